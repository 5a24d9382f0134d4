//! `ledger`: what the fail-safe layer said during a run, by cause.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use anyhow::Context as _;
use palpate_runs::{Csv, RunDir};

use crate::train::book::FILE;

/// What the columns of the table are.
const LEGEND: &str = "\
events: verdicts, one however many control ticks in a row; then per episode, per 1000 steps, per successful episode,
and per 1000 steps in the first and the last tenth of the run. distance: the least to the limit that decided, in its
unit (N or N m, m, rad, rad/s), negative beyond it. force: the largest at the beginning of an event, filtered
";

/// All verdicts of one cause.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Row {
    /// As in `ledger.csv`.
    pub cause: String,
    /// Times it was given, however many ticks in a row.
    pub events: u64,
    /// Control ticks of 2 ms.
    pub ticks: u64,
    /// Events per episode.
    pub per_episode: f64,
    /// Events per 1,000 environment steps.
    pub per_1000_steps: f64,
    /// Events per successful episode; none before the first.
    pub per_success: Option<f64>,
    /// The same in the first and the last tenth of the run's steps, per 1,000 steps.
    pub early_and_late: (f64, f64),
    /// Furthest beyond the limit (negative) or nearest to it, in the limit's own unit.
    pub least_distance: Option<f64>,
    /// Largest force at the beginning of an event, N.
    pub largest_force: f64,
}

/// What `ledger` prints.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Environment steps.
    pub steps: u64,
    /// Finished episodes.
    pub episodes: u64,
    /// Of these, those that reached the goal.
    pub successes: u64,
    /// The most frequent first.
    pub causes: Vec<Row>,
}

impl Report {
    /// Reads a run's tables.
    pub fn of(run: &Path) -> anyhow::Result<Self> {
        RunDir::view(run)?;
        let episodes = Csv::read(&run.join("episodes.csv"))?;
        let column = |name| anyhow::Ok(episodes.column(name)?.into_iter().flatten());
        let steps = column("step")?.last().unwrap_or(0.0) as u64;
        let successes = column("success")?.sum::<f64>() as u64;
        let path = run.join(FILE);
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!("cannot read {}: was the run made before there was one?", path.display())
        })?;
        let mut report =
            Self { steps, episodes: episodes.rows() as u64, successes, causes: Vec::new() };
        report.read(&text).with_context(|| format!("{} is damaged", path.display()))?;
        Ok(report)
    }

    fn read(&mut self, text: &str) -> anyhow::Result<()> {
        let mut lines = text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let at = |name: &str| {
            header.iter().position(|h| *h == name).with_context(|| format!("no column {name}"))
        };
        let (cause, step, ticks, distance) =
            (at("cause")?, at("step")?, at("ticks")?, at("distance")?);
        let force = [at("fx")?, at("fy")?, at("fz")?];
        let tenth = self.steps as f64 / 10.0;
        let mut rows = BTreeMap::<&str, Row>::new();
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let cell =
                |i: usize| cells.get(i).copied().with_context(|| format!("short row {line}"));
            let number = |i: usize| -> anyhow::Result<f64> {
                cell(i)?.parse().with_context(|| format!("`{}` is no number", cells[i]))
            };
            let row = rows.entry(cell(cause)?).or_default();
            row.events += 1;
            row.ticks += number(ticks)? as u64;
            let when = number(step)?;
            row.early_and_late.0 += f64::from(u8::from(when <= tenth));
            row.early_and_late.1 += f64::from(u8::from(when > 9.0 * tenth));
            if !cell(distance)?.is_empty() {
                let distance = number(distance)?;
                row.least_distance = Some(row.least_distance.map_or(distance, |d| d.min(distance)));
            }
            let mut squares = 0.0;
            for i in force {
                squares += number(i)?.powi(2);
            }
            row.largest_force = row.largest_force.max(squares.sqrt());
        }
        self.causes = rows.into_iter().map(|(cause, row)| self.finished(cause, &row)).collect();
        self.causes.sort_by_key(|row| std::cmp::Reverse(row.events));
        Ok(())
    }

    fn finished(&self, cause: &str, row: &Row) -> Row {
        let (events, thousands) = (row.events as f64, self.steps.max(1) as f64 / 1000.0);
        let part = thousands / 10.0;
        Row {
            cause: cause.into(),
            per_episode: events / self.episodes.max(1) as f64,
            per_1000_steps: events / thousands,
            per_success: (self.successes > 0).then(|| events / self.successes as f64),
            early_and_late: (row.early_and_late.0 / part, row.early_and_late.1 / part),
            ..row.clone()
        }
    }

    fn table(&self) -> String {
        use std::fmt::Write as _;
        let Self { steps, episodes, successes, causes } = self;
        let mut out = format!("{steps} steps, {episodes} episodes, {successes} successes\n");
        if causes.is_empty() {
            out.push_str("the fail-safe layer let every command pass\n");
            return out;
        }
        let _ = writeln!(
            out,
            "{:<22} {:>8} {:>9} {:>9} {:>8} {:>9}  {:>17}  {:>9} {:>9}",
            "cause",
            "events",
            "ticks",
            "/episode",
            "/1000",
            "/success",
            "/1000 first, last",
            "distance",
            "force N"
        );
        for r in causes {
            let or_none = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| format!("{x:.3}"));
            let (early, late) = r.early_and_late;
            let _ = writeln!(
                out,
                "{:<22} {:>8} {:>9} {:>9.2} {:>8.1} {:>9}  {:>17}  {:>9} {:>9.1}",
                r.cause,
                r.events,
                r.ticks,
                r.per_episode,
                r.per_1000_steps,
                or_none(r.per_success),
                format!("{early:.1}, {late:.1}"),
                or_none(r.least_distance),
                r.largest_force,
            );
        }
        out.push_str(LEGEND);
        out
    }
}

