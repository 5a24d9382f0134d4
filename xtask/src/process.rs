//! Child processes whose output is passed on and kept.

use std::io::{Read, Write};
use std::process::{Command, ExitStatus, Stdio};

use anyhow::Context as _;

/// What a child said, after the user has seen it.
#[derive(Debug)]
pub(crate) struct Said {
    pub(crate) status: ExitStatus,
    /// Standard output, then standard error.
    pub(crate) text: String,
}

/// Runs `command`; both its streams go to ours as they come and are kept.
pub(crate) fn tee(command: &mut Command) -> anyhow::Result<Said> {
    if crate::style::coloured() {
        command.env("CARGO_TERM_COLOR", "always");
    }
    // Kept apart, so that no line of one stream ends up inside a line of the other.
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let status = pump(
        command,
        |bytes| {
            out.extend_from_slice(bytes);
            pass_on(&mut std::io::stdout().lock(), bytes);
        },
        |bytes| {
            err.extend_from_slice(bytes);
            pass_on(&mut std::io::stderr().lock(), bytes);
        },
    )?;
    out.extend_from_slice(&err);
    Ok(Said { status, text: String::from_utf8_lossy(&out).into_owned() })
}

/// Runs `command` and gives its output to `out` and its errors to `err`, in pieces as they come.
pub(crate) fn pump(
    command: &mut Command,
    mut out: impl FnMut(&[u8]) + Send,
    mut err: impl FnMut(&[u8]),
) -> anyhow::Result<ExitStatus> {
    let name = command.get_program().to_string_lossy().into_owned();
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {name}"))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        scope.spawn(move || drain(stdout, &mut out));
        drain(stderr, &mut err);
    });
    child.wait().with_context(|| format!("lost {name}"))
}

fn drain(stream: Option<impl Read>, sink: &mut impl FnMut(&[u8])) {
    let Some(mut stream) = stream else { return };
    let mut buffer = [0; 8192];
    loop {
        match stream.read(&mut buffer) {
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Ok(0) | Err(_) => return,
            Ok(n) => sink(&buffer[..n]),
        }
    }
}

/// Writes at once. A reader that went away is no reason to stop the child.
pub(crate) fn pass_on(to: &mut impl Write, bytes: &[u8]) {
    let _ = to.write_all(bytes).and_then(|()| to.flush());
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn both_streams_and_the_exit_code_arrive() {
        let mut command = Command::new("sh");
        command.args(["-c", "echo to out; echo to err >&2; exit 7"]);
        let said = tee(&mut command).unwrap();
        assert_eq!(said.status.code(), Some(7));
        assert!(said.text.contains("to out\n") && said.text.contains("to err\n"), "{}", said.text);
    }

    #[test]
    fn a_program_that_does_not_exist_is_named() {
        let e = tee(&mut Command::new("no-such-program-here")).unwrap_err();
        assert!(e.to_string().contains("no-such-program-here"), "{e}");
    }
}
