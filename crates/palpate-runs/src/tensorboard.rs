//! Scalars as TensorBoard event files.
//!
//! A file is a sequence of TFRecords: length u64, its masked CRC-32C, payload, its masked CRC-32C, all
//! little-endian. A payload is a protobuf `Event` (tensorflow/core/util/event.proto), of which four
//! fields are written here, so no protobuf library is needed.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::RunError;
use crate::error::At as _;
use crate::time::since_epoch;

#[derive(Debug)]
pub(crate) struct EventFile {
    path: PathBuf,
    file: File,
}

impl EventFile {
    /// Starts a new file in `dir`. Files of earlier starts stay; TensorBoard reads them in order.
    pub(crate) fn create(dir: &Path) -> Result<Self, RunError> {
        std::fs::create_dir_all(dir).at("create", dir)?;
        let (seconds, pid) = (since_epoch().as_secs(), std::process::id());
        let mut n = 0;
        loop {
            let path = dir.join(format!("events.out.tfevents.{seconds:010}.palpate.{pid}.{n}"));
            match File::create_new(&path) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => n += 1,
                file => {
                    let mut events = Self { file: file.at("create", &path)?, path };
                    let mut version = Vec::new();
                    field_bytes(&mut version, 3, b"brain.Event:2");
                    events.event(0, &version)?;
                    return Ok(events);
                }
            }
        }
    }

    /// Tells readers to forget events of earlier files from `step` on.
    pub(crate) fn restart(&mut self, step: u64) -> Result<(), RunError> {
        const START: u64 = 1;
        let mut log = Vec::new();
        field_varint(&mut log, 1, START);
        let mut event = Vec::new();
        field_bytes(&mut event, 7, &log);
        self.event(step, &event)
    }

    pub(crate) fn scalars<'a>(
        &mut self,
        step: u64,
        values: impl Iterator<Item = (&'a str, f64)>,
    ) -> Result<(), RunError> {
        let mut summary = Vec::new();
        for (tag, value) in values {
            let mut scalar = Vec::new();
            field_bytes(&mut scalar, 1, tag.as_bytes());
            key(&mut scalar, 2, FIXED32);
            scalar.extend((value as f32).to_le_bytes());
            field_bytes(&mut summary, 1, &scalar);
        }
        let mut event = Vec::new();
        field_bytes(&mut event, 5, &summary);
        self.event(step, &event)
    }

    pub(crate) fn sync(&mut self) -> Result<(), RunError> {
        self.file.sync_all().at("sync", &self.path)
    }

    fn event(&mut self, step: u64, what: &[u8]) -> Result<(), RunError> {
        let mut event = Vec::new();
        key(&mut event, 1, FIXED64);
        event.extend(since_epoch().as_secs_f64().to_le_bytes());
        field_varint(&mut event, 2, step);
        event.extend(what);
        self.file.write_all(&record(&event)).at("append to", &self.path)
    }
}

fn record(payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u64).to_le_bytes();
    let mut record = Vec::with_capacity(payload.len() + 16);
    record.extend(length);
    record.extend(masked_crc(&length).to_le_bytes());
    record.extend(payload);
    record.extend(masked_crc(payload).to_le_bytes());
    record
}

