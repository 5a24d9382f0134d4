//! The question behind every accepted step: can the arm still brake legally after it?
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::SerialChain;
use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;
use super::geometry::{Clearance, Geometry};
use super::motion::Motion;
use crate::Refusal;

/// The arm settles this far inside its walls, m. The joints of the verified brake do not go in step, so a brake swerves a little;
/// without room for that an arm at a wall could not even leave it.
pub(crate) const GUARD: f64 = 5e-5;

/// Rounding of speeds that are at their limit by construction.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Limits on motion and place.
#[derive(Clone, Debug)]
pub(crate) struct Verifier {
    pub(crate) dt: f64,
    pub(crate) brakes: [Brake; DOF],
    pub(crate) lower: JointVector,
    pub(crate) upper: JointVector,
    pub(crate) velocity: JointVector,
    pub(crate) acceleration: JointVector,
    pub(crate) jerk: JointVector,
    pub(crate) geometry: Geometry,
}

/// What a legal step leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Verified {
    /// Clearance at its end, m.
    pub(crate) clearance: f64,
    /// Time until the brake has stopped every joint, s.
    pub(crate) stopping_time: f64,
}

impl Verifier {
    /// Whether the step itself is within the limits of speed, acceleration and jerk.
    pub(crate) fn step_is_legal(&self, from: &Motion, to: &Motion) -> bool {
        (0..DOF).all(|i| {
            to.v[i].abs() <= self.velocity[i]
                && to.a[i].abs() <= self.acceleration[i]
                && (to.a[i] - from.a[i]).abs() <= self.jerk[i] * self.dt
        })
    }

    /// Whether `to` and the whole brake from there keep to joint ranges and speeds and out of every
    /// obstacle.
    ///
    /// `clearance` is what the arm has now. One that is outside already (a start outside the box) may move as
    /// long as it comes no nearer.
    pub(crate) fn brake_is_legal(
        &self,
        chain: &SerialChain<DOF>,
        from: &Motion,
        to: &Motion,
        clearance: f64,
    ) -> Result<Verified, Refusal> {
        let mut sweep = JointVector::zeros();
        let mut ticks: f64 = 0.0;
        for joint in 0..DOF {
            let (v, q) = (to.v[joint], to.q[joint]);
            let stop = self.brakes[joint].stop(v, to.a[joint]);
            let (speed, limit) = (v.abs().max(stop.run_out.abs()), self.velocity[joint]);
            if !(speed <= limit * ROUNDING && stop.run_out.is_finite()) {
                return Err(Refusal::JointSpeed { joint, speed, limit });
            }
            let lower = self.lower[joint].min(from.q[joint]);
            let upper = self.upper[joint].max(from.q[joint]);
            for value in [q + stop.lowest, q + stop.highest] {
                if !(value >= lower && value <= upper) {
                    return Err(Refusal::JointRange { joint, value, lower, upper });
                }
            }
            sweep[joint] = stop.sweep;
            ticks = ticks.max(stop.ticks);
        }
        let look = |q: &JointVector| self.geometry.clearance(chain, q);
        let clearance = self.way_is_clear(look, to, &sweep, clearance)?.distance;
        Ok(Verified { clearance, stopping_time: ticks * self.dt })
    }

    /// Conservative advancement along the brake: as long as no point can have moved farther than the last
    /// measured clearance, nothing needs to be measured with `look`.
    fn way_is_clear(
        &self,
        mut look: impl FnMut(&JointVector) -> Clearance,
        to: &Motion,
        sweep: &JointVector,
        clearance: f64,
    ) -> Result<Clearance, Refusal> {
        let mut at = |q: &JointVector, floor: f64| {
            let clearance = look(q);
            let Clearance { distance, obstacle } = clearance;
            if distance >= floor {
                Ok(clearance)
            } else {
                Err(Refusal::Obstacle { obstacle, distance })
            }
        };
        // The step ends a guard's width inside, or no farther outside than it began; the brake may use the guard.
        let here = at(&to.q, clearance.clamp(0.0, GUARD).min(clearance))?;
        let floor = clearance.min(0.0);
        let mut left = here.distance - floor;
        if self.geometry.travel(sweep) <= left {
            return Ok(here);
        }
        let mut motion = *to;
        while !motion.is_at_rest() {
            motion = motion.braked(&self.brakes, self.dt);
            left -= self.geometry.travel(&(motion.v.abs() * self.dt));
            if !(left >= 0.0) {
                let clearance = at(&motion.q, floor)?;
                left = clearance.distance - floor;
                if self.geometry.travel(&self.sweep(&motion)) <= left {
                    break;
                }
            }
        }
        Ok(here)
    }

