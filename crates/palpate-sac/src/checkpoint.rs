//! Saving and loading, so that learning goes on as if nothing had happened.
//!
//! | file | holds |
//! |---|---|
//! | `agent.safetensors` | every layer of every network as (inputs, outputs) weight and bias, Adam's moments, log α |
//! | `replay.safetensors` | the ring, one tensor per column; demonstrations and danger likewise, where there are any |
//! | `state.json` | configuration, counters, random streams |
//!
//! [`Sac::save_policy`] writes `agent.safetensors` with the actor alone; [`Policy::load`] reads
//! either. Files are written in place: whoever calls decides on temporary directories and syncing.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::learner::Learner;
use crate::mlp::Shape;
use crate::network::Network;
use crate::optimiser::Moments;
use crate::replay::Replay;
use crate::rng::Streams;
use crate::squash::LogStd;
use crate::tensors::{Reader, Writer};
use crate::{Policy, Sac, SacConfig, SacError};

const AGENT: &str = "agent.safetensors";
const REPLAY: &str = "replay.safetensors";
const STATE: &str = "state.json";
/// Raised whenever older files can no longer be read.
const FORMAT: u32 = 1;

/// What a reader of the actor needs to know beside its layers.
#[derive(Serialize, Deserialize)]
struct ActorHeader {
    format: u32,
    observation_dim: usize,
    action_dim: usize,
    hidden: Vec<usize>,
    log_std_min: f32,
    log_std_max: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    format: u32,
    observation_dim: usize,
    action_dim: usize,
    seed: u64,
    steps: u64,
    updates: u64,
    replay_next: usize,
    /// Files from before danger was kept apart hold none.
    #[serde(default)]
    danger_next: usize,
    adam_steps: AdamSteps,
    streams: Streams,
    config: SacConfig,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AdamSteps {
    actor: u64,
    critics: [u64; 2],
    log_alpha: u64,
}

impl Sac {
    /// Writes everything that learning depends on into an existing directory.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save(&self, directory: &Path) -> Result<(), SacError> {
        // No `..`: a field added later must be thought about here.
        let Self {
            config,
            observation_dim,
            action_dim,
            seed,
            learner,
            memory,
            streams,
            steps,
            updates,
            policy,
        } = self;

        let mut agent = Writer::new();
        write_layers(&mut agent, "actor", &learner.actor)?;
        for (i, (critic, target)) in learner.critics.iter().zip(&learner.targets).enumerate() {
            write_layers(&mut agent, CRITICS[i], critic)?;
            write_layers(&mut agent, TARGETS[i], target)?;
            write_moments(&mut agent, CRITICS[i], &learner.critic_moments[i]);
        }
        write_moments(&mut agent, "actor", &learner.actor_moments);
        write_moments(&mut agent, "log_alpha", &learner.alpha_moments);
        agent.f32("log_alpha", &[1], &learner.log_alpha.as_tensor().to_vec1()?);
        agent.save(&directory.join(AGENT), &actor_header(policy))?;

        let mut rings = Writer::new();
        write_ring(&mut rings, "", &memory.own);
        for (prefix, part) in [(SHOWN, &memory.demonstrations), (DANGER, &memory.danger)] {
            if part.replay.len() > 0 {
                write_ring(&mut rings, prefix, &part.replay);
            }
        }
        rings.save(&directory.join(REPLAY), &FORMAT)?;

        let state = State {
            format: FORMAT,
            observation_dim: *observation_dim,
            action_dim: *action_dim,
            seed: *seed,
            steps: *steps,
            updates: *updates,
            replay_next: memory.own.next,
            danger_next: memory.danger.replay.next,
            adam_steps: AdamSteps {
                actor: learner.actor_moments.steps,
                critics: [learner.critic_moments[0].steps, learner.critic_moments[1].steps],
                log_alpha: learner.alpha_moments.steps,
            },
            streams: streams.clone(),
            config: config.clone(),
        };
        let path = directory.join(STATE);
        let text = serde_json::to_vec_pretty(&state).map_err(|e| SacError::checkpoint(&path, e))?;
        std::fs::write(&path, text).map_err(|source| SacError::Io { path, source })
    }

    /// Reads what [`save`](Self::save) wrote; the agent goes on bit for bit.
    ///
    /// # Errors
    /// If a file is missing, cut short, of another format, or does not fit the others.
    pub fn load(directory: &Path) -> Result<Self, SacError> {
        Self::read(directory, None)
    }

