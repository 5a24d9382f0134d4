//! Success on thousands of poses: tracking, singularities, far seeds; nominal and calibrated arms.
//!
//! The example `ik_report` prints the same sets with timings.
#![expect(clippy::unwrap_used, reason = "our own arms load")]

mod sets;

use palpate_kinematics::{IkOptions, SerialChain, UrModel};
use sets::{CALIBRATIONS, Case, DISTANCES, SINGULARITIES};

/// Every case must be solved within 0.05 rad of its seed.
fn tracks(chain: &SerialChain<6>, cases: &[Case], what: &str) {
    for case in cases {
        let target = chain.forward(&case.goal);
        let solution = chain.solve_near(&target, &case.seed, &IkOptions::default());
        let solution = solution.unwrap_or_else(|e| panic!("{what}: {e}\n{case:?}"));
        assert!(sets::reaches(chain, &solution.q, &target), "{what}: {case:?}");
        assert!(
            (solution.q - case.seed).amax() <= 0.05,
            "{what}: stepped {} rad\n{case:?}",
            solution.max_step
        );
    }
}

fn arms() -> Vec<(String, SerialChain<6>)> {
    let rng = &mut sets::stream(40);
    let calibrated =
        CALIBRATIONS.map(|c| (format!("{c:?}"), sets::calibrated(UrModel::Ur3e, c, rng)));
    let delta = sets::delta_dh(UrModel::Ur3e, CALIBRATIONS[2], rng);
    let by_delta = ("delta DH".into(), UrModel::Ur3e.calibrated_chain(&delta).unwrap());
    std::iter::once(("nominal".into(), sets::ur(UrModel::Ur3e)))
        .chain(calibrated)
        .chain([by_delta])
        .collect()
}

#[test]
fn a_seed_millimetres_away_always_leads_there() {
    for (name, chain) in arms().into_iter().chain(large_arms().map(|(_, arm)| arm)) {
        let rng = &mut sets::stream(41);
        let cases = sets::near(&chain, 2000, rng, |rng| sets::configuration(&chain, rng));
        tracks(&chain, &cases, &name);
    }
}

/// UR5e and UR10e, nominal and as far off as the worst calibration.
fn large_arms() -> impl Iterator<Item = (UrModel, (String, SerialChain<6>))> {
    [UrModel::Ur5e, UrModel::Ur10e].into_iter().flat_map(|model| {
        let off = sets::calibrated(model, CALIBRATIONS[2], &mut sets::stream(45));
        [
            (model, (format!("nominal {}", model.name()), sets::ur(model))),
            (model, (format!("calibrated {}", model.name()), off)),
        ]
    })
}

#[test]
fn also_at_every_singularity() {
    let small = arms().into_iter().map(|arm| (UrModel::Ur3e, arm));
    for (model, (name, chain)) in small.chain(large_arms()) {
        for kind in SINGULARITIES {
            for distance in DISTANCES {
                let rng = &mut sets::stream(42);
                let cases = sets::near(&chain, 200, rng, |rng| {
                    sets::singular_of(model, kind, distance, rng)
                });
                tracks(&chain, &cases, &format!("{name}, {kind:?} at {distance:.0e}"));
            }
        }
    }
}

/// A calibrated arm is singular a little beside its nominal one.
#[test]
fn also_where_the_calibrated_arm_itself_is_singular() {
    let small = arms().into_iter().skip(1).map(|arm| (UrModel::Ur3e, arm));
    for (model, (name, chain)) in small.chain(large_arms()) {
        for kind in SINGULARITIES {
            for distance in DISTANCES {
                let rng = &mut sets::stream(46);
                let cases = sets::near(&chain, 100, rng, |rng| {
                    sets::singular_itself(&chain, model, kind, distance, rng)
                });
                tracks(&chain, &cases, &format!("{name}, {kind:?} itself at {distance:.0e}"));
            }
        }
    }
}

/// Share of far seeds from which the hybrid solver gets there.
fn solved(chain: &SerialChain<6>, model: UrModel) -> f64 {
    let arm = palpate_kinematics::UrSolver::new(chain.clone(), model).unwrap();
    let rng = &mut sets::stream(43);
    let cases = sets::random(chain, 2000, rng);
    let ok = cases.iter().filter(|case| {
        let target = chain.forward(&case.goal);
        let solution = arm.solve_near(&target, &case.seed, &IkOptions::default());
        solution.is_ok_and(|s| sets::reaches(chain, &s.q, &target))
    });
    ok.count() as f64 / cases.len() as f64
}

#[test]
fn far_seeds_always_lead_there_on_a_nominal_arm() {
    for model in UrModel::ALL {
        assert_eq!(solved(&sets::ur(model), model), 1.0, "{model:?}");
    }
}

#[test]
fn far_seeds_lead_there_on_a_calibrated_arm() {
    let small = arms().into_iter().skip(1).map(|arm| (UrModel::Ur3e, arm));
    let large = large_arms().filter(|(_, (name, _))| name.starts_with("calibrated"));
    for (model, (name, chain)) in small.chain(large) {
        let share = solved(&chain, model);
        assert!(share >= 0.97, "{name}: {share}");
    }
}

#[test]
fn the_closed_form_is_what_makes_far_seeds_work() {
    let chain = sets::ur(UrModel::Ur3e);
    let cases = sets::random(&chain, 2000, &mut sets::stream(43));
    let alone = |c: &&Case| {
        chain.solve_near(&chain.forward(&c.goal), &c.seed, &IkOptions::default()).is_ok()
    };
    let share = cases.iter().filter(alone).count() as f64 / cases.len() as f64;
    assert!((0.3..0.9).contains(&share), "{share}");
}
