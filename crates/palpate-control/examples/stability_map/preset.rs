//! The presets and the policy models, as the repository has them.

use std::path::PathBuf;

use anyhow::Context as _;
use palpate_control::{ActionMap, ControlConfig, ForceLoop, Gains, PolicyModel};

use crate::press::Press;

/// Table I of the paper, its order.
pub(crate) const MODELS: [&str; 8] =
    ["p-9", "p-14", "p-19", "p-24", "a-8", "a-13", "a-13pd", "a-18"];

/// What of the preset makes the force loop.
#[derive(Clone, Debug)]
pub(crate) struct Preset {
    pub(crate) control: ControlConfig,
    pub(crate) force_loop: ForceLoop,
    /// Of tool, sensor and arm in series, N/m.
    pub(crate) stiffness: f64,
    /// N s/m.
    pub(crate) damping: f64,
}

pub(crate) fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn read(path: &str) -> anyhow::Result<toml::Table> {
    let path = root().join(path);
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    text.parse().with_context(|| format!("cannot parse {}", path.display()))
}

impl Preset {
    /// `assets/presets/NAME.toml`.
    pub(crate) fn load(name: &str) -> anyhow::Result<Self> {
        let table = read(&format!("assets/presets/{name}.toml"))?;
        let reference = table
            .get("env")
            .and_then(|env| env.get("reference")?.as_str())
            .context("the preset has no env.reference")?;
        let number = |path: &[&str]| {
            let (key, tables) = path.split_last().context("no key")?;
            tables
                .iter()
                .try_fold(&table, |table, name| table.get(*name)?.as_table())
                .and_then(|table| table.get(*key)?.as_float())
                .with_context(|| format!("the preset has no number {}", path.join(".")))
        };
        Ok(Self {
            control: table
                .get("control")
                .context("the preset has no control")?
                .clone()
                .try_into()?,
            force_loop: ForceLoop {
                cutoff: number(&["safety", "force_filter_cutoff"])?,
                servo_lag: number(&["sim", "servo", "lag"])?,
                rebased: reference == "measured",
                period: 0.002,
            },
            stiffness: number(&["sim", "compliance", "linear_stiffness"])?,
            damping: number(&["sim", "compliance", "linear_damping"])?,
        })
    }

    /// A press in the preset's contact with another damper.
    pub(crate) fn press(&self, damping: f64) -> Press {
        Press { stiffness: self.stiffness, damping, force_loop: self.force_loop }
    }
}

pub(crate) fn model(name: &str) -> anyhow::Result<PolicyModel> {
    Ok(read(&format!("assets/policies/{name}.toml"))?.try_into()?)
}

/// Gains at every corner of the ranges along z: components of the action that move them, each at ±1.
pub(crate) fn corners(model: &PolicyModel) -> anyhow::Result<Vec<Gains>> {
    let map = ActionMap::new(model)?;
    let moves_z = |label: &String| match label.split_once('.') {
        Some((gain, axis)) => gain != "motion" && axis == "z",
        None => true,
    };
    let components: Vec<usize> = map
        .labels()
        .iter()
        .enumerate()
        .filter(|(_, label)| moves_z(label))
        .map(|(i, _)| i)
        .collect();
    (0..1 << components.len())
        .map(|corner: usize| {
            let mut action = vec![0.0; map.dim()];
            for (bit, &component) in components.iter().enumerate() {
                action[component] = if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            }
            Ok(map.decode(&action)?.gains)
        })
        .collect()
}
