//! Every transition on disk before it is learned from.
//!
//! A thread stands between the control thread and the learner: what the arm went through is in the journal, synced,
//! however far behind the learner is. A kill or a power cut loses the step in flight and no other.

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use anyhow::Context as _;
use palpate_runs::{JOURNAL, Journal};

use super::thread::News;
use crate::train::lesson::Lesson;
use crate::train::pupil::Pupil;

/// Opens the journal of a run; what it holds beyond the checkpoint is learned now.
pub(super) fn catch_up(dir: &Path, pupil: &mut Pupil) -> anyhow::Result<Journal> {
    let (journal, held) = Journal::open(&dir.join(JOURNAL))?;
    if let Some(damage) = &held.damage {
        pupil.console.note(&format!(
            "{JOURNAL}: {damage}; the {} transitions before it are kept, the rest is in {JOURNAL}.cut",
            held.records.len()
        ));
    }
    let (observation, action) = (pupil.agent.observation_dim(), pupil.agent.action_dim());
    let (from, mut last) = (pupil.progress.step, None);
    for record in &held.records {
        let (number, lesson) = Lesson::parse(record, observation, action)
            .with_context(|| format!("{JOURNAL} is that of another task"))?;
        if number > pupil.progress.step {
            // Steps that a full disk kept out of the journal are not counted twice.
            pupil.progress.step = number - 1;
            pupil.take(&lesson)?;
            last = Some(lesson);
        }
    }
    if let Some(lesson) = last {
        if !lesson.episode_end {
            pupil.agent.end_episode();
        }
        pupil.console.note(&format!(
            "{} steps that the arm took after the last checkpoint are back from the journal",
            pupil.progress.step - from
        ));
        pupil.checkpoint()?;
    }
    Ok(journal)
}

/// Puts the journal between the control thread's news and whoever listens; `step` have been taken before.
pub(super) fn tee(
    mut journal: Journal,
    news: Receiver<News>,
    mut step: u64,
    room: usize,
) -> anyhow::Result<Receiver<News>> {
    let (out, kept): (SyncSender<News>, _) = sync_channel(room);
    std::thread::Builder::new()
        .name("journal".into())
        .spawn(move || {
            let mut failing = false;
            for item in news {
                if let News::Step(lesson) = &item {
                    step += 1;
                    let result = journal.append(&lesson.record(step));
                    if let (Err(error), false) = (&result, failing) {
                        tracing::warn!("the journal has gaps until this is mended: {error}");
                    }
                    failing = result.is_err();
                }
                if out.send(item).is_err() {
                    return;
                }
            }
        })
        .context("cannot start the journal's thread")?;
    Ok(kept)
}
