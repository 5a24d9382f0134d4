//! A run is continued under the settings it was made with.

use anyhow::{Context as _, bail};
use toml::{Table, Value};

use crate::Config;

/// What may differ when a run is continued: its length, the threads of its updates, which change no result, and the
/// arm's address and link.
fn may_differ(key: &str) -> bool {
    matches!(key, "run.steps" | "sac.threads") || key.starts_with("ur.")
}

/// Compares the configuration of a checkpoint with the one a run is to be continued under.
///
/// # Errors
/// Naming every setting that would change the past.
pub(super) fn unchanged(checkpoint: &str, now: &Config) -> anyhow::Result<()> {
    compared(checkpoint, now, |key| !may_differ(key))
}

/// The same where a new run begins with a checkpoint's learner: that one stays what it is, and its observations and
/// actions mean what they did. All else may change; of what makes its memories wrong, a list.
pub(super) fn inheritable(checkpoint: &str, now: &Config) -> anyhow::Result<Vec<String>> {
    compared(checkpoint, now, |key| {
        gives_meaning(key) || (key.starts_with("sac.") && !may_differ(key))
    })?;
    changed(checkpoint, now, gives_worth)
}

/// Keys that decide what the numbers of an observation and of an action mean.
pub(crate) fn gives_meaning(key: &str) -> bool {
    match key.split_once('.') {
        Some(("env", key)) => {
            key.starts_with("observation.") || key == "policy_period" || key == "reference"
        }
        Some((table, _)) => ["policy", "control"].contains(&table),
        None => false,
    }
}

/// Keys that decide what a transition was worth, and how forces are scaled in an observation.
pub(crate) fn gives_worth(key: &str) -> bool {
    let scales = ["force_max", "torque_max", "force_filter_cutoff"];
    match key.split_once('.') {
        Some(("safety", key)) => scales.contains(&key),
        Some((table, _)) => table == "reward",
        None => false,
    }
}

fn compared(checkpoint: &str, now: &Config, matters: impl Fn(&str) -> bool) -> anyhow::Result<()> {
    let changes = changed(checkpoint, now, matters)?;
    if changes.is_empty() {
        return Ok(());
    }
    bail!(
        "its checkpoint was made with other settings:\n  {}\nPut them back, or begin a new run from nothing with them",
        changes.join("\n  ")
    );
}

fn changed(
    checkpoint: &str,
    now: &Config,
    matters: impl Fn(&str) -> bool,
) -> anyhow::Result<Vec<String>> {
    // Through the configuration: keys that are younger than the checkpoint stand at what it was made with.
    let then: Config = toml::from_str(checkpoint)
        .context("the configuration in its checkpoint is not of this version")?;
    let changes = differences(&then, now)?.into_iter();
    Ok(changes.filter(|(key, _)| matters(key)).map(|(_, change)| change).collect())
}

/// Every key whose value is not the same, with what it was and is.
pub(crate) fn differences(then: &Config, now: &Config) -> anyhow::Result<Vec<(String, String)>> {
    let table = |config: &Config| -> anyhow::Result<Value> {
        Ok(Value::Table(toml::from_str::<Table>(&config.to_toml()?)?))
    };
    let mut changes = Vec::new();
    compare("", &table(then)?, &table(now)?, &mut changes);
    Ok(changes)
}

fn compare(key: &str, then: &Value, now: &Value, changes: &mut Vec<(String, String)>) {
    if let (Value::Table(then), Value::Table(now)) = (then, now) {
        let names = then.keys().chain(now.keys().filter(|name| !then.contains_key(*name)));
        for name in names {
            let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
            match (then.get(name), now.get(name)) {
                (Some(then), Some(now)) => compare(&key, then, now, changes),
                (Some(then), None) => changes.push((key.clone(), format!("{key} was {then}"))),
                (None, Some(now)) => {
                    changes.push((key.clone(), format!("{key} is {now} and was not there")));
                }
                (None, None) => {}
            }
        }
    } else if then != now {
        changes.push((key.to_owned(), format!("{key} was {then} and is {now}")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Choice;

    fn config(set: &[&str]) -> Config {
        let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
        let set = set.iter().map(ToString::to_string).collect();
        Config::load(&Choice { preset, task, model, file: None, set }).unwrap()
    }

    #[test]
    fn only_what_changes_the_past_is_refused_and_named() {
        let then = config(&[]).to_toml().unwrap();
        unchanged(&then, &config(&[])).unwrap();
        unchanged(&then, &config(&["run.steps=7"])).unwrap();
        unchanged(&then, &config(&["sac.threads=1"])).unwrap();
        let other = config(&["sac.gamma=0.5", "run.seed=9", "run.steps=7"]);
        let said = unchanged(&then, &other).unwrap_err().to_string();
        assert!(said.contains("sac.gamma was 0.98 and is 0.5"), "{said}");
        assert!(said.contains("run.seed was 1 and is 9"), "{said}");
        assert!(!said.contains("run.steps"), "{said}");
        assert_eq!(said.lines().count(), 4, "{said}");
    }

    #[test]
    fn an_heir_may_change_its_world_and_not_itself() {
        let then = config(&[]).to_toml().unwrap();
        let heir = |set: &[&str]| inheritable(&then, &config(set));
        let world = ["sim.friction=0.4", "task.goal_spread.position=[0.002, 0.002, 0.001]"];
        assert!(heir(&[&world[..], &["run.seed=9", "sac.threads=1"]].concat()).unwrap().is_empty());
        for (set, change) in [
            ("sac.n_step=3", "sac.n_step was 5 and is 3"),
            ("policy.motion.linear=0.03", "policy.motion.linear was 0.02 and is 0.03"),
            ("env.policy_period=0.1", "env.policy_period was 0.05 and is 0.1"),
        ] {
            let said = heir(&[set]).unwrap_err().to_string();
            assert!(said.contains(change), "{said}");
        }
        let remarks = heir(&["reward.violation=0"]).unwrap();
        assert_eq!(remarks, ["reward.violation was -10.0 and is 0.0"]);
    }

    #[test]
    fn a_checkpoint_from_before_a_key_stands_at_the_keys_default() {
        let now = config(&[]).to_toml().unwrap();
        let then: Vec<&str> = now.lines().filter(|line| !line.starts_with("danger_")).collect();
        assert_eq!(then.len() + 2, now.lines().count());
        unchanged(&then.join("\n"), &config(&[])).unwrap();
        let said = unchanged(&then.join("\n"), &config(&["sac.danger_share=0.1"])).unwrap_err();
        assert!(said.to_string().contains("sac.danger_share was 0.0 and is 0.1"), "{said}");
    }
}
