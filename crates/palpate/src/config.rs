//! One resolved configuration: preset + task + policy model + file + overrides.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use palpate_control::{ControlConfig, ForceLoop, PolicyModel};
use palpate_env::{EnvConfig, Reference, RewardConfig, TaskConfig};
use palpate_runs::config::{Layer, parse, resolve};
use palpate_sac::SacConfig;
use palpate_safety::SafetyConfig;
use palpate_sim::{SimArm, SimConfig};
use palpate_ur::UrConfig;

use crate::record::RecordConfig;

mod assets;

pub use assets::{Assets, MODELS, PRESETS, ROBOTS, STUDIES, TASKS, asset};

/// Tables with optional keys.
const OPEN: &[&str] = &["policy", "ur"];

/// What an arm gets whatever the preset: the shield, and a reaction time that knows a UR's delay.
const ON_AN_ARM: [(&str, &str); 2] =
    [("safety.mode", "\"shield\""), ("safety.shield.force.reaction_time", ARM_REACTION)];

/// Until a brake begins to work on a UR, s: 34 ms of servo at a lookahead of 30 ms, and 20 ms for filter, two periods and
/// turns, as in the preset behind its 10 ms.
const ARM_REACTION: &str = "0.055";

/// Evaluations cost an arm's time: about 5 s an episode with the way back.
const EVALUATED_ON_AN_ARM: [(&str, u64); 2] = [("evaluate_every", 2000), ("evaluate_episodes", 10)];

/// Of every batch, where there are demonstrations: Ball et al. 2023.
const SHARE: f64 = 0.5;

/// What a UR's drives add to servoj's lookahead, s: 34 ms were measured at a lookahead of 30 ms
/// (Universal_Robots_Client_Library, issue 86).
pub(crate) const DRIVE_LAG: f64 = 0.004;

/// Everything a run depends on.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Length, seed and rhythm of the run.
    pub run: RunConfig,
    /// The arm.
    pub robot: RobotConfig,
    /// The task.
    pub task: TaskConfig,
    /// Which gains the policy moves.
    pub policy: PolicyModel,
    /// The control laws.
    pub control: ControlConfig,
    /// The fail-safe layer.
    pub safety: SafetyConfig,
    /// The environment.
    pub env: EnvConfig,
    /// The reward.
    pub reward: RewardConfig,
    /// The learner.
    pub sac: SacConfig,
    /// The simulator.
    pub sim: SimConfig,
    /// Which episodes of a training are recorded; a run without the key is from before there were recordings.
    #[serde(default)]
    pub record: RecordConfig,
    /// The real arm, for the commands that move one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ur: Option<UrConfig>,
}

/// Length, seed and rhythm of a run.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Every random number of the run comes from it.
    pub seed: u64,
    /// Environment steps.
    pub steps: u64,
    /// Steps between evaluations.
    pub evaluate_every: u64,
    /// Episodes per evaluation.
    pub evaluate_episodes: u64,
    /// Steps between checkpoints.
    pub checkpoint_every: u64,
    /// Steps between rows of metrics.csv.
    pub log_every: u64,
}

/// The arm.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// A built-in name or a path to a URDF file.
    pub urdf: String,
    /// Base link.
    pub base_link: String,
    /// Link that carries the force/torque sensor and the tool.
    pub tip_link: String,
    /// Tool centre point in tip axes, m.
    pub tcp: [f64; 3],
}

/// What the command line says about the configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Preset name.
    pub preset: String,
    /// Task name.
    pub task: String,
    /// Policy model name.
    pub model: String,
    /// A TOML file with keys that override the preset.
    pub file: Option<PathBuf>,
    /// `key.path=value` overrides; they win over the file.
    pub set: Vec<String>,
}

impl Config {
    /// Resolves a choice.
    pub fn load(choice: &Choice) -> anyhow::Result<Self> {
        Self::resolve(choice, None, false)
    }

    /// The same for a run that learns from demonstrations as well, on an arm if there is one.
    pub(crate) fn load_shown(choice: &Choice, arm: Option<&UrConfig>) -> anyhow::Result<Self> {
        Self::resolve(choice, arm, true)
    }

    /// Resolves a choice for an arm; its settings are the keys below `ur`.
    pub fn load_for(choice: &Choice, arm: &UrConfig) -> anyhow::Result<Self> {
        Self::resolve(choice, Some(arm), false)
    }

