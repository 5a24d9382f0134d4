//! What needs no arm to be found out.

use super::*;

fn config(set: &[&str]) -> Config {
    let set = set.iter().map(ToString::to_string).collect();
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    let choice = Choice { preset, task, model, file: None, set };
    Config::load_for(&choice, &UrConfig::at("10.0.0.2")).unwrap()
}

fn found(set: &[&str]) -> (Grade, String) {
    let mut report = Report::default();
    cell(&mut report, &config(set));
    let Finding { grade, found, .. } = report.findings.remove(0);
    (grade, found)
}

#[test]
fn a_task_outside_the_workspace_and_limits_that_contradict_each_other_forbid_motion() {
    assert_eq!(found(&[]).0, Grade::Ok);
    let (grade, said) = found(&["task.hole_position=[0.30, 0.13, 0.05]"]);
    assert!(grade == Grade::Fail && said.contains("safety.shield.workspace"), "{said}");
    let (grade, said) = found(&["safety.force_max=15.0"]);
    assert!(grade == Grade::Fail && said.contains("force_norm_max"), "{said}");
}

#[test]
fn the_limits_of_a_rehearsal_are_for_this_computer_alone() {
    let grade = |host: &str, stale_ticks, stall_ticks| {
        let mut report = Report::default();
        silence(&mut report, &UrConfig { stale_ticks, stall_ticks, ..UrConfig::at(host) });
        report.findings[0].grade
    };
    assert_eq!(grade("10.0.0.2", 5, 10), Grade::Ok);
    assert_eq!(grade("10.0.0.2", 11, 22), Grade::Warn);
    assert_eq!(grade("10.0.0.2", 100, 100), Grade::Fail);
    assert_eq!(grade("127.0.0.1", 100, 100), Grade::Warn);
    assert_eq!(grade("localhost", 5, 300), Grade::Warn);
}
