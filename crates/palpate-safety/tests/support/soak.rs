//! Adversaries against the shield, with the judge looking on.

use palpate_safety::Counts;
use palpate_safety::SafetyConfig;
use palpate_safety::shield::{Proposal, Shield};
use palpate_spatial::{DOF, JointVector, Vector3, Wrench};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::adversary::{Adversary, KINDS, Kind};
use super::judge::Judge;
use super::{DT, chain, home, sample, tool0_T_tool};

pub(crate) struct Report {
    pub(crate) judge: Judge,
    pub(crate) counts: Counts,
    pub(crate) ticks: u64,
    /// Ticks per kind of adversary.
    pub(crate) by_kind: [u64; KINDS.len()],
    /// Least |det J| on the way.
    pub(crate) least_manipulability: f64,
    /// Cost of each tick.
    pub(crate) nanoseconds: Vec<u32>,
}

/// `ticks` proposals; the judge sees what the shield sends, or with `unguarded` what was asked for.
pub(crate) fn run(safety: &SafetyConfig, seed: u64, ticks: u64, unguarded: bool) -> Report {
    let chain = chain();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut shield = Shield::new(safety, chain.clone(), &tool0_T_tool(), DT).unwrap();
    let mut judge = Judge::new(safety, &chain);
    let mut by_kind = [0; KINDS.len()];
    let (mut q, mut lagging) = (home(), home());
    let mut adversary = Adversary::new(Kind::Honest, &q, rng);
    let (mut until, mut restart_at) = (0, 0);
    let (mut wrench, mut push) = (Wrench::zero(), Vector3::zeros());
    let mut least_manipulability = f64::INFINITY;
    let mut asked = q;
    let mut nanoseconds = Vec::with_capacity(ticks as usize);
    for tick in 0..ticks {
        if tick >= restart_at {
            q = start(&judge, rng);
            (lagging, asked) = (q, q);
            shield.restart();
            shield.begin_reset();
            if rng.random_bool(0.7) {
                shield.begin_episode();
            }
            judge.place(&q);
            restart_at = tick + rng.random_range(2_000..10_000);
            until = tick;
        }
        if tick >= until {
            let kind = KINDS[rng.random_range(0..KINDS.len())];
            adversary = Adversary::new(kind, &asked, rng);
            until = tick + rng.random_range(50..1_500);
        }
        // Now and then something pushes, so that there are stops and retreats.
        if rng.random_bool(0.002) {
            let size = if rng.random_bool(0.5) { 0.0 } else { rng.random_range(0.0..140.0) };
            push = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)) * size;
        }
        if shield.is_stopped() && rng.random_bool(0.01) {
            (wrench, push) = (Wrench::zero(), Vector3::zeros());
            shield.begin_reset();
            shield.begin_episode();
        }
        wrench.force += (push - wrench.force) * if tick % 3 == 0 { 0.3 } else { 0.003 };
        lagging += (q - lagging) * 0.2;
        let m = sample(&chain, tick as f64 * DT, &lagging, &q, wrench);
        let headed = if unguarded { asked } else { q };
        let proposal = adversary.next(&chain, &headed, &safety.joint_velocity_max, rng);
        by_kind[adversary.kind as usize] += 1;
        if unguarded {
            if let Proposal::Joints(q) = proposal {
                asked = q;
                judge.see(&q);
                if !q.iter().all(|x| x.abs() < 7.0) {
                    asked = home();
                    judge.place(&asked);
                }
            }
            continue;
        }
        let before = std::time::Instant::now();
        let decision = shield.tick(&m, &proposal);
        nanoseconds.push(before.elapsed().as_nanos() as u32);
        q = decision.executed;
        judge.see(&q);
        if tick % 16 == 0 {
            let J = chain.kinematics(&q).jacobian(palpate_kinematics::Frame::BaseAligned);
            least_manipulability = least_manipulability.min(J.determinant().abs());
        }
    }
    Report {
        judge,
        counts: shield.ledger().counts(),
        ticks,
        by_kind,
        least_manipulability,
        nanoseconds,
    }
}

/// A configuration that touches nothing.
fn start(judge: &Judge, rng: &mut ChaCha8Rng) -> JointVector {
    for _ in 0..20_000 {
        let spread = if rng.random_bool(0.5) { 0.3 } else { 3.0 };
        let by = JointVector::from_fn(|_, _| rng.random_range(-spread..spread));
        let q = home() + by;
        if judge.clearances(&q).iter().all(|&c| c > 0.0) && (0..DOF).all(|i| q[i].abs() < 3.0) {
            return q;
        }
    }
    home()
}
