//! Tables of numbers as CSV.
//!
//! Numbers are written with the fewest digits that read back as the same bits, so equal runs write
//! equal bytes. A value that does not exist yet is an empty cell.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::RunError;
use crate::config::nearest;
use crate::error::At as _;

/// Where a table ends, for a checkpoint to remember: what was written by then must be there, byte for byte, when the
/// run goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Rows.
    pub rows: u64,
    /// Bytes, the header's included.
    bytes: u64,
    /// Of these bytes.
    crc32c: u32,
}

/// A CSV file that grows by whole rows.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    file: File,
    columns: usize,
    /// Behind the last whole row.
    mark: Mark,
    /// A failed append may have left half a row behind `end`.
    torn: bool,
    line: String,
}

impl Table {
    /// Opens a table and cuts it where a checkpoint left it; with the default mark it is created, or emptied.
    ///
    /// # Errors
    ///
    /// If it has other columns, or if what was written by then is not there any more, byte for byte.
    pub fn open(path: &Path, columns: &[&str], mark: Mark) -> Result<Self, RunError> {
        let wrong = |reason: String| RunError::Table { path: path.to_owned(), reason };
        if let Some(name) = columns.iter().find(|name| name.contains([',', '"', '\n', '\r'])) {
            return Err(wrong(format!("the column name {name:?} does not fit into CSV")));
        }
        let header = format!("{}\n", columns.join(","));
        let mark = if mark == Mark::default() {
            fs::write(path, &header).at("create", path)?;
            Mark { rows: 0, bytes: header.len() as u64, crc32c: crc32c::crc32c(header.as_bytes()) }
        } else {
            let bytes = fs::read(path).at("read", path)?;
            if !bytes.starts_with(header.as_bytes()) {
                let found = String::from_utf8_lossy(&bytes);
                return Err(wrong(format!(
                    "its columns are {}, where this version writes {}",
                    found.lines().next().unwrap_or_default(),
                    columns.join(",")
                )));
            }
            let kept = bytes.get(..mark.bytes as usize);
            if kept.is_none_or(|kept| crc32c::crc32c(kept) != mark.crc32c) {
                return Err(wrong(format!(
                    "its first {} rows are not as the checkpoint left them",
                    mark.rows
                )));
            }
            mark
        };
        let mut file = File::options().write(true).open(path).at("open", path)?;
        file.set_len(mark.bytes).at("cut", path)?;
        file.seek(SeekFrom::End(0)).at("open", path)?;
        let columns = columns.len();
        Ok(Self { path: path.to_owned(), file, columns, mark, torn: false, line: String::new() })
    }

    /// Appends a row, one value per column. After an error it can be tried again.
    pub fn write(&mut self, values: &[Option<f64>]) -> Result<(), RunError> {
        self.append(None, values)
    }

    /// The same where the first column holds names, which fit into CSV as they are.
    pub fn write_labelled(&mut self, name: &str, values: &[Option<f64>]) -> Result<(), RunError> {
        self.append(Some(name), values)
    }

    fn append(&mut self, name: Option<&str>, values: &[Option<f64>]) -> Result<(), RunError> {
        let cells = values.len() + usize::from(name.is_some());
        if cells != self.columns {
            let reason = format!("a row of {cells} values for {} columns", self.columns);
            return Err(RunError::Table { path: self.path.clone(), reason });
        }
        self.line.clear();
        if let Some(name) = name {
            self.line.push_str(name);
            self.line.push(',');
        }
        for (i, value) in values.iter().enumerate() {
            if i > 0 {
                self.line.push(',');
            }
            if let Some(value) = value {
                push_number(&mut self.line, *value);
            }
        }
        self.line.push('\n');
        if self.torn {
            self.file.set_len(self.mark.bytes).at("cut", &self.path)?;
            self.file.seek(SeekFrom::End(0)).at("cut", &self.path)?;
            self.torn = false;
        }
        // In one piece, so that who looks on sees whole rows.
        let written = self.file.write_all(self.line.as_bytes());
        self.torn = written.is_err();
        written.at("append to", &self.path)?;
        self.mark = Mark {
            rows: self.mark.rows + 1,
            bytes: self.mark.bytes + self.line.len() as u64,
            crc32c: crc32c::crc32c_append(self.mark.crc32c, self.line.as_bytes()),
        };
        Ok(())
    }

    /// Where it ends now.
    pub fn mark(&self) -> Mark {
        self.mark
    }

    /// Waits until all rows would survive a power cut.
    pub fn sync(&mut self) -> Result<(), RunError> {
        self.file.sync_all().at("sync", &self.path)
    }
}

/// The shortest text that reads back as the same bits.
fn push_number(line: &mut String, value: f64) {
    let size = value.abs();
    let plain = (1e-5..1e16).contains(&size) || size == 0.0 || !size.is_finite();
    let _ = if plain { write!(line, "{value}") } else { write!(line, "{value:e}") };
}

/// A table read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Csv {
    path: PathBuf,
    columns: Vec<String>,
    rows: Vec<Vec<Option<f64>>>,
}

