//! Names, parameters and kinds of the built-in functions.

/// How a built-in takes part in the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// A function of its arguments alone.
    Pure,
    /// Asks or tells the controller.
    World,
    /// Moves the arm: one thread at a time, and not from a secondary program.
    Motion,
}

/// One built-in function: its name as in the script manual.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Builtin {
    /// What scripts call it.
    pub name: &'static str,
    /// Parameter names, for arguments by name.
    pub parameters: &'static [&'static str],
    /// How many of them must be given.
    pub required: usize,
    pub(crate) role: Role,
}

impl std::fmt::Debug for Builtin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

const fn pure(name: &'static str, parameters: &'static [&'static str]) -> Builtin {
    Builtin { name, parameters, required: parameters.len(), role: Role::Pure }
}

const fn world(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
) -> Builtin {
    Builtin { name, parameters, required, role: Role::World }
}

const fn motion(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
) -> Builtin {
    Builtin { name, parameters, required, role: Role::Motion }
}

/// Every built-in that is modelled.
pub(crate) const BUILTINS: &[Builtin] = &[
    motion("movej", 1, &["q", "a", "v", "t", "r"]),
    motion("movel", 1, &["pose", "a", "v", "t", "r"]),
    motion("servoj", 1, &["q", "a", "v", "t", "lookahead_time", "gain"]),
    motion("speedj", 1, &["qd", "a", "t"]),
    motion("speedl", 1, &["xd", "a", "t", "aRot"]),
    motion("stopj", 1, &["a"]),
    motion("stopl", 1, &["a", "aRot"]),
    world("get_actual_joint_positions", 0, &[]),
    world("get_actual_joint_speeds", 0, &[]),
    world("get_target_joint_positions", 0, &[]),
    world("get_target_joint_speeds", 0, &[]),
    world("get_actual_tcp_pose", 0, &[]),
    world("get_target_tcp_pose", 0, &[]),
    world("get_actual_tool_flange_pose", 0, &[]),
    world("get_target_payload_inertia", 0, &[]),
    world("get_actual_tcp_speed", 0, &[]),
    world("get_target_tcp_speed", 0, &[]),
    world("get_tcp_force", 0, &[]),
    world("get_tcp_offset", 0, &[]),
    world("get_target_payload", 0, &[]),
    world("get_target_payload_cog", 0, &[]),
    world("get_steptime", 0, &[]),
    world("is_steady", 0, &[]),
    world("is_within_safety_limits", 1, &["pose"]),
    world("get_forward_kin", 0, &["q", "tcp"]),
    world("get_inverse_kin", 1, &["x", "qnear", "maxPositionError", "maxOrientationError", "tcp"]),
    world(
        "get_inverse_kin_has_solution",
        1,
        &["pose", "qnear", "maxPositionError", "maxOrientationError", "tcp"],
    ),
    world("zero_ftsensor", 0, &[]),
    world("set_payload", 1, &["m", "cog"]),
    world("set_payload_mass", 1, &["m"]),
    world("set_payload_cog", 1, &["CoG"]),
    world("set_target_payload", 2, &["m", "cog", "inertia", "transition_time"]),
    world("set_tcp", 1, &["pose", "tcp_name"]),
    world("set_gravity", 1, &["d"]),
    world("read_input_integer_register", 1, &["address"]),
    world("read_input_float_register", 1, &["address"]),
    world("read_input_boolean_register", 1, &["address"]),
    world("read_output_integer_register", 1, &["address"]),
    world("read_output_float_register", 1, &["address"]),
    world("read_output_boolean_register", 1, &["address"]),
    world("write_output_integer_register", 2, &["address", "value"]),
    world("write_output_float_register", 2, &["address", "value"]),
    world("write_output_boolean_register", 2, &["address", "value"]),
    world("rtde_set_watchdog", 2, &["variable_name", "min_frequency", "action"]),
    world("force_mode_set_damping", 1, &["damping"]),
    world("force_mode_set_gain_scaling", 1, &["scaling"]),
    world("textmsg", 1, &["s1", "s2"]),
    world("popup", 1, &["s", "title", "warning", "error", "blocking"]),
    world("protective_stop", 0, &[]),
    world("sleep", 1, &["t"]),
    world("sync", 0, &[]),
    world("random", 0, &[]),
    pure("acos", &["f"]),
    pure("asin", &["f"]),
    pure("atan", &["f"]),
    pure("atan2", &["x", "y"]),
    pure("ceil", &["f"]),
    pure("cos", &["f"]),
    pure("d2r", &["f"]),
    pure("floor", &["f"]),
    pure("get_list_length", &["v"]),
    pure("interpolate_pose", &["p_from", "p_to", "alpha"]),
    pure("length", &["v"]),
    pure("log", &["b", "f"]),
    pure("norm", &["a"]),
    pure("normalize", &["v"]),
    pure("point_dist", &["p_from", "p_to"]),
    pure("pose_add", &["p_1", "p_2"]),
    pure("pose_dist", &["p_from", "p_to"]),
    pure("pose_inv", &["p_from"]),
    pure("pose_sub", &["p_to", "p_from"]),
    pure("pose_trans", &["p_from", "p_from_to"]),
    pure("pow", &["base", "exponent"]),
    pure("r2d", &["f"]),
    pure("sin", &["f"]),
    pure("size", &["v"]),
    pure("sqrt", &["f"]),
    pure("str_at", &["src", "index"]),
    pure("str_cat", &["op1", "op2"]),
    pure("str_empty", &["str"]),
    pure("str_len", &["str"]),
    pure("tan", &["f"]),
    pure("to_num", &["str"]),
    pure("to_str", &["val"]),
    Builtin {
        name: "make_list",
        parameters: &["length", "initial_value", "capacity"],
        required: 2,
        role: Role::Pure,
    },
];

/// Real functions that a program may name without harm, and may not call: those that the control programs
/// of other clients name.
pub(crate) const NOT_MODELLED: &[&str] = &[
    "conveyor_pulse_decode",
    "direct_torque",
    "enable_external_ft_sensor",
    "encoder_get_tick_count",
    "end_force_mode",
    "end_freedrive_mode",
    "end_teach_mode",
    "end_screw_driving",
    "force",
    "force_mode",
    "freedrive_mode",
    "ft_rtde_input_enable",
    "get_actual_joint_positions_history",
    "get_coriolis_and_centrifugal_torques",
    "get_flag",
    "get_freedrive_status",
    "get_jacobian",
    "get_jacobian_time_derivative",
    "get_joint_torques",
    "get_mass_matrix",
    "get_standard_digital_in",
    "get_target_waypoint",
    "jac_dot",
    "movec",
    "movep",
    "path_offset_disable",
    "path_offset_enable",
    "path_offset_get",
    "path_offset_set",
    "path_offset_set_alpha_filter",
    "path_offset_set_max_offset",
    "request_boolean_from_primary_client",
    "servoc",
    "servol",
    "set_configurable_digital_out",
    "set_digital_out",
    "set_flag",
    "set_standard_analog_out",
    "set_standard_digital_out",
    "set_tool_digital_out",
    "set_tool_voltage",
    "socket_close",
    "socket_get_var",
    "socket_open",
    "socket_read_ascii_float",
    "socket_read_binary_integer",
    "socket_read_line",
    "socket_read_string",
    "socket_send_byte",
    "socket_send_int",
    "socket_send_line",
    "socket_send_string",
    "socket_set_var",
    "teach_mode",
    "tool_contact",
];

impl Builtin {
    pub(crate) fn named(name: &str) -> Option<&'static Self> {
        BUILTINS.iter().find(|b| b.name == name)
    }
}
