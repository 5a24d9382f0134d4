//! What recordings hold, read back from the files.

use std::collections::BTreeMap;
use std::path::Path;

use palpate_env::Outcome;

use super::*;
use crate::baselines::Actor;
use crate::config::Choice;
use crate::stack::{Purpose, SimEnv, sim_env};

fn config(set: &[&str]) -> Config {
    let set = set.iter().map(ToString::to_string).collect();
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    Config::load(&Choice { preset, task, model, file: None, set }).unwrap()
}

fn episode(env: &mut SimEnv, actor: &mut Actor, number: u64) -> Outcome {
    env.set_next_episode(number);
    env.reset().unwrap();
    actor.reset(number);
    loop {
        let action = actor.act(env).to_vec();
        if let Some(summary) = env.step(&action).unwrap().summary {
            return summary.outcome;
        }
    }
}

/// Messages per topic, and what the last line of the log says.
fn contents(file: &Path) -> (BTreeMap<String, usize>, String) {
    let bytes = std::fs::read(file).unwrap();
    let (mut topics, mut said) = (BTreeMap::new(), String::new());
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        *topics.entry(message.channel.topic.clone()).or_default() += 1;
        if message.channel.topic == "/log" {
            said = String::from_utf8_lossy(&message.data).into_owned();
        }
    }
    (topics, said)
}

#[test]
fn a_success_is_recorded_sample_by_sample_and_thinned_on_request() {
    let dir = tempfile::tempdir().unwrap();
    for (rate, per_action) in [("500.0", 25.0), ("50.0", 2.5)] {
        let config = config(&[&format!("record.rate={rate}")]);
        let mut env = sim_env(&config, 7, Purpose::Evaluate).unwrap();
        let mut recorder = Recorder::new(&config, dir.path()).unwrap();
        recorder.load(&mut env);
        let mut script = Actor::scripted(&config, env.action_dim());
        assert_eq!(episode(&mut env, &mut script, 0), Outcome::Success);
        recorder.keep(&mut env, Kind::Policy("a script".into()), true);
        assert_eq!(recorder.finish(), [""; 0]);
        let (topics, said) = contents(&dir.path().join("a-script_000_success.mcap"));
        let (actions, joints) = (topics["/action"], topics["/joints"]);
        // And what the arm takes to stop.
        let more = joints as f64 - per_action * actions as f64;
        assert!((-1.0..25.0).contains(&more), "{topics:?}");
        for topic in ["/joints/target", "/wrench", "/wrench/unfiltered", "/error", "/tool/pose"] {
            assert_eq!(topics[topic], joints, "{topic}");
        }
        assert_eq!((topics["/reward"], topics["/gains"]), (actions, actions));
        assert!(topics["/frames"] * 10 >= actions * 25, "{topics:?}");
        assert_eq!((topics["/scene"], topics["/robot_description"]), (1, 1));
        assert!(said.contains("Success"), "{said}");
    }
}

#[test]
fn a_collision_tells_its_cause_and_tapes_are_used_again() {
    let dir = tempfile::tempdir().unwrap();
    let config =
        config(&["safety.mode=force-first", "safety.force_max=4.0", "record.collisions=3"]);
    let mut env = sim_env(&config, 7, Purpose::Train).unwrap();
    let mut recorder = Recorder::new(&config, dir.path()).unwrap();
    recorder.load(&mut env);
    let mut random = Actor::random(env.action_dim(), 1);
    let collided: Vec<u64> = (0..8)
        .filter(|&n| {
            let collided = episode(&mut env, &mut random, n) == Outcome::Collision;
            if collided {
                recorder.keep(&mut env, Kind::Collision, true);
            }
            collided
        })
        .collect();
    assert!(collided.len() > 4, "{collided:?}");
    assert_eq!(recorder.finish(), [""; 0]);
    let mut files: Vec<String> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let last = &collided[collided.len() - 3..];
    let expected: Vec<String> = last.iter().map(|n| format!("collision_{n:06}.mcap")).collect();
    assert_eq!(files, expected);
    let (topics, said) = contents(&dir.path().join(&files[2]));
    assert!(topics["/log"] >= 2 && topics["/verdict"] >= 2, "{topics:?}");
    assert!(said.contains("Collision"), "{said}");
}

#[test]
fn a_recorder_that_is_behind_is_not_waited_for_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(&["env.max_steps=2"]);
    let mut env = sim_env(&config, 7, Purpose::Train).unwrap();
    let mut recorder = Recorder::new(&config, dir.path()).unwrap();
    // A queue that nobody empties.
    let (full, jobs) = sync_channel(1);
    recorder.full = Some(full);
    recorder.load_in_real_time(&mut env);
    let mut zero = Actor::zero(env.action_dim());
    for n in 0..3 {
        episode(&mut env, &mut zero, n);
        recorder.keep(&mut env, Kind::Policy("arm".into()), false);
    }
    assert_eq!(jobs.try_iter().count(), 1);
    drop(jobs);
    let lost = recorder.finish();
    assert!(lost.iter().any(|line| line.contains("2 episodes")), "{lost:?}");
}
