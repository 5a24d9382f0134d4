//! `study report`: a study's rows as tables, curves and statistics, in Markdown and on one page of HTML.
//!
//! It needs the collected rows alone; run directories are needed only to collect them and for what the policies do.

mod chapters;
mod document;
mod evolution;
mod figures;
mod group;
mod orderings;
mod paper;
mod policies;
mod variations;

use std::path::PathBuf;

use anyhow::bail;
use palpate_runs::write_whole;

use super::folder::Folder;
use document::{Item, html, markdown};

/// Collects the rows and writes the report; the files.
pub(super) fn write(folder: &Folder) -> anyhow::Result<Vec<PathBuf>> {
    let rows = folder.rows()?;
    if rows.runs.is_empty() {
        bail!("no run of {} is done yet; see `study status`", folder.path.display());
    }
    rows.write(&folder.path)?;
    let motions = evolution::collect(folder)?;
    let chapters = chapters::all(folder, &rows, &motions);
    let title = format!("Study: {}", folder.study.name);
    let mut files = Vec::new();
    let mut put = |name: &str, text: &str| -> anyhow::Result<()> {
        let path = folder.path.join(name);
        write_whole(&path, text.as_bytes())?;
        files.push(path);
        Ok(())
    };
    for item in chapters.iter().flat_map(|chapter| &chapter.items) {
        if let Item::Figure(file, svg, _) = item {
            put(file, svg)?;
        }
    }
    put("report.html", &html(&title, &chapters))?;
    put("report.md", &markdown(&title, &chapters))?;
    Ok(files)
}
