//! Following and catching up, braking and force stops, and what is written down.

use palpate_kinematics::{Frame, IkOptions};
use palpate_robot_io::RobotState;
use palpate_spatial::{DOF, JointVector, Pose, Twist, UnitQuaternion, Vector3, Wrench};

use super::*;

const DT: f64 = 0.002;

fn home() -> JointVector {
    [0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians).into()
}

/// The preset's limits: 25 N, 60 N in a reset, 75 % of both aimed at, 10 N/mm, 30 ms.
fn shield() -> Shield {
    let text = include_str!("../../../../../assets/presets/palpate.toml");
    let mut table: toml::Table = toml::from_str(text).unwrap();
    let safety: SafetyConfig = table.remove("safety").unwrap().try_into().unwrap();
    let urdf = include_str!("../../../../../assets/robots/ur3e.urdf");
    let tool = Pose::from_parts(Vector3::new(0.0, 0.0, 0.15).into(), UnitQuaternion::identity());
    let chain = SerialChain::from_urdf_str(urdf, "base_link", "tool0").unwrap();
    let mut shield = Shield::new(&safety, chain.with_tool(tool), &tool, DT).unwrap();
    shield.begin_episode();
    shield
}

/// A sample of an arm that is where it was sent.
fn sample(shield: &Shield, force: Vector3) -> Measurement {
    let q = shield.motion().map_or(home(), |m| m.q);
    let wrench = Wrench::new(force, Vector3::zeros());
    let state =
        RobotState { time: 0.0, q, dq: JointVector::zeros(), q_target: q, sensor_wrench: wrench };
    let base_T_tool = shield.chain.forward(&q);
    Measurement { state, base_T_tool, tool_twist: Twist::zero(), wrench, raw_wrench: wrench }
}

/// Upwards at 60 mm/s.
fn moving() -> Shield {
    let mut shield = shield();
    let mut pose = shield.chain.forward(&home());
    for _ in 0..60 {
        pose.translation.z += 0.06 * DT;
        let m = sample(&shield, Vector3::zeros());
        pose = shield.tick(&m, &Proposal::Pose(pose)).governed.unwrap_or(pose);
    }
    shield
}

#[test]
fn the_approach_aims_below_the_limit_of_its_phase() {
    let mut shield = shield();
    let m = sample(&shield, Vector3::zeros());
    let _ = shield.tick(&m, &Proposal::Rest);
    // 0.75 · F / (k · t) at rest in free air; with 5 N against it, 5 N less.
    for (resets, limit) in [(false, 25.0), (true, 60.0)] {
        if resets {
            shield.begin_reset();
        } else {
            shield.begin_episode();
        }
        let free = shield.bounds(&sample(&shield, Vector3::zeros()));
        let pressed = shield.bounds(&sample(&shield, Vector3::z() * 5.0));
        assert!((free.lower.z + 0.75 * limit / 300.0).abs() < 1e-12, "{free:?}");
        assert!((pressed.lower.z + (0.75 * limit - 5.0) / 300.0).abs() < 1e-12, "{pressed:?}");
    }
}

/// The time that the brake still takes counts down while it brakes, and half of it counts as reaction.
#[test]
fn a_brake_under_way_leaves_less_and_less_time_to_count() {
    let mut shield = moving();
    let mut ticks = 0;
    loop {
        let (mut rest, mut left) = (*shield.motion().unwrap(), 0.0);
        while !rest.is_at_rest() {
            rest = rest.braked(&shield.verifier.brakes, DT);
            left += DT;
        }
        assert!((shield.stopping_time - left).abs() <= DT + 1e-12, "tick {ticks}: {left}");
        let m = sample(&shield, Vector3::zeros());
        let bound = 0.75 * 25.0 / (1.0e4 * (0.03 + 0.5 * shield.stopping_time));
        assert!((shield.bounds(&m).upper.z - bound).abs() < 1e-12);
        let standing = if left == 0.0 { Standing::AtRest } else { Standing::Moving };
        assert_eq!(shield.standing(), standing);
        if left == 0.0 {
            break;
        }
        let _ = shield.tick(&m, &Proposal::Rest);
        ticks += 1;
    }
    assert!(ticks >= 10, "{ticks}");
    for _ in 0..3 {
        let m = sample(&shield, Vector3::zeros());
        let _ = shield.tick(&m, &Proposal::Rest);
    }
    assert_eq!(shield.stopping_time, 0.0);
}

