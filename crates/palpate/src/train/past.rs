//! A run is continued under the settings it was made with.

use anyhow::bail;
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
    let then: Table = toml::from_str(checkpoint)?;
    let now: Table = toml::from_str(&now.to_toml()?)?;
    let mut changes = Vec::new();
    compare("", &Value::Table(then), &Value::Table(now), &mut changes);
    changes.retain(|(key, _)| !may_differ(key));
    if changes.is_empty() {
        return Ok(());
    }
    let changes: Vec<String> = changes.into_iter().map(|(_, change)| change).collect();
    bail!(
        "its checkpoint was made with other settings:\n  {}\nPut them back, or begin a new run with them",
        changes.join("\n  ")
    );
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
}
