use super::*;
use crate::{Mark, Slot, Table, copy};

/// A run with three checkpoints, tables and a journal, on nobody's hands.
fn run() -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("run");
    let dir = RunDir::create(Some(&path), "x", "seed = 1\n").unwrap();
    for step in [1, 2, 3] {
        let fill = |to: &Path| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
            fs::write(to.join("state.json"), step.to_string())?;
            Ok(fs::write(to.join(CONFIG), "seed = 1\n")?)
        };
        dir.checkpoints().unwrap().save(Slot::Step(step), fill).unwrap();
    }
    for name in TABLES {
        let mut table = Table::open(&path.join(name), &["step"], Mark::default()).unwrap();
        table.write(&[Some(1.0)]).unwrap();
    }
    let (mut journal, _) = Journal::open(&path.join(JOURNAL)).unwrap();
    journal.append(b"transition").unwrap();
    (root, path)
}

fn not_whole(path: &Path) -> Vec<String> {
    let parts = inspect(path).unwrap().into_iter();
    parts.filter(|p| !matches!(p.health, Health::Whole(_))).map(|p| p.name).collect()
}

#[test]
fn a_whole_run_is_called_whole_and_left_alone() {
    let (_root, path) = run();
    let parts = inspect(&path).unwrap();
    let names: Vec<_> = parts.iter().map(|p| p.name.as_str()).collect();
    let expected = [
        "config.toml",
        "provenance.json",
        "checkpoints/step_0000003",
        "checkpoints/step_0000002",
        "checkpoints/step_0000001",
        "metrics.csv",
        "episodes.csv",
        "replay.journal",
    ];
    assert_eq!(names, expected);
    assert_eq!(not_whole(&path), [""; 0]);
    assert_eq!(repair(&path).unwrap(), [""; 0]);
}

#[test]
fn every_damage_is_named_and_repaired() {
    let (_root, path) = run();
    let append = |name: &str, bytes: &[u8]| {
        let mut text = fs::read(path.join(name)).unwrap();
        text.extend_from_slice(bytes);
        fs::write(path.join(name), text).unwrap();
    };
    fs::write(path.join(CONFIG), "seed = ").unwrap();
    fs::write(path.join("checkpoints/step_0000003/state.json"), "9").unwrap();
    fs::create_dir(path.join("checkpoints/.step_0000004.tmp")).unwrap();
    append("metrics.csv", b"2");
    append(JOURNAL, &[7, 0]);
    let broken = [
        "config.toml",
        "checkpoints/step_0000003",
        "checkpoints/.step_0000004.tmp",
        "metrics.csv",
        "replay.journal",
    ];
    assert_eq!(not_whole(&path), broken);
    assert_eq!(not_whole(&path), broken, "looking changes nothing");

    let done = repair(&path).unwrap();
    assert!(done.len() == 6, "{done:?}");
    assert_eq!(not_whole(&path), [""; 0]);
    assert_eq!(fs::read_to_string(path.join(CONFIG)).unwrap(), "seed = 1\n");
    assert_eq!(fs::read_to_string(path.join("metrics.csv")).unwrap(), "step\n1\n");
    assert_eq!(fs::read_to_string(path.join("damaged/step_0000003/state.json")).unwrap(), "9");
    let last = CheckpointStore::open(&path).unwrap().latest().unwrap().unwrap();
    assert!(last.ends_with("step_0000002"));
}

#[test]
fn a_lost_configuration_without_a_copy_is_said() {
    let (_root, path) = run();
    fs::remove_dir_all(path.join("checkpoints")).unwrap();
    fs::write(path.join(CONFIG), "seed = ").unwrap();
    let said = repair(&path).unwrap_err().to_string();
    assert!(said.contains("no whole checkpoint holds a copy"), "{said}");
    assert_eq!(fs::read_to_string(path.join(CONFIG)).unwrap(), "seed = ");
}

#[test]
fn a_run_that_is_written_is_not_repaired_but_copied() {
    let (root, path) = run();
    let writer = RunDir::open(&path).unwrap();
    assert!(matches!(repair(&path), Err(RunError::Locked { .. })));
    fs::write(path.join("checkpoints/step_0000002/state.json"), "9").unwrap();
    fs::create_dir(path.join("episodes")).unwrap();
    fs::write(path.join("episodes/whole.mcap"), "1").unwrap();
    fs::write(path.join("episodes/half.tmp"), "1").unwrap();
    let to = root.path().join("copy");
    assert_eq!(copy(&path, &to).unwrap(), ["step_0000003", "step_0000001"]);
    assert!(to.join("episodes/whole.mcap").exists() && !to.join("episodes/half.tmp").exists());
    drop(writer);
    assert_eq!(not_whole(&to), [""; 0]);
    assert_eq!(inspect(&to).unwrap().len(), 7);
    assert!(!to.join("lock").exists());
    assert!(matches!(copy(&path, &to), Err(RunError::NotEmpty(_))));
}

#[test]
fn demonstrations_are_whole_or_set_aside() {
    let (_root, path) = run();
    let shown = path.join(DEMONSTRATIONS);
    let (mut journal, _) = Journal::open(&shown).unwrap();
    for record in ["header", "step", "step"] {
        journal.append(record.as_bytes()).unwrap();
    }
    let part = inspect(&path).unwrap().pop().unwrap();
    assert_eq!(part.health, Health::Whole("2 transitions".into()));
    let whole = fs::read(&shown).unwrap();
    // Cut short, or changed.
    for change in [0, 1] {
        let mut bytes = whole[..whole.len() - 1 + change].to_vec();
        *bytes.last_mut().unwrap() ^= change as u8;
        fs::write(&shown, &bytes).unwrap();
        assert_eq!(not_whole(&path), [DEMONSTRATIONS]);
        repair(&path).unwrap();
        assert!(!shown.exists());
        assert_eq!(fs::read(path.join("damaged").join(DEMONSTRATIONS)).unwrap(), bytes);
        fs::remove_file(path.join("damaged").join(DEMONSTRATIONS)).unwrap();
    }
}
