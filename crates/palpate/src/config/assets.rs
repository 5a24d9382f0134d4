//! What is compiled into the binary: presets, tasks, policy models, studies, robots.

use anyhow::bail;
use palpate_runs::config::nearest;

macro_rules! assets {
    ($folder:literal, $extension:literal: $($name:literal),+ $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../assets/", $folder, "/", $name, ".", $extension)))),+]
    };
}

/// Named texts compiled into the binary.
pub type Assets = &'static [(&'static str, &'static str)];

/// Presets, by name.
pub const PRESETS: Assets = assets!("presets", "toml": "palpate", "paper");
/// Tasks, by name.
pub const TASKS: Assets = assets!(
    "tasks", "toml": "peg-insertion", "peg-insertion-sharp", "ring-insertion", "pulley-insertion"
);
/// Policy models, by name.
pub const MODELS: Assets = assets!("policies", "toml": "p-6", "p-9", "p-14", "p-19", "p-24", "a-8", "a-13", "a-13pd", "a-18");
/// Studies, by name.
pub const STUDIES: Assets = assets!("studies", "toml": "paper", "learner", "tight", "conditions");
/// Robot descriptions, by name.
pub const ROBOTS: Assets = assets!("robots", "urdf": "ur3e", "ur5e", "ur10e");

/// Finds a named text, or says which exist.
pub fn asset(kind: &str, assets: Assets, name: &str) -> anyhow::Result<&'static str> {
    let wanted = name.to_lowercase();
    if let Some((_, text)) = assets.iter().find(|(n, _)| *n == wanted) {
        return Ok(text);
    }
    let names: Vec<&str> = assets.iter().map(|(n, _)| *n).collect();
    match nearest(&wanted, names.iter().copied()) {
        Some(near) => bail!(
            "there is no {kind} `{name}`; did you mean `{near}`? There are: {}",
            names.join(", ")
        ),
        None => bail!("there is no {kind} `{name}`. There are: {}", names.join(", ")),
    }
}
