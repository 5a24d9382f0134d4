//! A document that becomes Markdown with pictures beside it, and one page of HTML with them inside.

use std::fmt::Write as _;

use crate::report::page::{STYLE, escape, scaled, table};

/// A part of a chapter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    /// A paragraph. `**bold**` and `` `code` `` are understood.
    Text(String),
    /// Lines of a list.
    List(Vec<String>),
    Table(Vec<String>, Vec<Vec<String>>),
    /// A picture: name of its file, SVG, caption.
    Figure(String, String, String),
}

/// A chapter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chapter {
    pub(super) title: String,
    pub(super) items: Vec<Item>,
}

impl Chapter {
    pub(super) fn new(title: &str) -> Self {
        Self { title: title.into(), items: Vec::new() }
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.items.push(Item::Text(text.into()));
    }

    pub(super) fn table(&mut self, head: &[&str], rows: Vec<Vec<String>>) {
        if !rows.is_empty() {
            let head = head.iter().map(|h| (*h).to_owned()).collect();
            self.items.push(Item::Table(head, rows));
        }
    }

    /// A picture; nothing if there was nothing to draw.
    pub(super) fn figure(&mut self, file: &str, svg: Option<String>, caption: &str) {
        if let Some(svg) = svg {
            self.items.push(Item::Figure(file.into(), svg, caption.into()));
        }
    }
}

/// As Markdown.
pub(super) fn markdown(title: &str, chapters: &[Chapter]) -> String {
    let mut out = format!("# {title}\n");
    for chapter in chapters.iter().filter(|c| !c.items.is_empty()) {
        _ = write!(out, "\n## {}\n", chapter.title);
        for item in &chapter.items {
            out.push('\n');
            match item {
                Item::Text(text) => _ = writeln!(out, "{text}"),
                Item::List(lines) => lines.iter().for_each(|line| _ = writeln!(out, "- {line}")),
                Item::Table(head, rows) => {
                    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
                    out += &line(head);
                    _ = writeln!(out, "|{}", "---|".repeat(head.len()));
                    for row in rows {
                        out += &line(row);
                    }
                }
                Item::Figure(file, _, caption) => _ = writeln!(out, "![{caption}]({file})"),
            }
        }
    }
    out
}

/// As a page that needs no network.
pub(super) fn html(title: &str, chapters: &[Chapter]) -> String {
    let mut body = format!("<header><h1>{}</h1></header>", escape(title));
    for chapter in chapters.iter().filter(|c| !c.items.is_empty()) {
        _ = write!(body, "<section><h2>{}</h2>", escape(&chapter.title));
        let mut figures = String::new();
        for item in &chapter.items {
            if !matches!(item, Item::Figure(..)) && !figures.is_empty() {
                _ = write!(body, "<div class=figures>{}</div>", std::mem::take(&mut figures));
            }
            match item {
                Item::Text(text) => _ = write!(body, "<p>{}</p>", spans(text)),
                Item::List(lines) => {
                    let line = |line: &String| format!("<li>{}</li>", spans(line));
                    let lines = lines.iter().map(line).collect::<Vec<_>>().concat();
                    _ = write!(body, "<ul>{lines}</ul>");
                }
                Item::Table(head, rows) => {
                    let head: Vec<String> = head.iter().map(|cell| spans(cell)).collect();
                    let head: Vec<&str> = head.iter().map(String::as_str).collect();
                    let rows: Vec<Vec<String>> = rows
                        .iter()
                        .map(|row| row.iter().map(|cell| spans(cell)).collect())
                        .collect();
                    body += &table(&head, &rows);
                }
                Item::Figure(_, svg, caption) => {
                    let caption = format!("<figcaption>{}</figcaption>", spans(caption));
                    _ = write!(figures, "<figure>{}{caption}</figure>", scaled(svg));
                }
            }
        }
        if !figures.is_empty() {
            _ = write!(body, "<div class=figures>{figures}</div>");
        }
        body += "</section>";
    }
    format!(
        "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8>\
         <meta name=viewport content=\"width=device-width, initial-scale=1\">\
         <title>{}</title><style>{STYLE}</style></head><body><main>{body}</main></body></html>\n",
        escape(title)
    )
}

/// Bold and code of a line as HTML.
fn spans(text: &str) -> String {
    let mut out = escape(text);
    for (mark, tag) in [("**", "b"), ("`", "code")] {
        let parts: Vec<&str> = out.split(mark).collect();
        if parts.len().is_multiple_of(2) {
            continue;
        }
        let marked = |(i, part): (usize, &&str)| {
            if i % 2 == 1 { format!("<{tag}>{part}</{tag}>") } else { (*part).to_owned() }
        };
        out = parts.iter().enumerate().map(marked).collect();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_everything() {
        let mut chapter = Chapter::new("Curves & more");
        chapter.text("**P-14** by `study run`");
        chapter.items.push(Item::List(vec!["one".into()]));
        chapter.table(&["a", "b"], vec![vec!["1 < 2".into(), "**3**".into()]]);
        chapter.figure(
            "x.svg",
            Some("<svg width=\"2\" height=\"1\"><g/></svg>".into()),
            "a figure",
        );
        let empty = Chapter::new("nothing");
        let md = markdown("T", &[chapter.clone(), empty.clone()]);
        assert_eq!(
            md,
            "# T\n\n## Curves & more\n\n**P-14** by `study run`\n\n- one\n\n| a | b |\n|---|---|\n| 1 < 2 | **3** |\n\n![a figure](x.svg)\n"
        );
        let page = html("T", &[chapter, empty]);
        for part in [
            "<h2>Curves &amp; more</h2>",
            "<b>P-14</b> by <code>study run</code>",
            "<li>one</li>",
            "<td>1 &lt; 2</td><td><b>3</b></td>",
            "viewBox=\"0 0 2 1\"",
            "<figcaption>a figure</figcaption>",
        ] {
            assert!(page.contains(part), "{part} in {page}");
        }
        assert!(!page.contains("nothing"));
    }
}