    /// The same, with updates on this many threads ([`SacConfig::threads`](crate::SacConfig::threads)), which changes no
    /// result.
    ///
    /// # Errors
    /// As [`load`](Self::load), and for a number of threads that there cannot be.
    pub fn load_on(directory: &Path, threads: usize) -> Result<Self, SacError> {
        Self::read(directory, Some(threads))
    }

    fn read(directory: &Path, threads: Option<usize>) -> Result<Self, SacError> {
        let path = directory.join(STATE);
        let text =
            std::fs::read(&path).map_err(|source| SacError::Io { path: path.clone(), source })?;
        let mut state: State =
            serde_json::from_slice(&text).map_err(|e| SacError::checkpoint(&path, e))?;
        state.config.threads = threads.unwrap_or(state.config.threads);
        check_format(&path, state.format)?;
        let (o, a) = (state.observation_dim, state.action_dim);

        // A new agent has the right shapes; everything else about it is overwritten.
        let mut agent = Self::new(&state.config, o, a, state.seed)?;
        let reader = Reader::open(&directory.join(AGENT))?;
        let learner: &mut Learner = &mut agent.learner;
        read_layers(&reader, "actor", &learner.actor)?;
        for i in 0..2 {
            read_layers(&reader, CRITICS[i], &learner.critics[i])?;
            read_layers(&reader, TARGETS[i], &learner.targets[i])?;
            read_moments(
                &reader,
                CRITICS[i],
                state.adam_steps.critics[i],
                &mut learner.critic_moments[i],
            )?;
        }
        read_moments(&reader, "actor", state.adam_steps.actor, &mut learner.actor_moments)?;
        read_moments(&reader, "log_alpha", state.adam_steps.log_alpha, &mut learner.alpha_moments)?;
        let log_alpha = reader.f32("log_alpha", &[1])?;
        learner.log_alpha.set(&candle_core::Tensor::from_vec(
            log_alpha,
            1,
            &candle_core::Device::Cpu,
        )?)?;

        let reader = Reader::open(&directory.join(REPLAY))?;
        let memory = &mut agent.memory;
        read_ring(&reader, "", state.replay_next, &mut memory.own)?;
        for (prefix, part, next) in [
            (SHOWN, &mut memory.demonstrations, None),
            (DANGER, &mut memory.danger, Some(state.danger_next)),
        ] {
            let reward = format!("{prefix}reward");
            if reader.has(&reward)? {
                let next = next.map_or_else(|| reader.rows(&reward), Ok)?;
                read_ring(&reader, prefix, next, &mut part.replay)?;
            }
        }

        agent.policy = agent.learner.policy()?;
        Ok(Self { streams: state.streams, steps: state.steps, updates: state.updates, ..agent })
    }

    /// Writes the policy alone into an existing directory, for [`Policy::load`].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_policy(&self, directory: &Path) -> Result<(), SacError> {
        let mut actor = Writer::new();
        write_layers(&mut actor, "actor", &self.learner.actor)?;
        actor.save(&directory.join(AGENT), &actor_header(&self.policy))
    }
}

impl Policy {
    /// Reads the policy from a directory that [`Sac::save`] or [`Sac::save_policy`] wrote.
    ///
    /// # Errors
    /// If `agent.safetensors` is missing, cut short or of another format.
    pub fn load(directory: &Path) -> Result<Self, SacError> {
        let path = directory.join(AGENT);
        let reader = Reader::open(&path)?;
        let header: ActorHeader = reader.header()?;
        check_format(&path, header.format)?;
        if header.observation_dim == 0 || header.action_dim == 0 || header.hidden.contains(&0) {
            return Err(SacError::checkpoint(&path, "the header names an empty layer"));
        }
        let shape =
            Shape::new(header.observation_dim, &header.hidden, 2 * header.action_dim, false);
        let parameters = layers(&reader, "actor", &shape)?;
        Ok(Self::new(
            shape,
            LogStd { min: header.log_std_min, max: header.log_std_max },
            parameters,
        ))
    }
}

const CRITICS: [&str; 2] = ["critic_1", "critic_2"];
const TARGETS: [&str; 2] = ["target_1", "target_2"];
/// Before the columns of a part of the memory that is not the run's own.
const SHOWN: &str = "demonstrations.";
const DANGER: &str = "danger.";

