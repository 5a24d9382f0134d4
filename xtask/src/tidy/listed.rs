//! Assets say where they come from; examples can be found.

use std::collections::BTreeSet;

use super::{File, Finding};

pub(super) fn check(files: &[File]) -> Vec<Finding> {
    assets(files).chain(examples(files)).collect()
}

/// Every folder of assets/ explains itself.
fn assets(files: &[File]) -> impl Iterator<Item = Finding> {
    let folders: BTreeSet<&str> =
        files.iter().map(File::folder).filter(|f| f.starts_with("assets/")).collect();
    folders.into_iter().filter_map(|folder| {
        let explained = ["SOURCE.md", "README.md"].iter().any(|name| files.iter().any(|f| f.path == format!("{folder}/{name}")));
        (!explained).then(|| {
            let remedy = "add a SOURCE.md (figures from elsewhere, with where they were published) or a README.md (our own)";
            Finding::new(folder, None, "nothing says where these files come from", remedy)
        })
    })
}

/// Every program of examples/ is named on a page that a reader can come across.
fn examples(files: &[File]) -> impl Iterator<Item = Finding> {
    let read = |f: &&File| {
        f.is("md")
            && (f.folder().is_empty()
                || f.path.starts_with("docs/")
                || f.path.starts_with("examples/"))
    };
    let pages: String = files.iter().filter(read).map(|f| f.text.as_str()).collect();
    files.iter().filter(|f| f.is("rs") && f.folder() == "examples/examples").filter_map(move |f| {
        let name = f.path.rsplit('/').next()?.strip_suffix(".rs")?;
        (!pages.contains(name)).then(|| {
            Finding::new(
                &f.path,
                None,
                "no page mentions this program",
                "add a row to examples/README.md: the name and what one learns",
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::file;
    use super::*;

    #[test]
    fn an_asset_without_a_source_is_found() {
        let files = [
            file("assets/robots/ur3e.urdf", ""),
            file("assets/robots/SOURCE.md", ""),
            file("assets/tasks/peg.toml", ""),
            file("assets/tasks/old/peg.toml", ""),
            file("assets/tasks/old/README.md", ""),
        ];
        let found: Vec<String> = check(&files).into_iter().map(|f| f.path).collect();
        assert_eq!(found, ["assets/tasks"]);
    }

    #[test]
    fn an_example_that_no_page_mentions_is_found() {
        let files = [
            file("examples/examples/01_first.rs", ""),
            file("examples/examples/02_second.rs", ""),
            file("examples/README.md", "`01_first`"),
            file("crates/a/README.md", "`02_second`"),
        ];
        let found: Vec<String> = check(&files).into_iter().map(|f| f.path).collect();
        assert_eq!(found, ["examples/examples/02_second.rs"]);
    }
}
