//! The built-ins that ask or move this controller.

use palpate_spatial::{JointVector, Vector6};
use rand::Rng;

use super::cycle::Controller;
use super::motion::{Motion, Profile};
use super::program::Severity;
use super::protection::StopCause;
use super::watchdog::Watchdog;
use super::{DT, ticks};
use crate::script::{Builtin, Reply, Value, World, pose_to_value, value_to_pose};

type Answer = Result<Reply, String>;

/// The arguments of a call, by position.
struct Arguments<'a>(&'a [Value]);

impl Arguments<'_> {
    fn get(&self, i: usize) -> &Value {
        self.0.get(i).unwrap_or(&Value::None)
    }

    /// A finite number: on the arm, NaN has no meaning anywhere.
    fn number(&self, i: usize) -> Result<f64, String> {
        let value = self.get(i);
        let number = value.number().ok_or_else(|| {
            format!("argument {}: expected a number, got {}", i + 1, value.kind())
        })?;
        if number.is_finite() { Ok(number) } else { Err(format!("argument {} is {number}", i + 1)) }
    }

    fn number_or(&self, i: usize, default: f64) -> Result<f64, String> {
        if *self.get(i) == Value::None { Ok(default) } else { self.number(i) }
    }

    fn positive_or(&self, i: usize, default: f64) -> Result<f64, String> {
        match self.number_or(i, default)? {
            x if x > 0.0 => Ok(x),
            x => Err(format!("argument {} is {x}, it must be above 0", i + 1)),
        }
    }

    fn within(&self, i: usize, default: f64, low: f64, high: f64) -> Result<f64, String> {
        match self.number_or(i, default)? {
            x if x >= low && x <= high => Ok(x),
            x => Err(format!("argument {} is {x}, it must be in [{low}, {high}]", i + 1)),
        }
    }

    fn six(&self, i: usize) -> Result<[f64; 6], String> {
        let value = self.get(i);
        let six = value
            .six()
            .ok_or_else(|| format!("argument {}: expected six numbers, got {value}", i + 1))?;
        if six.iter().all(|x| x.is_finite()) {
            Ok(six)
        } else {
            Err(format!("argument {} is {value}", i + 1))
        }
    }

    fn six_or_none(&self, i: usize) -> Result<Option<[f64; 6]>, String> {
        if *self.get(i) == Value::None { Ok(None) } else { self.six(i).map(Some) }
    }

    fn three(&self, i: usize) -> Result<[f64; 3], String> {
        let Value::List(items) = self.get(i) else {
            return Err(format!("argument {}: expected a list", i + 1));
        };
        let mut three = [0.0; 3];
        if items.len() != 3 {
            return Err(format!("argument {}: expected three numbers", i + 1));
        }
        for (slot, item) in three.iter_mut().zip(items) {
            *slot =
                item.number().filter(|x| x.is_finite()).ok_or("expected three finite numbers")?;
        }
        Ok(three)
    }

    fn address(&self, count: usize) -> Result<usize, String> {
        match self.get(0) {
            Value::Int(i) if usize::try_from(*i).is_ok_and(|i| i < count) => Ok(*i as usize),
            other => Err(format!("register {other}: there are 0 to {}", count - 1)),
        }
    }

    fn text(&self, i: usize) -> String {
        match self.get(i) {
            Value::None => String::new(),
            other => other.to_string(),
        }
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the last word of many a built-in")]
fn value(value: Value) -> Answer {
    Ok(Reply::Value(value))
}

fn list(values: impl IntoIterator<Item = f64>) -> Answer {
    value(Value::floats(values))
}

const DONE: Answer = Ok(Reply::Value(Value::None));

impl World for Controller {
    fn call(&mut self, builtin: &Builtin, arguments: &[Value]) -> Answer {
        let a = Arguments(arguments);
        match builtin.name {
            "movej" | "movel" | "servoj" | "speedj" | "speedl" | "stopj" | "stopl" => {
                self.move_by(builtin.name, &a)
            }
            name if name.contains("_register") => self.register(name, &a),
            name if name.starts_with("get_") => self.get(name, &a),
            "is_steady" => value(Value::Bool(self.actual.dq.amax() < 1e-3)),
            "is_within_safety_limits" => {
                let q = match a.get(0) {
                    Value::Pose(pose) => {
                        self.arm.inverse(&value_to_pose(pose), &self.set_point.q, None).ok()
                    }
                    _ => Some(JointVector::from(a.six(0)?)),
                };
                let range = &self.config.limits.position;
                let inside = |q: JointVector| q.iter().zip(range).all(|(q, most)| q.abs() <= *most);
                value(Value::Bool(q.is_some_and(inside)))
            }
            "zero_ftsensor" => {
                self.zero_sensor();
                DONE
            }
            "set_payload" | "set_target_payload" => {
                self.payload = a.within(0, 0.0, 0.0, 100.0)?;
                if *a.get(1) != Value::None {
                    self.payload_cog = a.three(1)?;
                }
                DONE
            }
            "set_payload_mass" => {
                self.payload = a.within(0, 0.0, 0.0, 100.0)?;
                DONE
            }
            "set_payload_cog" => {
                self.payload_cog = a.three(0)?;
                DONE
            }
            "set_tcp" => {
                self.arm.set_tcp(a.six(0)?).map_err(|e| e.to_string())?;
                DONE
            }
            "set_gravity" => {
                self.gravity = a.three(0)?;
                DONE
            }
            "rtde_set_watchdog" => {
                let action = if *a.get(2) == Value::None { "pause".into() } else { a.text(2) };
                let dog = Watchdog::new(&a.text(0), a.number(1)?, &action, self.tick)?;
                self.watchdogs.retain(|d| d.variable() != dog.variable());
                self.watchdogs.push(dog);
                DONE
            }
            // Settings of a mode that is not modelled: programs make them at their start, whether they use it or not.
            "force_mode_set_damping" => a.within(0, 0.0, 0.0, 1.0).and(DONE),
            "force_mode_set_gain_scaling" => a.within(0, 0.0, 0.0, 2.0).and(DONE),
            "textmsg" => {
                self.note(Severity::Info, format!("{}{}", a.text(0), a.text(1)));
                DONE
            }
            "popup" => {
                self.note(Severity::Info, format!("popup: {}", a.text(0)));
                self.popup = Some(a.text(0));
                if *a.get(4) == Value::Bool(true) {
                    // The program goes on when somebody closes it.
                    self.pause_program();
                    return Ok(Reply::Ticks(1));
                }
                DONE
            }
            "protective_stop" => {
                self.protective_stop(StopCause::Requested);
                Ok(Reply::Ticks(1))
            }
            "sync" => Ok(Reply::Ticks(1)),
            "sleep" => match a.number(0)? {
                t if t >= 0.0 => Ok(Reply::Ticks(cycles(t))),
                t => Err(format!("{t} s")),
            },
            "random" => value(Value::Float(self.rng.random())),
            other => Err(format!("{other} has no definition")),
        }
    }

    fn is_moving(&self) -> bool {
        match &self.motion {
            Motion::Hold | Motion::Servo { .. } => false,
            Motion::Speed { goal, .. } => {
                goal.amax() == 0.0 || (self.set_point.dq - goal * self.scaling).amax() > 1e-9
            }
            Motion::ToolSpeed { goal, now, .. } => goal != now,
            Motion::Joints { .. } | Motion::Line { .. } => true,
        }
    }

    fn abandon_motion(&mut self) {
        self.brake();
    }
}

/// Cycles in a time, as the scheduler counts them.
fn cycles(seconds: f64) -> u32 {
    u32::try_from(ticks(seconds)).unwrap_or(u32::MAX)
}

impl Controller {
    fn move_by(&mut self, name: &str, a: &Arguments<'_>) -> Answer {
        match name {
            "servoj" => {
                let goal = JointVector::from(a.six(0)?);
                let time = a.positive_or(3, DT)?;
                let lookahead = a.within(4, 0.1, 0.03, 0.2)?;
                a.within(5, 300.0, 100.0, 2000.0)?;
                // Slowed down, the same way takes longer.
                let blocked = cycles(time / self.scaling.max(0.01)).max(1);
                // One cycle more than it blocks, so that who calls again at once never leaves a gap.
                self.motion = Motion::Servo { goal, lookahead, alive: u64::from(blocked) + 1 };
                Ok(Reply::Ticks(blocked))
            }
            "speedj" => {
                let goal = JointVector::from(a.six(0)?);
                self.motion = Motion::Speed { goal, acceleration: a.positive_or(1, 1.4)? };
                Ok(returns_after(a.number_or(2, 0.0)?))
            }
            "speedl" => {
                let now = self.target.tcp_speed;
                let acceleration = a.positive_or(1, 1.2)?;
                self.motion = Motion::ToolSpeed { goal: a.six(0)?, now, acceleration };
                Ok(returns_after(a.number_or(2, 0.0)?))
            }
            "stopj" => {
                self.motion = Motion::brake(a.positive_or(0, 2.0)?);
                Ok(Reply::Motion)
            }
            "stopl" => {
                // Along the joints' present way, as hard as the tool's deceleration asks.
                let a = a.positive_or(0, 20.0)?;
                let tool = Vector6::from(self.target.tcp_speed).fixed_rows::<3>(0).norm();
                let joints = self.set_point.dq.amax();
                let joint_deceleration = if tool > 1e-6 { a * joints / tool } else { a };
                self.motion = Motion::brake(joint_deceleration.max(0.1));
                Ok(Reply::Motion)
            }
            _ => {
                let line = name == "movel";
                let (acceleration, speed) = if line { (1.2, 0.25) } else { (1.4, 1.05) };
                let profile = match a.number_or(3, 0.0)? {
                    t if t > 0.0 => Profile::Duration(t),
                    _ => Profile::Limits {
                        acceleration: a.positive_or(1, acceleration)?,
                        speed: a.positive_or(2, speed)?,
                    },
                };
                let near = self.set_point.q;
                let q = match a.get(0) {
                    Value::Pose(pose) => self.arm.inverse(&value_to_pose(pose), &near, None)?,
                    _ => JointVector::from(a.six(0)?),
                };
                self.motion = if line {
                    let goal = Box::new(self.arm.forward(&q, None));
                    Motion::Line { goal, profile, begun: None }
                } else {
                    Motion::Joints { goal: q, profile, begun: None }
                };
                Ok(Reply::Motion)
            }
        }
    }

    fn get(&mut self, name: &str, a: &Arguments<'_>) -> Answer {
        match name {
            "get_actual_joint_positions" => list(self.actual.q.iter().copied()),
            "get_actual_joint_speeds" => list(self.actual.dq.iter().copied()),
            "get_target_joint_positions" => list(self.set_point.q.iter().copied()),
            "get_target_joint_speeds" => list(self.set_point.dq.iter().copied()),
            "get_actual_tcp_pose" => value(Value::Pose(self.actual.tcp)),
            "get_target_tcp_pose" => value(Value::Pose(self.target.tcp)),
            "get_actual_tool_flange_pose" => {
                value(Value::Pose(pose_to_value(&self.arm.flange(&self.actual.q))))
            }
            "get_target_payload_inertia" => list([0.0; 6]),
            "get_actual_tcp_speed" => list(self.actual.tcp_speed),
            "get_target_tcp_speed" => list(self.target.tcp_speed),
            "get_tcp_force" => list(self.tcp_force()),
            "get_tcp_offset" => value(Value::Pose(self.arm.tcp_offset())),
            "get_target_payload" => value(Value::Float(self.payload)),
            "get_target_payload_cog" => list(self.payload_cog),
            "get_steptime" => value(Value::Float(DT)),
            "get_forward_kin" => {
                let q = a.six_or_none(0)?.map_or(self.actual.q, JointVector::from);
                let pose = self.arm.forward(&q, a.six_or_none(1)?);
                value(Value::Pose(pose_to_value(&pose)))
            }
            "get_inverse_kin" => list(self.inverse(a)?.iter().copied()),
            _ => value(Value::Bool(self.inverse(a).is_ok())),
        }
    }

    fn inverse(&self, a: &Arguments<'_>) -> Result<JointVector, String> {
        let Value::Pose(pose) = a.get(0) else {
            return Err(format!("expected a pose p[…], got {}", a.get(0).kind()));
        };
        let near = a.six_or_none(1)?.map_or(self.actual.q, JointVector::from);
        self.arm.inverse(&value_to_pose(pose), &near, a.six_or_none(4)?)
    }

    fn register(&mut self, name: &str, a: &Arguments<'_>) -> Answer {
        let bank = if name.contains("_input_") {
            &mut self.registers.input
        } else {
            &mut self.registers.output
        };
        let write = name.starts_with("write");
        if name.contains("_integer_") {
            let address = a.address(bank.ints.len())?;
            if !write {
                return value(Value::Int(bank.ints[address]));
            }
            let Value::Int(i) = a.get(1) else {
                return Err(format!("expected an integer, got {}", a.get(1).kind()));
            };
            bank.ints[address] = *i;
        } else if name.contains("_float_") {
            let address = a.address(bank.floats.len())?;
            if !write {
                return value(Value::Float(bank.floats[address]));
            }
            bank.floats[address] = a.number(1)?;
        } else {
            let address = a.address(bank.bits.len())?;
            if !write {
                return value(Value::Bool(bank.bits[address]));
            }
            let Value::Bool(b) = a.get(1) else {
                return Err(format!("expected a boolean, got {}", a.get(1).kind()));
            };
            bank.bits[address] = *b;
        }
        DONE
    }
}

/// `speedj` and `speedl` return after a time if one is given, else when the speed is reached.
fn returns_after(time: f64) -> Reply {
    if time > 0.0 { Reply::Ticks(cycles(time)) } else { Reply::Motion }
}