    fn resolve(choice: &Choice, arm: Option<&UrConfig>, shown: bool) -> anyhow::Result<Self> {
        let policy =
            format!("[policy]\n{}", nest(asset("policy model", MODELS, &choice.model)?, "policy"));
        let mut base = Layer {
            name: format!(
                "preset {} + task {} + model {}",
                choice.preset, choice.task, choice.model
            ),
            text: format!(
                "{}\n{}\n{policy}\n{}",
                asset("preset", PRESETS, &choice.preset)?,
                asset("task", TASKS, &choice.task)?,
                arm.map_or(Ok(String::new()), arm_text)?,
            ),
        };
        let mut layers = Vec::new();
        if arm.is_some() {
            let keys = EVALUATED_ON_AN_ARM.map(|(key, value)| format!("{key} = {value}\n"));
            layers.push(Layer {
                name: "the default on an arm".into(),
                text: format!("[run]\n{}", keys.concat()),
            });
        }
        if arm.is_some() && base.text.contains("[safety.shield]") {
            let keys = ON_AN_ARM.map(|(key, value)| format!("{key} = {value}\n"));
            layers.push(Layer { name: "the default on an arm".into(), text: keys.concat() });
        }
        if shown {
            layers.push(Layer {
                name: "the default with demonstrations".into(),
                text: format!("[sac]\ndemonstration_share = {SHARE}\n"),
            });
        }
        let file = choice.file.as_deref().map(file_layer).transpose()?;
        // A cell's file is for the simulation as well, which has no arm: its keys are checked and left out.
        let idle = arm.is_none() && file.as_ref().is_some_and(|file| names_an_arm(&file.text));
        if idle {
            base.text += &arm_text(&UrConfig::at(""))?;
        }
        layers.extend(file);
        let mut set: Vec<String> = arm.map_or_else(Vec::new, place_of);
        set.extend_from_slice(&choice.set);
        not_by_name(&set, || Some(choice.task.to_lowercase()))?;
        let resolved = resolve(&base, &layers, &set, OPEN)?;
        let mut config: Self = parse(resolved)?;
        if idle {
            config.ur = None;
        }
        config.validate()?;
        Ok(config)
    }

    /// Reads the resolved configuration of a run, changed by `set`.
    pub fn of_run(dir: &Path, set: &[String]) -> anyhow::Result<Self> {
        Self::reread(dir, None, None, set)
    }

    /// The same, with the keys of a file between the run's and `set`.
    pub fn of_run_with(dir: &Path, file: Option<&Path>, set: &[String]) -> anyhow::Result<Self> {
        Self::reread(dir, None, file, set)
    }

    /// The same for an arm. A run that was made on one keeps its settings, but not where it was. The keys of `file`
    /// override the run's.
    pub fn of_run_for(
        dir: &Path,
        arm: &UrConfig,
        file: Option<&Path>,
        set: &[String],
    ) -> anyhow::Result<Self> {
        Self::reread(dir, Some(arm), file, set)
    }

    fn reread(
        dir: &Path,
        arm: Option<&UrConfig>,
        file: Option<&Path>,
        set: &[String],
    ) -> anyhow::Result<Self> {
        let path = dir.join("config.toml");
        let mut text = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}: is this a run?", path.display()))?;
        let mut set = set.to_vec();
        if let Some(arm) = arm {
            if names_an_arm(&text) {
                set.splice(0..0, place_of(arm));
            } else {
                if text.contains("[safety.shield]") {
                    let keys = ON_AN_ARM.map(|(key, value)| format!("{key}={value}"));
                    set.splice(0..0, keys);
                }
                for (key, value) in EVALUATED_ON_AN_ARM {
                    set.insert(0, format!("run.{key}={value}"));
                }
                text += &arm_text(arm)?;
            }
        }
        let name = path.display().to_string();
        let file = file.map(file_layer).transpose()?;
        let idle = !names_an_arm(&text) && file.as_ref().is_some_and(|f| names_an_arm(&f.text));
        if idle {
            text += &arm_text(&UrConfig::at(""))?;
        }
        let layers: Vec<Layer> = file.into_iter().collect();
        let read = |layers: &[Layer], set: &[String]| -> anyhow::Result<Self> {
            let base = Layer { name: name.clone(), text: text.clone() };
            let mut config: Self = parse(resolve(&base, layers, set, OPEN)?)?;
            if idle {
                config.ur = None;
            }
            config.validate()?;
            Ok(config)
        };
        not_by_name(&set, || read(&[], &[]).ok().map(|run| run.task.name))?;
        read(&layers, &set).map_err(|error| {
            if read(&[], &[]).is_ok() {
                return error; // What was laid over the run's own text is to blame.
            }
            error.context(format!(
                "{name} cannot be used; each of the run's checkpoints holds a copy"
            ))
        })
    }

    /// The configuration as TOML, every key stated.
    pub fn to_toml(&self) -> anyhow::Result<String> {
        toml::to_string(self).context("cannot write the configuration as TOML")
    }

    /// What is allowed and unwise: corners of the gain ranges where a loop does not settle, in the simulated
    /// arm's servo, sensor and control period.
    pub fn warnings(&self) -> Vec<String> {
        let period = SimArm::PERIOD.as_secs_f64();
        let mut warnings = self.policy.warnings(&self.control, period);
        let force_loop = ForceLoop {
            cutoff: self.safety.force_filter_cutoff,
            // servoj filters with its lookahead; the drives' own share is what is left of measured delays.
            servo_lag: self.ur.as_ref().map_or(self.sim.servo.lag, |ur| ur.lookahead + DRIVE_LAG),
            rebased: self.env.reference == Reference::Measured,
            period,
        };
        let contact = self.sim.compliance.linear_stiffness;
        warnings.extend(self.policy.contact_warnings(&self.control, contact, &force_loop));
        by_axes(warnings.iter().map(ToString::to_string))
    }

    fn validate(&self) -> anyhow::Result<()> {
        for (key, value) in [
            ("run.steps", self.run.steps),
            ("run.evaluate_every", self.run.evaluate_every),
            ("run.evaluate_episodes", self.run.evaluate_episodes),
            ("run.checkpoint_every", self.run.checkpoint_every),
            ("run.log_every", self.run.log_every),
        ] {
            if value == 0 {
                bail!("{key} is 0, but it must be positive");
            }
        }
        self.policy.validate(&self.control)?;
        self.sac.validate()?;
        self.sim.validate()?;
        self.record.validate()?;
        if let Some(ur) = &self.ur {
            ur.validate()?;
        }
        let tip = self.robot.tcp;
        if tip[0] != 0.0 || tip[1] != 0.0 || (tip[2] - self.sim.tool.length).abs() > 1e-12 {
            bail!(
                "robot.tcp is {tip:?}, but the simulated tool is sim.tool.length = {} m long: the tool centre point must be its tip",
                self.sim.tool.length
            );
        }
        Ok(())
    }
}

