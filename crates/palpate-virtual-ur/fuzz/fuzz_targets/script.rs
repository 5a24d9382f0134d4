//! Text to the script port: a program or an error, and bounded work in every tick.
#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_virtual_ur::script::testing::Recorder;
use palpate_virtual_ur::script::{Machine, Unit, Units, compile};

fuzz_target!(|bytes: &[u8]| {
    let mut units = Units::default();
    units.push(bytes);
    units.idle();
    while let Some(unit) = units.take() {
        let Unit::Program(text) = unit else { continue };
        let Ok(program) = compile(&text) else { continue };
        let mut machine = Machine::new(program);
        for _ in 0..5 {
            if machine.tick(&mut Recorder::default()).is_err() {
                break;
            }
        }
    }
});
