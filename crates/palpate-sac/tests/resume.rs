//! Same seed, same bits; saved and loaded, same bits; a damaged file is refused by name.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::path::Path;

use palpate_sac::{Mode, Policy, Sac, SacConfig, Transition};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn config() -> SacConfig {
    SacConfig {
        hidden: vec![16, 16],
        batch_size: 16,
        start_training: 16,
        replay_capacity: 60,
        ..SacConfig::default()
    }
}

/// Lives through `steps` steps that depend on the step's number alone and returns the bits of all actions.
fn live(agent: &mut Sac, from: usize, steps: usize) -> Vec<u32> {
    let mut action = [0.0; 3];
    let mut bits = Vec::new();
    for step in from..from + steps {
        let see = |step: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(step as u64);
            [(); 4].map(|()| rng.random_range(-1.0..1.0f32))
        };
        agent.act(&see(step), Mode::Explore, &mut action).unwrap();
        bits.extend(action.map(f32::to_bits));
        let transition = Transition {
            observation: &see(step),
            action: &action,
            reward: action[0] * see(step)[1],
            next_observation: &see(step + 1),
            terminal: step % 17 == 16,
            episode_end: step % 11 == 10,
        };
        agent.observe(&transition).unwrap();
        agent.update().unwrap();
    }
    bits
}

/// Every file of a checkpoint, bit for bit.
fn files(agent: &Sac) -> Vec<(String, Vec<u8>)> {
    let dir = tempfile::tempdir().unwrap();
    agent.save(dir.path()).unwrap();
    let mut files: Vec<_> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, std::fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn a_seed_fixes_every_bit() {
    let run = |seed| {
        let mut agent = Sac::new(&config(), 4, 3, seed).unwrap();
        (live(&mut agent, 0, 80), files(&agent))
    };
    assert!(run(1) == run(1));
    assert!(run(1).0 != run(2).0);
}

#[test]
fn a_loaded_agent_goes_on_as_if_nothing_had_happened() {
    let mut straight = Sac::new(&config(), 4, 3, 1).unwrap();
    let mut cut = Sac::new(&config(), 4, 3, 1).unwrap();
    // Before learning starts, while the ring fills, and after it wrapped.
    for (from, steps) in [(0, 7), (7, 40), (47, 70)] {
        let expected = live(&mut straight, from, steps);
        assert!(live(&mut cut, from, steps) == expected, "steps {from} to {}", from + steps);
        let dir = tempfile::tempdir().unwrap();
        cut.save(dir.path()).unwrap();
        cut = Sac::load(dir.path()).unwrap();
    }
    assert!(files(&cut) == files(&straight));
    assert_eq!((cut.steps(), cut.updates()), (straight.steps(), straight.updates()));
}

#[test]
fn the_saved_policy_is_the_one_that_acts() {
    let mut agent = Sac::new(&config(), 4, 3, 1).unwrap();
    live(&mut agent, 0, 50);
    let dir = tempfile::tempdir().unwrap();
    agent.save_policy(dir.path()).unwrap();
    let (mut expected, mut found) = ([0.0; 3], [0.0; 3]);
    let observation = [0.3, -0.2, 0.9, 0.0];
    agent.act(&observation, Mode::Exploit, &mut expected).unwrap();
    Policy::load(dir.path()).unwrap().mean(&observation, &mut found);
    assert_eq!(expected, found);
    agent.save(dir.path()).unwrap();
    Policy::load(dir.path()).unwrap().mean(&observation, &mut found);
    assert_eq!(expected, found);
}

#[test]
fn a_damaged_file_is_refused_by_name() {
    let mut agent = Sac::new(&config(), 4, 3, 1).unwrap();
    live(&mut agent, 0, 30);
    for name in ["agent.safetensors", "replay.safetensors", "state.json"] {
        for damage in ["cut", "missing", "other"] {
            let dir = tempfile::tempdir().unwrap();
            agent.save(dir.path()).unwrap();
            let path = dir.path().join(name);
            match damage {
                "cut" => {
                    let bytes = std::fs::read(&path).unwrap();
                    std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
                }
                "missing" => std::fs::remove_file(&path).unwrap(),
                _ => std::fs::write(&path, b"not what was saved").unwrap(),
            }
            let error = Sac::load(dir.path()).unwrap_err().to_string();
            assert!(error.contains(name), "{name} {damage}: {error}");
        }
    }
}

#[test]
fn a_checkpoint_of_other_sizes_is_refused() {
    let save = |agent: &Sac, dir: &Path| agent.save(dir).unwrap();
    let (dir, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut agent = Sac::new(&config(), 4, 3, 1).unwrap();
    live(&mut agent, 0, 30);
    save(&agent, dir.path());
    let wide = SacConfig { hidden: vec![24, 16], ..config() };
    save(&Sac::new(&wide, 4, 3, 1).unwrap(), other.path());
    std::fs::copy(other.path().join("agent.safetensors"), dir.path().join("agent.safetensors"))
        .unwrap();
    let error = Sac::load(dir.path()).unwrap_err().to_string();
    assert!(error.contains("agent.safetensors"), "{error}");
}
