//! What a variable can hold.

use std::fmt;

/// A value. Lists and poses are copied when assigned.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Value {
    /// What a function without `return` gives, and an argument that was left out.
    #[default]
    None,
    /// `True` or `False`.
    Bool(bool),
    /// 32 bits, as on the controller.
    Int(i32),
    /// 64 bits.
    Float(f64),
    /// Text.
    Text(String),
    /// `[…]`.
    List(Vec<Self>),
    /// `p[x, y, z, rx, ry, rz]`: m and a rotation vector in rad.
    Pose([f64; 6]),
}

impl Value {
    /// A list of numbers.
    pub fn floats(values: impl IntoIterator<Item = f64>) -> Self {
        Self::List(values.into_iter().map(Self::Float).collect())
    }

    /// The number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Int(i) => Some(f64::from(*i)),
            Self::Float(x) => Some(*x),
            _ => None,
        }
    }

    /// Six numbers, from a list or a pose.
    pub fn six(&self) -> Option<[f64; 6]> {
        match self {
            Self::Pose(pose) => Some(*pose),
            Self::List(items) if items.len() == 6 => {
                let mut six = [0.0; 6];
                for (slot, item) in six.iter_mut().zip(items) {
                    *slot = item.number()?;
                }
                Some(six)
            }
            _ => None,
        }
    }

    /// What it is, in words.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::None => "no value",
            Self::Bool(_) => "a boolean",
            Self::Int(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "a string",
            Self::List(_) => "a list",
            Self::Pose(_) => "a pose",
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let separated = |f: &mut fmt::Formatter<'_>, items: &mut dyn Iterator<Item = String>| {
            for (i, item) in items.enumerate() {
                write!(f, "{}{item}", if i == 0 { "" } else { ", " })?;
            }
            f.write_str("]")
        };
        match self {
            Self::None => f.write_str("None"),
            Self::Bool(b) => f.write_str(if *b { "True" } else { "False" }),
            Self::Int(i) => write!(f, "{i}"),
            Self::Float(x) => f.write_str(&significant(*x)),
            Self::Text(text) => f.write_str(text),
            Self::List(items) => {
                f.write_str("[")?;
                separated(f, &mut items.iter().map(ToString::to_string))
            }
            Self::Pose(pose) => {
                f.write_str("p[")?;
                separated(f, &mut pose.iter().map(|x| significant(*x)))
            }
        }
    }
}

/// Six significant digits without trailing zeros, as C's `%g` prints.
fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let scientific = format!("{x:.5e}");
    let exponent: i32 =
        scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or_default();
    let trim = |digits: &str| {
        if digits.contains('.') {
            digits.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            digits.to_owned()
        }
    };
    if (-4..6).contains(&exponent) {
        return trim(&format!("{x:.*}", usize::try_from(5 - exponent).unwrap_or_default()));
    }
    let mantissa = scientific.split_once('e').map_or("", |(m, _)| m);
    format!("{}e{exponent:+03}", trim(mantissa))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_print_with_six_significant_digits() {
        for (x, text) in [
            (0.1 + 0.2, "0.3"),
            (1.0, "1"),
            (-1234.5678, "-1234.57"),
            (1e-5, "1e-05"),
            (123_456_789.0, "1.23457e+08"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
            (999_999.5, "1e+06"),
            (100_000.0, "100000"),
        ] {
            assert_eq!(Value::Float(x).to_string(), text);
        }
        let list = Value::List(vec![Value::Int(1), Value::Text("a".into()), Value::Bool(true)]);
        assert_eq!(list.to_string(), "[1, a, True]");
        assert_eq!(Value::Pose([0.5; 6]).to_string(), "p[0.5, 0.5, 0.5, 0.5, 0.5, 0.5]");
    }
}
