//! The same seed gives the same bits; so does saving, loading and going on; damaged files are refused.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

use std::fs;
use std::path::Path;

use palpate_sac::{Mode, Policy, Sac, SacConfig, UpdateStats};
use palpate_sac::{SacError, Transition};

const FILES: [&str; 3] = ["agent.safetensors", "replay.safetensors", "state.json"];

/// An agent and where its world is: a point that drifts as pushed, episodes of 30 steps.
struct Run {
    agent: Sac,
    observation: [f32; 2],
}

impl Run {
    fn new(seed: u64) -> Self {
        Self::with_threads(seed, 0)
    }

    fn with_threads(seed: u64, threads: usize) -> Self {
        Self::with(seed, &SacConfig { threads, ..SacConfig::default() })
    }

    /// One that was shown 40 steps, and keeps what went before every second episode's end apart.
    fn taught(seed: u64) -> Self {
        let shares = SacConfig {
            demonstration_share: 0.5,
            danger_share: 0.2,
            danger_steps: 4,
            ..SacConfig::default()
        };
        let mut run = Self::with(seed, &shares);
        for number in 0..40u8 {
            let seen = [f32::from(number) / 40.0, 0.0];
            run.agent
                .demonstrate(&Transition {
                    observation: &seen,
                    action: &[-1.0],
                    executed: &[-1.0],
                    reward: 1.0,
                    next_observation: &seen,
                    terminal: false,
                    episode_end: number % 20 == 19,
                })
                .unwrap();
        }
        run
    }

    fn with(seed: u64, config: &SacConfig) -> Self {
        let config = SacConfig {
            hidden: vec![24, 24],
            batch_size: 16,
            start_training: 20,
            // Small enough to wrap around within the test, in warm-up and after it.
            replay_capacity: 70,
            warmup_steps: 25,
            ..config.clone()
        };
        Self { agent: Sac::new(&config, 2, 1, seed).unwrap(), observation: [0.5, -0.5] }
    }

    /// Bits of every action and statistic on the way.
    fn go(&mut self, steps: usize) -> Vec<u32> {
        let mut bits = Vec::new();
        for _ in 0..steps {
            let mut action = [0.0];
            self.agent.act(&self.observation, Mode::Explore, &mut action).unwrap();
            let [position, speed] = self.observation;
            let next_observation = [position + 0.1 * speed, 0.9 * speed + 0.1 * action[0]];
            let end = self.agent.steps() % 30 == 29;
            self.agent
                .observe(&Transition {
                    observation: &self.observation,
                    action: &action,
                    executed: &action,
                    reward: -next_observation[0].abs(),
                    next_observation: &next_observation,
                    terminal: end && position > 0.4,
                    episode_end: end,
                })
                .unwrap();
            if self.agent.steps().is_multiple_of(60) {
                self.agent.remember_danger();
            }
            self.observation = if end { [0.5, -0.5] } else { next_observation };
            bits.push(action[0].to_bits());
            if let Some(stats) = self.agent.update().unwrap() {
                let UpdateStats { critic_loss, actor_loss, alpha, entropy, .. } = stats;
                bits.extend([critic_loss, actor_loss, alpha, entropy].map(f32::to_bits));
            }
        }
        bits
    }
}

/// Every byte that a save consists of: weights, moments, replay, counters and random streams.
fn bytes(agent: &Sac) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    agent.save(folder.path()).unwrap();
    FILES.map(|file| fs::read(folder.path().join(file)).unwrap()).into()
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_does_not() {
    let (mut first, mut second, mut other) = (Run::new(3), Run::new(3), Run::new(4));
    let bits = first.go(90);
    assert_eq!(bits, second.go(90));
    assert_eq!(bytes(&first.agent), bytes(&second.agent));
    assert_ne!(bits, other.go(90));
}

#[test]
fn one_thread_and_two_learn_the_same_bits() {
    let (mut one, mut two) = (Run::with_threads(3, 1), Run::with_threads(3, 2));
    assert_eq!(one.go(90), two.go(90));
    // All but the configuration, which says how many there are.
    assert_eq!(bytes(&one.agent)[..2], bytes(&two.agent)[..2]);
}

#[test]
fn saving_and_loading_changes_nothing() {
    // In warm-up, at the first updates, and with a ring that has wrapped.
    for at in [10, 22, 100] {
        let mut straight = Run::new(3);
        straight.go(at);
        let folder = tempfile::tempdir().unwrap();
        straight.agent.save(folder.path()).unwrap();
        let agent = Sac::load(folder.path()).unwrap();
        let mut resumed = Run { agent, observation: straight.observation };
        assert_eq!(straight.go(60), resumed.go(60), "saved after {at} steps");
        assert_eq!(bytes(&straight.agent), bytes(&resumed.agent), "saved after {at} steps");
    }
}

#[test]
fn threads_may_be_others_after_loading() {
    let (folder, again) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    Run::new(3).agent.save(folder.path()).unwrap();
    for threads in [1, 2] {
        let agent = Sac::load_on(folder.path(), threads).unwrap();
        agent.save(again.path()).unwrap();
        let state = fs::read_to_string(again.path().join("state.json")).unwrap();
        assert!(state.contains(&format!("\"threads\": {threads}")), "{state}");
    }
    let error = Sac::load_on(folder.path(), 3).unwrap_err().to_string();
    assert!(error.contains("threads"), "{error}");
}

