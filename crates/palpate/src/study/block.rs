//! A block of a study file: every combination of what its lists hold.

use anyhow::{Context as _, bail};
use toml::{Table, Value};

use super::plan::{Kind, Planned, Study, settings, slug};

/// Every combination of what its lists hold.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Block {
    pub(super) name: String,
    task: Many<String>,
    model: Many<String>,
    /// `learned`, or a baseline: `zero`, `random`, `scripted`.
    #[serde(default = "learned")]
    policy: Many<Kind>,
    /// Whether a violation is punished (κ = −10) or not (κ = 0).
    #[serde(default = "punished")]
    penalty: Many<bool>,
    #[serde(default = "first")]
    seeds: Many<u64>,
    /// Environment steps of a learned policy.
    #[serde(default)]
    steps: u64,
    /// Successful episodes of the script that a learned policy is shown; recorded with the run's seed.
    #[serde(default)]
    demonstrations: u64,
    /// Settings of this block.
    #[serde(default)]
    set: Table,
    /// Keys with lists of values to try.
    #[serde(default)]
    vary: Table,
}

/// One value, or a list of them.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(
    untagged,
    expecting = "expected a value or a list of values (policy: learned, zero, random, scripted)"
)]
enum Many<T> {
    One(T),
    List(Vec<T>),
}

impl<T: Clone> Many<T> {
    fn list(&self) -> Vec<T> {
        match self {
            Self::One(value) => vec![value.clone()],
            Self::List(values) => values.clone(),
        }
    }
}

fn learned() -> Many<Kind> {
    Many::One(Kind::Learned)
}

fn punished() -> Many<bool> {
    Many::One(true)
}

fn first() -> Many<u64> {
    Many::One(1)
}

impl Block {
    pub(super) fn seeds(&self) -> Vec<u64> {
        self.seeds.list()
    }

    /// Its runs with one seed.
    pub(super) fn runs(
        &self,
        study: &Study,
        seed: u64,
        all: &mut Vec<Planned>,
    ) -> anyhow::Result<()> {
        let set = [settings(&study.set), settings(&self.set)].concat();
        let (tasks, models) = (self.task.list(), self.model.list());
        let (kinds, penalties) = (self.policy.list(), self.penalty.list());
        if self.demonstrations > 0 && !kinds.contains(&Kind::Learned) {
            bail!("block {}: nothing in it learns from `demonstrations`", self.name);
        }
        for task in &tasks {
            for varied in self.variations()? {
                for model in &models {
                    for kind in &kinds {
                        for penalty in &penalties {
                            let (steps, demonstrations) = match kind {
                                Kind::Learned if self.steps == 0 => {
                                    bail!("block {}: `steps` is missing", self.name)
                                }
                                Kind::Learned => (self.steps, self.demonstrations),
                                _ => (0, 0),
                            };
                            let mut words = vec![self.name.clone()];
                            words.extend((tasks.len() > 1).then(|| task.clone()));
                            words.push(model.clone());
                            words.extend((*kind != Kind::Learned).then(|| format!("{kind:?}")));
                            if penalties.len() > 1 {
                                words.push(if *penalty { "penalty" } else { "free" }.into());
                            }
                            words.extend(varied.iter().map(|(key, value)| {
                                let key = key.rsplit('.').next().unwrap_or_default();
                                format!("{key}-{value}")
                            }));
                            words.push(format!("s{seed}"));
                            all.push(Planned {
                                id: slug(&words.join("_")),
                                block: self.name.clone(),
                                task: task.clone(),
                                model: model.clone(),
                                kind: *kind,
                                penalty: *penalty,
                                seed,
                                steps,
                                demonstrations,
                                varied: varied.clone(),
                                preset: study.preset.clone(),
                                set: set.clone(),
                            });
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Every combination of the varied keys' values; one empty one if there are none.
    fn variations(&self) -> anyhow::Result<Vec<Vec<(String, String)>>> {
        let mut combinations = vec![Vec::new()];
        let mut keys = Vec::new();
        lists("", &self.vary, &mut keys).with_context(|| format!("block {}: `vary`", self.name))?;
        for (key, values) in keys {
            let with = |before: &Vec<(String, String)>| -> Vec<_> {
                let add = |value: &Value| {
                    let mut all = before.clone();
                    all.push((key.clone(), value.to_string()));
                    all
                };
                values.iter().map(add).collect()
            };
            combinations = combinations.iter().flat_map(with).collect();
        }
        Ok(combinations)
    }
}

/// Keys that hold a list.
fn lists(prefix: &str, table: &Table, found: &mut Vec<(String, Vec<Value>)>) -> anyhow::Result<()> {
    for (key, value) in table {
        let key = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Table(inner) => lists(&key, inner, found)?,
            Value::Array(values) if !values.is_empty() => found.push((key, values.clone())),
            _ => bail!("{key} must be a list of the values to try"),
        }
    }
    Ok(())
}
