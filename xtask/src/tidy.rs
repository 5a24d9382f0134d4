//! What clippy cannot know: rules of this repository, checked rather than hoped for.

mod docs;
mod fronts;
mod graph;
mod layering;
mod listed;
mod text;

use anyhow::{Context as _, bail};

use crate::{style, workspace};

/// A file of the working tree.
#[derive(Debug)]
struct File {
    /// Relative to the root, with `/`.
    path: String,
    /// Empty where the file is not UTF-8.
    text: String,
}

impl File {
    fn is(&self, extension: &str) -> bool {
        self.path.rsplit_once('.').is_some_and(|(_, e)| e == extension)
    }

    /// The folder it lies in; empty for the root.
    fn folder(&self) -> &str {
        self.path.rsplit_once('/').map_or("", |(folder, _)| folder)
    }
}

/// A broken rule and what to do about it.
#[derive(Debug)]
struct Finding {
    path: String,
    /// From 1; none where the whole file is meant.
    line: Option<usize>,
    problem: String,
    remedy: String,
}

impl Finding {
    fn new(
        path: &str,
        line: impl Into<Option<usize>>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            path: path.into(),
            line: line.into(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.path)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}\n    → {}", self.problem, self.remedy)
    }
}

/// `cargo xtask tidy`
pub(crate) fn command() -> anyhow::Result<()> {
    let files = workspace::files()?
        .into_iter()
        .map(|path| {
            let bytes = std::fs::read(workspace::root().join(&path))
                .with_context(|| format!("cannot read {path}"))?;
            Ok(File { path, text: String::from_utf8(bytes).unwrap_or_default() })
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let findings: Vec<Finding> = [
        layering::check(&graph::Graph::of_workspace()?),
        text::check(&files),
        docs::check(&files),
        listed::check(&files),
        fronts::check(&files),
    ]
    .into_iter()
    .flatten()
    .collect();
    for finding in &findings {
        println!("{} {finding}", style::red("✗"));
    }
    match findings.len() {
        0 => println!("{} files are tidy", files.len()),
        1 => bail!("one thing to tidy up"),
        n => bail!("{n} things to tidy up"),
    }
    Ok(())
}

#[cfg(test)]
fn file(path: &str, text: &str) -> File {
    File { path: path.into(), text: text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_says_where_what_and_what_to_do() {
        let finding = Finding::new("docs/a.md", 3, "a link leads nowhere", "correct it");
        assert_eq!(finding.to_string(), "docs/a.md:3: a link leads nowhere\n    → correct it");
        assert_eq!(file("crates/x/src/lib.rs", "").folder(), "crates/x/src");
        assert!(file("a.b/c.rs", "").is("rs") && !file("a.b/run", "").is("b"));
    }
}
