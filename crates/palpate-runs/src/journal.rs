//! A log of records that survives a kill and a power cut, record by record.
//!
//! ```text
//! "palpate journal 1\n"
//! length u32 │ CRC-32C u32 of length and payload │ payload     all little-endian
//! ```
//!
//! The file only grows. A record that a kill cut short is cut off at the next opening; so is everything behind
//! a record that has changed on disk. What is cut off is kept beside the journal.

use std::fs::{self, File};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::error::At as _;
use crate::{RunError, durable};

const MAGIC: &[u8] = b"palpate journal 1\n";
const FRAME: usize = 8;
/// More than any record has; a longer length is a damaged one.
const LONGEST: usize = 1 << 20;

/// A journal open for appending.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Bytes of whole records; what a failed append left behind them is cut by the next one.
    end: u64,
    torn: bool,
    frame: Vec<u8>,
}

/// What a journal holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Records {
    /// The payloads, oldest first.
    pub records: Vec<Vec<u8>>,
    /// Whether a record behind them was never finished.
    pub torn: bool,
    /// What else is wrong behind them.
    pub damage: Option<String>,
    /// Bytes up to the end of the last whole record.
    whole: u64,
}

impl Journal {
    /// Reads a journal without touching it. None is an empty one.
    pub fn read(path: &Path) -> Result<Records, RunError> {
        match fs::read(path) {
            Ok(bytes) => Ok(parse(&bytes)),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Records::default()),
            Err(error) => Err(error).at("read", path),
        }
    }

    /// Copies the whole records of a journal to another file, which is there with all of them or not at all.
    pub fn copy(from: &Path, to: &Path) -> Result<(), RunError> {
        let bytes = fs::read(from).at("read", from)?;
        let whole = parse(&bytes).whole as usize;
        durable::write(to, bytes.get(..whole).unwrap_or_default())
    }

    /// Opens a journal to append to it, or begins one. Gives what it held, after cutting what is not whole;
    /// the bytes that are cut go to `NAME.cut` first.
    pub fn open(path: &Path) -> Result<(Self, Records), RunError> {
        let held = Self::read(path)?;
        let bytes = if path.exists() { fs::read(path).at("read", path)? } else { Vec::new() };
        let cut = bytes.get(held.whole as usize..).unwrap_or_default();
        if cut.iter().any(|byte| *byte != 0) {
            durable::write(&path.with_added_extension("cut"), cut)?;
        }
        let mut file =
            File::options().write(true).create(true).truncate(false).open(path).at("open", path)?;
        file.set_len(held.whole).at("cut", path)?;
        file.seek(SeekFrom::End(0)).at("open", path)?;
        let mut end = held.whole;
        if end == 0 {
            file.write_all(MAGIC).at("write", path)?;
            end = MAGIC.len() as u64;
        }
        file.sync_all().at("sync", path)?;
        path.parent().map_or(Ok(()), durable::sync_dir)?;
        Ok((Self { path: path.to_owned(), file, end, torn: false, frame: Vec::new() }, held))
    }

    /// Appends a record and waits until it would survive a power cut. After an error the journal is as it was.
    pub fn append(&mut self, payload: &[u8]) -> Result<(), RunError> {
        if payload.is_empty() || payload.len() > LONGEST {
            let reason = format!("a record of {} bytes does not fit", payload.len());
            return Err(RunError::Table { path: self.path.clone(), reason });
        }
        if self.torn {
            self.file.set_len(self.end).at("cut", &self.path)?;
            self.file.seek(SeekFrom::End(0)).at("cut", &self.path)?;
            self.torn = false;
        }
        let length = (payload.len() as u32).to_le_bytes();
        self.frame.clear();
        self.frame.extend_from_slice(&length);
        self.frame.extend_from_slice(&checksum(&length, payload).to_le_bytes());
        self.frame.extend_from_slice(payload);
        let written = self.file.write_all(&self.frame).and_then(|()| self.file.sync_data());
        self.torn = written.is_err();
        written.at("append to", &self.path)?;
        self.end += self.frame.len() as u64;
        Ok(())
    }
}

fn checksum(length: &[u8], payload: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(length), payload)
}

fn parse(bytes: &[u8]) -> Records {
    let mut held = Records::default();
    let Some(mut rest) = bytes.strip_prefix(MAGIC) else {
        // A kill may have cut the first line short.
        held.torn = MAGIC.starts_with(bytes);
        if !held.torn {
            held.damage = Some("it does not begin as a journal of this version".into());
        }
        return held;
    };
    held.whole = MAGIC.len() as u64;
    while !rest.is_empty() {
        let Some((payload, after)) = record(rest) else {
            let number = held.records.len() + 1;
            held.torn = unfinished(rest);
            if !held.torn {
                held.damage = Some(format!("record {number} has changed on disk"));
            }
            break;
        };
        held.whole += (FRAME + payload.len()) as u64;
        held.records.push(payload.to_vec());
        rest = after;
    }
    held
}

