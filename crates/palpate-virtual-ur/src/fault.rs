//! Faults on request, as data.

use std::str::FromStr;

use crate::controller::SensorFault;

/// One of the controller's servers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Port {
    /// 30004.
    Rtde,
    /// 29999.
    Dashboard,
    /// 30001.
    Primary,
    /// 30002.
    Secondary,
    /// 30003.
    RealTime,
}

impl Port {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Rtde, Self::Dashboard, Self::Primary, Self::Secondary, Self::RealTime];

    /// The number on a real controller.
    pub const fn number(self) -> u16 {
        match self {
            Self::Rtde => 30004,
            Self::Dashboard => 29999,
            Self::Primary => 30001,
            Self::Secondary => 30002,
            Self::RealTime => 30003,
        }
    }

    /// As faults name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rtde => "rtde",
            Self::Dashboard => "dashboard",
            Self::Primary => "primary",
            Self::Secondary => "secondary",
            Self::RealTime => "realtime",
        }
    }
}

/// Something that goes wrong.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// On the connections to one port.
    Link(Port, LinkFault),
    /// RTDE refuses protocol version 2 on connections made from now on.
    OnlyVersion1,
    /// Another program owns an input for some seconds.
    InUse(String, f64),
    /// The RTDE time stamp jumps by this, s; below zero it goes back.
    Timestamp(f64),
    /// Nothing runs for some seconds: no cycle, no answer.
    Stall(f64),
    /// The controller boots: all connections end, the time stamp starts at 0, no program, no power.
    Reboot,
    /// A protective stop.
    ProtectiveStop,
    /// The emergency stop button is pressed (true) or released.
    EmergencyStop(bool),
    /// The safeguard opens (true) or is reset.
    SafeguardStop(bool),
    /// The safety system finds a fault.
    SafetyFault,
    /// Somebody moves the speed slider, 0 to 1.
    Slider(f64),
    /// Somebody switches to remote (true) or local control.
    RemoteControl(bool),
    /// The program is stopped at the pendant.
    KillProgram,
    /// The program is paused at the pendant.
    PauseProgram,
    /// The force/torque sensor.
    Sensor(SensorFault),
}

/// What happens to connections.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LinkFault {
    /// Closed in order (FIN).
    Drop,
    /// Closed without order (RST).
    Reset,
    /// For some seconds nothing passes in either direction, as with a pulled cable.
    HalfOpen(f64),
    /// For some seconds nothing reaches the client.
    Mute(f64),
    /// For some seconds nothing reaches the controller; then all of it at once.
    Deaf(f64),
    /// The controller reads at most so many bytes per cycle, for some seconds.
    SlowReader(usize, f64),
    /// For some seconds every packet is cut in two, at another place each time.
    Split(f64),
    /// So many cycles' packets come at once, for some seconds.
    Merge(u32, f64),
    /// So many random bytes.
    Garbage(usize),
    /// A header that announces this size and kind, with nothing behind it.
    Header(u16, u8),
    /// So many text messages at once.
    TextFlood(usize),
    /// From now on everything arrives later: mean and uniform jitter to either side, s.
    Latency(f64, f64),
}

/// A fault and when it happens.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedFault {
    /// Seconds after the controller was started.
    pub at: f64,
    /// What happens.
    pub fault: Fault,
}

/// A fault that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("fault {text:?}: {problem}")]
pub struct FaultError {
    text: String,
    problem: String,
}

/// What the command line takes, for its help.
pub const FAULT_HELP: &str = "SECONDS:FAULT[=NUMBERS][@PORT], PORT being rtde (default), dashboard, primary, secondary or realtime.
On a link: drop, reset, half-open=S, mute=S, deaf=S, slow-reader=BYTES,S, split=S, merge=CYCLES,S, garbage=BYTES, header=SIZE,KIND, \
texts=N, latency=MEAN,JITTER.
In the controller: version-1, in-use=VARIABLE,S, timestamp=S, stall=S, reboot, protective-stop, emergency-stop=1|0, safeguard=1|0, \
safety-fault, slider=FRACTION, remote=1|0, kill-program, pause-program.
In the sensor (N, N·m, tool axes): ft-bias=FX,FY,FZ,TX,TY,TZ, ft-drift=… per second, ft-nan, ft-stuck, ft-saturated=FORCE,TORQUE, ft-ok.";