impl Csv {
    /// Reads a table that [`Table`] wrote. A last row without its line end is still being written
    /// and left out.
    pub fn read(path: &Path) -> Result<Self, RunError> {
        let text = fs::read_to_string(path).at("read", path)?;
        let mut lines = text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
        let columns: Vec<String> =
            lines.next().unwrap_or_default().split(',').map(str::to_owned).collect();
        let row = |(i, line): (usize, &str)| {
            let cells = line.split(',').map(|cell| match cell {
                "" => Some(None),
                cell => cell.parse().ok().map(Some),
            });
            let cells: Option<Vec<_>> = cells.collect();
            cells.filter(|cells| cells.len() == columns.len()).ok_or_else(|| RunError::Table {
                path: path.to_owned(),
                reason: format!("line {} is no row of {} numbers: {line}", i + 2, columns.len()),
            })
        };
        let rows = lines.enumerate().map(row).collect::<Result<_, _>>()?;
        Ok(Self { path: path.to_owned(), columns, rows })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Names of the columns.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// A column, row by row.
    pub fn column(&self, name: &str) -> Result<Vec<Option<f64>>, RunError> {
        let at = self.columns.iter().position(|column| column == name).ok_or_else(|| {
            let near = nearest(name, self.columns.iter().map(String::as_str));
            let hint = near.map_or(String::new(), |near| format!("; did you mean {near}?"));
            let reason = format!("there is no column {name}{hint}");
            RunError::Table { path: self.path.clone(), reason }
        })?;
        Ok(self.rows.iter().map(|row| row[at]).collect())
    }

    /// The rows in which two columns both have a value.
    pub fn points(&self, x: &str, y: &str) -> Result<Vec<(f64, f64)>, RunError> {
        Ok(self.column(x)?.into_iter().zip(self.column(y)?).filter_map(|(x, y)| x.zip(y)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: &[&str] = &["step", "loss"];

    fn table() -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("metrics.csv");
        (dir, path)
    }

    #[test]
    fn numbers_read_back_with_the_same_bits() {
        let (_dir, path) = table();
        let values = [
            0.0,
            -0.0,
            50.0,
            0.1 + 0.2,
            1e-5,
            9.99e-6,
            5e-324,
            f64::MAX,
            f64::MIN_POSITIVE,
            1e15,
            1e16,
            -1.0 / 3.0,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        let mut table = Table::open(&path, COLUMNS, Mark::default()).unwrap();
        for value in values {
            table.write(&[Some(value), None]).unwrap();
        }
        table.write(&[Some(f64::NAN), Some(2.0)]).unwrap();
        let csv = Csv::read(&path).unwrap();
        let read = csv.column("step").unwrap();
        for (value, read) in values.iter().zip(&read) {
            assert_eq!(read.unwrap().to_bits(), value.to_bits());
        }
        assert!(read[values.len()].unwrap().is_nan());
        assert_eq!(csv.column("loss").unwrap()[0], None);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(
            "step,loss\n0,\n-0,\n50,\n0.30000000000000004,\n0.00001,\n9.99e-6,\n5e-324,\n"
        ));
        assert!(text.ends_with("NaN,2\n"));
    }

    #[test]
    fn a_resumed_table_forgets_later_rows() {
        let (_dir, path) = table();
        let mut straight = Table::open(&path, COLUMNS, Mark::default()).unwrap();
        let mut marks = Vec::new();
        for step in 0..5 {
            straight.write(&[Some(f64::from(step)), Some(0.5)]).unwrap();
            marks.push(straight.mark());
        }
        let expected = fs::read_to_string(&path).unwrap();
        // A kill in the middle of a row.
        fs::write(&path, format!("{expected}5,0.")).unwrap();
        let mut resumed = Table::open(&path, COLUMNS, marks[2]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "step,loss\n0,0.5\n1,0.5\n2,0.5\n");
        for step in 3..5 {
            resumed.write(&[Some(f64::from(step)), Some(0.5)]).unwrap();
        }
        resumed.sync().unwrap();
        assert_eq!(resumed.mark(), marks[4]);
        assert_eq!(fs::read_to_string(&path).unwrap(), expected);
        Table::open(&path, COLUMNS, Mark::default()).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "step,loss\n");
    }

    #[test]
    fn a_table_that_is_not_the_checkpoints_is_refused() {
        let (_dir, path) = table();
        let mut table = Table::open(&path, COLUMNS, Mark::default()).unwrap();
        table.write(&[Some(1.0), Some(2.0)]).unwrap();
        table.write(&[Some(3.0), Some(4.0)]).unwrap();
        let (mark, whole) = (table.mark(), fs::read_to_string(&path).unwrap());
        for wrong in ["step,loss\n1,2\n3,", "step,loss\n1,2\n3,5\n", "step,loss\n1,2\n3,4"] {
            fs::write(&path, wrong).unwrap();
            let said = Table::open(&path, COLUMNS, mark).unwrap_err().to_string();
            assert!(
                said.ends_with("its first 2 rows are not as the checkpoint left them"),
                "{said}"
            );
            assert_eq!(fs::read_to_string(&path).unwrap(), wrong);
        }
        fs::write(&path, whole).unwrap();
        let said = Table::open(&path, &["step", "gain"], mark).unwrap_err().to_string();
        assert!(said.contains("its columns are step,loss, where"), "{said}");
        assert!(Table::open(&path, &["a,b"], Mark::default()).is_err());
        let mut table = Table::open(&path, COLUMNS, mark).unwrap();
        assert!(table.write(&[None]).unwrap_err().to_string().contains("1 values for 2 columns"));
    }

    #[test]
    fn reading_skips_gaps_and_the_row_being_written() {
        let (_dir, path) = table();
        fs::write(&path, "step,loss\n1,\n2,0.5\n3,0.25\n4,0.1").unwrap();
        let csv = Csv::read(&path).unwrap();
        assert_eq!(csv.points("step", "loss").unwrap(), [(2.0, 0.5), (3.0, 0.25)]);
        let said = csv.column("lost").unwrap_err().to_string();
        assert!(said.ends_with("there is no column lost; did you mean loss?"), "{said}");
        fs::write(&path, "step,loss\n1,2\n1\n").unwrap();
        assert!(Csv::read(&path).unwrap_err().to_string().contains("line 3 is no row"));
    }
}
