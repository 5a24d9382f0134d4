//! What training does when the disk refuses: it waits, and loses nothing.
//!
//! A full disk, a quota or a folder that has become read-only is a person's to mend. Until then training stands
//! still, as at the end of an episode on an arm, and tries again; the checkpoints on disk are whole all the time.

use std::time::{Duration, Instant};

use anyhow::Context as _;
use palpate_runs::{Console, RunError};

use crate::interrupt;

const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// An unattended run ends after this: its place may be wanted.
const PATIENCE: Duration = Duration::from_mins(15);

/// Does something that writes, until the disk takes it, a person ends the run, or patience does.
pub(super) fn insist<T>(
    console: &mut Console,
    mut attempt: impl FnMut() -> Result<T, RunError>,
) -> anyhow::Result<T> {
    let (began, mut pause, mut waited) = (Instant::now(), FIRST_PAUSE, false);
    loop {
        let error = match attempt() {
            Ok(done) => {
                if waited {
                    console.note("the disk takes it now: training goes on");
                }
                return Ok(done);
            }
            Err(error) => error,
        };
        let hopeless = !error.is_storage() || began.elapsed() > PATIENCE;
        let error = anyhow::Error::from(error);
        if hopeless || interrupt::requested() {
            return Err(error)
                .context("what is on disk is whole: --resume goes on from the last checkpoint");
        }
        if !waited {
            console.note(&format!(
                "the disk refuses: {error:#}\nTraining waits for up to {} minutes and loses nothing: make room. Ctrl-C ends the run.",
                PATIENCE.as_secs() / 60
            ));
        }
        waited = true;
        std::thread::sleep(pause);
        pause = LONGEST_PAUSE.min(2 * pause);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(kind: std::io::ErrorKind) -> RunError {
        let (action, path) = ("append to", "metrics.csv".into());
        RunError::Io { action, path, source: kind.into() }
    }

    #[test]
    fn a_full_disk_is_waited_for_and_other_errors_are_not() {
        let mut console = Console::new(1, 0);
        let mut left = 3;
        let done = insist(&mut console, || {
            left -= 1;
            if left > 0 { Err(refusal(std::io::ErrorKind::StorageFull)) } else { Ok(left) }
        });
        assert_eq!(done.unwrap(), 0);
        let mut tries = 0;
        let error = insist(&mut console, || {
            tries += 1;
            Err::<(), _>(refusal(std::io::ErrorKind::PermissionDenied))
        });
        assert_eq!(tries, 1);
        let said = format!("{:#}", error.unwrap_err());
        assert!(said.contains("--resume") && said.contains("metrics.csv"), "{said}");
    }
}
