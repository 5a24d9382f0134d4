use super::*;
use palpate_safety::Mode;

use crate::stack::{Purpose, sim_env};

fn choice(preset: &str, task: &str, model: &str, set: &[&str]) -> Choice {
    Choice {
        preset: preset.into(),
        task: task.into(),
        model: model.into(),
        file: None,
        set: set.iter().map(ToString::to_string).collect(),
    }
}

#[test]
fn every_preset_task_and_model_makes_a_configuration() {
    for (preset, _) in PRESETS {
        for (task, _) in TASKS {
            for (model, _) in MODELS {
                Config::load(&choice(preset, task, model, &[])).unwrap();
            }
        }
    }
}

#[test]
fn a_task_is_not_changed_by_its_name() {
    let named = |name: &str| {
        let set = format!("task.name={name}");
        Config::load(&choice("palpate", "peg-insertion", "P-14", &[&set]))
    };
    let error = named("ring-insertion").unwrap_err().to_string();
    assert!(error.contains("--task ring-insertion"), "{error}");
    let mine = named("my-peg").unwrap();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("config.toml"), mine.to_toml().unwrap()).unwrap();
    let set = ["task.name=peg-insertion-sharp".to_owned()];
    let error = Config::of_run(dir.path(), &set).unwrap_err().to_string();
    assert!(error.contains("would not make my-peg that task"), "{error}");
}

#[test]
fn a_resolved_configuration_reads_back_as_itself() {
    let config =
        Config::load(&choice("palpate", "peg-insertion", "A-18", &["run.seed=7"])).unwrap();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("config.toml"), config.to_toml().unwrap()).unwrap();
    assert_eq!(Config::of_run(dir.path(), &[]).unwrap(), config);
}

/// The example of the how-to page, with and without an arm.
#[test]
fn the_example_cell_stands_the_shield_and_its_arm_is_left_out_of_a_simulation() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("cell.toml");
    let text = include_str!("../../../../docs/how-to/cell.toml");
    // With the keys that the example has commented out.
    let arm: Vec<&str> = text
        .lines()
        .skip_while(|line| !line.starts_with("# [ur]"))
        .map(|line| line.trim_start_matches("# "))
        .collect();
    let arm = arm.join("\n");
    std::fs::write(&file, format!("{text}\n{arm}\nhost = \"elsewhere\"\n")).unwrap();
    let choice =
        Choice { file: Some(file.clone()), ..choice("palpate", "peg-insertion", "P-14", &[]) };
    let simulated = Config::load(&choice).unwrap();
    assert_eq!(simulated.ur, None);
    let here = UrConfig::at("here");
    let arm = Config::load_for(&choice, &here).unwrap();
    let ur = arm.ur.clone().unwrap();
    assert_eq!((ur.host.as_str(), ur.stale_ticks), ("here", 8));
    let reaction = |config: &Config| config.safety.shield.as_ref().unwrap().force.reaction_time;
    assert_eq!((reaction(&simulated), reaction(&arm)), (0.03, 0.055));
    let mut env = sim_env(&arm, 1, Purpose::Train).unwrap();
    for _ in 0..3 {
        env.reset().unwrap();
    }

    // A run of a simulation takes the file when it goes to the arm.
    std::fs::write(dir.path().join("config.toml"), simulated.to_toml().unwrap()).unwrap();
    let run = Config::of_run_for(dir.path(), &here, Some(&file), &[]).unwrap();
    assert_eq!(reaction(&run), 0.055);
    assert_eq!((run.ur.unwrap().stale_ticks, run.safety.mode), (8, Mode::Shield));
    // And a simulation that goes on from it takes it without its arm.
    let run = Config::of_run_with(dir.path(), Some(&file), &[]).unwrap();
    assert_eq!((run.ur.is_none(), reaction(&run)), (true, 0.03));

    std::fs::write(&file, "[ur]\nstale_tick = 8\n").unwrap();
    let error = format!("{:#}", Config::load(&choice).unwrap_err());
    assert!(error.contains("`stale_tick`") && error.contains("`stale_ticks`"), "{error}");
}

#[test]
fn what_is_laid_over_a_run_is_to_blame_for_itself() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("config.toml");
    let config = Config::load(&choice("palpate", "peg-insertion", "P-14", &[])).unwrap();
    std::fs::write(&path, config.to_toml().unwrap()).unwrap();
    let error = || format!("{:#}", Config::of_run(dir.path(), &["sac.gama=1".into()]).unwrap_err());
    assert!(error().contains("sac.gamma") && !error().contains("cannot be used"), "{}", error());
    std::fs::write(&path, "[run]\nseed = 1\n").unwrap();
    assert!(error().contains("cannot be used"), "{}", error());
}

#[test]
fn errors_name_the_key_and_what_would_do() {
    let error = |task, model, set: &[&str]| {
        format!("{:#}", Config::load(&choice("palpate", task, model, set)).unwrap_err())
    };
    let e = error("peg-insertion", "P-14", &["sac.gama=0.9"]);
    assert!(e.contains("sac.gama") && e.contains("sac.gamma"), "{e}");
    let e = error("peg-insertion", "P-15", &[]);
    assert!(e.contains("P-15") && e.contains("p-14") && e.contains("a-13pd"), "{e}");
    let e = error("peg-insertion", "P-14", &["policy.gains.position.range=[2, 2, 2, 2, 2, 2]"]);
    assert!(e.contains("policy.gains.position") && e.contains("less than the base of 1"), "{e}");
    let e = error("peg-insertion", "P-14", &["run.steps=0"]);
    assert!(e.contains("run.steps"), "{e}");
    let e = error("peg-insertion", "P-14", &["robot.tcp=[0.0, 0.0, 0.2]"]);
    assert!(e.contains("robot.tcp") && e.contains("sim.tool.length"), "{e}");
}

#[test]
fn the_default_parallel_models_stand_the_simulated_contact_and_a_stiff_one_is_warned_of() {
    let quiet = Config::load(&choice("palpate", "peg-insertion", "P-14", &[])).unwrap();
    assert_eq!(quiet.warnings(), [""; 0]);
    let stiff =
        choice("palpate", "peg-insertion", "P-14", &["sim.compliance.linear_stiffness=4e4"]);
    let warnings = Config::load(&stiff).unwrap().warnings();
    assert!(
        warnings.len() == 1 && warnings[0].starts_with("axes x, y, z: a contact"),
        "{warnings:?}"
    );
}