/// What would exceed the limit is taken off, by the joints that move that axis most for their strength; half of what
/// is kept back for the unforeseen may be used first.
#[test]
fn an_approach_that_is_too_fast_is_slowed_before_anything_else() {
    let shield = moving();
    let here = *shield.motion().unwrap();
    let allowed =
        |force: f64| (0.875 * 25.0 - force) / (1.0e4 * (0.03 + 0.5 * shield.stopping_time));
    let up = |speed: &JointVector| shield.tool_velocity(speed).z;
    // Downwards force against it, more and more.
    let mut slowed = 0;
    for force in 0..21 {
        let force = f64::from(force);
        let said = shield.limit_approach(&sample(&shield, Vector3::z() * -force), &here);
        if up(&here.v) <= allowed(force) {
            assert_eq!(said, None, "{force}");
            continue;
        }
        let said = said.unwrap();
        slowed += 1;
        assert!((up(&said) - allowed(force)).abs() < 1e-9, "{force}");
        let J = shield.chain.kinematics(&here.q).jacobian(Frame::BaseAligned);
        let cheapest: JointVector =
            J.row(2).transpose().component_mul(&shield.verifier.acceleration);
        let change = said - here.v;
        assert!((change.dot(&cheapest).abs() - change.norm() * cheapest.norm()).abs() < 1e-9);
        // Force that pulls where it goes anyway is no reason.
        assert_eq!(shield.limit_approach(&sample(&shield, Vector3::z() * force), &here), None);
    }
    assert!((5..20).contains(&slowed), "{slowed}");
    // Beyond the limit it is to stand still.
    let said = shield.limit_approach(&sample(&shield, Vector3::z() * -30.0), &here).unwrap();
    assert!(up(&said).abs() < 1e-12);
}

#[test]
fn the_tools_velocity_is_the_difference_of_its_places() {
    let shield = moving();
    let step = 1e-6;
    for joint in 0..DOF {
        let speed = JointVector::from_fn(|i, _| if i == joint { 0.7 } else { 0.1 });
        let place = |t: f64| shield.chain.forward(&(shield.target + speed * t)).translation;
        let difference = (place(step).vector - place(-step).vector) / (2.0 * step);
        let said = shield.tool_velocity(&speed);
        assert!((said - difference).norm() < 1e-8, "{said} {difference}");
    }
}

/// Negative beyond the limit, whichever way the force points.
#[test]
fn the_ledger_shows_how_far_the_force_is_from_its_limit() {
    for force in [-26.0, 26.0] {
        let mut shield = moving();
        let m = sample(&shield, Vector3::x() * force);
        for _ in 0..2 {
            let _ = shield.tick(&m, &Proposal::Rest);
        }
        assert!(shield.is_stopped());
        let _ = shield.tick(&sample(&shield, Vector3::zeros()), &Proposal::Rest);
        for cause in [Cause::ForceSoft, Cause::Stopped] {
            let entry = shield.ledger().entries().find(|e| e.cause == cause).unwrap();
            assert!((entry.distance + 1.0).abs() < 1e-12, "{cause:?}: {}", entry.distance);
        }
    }
}

#[test]
fn the_ledger_shows_how_much_force_was_left_where_that_slowed() {
    let mut shield = shield();
    for tick in 0..=300 {
        let m = sample(&shield, Vector3::z() * (0.05 * f64::from(tick)));
        let _ = shield.tick(&m, &Proposal::Rest);
    }
    // Down at 0.05 m/s against 15 N.
    let mut down = shield.target_pose();
    down.translation.z -= 1e-4;
    let decision = shield.tick(&sample(&shield, Vector3::z() * 15.0), &Proposal::Pose(down));
    assert_eq!(decision.cause, Some(Cause::SlowedByForce), "{decision:?}");
    let entry = shield.ledger().entries().last().unwrap();
    assert!((entry.distance - 10.0).abs() < 1e-9, "{entry:?}");
}

