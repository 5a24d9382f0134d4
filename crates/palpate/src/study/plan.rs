//! A study file, and the runs it stands for: a pure function of the file.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use palpate_runs::config::nearest;
use toml::Table;

use super::block::Block;
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
    pub(super) preset: String,
    /// Settings of all runs.
    #[serde(default)]
    pub(super) set: Table,
    /// How a finished run is judged.
    #[serde(default)]
    pub(super) evaluation: Judging,
    /// Under what else it is judged.
    #[serde(default)]
    pub(super) conditions: Vec<Condition>,
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

/// A change of the world under which every finished policy is judged once more.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Condition {
    pub(super) name: String,
    set: Table,
}

impl Condition {
    pub(super) fn settings(&self) -> Vec<String> {
        settings(&self.set)
    }
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
    /// Episodes it is shown.
    pub(super) demonstrations: u64,
    /// What its block tries: key and value.
    pub(super) varied: Vec<(String, String)>,
    pub(super) preset: String,
    pub(super) set: Vec<String>,
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
    if !name.exists() {
        let begun = Path::new("studies").join(name);
        let hint = if begun.is_dir() {
            format!("; did you mean {}?", begun.display())
        } else {
            let near = name.to_str().and_then(|name| nearest(name, known.iter().copied()));
            near.map_or_else(String::new, |near| format!("; did you mean {near}?"))
        };
        bail!("there is no study {} (built in: {}){hint}", name.display(), known.join(", "));
    }
    std::fs::read_to_string(name)
        .with_context(|| format!("cannot read the study {}", name.display()))
}

impl Study {
    pub(super) fn parse(text: &str) -> anyhow::Result<Self> {
        let study: Self =
            toml::from_str(text).context("not a study as docs/how-to/studies.md describes it")?;
        ensure!(
            slug(&study.name) == study.name,
            "the study's name {:?} names a folder: letters, digits, - and _",
            study.name
        );
        Ok(study)
    }

    /// What it sets for all runs, in words.
    pub(super) fn settings(&self) -> String {
        match settings(&self.set).join(", ") {
            none if none.is_empty() => "none".into(),
            some => format!("`{some}`"),
        }
    }

    /// Its runs, seed after seed: half a study is a whole one with fewer seeds.
    ///
    /// # Errors
    /// If a setting is wrong, naming the run, or if two runs would be the same.
    pub(super) fn plan(&self) -> anyhow::Result<Vec<Planned>> {
        let mut all = Vec::new();
        for block in &self.runs {
            for seed in block.seeds() {
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
            let with = |set: &[String]| Config::load(&run.choice(set));
            with(&[]).with_context(|| format!("run {}", run.id))?;
            for condition in &self.conditions {
                with(&condition.settings())
                    .with_context(|| format!("run {} under {:?}", run.id, condition.name))?;
            }
        }
        for (i, condition) in self.conditions.iter().enumerate() {
            let before = self.conditions.get(..i).unwrap_or_default();
            ensure!(
                !condition.name.is_empty() && before.iter().all(|c| c.name != condition.name),
                "every condition needs a name of its own: {:?}",
                condition.name
            );
        }
        ensure!(!all.is_empty(), "the study has no runs");
        Ok(all)
    }
}

/// A table as `key=value`.
pub(super) fn settings(table: &Table) -> Vec<String> {
    flat(table).into_iter().map(|(key, value)| format!("{key}={value}")).collect()
}

/// A name as a folder's: everything but letters, digits, `-`, `_` and `.` becomes `-`.
pub(super) fn slug(name: &str) -> String {
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
[[runs]]
name = "shown"
task = "peg-insertion"
model = "P-14"
steps = 300
demonstrations = 10
[[conditions]]
name = "slippery"
set = { sim.friction = 0.1 }
"#;

    #[test]
    fn a_study_is_every_combination_seed_after_seed() {
        let plan = Study::parse(TEXT).unwrap().plan().unwrap();
        let ids: Vec<&str> = plan.iter().map(|run| run.id.as_str()).collect();
        assert_eq!(ids.len(), 2 * 2 * 2 + 4 + 4 + 1);
        assert_eq!((plan[15].demonstrations, plan[16].demonstrations), (0, 10));
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
        assert!(said(&TEXT.replace("sim.friction", "sim.fiction")).contains("under \"slippery\""));
        assert!(said(&TEXT.replace("\"slippery\"", "\"\"")).contains("a name of its own"));
        let misspelt = TEXT.replace("\"zero\"", "\"zro\"");
        assert!(said(&misspelt).contains("policy: learned, zero, random, scripted"));
        assert!(
            said(&TEXT.replace("policy =", "demonstrations = 1\npolicy ="))
                .contains("nothing in it learns")
        );
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
