//! Links between the repository's Markdown files lead somewhere.

use std::collections::{BTreeMap, BTreeSet};

use super::{File, Finding};

pub(super) fn check(files: &[File]) -> Vec<Finding> {
    let mut places: BTreeSet<&str> = files.iter().map(|f| f.path.as_str()).collect();
    for file in files {
        let mut folder = file.folder();
        while places.insert(folder) && !folder.is_empty() {
            folder = folder.rsplit_once('/').map_or("", |(above, _)| above);
        }
    }
    let pages: BTreeMap<&str, &File> =
        files.iter().filter(|f| f.is("md")).map(|f| (f.path.as_str(), f)).collect();
    let mut findings = Vec::new();
    for page in pages.values() {
        for (line, target) in links(&page.text) {
            if let Some(problem) = broken(page, &target, &places, &pages) {
                let remedy = "correct the link; paths are relative to the page, anchors are headings in lower case with dashes";
                findings.push(Finding::new(&page.path, line, problem, remedy));
            }
        }
    }
    findings
}

fn broken(
    page: &File,
    target: &str,
    places: &BTreeSet<&str>,
    pages: &BTreeMap<&str, &File>,
) -> Option<String> {
    // `https:`, `mailto:` and the like are elsewhere.
    if target.split(['/', '#']).next().is_some_and(|head| head.contains(':')) {
        return None;
    }
    let (path, anchor) =
        target.split_once('#').map_or((target, None), |(path, anchor)| (path, Some(anchor)));
    let path = if path.is_empty() { Some(page.path.clone()) } else { join(page.folder(), path) };
    let Some(path) = path.filter(|path| places.contains(path.as_str())) else {
        return Some(format!("`{target}` leads to no file of the repository"));
    };
    let (page, anchor) = (pages.get(path.as_str())?, anchor?);
    (!anchors(&page.text).contains(anchor))
        .then(|| format!("{path} has no heading for `#{anchor}`"))
}

/// `folder/path` without `.` and `..`; none where it leaves the repository.
fn join(folder: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

/// Line number and target of every link, image and HTML reference outside code.
fn links(markdown: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (n, line) in prose(markdown) {
        let mut add = |target: &str| found.push((n, target.to_owned()));
        for (at, _) in line.match_indices("](") {
            // `(a.md "title")` and `(<a b.md>)` are allowed forms.
            let rest = &line[at + 2..];
            if let Some(rest) = rest.strip_prefix('<') {
                add(rest.split('>').next().unwrap_or(""));
            } else {
                add(rest.split([')', ' ']).next().unwrap_or(""));
            }
        }
        if let Some((_, target)) = line
            .strip_prefix('[')
            .filter(|rest| !rest.starts_with('^'))
            .and_then(|rest| rest.split_once("]: "))
        {
            add(target.split_whitespace().next().unwrap_or(""));
        }
        for attribute in ["src=\"", "href=\""] {
            for (at, _) in line.match_indices(attribute) {
                add(line[at + attribute.len()..].split('"').next().unwrap_or(""));
            }
        }
    }
    found
}

/// Lines outside fenced code, with `code spans` blanked, numbered from 1.
fn prose(markdown: &str) -> impl Iterator<Item = (usize, String)> {
    let mut fence: Option<&str> = None;
    (1..).zip(markdown.lines()).filter_map(move |(n, line)| {
        let mark = ["```", "~~~"].into_iter().find(|mark| line.trim_start().starts_with(mark));
        match (fence, mark) {
            (None, Some(mark)) => fence = Some(mark),
            (Some(open), Some(mark)) if open == mark => fence = None,
            (None, None) => {
                // Every second piece between backticks is code.
                let pieces: Vec<&str> = line.split('`').step_by(2).collect();
                return Some((n, pieces.join("``")));
            }
            _ => {}
        }
        None
    })
}

/// What can follow `#`: headings as forges spell them, and explicit `id="…"`.
fn anchors(markdown: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut anchors = BTreeSet::new();
    let numbers: BTreeSet<usize> = prose(markdown).map(|(n, _)| n).collect();
    // Code spans count in headings, so the line itself is read, not its prose.
    for (_, line) in (1..).zip(markdown.lines()).filter(|(n, _)| numbers.contains(n)) {
        for (at, _) in line.match_indices("id=\"") {
            anchors.extend(line[at + 4..].split('"').next().map(str::to_owned));
        }
        let title = line.trim_start_matches('#');
        if title.len() == line.len() || !title.starts_with(' ') {
            continue;
        }
        let slug: String = title
            .trim()
            .to_lowercase()
            .chars()
            .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
            .map(|c| if c == ' ' { '-' } else { c })
            .collect();
        let count = seen.entry(slug.clone()).and_modify(|n| *n += 1).or_insert(0);
        anchors.insert(if *count == 0 { slug } else { format!("{slug}-{count}") });
    }
    anchors
}

#[cfg(test)]
mod tests {
    use super::super::file;
    use super::*;

    fn problems(page: &str) -> Vec<String> {
        let files = [
            file("docs/a.md", page),
            file(
                "docs/b.md",
                "# Über `Safe`: what, why\n## Twice\n## Twice\n```sh\n# a comment\n```\n",
            ),
            file("README.md", ""),
            file("assets/robots/ur3e.urdf", ""),
        ];
        check(&files)
            .iter()
            .map(|f| format!("{}:{}: {}", f.path, f.line.unwrap(), f.problem))
            .collect()
    }

    #[test]
    fn links_that_lead_somewhere_pass() {
        let page = "[b](b.md), [up](../README.md \"title\"), [folder](../assets/robots/), ![](<../assets/robots/ur3e.urdf>)
[web](https://example.org/none.md) [mail](mailto:a@example.org) [here](#own-heading) [ref][r]
[h](b.md#über-safe-what-why) [second](b.md#twice-1)
<img src=\"../assets/robots/ur3e.urdf\">
[r]: b.md
`[code](none.md)`
```text
[fenced](none.md)
```
# Own heading
";
        assert_eq!(problems(page), [] as [&str; 0]);
    }

    #[test]
    fn links_that_lead_nowhere_are_found() {
        for (page, problem) in [
            ("\n[x](none.md)", "docs/a.md:2: `none.md` leads to no file"),
            ("[x](../../out.md)", "docs/a.md:1: `../../out.md` leads to no file"),
            ("[x](b.md) and [y](c.md)", "docs/a.md:1: `c.md` leads to no file"),
            ("[x]: none.md", "docs/a.md:1: `none.md` leads to no file"),
            ("<a href=\"none.html\">", "docs/a.md:1: `none.html` leads to no file"),
            ("[x](b.md#thrice)", "docs/a.md:1: docs/b.md has no heading for `#thrice`"),
            ("[x](b.md#a-comment)", "docs/a.md:1: docs/b.md has no heading for `#a-comment`"),
            ("[x](#gone)", "docs/a.md:1: docs/a.md has no heading for `#gone`"),
        ] {
            let found = problems(page);
            assert!(found.len() == 1 && found[0].starts_with(problem), "{page}: {found:?}");
        }
    }
}