/// What lags behind is made up for, but not at more speed than the force that is left allows.
#[test]
fn catching_up_counts_as_approach() {
    let mut shield = shield();
    shield.begin_reset();
    let mut goal = shield.chain.forward(&home());
    goal.translation.vector += Vector3::new(0.0, 0.05, -0.02);
    let q = shield.chain.solve_near(&goal, &home(), &IkOptions::default()).unwrap().q;
    let (mut nearest, mut behind, mut ticks) = (0.0f64, 0.0f64, 0);
    // 0.25 m/s, more than the bounds allow, and then a wait at the end of the path.
    while shield.motion().is_none_or(|m| (m.q - q).amax() > 1e-9) {
        let path = home() + (q - home()) * (f64::from(ticks) / 100.0).min(1.0);
        let m = sample(&shield, Vector3::zeros());
        let allowed = 0.75 * 60.0 / (1.0e4 * (0.03 + 0.5 * shield.stopping_time));
        assert_eq!(shield.tick(&m, &Proposal::Joints(path)).verdict, Verdict::Accepted);
        let here = shield.motion().unwrap();
        let J = shield.chain.kinematics(&here.q).jacobian(Frame::BaseAligned);
        nearest = nearest.max((J * here.v).fixed_rows::<3>(0).amax() / allowed);
        behind = behind.max((shield.target - here.q).amax());
        ticks += 1;
        assert!(ticks < 500, "it never gets there");
    }
    assert!(behind > 0.005, "{behind} rad: there was something to make up for");
    assert!(nearest > 0.9 && nearest < 1.03, "{nearest} of the speed that is allowed");
}

/// The last joint turns about the tool's axis: nothing but its own limits holds it back.
#[test]
fn catching_up_ends_at_full_speed() {
    let mut shield = shield();
    let full = shield.verifier.velocity[5];
    let (mut fastest, mut behind) = (0.0f64, 0.0f64);
    for tick in 0..400 {
        let mut path = if tick == 0 { home() } else { shield.target };
        path[5] += full * DT;
        let m = sample(&shield, Vector3::zeros());
        let decision = shield.tick(&m, &Proposal::Joints(path));
        assert_eq!(decision.verdict, Verdict::Accepted, "tick {tick}");
        fastest = fastest.max(shield.motion().unwrap().v[5] / full);
        behind = behind.max(shield.target[5] - shield.motion().unwrap().q[5]);
    }
    assert!(behind > 0.01, "{behind} rad: there was something to make up for");
    assert!(fastest > 1.0 - 1e-9 && fastest < 1.0 + 1e-9, "{fastest} of full speed");
}

/// The tool is mounted on the flange, and so is its capsule.
#[test]
fn the_tools_capsule_moves_with_the_flange() {
    let urdf = include_str!("../../../../../assets/robots/ur3e.urdf");
    let arm = SerialChain::<DOF>::from_urdf_str(urdf, "base_link", "tool0").unwrap();
    let shield = shield();
    let tool = shield.config.tool;
    for turn in [-0.9, 0.0, 0.4, 1.3] {
        let q = home().map(|x| 0.8 * x + turn);
        let base_T_tool0 = arm.forward(&q);
        let capsules = shield.geometry().capsules(&shield.chain, &q);
        let (ends, radius) = capsules[capsules.len() - 1];
        assert_eq!(radius, tool.radius);
        for (end, flange) in ends.iter().zip([tool.from, tool.to]) {
            let expected = base_T_tool0 * nalgebra::Point3::from(flange);
            assert!((end - expected.coords).norm() < 1e-9, "{end} {expected}");
        }
    }
}

/// A person moved the arm and saw to the sensor: nothing from before counts.
#[test]
fn a_restart_begins_at_rest_where_the_arm_is_then() {
    let mut shield = moving();
    let pressed = sample(&shield, Vector3::x() * 26.0);
    for _ in 0..2 {
        let _ = shield.tick(&pressed, &Proposal::Rest);
    }
    for _ in 0..shield.config.sensor.bad_samples_max {
        let stale = shield.watch(&pressed.state);
        assert!(stale.is_err() || shield.bad_samples == 0);
    }
    let _ = shield.watch(&pressed.state);
    assert!(shield.is_stopped() && shield.is_blind() && !shield.is_armed());
    assert_eq!(shield.standing(), Standing::Moving);
    shield.restart();
    assert!(!shield.is_stopped() && !shield.is_blind() && shield.is_armed());
    assert_eq!((shield.standing(), shield.motion()), (Standing::AtRest, None));
    assert_eq!(shield.watch(&pressed.state), Ok(()), "the first sample has no predecessor");
    let mut m = sample(&shield, Vector3::zeros());
    m.state.q = home().map(|x| x + 0.01);
    m.state.q_target = m.state.q;
    let decision = shield.tick(&m, &Proposal::Rest);
    assert_eq!((decision.verdict, decision.executed), (Verdict::Accepted, m.state.q));
}
