//! What finished runs leave: one row per run, per episode and per judged episode, as CSV for pandas and rliable.

use std::path::Path;

use anyhow::Context as _;
use palpate_runs::{Csv, write_whole};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// File in a run's folder that says it is done: its rows of runs.csv and times.csv.
pub(super) const RESULT: &str = "result.json";
/// File in a run's folder with its judged episodes.
pub(super) const EVALUATION: &str = "evaluation.csv";

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RunRow {
    pub(super) run: String,
    pub(super) block: String,
    pub(super) task: String,
    pub(super) model: String,
    /// What acts: `learned`, or a baseline.
    pub(super) policy: super::plan::Kind,
    pub(super) penalty: bool,
    pub(super) seed: u64,
    /// Episodes it was shown before it began.
    #[serde(default)]
    pub(super) demonstrations: u64,
    /// Environment steps taken.
    pub(super) steps: u64,
    /// Keys and values that the block tries.
    pub(super) varied: String,
    pub(super) episodes: u64,
    pub(super) successes: u64,
    pub(super) collisions: u64,
    pub(super) first_success_step: Option<u64>,
    /// Step of the kept policy.
    pub(super) kept_step: Option<u64>,
}

/// How long a run took, and where: what may differ between equal runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TimeRow {
    pub(super) run: String,
    /// Of the part since its last start.
    pub(super) seconds: f64,
    /// Of an update.
    pub(super) threads: usize,
    pub(super) cpu: String,
    /// Of the sources' checkout when the run was started; the program may have been built from an earlier one.
    pub(super) commit: String,
    pub(super) version: String,
}

/// A training episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct EpisodeRow {
    pub(super) run: String,
    pub(super) episode: u64,
    /// Environment step at its end.
    pub(super) step: u64,
    #[serde(rename = "return")]
    pub(super) total: f64,
    pub(super) length: u64,
    pub(super) success: u8,
    pub(super) collision: u8,
    /// N.
    pub(super) peak_force: f64,
}

/// A judged episode of a finished policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct JudgedRow {
    pub(super) run: String,
    /// What was changed about the world; nothing if empty.
    #[serde(default)]
    pub(super) condition: String,
    /// `last`, `kept`, or a baseline's name.
    pub(super) policy: String,
    /// `mean` or `sampled` actions.
    pub(super) actions: String,
    pub(super) episode: u64,
    pub(super) success: u8,
    pub(super) collision: u8,
    #[serde(rename = "return")]
    pub(super) total: f64,
    pub(super) length: u64,
    /// s.
    pub(super) seconds: f64,
    /// N.
    pub(super) peak_force: f64,
    /// N.
    pub(super) mean_force: f64,
}

/// A point of a training's evaluations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct CurveRow {
    pub(super) run: String,
    pub(super) step: u64,
    pub(super) success_rate: f64,
    pub(super) mean_return: f64,
    pub(super) mean_length: f64,
    /// N, median.
    pub(super) peak_force: f64,
    pub(super) q_minus_return: f64,
}

/// What result.json holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) run: RunRow,
    pub(super) time: TimeRow,
}

/// Rows of some runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rows {
    pub(super) runs: Vec<RunRow>,
    pub(super) times: Vec<TimeRow>,
    pub(super) episodes: Vec<EpisodeRow>,
    pub(super) judged: Vec<JudgedRow>,
    pub(super) curves: Vec<CurveRow>,
}

impl Rows {
    /// The rows of a run from its own folder; `None` if it is not done.
    pub(super) fn of_run(dir: &Path) -> Option<anyhow::Result<Self>> {
        let text = std::fs::read_to_string(dir.join(RESULT)).ok()?;
        Some(Self::of_result(dir, &text))
    }

    fn of_result(dir: &Path, text: &str) -> anyhow::Result<Self> {
        let Outcome { run, time } = serde_json::from_str(text).context("result.json")?;
        let name = run.run.clone();
        let learned = run.policy == super::plan::Kind::Learned;
        Ok(Self {
            episodes: if learned { episodes(&name, dir)? } else { Vec::new() },
            curves: if learned { curves(&name, dir)? } else { Vec::new() },
            judged: read(&dir.join(EVALUATION))?,
            runs: vec![run],
            times: vec![time],
        })
    }

    /// Names of the runs that [`write`](Self::write) wrote into a folder.
    pub(super) fn names(folder: &Path) -> anyhow::Result<Vec<String>> {
        let path = folder.join("runs.csv");
        let rows: Vec<RunRow> = if path.is_file() { read(&path)? } else { Vec::new() };
        Ok(rows.into_iter().map(|row| row.run).collect())
    }

