//! The set-point generator: where the arm shall be in each cycle.

use palpate_spatial::{JointVector, Pose, UnitQuaternion};

use super::DT;
use super::arm::ArmModel;

/// What the arm is doing.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// Standing.
    Hold,
    /// Following a stream of joint set-points through a first-order filter.
    ///
    /// The lag of `servoj` is the lookahead time plus that of the servo (measured on real arms: 34 ms at
    /// 0.03 s). `gain` has no published law; it is range-checked and not modelled.
    Servo {
        /// rad.
        goal: JointVector,
        /// Time constant, s.
        lookahead: f64,
        /// Cycles for which the stream is alive.
        alive: u64,
    },
    /// Towards joint speeds, then on at them: zero for a stop.
    Speed {
        /// rad/s.
        goal: JointVector,
        /// Of the leading axis, rad/s².
        acceleration: f64,
    },
    /// Along a tool speed, base axes.
    ToolSpeed {
        /// m/s and rad/s.
        goal: [f64; 6],
        /// The speed now.
        now: [f64; 6],
        /// m/s².
        acceleration: f64,
    },
    /// To joints, in a straight line of joint space.
    Joints {
        /// rad.
        goal: JointVector,
        /// Speed profile over the leading axis' way.
        profile: Profile,
        /// Set when the arm has come to rest and the move begins: start and time since.
        begun: Option<(JointVector, f64)>,
    },
    /// To a pose, in a straight line of space.
    Line {
        /// base_T_tcp.
        goal: Box<Pose>,
        /// Speed profile over the way.
        profile: Profile,
        /// Start and time since.
        begun: Option<(Box<Pose>, f64)>,
    },
}

/// A trapezoid of speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Profile {
    /// At most this speed and acceleration.
    Limits {
        /// Per s.
        speed: f64,
        /// Per s².
        acceleration: f64,
    },
    /// In this time, s: a third speeding up, a third slowing down.
    Duration(f64),
}

impl Profile {
    /// Way covered `time` seconds after the start of a way of `length`, and whether it is over.
    pub(crate) fn at(&self, length: f64, time: f64) -> (f64, bool) {
        if length <= 0.0 {
            return (0.0, true);
        }
        let (v, a) = match *self {
            Self::Limits { speed, acceleration } => (speed, acceleration),
            Self::Duration(t) => (1.5 * length / t, 4.5 * length / (t * t)),
        };
        // A way too short for the full speed has a lower peak.
        let v = v.min((length * a).sqrt());
        let (ramp, total) = (v / a, length / v + v / a);
        if time >= total {
            return (length, true);
        }
        let way = if time < ramp {
            0.5 * a * time * time
        } else if time > total - ramp {
            length - 0.5 * a * (total - time).powi(2)
        } else {
            v * (time - 0.5 * ramp)
        };
        (way, false)
    }
}

/// Set-point and speed in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SetPoint {
    pub(crate) q: JointVector,
    pub(crate) dq: JointVector,
}

/// What a motion asks for in the next cycle.
#[derive(Debug, PartialEq)]
pub(crate) enum Next {
    Go(SetPoint),
    /// It is over.
    Done(SetPoint),
    /// It has no next set-point.
    Impossible(String),
}

impl Motion {
    /// A stop at this deceleration of the leading axis, rad/s².
    pub fn brake(deceleration: f64) -> Self {
        Self::Speed { goal: JointVector::zeros(), acceleration: deceleration }
    }

    /// A move interrupted by a pause starts anew from where the arm is.
    pub(crate) fn restart(&mut self) {
        match self {
            Self::Joints { begun, .. } => *begun = None,
            Self::Line { begun, .. } => *begun = None,
            _ => {}
        }
    }

