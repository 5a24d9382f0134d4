//! Colours, where somebody sees them.

use std::io::IsTerminal as _;

/// Whether standard output takes ANSI colours. <https://no-color.org>; `CARGO_TERM_COLOR` as in cargo.
pub(crate) fn coloured() -> bool {
    let var = |name| std::env::var_os(name).filter(|v| !v.is_empty());
    match var("CARGO_TERM_COLOR") {
        Some(when) if when == "always" => true,
        Some(when) if when == "never" => false,
        _ => var("NO_COLOR").is_none() && std::io::stdout().is_terminal(),
    }
}

pub(crate) fn bold(text: &str) -> String {
    paint("1", text)
}

pub(crate) fn red(text: &str) -> String {
    paint("1;31", text)
}

pub(crate) fn green(text: &str) -> String {
    paint("1;32", text)
}

pub(crate) fn yellow(text: &str) -> String {
    paint("1;33", text)
}

fn paint(code: &str, text: &str) -> String {
    if coloured() { format!("\x1b[{code}m{text}\x1b[0m") } else { text.into() }
}

/// `text` without ANSI escape sequences of the `ESC [ … letter` kind.
pub(crate) fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        if c == '\x1b' {
            // '[' is itself within '@'..='~': it opens the sequence, the next one ends it.
            let _ = chars.by_ref().skip(1).find(|c| ('@'..='~').contains(c));
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_removed_and_nothing_else() {
        assert_eq!(plain("\x1b[1;32mok\x1b[0m 3 µm [x]"), "ok 3 µm [x]");
    }
}
