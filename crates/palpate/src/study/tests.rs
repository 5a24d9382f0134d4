use super::*;
use work::Tally;

#[test]
fn shards_are_a_partition() {
    assert_eq!(shard("2/8"), Ok((2, 8)));
    for wrong in ["0/2", "3/2", "2", "a/b", "1/0", "/2"] {
        assert!(shard(wrong).is_err(), "{wrong}");
    }
    let share = |shard| Share {
        which: Which { study: "x".into(), out: None },
        index: None,
        shard,
        jobs: Some(3),
        threads: None,
        time_budget: None,
        worker: false,
    };
    assert_eq!(share(None).indices(3), [0, 1, 2]);
    let mut all: Vec<usize> = (1..=3).flat_map(|i| share(Some((i, 3))).indices(10)).collect();
    assert_eq!(share(Some((2, 3))).indices(10), [1, 4, 7]);
    all.sort_unstable();
    assert_eq!(all, (0..10).collect::<Vec<_>>());
    let (jobs, threads) = share(None).processes();
    assert!(jobs == 3 && (1..=2).contains(&threads));
}

#[test]
fn the_exit_code_is_for_the_scheduler() {
    let code = |failed: &[&str], left| {
        let failed = failed.iter().map(ToString::to_string).collect();
        Tally { done: 1, failed, left }.code()
    };
    assert_eq!(code(&[], 0), 0);
    assert_eq!(code(&[], 2), 75);
    assert_eq!(code(&["a"], 2), 1);
}
