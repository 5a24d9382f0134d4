//! Modes and states that the controller reports as numbers.
//!
//! A number that is not known here is kept as `Unknown` and never counts as safe to move.

macro_rules! mode {
    ($(#[$doc:meta])* $name:ident: $int:ty { $($value:literal => $variant:ident $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[expect(missing_docs, reason = "the variants carry the controller's own names")]
        pub enum $name { $($variant,)* Unknown($int) }

        impl From<$int> for $name {
            fn from(value: $int) -> Self {
                match value { $($value => Self::$variant,)* other => Self::Unknown(other) }
            }
        }

        impl From<$name> for $int {
            fn from(mode: $name) -> Self {
                match mode { $($name::$variant => $value,)* $name::Unknown(other) => other }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self {
                    $(Self::$variant => f.write_str($text),)*
                    Self::Unknown(other) => write!(f, "UNKNOWN({other})"),
                }
            }
        }

        impl $name {
            /// Every known one, by the controller's number.
            pub const KNOWN: &'static [Self] = &[$(Self::$variant,)*];
        }
    };
}

mode! {
    /// `robot_mode`: power and brakes.
    RobotMode: i32 {
        -1 => NoController "NO_CONTROLLER",
        0 => Disconnected "DISCONNECTED",
        1 => ConfirmSafety "CONFIRM_SAFETY",
        2 => Booting "BOOTING",
        3 => PowerOff "POWER_OFF",
        4 => PowerOn "POWER_ON",
        5 => Idle "IDLE",
        6 => Backdrive "BACKDRIVE",
        7 => Running "RUNNING",
        8 => UpdatingFirmware "UPDATING_FIRMWARE",
    }
}

mode! {
    /// `safety_status`, and `safety_mode`, which has one number more (14).
    SafetyStatus: i32 {
        1 => Normal "NORMAL",
        2 => Reduced "REDUCED",
        3 => ProtectiveStop "PROTECTIVE_STOP",
        4 => Recovery "RECOVERY",
        5 => SafeguardStop "SAFEGUARD_STOP",
        6 => SystemEmergencyStop "SYSTEM_EMERGENCY_STOP",
        7 => RobotEmergencyStop "ROBOT_EMERGENCY_STOP",
        8 => Violation "VIOLATION",
        9 => Fault "FAULT",
        10 => ValidateJointId "VALIDATE_JOINT_ID",
        11 => Undefined "UNDEFINED_SAFETY_MODE",
        12 => AutomaticModeSafeguardStop "AUTOMATIC_MODE_SAFEGUARD_STOP",
        13 => SystemThreePositionEnablingStop "SYSTEM_THREE_POSITION_ENABLING_STOP",
        14 => PendantThreePositionEnablingStop "TP_THREE_POSITION_ENABLING_STOP",
    }
}

mode! {
    /// `runtime_state`: the program.
    RuntimeState: u32 {
        0 => Stopping "STOPPING",
        1 => Stopped "STOPPED",
        2 => Playing "PLAYING",
        3 => Pausing "PAUSING",
        4 => Paused "PAUSED",
        5 => Resuming "RESUMING",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_numbers_are_kept_and_not_safe() {
        for n in [-5, 15, i32::MAX, i32::MIN] {
            assert_eq!(i32::from(SafetyStatus::from(n)), n);
            assert_ne!(SafetyStatus::from(n), SafetyStatus::Normal);
            assert_ne!(RobotMode::from(n), RobotMode::Running);
        }
        assert_eq!(RuntimeState::from(77).to_string(), "UNKNOWN(77)");
        for mode in RobotMode::KNOWN {
            assert_eq!(RobotMode::from(i32::from(*mode)), *mode);
        }
    }
}