/// Says once what differs in its axis alone: "axis x: …" and "axis y: …" become "axes x, y: …".
fn by_axes(warnings: impl Iterator<Item = String>) -> Vec<String> {
    let mut groups: Vec<(Vec<String>, String)> = Vec::new();
    for warning in warnings {
        let (axis, what) = match warning.strip_prefix("axis ").and_then(|w| w.split_once(": ")) {
            Some((axis, what)) => (axis.to_owned(), what.to_owned()),
            None => (String::new(), warning),
        };
        match groups.iter_mut().find(|(_, known)| *known == what) {
            Some((axes, _)) => axes.push(axis),
            None => groups.push((vec![axis], what)),
        }
    }
    let sentence = |(axes, what): (Vec<String>, String)| match axes.as_slice() {
        [axis] if axis.is_empty() => what,
        [axis] => format!("axis {axis}: {what}"),
        axes => format!("axes {}: {what}", axes.join(", ")),
    };
    groups.into_iter().map(sentence).collect()
}

/// Refuses to give a task the name of another built-in one, which would change nothing else.
fn not_by_name(set: &[String], task: impl Fn() -> Option<String>) -> anyhow::Result<()> {
    let names = set.iter().filter_map(|entry| entry.split_once('='));
    for (_, name) in names.filter(|(key, _)| key.trim() == "task.name") {
        let name = name.trim().trim_matches(['"', '\'']);
        let known = TASKS.iter().any(|(known, _)| *known == name);
        if let Some(task) = task().filter(|task| known && name != *task) {
            bail!(
                "task.name={name} would not make {task} that task: choose it with --task {name}, or, going on from another run, with --config assets/tasks/{name}.toml"
            );
        }
    }
    Ok(())
}

/// Where the arm is, as overrides: the command line says it, whatever files say.
fn place_of(arm: &UrConfig) -> Vec<String> {
    vec![format!("ur.host={:?}", arm.host), format!("ur.ports.rtde={}", arm.ports.rtde)]
}

/// A user's file.
fn file_layer(path: &Path) -> anyhow::Result<Layer> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the config file {}", path.display()))?;
    Ok(Layer { name: path.display().to_string(), text })
}

/// Whether a text has the table `[ur]`.
fn names_an_arm(text: &str) -> bool {
    toml::from_str::<toml::Table>(text).is_ok_and(|table| table.contains_key("ur"))
}

/// An arm's settings as the table `[ur]`.
fn arm_text(arm: &UrConfig) -> anyhow::Result<String> {
    let text = toml::to_string(arm).context("cannot write the arm's settings as TOML")?;
    Ok(format!("\n[ur]\n{}", nest(&text, "ur")))
}

/// Puts a text's tables below `parent`: `[gains.force]` becomes `[parent.gains.force]`.
fn nest(text: &str, parent: &str) -> String {
    text.lines()
        .map(|line| match line.strip_prefix('[') {
            Some(rest) if !line.starts_with("[[") => format!("[{parent}.{rest}\n"),
            _ => format!("{line}\n"),
        })
        .collect()
}

#[cfg(test)]
mod tests;
