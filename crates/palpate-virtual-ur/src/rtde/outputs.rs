//! The variables that the controller sends.
//!
//! Names and types are those of the RTDE guide for e-Series. What the arm does not model (temperatures,
//! currents, voltages) has a plausible constant value.

use palpate_ur::proto::{DataType, RuntimeState, Value};

use super::inputs::Input;
use super::numbered;
use crate::controller::Controller;

/// An output variable.
#[derive(Clone, Copy)]
pub enum Output {
    /// `output_bit_registers0_to_31` and `32_to_63`, by the first bit.
    Word(usize),
    /// `output_bit_register_64` to `127`.
    Bit(usize),
    /// `output_int_register_0` to `47`.
    Int(usize),
    /// `output_double_register_0` to `47`.
    Float(usize),
    /// An input, read back.
    Input(Input),
    /// Any other, by its place in the table.
    Other(usize),
}

impl std::fmt::Debug for Output {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Word(i) => write!(f, "Word({i})"),
            Self::Bit(i) => write!(f, "Bit({i})"),
            Self::Int(i) => write!(f, "Int({i})"),
            Self::Float(i) => write!(f, "Float({i})"),
            Self::Input(input) => write!(f, "{input:?}"),
            Self::Other(i) => f.write_str(OUTPUT_NAMES[*i].0),
        }
    }
}

type Read = fn(&Controller) -> Value;

const fn double(x: f64) -> Value {
    Value::Double(x)
}

