//! What you learn: how often IK succeeds, how far it steps and how long it takes, on thousands of poses.
//! Run: `cargo run --release -p palpate-kinematics --example ik_report`
//! You should see: 100 % everywhere but for far seeds on badly calibrated arms, in about a microsecond.
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a report for a terminal, on our own files"
)]

#[path = "../tests/sets/mod.rs"]
mod sets;

use std::time::Instant;

use palpate_kinematics::{IkError, IkOptions, IkSolution, SerialChain, UrModel, UrSolver};
use palpate_spatial::{JointVector, Pose};
use sets::{CALIBRATIONS, Case, DISTANCES, SINGULARITIES};

fn main() {
    println!(
        "{:<23} {:<20} {:>6} {:>8} {:>9} {:>7} {:>7} {:>7}",
        "arm", "set", "cases", "ok", "max step", "p50", "p99", "max"
    );
    println!(
        "{:<23} {:<20} {:>6} {:>8} {:>9} {:>7} {:>7} {:>7}",
        "", "", "", "%", "rad", "us", "us", "us"
    );
    let nominal = UrModel::ALL.map(|model| (model.name().to_owned(), model, sets::ur(model)));
    for (name, model, chain) in nominal {
        report(&name, model, &chain, model == UrModel::Ur3e);
    }
    let rng = &mut sets::stream(40);
    for size in CALIBRATIONS {
        let name = format!("UR3e {} mm / {} mrad", size.length * 1e3, size.angle * 1e3);
        report(&name, UrModel::Ur3e, &sets::calibrated(UrModel::Ur3e, size, rng), true);
    }
    let delta = sets::delta_dh(UrModel::Ur3e, CALIBRATIONS[2], rng);
    report("UR3e delta DH", UrModel::Ur3e, &UrModel::Ur3e.calibrated_chain(&delta).unwrap(), true);
    seven_joints();
}

fn report(name: &str, model: UrModel, chain: &SerialChain<6>, singular: bool) {
    let arm = UrSolver::new(chain.clone(), model).unwrap();
    let track = |t: &Pose, q: &JointVector| chain.solve_near(t, q, &IkOptions::default());
    let hybrid = |t: &Pose, q: &JointVector| arm.solve_near(t, q, &IkOptions::default());
    let near =
        sets::near(chain, 2000, &mut sets::stream(41), |rng| sets::configuration(chain, rng));
    row(name, "seed 1-5 mm", chain, &near, track);
    row(name, "seed 1-5 mm, hybrid", chain, &near, hybrid);
    for kind in SINGULARITIES.into_iter().filter(|_| singular) {
        let all: Vec<Case> = DISTANCES
            .into_iter()
            .flat_map(|d| {
                sets::near(chain, 200, &mut sets::stream(42), |rng| sets::singular(kind, d, rng))
            })
            .collect();
        row(name, &format!("{kind:?} 0.1 ... 0"), chain, &all, track);
    }
    let far = sets::random(chain, 2000, &mut sets::stream(43));
    row(name, "far seed, LM alone", chain, &far, track);
    row(name, "far seed, hybrid", chain, &far, hybrid);
}

fn row(
    name: &str,
    set: &str,
    chain: &SerialChain<6>,
    cases: &[Case],
    solve: impl Fn(&Pose, &JointVector) -> Result<IkSolution<6>, IkError>,
) {
    let (mut times, mut ok, mut max_step) = (Vec::new(), 0, 0.0f64);
    for case in cases {
        let target = chain.forward(&case.goal);
        let start = Instant::now();
        let solution = std::hint::black_box(solve(&target, &case.seed));
        times.push(start.elapsed().as_secs_f64() * 1e6);
        let good = solution.ok().filter(|s| sets::reaches(chain, &s.q, &target));
        ok += usize::from(good.is_some());
        max_step = max_step.max(good.map_or(0.0, |s| s.max_step));
    }
    let share = 100.0 * ok as f64 / cases.len() as f64;
    print_row(name, set, share, max_step, times);
}

fn print_row(name: &str, set: &str, share: f64, max_step: f64, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    let (p50, p99, max) = (at(0.5), at(0.99), at(1.0));
    let count = times.len();
    println!(
        "{name:<23} {set:<20} {count:>6} {share:>8.2} {max_step:>9.4} {p50:>7.2} {p99:>7.2} {max:>7.1}"
    );
}

/// A redundant chain with everything odd, by the same call.
fn seven_joints() {
    let (chain, rng) = (sets::odd_arm(), &mut sets::stream(44));
    let (mut times, mut ok, mut max_step) = (Vec::new(), 0, 0.0f64);
    for _ in 0..2000 {
        let goal = sets::configuration(&chain, rng) * 0.9;
        let seed = goal + sets::configuration(&chain, rng) * 2e-3;
        let target = chain.forward(&goal);
        let start = Instant::now();
        let solution =
            std::hint::black_box(chain.solve_near(&target, &seed, &IkOptions::default()));
        times.push(start.elapsed().as_secs_f64() * 1e6);
        let Ok(solution) = solution else { continue };
        let (position, rotation) = sets::apart(&chain.forward(&solution.q), &target);
        ok += usize::from(position <= 1e-6 && rotation <= 1e-6);
        max_step = max_step.max(solution.max_step);
    }
    print_row(
        "7 joints, all odd",
        "seed near",
        100.0 * f64::from(ok as u32) / 2000.0,
        max_step,
        times,
    );
}
