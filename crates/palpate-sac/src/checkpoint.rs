//! Saving and loading, so that learning goes on as if nothing had happened.
//!
//! | file | holds |
//! |---|---|
//! | `agent.safetensors` | every layer of every network as (inputs, outputs) weight and bias, Adam's moments, log α |
//! | `replay.safetensors` | the ring, one tensor per column |
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
            replay,
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

        let mut ring = Writer::new();
        let Replay { capacity: _, observation_dim: _, action_dim: _, next, .. } = replay;
        let (rows, o, a) = (replay.len(), *observation_dim, *action_dim);
        ring.f32("observation", &[rows, o], &replay.observations);
        ring.f32("action", &[rows, a], &replay.actions);
        ring.f32("executed", &[rows, a], &replay.executed);
        ring.f32("reward", &[rows], &replay.rewards);
        ring.f32("next_observation", &[rows, o], &replay.next_observations);
        ring.u8("terminal", &[rows], &replay.terminals);
        ring.u8("episode_end", &[rows], &replay.episode_ends);
        ring.save(&directory.join(REPLAY), &FORMAT)?;

        let state = State {
            format: FORMAT,
            observation_dim: o,
            action_dim: a,
            seed: *seed,
            steps: *steps,
            updates: *updates,
            replay_next: *next,
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
        let path = directory.join(STATE);
        let text =
            std::fs::read(&path).map_err(|source| SacError::Io { path: path.clone(), source })?;
        let state: State =
            serde_json::from_slice(&text).map_err(|e| SacError::checkpoint(&path, e))?;
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

        let path = directory.join(REPLAY);
        let reader = Reader::open(&path)?;
        let rows = reader.rows("reward")?;
        let replay = &mut agent.replay;
        let (capacity, next) = (replay.capacity, state.replay_next);
        let expected_next = if rows < capacity { next == rows } else { next < capacity };
        if rows > capacity || !expected_next {
            let reason = format!(
                "{rows} transitions with the next at {next} do not fit a ring of {capacity}"
            );
            return Err(SacError::checkpoint(&path, reason));
        }
        replay.next = next;
        replay.observations = reader.f32("observation", &[rows, o])?;
        replay.actions = reader.f32("action", &[rows, a])?;
        replay.executed = reader.f32("executed", &[rows, a])?;
        replay.rewards = reader.f32("reward", &[rows])?;
        replay.next_observations = reader.f32("next_observation", &[rows, o])?;
        replay.terminals = reader.u8("terminal", &[rows])?;
        replay.episode_ends = reader.u8("episode_end", &[rows])?;

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
