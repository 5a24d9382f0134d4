//! The variables that a client can write.

use palpate_ur::proto::{DataType, Value};

use super::numbered;
use crate::controller::Controller;

/// An input variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// `input_bit_registers0_to_31` and `32_to_63`, by the first bit.
    Word(usize),
    /// `input_bit_register_64` to `127`.
    Bit(usize),
    /// `input_int_register_0` to `47`.
    Int(usize),
    /// `input_double_register_0` to `47`.
    Float(usize),
    /// Any other, by its place in the table.
    Other(usize),
}

const OTHERS: &[(&str, DataType)] = &[
    ("speed_slider_mask", DataType::Uint32),
    ("speed_slider_fraction", DataType::Double),
    ("standard_digital_output_mask", DataType::Uint8),
    ("standard_digital_output", DataType::Uint8),
    ("configurable_digital_output_mask", DataType::Uint8),
    ("configurable_digital_output", DataType::Uint8),
    ("tool_digital_output_mask", DataType::Uint8),
    ("tool_digital_output", DataType::Uint8),
    ("standard_analog_output_mask", DataType::Uint8),
    ("standard_analog_output_type", DataType::Uint8),
    ("standard_analog_output_0", DataType::Double),
    ("standard_analog_output_1", DataType::Double),
    ("external_force_torque", DataType::Vector6d),
];

impl Input {
    /// The input of this name.
    pub fn named(name: &str) -> Option<Self> {
        if let Some(i) = numbered(name, "input_int_register_", 48) {
            return Some(Self::Int(i));
        }
        if let Some(i) = numbered(name, "input_double_register_", 48) {
            return Some(Self::Float(i));
        }
        if let Some(i) = numbered(name, "input_bit_register_", 128) {
            return (i >= 64).then_some(Self::Bit(i));
        }
        match name {
            "input_bit_registers0_to_31" => Some(Self::Word(0)),
            "input_bit_registers32_to_63" => Some(Self::Word(32)),
            _ => OTHERS.iter().position(|(n, _)| *n == name).map(Self::Other),
        }
    }

    /// Its type.
    pub fn data_type(self) -> DataType {
        match self {
            Self::Word(_) => DataType::Uint32,
            Self::Bit(_) => DataType::Bool,
            Self::Int(_) => DataType::Int32,
            Self::Float(_) => DataType::Double,
            Self::Other(i) => OTHERS[i].1,
        }
    }
}

/// The other inputs of one data packet: a mask and its values act together.
#[derive(Debug, Default)]
pub(crate) struct Masked {
    values: [Option<Value>; OTHERS.len()],
}

impl Masked {
    fn byte(&self, name: &str) -> Option<u8> {
        match self.get(name) {
            Some(Value::Uint8(byte)) => Some(byte),
            _ => None,
        }
    }

    fn get(&self, name: &str) -> Option<Value> {
        OTHERS.iter().position(|(n, _)| *n == name).and_then(|i| self.values[i])
    }

    fn double(&self, name: &str) -> Option<f64> {
        match self.get(name) {
            Some(Value::Double(x)) if x.is_finite() => Some(x),
            _ => None,
        }
    }
}

impl Controller {
    /// Writes one register, or keeps another input for [`apply_masked`](Self::apply_masked).
    pub(crate) fn write_input(&mut self, input: Input, value: Value, masked: &mut Masked) {
        let bank = &mut self.registers.input;
        match (input, value) {
            (Input::Word(first), Value::Uint32(word)) => bank.set_word(first, word),
            (Input::Bit(i), Value::Bool(b)) => bank.bits[i] = b,
            (Input::Int(i), Value::Int32(n)) => bank.ints[i] = n,
            (Input::Float(i), Value::Double(x)) => bank.floats[i] = x,
            (Input::Other(i), value) => masked.values[i] = Some(value),
            _ => {}
        }
    }

    /// Slider and outputs, where their masks say so.
    pub(crate) fn apply_masked(&mut self, masked: &Masked) {
        if let (Some(Value::Uint32(1..)), Some(fraction)) =
            (masked.get("speed_slider_mask"), masked.double("speed_slider_fraction"))
        {
            self.set_slider(fraction);
        }
        for (name, shift) in [
            ("standard_digital_output", 0),
            ("configurable_digital_output", 8),
            ("tool_digital_output", 16),
        ] {
            if let (Some(mask), Some(bits)) =
                (masked.byte(&format!("{name}_mask")), masked.byte(name))
            {
                let mask = u64::from(mask) << shift;
                let bits = u64::from(bits) << shift;
                self.digital_outputs = self.digital_outputs & !mask | bits & mask;
            }
        }
        if let Some(mask) = masked.byte("standard_analog_output_mask") {
            for (i, name) in
                ["standard_analog_output_0", "standard_analog_output_1"].iter().enumerate()
            {
                if let Some(ratio) = masked.double(name).filter(|_| mask >> i & 1 == 1) {
                    self.analog_outputs[i] = ratio.clamp(0.0, 1.0);
                }
            }
        }
    }

    /// An input's present value, as outputs report it.
    pub(crate) fn read_input(&self, input: Input) -> Value {
        let bank = &self.registers.input;
        match input {
            Input::Word(first) => Value::Uint32(bank.word(first)),
            Input::Bit(i) => Value::Bool(bank.bits[i]),
            Input::Int(i) => Value::Int32(bank.ints[i]),
            Input::Float(i) => Value::Double(bank.floats[i]),
            Input::Other(i) => OTHERS[i].1.zero(),
        }
    }
}
