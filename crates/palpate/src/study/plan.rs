//! A study file, and the runs it stands for: a pure function of the file.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use toml::{Table, Value};

use crate::Config;
use crate::config::{Choice, STUDIES};
use crate::flat::flat;

/// A study, as its file says it.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Study {
    /// Names the folder.
    pub(super) name: String,
    /// What it is for, in a sentence.
    #[serde(default)]
    pub(super) about: String,
    #[serde(default = "default_preset")]
    preset: String,
    /// Settings of all runs.
    #[serde(default)]
    set: Table,
    /// How a finished run is judged.
    #[serde(default)]
    pub(super) evaluation: Judging,
    /// Blocks of runs.
    runs: Vec<Block>,
}

fn default_preset() -> String {
    "palpate".into()
}

/// How a finished run is judged: on the same fresh episodes as `evaluate`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Judging {
    /// Episodes, with the last and with the kept policy, the mean action and sampled ones.
    pub(super) episodes: u64,
    /// Their seed.
    pub(super) seed: u64,
}

impl Default for Judging {
    fn default() -> Self {
        Self { episodes: 100, seed: crate::evaluate::DEFAULT_SEED }
    }
}

/// Every combination of what its lists hold.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Block {
    name: String,
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
    /// Settings of this block.
    #[serde(default)]
    set: Table,
    /// Keys with lists of values to try.
    #[serde(default)]
    vary: Table,
}

/// One value, or a list of them.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(untagged)]
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

/// What acts.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Kind {
    /// A policy, trained.
    Learned,
    /// a = 0: the force controller alone.
    Zero,
    /// Uniform random actions.
    Random,
    /// Align, descend, spiral search on contact, with force control.
    Scripted,
}

/// One run of a study.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Planned {
    /// Its name, a folder's.
    pub(super) id: String,
    pub(super) block: String,
    pub(super) task: String,
    pub(super) model: String,
    pub(super) kind: Kind,
    pub(super) penalty: bool,
    pub(super) seed: u64,
    pub(super) steps: u64,
    /// What its block tries: key and value.
    pub(super) varied: Vec<(String, String)>,
    preset: String,
    set: Vec<String>,
}

impl Planned {
    /// What `varied` says, in a word.
    pub(super) fn variation(&self) -> String {
        let pairs: Vec<_> = self.varied.iter().map(|(k, v)| format!("{k}={v}")).collect();
        pairs.join(" ")
    }

    /// What to load the configuration from, with more `set` over it.
    pub(super) fn choice(&self, more: &[String]) -> Choice {
        let mut set = self.set.clone();
        if !self.penalty {
            set.push("reward.violation=0.0".into());
        }
        set.extend(self.varied.iter().map(|(key, value)| format!("{key}={value}")));
        set.push(format!("run.seed={}", self.seed));
        if self.kind == Kind::Learned {
            set.push(format!("run.steps={}", self.steps));
        }
        set.extend_from_slice(more);
        Choice {
            preset: self.preset.clone(),
            task: self.task.clone(),
            model: self.model.clone(),
            file: None,
            set,
        }
    }
}

/// The text of a study: of a file, or of one that is built in.
pub(super) fn text(name: &Path) -> anyhow::Result<String> {
    if let Some((_, text)) = STUDIES.iter().find(|(known, _)| Path::new(known) == name) {
        return Ok((*text).to_owned());
    }
    let known: Vec<&str> = STUDIES.iter().map(|(name, _)| *name).collect();
    std::fs::read_to_string(name).with_context(|| {
        format!("cannot read the study {} (built in: {})", name.display(), known.join(", "))
    })
}

impl Study {
    pub(super) fn parse(text: &str) -> anyhow::Result<Self> {
        let study: Self = toml::from_str(text).context("this is no study file")?;
        ensure!(
            slug(&study.name) == study.name,
            "the study's name {:?} names a folder: letters, digits, - and _",
            study.name
        );
        Ok(study)
    }

    /// Its runs, seed after seed: half a study is a whole one with fewer seeds.
    ///
    /// # Errors
    /// If a setting is wrong, naming the run, or if two runs would be the same.
    pub(super) fn plan(&self) -> anyhow::Result<Vec<Planned>> {
        let mut all = Vec::new();
        for block in &self.runs {
            for seed in block.seeds.list() {
                block.runs(self, seed, &mut all)?;
            }
        }
        for (i, run) in all.iter().enumerate() {
            if all.iter().take(i).any(|other: &Planned| other.id == run.id) {
                bail!(
                    "the study has two runs called {}: give their blocks different names",
                    run.id
                );
            }
            Config::load(&run.choice(&[])).with_context(|| format!("run {}", run.id))?;
        }
        ensure!(!all.is_empty(), "the study has no runs");
        Ok(all)
    }
}

