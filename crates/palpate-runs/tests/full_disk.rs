//! A disk that fills up in the middle of a write, made by the system itself: a limit on the size of files cuts a
//! write short and then refuses.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test of its own folder")]

use std::fs;
use std::path::Path;

use palpate_runs::{CheckpointStore, Journal, Mark, RunError, Slot, Table};
use rustix::process::{Resource, Rlimit, setrlimit};

/// Files may grow to this many bytes; `None`: as they like.
fn room(bytes: Option<u64>) {
    let maximum = rustix::process::getrlimit(Resource::Fsize).maximum;
    setrlimit(Resource::Fsize, Rlimit { current: bytes.or(maximum), maximum }).unwrap();
}

fn refused<T>(result: Result<T, RunError>) {
    let error = result.err().unwrap();
    assert!(error.is_storage(), "{error:?}");
}

/// In one test: the limit is the process's.
#[test]
fn what_a_full_disk_cut_short_is_written_whole_once_there_is_room() {
    // Without a handler the signal ends the process.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default()).unwrap();
    let dir = tempfile::tempdir().unwrap();

    let path = dir.path().join("metrics.csv");
    let mut table = Table::open(&path, &["step", "loss"], Mark::default()).unwrap();
    table.write(&[Some(1.0), Some(0.5)]).unwrap();
    let whole = fs::read(&path).unwrap();
    room(Some(whole.len() as u64 + 2));
    refused(table.write(&[Some(222.0), None]));
    assert_eq!(fs::read(&path).unwrap().len(), whole.len() + 2, "the write was cut short");
    refused(table.write(&[Some(222.0), None]));
    room(None);
    table.write(&[Some(222.0), None]).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "step,loss\n1,0.5\n222,\n");
    assert_eq!(table.mark().rows, 2);

    let path = dir.path().join("replay.journal");
    let (mut journal, _) = Journal::open(&path).unwrap();
    journal.append(b"first").unwrap();
    room(Some(fs::metadata(&path).unwrap().len() + 3));
    refused(journal.append(b"second"));
    room(None);
    journal.append(b"second").unwrap();
    assert_eq!(Journal::read(&path).unwrap().records, [&b"first"[..], b"second"]);

    let store = CheckpointStore::open(dir.path()).unwrap();
    let save = |step, text: &str| {
        store.save(Slot::Step(step), |to: &Path| Ok(fs::write(to.join("state.json"), text)?))
    };
    save(1, "old").unwrap();
    for bytes in [0, 1, 100] {
        room(Some(bytes));
        refused(save(2, &"new ".repeat(50)));
        room(None);
        let last = store.latest().unwrap().unwrap();
        assert_eq!(fs::read_to_string(last.join("state.json")).unwrap(), "old");
    }
    assert_eq!(fs::read_dir(dir.path().join("checkpoints")).unwrap().count(), 1);
    save(2, "new").unwrap();
    let last = store.latest().unwrap().unwrap();
    assert_eq!(fs::read_to_string(last.join("state.json")).unwrap(), "new");
}
