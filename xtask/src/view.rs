//! `cargo xtask view RUN`: lists recordings and opens them with what is installed.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, bail};

use crate::{USAGE, workspace};

const HELP: &str = "\
Usage: cargo xtask view RUN [PART_OF_A_NAME]… [--list]

Lists the recordings of a run (RUN/episodes, or any folder or file of .mcap) and opens those whose names hold one of
the parts given; without one, the latest. --list opens nothing.
";

const HOW: &str = "\
To look at them:
  Rerun      pip install rerun-sdk, then this command again; or: rerun FILE.mcap
  Foxglove   open FILE.mcap in the Foxglove app; add a 3D panel and a Plot panel
";

/// Something that shows recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Viewer {
    /// Rerun with its plots arranged, by python/view.py.
    Arranged,
    /// Rerun as it comes.
    Rerun,
    /// The Foxglove app.
    Foxglove,
}

pub(crate) fn command(args: &[OsString]) -> anyhow::Result<ExitCode> {
    let args: Vec<String> = args.iter().map(|a| a.to_string_lossy().into_owned()).collect();
    let (flags, words): (Vec<&String>, Vec<&String>) =
        args.iter().partition(|a| a.starts_with('-'));
    let list_only = flags.iter().any(|flag| *flag == "--list");
    let Some((place, parts)) = words.split_first() else {
        eprint!("{HELP}");
        return Ok(ExitCode::from(USAGE));
    };
    if let Some(unknown) = flags.iter().find(|flag| **flag != "--list") {
        eprint!("{unknown} means nothing here\n\n{HELP}");
        return Ok(ExitCode::from(USAGE));
    }
    let recordings = recordings(Path::new(place))?;
    for path in &recordings {
        let size = std::fs::metadata(path).map_or(0, |m| m.len());
        println!("{:>7.1} MB  {}", size as f64 / 1e6, path.display());
    }
    if list_only {
        return Ok(ExitCode::SUCCESS);
    }
    let chosen = chosen(&recordings, &parts.iter().map(|p| p.as_str()).collect::<Vec<_>>())?;
    if let Some(viewer) = viewer() {
        return open(viewer, &chosen);
    }
    print!("\n{HOW}");
    Ok(ExitCode::SUCCESS)
}

/// The recordings of a run, of a folder, or the one that is named; the oldest first.
fn recordings(place: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if place.extension().is_some_and(|e| e == "mcap") && place.is_file() {
        return Ok(vec![place.to_owned()]);
    }
    let inside = place.join("episodes");
    let folder = if inside.is_dir() { inside } else { place.to_owned() };
    let entries = std::fs::read_dir(&folder)
        .with_context(|| format!("there is no run or folder {}", place.display()))?;
    let mut found: Vec<(std::time::SystemTime, PathBuf)> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let recorded = path.extension().is_some_and(|e| e == "mcap");
            recorded.then(|| Some((path.metadata().ok()?.modified().ok()?, path)))?
        })
        .collect();
    if found.is_empty() {
        bail!(
            "{} holds no recording: trainings record as [record] of their configuration says; \
             `cargo xtask evaluate RUN --record DIR` records a policy",
            folder.display()
        );
    }
    found.sort();
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

/// Those whose names hold one of the parts; the latest without a part.
fn chosen<'a>(recordings: &'a [PathBuf], parts: &[&str]) -> anyhow::Result<Vec<&'a Path>> {
    if parts.is_empty() {
        return Ok(recordings.last().map(PathBuf::as_path).into_iter().collect());
    }
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let chosen: Vec<&Path> = recordings
        .iter()
        .map(PathBuf::as_path)
        .filter(|path| parts.iter().any(|part| name(path).contains(part)))
        .collect();
    if chosen.is_empty() {
        bail!("no recording is called {}", parts.join(" or "));
    }
    Ok(chosen)
}

fn runs(program: &str, args: &[&str]) -> bool {
    Command::new(program).args(args).output().is_ok_and(|out| out.status.success())
}

fn viewer() -> Option<Viewer> {
    if runs("python3", &["-c", "import rerun.blueprint"]) {
        Some(Viewer::Arranged)
    } else if runs("rerun", &["--version"]) {
        Some(Viewer::Rerun)
    } else if runs("foxglove-studio", &["--version"]) {
        Some(Viewer::Foxglove)
    } else {
        None
    }
}

fn open(viewer: Viewer, files: &[&Path]) -> anyhow::Result<ExitCode> {
    let mut command = match viewer {
        Viewer::Arranged => {
            let mut command = Command::new("python3");
            command.arg(workspace::root().join("python/view.py"));
            command
        }
        Viewer::Rerun => Command::new("rerun"),
        Viewer::Foxglove => Command::new("foxglove-studio"),
    };
    println!(
        "\nopening {} with {viewer:?}",
        files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", ")
    );
    let status = command.args(files).status().context("cannot start the viewer")?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_is_shown_unless_some_are_named() {
        let all: Vec<PathBuf> =
            ["collision_1.mcap", "eval_1.mcap", "eval_2.mcap"].map(PathBuf::from).to_vec();
        let names = |parts: &[&str]| {
            chosen(&all, parts)
                .map(|c| c.iter().map(|p| p.display().to_string()).collect::<Vec<_>>())
        };
        assert_eq!(names(&[]).unwrap(), ["eval_2.mcap"]);
        assert_eq!(names(&["collision", "_2"]).unwrap(), ["collision_1.mcap", "eval_2.mcap"]);
        assert!(names(&["success"]).unwrap_err().to_string().contains("success"));
    }

    #[test]
    fn a_folder_without_recordings_says_how_to_make_some() {
        let error = recordings(&workspace::root().join("docs")).unwrap_err().to_string();
        assert!(error.contains("--record"), "{error}");
        let error = recordings(Path::new("no/such/run")).unwrap_err().to_string();
        assert!(error.contains("no/such/run"), "{error}");
    }
}
