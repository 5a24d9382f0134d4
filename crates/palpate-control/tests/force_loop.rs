//! The limit of the sampled loop against the loop itself: spring, filter, law, set-point and servo, tick by tick.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use palpate_control::{
    ActionPlacement, AdmittanceGains, AdmittanceOutput, ControlConfig, ControlInput, Controller,
    DerivativeRule, ForceController, ForceLoop, Gains, Law, LowPass, ParallelGains,
};
use palpate_spatial::{Twist, Vector6, Wrench};
use support::*;

/// Energy of the last third of a swing by that of the middle third.
fn growth(
    force_loop: &ForceLoop,
    control: &ControlConfig,
    gains: &Gains,
    axis: usize,
    k: f64,
) -> f64 {
    let law = match gains {
        Gains::Parallel(_) => Law::Parallel,
        Gains::Admittance(_) => Law::Admittance,
    };
    let mut law = Controller::new(control, law).unwrap();
    law.set_gains(gains).unwrap();
    let dt = force_loop.period;
    let mut filter = LowPass::new(force_loop.cutoff, 1.0 / dt);
    let follow = 1.0 - (-dt / force_loop.servo_lag).exp();
    let along = |x: f64| Vector6::from_fn(|j, _| if j == axis { x } else { 0.0 });
    // 1 nm and 1 nrad: no bound acts, and sin(θ/2) is θ/2.
    let (mut set_point, mut pose) = (1e-9, 1e-9);
    let mut energy = [0.0; 3];
    for part in &mut energy {
        for _ in 0..6000 {
            let wrench = filter.update(&Wrench::from(along(-k * pose)));
            let error = -pose * if axis < 3 { 1.0 } else { 0.5 };
            let input = ControlInput { pose_error: along(error), wrench, action: Twist::zero() };
            if force_loop.rebased {
                set_point = pose;
            }
            set_point += law.update(&input, dt).vector()[axis] * dt;
            pose += (set_point - pose) * follow;
            *part += pose * pose;
            if pose.is_nan() || pose.abs() > 1e-5 {
                return f64::INFINITY;
            }
        }
    }
    energy[2] / energy[1]
}

/// ±0.5 %.
fn is_the_limit(force_loop: &ForceLoop, control: &ControlConfig, gains: &Gains, axis: usize) {
    let limit = force_loop.contact_limit(control, gains, axis);
    let [below, above] =
        [0.995, 1.005].map(|part| growth(force_loop, control, gains, axis, part * limit));
    assert!(
        below < 0.99 && above > 1.01,
        "{force_loop:?}\n{gains:?}\naxis {axis}: {limit} N/m, {below} and {above} at ±0.5 %"
    );
}

const LAGS: [f64; 3] = [0.0, 0.010, 0.030];
const CUTOFFS: [f64; 4] = [2.5, 10.0, 50.0, 200.0];

#[test]
fn of_the_parallel_law() {
    for servo_lag in LAGS {
        for cutoff in CUTOFFS {
            let force_loop = ForceLoop { cutoff, servo_lag, rebased: false, period: DT };
            for (kp, kf, s) in [(1.0, 9e-3, 0.1), (5.0, 5e-3, 0.5), (9.0, 1e-3, 0.9)] {
                for axis in [2, 4] {
                    is_the_limit(&force_loop, &control(), &parallel_gains(kp, kf, s), axis);
                }
            }
        }
    }
}

#[test]
fn of_the_admittance_law_in_both_outputs() {
    for output in [AdmittanceOutput::Velocity, AdmittanceOutput::Displacement] {
        for damping_ratio in [0.5, 1.0, 3.0] {
            let mut control = control();
            control.admittance.output = output;
            control.admittance.damping_ratio = damping_ratio;
            for servo_lag in LAGS {
                for cutoff in CUTOFFS {
                    let force_loop = ForceLoop { cutoff, servo_lag, rebased: false, period: DT };
                    for kd in [100.0, 500.0] {
                        for axis in [0, 5] {
                            is_the_limit(&force_loop, &control, &admittance_gains(1.0, kd), axis);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn of_derivatives_and_strong_integrals() {
    let force_loop = ForceLoop { cutoff: 50.0, servo_lag: 0.010, rebased: false, period: DT };
    for rule in [DerivativeRule::Critical, DerivativeRule::Tenth, DerivativeRule::RootTimesBase] {
        for placement in [ActionPlacement::OutsideSelection, ActionPlacement::InsideSelection] {
            let mut control = control();
            control.parallel.derivative_rule = rule;
            control.parallel.action_placement = placement;
            control.parallel.integral_ratio = 2.0;
            control.admittance.derivative_rule = rule;
            for axis in [1, 3] {
                is_the_limit(&force_loop, &control, &parallel_gains(2.0, 5e-3, 0.3), axis);
                is_the_limit(&force_loop, &control, &admittance_gains(0.1, 300.0), axis);
            }
        }
    }
}

#[test]
fn of_commands_that_start_from_the_measured_pose() {
    for servo_lag in LAGS {
        for cutoff in CUTOFFS {
            let force_loop = ForceLoop { cutoff, servo_lag, rebased: true, period: DT };
            for axis in [2, 4] {
                is_the_limit(&force_loop, &control(), &parallel_gains(1.0, 9e-3, 0.1), axis);
                is_the_limit(&force_loop, &control(), &admittance_gains(1.0, 300.0), axis);
            }
        }
    }
}

#[test]
fn every_axis_has_its_own_gains() {
    let force_loop = ForceLoop { cutoff: 50.0, servo_lag: 0.010, rebased: false, period: DT };
    let ramp = Vector6::from_fn(|j, _| 1.0 + j as f64);
    let parallel =
        Gains::Parallel(ParallelGains { kp_x: ramp, kp_f: ramp * 1e-3, selection: ramp * 0.1 });
    let admittance = Gains::Admittance(AdmittanceGains { kp_x: ramp, stiffness: ramp * 100.0 });
    for axis in 0..6 {
        is_the_limit(&force_loop, &control(), &parallel, axis);
        is_the_limit(&force_loop, &control(), &admittance, axis);
    }
}

#[test]
fn without_lag_and_with_short_ticks_it_is_the_closed_form() {
    let control = control();
    for cutoff in [2.5, 50.0] {
        let force_loop = ForceLoop { cutoff, servo_lag: 0.0, rebased: false, period: 1e-6 };
        let limit = force_loop.contact_limit(&control, &parallel_gains(1.0, 9e-3, 0.1), 0);
        let closed = control.parallel.contact_limit(1.0, 9e-3, 0.1, cutoff);
        assert!((limit / closed - 1.0).abs() < 2e-3, "{limit} for {closed}");
        let limit = force_loop.contact_limit(&control, &admittance_gains(0.0, 100.0), 0);
        let closed = control.admittance.contact_limit(100.0, cutoff);
        assert!((limit / closed - 1.0).abs() < 2e-3, "{limit} for {closed}");
    }
}

#[test]
fn a_law_that_does_not_hear_the_force_has_no_limit() {
    let force_loop = ForceLoop { cutoff: 50.0, servo_lag: 0.010, rebased: false, period: DT };
    for gains in [parallel_gains(1.0, 5e-3, 1.0), parallel_gains(1.0, 0.0, 0.5)] {
        assert_eq!(force_loop.contact_limit(&control(), &gains, 0), f64::INFINITY);
    }
}
