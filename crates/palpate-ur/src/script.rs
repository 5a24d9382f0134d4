//! The control program: its text, filled in, and the way onto the controller.

use std::fmt::Write as _;
use std::io::{ErrorKind, Read, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use crate::link::connect;
use crate::{UrConfig, UrError};

/// The control program with `$NAME$` where the configuration goes.
pub const TEMPLATE: &str = include_str!("../scripts/palpate.script");

/// The control program for this configuration. Packets count only with this token.
pub fn control_program(config: &UrConfig, token: i32) -> String {
    let payload = config.payload.map_or_else(
        || "# the payload stays as set in the installation".into(),
        |p| format!("set_payload({}, {})", float(p.mass), list(&p.cog)),
    );
    let tcp = config.tcp.map_or_else(
        || "# the tool centre point stays as set in the installation".into(),
        |tcp| format!("set_tcp(p{})", list(&tcp)),
    );
    let watchdog = config.watchdog.map_or_else(
        || "# the controller's own watchdog stays off".into(),
        |rate| format!("rtde_set_watchdog(\"input_int_register_25\", {}, \"stop\")", float(rate)),
    );
    [
        ("$TOKEN$", token.to_string()),
        ("$STALL_CYCLES$", config.stall_ticks.to_string()),
        ("$BRAKE$", float(config.brake)),
        ("$LOOKAHEAD$", float(config.lookahead)),
        ("$GAIN$", float(config.gain)),
        ("$FIRST_STEP$", list(&[config.first_step_max; 6])),
        ("$MAX_STEP$", list(&config.step_max())),
        ("$PAYLOAD$", payload),
        ("$TCP$", tcp),
        ("$WATCHDOG$", watchdog),
    ]
    .into_iter()
    .fold(TEMPLATE.to_owned(), |text, (name, value)| text.replace(name, &value))
}

/// URScript knows no exponents.
fn float(x: f64) -> String {
    format!("{x:.9}")
}

fn list(values: &[f64]) -> String {
    let mut text = String::from("[");
    for (n, x) in values.iter().enumerate() {
        let _ = write!(text, "{}{x:.9}", if n > 0 { ", " } else { "" });
    }
    text + "]"
}

/// A connection to the primary or secondary interface that has sent a program.
///
/// Keep it, and [`drain`](Self::drain) it, until the program reports: the interface streams robot state
/// all the time, and closing a socket with unread data resets the connection, which can take the program
/// with it.
#[derive(Debug)]
pub struct Upload(TcpStream);

impl Upload {
    /// Sends `program`, whose last line ends with a newline, and with it starts it. A running program is
    /// replaced.
    ///
    /// # Errors
    ///
    /// No connection, or the controller does not take the text within `timeout`.
    pub fn send(host: &str, port: u16, program: &str, timeout: Duration) -> Result<Self, UrError> {
        let stream = connect("the script interface", host, port, timeout)?;
        stream.set_write_timeout(Some(timeout))?;
        (&stream).write_all(program.as_bytes())?;
        stream.set_nonblocking(true)?;
        Ok(Self(stream))
    }

    /// Throws away what the interface has streamed so far.
    pub fn drain(&mut self) {
        let mut sink = [0; 4096];
        loop {
            match self.0.read(&mut sink) {
                Ok(n) if n > 0 => {}
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                // Nothing more, or nothing ever again: RTDE will tell.
                _ => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers;

    fn program() -> String {
        let mut config = UrConfig::at("robot");
        config.payload = Some(crate::Payload { mass: 0.3, cog: [0.0, 0.0, 1e-7] });
        config.tcp = Some([0.0, 0.0, 0.15, 0.0, 0.0, 0.0]);
        control_program(&config, 1234)
    }

    #[test]
    fn everything_is_filled_in() {
        let text = program();
        assert!(!text.replace("# $NAME$ is", "").contains('$'), "{text}");
        for line in [
            "  TOKEN = 1234",
            "  set_payload(0.300000000, [0.000000000, 0.000000000, 0.000000100])",
            "  set_tcp(p[0.000000000, 0.000000000, 0.150000000, 0.000000000, 0.000000000, 0.000000000])",
            "  rtde_set_watchdog(\"input_int_register_25\", 1.000000000, \"stop\")",
            "  STALL_CYCLES = 10",
        ] {
            assert!(text.lines().any(|l| l == line), "no line {line:?} in\n{text}");
        }
        assert!(text.ends_with("\nend\n"));
    }

    #[test]
    fn blocks_are_closed() {
        let mut depth = 0;
        for line in program().lines().map(|l| l.split('#').next().unwrap_or("").trim()) {
            let word = line.split([' ', ':']).next();
            if matches!(word, Some("def" | "while" | "if")) {
                assert!(line.ends_with(':'), "{line}");
                depth += 1;
            }
            if word == Some("end") {
                depth -= 1;
            }
        }
        assert_eq!(depth, 0);
    }

    /// The program is one file for the controller: its numbers are compared with the crate's.
    #[test]
    fn the_program_uses_the_registers_of_the_crate() {
        use registers::{CHECK, Mode, REPORT, SEQUENCE, SET_POINT, TOKEN, VERSION};
        let text = program();
        let has = |part: String| assert!(text.contains(&part), "no {part} in the program");
        has(format!("  VERSION = {VERSION}\n"));
        has(format!("mode = read_input_integer_register({})", registers::MODE));
        has(format!("sequence = read_input_integer_register({SEQUENCE})"));
        has(format!("read_input_integer_register({TOKEN}) == TOKEN"));
        for joint in 0..6 {
            has(format!("read_input_float_register({})", SET_POINT + joint));
        }
        has(format!("- read_input_float_register({CHECK})"));
        let report = ["VERSION", "taken", "status", "heartbeat", "TOKEN", "tares", "reason"];
        for (register, value) in REPORT.zip(report) {
            has(format!("write_output_integer_register({register}, {value})"));
        }
        has(format!("gap = gap + {}", registers::SEQUENCE_END));
        for (name, mode) in [
            ("IDLE", Mode::Idle),
            ("SERVO", Mode::Servo),
            ("STOP", Mode::Stop),
            ("TARE", Mode::Tare),
            ("END", Mode::End),
        ] {
            has(format!("  MODE_{name} = {}\n", mode as i32));
        }
        use registers::Status;
        for (name, status) in [
            ("IDLE", Status::Idle),
            ("SERVO", Status::Servo),
            ("STOPPED", Status::Stopped),
            ("STALLED", Status::Stalled),
            ("ENDED", Status::Ended),
        ] {
            let number = (0..10).find(|n| Status::new(*n, 0) == status);
            has(format!("  STATUS_{name} = {}\n", number.unwrap_or(-1)));
        }
    }
}