/// The first record, if it is whole, and what follows it.
fn record(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (sum, rest) = rest.split_first_chunk::<4>()?;
    let size = u32::from_le_bytes(*length) as usize;
    let (payload, after) = (size > 0 && size <= LONGEST).then(|| rest.split_at_checked(size))??;
    (checksum(length, payload) == u32::from_le_bytes(*sum)).then_some((payload, after))
}

/// Whether this is what a kill in the middle of an append leaves: a beginning of one record, or, after a power
/// cut, zeros that were never filled.
fn unfinished(bytes: &[u8]) -> bool {
    let short = match bytes.split_first_chunk::<4>() {
        Some((length, rest)) => {
            let size = u32::from_le_bytes(*length) as usize;
            size > 0 && size <= LONGEST && rest.len() < 4 + size
        }
        None => true,
    };
    short || bytes.iter().all(|byte| *byte == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAYLOADS: [&[u8]; 4] = [b"one", b"and two", b"3", b"the fourth of them"];

    fn journal() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("replay.journal");
        let (mut journal, held) = Journal::open(&path).unwrap();
        assert!(held.records.is_empty() && held.damage.is_none());
        for payload in PAYLOADS {
            journal.append(payload).unwrap();
        }
        let bytes = fs::read(&path).unwrap();
        (dir, path, bytes)
    }

    /// Offsets at which a record ends.
    fn ends() -> Vec<usize> {
        let mut at = MAGIC.len();
        let mut ends = vec![at];
        for payload in PAYLOADS {
            at += FRAME + payload.len();
            ends.push(at);
        }
        ends
    }

    #[test]
    fn a_cut_at_any_byte_keeps_every_whole_record_and_goes_on() {
        let (_dir, path, whole) = journal();
        for cut in 0..=whole.len() {
            fs::write(&path, &whole[..cut]).unwrap();
            let kept = ends().iter().skip(1).filter(|end| **end <= cut).count();
            let (mut journal, held) = Journal::open(&path).unwrap();
            assert_eq!(held.records, PAYLOADS[..kept], "cut at byte {cut}");
            assert_eq!(held.damage, None, "cut at byte {cut}");
            assert_eq!(held.torn, !ends().contains(&cut), "cut at byte {cut}");
            journal.append(b"next").unwrap();
            let read = Journal::read(&path).unwrap();
            assert_eq!(read.records.len(), kept + 1, "cut at byte {cut}");
            assert_eq!(read.records[kept], b"next");
        }
    }

    #[test]
    fn no_flipped_bit_passes_and_what_is_cut_off_is_kept_beside() {
        let (_dir, path, whole) = journal();
        let beside = path.with_added_extension("cut");
        for bit in 0..8 * whole.len() {
            let mut broken = whole.clone();
            broken[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, &broken).unwrap();
            _ = fs::remove_file(&beside);
            let before = ends().iter().skip(1).filter(|end| **end <= bit / 8).count();
            let (_, held) = Journal::open(&path).unwrap();
            assert_eq!(held.records, PAYLOADS[..before], "bit {bit}");
            assert!(before < PAYLOADS.len(), "bit {bit} was not noticed");
            assert_eq!(fs::read(&beside).unwrap(), broken[held.whole as usize..], "bit {bit}");
        }
    }

    #[test]
    fn a_copy_holds_the_whole_records_and_no_half_one() {
        let (dir, path, whole) = journal();
        fs::write(&path, &whole[..whole.len() - 1]).unwrap();
        let to = dir.path().join("copy");
        Journal::copy(&path, &to).unwrap();
        let held = Journal::read(&to).unwrap();
        assert_eq!((held.records.len(), held.torn), (3, false));
        Journal::copy(&dir.path().join("none"), &to).unwrap_err();
    }

    #[test]
    fn zeros_behind_the_last_record_are_a_power_cut() {
        let (_dir, path, whole) = journal();
        fs::write(&path, [&whole[..], &[0; 700]].concat()).unwrap();
        let (_, held) = Journal::open(&path).unwrap();
        assert_eq!((held.records.len(), held.damage), (4, None));
        assert_eq!(fs::read(&path).unwrap(), whole);
    }

    #[test]
    fn another_file_is_not_taken_for_a_journal() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("replay.journal");
        fs::write(&path, "palpate journal 2\nwhatever").unwrap();
        let (mut journal, held) = Journal::open(&path).unwrap();
        assert!(held.damage.unwrap().contains("this version"));
        journal.append(b"new").unwrap();
        assert_eq!(Journal::read(&path).unwrap().records, [b"new"]);
        let kept = fs::read_to_string(path.with_added_extension("cut")).unwrap();
        assert_eq!(kept, "palpate journal 2\nwhatever");
        for wrong in [&[][..], &vec![0; LONGEST + 1]] {
            journal.append(wrong).unwrap_err();
        }
    }
}
