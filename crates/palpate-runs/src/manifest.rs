//! What a checkpoint is made of, so that a later reader can tell whether it is whole.
//!
//! CRC-32C finds every flipped bit, every burst of up to 32 bits and, with the sizes, every cut;
//! anything else passes with a chance of 2⁻³². It guards against broken disks and power cuts, not
//! against forgery.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read as _;
use std::path::Path;

use crate::durable;
use crate::error::{At as _, Rejected, RunError};

/// Its file name in the checkpoint's folder.
pub(crate) const MANIFEST: &str = "manifest.json";
/// Raised whenever older versions can no longer read a checkpoint.
pub(crate) const FORMAT: u64 = 1;

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    format: u64,
    /// The checkpoint's name, so that a renamed folder is no other checkpoint.
    name: String,
    files: BTreeMap<String, Sum>,
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Sum {
    bytes: u64,
    crc32c: String,
}

/// Why a checkpoint cannot be used.
pub(crate) enum Unusable {
    /// It is not as it was written.
    Torn(Rejected),
    /// It is of a later version.
    Newer(u64),
}

/// Syncs every file of a folder and writes its manifest, which is synced too.
pub(crate) fn seal(dir: &Path, name: &str) -> Result<(), RunError> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(dir).at("list", dir)? {
        let path = entry.at("list", dir)?.path();
        let Some(file_name) = path.file_name().and_then(|n| n.to_str()).filter(|_| path.is_file())
        else {
            let source =
                std::io::Error::other("a checkpoint holds plain files with names in UTF-8");
            return Err(RunError::Io { action: "keep", path, source });
        };
        let sum = checksum(&path).at("read back", &path)?;
        // Some systems sync only what is open for writing.
        let file = File::options().append(true).open(&path).at("open", &path)?;
        file.sync_all().at("sync", &path)?;
        files.insert(file_name.to_owned(), sum);
    }
    let path = dir.join(MANIFEST);
    let manifest = Manifest { format: FORMAT, name: name.into(), files };
    let body = serde_json::to_string_pretty(&manifest)
        .map_err(|source| RunError::Json { path: path.clone(), source })?;
    durable::create(&path, wrap(&body).as_bytes())?;
    durable::sync_dir(dir)
}

// The shell is the same in every format, so that a later one can be told from a damaged one.
const BEFORE_SUM: &str = "{\"crc32c\": \"";
const BEFORE_BODY: &str = "\", \"manifest\": ";
const END: &str = "}\n";

fn wrap(body: &str) -> String {
    format!("{BEFORE_SUM}{:08x}{BEFORE_BODY}{body}{END}", crc32c::crc32c(body.as_bytes()))
}

/// The manifest's text, if every byte is as it was written.
fn unwrap(text: &str) -> Option<&str> {
    let (_, rest) = text.strip_prefix(BEFORE_SUM)?.split_once(BEFORE_BODY)?;
    let body = rest.strip_suffix(END)?;
    (wrap(body) == text).then_some(body)
}

/// Checks a folder against its manifest, every byte.
pub(crate) fn verify(dir: &Path, name: &str) -> Result<(), Unusable> {
    let torn = |reason: String| Unusable::Torn(Rejected { name: name.into(), reason });
    let broken = |e: &dyn std::fmt::Display| torn(format!("{MANIFEST}: {e}"));
    let text = fs::read_to_string(dir.join(MANIFEST)).map_err(|e| broken(&e))?;
    let body = unwrap(&text).ok_or_else(|| broken(&"it does not match its own checksum"))?;
    let value: serde_json::Value = serde_json::from_str(body).map_err(|e| broken(&e))?;
    if let Some(format) = value["format"].as_u64().filter(|format| *format > FORMAT) {
        return Err(Unusable::Newer(format));
    }
    let manifest: Manifest = serde_json::from_value(value).map_err(|e| broken(&e))?;
    if manifest.name != name {
        return Err(torn(format!("its manifest is that of {}", manifest.name)));
    }
    for (file, expected) in &manifest.files {
        let found = checksum(&dir.join(file)).map_err(|e| torn(format!("{file}: {e}")))?;
        if found.bytes != expected.bytes {
            return Err(torn(format!("{file} has {} of {} bytes", found.bytes, expected.bytes)));
        }
        if found.crc32c != expected.crc32c {
            return Err(torn(format!(
                "{file} has changed: its CRC-32C is {}, not {}",
                found.crc32c, expected.crc32c
            )));
        }
    }
    Ok(())
}

/// Size and checksum of a file, read in pieces: a replay buffer may be larger than the memory left.
fn checksum(path: &Path) -> std::io::Result<Sum> {
    const PIECE: usize = 1 << 20;
    let mut file = File::open(path)?;
    let (mut buffer, mut bytes, mut crc) = (vec![0; PIECE], 0, 0);
    loop {
        let n = file.read(&mut buffer)?;
        if n == 0 {
            return Ok(Sum { bytes, crc32c: format!("{crc:08x}") });
        }
        bytes += n as u64;
        crc = crc32c::crc32c_append(crc, &buffer[..n]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(dir: &Path) -> String {
        match verify(dir, "step_1").unwrap_err() {
            Unusable::Torn(rejected) => rejected.reason,
            Unusable::Newer(format) => format!("newer: {format}"),
        }
    }

    fn sealed() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("a.bin"), [1, 2, 3, 4, 5]).unwrap();
        fs::write(dir.path().join("b.bin"), []).unwrap();
        seal(dir.path(), "step_1").unwrap();
        assert!(verify(dir.path(), "step_1").is_ok());
        dir
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let dir = sealed();
        for name in [MANIFEST, "a.bin"] {
            let path = dir.path().join(name);
            let whole = fs::read(&path).unwrap();
            for bit in 0..8 * whole.len() {
                let mut broken = whole.clone();
                broken[bit / 8] ^= 1 << (bit % 8);
                fs::write(&path, broken).unwrap();
                assert!(reason(dir.path()).contains(name), "bit {bit} of {name}");
            }
            fs::write(&path, whole).unwrap();
        }
        assert!(verify(dir.path(), "step_1").is_ok());
    }

    #[test]
    fn every_cut_is_found() {
        let dir = sealed();
        for name in [MANIFEST, "a.bin"] {
            let path = dir.path().join(name);
            let whole = fs::read(&path).unwrap();
            for length in 0..whole.len() {
                fs::write(&path, &whole[..length]).unwrap();
                assert!(reason(dir.path()).contains(name), "{length} bytes of {name}");
            }
            fs::remove_file(&path).unwrap();
            assert!(reason(dir.path()).contains(name), "no {name}");
            fs::write(&path, whole).unwrap();
        }
    }

    #[test]
    fn a_renamed_folder_is_no_other_checkpoint() {
        let dir = sealed();
        let Err(Unusable::Torn(rejected)) = verify(dir.path(), "step_2") else { panic!() };
        assert!(rejected.reason.contains("that of step_1"));
    }

    #[test]
    fn a_later_format_is_not_called_torn() {
        let dir = sealed();
        let later = wrap("{\"format\": 9, \"what\": [1]}");
        fs::write(dir.path().join(MANIFEST), later).unwrap();
        assert_eq!(reason(dir.path()), "newer: 9");
    }

    /// The check value of CRC-32C (iSCSI, RFC 3720): the digits 1 … 9 give e3069283.
    #[test]
    fn the_checksum_is_the_published_one() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("x"), "123456789").unwrap();
        let sum = checksum(&dir.path().join("x")).unwrap();
        assert_eq!(sum, Sum { bytes: 9, crc32c: "e3069283".into() });
    }
}
