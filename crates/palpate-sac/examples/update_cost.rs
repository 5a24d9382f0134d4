//! CPU time of one update as a share of what the core could do, measured together.
//!
//! `cargo run --release -p palpate-sac --example update_cost`
//!
//! Time on the CPU of the calling thread alone (Linux), so that other work on the machine counts only
//! through caches and clock. The peak is that of independent fused multiply-adds between the updates, at
//! the vector width of the element-wise loops; matrix products use a wider one where there is one.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]
#![expect(clippy::print_stdout, reason = "the result of the program")]

use std::hint::black_box;

use palpate_sac::{Mode, Ops, Sac, SacConfig, Transition};

const OBSERVATION: usize = 18;
const ACTION: usize = 14;
const BATCH: usize = 256;
const UNITS: usize = 256;
const ROUNDS: usize = 60;

fn main() {
    let mut fused = experienced(Ops::Fused);
    let mut plain = experienced(Ops::Plain);
    let (mut updates, mut references, mut peaks) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        peaks.push(peak());
        updates.push(cpu_seconds(|| fused.update().unwrap()));
        if round < ROUNDS / 4 {
            references.push(cpu_seconds(|| plain.update().unwrap()));
        }
    }
    let (update, reference, peak) = (median(updates), median(references), median(peaks));
    let share = work() / peak / update;
    println!("peak {:.1} GFLOP/s, update {:.0} MFLOP in matrix products", peak / 1e9, work() / 1e6);
    println!("update, fused: {:.2} ms of CPU time, {:.0} % of peak", update * 1e3, share * 100.0);
    println!(
        "update, plain: {:.2} ms on the calling thread, which spins while its pool works",
        reference * 1e3
    );
}

fn experienced(ops: Ops) -> Sac {
    let config = SacConfig {
        ops,
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
    let mut operations = 0;
    let seconds = cpu_seconds(|| operations = pulp::Arch::new().dispatch(Chains::<CHAINS>));
    operations as f64 / seconds
}

struct Chains<const CHAINS: usize>;

impl<const CHAINS: usize> pulp::WithSimd for Chains<CHAINS> {
    type Output = usize;

    // Compiled for the vector unit only inside its caller.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> usize {
        const TURNS: usize = 3_000_000;
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
    // The kernel brings the figure up to date when it schedules.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
