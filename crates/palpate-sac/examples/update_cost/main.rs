//! Time of one update as a share of what the core could do, measured together.
//!
//! `cargo run --release -p palpate-sac --example update_cost [ROUNDS [torch] [jax]]`; `cargo xtask bench` asks for the peers
//! that this computer's Python has. They take turns with ours, five updates at a time, in CPU time of one thread.
//!
//! One thread: time on the CPU of the calling thread alone (Linux), so that other work on the machine counts
//! only through caches and clock. Two threads: wall time, beside the wall time of one thread in the same run. The
//! peak is the best that independent fused multiply-adds on registers reached, with 256-bit and with the
//! widest vectors, between the updates.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]
#![expect(clippy::print_stdout, reason = "the result of the program")]

mod peer;

use std::fmt::{Display, Formatter};
use std::hint::black_box;
use std::time::Instant;

use peer::Peer;

use palpate_sac::{Mode, Ops, Sac, SacConfig, Transition};

const OBSERVATION: usize = 18;
const ACTION: usize = 14;
const BATCH: usize = 256;
const UNITS: usize = 256;
/// Updates in a turn: in a training, too, nothing empties the caches between most of them.
const TURN: usize = 5;

fn main() {
    let rounds = std::env::args().nth(1).map_or(20, |n| n.parse().unwrap());
    let [mut one, mut two] = [1, 2].map(|threads| experienced(Ops::Fused, threads));
    let mut peers: Vec<Peer> = std::env::args().skip(2).map(|name| Peer::start(&name)).collect();
    let (mut updates, mut peaks) = (Vec::new(), Vec::new());
    let (mut walls, mut pairs) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        peaks.push(peak());
        for _ in 0..TURN {
            let began = Instant::now();
            updates.push(cpu_seconds(|| one.update().unwrap()));
            walls.push(began.elapsed().as_secs_f64());
        }
        for _ in 0..TURN {
            let began = Instant::now();
            two.update().unwrap();
            pairs.push(began.elapsed().as_secs_f64());
        }
        for peer in &mut peers {
            (0..TURN).for_each(|_| peer.update());
        }
    }
    // Last: once candle's pool has started, it spins beside everything else.
    let mut plain = experienced(Ops::Plain, 1);
    let references = (0..rounds).map(|_| cpu_seconds(|| plain.update().unwrap())).collect();
    let peak = peaks.into_iter().fold(0.0, f64::max);
    let [ours, reference, walls, pairs] = [updates, references, walls, pairs].map(Spread::of);
    let share = |seconds: f64| 100.0 * work() / peak / seconds;
    println!("peak {:.1} GFLOP/s, update {:.0} MFLOP in matrix products", peak / 1e9, work() / 1e6);
    println!(
        "fused, one thread: {ours} of CPU time, {:.0} % of peak (best {:.0} %)",
        share(ours.median),
        share(ours.best)
    );
    println!("fused, one thread: {walls} of wall time");
    println!(
        "fused, two threads: {pairs} of wall time: {:.2} times one thread (best against best {:.2})",
        walls.median / pairs.median,
        walls.best / pairs.best
    );
    for Peer { name, updates, .. } in &peers {
        let theirs = Spread::of(updates.clone());
        println!(
            "{name}: {theirs}, {:.2} times ours (best against best {:.2})",
            theirs.median / ours.median,
            theirs.best / ours.best
        );
    }
    println!("plain: {reference} on the calling thread, which spins while its pool works");
}

struct Spread {
    best: f64,
    median: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self { best: values[0], median: values[values.len() / 2] }
    }
}

impl Display for Spread {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2} ms (best {:.2})", self.median * 1e3, self.best * 1e3)
    }
}

fn experienced(ops: Ops, threads: usize) -> Sac {
    let config = SacConfig {
        ops,
        threads,
        hidden: vec![UNITS, UNITS],
        batch_size: BATCH,
        updates_per_step: 1,
        replay_capacity: 20_000,
        warmup_steps: u64::MAX,
        ..SacConfig::default()
    };
    let mut agent = Sac::new(&config, OBSERVATION, ACTION, 1).unwrap();
    let (mut observation, mut action) = ([0.1; OBSERVATION], [0.0; ACTION]);
    for step in 0..20_000 {
        agent.act(&observation, Mode::Explore, &mut action).unwrap();
        let next_observation = std::array::from_fn(|i| 0.5 * observation[i] + action[i % ACTION]);
        let transition = Transition {
            observation: &observation,
            action: &action,
            executed: &action,
            reward: -action[0].abs(),
            next_observation: &next_observation,
            terminal: false,
            episode_end: step % 150 == 149,
        };
        agent.observe(&transition).unwrap();
        observation = next_observation;
    }
    agent
}

/// Floating-point operations of one update's matrix products.
fn work() -> f64 {
    let (below, inner) = ((OBSERVATION + ACTION) * UNITS, UNITS * UNITS);
    let (actor_head, actor_below) = (2 * ACTION * UNITS, OBSERVATION * UNITS);
    let (actor, critic) = (actor_below + inner + actor_head, below + inner + UNITS);
    let forward = 2 * actor + 6 * critic;
    // Weights of what is trained, and deltas down to its first layer.
    let trained = (actor + inner + actor_head) + 2 * (critic + inner + UNITS);
    // Through both frozen critics to the action.
    let through = 2 * (UNITS + inner + UNITS * ACTION);
    (2 * BATCH * (forward + trained + through)) as f64
}

/// FLOP/s of fused multiply-adds on registers: the best of some numbers of independent chains.
fn peak() -> f64 {
    chains::<8>().max(chains::<12>()).max(chains::<16>())
}

fn chains<const CHAINS: usize>() -> f64 {
    let rate = |run: &dyn Fn() -> usize| {
        let mut operations = 0;
        let seconds = cpu_seconds(|| operations = run());
        operations as f64 / seconds
    };
    let widest = rate(&|| pulp::Arch::new().dispatch(Chains::<CHAINS>));
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return widest.max(rate(&|| pulp::Simd::vectorize(simd, Chains::<CHAINS>)));
    }
    widest
}

struct Chains<const CHAINS: usize>;

impl<const CHAINS: usize> pulp::WithSimd for Chains<CHAINS> {
    type Output = usize;

    // Compiled for the vector unit only inside its caller.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> usize {
        const TURNS: usize = 300_000;
        let (a, b) = (simd.splat_f32s(black_box(0.999_9)), simd.splat_f32s(black_box(1e-4)));
        let mut sums = [simd.splat_f32s(black_box(1.0)); CHAINS];
        for _ in 0..TURNS {
            for sum in &mut sums {
                *sum = simd.mul_add_f32s(*sum, a, b);
            }
        }
        black_box(sums.map(|sum| simd.reduce_sum_f32s(sum)));
        2 * S::F32_LANES * CHAINS * TURNS
    }
}

fn cpu_seconds<T>(work: impl FnOnce() -> T) -> f64 {
    let before = on_cpu();
    black_box(work());
    on_cpu() - before
}

/// Seconds this thread has run.
fn on_cpu() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