impl FromStr for TimedFault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let wrong = |problem: String| FaultError { text: text.to_owned(), problem };
        let (at, what) =
            text.split_once(':').ok_or_else(|| wrong("no SECONDS: before it".into()))?;
        let at = at.parse().ok().filter(|t: &f64| *t >= 0.0 && t.is_finite());
        let at = at.ok_or_else(|| wrong("does not start with seconds".into()))?;
        let (what, port) = what.split_once('@').map_or((what, Port::Rtde.name()), |(w, p)| (w, p));
        let port = Port::ALL.into_iter().find(|p| p.name() == port);
        let port = port.ok_or_else(|| wrong("there is no such port".into()))?;
        let (name, arguments) = what.split_once('=').unwrap_or((what, ""));
        let fault = if name == "in-use" {
            let (variable, seconds) = arguments.split_once(',').unwrap_or((arguments, "inf"));
            let seconds = seconds.parse().or(Err(wrong("expected in-use=VARIABLE,S".into())))?;
            Fault::InUse(variable.to_owned(), seconds)
        } else {
            let numbers: Result<Vec<f64>, _> =
                arguments.split(',').filter(|a| !a.is_empty()).map(str::parse).collect();
            let numbers = numbers.or(Err(wrong("its arguments are no numbers".into())))?;
            named(name, &numbers, port).ok_or_else(|| wrong(format!("not one of\n{FAULT_HELP}")))?
        };
        Ok(Self { at, fault })
    }
}

fn named(name: &str, n: &[f64], port: Port) -> Option<Fault> {
    let link = |fault| Some(Fault::Link(port, fault));
    match (name, n) {
        ("drop", []) => link(LinkFault::Drop),
        ("reset", []) => link(LinkFault::Reset),
        ("half-open", [s]) => link(LinkFault::HalfOpen(*s)),
        ("mute", [s]) => link(LinkFault::Mute(*s)),
        ("deaf", [s]) => link(LinkFault::Deaf(*s)),
        ("slow-reader", [bytes, s]) => link(LinkFault::SlowReader(*bytes as usize, *s)),
        ("split", [s]) => link(LinkFault::Split(*s)),
        ("merge", [cycles, s]) => link(LinkFault::Merge(*cycles as u32, *s)),
        ("garbage", [bytes]) => link(LinkFault::Garbage(*bytes as usize)),
        ("header", [size, kind]) => link(LinkFault::Header(*size as u16, *kind as u8)),
        ("texts", [count]) => link(LinkFault::TextFlood(*count as usize)),
        ("latency", [mean, jitter]) => link(LinkFault::Latency(*mean, *jitter)),
        ("version-1", []) => Some(Fault::OnlyVersion1),
        ("timestamp", [s]) => Some(Fault::Timestamp(*s)),
        ("stall", [s]) => Some(Fault::Stall(*s)),
        ("reboot", []) => Some(Fault::Reboot),
        ("protective-stop", []) => Some(Fault::ProtectiveStop),
        ("emergency-stop", [pressed]) => Some(Fault::EmergencyStop(*pressed != 0.0)),
        ("safeguard", [open]) => Some(Fault::SafeguardStop(*open != 0.0)),
        ("safety-fault", []) => Some(Fault::SafetyFault),
        ("slider", [fraction]) => Some(Fault::Slider(*fraction)),
        ("remote", [on]) => Some(Fault::RemoteControl(*on != 0.0)),
        ("kill-program", []) => Some(Fault::KillProgram),
        ("pause-program", []) => Some(Fault::PauseProgram),
        ("ft-bias", six) => Some(Fault::Sensor(SensorFault::Bias(six.try_into().ok()?))),
        ("ft-drift", six) => Some(Fault::Sensor(SensorFault::Drift(six.try_into().ok()?))),
        ("ft-nan", []) => Some(Fault::Sensor(SensorFault::NotANumber)),
        ("ft-stuck", []) => Some(Fault::Sensor(SensorFault::Stuck)),
        ("ft-saturated", [force, torque]) => {
            Some(Fault::Sensor(SensorFault::Saturated(*force, *torque)))
        }
        ("ft-ok", []) => Some(Fault::Sensor(SensorFault::None)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_can_be_written() {
        for (text, fault) in [
            ("3:drop", Fault::Link(Port::Rtde, LinkFault::Drop)),
            ("0.5:half-open=12@dashboard", Fault::Link(Port::Dashboard, LinkFault::HalfOpen(12.0))),
            ("1:latency=0.02,0.005", Fault::Link(Port::Rtde, LinkFault::Latency(0.02, 0.005))),
            ("1:in-use=input_int_register_24,3", Fault::InUse("input_int_register_24".into(), 3.0)),
            (
                "1:ft-bias=0,0,5,0,0,0",
                Fault::Sensor(SensorFault::Bias([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])),
            ),
            ("1:slider=0.5", Fault::Slider(0.5)),
        ] {
            let timed: TimedFault = text.parse().unwrap();
            assert_eq!(timed.fault, fault, "{text}");
        }
        for text in [
            "drop",
            "x:drop",
            "-1:drop",
            "1:drop@moon",
            "1:fly",
            "1:half-open",
            "1:ft-bias=1,2",
            "1:mute=a",
        ] {
            text.parse::<TimedFault>().unwrap_err();
        }
    }

    #[test]
    fn the_help_names_every_fault() {
        // Each name in the help is understood with arguments of the kind it shows.
        for name in [
            "drop",
            "reset",
            "version-1",
            "reboot",
            "protective-stop",
            "safety-fault",
            "kill-program",
            "ft-nan",
        ] {
            assert!(FAULT_HELP.contains(name) && named(name, &[], Port::Rtde).is_some(), "{name}");
        }
    }
}
