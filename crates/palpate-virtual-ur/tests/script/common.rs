//! What the tests share.

use palpate_virtual_ur::script::testing::Recorder;
use palpate_virtual_ur::script::{Machine, Status, compile};

/// Runs a program to its end and returns what `textmsg` said, one line each.
pub(crate) fn said(text: &str) -> Result<String, String> {
    let (machine, world) = run(text, Recorder::default(), 1000)?;
    drop(machine);
    Ok(world.messages.join("\n"))
}

pub(crate) fn run(
    text: &str,
    mut world: Recorder,
    ticks: u32,
) -> Result<(Machine, Recorder), String> {
    let mut machine = Machine::new(compile(text).map_err(|e| e.to_string())?);
    for _ in 0..ticks {
        if machine.tick(&mut world).map_err(|e| e.to_string())? == Status::Finished {
            return Ok((machine, world));
        }
    }
    Ok((machine, world))
}

/// The value of an expression, as `textmsg` prints it.
pub(crate) fn value(expression: &str) -> Result<String, String> {
    said(&format!("def f():\n textmsg(to_str({expression}))\nend\n"))
}
