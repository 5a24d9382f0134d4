//! Where runs come from: configurations, commands, commits.

use std::fmt::Write as _;

use super::page::{escape, table};
use super::run::Run;
use crate::flat::flat;

/// What differs between runs, then each one's latest start and whole configuration.
pub(super) fn origin(runs: &[Run]) -> anyhow::Result<String> {
    let mut out = String::new();
    let texts = runs.iter().map(|run| run.config.to_toml()).collect::<anyhow::Result<Vec<_>>>()?;
    if runs.len() > 1 {
        out += "<h3>What differs</h3>";
        out += &differences(runs, &texts);
    }
    for (run, text) in runs.iter().zip(&texts) {
        let name = escape(&run.name);
        if let Some(start) = run.provenance.as_array().and_then(|starts| starts.last()) {
            let word = |pointer: &str| match start.pointer(pointer) {
                Some(serde_json::Value::String(text)) => escape(text),
                Some(serde_json::Value::Array(words)) => {
                    let words: Vec<&str> = words.iter().filter_map(|w| w.as_str()).collect();
                    // The program's place on the disk tells nobody anything.
                    escape(&format!("palpate {}", words.get(1..).unwrap_or_default().join(" ")))
                }
                Some(value) => escape(&value.to_string()),
                None => "–".into(),
            };
            let dirty =
                if word("/git/dirty") == "true" { ", with uncommitted changes" } else { "" };
            let row = |what: &str, value: String| vec![what.to_owned(), value];
            out += &table(
                &[&format!("{name}: its latest start"), ""],
                &[
                    row("command", format!("<code>{}</code>", word("/arguments"))),
                    row("started", word("/started")),
                    row("commit", format!("<code>{}</code>{dirty}", word("/git/commit"))),
                    row("compiler", word("/rustc")),
                    row(
                        "machine",
                        format!(
                            "{}, {} cores, {} {}",
                            word("/cpu"),
                            word("/cores"),
                            word("/os"),
                            word("/arch")
                        ),
                    ),
                ],
            );
        }
        _ = write!(
            out,
            "<details><summary>{name}: config.toml</summary><pre>{}</pre></details>",
            escape(text)
        );
    }
    Ok(out)
}

/// Keys that not all runs share, and their values.
fn differences(runs: &[Run], texts: &[String]) -> String {
    let keys = |text: &String| text.parse().map(|table| flat(&table)).unwrap_or_default();
    let all: Vec<_> = texts.iter().map(keys).collect();
    let mut keys: Vec<&String> = all.iter().flat_map(|keys| keys.keys()).collect();
    keys.sort();
    keys.dedup();
    let row = |key: &&String| {
        let values: Vec<_> =
            all.iter().map(|keys| keys.get(*key).cloned().unwrap_or_default()).collect();
        let same = values.windows(2).all(|pair| pair[0] == pair[1]);
        (!same).then(|| {
            std::iter::once(format!("<code>{}</code>", escape(key)))
                .chain(values.iter().map(|value| escape(value)))
                .collect::<Vec<_>>()
        })
    };
    let rows: Vec<Vec<String>> = keys.iter().filter_map(row).collect();
    if rows.is_empty() {
        return "<p>Nothing: they have the same configuration.</p>".into();
    }
    let names: Vec<String> = runs.iter().map(|run| escape(&run.name)).collect();
    let head: Vec<&str> = std::iter::once("key").chain(names.iter().map(String::as_str)).collect();
    table(&head, &rows)
}