/// tensorflow/core/lib/hash/crc32c.h: rotated right by 15, plus a constant.
fn masked_crc(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

// Wire types of protobuf.
const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const BYTES: u64 = 2;
const FIXED32: u64 = 5;

fn key(out: &mut Vec<u8>, field: u64, wire_type: u64) {
    varint(out, field << 3 | wire_type);
}

fn field_varint(out: &mut Vec<u8>, field: u64, value: u64) {
    key(out, field, VARINT);
    varint(out, value);
}

fn field_bytes(out: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    key(out, field, BYTES);
    varint(out, bytes.len() as u64);
    out.extend(bytes);
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// One scalar of an event file.
    pub(crate) type Scalar = (u64, String, f32);

    struct Reader<'a>(&'a [u8]);

    impl<'a> Reader<'a> {
        fn take(&mut self, n: usize) -> &'a [u8] {
            let (head, tail) = self.0.split_at(n);
            self.0 = tail;
            head
        }

        fn u64(&mut self) -> u64 {
            u64::from_le_bytes(self.take(8).try_into().unwrap())
        }

        fn u32(&mut self) -> u32 {
            u32::from_le_bytes(self.take(4).try_into().unwrap())
        }

        fn varint(&mut self) -> u64 {
            let (mut value, mut shift) = (0, 0);
            loop {
                let byte = u64::from(self.take(1)[0]);
                value += (byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    return value;
                }
            }
        }

        /// Field number and content; numbers as 8 little-endian bytes.
        fn field(&mut self) -> Option<(u64, Vec<u8>)> {
            if self.0.is_empty() {
                return None;
            }
            let key = self.varint();
            let content = match key & 7 {
                0 => self.varint().to_le_bytes().to_vec(),
                1 => self.take(8).to_vec(),
                2 => {
                    let n = self.varint() as usize;
                    self.take(n).to_vec()
                }
                5 => self.take(4).to_vec(),
                other => panic!("wire type {other}"),
            };
            Some((key >> 3, content))
        }
    }

    /// Scalars and purge steps of a file; checks every record's sums, computed bit by bit.
    pub(crate) fn read(path: &Path) -> (Vec<Scalar>, Vec<u64>) {
        let bytes = std::fs::read(path).unwrap();
        let mut file = Reader(&bytes);
        let (mut scalars, mut purges) = (Vec::new(), Vec::new());
        let mut first = true;
        while !file.0.is_empty() {
            let length = file.u64();
            assert_eq!(file.u32(), slow_masked_crc(&length.to_le_bytes()));
            let payload = file.take(length as usize);
            assert_eq!(file.u32(), slow_masked_crc(payload));
            let mut event = Reader(payload);
            let mut step = 0;
            while let Some((field, content)) = event.field() {
                match field {
                    1 => assert!(f64::from_le_bytes(content.try_into().unwrap()) > 1.6e9),
                    2 => step = u64::from_le_bytes(content.try_into().unwrap()),
                    3 => assert!(first && content == b"brain.Event:2"),
                    5 => scalars.extend(summary(step, &content)),
                    7 => purges.push(step),
                    other => panic!("field {other}"),
                }
            }
            first = false;
        }
        (scalars, purges)
    }

    fn summary(step: u64, content: &[u8]) -> Vec<Scalar> {
        let mut summary = Reader(content);
        let mut scalars = Vec::new();
        while let Some((1, value)) = summary.field() {
            let mut value = Reader(&value);
            let (tag_field, tag) = value.field().unwrap();
            let (value_field, number) = value.field().unwrap();
            assert_eq!((tag_field, value_field), (1, 2));
            let number = f32::from_le_bytes(number.try_into().unwrap());
            scalars.push((step, String::from_utf8(tag).unwrap(), number));
        }
        scalars
    }

    /// The definition, without tables or instructions: polynomial 0x1EDC6F41, reflected.
    fn slow_masked_crc(bytes: &[u8]) -> u32 {
        let mut crc = !0u32;
        for byte in bytes {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
            }
        }
        (!crc).rotate_right(15).wrapping_add(0xa282_ead8)
    }

    #[test]
    fn scalars_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let mut events = EventFile::create(dir.path()).unwrap();
        events.restart(300).unwrap();
        events.scalars(300, [("a/b", 0.5), ("c", -2.0)].into_iter()).unwrap();
        events.scalars(1 << 40, [("a/b", 1.5)].into_iter()).unwrap();
        events.sync().unwrap();
        let (scalars, purges) = read(&events.path);
        let expected = [(300, "a/b", 0.5), (300, "c", -2.0), (1 << 40, "a/b", 1.5)];
        assert_eq!(scalars, expected.map(|(step, tag, value)| (step, tag.to_owned(), value)));
        assert_eq!(purges, [300]);
        let second = EventFile::create(dir.path()).unwrap();
        assert_ne!(second.path, events.path);
    }
}