    /// The next set-point; time passes at `scale` (speed slider).
    pub(crate) fn next(&mut self, now: &SetPoint, arm: &ArmModel, scale: f64) -> Next {
        let dt = DT * scale;
        let to = |q: JointVector| SetPoint { q, dq: (q - now.q) / DT };
        match self {
            Self::Hold => Next::Done(SetPoint { q: now.q, dq: JointVector::zeros() }),
            Self::Servo { goal, lookahead, alive } => {
                if *alive == 0 {
                    return Next::Done(*now);
                }
                *alive -= 1;
                Next::Go(to(now.q + (*goal - now.q) * -(-dt / *lookahead).exp_m1()))
            }
            Self::Speed { goal, acceleration } => {
                let rest = goal.amax() == 0.0;
                let change = *goal * scale - now.dq;
                let most = *acceleration * DT;
                let reached = change.amax() <= most;
                let dq =
                    if reached { *goal * scale } else { now.dq + change * (most / change.amax()) };
                let next = SetPoint { q: now.q + dq * DT, dq };
                if reached && rest { Next::Done(next) } else { Next::Go(next) }
            }
            Self::ToolSpeed { goal, now: speed, acceleration } => {
                let most = *acceleration * DT;
                let change =
                    goal.iter().zip(&*speed).fold(0.0f64, |m, (g, s)| m.max((g - s).abs()));
                let part = if change <= most { 1.0 } else { most / change };
                for (s, g) in speed.iter_mut().zip(goal) {
                    *s += (*g - *s) * part;
                }
                match arm.joint_speeds(&now.q, &speed.map(|s| s * scale)) {
                    Some(dq) => Next::Go(SetPoint { q: now.q + dq * DT, dq }),
                    None => Next::Impossible("the arm is in a singularity".into()),
                }
            }
            Self::Joints { goal, profile, begun } => {
                let Some((start, time)) = begun else {
                    if now.dq.amax() > 0.0 {
                        return settle(now);
                    }
                    *begun = Some((now.q, 0.0));
                    return Next::Go(*now);
                };
                *time += dt;
                let way = *goal - *start;
                let length = way.amax();
                let (covered, over) = profile.at(length, *time);
                if over {
                    return Next::Done(SetPoint { q: *goal, dq: JointVector::zeros() });
                }
                Next::Go(to(*start + way * (covered / length)))
            }
            Self::Line { goal, profile, begun } => {
                let Some((start, time)) = begun else {
                    if now.dq.amax() > 0.0 {
                        return settle(now);
                    }
                    *begun = Some((Box::new(arm.forward(&now.q, None)), 0.0));
                    return Next::Go(*now);
                };
                *time += dt;
                let way = start.inv_mul(goal);
                let turn = way.rotation.scaled_axis();
                // A turn in place is as long as the way of a point 0.25 m from its axis.
                let length = way.translation.vector.norm().max(turn.norm() * 0.25);
                let (covered, over) = profile.at(length, *time);
                let part = if over { 1.0 } else { covered / length };
                let rotation = UnitQuaternion::from_scaled_axis(turn * part);
                let there = Pose::from_parts((way.translation.vector * part).into(), rotation);
                match arm.inverse(&(**start * there), &now.q, None) {
                    Ok(q) if over => Next::Done(SetPoint { q, dq: JointVector::zeros() }),
                    Ok(q) => Next::Go(to(q)),
                    Err(problem) => Next::Impossible(problem),
                }
            }
        }
    }
}

/// A cycle of coming to rest before a move.
fn settle(now: &SetPoint) -> Next {
    /// rad/s² of the leading axis.
    const DECELERATION: f64 = 10.0;
    let speed = now.dq.amax();
    let left = (speed - DECELERATION * DT).max(0.0);
    let dq = now.dq * (left / speed);
    Next::Go(SetPoint { q: now.q + dq * DT, dq })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trapezoid_covers_its_way_within_its_limits() {
        for (length, profile, duration) in [
            (1.0, Profile::Limits { speed: 0.5, acceleration: 1.0 }, 2.5),
            // Too short to reach the speed: two ramps of √(length/a).
            (0.04, Profile::Limits { speed: 0.5, acceleration: 1.0 }, 0.4),
            (0.7, Profile::Duration(1.4), 1.4),
        ] {
            let way = |t: f64| profile.at(length, t).0;
            assert!(
                !profile.at(length, duration - 1e-6).1 && profile.at(length, duration + 1e-6).1
            );
            let steps = 1000;
            let dt = duration / f64::from(steps);
            let mut last = 0.0;
            for i in 1..=steps {
                let here = way(f64::from(i) * dt);
                let speed = (here - last) / dt;
                assert!(speed >= -1e-9 && speed <= 1.5 * length / duration * 1.4, "{speed}");
                last = here;
            }
            assert!((last - length).abs() < 1e-9);
        }
    }
}