impl Block {
    fn runs(&self, study: &Study, seed: u64, all: &mut Vec<Planned>) -> anyhow::Result<()> {
        let settings = |table: &Table| -> Vec<String> {
            flat(table).into_iter().map(|(key, value)| format!("{key}={value}")).collect()
        };
        let set = [settings(&study.set), settings(&self.set)].concat();
        let (tasks, models) = (self.task.list(), self.model.list());
        let (kinds, penalties) = (self.policy.list(), self.penalty.list());
        for task in &tasks {
            for varied in self.variations()? {
                for model in &models {
                    for kind in &kinds {
                        for penalty in &penalties {
                            if *kind == Kind::Learned && self.steps == 0 {
                                bail!("block {}: `steps` is missing", self.name);
                            }
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
                                steps: if *kind == Kind::Learned { self.steps } else { 0 },
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

/// A name as a folder's: everything but letters, digits, `-`, `_` and `.` becomes `-`.
fn slug(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    name.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
name = "small"
set = { "sac.gamma" = 0.9, sac.hidden = [64, 64] }
[[runs]]
name = "peg"
task = "peg-insertion"
model = ["P-9", "A-13pd"]
penalty = [true, false]
seeds = [1, 2]
steps = 500
[[runs]]
name = "filter"
task = "peg-insertion"
model = "P-14"
seeds = [7]
steps = 300
vary = { safety.force_filter_cutoff = [2.5, 50.0], "safety.force_max" = [20.0, 25.0] }
[[runs]]
name = "base"
task = ["peg-insertion", "ring-insertion"]
model = "P-14"
policy = ["zero", "scripted"]
"#;

    #[test]
    fn a_study_is_every_combination_seed_after_seed() {
        let plan = Study::parse(TEXT).unwrap().plan().unwrap();
        let ids: Vec<&str> = plan.iter().map(|run| run.id.as_str()).collect();
        assert_eq!(ids.len(), 2 * 2 * 2 + 4 + 4);
        assert_eq!(
            ids[..4],
            [
                "peg_P-9_penalty_s1",
                "peg_P-9_free_s1",
                "peg_A-13pd_penalty_s1",
                "peg_A-13pd_free_s1"
            ]
        );
        assert_eq!(ids[4], "peg_P-9_penalty_s2");
        assert_eq!(ids[8], "filter_P-14_force_filter_cutoff-2.5_force_max-20.0_s7");
        assert_eq!(ids[12], "base_peg-insertion_P-14_Zero_s1");
        let config = Config::load(&plan[1].choice(&[])).unwrap();
        assert_eq!((config.reward.violation, config.run.seed, config.run.steps), (0.0, 1, 500));
        assert_eq!((config.sac.gamma, config.sac.hidden.as_slice()), (0.9, &[64, 64][..]));
        let config = Config::load(&plan[9].choice(&[])).unwrap();
        assert_eq!((config.safety.force_filter_cutoff, config.safety.force_max), (2.5, 25.0));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let said = |text: &str| {
            let study = Study::parse(text);
            format!("{:#}", study.and_then(|study| study.plan()).unwrap_err())
        };
        assert!(said(&TEXT.replace("sac.gamma", "sac.gama")).contains("gamma"));
        assert!(said(&TEXT.replace("steps = 500", "")).contains("block peg: `steps` is missing"));
        assert!(said(&TEXT.replace("[2.5, 50.0]", "2.5")).contains("must be a list"));
        assert!(
            said(&TEXT.replace("\"filter\"", "\"peg\"").replace("vary =", "set ="))
                .contains("run ")
        );
        assert!(
            said(&TEXT.replace("seeds = [1, 2]", "seeds = [1, 1]")).contains("two runs called")
        );
        assert!(said(&TEXT.replace("model = \"P-14\"", "mode = \"P-14\"")).contains("mode"));
        assert!(said("name = \"a/b\"\nruns = []").contains("names a folder"));
    }

    #[test]
    fn the_built_in_studies_are_whole() {
        for (name, text) in STUDIES {
            let study = Study::parse(text).unwrap();
            assert_eq!(study.name, *name);
            assert!(!study.plan().unwrap().is_empty());
        }
        let paper = Study::parse(&text(Path::new("paper")).unwrap()).unwrap().plan().unwrap();
        let peg = paper.iter().filter(|run| run.block == "peg").count();
        assert!(peg >= 8 * 2 * 5, "{peg}");
    }
}
