//! The scalars of a run, for spreadsheets and for TensorBoard.

use crate::tensorboard::EventFile;
use crate::{Mark, RunDir, RunError, Table};

/// metrics.csv and the event files in tb/.
#[derive(Debug)]
pub struct Metrics {
    table: Table,
    /// Gone after the first error: the table is the record, TensorBoard a view of it.
    events: Option<EventFile>,
    columns: Vec<String>,
    /// Earlier event files may hold rows that are written again.
    resumed: bool,
}

impl Metrics {
    /// Opens the metrics and cuts them where a checkpoint left them; see [`Table::open`].
    pub fn open(dir: &RunDir, columns: &[&str], mark: Mark) -> Result<Self, RunError> {
        Ok(Self {
            table: Table::open(&dir.path().join("metrics.csv"), columns, mark)?,
            events: Some(EventFile::create(&dir.path().join("tb"))?),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            resumed: mark.rows > 0,
        })
    }

    /// Appends a row, one value per column. `step` is the abscissa in TensorBoard.
    ///
    /// After an error it can be tried again. If only the event file fails, the run goes on without it.
    pub fn write(&mut self, step: u64, values: &[Option<f64>]) -> Result<(), RunError> {
        self.table.write(values)?;
        let restart = std::mem::take(&mut self.resumed);
        let names = self.columns.iter().map(String::as_str);
        let scalars = names.zip(values).filter_map(|(name, value)| Some((name, (*value)?)));
        view(&mut self.events, |events| {
            if restart {
                events.restart(step)?;
            }
            events.scalars(step, scalars)
        });
        Ok(())
    }

    /// Where the table ends now.
    pub fn mark(&self) -> Mark {
        self.table.mark()
    }

    /// Waits until all rows would survive a power cut.
    pub fn sync(&mut self) -> Result<(), RunError> {
        self.table.sync()?;
        view(&mut self.events, EventFile::sync);
        Ok(())
    }
}

/// Shows something in TensorBoard, unless that has failed before.
fn view(events: &mut Option<EventFile>, show: impl FnOnce(&mut EventFile) -> Result<(), RunError>) {
    if let Some(file) = events
        && let Err(error) = show(file)
    {
        tracing::warn!("TensorBoard shows nothing from here on: {error}");
        *events = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensorboard::tests::read;

    #[test]
    fn tensorboard_shows_what_the_table_holds_and_forgets_what_is_written_again() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let dir = RunDir::create(Some(&path), "x", "").unwrap();
        let mut metrics = Metrics::open(&dir, &["step", "loss"], Mark::default()).unwrap();
        metrics.write(100, &[Some(100.0), None]).unwrap();
        let mark = metrics.mark();
        metrics.write(200, &[Some(200.0), Some(0.5)]).unwrap();
        drop(metrics);
        let mut metrics = Metrics::open(&dir, &["step", "loss"], mark).unwrap();
        metrics.write(200, &[Some(200.0), Some(0.5)]).unwrap();
        metrics.sync().unwrap();
        assert_eq!(metrics.mark().rows, 2);
        let csv = std::fs::read_to_string(path.join("metrics.csv")).unwrap();
        assert_eq!(csv, "step,loss\n100,\n200,0.5\n");

        let mut files: Vec<_> =
            std::fs::read_dir(path.join("tb")).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        let [first, second] = [read(&files[0]), read(&files[1])];
        let scalar = |step, tag: &str, value| (step, tag.to_owned(), value);
        let row = [scalar(200, "step", 200.0), scalar(200, "loss", 0.5)];
        assert_eq!(first.0, [&[scalar(100, "step", 100.0)], &row[..]].concat());
        assert_eq!((second.0.as_slice(), second.1.as_slice()), (&row[..], &[200][..]));
        assert!(first.1.is_empty());
    }
}