/// The `ledger` command.
pub fn command(run: &Path, json: bool, out: &mut dyn Write) -> anyhow::Result<()> {
    let report = Report::of(run)?;
    if json {
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        write!(out, "{}", report.table())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "cause,step,ticks,distance,fx,fy,fz\n\
                        joint-speed,50,3,-0.5,0,0,0\n\
                        force-soft,100,1,-2,3,4,0\n\
                        joint-speed,980,2,-0.7,0,0,1\n\
                        no-ik,990,1,,0,0,0\n";

    fn report(text: &str) -> anyhow::Result<Report> {
        let mut report = Report { steps: 1000, episodes: 10, successes: 4, causes: Vec::new() };
        report.read(text).map(|()| report)
    }

    #[test]
    fn events_are_counted_by_cause() {
        let report = report(TEXT).unwrap();
        let first = &report.causes[0];
        assert_eq!((first.cause.as_str(), first.events, first.ticks), ("joint-speed", 2, 5));
        assert_eq!(
            (first.per_episode, first.per_1000_steps, first.per_success),
            (0.2, 2.0, Some(0.5))
        );
        assert_eq!((first.early_and_late, first.least_distance), ((10.0, 10.0), Some(-0.7)));
        let force = report.causes.iter().find(|r| r.cause == "force-soft").unwrap();
        assert_eq!((force.largest_force, force.early_and_late), (5.0, (10.0, 0.0)));
        let no_ik = report.causes.iter().find(|r| r.cause == "no-ik").unwrap();
        assert_eq!(no_ik.least_distance, None);
        assert!(report.table().contains("force-soft"), "{}", report.table());
    }

    #[test]
    fn half_a_row_is_being_written_and_a_bad_one_is_an_error() {
        assert_eq!(report(&format!("{TEXT}joint-sp")).unwrap(), report(TEXT).unwrap());
        let said = format!("{:#}", report(&format!("{TEXT}plane,9,x,0,0,0,0\n")).unwrap_err());
        assert!(said.contains("`x` is no number"), "{said}");
        report("a,b\n").unwrap_err();
    }
}
