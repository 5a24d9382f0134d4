//! Every crate has a front page: a runnable example in `lib.rs`, and the same one in its README.

use super::{File, Finding};

pub(super) fn check(files: &[File]) -> Vec<Finding> {
    let libraries = files.iter().filter_map(|file| {
        let name = file.path.strip_prefix("crates/")?.strip_suffix("/src/lib.rs")?;
        (!name.contains('/')).then_some((name, file))
    });
    libraries.filter_map(|(name, library)| front(files, name, library)).collect()
}

fn front(files: &[File], name: &str, library: &File) -> Option<Finding> {
    let Some(example) = example(&library.text) else {
        return Some(Finding::new(
            &library.path,
            1,
            "the crate's documentation begins without a runnable example",
            "show in a dozen lines what the crate is for",
        ));
    };
    let path = format!("crates/{name}/README.md");
    let Some(readme) = files.iter().find(|file| file.path == path) else {
        let remedy = "add one: what it is, the example of lib.rs, what it needs";
        return Some(Finding::new(&path, None, "the crate has no README", remedy));
    };
    let shown = format!("```rust\n{example}\n```");
    (!readme.text.contains(&shown)).then(|| {
        let remedy = format!("put this there, as it is run:\n{shown}");
        Finding::new(&path, None, "it does not show the first example of lib.rs", remedy)
    })
}

/// The first block of the crate's documentation that rustdoc compiles as it is, without its hidden lines.
fn example(text: &str) -> Option<String> {
    let lines = text.lines().take_while(|line| line.starts_with("//!"));
    let lines = lines.map(|line| line[3..].strip_prefix(' ').unwrap_or(&line[3..]));
    let (mut block, mut other): (Option<Vec<&str>>, bool) = (None, false);
    for line in lines {
        match (&mut block, line.strip_prefix("```")) {
            (Some(lines), Some(_)) => return Some(lines.join("\n").trim_matches('\n').to_owned()),
            (Some(lines), None) if line != "#" && !line.starts_with("# ") => lines.push(line),
            (None, Some(_)) if other => other = false,
            (None, Some("" | "rust" | "no_run")) => block = Some(Vec::new()),
            (None, Some(_)) => other = true,
            (_, None) => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::file;
    use super::*;

    const LIB: &str = "//! A.\n//!\n//! ```text\n//! no\n//! ```\n//!\n//! ```\n//! # hidden\n//! let a = 1;\n//! ```\nmod b;\n";

    fn found(lib: &str, readme: Option<&str>) -> Vec<String> {
        let mut files =
            vec![file("crates/a/src/lib.rs", lib), file("crates/a/src/deep/lib.rs", "")];
        files.extend(readme.map(|text| file("crates/a/README.md", text)));
        check(&files).into_iter().map(|f| f.problem).collect()
    }

    #[test]
    fn the_readme_shows_the_first_example_that_runs() {
        assert_eq!(example(LIB).unwrap(), "let a = 1;");
        assert_eq!(found(LIB, Some("# a\n\n```rust\nlet a = 1;\n```\n")), [""; 0]);
        assert_eq!(found(LIB, Some("```rust\nlet a = 2;\n```\n")).len(), 1);
        assert!(found(LIB, None)[0].contains("no README"));
        assert!(found("//! A.\n//! ```text\n//! ```\n", None)[0].contains("without a runnable"));
        assert!(found("//! ```compile_fail\n//! a\n//! ```\n", None)[0].contains("without"));
    }
}