/// Outputs other than registers: name, type, how to read them.
pub const OUTPUT_NAMES: &[(&str, DataType, Read)] = &[
    ("timestamp", DataType::Double, |c| double(c.time())),
    ("control_step", DataType::Uint64, |c| Value::Uint64(c.tick)),
    ("target_q", DataType::Vector6d, |c| Value::Vector6d(c.target.q.into())),
    ("target_qd", DataType::Vector6d, |c| Value::Vector6d(c.target.dq.into())),
    ("target_qdd", DataType::Vector6d, |c| Value::Vector6d(c.ddq_target.into())),
    ("target_current", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("target_moment", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("actual_q", DataType::Vector6d, |c| Value::Vector6d(c.actual.q.into())),
    ("actual_qd", DataType::Vector6d, |c| Value::Vector6d(c.actual.dq.into())),
    ("actual_current", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("actual_current_window", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("actual_current_as_torque", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("joint_control_output", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("actual_TCP_pose", DataType::Vector6d, |c| Value::Vector6d(c.actual.tcp)),
    ("target_TCP_pose", DataType::Vector6d, |c| Value::Vector6d(c.target.tcp)),
    ("actual_TCP_speed", DataType::Vector6d, |c| Value::Vector6d(c.actual.tcp_speed)),
    ("target_TCP_speed", DataType::Vector6d, |c| Value::Vector6d(c.target.tcp_speed)),
    ("actual_TCP_force", DataType::Vector6d, |c| Value::Vector6d(c.tcp_force())),
    ("ft_raw_wrench", DataType::Vector6d, |c| Value::Vector6d(c.sensor.raw.into())),
    ("wrench_calc_from_currents", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("tcp_force_scalar", DataType::Double, |c| {
        double(c.tcp_force()[..3].iter().map(|x| x * x).sum::<f64>().sqrt())
    }),
    ("tcp_offset", DataType::Vector6d, |c| Value::Vector6d(c.arm.tcp_offset())),
    ("payload", DataType::Double, |c| double(c.payload)),
    ("payload_cog", DataType::Vector3d, |c| Value::Vector3d(c.payload_cog)),
    ("payload_inertia", DataType::Vector6d, |_| Value::Vector6d([0.0; 6])),
    ("actual_tool_accelerometer", DataType::Vector3d, |_| Value::Vector3d([0.0, 0.0, 9.82])),
    ("joint_temperatures", DataType::Vector6d, |_| Value::Vector6d([28.0; 6])),
    ("actual_joint_voltage", DataType::Vector6d, |_| Value::Vector6d([47.5; 6])),
    // 253 is JOINT_RUNNING_MODE, 239 POWER_OFF.
    ("joint_mode", DataType::Vector6Int32, |c| {
        let running = c.robot_mode == palpate_ur::proto::RobotMode::Running;
        Value::Vector6Int32([if running { 253 } else { 239 }; 6])
    }),
    ("robot_mode", DataType::Int32, |c| Value::Int32(c.robot_mode.into())),
    ("safety_mode", DataType::Int32, |c| Value::Int32(c.safety.into())),
    ("safety_status", DataType::Int32, |c| Value::Int32(c.safety.into())),
    ("robot_status_bits", DataType::Uint32, |c| Value::Uint32(c.robot_status_bits())),
    ("safety_status_bits", DataType::Uint32, |c| Value::Uint32(c.safety_status_bits())),
    ("runtime_state", DataType::Uint32, |c| Value::Uint32(c.runtime.into())),
    ("script_control_line", DataType::Uint32, |c| {
        Value::Uint32(if c.runtime == RuntimeState::Playing { c.control_line } else { 0 })
    }),
    ("speed_scaling", DataType::Double, |c| double(c.scaling)),
    ("target_speed_fraction", DataType::Double, |c| double(c.slider)),
    ("actual_execution_time", DataType::Double, |_| double(0.4)),
    ("target_execution_time", DataType::Double, |_| double(0.4)),
    ("actual_momentum", DataType::Double, |_| double(0.0)),
    ("joint_position_deviation_ratio", DataType::Double, |c| {
        double((c.target.q - c.actual.q).amax() / c.config.limits.deviation)
    }),
    ("collision_detection_ratio", DataType::Double, |_| double(0.0)),
    ("time_scale_source", DataType::Int32, |_| Value::Int32(0)),
    ("target_gravity", DataType::Vector3d, |c| Value::Vector3d(c.gravity)),
    ("elbow_position", DataType::Vector3d, |_| Value::Vector3d([0.0; 3])),
    ("elbow_velocity", DataType::Vector3d, |_| Value::Vector3d([0.0; 3])),
    ("actual_main_voltage", DataType::Double, |_| double(47.8)),
    ("actual_robot_voltage", DataType::Double, |_| double(47.8)),
    ("actual_robot_current", DataType::Double, |_| double(0.6)),
    ("io_current", DataType::Double, |_| double(0.0)),
    ("actual_digital_input_bits", DataType::Uint64, |_| Value::Uint64(0)),
    ("actual_digital_output_bits", DataType::Uint64, |c| Value::Uint64(c.digital_outputs)),
    ("analog_io_types", DataType::Uint32, |_| Value::Uint32(0)),
    ("standard_analog_input0", DataType::Double, |_| double(0.0)),
    ("standard_analog_input1", DataType::Double, |_| double(0.0)),
    ("standard_analog_output0", DataType::Double, |c| double(c.analog_outputs[0])),
    ("standard_analog_output1", DataType::Double, |c| double(c.analog_outputs[1])),
    ("tool_mode", DataType::Uint32, |_| Value::Uint32(253)),
    ("tool_analog_input_types", DataType::Uint32, |_| Value::Uint32(0)),
    ("tool_analog_input0", DataType::Double, |_| double(0.0)),
    ("tool_analog_input1", DataType::Double, |_| double(0.0)),
    ("tool_output_current", DataType::Double, |_| double(0.0)),
    ("tool_temperature", DataType::Double, |_| double(28.0)),
    ("tool_output_voltage", DataType::Int32, |_| Value::Int32(0)),
    ("tool_output_mode", DataType::Uint8, |_| Value::Uint8(0)),
    ("tool_digital_output0_mode", DataType::Uint8, |_| Value::Uint8(0)),
    ("tool_digital_output1_mode", DataType::Uint8, |_| Value::Uint8(0)),
];

impl Output {
    /// The output of this name.
    pub fn named(name: &str) -> Option<Self> {
        if let Some(i) = numbered(name, "output_int_register_", 48) {
            return Some(Self::Int(i));
        }
        if let Some(i) = numbered(name, "output_double_register_", 48) {
            return Some(Self::Float(i));
        }
        if let Some(i) = numbered(name, "output_bit_register_", 128) {
            return (i >= 64).then_some(Self::Bit(i));
        }
        match name {
            "output_bit_registers0_to_31" => return Some(Self::Word(0)),
            "output_bit_registers32_to_63" => return Some(Self::Word(32)),
            _ => {}
        }
        if name.starts_with("input_") {
            return Input::named(name).map(Self::Input);
        }
        OUTPUT_NAMES.iter().position(|(n, ..)| *n == name).map(Self::Other)
    }

    /// Its type.
    pub fn data_type(self) -> DataType {
        match self {
            Self::Word(_) => DataType::Uint32,
            Self::Bit(_) => DataType::Bool,
            Self::Int(_) => DataType::Int32,
            Self::Float(_) => DataType::Double,
            Self::Input(input) => input.data_type(),
            Self::Other(i) => OUTPUT_NAMES[i].1,
        }
    }

    /// Its value now.
    pub fn value(self, controller: &Controller) -> Value {
        let bank = &controller.registers.output;
        match self {
            Self::Word(first) => Value::Uint32(bank.word(first)),
            Self::Bit(i) => Value::Bool(bank.bits[i]),
            Self::Int(i) => Value::Int32(bank.ints[i]),
            Self::Float(i) => Value::Double(bank.floats[i]),
            Self::Input(input) => controller.read_input(input),
            Self::Other(i) => OUTPUT_NAMES[i].2(controller),
        }
    }
}
