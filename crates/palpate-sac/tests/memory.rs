//! Learning takes no more memory the longer it lasts.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use palpate_sac::{Mode, Ops, Sac, SacConfig, Transition};

fn experienced(ops: Ops, batch_size: usize) -> Sac {
    let config = SacConfig {
        ops,
        threads: 1,
        hidden: vec![16, 16],
        batch_size,
        start_training: 8,
        replay_capacity: 1000,
        ..SacConfig::default()
    };
    let mut agent = Sac::new(&config, 3, 2, 1).unwrap();
    // More than the replay holds: from here on nothing needs room.
    for _ in 0..1500 {
        step(&mut agent);
    }
    agent
}

fn step(agent: &mut Sac) {
    let (observation, mut action) = ([0.1, -0.2, 0.3], [0.0; 2]);
    agent.act(&observation, Mode::Explore, &mut action).unwrap();
    agent
        .observe(&Transition {
            observation: &observation,
            action: &action,
            executed: &action,
            reward: -action[0].abs(),
            next_observation: &observation,
            terminal: false,
            episode_end: false,
        })
        .unwrap();
    agent.update().unwrap();
}

#[test]
fn what_an_update_takes_it_gives_back() {
    for ops in [Ops::Fused, Ops::Plain] {
        let mut agent = experienced(ops, 8);
        let taken = allocation_counter::measure(|| (0..3000).for_each(|_| step(&mut agent)));
        assert!(taken.count_total > 0, "nothing was counted");
        assert_eq!((taken.count_current, taken.bytes_current), (0, 0), "{ops:?}");
    }
}

/// What is given back is kept for the next update: the kernel is not asked for it again.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[test]
fn updates_ask_the_kernel_for_no_memory() {
    // Pages that the calling thread was given since it began.
    let pages = || -> u64 {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        // Counted behind the name, which may hold anything.
        stat.rsplit(')').next().unwrap().split_whitespace().nth(7).unwrap().parse().unwrap()
    };
    // A large batch: more than 128 kB come and go.
    let mut agent = experienced(Ops::Fused, 2048);
    let before = pages();
    (0..200).for_each(|_| step(&mut agent));
    let taken = pages() - before;
    assert!(taken < 100, "{taken} pages in 200 updates");
}

/// Minutes, hence on request: a million updates within the memory of the first hundred thousand.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "a million updates; run it with --run-ignored only"]
fn a_million_updates_take_no_more_memory_than_a_hundred_thousand() {
    let resident = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
    };
    let mut agent = experienced(Ops::Fused, 8);
    (0..50_000).for_each(|_| step(&mut agent));
    let before = resident();
    while agent.updates() < 1_000_000 {
        step(&mut agent);
    }
    let after = resident();
    println!("{before} kB after 100,000 updates, {after} kB after a million");
    assert!(after <= before + 256, "{before} kB have become {after} kB");
}
