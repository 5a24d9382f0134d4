//! Commands, the replies that mean yes, and the version that has them.

use std::borrow::Cow;
use std::fmt;

/// A command of the dashboard server of an e-Series controller.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the variants are the commands' own names")]
pub enum Command<'a> {
    PowerOn,
    PowerOff,
    BrakeRelease,
    UnlockProtectiveStop,
    CloseSafetyPopup,
    ClosePopup,
    RestartSafety,
    Load(&'a str),
    Play,
    Pause,
    Stop,
    Running,
    RobotMode,
    SafetyStatus,
    ProgramState,
    PolyscopeVersion,
    IsInRemoteControl,
    SerialNumber,
    RobotModel,
    OperationalMode,
    Popup(&'a str),
    AddToLog(&'a str),
    Quit,
}

impl Command<'_> {
    /// The line to send, without its end. A line break in an argument becomes a space.
    pub fn text(&self) -> Cow<'static, str> {
        let with = |name: &str, argument: &str| {
            Cow::Owned(format!("{name} {}", argument.replace(['\r', '\n'], " ")))
        };
        Cow::Borrowed(match self {
            Self::PowerOn => "power on",
            Self::PowerOff => "power off",
            Self::BrakeRelease => "brake release",
            Self::UnlockProtectiveStop => "unlock protective stop",
            Self::CloseSafetyPopup => "close safety popup",
            Self::ClosePopup => "close popup",
            Self::RestartSafety => "restart safety",
            Self::Load(program) => return with("load", program),
            Self::Play => "play",
            Self::Pause => "pause",
            Self::Stop => "stop",
            Self::Running => "running",
            Self::RobotMode => "robotmode",
            Self::SafetyStatus => "safetystatus",
            Self::ProgramState => "programState",
            Self::PolyscopeVersion => "PolyscopeVersion",
            Self::IsInRemoteControl => "is in remote control",
            Self::SerialNumber => "get serial number",
            Self::RobotModel => "get robot model",
            Self::OperationalMode => "get operational mode",
            Self::Popup(text) => return with("popup", text),
            Self::AddToLog(text) => return with("addToLog", text),
            Self::Quit => "quit",
        })
    }

    /// Whether a reply is the documented one for success.
    pub fn accepts(&self, reply: &str) -> bool {
        match self {
            Self::PowerOn => reply == "Powering on",
            Self::PowerOff => reply == "Powering off",
            Self::BrakeRelease => reply == "Brake releasing",
            Self::UnlockProtectiveStop => reply == "Protective stop releasing",
            Self::CloseSafetyPopup => reply == "closing safety popup",
            Self::ClosePopup => reply == "closing popup",
            Self::RestartSafety => reply == "Restarting safety",
            Self::Load(program) => reply == format!("Loading program: {program}"),
            Self::Play => reply == "Starting program",
            Self::Pause => reply == "Pausing program",
            Self::Stop => reply == "Stopped",
            Self::Running => matches!(reply, "Program running: true" | "Program running: false"),
            Self::RobotMode => reply.starts_with("Robotmode: "),
            Self::SafetyStatus => reply.starts_with("Safetystatus: "),
            Self::ProgramState => {
                ["STOPPED", "PLAYING", "PAUSED"].iter().any(|state| reply.starts_with(state))
            }
            Self::PolyscopeVersion => PolyScope::parse(reply).is_some(),
            Self::IsInRemoteControl => matches!(reply, "true" | "false"),
            Self::SerialNumber => !reply.is_empty() && reply.bytes().all(|b| b.is_ascii_digit()),
            Self::RobotModel => reply.starts_with("UR"),
            Self::OperationalMode => matches!(reply, "NONE" | "MANUAL" | "AUTOMATIC"),
            Self::Popup(_) => reply == "showing popup",
            Self::AddToLog(_) => reply == "Added log message",
            Self::Quit => reply == "Disconnected",
        }
    }

    /// The oldest version that has the command.
    pub fn since(&self) -> PolyScope {
        match self {
            Self::RestartSafety => PolyScope(5, 1, 0),
            Self::SafetyStatus => PolyScope(5, 4, 0),
            Self::IsInRemoteControl
            | Self::SerialNumber
            | Self::RobotModel
            | Self::OperationalMode => PolyScope(5, 6, 0),
            _ => PolyScope(5, 0, 0),
        }
    }
}

/// A PolyScope version: major, minor, bugfix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PolyScope(pub u32, pub u32, pub u32);

impl PolyScope {
    /// From `URSoftware 5.12.4.1101661 (Oct 13 2022)`.
    pub fn parse(reply: &str) -> Option<Self> {
        let version = reply.strip_prefix("URSoftware ")?.split(' ').next()?;
        let mut parts = version.split('.').map(|part| part.parse().ok());
        Some(Self(parts.next()??, parts.next()??, parts.next()??))
    }
}

impl fmt::Display for PolyScope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.0, self.1, self.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_and_ordered() {
        let parsed = PolyScope::parse("URSoftware 5.12.4.1101661 (Oct 13 2022)");
        assert_eq!(parsed, Some(PolyScope(5, 12, 4)));
        assert!(PolyScope(5, 12, 4) > Command::SafetyStatus.since());
        for bad in ["", "URSoftware", "URSoftware 5.x.1", "5.12.4", "URSoftware 5.12"] {
            assert_eq!(PolyScope::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn an_argument_stays_one_line() {
        assert_eq!(Command::Popup("a\nshutdown").text(), "popup a shutdown");
    }

    #[test]
    fn refusals_are_not_taken_for_success() {
        assert!(!Command::Play.accepts("Failed to execute: play"));
        assert!(!Command::Load("a.urp").accepts("File not found: a.urp"));
        assert!(!Command::UnlockProtectiveStop.accepts(
            "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking"
        ));
        assert!(Command::ProgramState.accepts("PLAYING a.urp"));
    }
}
