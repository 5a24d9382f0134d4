//! A world that only writes down what a program does, for tests and examples.

use std::collections::BTreeMap;

use super::{Builtin, Reply, Value, World};

/// Registers, messages and a motion that takes as many ticks as it is told.
#[derive(Debug, Default)]
pub struct Recorder {
    /// Every call of a built-in that reaches the world, as `name(arguments)`.
    pub calls: Vec<String>,
    /// What `textmsg` said.
    pub messages: Vec<String>,
    /// Values for `read_input_*_register`.
    pub inputs: BTreeMap<i32, Value>,
    /// What `write_output_*_register` wrote.
    pub outputs: BTreeMap<i32, Value>,
    /// Whether a motion is under way; a motion other than `servoj` sets it.
    pub moving: bool,
    /// How often a motion was left without its thread.
    pub abandoned: u32,
}

impl World for Recorder {
    fn call(&mut self, builtin: &Builtin, arguments: &[Value]) -> Result<Reply, String> {
        let given: Vec<String> =
            arguments.iter().filter(|a| **a != Value::None).map(ToString::to_string).collect();
        self.calls.push(format!("{}({})", builtin.name, given.join(", ")));
        let ticks = |seconds: &Value| {
            let seconds = seconds.number().ok_or("expected seconds")?;
            Ok::<_, String>(Reply::Ticks((seconds / 0.002).ceil() as u32))
        };
        match (builtin.name, arguments) {
            ("sync" | "servoj", _) => Ok(Reply::Ticks(1)),
            ("sleep", [seconds]) => ticks(seconds),
            ("textmsg", _) => {
                self.messages.push(given.concat());
                Ok(Reply::Value(Value::None))
            }
            ("movej" | "movel" | "speedj" | "speedl" | "stopj" | "stopl", _) => {
                self.moving = true;
                Ok(Reply::Motion)
            }
            (name, [Value::Int(address)]) if name.starts_with("read_input") => self
                .inputs
                .get(address)
                .map(|v| Reply::Value(v.clone()))
                .ok_or_else(|| format!("input register {address} was not set")),
            (name, [Value::Int(address), value]) if name.starts_with("write_output") => {
                self.outputs.insert(*address, value.clone());
                Ok(Reply::Value(Value::None))
            }
            ("get_steptime", _) => Ok(Reply::Value(Value::Float(0.002))),
            ("get_actual_joint_positions", _) => Ok(Reply::Value(Value::floats([0.0; 6]))),
            _ => Ok(Reply::Value(Value::None)),
        }
    }

    fn is_moving(&self) -> bool {
        self.moving
    }

    fn abandon_motion(&mut self) {
        self.abandoned += 1;
        self.moving = false;
    }
}
