//! Laws, gains and inputs shared by the integration tests.
#![expect(dead_code, unreachable_pub, reason = "every user takes what it needs")]
#![expect(clippy::unwrap_used, reason = "our own files load")]

use palpate_control::{
    ActionPlacement, AdmittanceConfig, AdmittanceGains, AdmittanceOutput, ControlConfig,
    ControlInput, DerivativeRule, Gains, Law, ParallelConfig, ParallelGains, PolicyModel,
};
use palpate_spatial::{Twist, Vector6, Wrench};
use proptest::prelude::*;

/// The period of the control loop, s.
pub const DT: f64 = 0.002;

/// Table I of the paper: model, actions.
pub const MODELS: [(&str, usize); 8] = [
    ("p-9", 9),
    ("p-14", 14),
    ("p-19", 19),
    ("p-24", 24),
    ("a-8", 8),
    ("a-13", 13),
    ("a-13pd", 13),
    ("a-18", 18),
];

pub const RULES: [DerivativeRule; 4] = [
    DerivativeRule::None,
    DerivativeRule::Critical,
    DerivativeRule::Tenth,
    DerivativeRule::RootTimesBase,
];

/// The laws of the default preset.
pub fn control() -> ControlConfig {
    toml::from_str(include_str!("../data/control.toml")).unwrap()
}

/// A model of `assets/policies/`.
pub fn model(name: &str) -> PolicyModel {
    let path = format!("{}/../../assets/policies/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Eq. 1 as printed, K_i^f = 0.
pub fn proportional() -> ParallelConfig {
    ParallelConfig {
        action_placement: ActionPlacement::OutsideSelection,
        derivative_rule: DerivativeRule::None,
        integral_ratio: 0.0,
        integral_limit: 1.0,
    }
}

pub fn admittance(inertia: f64, damping_ratio: f64, output: AdmittanceOutput) -> AdmittanceConfig {
    AdmittanceConfig { inertia, damping_ratio, derivative_rule: DerivativeRule::None, output }
}

/// The same gains on all axes.
pub fn parallel_gains(kp_x: f64, kp_f: f64, selection: f64) -> Gains {
    Gains::Parallel(ParallelGains {
        kp_x: Vector6::repeat(kp_x),
        kp_f: Vector6::repeat(kp_f),
        selection: Vector6::repeat(selection),
    })
}

/// The same gains on all axes.
pub fn admittance_gains(kp_x: f64, stiffness: f64) -> Gains {
    Gains::Admittance(AdmittanceGains {
        kp_x: Vector6::repeat(kp_x),
        stiffness: Vector6::repeat(stiffness),
    })
}

/// The same numbers on all axes.
pub fn input(error: f64, force: f64, action: f64) -> ControlInput {
    ControlInput {
        pose_error: Vector6::repeat(error),
        wrench: Wrench::from(Vector6::repeat(force)),
        action: Twist::from(Vector6::repeat(action)),
    }
}

/// At the goal, in free air, no motion asked for.
pub fn nothing() -> ControlInput {
    input(0.0, 0.0, 0.0)
}

/// A six-vector with components in ±`bound`.
pub fn vector(bound: f64) -> impl Strategy<Value = Vector6> {
    proptest::array::uniform6(-bound..bound).prop_map(Vector6::from)
}

/// A six-vector with components in `low`..`high`.
fn between(low: f64, high: f64) -> impl Strategy<Value = Vector6> {
    proptest::array::uniform6(low..high).prop_map(Vector6::from)
}

/// Errors of ±5 cm, forces of ±50 N, motions of ±0.1 m/s.
pub fn any_input() -> impl Strategy<Value = ControlInput> {
    (vector(0.05), vector(50.0), vector(0.1)).prop_map(|(pose_error, wrench, action)| {
        ControlInput { pose_error, wrench: wrench.into(), action: action.into() }
    })
}

pub fn any_parallel_gains() -> impl Strategy<Value = ParallelGains> {
    (between(0.0, 60.0), between(0.0, 0.5), between(0.0, 1.0))
        .prop_map(|(kp_x, kp_f, selection)| ParallelGains { kp_x, kp_f, selection })
}

pub fn any_admittance_gains() -> impl Strategy<Value = AdmittanceGains> {
    (between(0.0, 60.0), between(1.0, 1e4))
        .prop_map(|(kp_x, stiffness)| AdmittanceGains { kp_x, stiffness })
}

/// Gains of either law.
pub fn any_gains(law: Law) -> BoxedStrategy<Gains> {
    match law {
        Law::Parallel => any_parallel_gains().prop_map(Gains::Parallel).boxed(),
        Law::Admittance => any_admittance_gains().prop_map(Gains::Admittance).boxed(),
    }
}

pub fn any_rule() -> impl Strategy<Value = DerivativeRule> {
    proptest::sample::select(&RULES[..])
}

pub fn any_placement() -> impl Strategy<Value = ActionPlacement> {
    prop_oneof![Just(ActionPlacement::OutsideSelection), Just(ActionPlacement::InsideSelection)]
}

pub fn any_output() -> impl Strategy<Value = AdmittanceOutput> {
    prop_oneof![Just(AdmittanceOutput::Velocity), Just(AdmittanceOutput::Displacement)]
}
