use super::*;

type Filled = Result<(), Box<dyn std::error::Error + Send + Sync>>;

struct Run {
    dir: tempfile::TempDir,
    store: CheckpointStore,
}

impl Run {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let store = CheckpointStore::open(dir.path()).unwrap();
        Self { dir, store }
    }

    fn save(&self, slot: Slot, text: &str) -> PathBuf {
        let fill = |dir: &Path| -> Filled { Ok(fs::write(dir.join("state.json"), text)?) };
        self.store.save(slot, fill).unwrap()
    }

    fn folders(&self) -> Vec<String> {
        let entries = fs::read_dir(self.dir.path().join(CheckpointStore::FOLDER)).unwrap();
        let mut names: Vec<_> =
            entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn latest(&self) -> String {
        fs::read_to_string(self.store.latest().unwrap().unwrap().join("state.json")).unwrap()
    }

    fn best(&self) -> String {
        fs::read_to_string(self.store.find(BEST).unwrap().unwrap().join("state.json")).unwrap()
    }
}

#[test]
fn the_last_three_steps_and_two_best_are_kept() {
    let run = Run::new();
    assert_eq!(run.store.latest().unwrap(), None);
    assert_eq!(run.store.find(BEST).unwrap(), None);
    for step in 1..6 {
        run.save(Slot::Step(100 * step), &step.to_string());
        run.save(Slot::Best(100 * step), &format!("best {step}"));
    }
    let expected = ["best_0000400", "best_0000500", "step_0000300", "step_0000400", "step_0000500"];
    assert_eq!(run.folders(), expected);
    assert_eq!((run.latest(), run.best()), ("5".into(), "best 5".into()));
    let named = run.store.find("step_0000400").unwrap().unwrap();
    assert_eq!(fs::read_to_string(named.join("state.json")).unwrap(), "4");
    assert_eq!(run.store.find("step_0000100").unwrap(), None);
    let steps: Vec<_> = run.store.entries().unwrap().iter().filter_map(Entry::step).collect();
    assert_eq!(steps, [500, 400, 300]);
}

#[test]
fn a_damaged_checkpoint_is_named_and_the_one_before_is_used() {
    let run = Run::new();
    let path: Vec<_> = (1..4).map(|s| run.save(Slot::Step(s), &s.to_string())).collect();
    fs::write(path[2].join("state.json"), "x").unwrap();
    assert_eq!(run.latest(), "2");
    fs::remove_file(path[1].join("manifest.json")).unwrap();
    assert_eq!(run.latest(), "1");
    let damage = run.store.entries().unwrap()[0].damage().unwrap().unwrap();
    assert_eq!(damage.name, "step_0000003");
    assert!(damage.reason.starts_with("state.json has changed"), "{damage}");

    fs::write(path[0].join("state.json"), "").unwrap();
    let said = run.store.latest().unwrap_err().to_string();
    for part in [
        "step_0000003 (state.json has changed",
        "step_0000002 (manifest.json: ",
        "step_0000001 (state.json has 0 of 1 bytes)",
    ] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn after_a_fallback_the_damaged_checkpoint_is_written_again() {
    let run = Run::new();
    for step in 1..4 {
        run.save(Slot::Step(step), "first");
    }
    fs::write(run.dir.path().join(CheckpointStore::FOLDER).join("step_0000003/state.json"), "torn")
        .unwrap();
    run.save(Slot::Step(3), "second");
    assert_eq!(run.latest(), "second");
    assert_eq!(run.folders(), ["step_0000001", "step_0000002", "step_0000003"]);
}

#[test]
fn what_a_resumed_run_did_not_come_from_is_removed() {
    let run = Run::new();
    for step in [100, 200, 300] {
        run.save(Slot::Step(step), &step.to_string());
    }
    run.save(Slot::Step(250), "250");
    assert_eq!(run.latest(), "250");
    assert_eq!(run.folders(), ["step_0000100", "step_0000200", "step_0000250"]);
}

#[test]
fn a_failing_writer_changes_nothing() {
    let run = Run::new();
    run.save(Slot::Step(1), "1");
    run.save(Slot::Best(1), "best");
    for slot in [Slot::Step(1), Slot::Step(2), Slot::Best(1)] {
        let error = run.store.save(slot, |dir| {
            fs::write(dir.join("state.json"), "half")?;
            Err("the disk is full".into())
        });
        let error = error.unwrap_err();
        assert!(error.to_string().starts_with("cannot write the checkpoint "));
        assert!(std::error::Error::source(&error).unwrap().to_string().contains("disk is full"));
    }
    assert_eq!(run.folders(), ["best_0000001", "step_0000001"]);
    assert_eq!((run.latest(), run.best()), ("1".into(), "best".into()));
}

/// Every state that a kill can leave while one checkpoint replaces another of its name.
#[test]
fn a_kill_at_any_moment_of_a_replacement_leaves_a_whole_one() {
    let run = Run::new();
    let dir = run.dir.path().join(CheckpointStore::FOLDER);
    let path = run.save(Slot::Step(7), "old");
    // Killed while filling …
    fs::create_dir(dir.join(".step_0000007.tmp")).unwrap();
    fs::write(dir.join(".step_0000007.tmp/state.json"), "ne").unwrap();
    assert_eq!(run.latest(), "old");
    // … after moving the old one aside …
    fs::rename(&path, dir.join(".step_0000007.replaced")).unwrap();
    assert_eq!(run.latest(), "old");
    // … and taken up again.
    run.save(Slot::Step(7), "new");
    assert_eq!(run.latest(), "new");
    assert_eq!(run.folders(), ["step_0000007"]);
}

#[test]
fn a_checkpoint_of_a_later_version_is_no_reason_to_fall_back() {
    let run = Run::new();
    run.save(Slot::Step(1), "1");
    let path = run.save(Slot::Step(2), "2");
    let body = "{\"format\": 2}";
    let sum = crc32c::crc32c(body.as_bytes());
    let text = format!("{{\"crc32c\": \"{sum:08x}\", \"manifest\": {body}}}\n");
    fs::write(path.join("manifest.json"), text).unwrap();
    let said = run.store.latest().unwrap_err().to_string();
    assert!(said.contains("format 2, this version reads up to 1"), "{said}");
}

#[test]
fn a_folder_in_a_checkpoint_is_refused() {
    let run = Run::new();
    let error = run.store.save(Slot::Step(1), |dir| Ok(fs::create_dir(dir.join("sub"))?));
    assert!(error.unwrap_err().to_string().contains("cannot keep"));
    assert_eq!(run.store.latest().unwrap(), None);
}

#[test]
fn other_folders_are_left_alone() {
    let run = Run::new();
    run.save(Slot::Step(1), "1");
    fs::create_dir(run.dir.path().join(CheckpointStore::FOLDER).join("mine")).unwrap();
    run.save(Slot::Step(2), "2");
    assert_eq!(run.folders(), ["mine", "step_0000001", "step_0000002"]);
}
