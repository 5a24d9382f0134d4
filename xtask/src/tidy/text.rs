//! What a line or a file must not look like.

use super::{File, Finding};

/// A file past this is two ideas.
const MAX_LINES: usize = 400;

/// Files that may be longer, and why.
const LONG: &[(&str, &str)] = &[];

/// Top-level folders that exist on the author's machine only.
const MACHINE_FOLDERS: &[&str] = &["work", "root", "tmp", "home", "Users"];

/// Spelt apart, so that this file does not find itself.
const MARKERS: &[&str] = &[concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X")];

pub(super) fn check(files: &[File]) -> Vec<Finding> {
    files.iter().flat_map(|file| long(file).into_iter().chain(lines(file))).collect()
}

fn long(file: &File) -> Option<Finding> {
    let lines = file.text.lines().count();
    let excused = LONG.iter().any(|(path, _)| *path == file.path);
    (file.is("rs") && lines > MAX_LINES && !excused).then(|| {
        Finding::new(
            &file.path,
            None,
            format!("{lines} lines, more than {MAX_LINES}"),
            "split it by idea, or list it with a reason in xtask/src/tidy/text.rs",
        )
    })
}

fn lines(file: &File) -> Vec<Finding> {
    let mut findings = Vec::new();
    if !["rs", "toml", "md", "yml", "urdf", "cff", "py", "sh"].iter().any(|e| file.is(e))
        && file.path != ".ci/run"
    {
        return findings;
    }
    let code = !file.is("md");
    for (n, line) in (1..).zip(outside_tests(file)) {
        if let Some(path) = machine_path(line) {
            findings.push(Finding::new(
                &file.path,
                n,
                format!("{path} exists on one machine only"),
                "use a path relative to the repository, std::env::temp_dir() or an argument",
            ));
        }
        if let Some(marker) = anonymous_marker(line).filter(|_| code) {
            findings.push(Finding::new(
                &file.path,
                n,
                format!("a {marker} that nobody owns"),
                format!("do it, delete it, or write `{marker}(name): reason`"),
            ));
        }
    }
    findings
}

/// Lines up to the file's test module; none of a file that holds tests only.
fn outside_tests(file: &File) -> impl Iterator<Item = &str> {
    let in_tests = file.path.contains("/tests/") || file.path.contains("/benches/");
    let lines: Vec<&str> = file.text.lines().collect();
    let module = lines.windows(2).position(|pair| {
        let attribute = pair[0].trim().replace(' ', "");
        attribute.starts_with("#[cfg(")
            && attribute.contains("test")
            && pair[1].starts_with("mod ")
            && pair[1].ends_with('{')
    });
    let end = if in_tests { 0 } else { module.unwrap_or(lines.len()) };
    lines.into_iter().take(end)
}

/// The first absolute path below a machine's folder.
fn machine_path(line: &str) -> Option<&str> {
    MACHINE_FOLDERS.iter().find_map(|folder| {
        let name = |c: char| c.is_alphanumeric() || "_-".contains(c);
        line.match_indices(folder).find_map(|(at, _)| {
            let before = line[..at].strip_suffix('/')?;
            let after = &line[at + folder.len()..];
            // `a/work/b`, `~/work`, `$DIR/work`, `</work>` and `https://work` start elsewhere.
            let absolute = !before.ends_with(|c: char| name(c) || "./~})]><".contains(c));
            let whole = !after.starts_with(name);
            let end = after.find(|c: char| c != '/' && c != '.' && !name(c)).unwrap_or(after.len());
            (absolute && whole).then(|| &line[at - 1..at + folder.len() + end])
        })
    })
}

/// A marker that is not followed by a name in parentheses.
fn anonymous_marker(line: &str) -> Option<&'static str> {
    let word = |c: char| c.is_alphanumeric() || c == '_';
    MARKERS.iter().copied().find(|marker| {
        line.match_indices(marker).any(|(at, _)| {
            let (before, after) = (&line[..at], &line[at + marker.len()..]);
            let owner = after
                .strip_prefix('(')
                .and_then(|rest| rest.split_once(')'))
                .map(|(owner, _)| owner.trim());
            !before.ends_with(word) && !after.starts_with(word) && owner.is_none_or(str::is_empty)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::file;
    use super::*;

    fn problems(path: &str, text: &str) -> Vec<String> {
        check(&[file(path, text)]).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_file_of_two_ideas_is_found() {
        let found = problems("crates/a/src/lib.rs", &"//\n".repeat(MAX_LINES + 1));
        assert!(found.len() == 1 && found[0].contains("401 lines"), "{found:?}");
        assert!(problems("crates/a/src/lib.rs", &"//\n".repeat(MAX_LINES)).is_empty());
        assert!(
            problems("CHANGELOG.md", &"-\n".repeat(MAX_LINES + 1)).is_empty(),
            "prose may be long"
        );
    }

    #[test]
    fn paths_of_one_machine_are_found() {
        for (line, path) in [
            ("let p = \"/work/data/a.toml\";", "/work/data/a.toml"),
            ("# see /root/notes", "/root/notes"),
            ("cd /tmp && ls", "/tmp"),
            ("file = '/home/ana/x.urdf'", "/home/ana/x.urdf"),
        ] {
            assert_eq!(machine_path(line), Some(path), "{line}");
            let found = problems("crates/a/src/lib.rs", line);
            assert!(
                found.len() == 1 && found[0].starts_with("crates/a/src/lib.rs:1: "),
                "{found:?}"
            );
        }
    }

    #[test]
    fn other_paths_are_left_alone() {
        for line in [
            "https://example.org/work/item",
            "~/work/x",
            "$HOME/tmp",
            "target/tmp/x",
            "</root>",
            "${DIR}/tmp/x",
            "square/root",
            "/roots of the polynomial",
            "https://home.example.org",
        ] {
            assert_eq!(machine_path(line), None, "{line}");
        }
    }

    #[test]
    fn markers_need_an_owner() {
        let marker = MARKERS[0];
        let found = problems("xtask/src/a.rs", &format!("fn a() {{}}\n// {marker}: later"));
        assert!(found.len() == 1 && found[0].starts_with("xtask/src/a.rs:2: "), "{found:?}");
        assert_eq!(anonymous_marker(&format!("// {marker}(): x")), Some(marker));
        assert_eq!(anonymous_marker(&format!("// {marker}(ana): wait for 0.37")), None);
        assert_eq!(anonymous_marker(&format!("const {marker}S: u8 = 1;")), None);
    }

    #[test]
    fn tests_may_hold_bad_samples() {
        let text = "fn a() {}\n#[cfg(test)]\nmod tests {\n    const P: &str = \"/tmp/x\";\n}\n";
        assert!(problems("crates/a/src/lib.rs", text).is_empty());
        assert!(problems("crates/a/tests/b.rs", "\"/tmp/x\"").is_empty());
        let helper = "#[cfg(test)]\nfn helper() {}\nconst P: &str = \"/tmp/x\";\n";
        assert_eq!(
            problems("crates/a/src/lib.rs", helper).len(),
            1,
            "only a test module ends the code"
        );
    }
}