    /// What [`write`](Self::write) wrote into a folder; nothing if it did not.
    pub(super) fn read(folder: &Path) -> anyhow::Result<Self> {
        if !folder.join("runs.csv").is_file() {
            return Ok(Self::default());
        }
        Ok(Self {
            runs: read(&folder.join("runs.csv"))?,
            times: read(&folder.join("times.csv"))?,
            episodes: read(&folder.join("episodes.csv"))?,
            judged: read(&folder.join(EVALUATION))?,
            curves: read(&folder.join("curves.csv"))?,
        })
    }

    /// Writes one table of each kind; runs.csv, which says what is in the others, last.
    pub(super) fn write(&self, folder: &Path) -> anyhow::Result<()> {
        write(&folder.join("times.csv"), &self.times)?;
        write(&folder.join("episodes.csv"), &self.episodes)?;
        write(&folder.join(EVALUATION), &self.judged)?;
        write(&folder.join("curves.csv"), &self.curves)?;
        write(&folder.join("runs.csv"), &self.runs)
    }

    /// The rows of one run.
    pub(super) fn only(&self, run: &str) -> Self {
        fn of<T: Clone>(rows: &[T], is: impl Fn(&T) -> bool) -> Vec<T> {
            rows.iter().filter(|row| is(row)).cloned().collect()
        }
        Self {
            runs: of(&self.runs, |row| row.run == run),
            times: of(&self.times, |row| row.run == run),
            episodes: of(&self.episodes, |row| row.run == run),
            judged: of(&self.judged, |row| row.run == run),
            curves: of(&self.curves, |row| row.run == run),
        }
    }

    /// Adds other runs' rows.
    pub(super) fn take(&mut self, other: Self) {
        self.runs.extend(other.runs);
        self.times.extend(other.times);
        self.episodes.extend(other.episodes);
        self.judged.extend(other.judged);
        self.curves.extend(other.curves);
    }
}

/// To four places: rows are for reading and drawing, and equal runs stay equal.
pub(super) fn rounded(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}

fn episodes(run: &str, dir: &Path) -> anyhow::Result<Vec<EpisodeRow>> {
    let csv = Csv::read(&dir.join("episodes.csv"))?;
    let columns = ["episode", "step", "return", "length", "success", "collision", "peak_force"];
    let [episode, step, total, length, success, collision, peak] = columns.map(|c| csv.column(c));
    let columns = [episode?, step?, total?, length?, success?, collision?, peak?];
    let row = |i: usize| {
        let [episode, step, total, length, success, collision, peak] =
            columns.each_ref().map(|column| column[i].unwrap_or(f64::NAN));
        EpisodeRow {
            run: run.to_owned(),
            episode: episode as u64,
            step: step as u64,
            total: rounded(total),
            length: length as u64,
            success: success as u8,
            collision: collision as u8,
            peak_force: rounded(peak),
        }
    };
    Ok((0..csv.rows()).map(row).collect())
}

fn curves(run: &str, dir: &Path) -> anyhow::Result<Vec<CurveRow>> {
    let csv = Csv::read(&dir.join("metrics.csv"))?;
    let columns = [
        "time/total_timesteps",
        "eval/success_rate",
        "eval/mean_reward",
        "eval/mean_ep_length",
        "eval/peak_force",
        "eval/q_minus_return",
    ];
    let [step, success, total, length, peak, gap] = columns.map(|c| csv.column(c));
    let columns = [step?, success?, total?, length?, peak?, gap?];
    let row = |i: usize| {
        let mut values = [0.0; 6];
        for (value, column) in values.iter_mut().zip(&columns) {
            *value = column[i]?;
        }
        let [step, success_rate, total, length, peak, gap] = values;
        Some(CurveRow {
            run: run.to_owned(),
            step: step as u64,
            success_rate,
            mean_return: rounded(total),
            mean_length: rounded(length),
            peak_force: rounded(peak),
            q_minus_return: rounded(gap),
        })
    };
    Ok((0..csv.rows()).filter_map(row).collect())
}

/// Reads a table of rows.
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<Vec<T>> {
    let mut reader =
        csv::Reader::from_path(path).with_context(|| format!("cannot read {}", path.display()))?;
    let rows = reader.deserialize().collect::<Result<_, _>>();
    rows.with_context(|| format!("{}", path.display()))
}

/// Writes a table of rows, whole or not at all.
pub(super) fn write<T: Serialize>(path: &Path, rows: &[T]) -> anyhow::Result<()> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row)?;
    }
    let bytes = writer.into_inner().context("a table in memory")?;
    Ok(write_whole(path, &bytes)?)
}