fn write_ring(writer: &mut Writer, prefix: &str, ring: &Replay) {
    let (rows, o, a) = (ring.len(), ring.observation_dim, ring.action_dim);
    let name = |column: &str| format!("{prefix}{column}");
    writer.f32(&name("observation"), &[rows, o], &ring.observations);
    writer.f32(&name("action"), &[rows, a], &ring.actions);
    writer.f32(&name("executed"), &[rows, a], &ring.executed);
    writer.f32(&name("reward"), &[rows], &ring.rewards);
    writer.f32(&name("next_observation"), &[rows, o], &ring.next_observations);
    writer.u8(&name("terminal"), &[rows], &ring.terminals);
    writer.u8(&name("episode_end"), &[rows], &ring.episode_ends);
}

fn read_ring(
    reader: &Reader,
    prefix: &str,
    next: usize,
    ring: &mut Replay,
) -> Result<(), SacError> {
    let (capacity, o, a) = (ring.capacity, ring.observation_dim, ring.action_dim);
    let name = |column: &str| format!("{prefix}{column}");
    let rows = reader.rows(&name("reward"))?;
    let expected_next = if rows < capacity { next == rows } else { next < capacity };
    if rows > capacity || !expected_next {
        let reason =
            format!("{rows} transitions with the next at {next} do not fit a ring of {capacity}");
        return Err(reader.malformed(&reason));
    }
    ring.next = next;
    ring.observations = reader.f32(&name("observation"), &[rows, o])?;
    ring.actions = reader.f32(&name("action"), &[rows, a])?;
    ring.executed = reader.f32(&name("executed"), &[rows, a])?;
    ring.rewards = reader.f32(&name("reward"), &[rows])?;
    ring.next_observations = reader.f32(&name("next_observation"), &[rows, o])?;
    ring.terminals = reader.u8(&name("terminal"), &[rows])?;
    ring.episode_ends = reader.u8(&name("episode_end"), &[rows])?;
    Ok(())
}

fn actor_header(policy: &Policy) -> ActorHeader {
    let layers = policy.shape().layers();
    ActorHeader {
        format: FORMAT,
        observation_dim: policy.observation_dim(),
        action_dim: policy.action_dim(),
        hidden: layers[..layers.len() - 1].iter().map(|l| l.outputs).collect(),
        log_std_min: policy.bounds().min,
        log_std_max: policy.bounds().max,
    }
}

fn check_format(path: &Path, format: u32) -> Result<(), SacError> {
    if format == FORMAT {
        Ok(())
    } else {
        Err(SacError::checkpoint(
            path,
            format!("format {format}; this version reads format {FORMAT}"),
        ))
    }
}

fn write_layers(writer: &mut Writer, name: &str, network: &Network) -> Result<(), SacError> {
    let parameters = network.parameters()?;
    for (i, layer) in network.shape().layers().iter().enumerate() {
        writer.f32(
            &format!("{name}.{i}.weight"),
            &[layer.inputs, layer.outputs],
            &parameters[layer.weight.clone()],
        );
        writer.f32(&format!("{name}.{i}.bias"), &[layer.outputs], &parameters[layer.bias.clone()]);
    }
    Ok(())
}

fn read_layers(reader: &Reader, name: &str, network: &Network) -> Result<(), SacError> {
    Ok(network.assign(layers(reader, name, network.shape())?)?)
}

/// The flat parameters of a network.
fn layers(reader: &Reader, name: &str, shape: &Shape) -> Result<Vec<f32>, SacError> {
    let mut parameters = Vec::with_capacity(shape.parameters());
    for (i, layer) in shape.layers().iter().enumerate() {
        parameters
            .extend(reader.f32(&format!("{name}.{i}.weight"), &[layer.inputs, layer.outputs])?);
        parameters.extend(reader.f32(&format!("{name}.{i}.bias"), &[layer.outputs])?);
    }
    Ok(parameters)
}

fn write_moments(writer: &mut Writer, name: &str, moments: &Moments) {
    let Moments { first, second, steps: _ } = moments;
    writer.f32(&format!("adam.{name}.first"), &[first.len()], first);
    writer.f32(&format!("adam.{name}.second"), &[second.len()], second);
}

fn read_moments(
    reader: &Reader,
    name: &str,
    steps: u64,
    moments: &mut Moments,
) -> Result<(), SacError> {
    let size = moments.first.len();
    moments.first = reader.f32(&format!("adam.{name}.first"), &[size])?;
    moments.second = reader.f32(&format!("adam.{name}.second"), &[size])?;
    moments.steps = steps;
    Ok(())
}
