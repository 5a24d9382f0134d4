//! The release binary: built when stale, then run in our place.

use std::ffi::OsString;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context as _, bail, ensure};

use crate::process::{pass_on, pump};
use crate::workspace::cargo;

/// Builds the binary if it is stale and gives its path.
pub(crate) fn binary() -> anyhow::Result<PathBuf> {
    built_with(&[])
}

fn built_with(features: &[&str]) -> anyhow::Result<PathBuf> {
    executables(&[&["-p", "palpate", "--bin", "palpate"], features].concat())?
        .pop()
        .map(|(_, path)| path)
        .context("cargo built no executable called palpate")
}

/// Builds and becomes `palpate ARGS…`.
pub(crate) fn exec(args: &[OsString]) -> anyhow::Result<ExitCode> {
    let features: &[&str] = if on_a_gpu(args) {
        ensure!(
            Command::new("nvcc").arg("--version").stdout(Stdio::null()).status().is_ok(),
            "updates on a GPU are built with NVIDIA's CUDA toolkit, and there is no nvcc in PATH: install the toolkit \
             and put its bin/ there, or leave --device cuda away"
        );
        &["--features", "cuda"]
    } else {
        &[]
    };
    let mut command = Command::new(built_with(features)?);
    command.args(args);
    become_it(command)
}

/// Whether updates are asked for on a GPU, or were so by the run that is gone on with.
fn on_a_gpu(args: &[OsString]) -> bool {
    let was = |run: &str| {
        let text = std::fs::read_to_string(Path::new(run).join("config.toml")).unwrap_or_default();
        text.lines().any(|line| line.trim() == "device = \"cuda\"")
    };
    let args: Vec<_> = args.iter().map(|arg| arg.to_string_lossy()).collect();
    let apart = args.windows(2).map(|pair| (&*pair[0], &*pair[1]));
    let joined = args.iter().filter_map(|arg| arg.split_once('='));
    apart.chain(joined).any(|(key, value)| match key {
        "--device" => value == "cuda",
        "--resume" | "--from" => was(value),
        "--set" => value.replace(['"', ' '], "") == "sac.device=cuda",
        _ => false,
    })
}

/// Replaces this process, so that there is one process for Ctrl-C to reach and one exit code.
#[cfg(unix)]
fn become_it(mut command: Command) -> anyhow::Result<ExitCode> {
    use std::os::unix::process::CommandExt as _;
    let error = command.exec();
    Err(error).with_context(|| format!("cannot run {}", command.get_program().display()))
}

/// The console hands Ctrl-C to both processes; this one has nothing to do but wait.
#[cfg(not(unix))]
fn become_it(mut command: Command) -> anyhow::Result<ExitCode> {
    let status = command
        .status()
        .with_context(|| format!("cannot run {}", command.get_program().display()))?;
    Ok(status.code().and_then(|c| u8::try_from(c).ok()).map_or(ExitCode::FAILURE, ExitCode::from))
}

/// `cargo build --release SELECTION…`: name and path of every executable. Silent when nothing is stale.
pub(crate) fn executables(selection: &[&str]) -> anyhow::Result<Vec<(String, PathBuf)>> {
    let mut command = cargo();
    command
        .args(["build", "--release", "--message-format=json-render-diagnostics"])
        .args(selection)
        .stdin(Stdio::null());
    if std::io::stderr().is_terminal() {
        // cargo sees a pipe; what it draws ends on a terminal all the same.
        command.envs([
            ("CARGO_TERM_COLOR", "always"),
            ("CARGO_TERM_PROGRESS_WHEN", "always"),
            ("CARGO_TERM_PROGRESS_WIDTH", "80"),
        ]);
    }
    let (mut messages, mut gate) = (Vec::new(), Gate::default());
    let status = pump(
        &mut command,
        |bytes| messages.extend_from_slice(bytes),
        |bytes| {
            let show = gate.take(bytes);
            pass_on(&mut std::io::stderr().lock(), &show);
        },
    )?;
    if !status.success() {
        pass_on(&mut std::io::stderr().lock(), &gate.held);
        bail!("the release build failed; nothing was run");
    }
    Ok(built(&String::from_utf8_lossy(&messages)))
}