#[test]
fn a_loaded_agent_draws_from_the_seed_it_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(3);
    run.go(60);
    run.agent.save(folder.path()).unwrap();
    let gone_on = |seed| {
        let mut agent = Sac::load(folder.path()).unwrap();
        agent.reseed(seed);
        let mut heir = Run { agent, observation: run.observation };
        heir.go(30);
        bytes(&heir.agent)
    };
    let same = gone_on(3);
    assert_ne!(gone_on(4), same);
    assert_ne!(gone_on(4), gone_on(5));
    run.go(30);
    assert_eq!(same, bytes(&run.agent));
}

#[test]
fn saving_and_loading_keeps_demonstrations_and_danger() {
    // Before the first update, and before and after there is danger to draw.
    for at in [0, 40, 100] {
        let mut straight = Run::taught(3);
        straight.go(at);
        let folder = tempfile::tempdir().unwrap();
        straight.agent.save(folder.path()).unwrap();
        let agent = Sac::load(folder.path()).unwrap();
        assert_eq!(agent.demonstrated(), 40);
        let mut resumed = Run { agent, observation: straight.observation };
        assert_eq!(straight.go(60), resumed.go(60), "saved after {at} steps");
        assert_eq!(bytes(&straight.agent), bytes(&resumed.agent), "saved after {at} steps");
    }
}

#[test]
fn demonstrations_are_learned_from_and_are_no_steps_of_the_run() {
    let (mut alone, mut taught) = (Run::new(3), Run::taught(3));
    assert_eq!((taught.agent.steps(), taught.agent.replay_len()), (0, 0));
    // Before the first update nothing differs.
    assert_eq!(alone.go(19), taught.go(19));
    assert_ne!(alone.go(10), taught.go(10));
    let wrong = taught.agent.demonstrate(&Transition {
        observation: &[0.0; 3],
        action: &[0.0],
        executed: &[0.0],
        reward: 0.0,
        next_observation: &[0.0; 2],
        terminal: false,
        episode_end: false,
    });
    assert!(wrong.unwrap_err().to_string().contains("observation has 3 values, expected 2"));
    assert_eq!(taught.agent.demonstrated(), 40);
}

#[test]
fn a_saved_policy_acts_like_the_agent() {
    let mut run = Run::new(3);
    run.go(60);
    let folder = tempfile::tempdir().unwrap();
    run.agent.save_policy(folder.path()).unwrap();
    let mut policy = Policy::load(folder.path()).unwrap();
    assert!(policy == run.agent.policy());
    let (mut by_policy, mut by_agent) = ([0.0], [0.0]);
    policy.mean(&[0.2, 0.1], &mut by_policy);
    run.agent.act(&[0.2, 0.1], Mode::Exploit, &mut by_agent).unwrap();
    assert_eq!(by_policy[0].to_bits(), by_agent[0].to_bits());
    // Learning on leaves the copy alone.
    run.go(10);
    assert!(policy != run.agent.policy());
}

/// The error of loading after one file was changed; it must name that file.
fn refused(saved: &Path, file: &str, edit: impl FnOnce(&mut Vec<u8>)) -> String {
    let folder = tempfile::tempdir().unwrap();
    for name in FILES {
        fs::copy(saved.join(name), folder.path().join(name)).unwrap();
    }
    let path = folder.path().join(file);
    let mut bytes = fs::read(&path).unwrap();
    edit(&mut bytes);
    fs::write(&path, bytes).unwrap();
    let error: SacError = Sac::load(folder.path()).unwrap_err();
    let message = error.to_string();
    assert!(message.contains(file), "{message}");
    message
}

fn saved() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(3);
    run.go(40);
    run.agent.save(folder.path()).unwrap();
    folder
}

#[test]
fn a_file_cut_short_is_refused_by_name() {
    let folder = saved();
    for file in FILES {
        let size = fs::read(folder.path().join(file)).unwrap().len();
        for keep in [0, 1, 7, 8, 100, size / 2, size - 1] {
            refused(folder.path(), file, |bytes| bytes.truncate(keep));
        }
    }
}

#[test]
fn a_missing_file_is_refused_by_name() {
    for file in FILES {
        let folder = saved();
        fs::remove_file(folder.path().join(file)).unwrap();
        let message = Sac::load(folder.path()).unwrap_err().to_string();
        assert!(message.contains(file), "{message}");
    }
}

#[test]
fn files_that_cannot_be_what_was_saved_are_refused() {
    let folder = saved();
    let replace = |bytes: &mut Vec<u8>, from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        bytes.splice(at..at + from.len(), to.bytes());
    };
    let last = |bytes: &mut Vec<u8>, value: [u8; 4]| {
        let at = bytes.len() - 4;
        bytes[at..].copy_from_slice(&value);
    };
    let message = refused(folder.path(), FILES[0], |b| last(b, f32::NAN.to_le_bytes()));
    assert!(message.contains("is NaN"), "{message}");
    let message = refused(folder.path(), FILES[1], |b| last(b, [7; 4]));
    assert!(message.contains("not a flag"), "{message}");
    refused(folder.path(), FILES[0], |b| b[9] ^= 0x40);
    refused(folder.path(), FILES[0], |b| replace(b, "actor.0.weight", "actor.9.weight"));
    refused(folder.path(), FILES[1], |b| b.extend([0; 4]));
    let message =
        refused(folder.path(), FILES[2], |b| replace(b, "\"format\": 1", "\"format\": 9"));
    assert!(message.contains("format 9"), "{message}");
    refused(folder.path(), FILES[2], |b| replace(b, "\"steps\"", "\"stops\""));
    // The replay does not say where the ring goes on: the state does.
    refused(folder.path(), FILES[1], |b| {
        let other = tempfile::tempdir().unwrap();
        let mut run = Run::new(3);
        run.go(35);
        run.agent.save(other.path()).unwrap();
        *b = fs::read(other.path().join(FILES[1])).unwrap();
    });
}