    fn sweep(&self, motion: &Motion) -> JointVector {
        JointVector::from_fn(|i, _| self.brakes[i].stop(motion.v[i], motion.a[i]).sweep)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shield::{ArmShape, Obstacle, Workspace};
    use palpate_spatial::Vector3;
    use proptest::prelude::*;

    const DT: f64 = 0.002;
    const SPEED: f64 = 2.0;
    const ACCELERATION: f64 = 10.0;
    /// Changes the acceleration by 1 rad/s² per tick.
    const JERK: f64 = 500.0;

    fn chain() -> SerialChain<DOF> {
        let urdf = include_str!("../../../../assets/robots/ur3e.urdf");
        SerialChain::from_urdf_str(urdf, "base_link", "tool0").unwrap()
    }

    fn home() -> JointVector {
        [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into()
    }

    /// Of an arm that is nothing but its tip, in a box.
    fn verifier(chain: &SerialChain<DOF>, workspace: Workspace) -> Verifier {
        let shape = ArmShape { source: String::new(), capsules: vec![], pairs: vec![] };
        let all = JointVector::from_element;
        Verifier {
            dt: DT,
            brakes: [Brake::new(ACCELERATION, JERK, DT); DOF],
            lower: all(-3.0),
            upper: all(3.0),
            velocity: all(SPEED),
            acceleration: all(ACCELERATION),
            jerk: all(JERK),
            geometry: Geometry::new(chain, &shape, workspace, &[], 0.0).unwrap(),
        }
    }

    fn roomy() -> Workspace {
        Workspace { min: Vector3::repeat(-9.0), max: Vector3::repeat(9.0) }
    }

    /// One joint's way, tick by tick, from `to` on: the last state is at rest.
    fn way(verifier: &Verifier, to: &Motion) -> Vec<Motion> {
        let mut way = vec![*to];
        while !way[way.len() - 1].is_at_rest() {
            way.push(way[way.len() - 1].braked(&verifier.brakes, DT));
        }
        way
    }

    fn only(joint: usize, value: f64) -> JointVector {
        JointVector::from_fn(|i, _| if i == joint { value } else { 0.0 })
    }

    #[test]
    fn a_step_may_use_every_limit_and_exceed_none() {
        let v = verifier(&chain(), roomy());
        let motion = |v: JointVector, a: JointVector| Motion { q: home(), v, a };
        let none = JointVector::zeros();
        for joint in 0..DOF {
            for sign in [1.0, -1.0] {
                let on = |value: f64| only(joint, sign * value);
                let rest = motion(none, none);
                assert!(v.step_is_legal(&rest, &motion(on(2.0), none)));
                assert!(!v.step_is_legal(&rest, &motion(on(2.000_000_1), none)), "speed");
                let hard = motion(none, on(10.0));
                assert!(v.step_is_legal(&motion(none, on(9.5)), &hard));
                let harder = motion(none, on(10.000_001));
                assert!(!v.step_is_legal(&hard, &harder), "acceleration");
                assert!(
                    v.step_is_legal(&motion(none, on(-0.5)), &motion(none, on(0.5))),
                    "1 in all"
                );
                let jerk = motion(none, on(0.500_001));
                assert!(!v.step_is_legal(&motion(none, on(-0.5)), &jerk), "jerk");
                assert!(!v.step_is_legal(&rest, &motion(none, on(f64::NAN))));
                assert!(!v.step_is_legal(&rest, &motion(on(f64::NAN), none)));
            }
        }
    }

    /// Running out an acceleration of 3 rad/s² at 1 rad/s² per tick adds (2 + 1)·dt to the speed.
    #[test]
    fn a_brake_may_run_out_to_full_speed_and_not_beyond() {
        let (chain, from) = (chain(), Motion::at_rest(home()));
        let v = verifier(&chain, roomy());
        let said = |joint: usize, speed: f64, a: f64| {
            let to = Motion { q: home(), v: only(joint, speed), a: only(joint, a) };
            v.brake_is_legal(&chain, &from, &to, 1.0)
        };
        let too_fast = |said: Result<Verified, Refusal>, expected: f64| matches!(said, Err(Refusal::JointSpeed { speed, limit: SPEED, .. }) if (speed - expected).abs() < 1e-9);
        for joint in 0..DOF {
            for sign in [1.0, -1.0] {
                assert!(said(joint, sign * SPEED, 0.0).is_ok(), "at the limit by construction");
                assert!(said(joint, sign * (SPEED + 1e-12), 0.0).is_ok(), "and with its rounding");
                let beyond = SPEED + 1e-11;
                assert!(too_fast(said(joint, sign * beyond, 0.0), beyond));
                let room = SPEED - 3.0 * DT;
                assert!(said(joint, sign * room, sign * 3.0).is_ok());
                assert!(too_fast(said(joint, sign * (room + 1e-6), sign * 3.0), SPEED + 1e-6));
                assert!(said(joint, sign * 1.0, f64::NAN).is_err());
                assert!(said(joint, f64::NAN, 0.0).is_err());
            }
        }
    }

    /// The whole way of a joint is inside its range, both ends of it and both ways round.
    #[test]
    fn a_brake_may_end_at_the_end_of_a_range_and_not_beyond() {
        let chain = chain();
        let mut v = verifier(&chain, roomy());
        // The last two turn round on their way.
        for (speed, a) in [(1.5, 4.0), (-1.5, -4.0), (1.0, 0.0), (0.05, -9.0), (-0.05, 9.0)] {
            for joint in 0..DOF {
                // Away from zero, so that a factor is no sum.
                let mut to = Motion { q: home(), v: only(joint, speed), a: only(joint, a) };
                to.q[joint] = 0.7;
                let way = way(&v, &to);
                let of = |pick: fn(f64, f64) -> f64| way.iter().map(|m| m.q[joint]).reduce(pick);
                let (lowest, highest) = (of(f64::min).unwrap(), of(f64::max).unwrap());
                assert!(highest - lowest > 1e-4);
                let mut said = |lower: f64, upper: f64| {
                    (v.lower[joint], v.upper[joint]) = (lower, upper);
                    let from = Motion::at_rest(to.q);
                    let said = v.brake_is_legal(&chain, &from, &to, 1.0);
                    (v.lower[joint], v.upper[joint]) = (-3.0, 3.0);
                    said
                };
                // Where the arm stands now counts as inside.
                let (below, above) = (lowest.min(0.7 - 1e-9), highest.max(0.7 + 1e-9));
                assert!(said(below - 1e-9, above + 1e-9).is_ok());
                for (lower, upper, beyond, at) in [
                    (lowest + 1e-7, 3.0, lowest < 0.7 - 1e-6, lowest),
                    (-3.0, highest - 1e-7, highest > 0.7 + 1e-6, highest),
                ] {
                    let refused = matches!(
                        said(lower, upper),
                        Err(Refusal::JointRange { joint: j, value, .. }) if j == joint && (value - at).abs() < 1e-9
                    );
                    assert_eq!(refused, beyond, "{speed} {a} in [{lower}, {upper}]");
                }
            }
        }
    }

    #[test]
    fn a_joint_that_starts_outside_its_range_may_only_come_in() {
        let chain = chain();
        let v = verifier(&chain, roomy());
        for (at, out) in [(3.1, 0.5), (-3.1, -0.5)] {
            let mut from = Motion::at_rest(home());
            from.q[2] = at;
            let said = |speed: f64| {
                let mut to = Motion { v: only(2, speed), ..from };
                to.q[2] += speed * DT;
                v.brake_is_legal(&chain, &from, &to, 1.0)
            };
            assert!(said(-out).is_ok() && said(0.0).is_ok());
            assert!(matches!(said(out), Err(Refusal::JointRange { joint: 2, .. })));
        }
    }

    #[test]
    fn what_is_verified_is_the_clearance_now_and_the_time_of_the_slowest_joint() {
        let chain = chain();
        let tip = chain.forward(&home()).translation.vector;
        let mut box_ = roomy();
        box_.max.z = tip.z + 0.1;
        let v = verifier(&chain, box_);
        let mut to = Motion::at_rest(home());
        (to.v[1], to.v[4]) = (-0.2, 1.6);
        let said = v.brake_is_legal(&chain, &Motion::at_rest(home()), &to, 0.1).unwrap();
        assert!((said.clearance - 0.1).abs() < 1e-12, "{said:?}");
        // From 1.6 rad/s: 1.6/10 s of full deceleration, and 10/500 s for its ramps.
        assert!((said.stopping_time - 0.18).abs() <= 2.0 * DT, "{said:?}");
    }

    /// The tip of an arm whose joints all move, near one face of a box.
    fn near_a_wall() -> impl Strategy<Value = (Motion, usize, bool, f64, f64)> {
        let each = || prop::array::uniform6(-1.0..1.0f64);
        let clearance = prop_oneof![Just(0.01), 1e-6..1e-4f64, -0.01..-1e-6f64];
        let beside = (-7.0..-1.5f64, any::<bool>());
        (each(), each(), each(), 0..3usize, any::<bool>(), beside, clearance).prop_map(
            |(q, v, a, axis, upper, (size, free), clearance)| {
                let offset = 10f64.powf(size) * if free { 1.0 } else { -1.0 };
                let to = Motion {
                    q: home() + JointVector::from(q) * 0.8,
                    v: JointVector::from(v) * 0.3,
                    a: JointVector::from(a) * ACCELERATION,
                };
                (to, axis, upper, offset, clearance)
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// Against a look at every tick. And it looks only where the way since the last look could have used
        /// up what was left then, and only as long as the rest of the way could.
        #[test]
        fn a_way_is_clear_if_every_tick_of_it_is(
            (to, axis, upper, offset, clearance) in near_a_wall(),
        ) {
            let chain = chain();
            let floor = if clearance < 0.0 { clearance } else { 0.0 };
            let way = way(&verifier(&chain, roomy()), &to);
            let sign = if upper { 1.0 } else { -1.0 };
            let along = |q: &JointVector| sign * chain.forward(q).translation.vector[axis];
            let farthest = way.iter().map(|m| along(&m.q)).fold(f64::MIN, f64::max);
            // The tip comes as near to the wall as the floor allows, and `offset` less.
            let wall = farthest + floor + offset;
            let mut workspace = roomy();
            if upper { workspace.max[axis] = wall } else { workspace.min[axis] = -wall }
            let v = verifier(&chain, workspace);

            let distances: Vec<f64> = way.iter().map(|m| wall - along(&m.q)).collect();
            let needed = if clearance > GUARD { GUARD } else { clearance };
            prop_assume!((distances[0] - needed).abs() > 1e-12);
            let first_bad = if distances[0] < needed {
                Some(0)
            } else {
                (1..way.len()).find(|&k| distances[k] < floor)
            };

            let mut looks = Vec::new();
            let look = |q: &JointVector| {
                looks.push(way.iter().position(|m| m.q == *q).unwrap());
                v.geometry.clearance(&chain, q)
            };
            let said = v.way_is_clear(look, &to, &v.sweep(&to), clearance);
            match (said, first_bad) {
                (Ok(here), None) => prop_assert!((here.distance - distances[0]).abs() < 1e-12),
                (Err(Refusal::Obstacle { obstacle, distance }), Some(k)) => {
                    prop_assert_eq!(obstacle, Obstacle::Workspace { axis, upper });
                    prop_assert!((distance - distances[k]).abs() < 1e-12);
                }
                other => prop_assert!(false, "{other:?}"),
            }

            // Travel between two ticks: no distance shrinks by more.
            let travel = |from: usize, to: usize| -> f64 {
                let steps = way[from..=to].windows(2);
                steps.map(|w| v.geometry.travel(&(w[1].q - w[0].q).abs())).sum()
            };
            let last = way.len() - 1;
            prop_assert_eq!(looks[0], 0);
            for pair in looks.windows(2) {
                let left = distances[pair[0]] - floor;
                prop_assert!(travel(pair[0], pair[1]) > left - 1e-9, "looked again too soon");
                prop_assert!(travel(pair[0], last) > left - 1e-9, "the rest could not reach it");
            }
        }
    }
}