/// Executables in cargo's JSON messages.
fn built(messages: &str) -> Vec<(String, PathBuf)> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-artifact")
        .filter_map(|m| {
            Some((m["target"]["name"].as_str()?.into(), m["executable"].as_str()?.into()))
        })
        .collect()
}

/// Said before the first line of cargo's own progress.
const NOTICE: &str =
    "building the release binary; the first build takes minutes, later ones seconds\n";

/// Holds back what cargo writes until it has work to do: a fresh build only says `Finished`.
#[derive(Debug, Default)]
struct Gate {
    held: Vec<u8>,
    open: bool,
}

impl Gate {
    /// Takes a piece of cargo's standard error and gives what to show now.
    fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        if self.open {
            return bytes.to_vec();
        }
        self.held.extend_from_slice(bytes);
        let text = String::from_utf8_lossy(&self.held);
        let building = ["Compiling", "Downloading"].iter().any(|word| text.contains(word));
        // Waiting for a lock, and everything that went wrong, is worth seeing without the notice.
        let talking = ["Blocking", "warning", "error"].iter().any(|word| text.contains(word));
        if !(building || talking) {
            return Vec::new();
        }
        self.open = true;
        let mut show = if building { NOTICE.as_bytes().to_vec() } else { Vec::new() };
        show.append(&mut self.held);
        show
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fresh_build_is_silent_and_a_stale_one_is_not() {
        let mut gate = Gate::default();
        assert!(gate.take(b"    Finished `release` profile [optimized] in 0.1s\n").is_empty());

        let mut gate = Gate::default();
        assert!(gate.take(b"   Comp").is_empty(), "words may arrive in pieces");
        let shown = String::from_utf8(gate.take(b"iling nalgebra v0.35.0\n")).unwrap();
        assert!(
            shown.starts_with(NOTICE) && shown.ends_with("   Compiling nalgebra v0.35.0\n"),
            "{shown}"
        );
        assert_eq!(gate.take(b"    Finished"), b"    Finished");
    }

    #[test]
    fn a_gpu_is_asked_for_by_word_or_by_a_run() {
        let run = std::env::temp_dir().join(format!("palpate-gpu-{}", std::process::id()));
        std::fs::create_dir_all(&run).unwrap();
        let wants = |args: &str| {
            let args = args.replace("RUN", &run.to_string_lossy());
            on_a_gpu(&args.split(' ').map(OsString::from).collect::<Vec<_>>())
        };
        assert!(wants("train-sim --device cuda") && wants("train-sim --device=cuda"));
        assert!(!wants("train-sim --device cpu") && !wants("train-sim --resume RUN"));
        std::fs::write(run.join("config.toml"), "[sac]\ndevice = \"cuda\"\n").unwrap();
        assert!(wants("train-sim --resume RUN") && wants("train-sim --from RUN --steps 9"));
        assert!(wants("train-sim --resume=RUN") && wants("train-sim --from=RUN"));
        assert!(
            wants("train-sim --set sac.device=\"cuda\"") && !wants("train-sim --set sac.gamma=1")
        );
        assert!(!wants("evaluate RUN"));
        std::fs::remove_dir_all(&run).unwrap();
    }

    #[test]
    fn a_compile_error_is_shown() {
        let mut gate = Gate::default();
        assert_eq!(gate.take(b"error: no such package"), b"error: no such package");
    }

    #[test]
    fn executables_are_found_among_cargos_messages() {
        let messages = r#"{"reason":"compiler-artifact","target":{"name":"serde"},"executable":null}
not json
{"reason":"compiler-artifact","target":{"name":"palpate"},"executable":"/x/release/palpate"}
{"reason":"build-finished","success":true}"#;
        assert_eq!(built(messages), [("palpate".to_owned(), PathBuf::from("/x/release/palpate"))]);
    }
}
