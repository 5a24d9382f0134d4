//! Arithmetic, comparison, indices.

use super::ast::{Binary, Unary};
use super::error::ErrorKind;
use super::value::Value;

/// Elements a list may have.
pub(crate) const LENGTH_MAX: usize = 1024;

pub(crate) fn unary(operator: Unary, operand: &Value) -> Result<Value, ErrorKind> {
    match (operator, operand) {
        (Unary::Not, Value::Bool(b)) => Ok(Value::Bool(!b)),
        (Unary::Minus, Value::Int(i)) => i.checked_neg().map(Value::Int).ok_or(OVERFLOW),
        (Unary::Minus, Value::Float(x)) => Ok(Value::Float(-x)),
        (Unary::Minus, Value::List(items)) => {
            items.iter().map(|i| unary(operator, i)).collect::<Result<_, _>>().map(Value::List)
        }
        (Unary::Not, other) => Err(mismatch("apply not to", other.kind().into())),
        (Unary::Minus, other) => Err(mismatch("negate", other.kind().into())),
    }
}

const OVERFLOW: ErrorKind = ErrorKind::Arithmetic("integer overflow: integers have 32 bits");
const BY_ZERO: ErrorKind = ErrorKind::Arithmetic("division by zero");

fn mismatch(what: &'static str, values: String) -> ErrorKind {
    ErrorKind::Type { what, values }
}

pub(crate) fn binary(operator: Binary, left: &Value, right: &Value) -> Result<Value, ErrorKind> {
    match operator {
        Binary::Equal => return equal(left, right).map(Value::Bool),
        Binary::NotEqual => return equal(left, right).map(|e| Value::Bool(!e)),
        Binary::Less | Binary::LessEqual | Binary::Greater | Binary::GreaterEqual => {
            return ordered(operator, left, right).map(Value::Bool);
        }
        Binary::Xor => {
            return match (left, right) {
                (Value::Bool(a), Value::Bool(b)) => Ok(Value::Bool(a ^ b)),
                _ => Err(pair("combine with xor", left, right)),
            };
        }
        _ => {}
    }
    match (left, right) {
        (Value::Int(a), Value::Int(b)) if operator != Binary::Divide => integer(operator, *a, *b),
        (Value::List(a), Value::List(b))
            if a.len() == b.len() && matches!(operator, Binary::Add | Binary::Subtract) =>
        {
            let sums = a.iter().zip(b).map(|(a, b)| binary(operator, a, b));
            sums.collect::<Result<_, _>>().map(Value::List)
        }
        (Value::List(items), scale) if scales(operator, scale) => {
            let scaled = items.iter().map(|i| binary(operator, i, scale));
            scaled.collect::<Result<_, _>>().map(Value::List)
        }
        (scale, Value::List(items)) if operator == Binary::Multiply && scales(operator, scale) => {
            let scaled = items.iter().map(|i| binary(operator, scale, i));
            scaled.collect::<Result<_, _>>().map(Value::List)
        }
        _ => match (left.number(), right.number()) {
            (Some(a), Some(b)) => float(operator, a, b),
            _ => Err(pair(verb(operator), left, right)),
        },
    }
}

fn scales(operator: Binary, scale: &Value) -> bool {
    matches!(operator, Binary::Multiply | Binary::Divide) && scale.number().is_some()
}

fn verb(operator: Binary) -> &'static str {
    match operator {
        Binary::Add => "add",
        Binary::Subtract => "subtract",
        Binary::Multiply => "multiply",
        Binary::Divide | Binary::Remainder => "divide",
        _ => "compare",
    }
}

fn pair(what: &'static str, left: &Value, right: &Value) -> ErrorKind {
    mismatch(what, format!("{} and {}", left.kind(), right.kind()))
}

fn integer(operator: Binary, a: i32, b: i32) -> Result<Value, ErrorKind> {
    match operator {
        Binary::Add => a.checked_add(b),
        Binary::Subtract => a.checked_sub(b),
        Binary::Multiply => a.checked_mul(b),
        _ if b == 0 => return Err(BY_ZERO),
        _ => a.checked_rem(b),
    }
    .map(Value::Int)
    .ok_or(OVERFLOW)
}

/// A quotient is a float, of integers too.
fn float(operator: Binary, a: f64, b: f64) -> Result<Value, ErrorKind> {
    Ok(Value::Float(match operator {
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        _ if b == 0.0 => return Err(BY_ZERO),
        Binary::Divide => a / b,
        _ => a % b,
    }))
}

/// Numbers compare by value, other things with their own kind only.
fn equal(left: &Value, right: &Value) -> Result<bool, ErrorKind> {
    match (left, right) {
        (Value::List(a), Value::List(b)) => {
            if a.len() != b.len() {
                return Ok(false);
            }
            for (a, b) in a.iter().zip(b) {
                if !equal(a, b)? {
                    return Ok(false);
                }
            }
            Ok(true)
        }
        (Value::Bool(a), Value::Bool(b)) => Ok(a == b),
        (Value::Text(a), Value::Text(b)) => Ok(a == b),
        (Value::Pose(a), Value::Pose(b)) => Ok(a == b),
        _ => match (left.number(), right.number()) {
            (Some(a), Some(b)) => Ok(a == b),
            _ => Err(pair("compare", left, right)),
        },
    }
}

fn ordered(operator: Binary, left: &Value, right: &Value) -> Result<bool, ErrorKind> {
    let (Some(a), Some(b)) = (left.number(), right.number()) else {
        return Err(pair("compare", left, right));
    };
    Ok(match operator {
        Binary::Less => a < b,
        Binary::LessEqual => a <= b,
        Binary::Greater => a > b,
        _ => a >= b,
    })
}

fn position(index: &Value, length: usize) -> Result<usize, ErrorKind> {
    let Value::Int(i) = *index else {
        return Err(mismatch("index with", index.kind().into()));
    };
    usize::try_from(i).ok().filter(|p| *p < length).ok_or(ErrorKind::Index { index: i, length })
}

/// `list[index]`.
pub(crate) fn element(list: &Value, index: &Value) -> Result<Value, ErrorKind> {
    match list {
        Value::List(items) => Ok(items[position(index, items.len())?].clone()),
        Value::Pose(pose) => Ok(Value::Float(pose[position(index, 6)?])),
        other => Err(mismatch("index", other.kind().into())),
    }
}

/// `list[i][j]… = value`.
pub(crate) fn set_element(
    list: &mut Value,
    indices: &[Value],
    value: Value,
) -> Result<(), ErrorKind> {
    let Some((index, deeper)) = indices.split_first() else {
        *list = value;
        return Ok(());
    };
    match list {
        Value::List(items) => {
            let position = position(index, items.len())?;
            set_element(&mut items[position], deeper, value)
        }
        Value::Pose(pose) => match (value.number(), deeper) {
            (Some(x), []) => {
                pose[position(index, 6)?] = x;
                Ok(())
            }
            _ => Err(mismatch("put into a pose", value.kind().into())),
        },
        other => Err(mismatch("index", other.kind().into())),
    }
}
