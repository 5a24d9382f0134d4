//! Built-ins that depend on their arguments alone.

use palpate_spatial::Pose;

use super::error::ErrorKind;
use super::ops::LENGTH_MAX;
use super::poses::{pose_to_value, value_to_pose};
use super::value::Value;

/// Longest string, bytes.
const TEXT_MAX: usize = 4096;

type Fallible<T> = Result<T, String>;

pub(crate) fn call(name: &'static str, arguments: &[Value]) -> Result<Value, ErrorKind> {
    evaluate(name, arguments).map_err(|problem| ErrorKind::Builtin { function: name, problem })
}

fn evaluate(name: &str, arguments: &[Value]) -> Fallible<Value> {
    let first = arguments.first().unwrap_or(&Value::None);
    let second = arguments.get(1).unwrap_or(&Value::None);
    Ok(match name {
        "acos" => Value::Float(within(number(first)?, 1.0)?.acos()),
        "asin" => Value::Float(within(number(first)?, 1.0)?.asin()),
        "atan" => Value::Float(number(first)?.atan()),
        "atan2" => Value::Float(number(first)?.atan2(number(second)?)),
        "ceil" => whole(number(first)?.ceil())?,
        "floor" => whole(number(first)?.floor())?,
        "cos" => Value::Float(number(first)?.cos()),
        "sin" => Value::Float(number(first)?.sin()),
        "tan" => Value::Float(number(first)?.tan()),
        "d2r" => Value::Float(number(first)?.to_radians()),
        "r2d" => Value::Float(number(first)?.to_degrees()),
        "log" => Value::Float(number(second)?.log(number(first)?)),
        "pow" => Value::Float(number(first)?.powf(number(second)?)),
        "sqrt" => match number(first)? {
            x if x >= 0.0 => Value::Float(x.sqrt()),
            x => return Err(format!("{x} has no square root")),
        },
        "norm" => norm(first)?,
        "normalize" => {
            let v = numbers(first)?;
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length <= 0.0 || length.is_nan() {
                return Err("a vector of length zero has no direction".into());
            }
            Value::floats(v.into_iter().map(|x| x / length))
        }
        "length" | "size" | "get_list_length" => count(match first {
            Value::List(items) => items.len(),
            Value::Pose(_) => 6,
            Value::Text(text) => text.len(),
            other => return Err(format!("{} has no length", other.kind())),
        })?,
        "make_list" => {
            let length = index(first)?;
            if length > LENGTH_MAX {
                return Err(format!("{length} elements, more than {LENGTH_MAX}"));
            }
            Value::List(vec![second.clone(); length])
        }
        "interpolate_pose" => {
            let (a, b) = (pose(first)?, pose(second)?);
            let alpha = number(arguments.get(2).unwrap_or(&Value::None))?;
            // From a, a part of the way to b, position and attitude each on its shortest path.
            let way = a.inv_mul(&b);
            let turned = way.rotation.scaled_axis() * alpha;
            let part = Pose::from_parts(
                (way.translation.vector * alpha).into(),
                palpate_spatial::UnitQuaternion::from_scaled_axis(turned),
            );
            of_pose(&(a * part))
        }
        "point_dist" => {
            let (a, b) = (pose(first)?, pose(second)?);
            Value::Float((a.translation.vector - b.translation.vector).norm())
        }
        "pose_dist" => {
            let d = pose_to_value(&pose(first)?.inv_mul(&pose(second)?));
            Value::Float(d.iter().map(|x| x * x).sum::<f64>().sqrt())
        }
        // Positions add in the common frame, rotations compose (script manual).
        "pose_add" => {
            let (a, b) = (pose(first)?, pose(second)?);
            let position = a.translation.vector + b.translation.vector;
            of_pose(&Pose::from_parts(position.into(), a.rotation * b.rotation))
        }
        "pose_sub" => {
            let (to, from) = (pose(first)?, pose(second)?);
            let position = to.translation.vector - from.translation.vector;
            of_pose(&Pose::from_parts(position.into(), to.rotation * from.rotation.inverse()))
        }
        "pose_inv" => of_pose(&pose(first)?.inverse()),
        "pose_trans" => of_pose(&(pose(first)? * pose(second)?)),
        "to_str" => Value::Text(limited(first.to_string())?),
        "to_num" => {
            let text = text(first)?.trim();
            let float = || text.parse().ok().map(Value::Float);
            let value = text.parse().ok().map(Value::Int).or_else(float);
            value.ok_or_else(|| format!("{text:?} is no number"))?
        }
        "str_at" => {
            let (text, i) = (text(first)?, index(second)?);
            let found = text.get(i..=i).ok_or_else(|| format!("index {i} of {} bytes", text.len()));
            Value::Text(found?.to_owned())
        }
        "str_cat" => Value::Text(limited(format!("{first}{second}"))?),
        "str_empty" => Value::Bool(text(first)?.is_empty()),
        "str_len" => count(text(first)?.len())?,
        _ => return Err("has no definition".into()),
    })
}

/// The magnitude of a number, the length of a list or of a pose's position.
fn norm(value: &Value) -> Fallible<Value> {
    let squares = |items: &[f64]| items.iter().map(|x| x * x).sum::<f64>().sqrt();
    Ok(match value {
        Value::Int(i) => Value::Int(i.checked_abs().ok_or("integer overflow")?),
        Value::Float(x) => Value::Float(x.abs()),
        Value::Pose(p) => Value::Float(squares(&p[..3])),
        list => Value::Float(squares(&numbers(list)?)),
    })
}

fn limited(text: String) -> Fallible<String> {
    if text.len() > TEXT_MAX {
        return Err(format!("{} bytes, more than {TEXT_MAX}", text.len()));
    }
    Ok(text)
}

fn count(n: usize) -> Fallible<Value> {
    i32::try_from(n).map(Value::Int).or(Err("too long".into()))
}

fn whole(x: f64) -> Fallible<Value> {
    if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&x) {
        return Err(format!("{x} fits no 32-bit integer"));
    }
    Ok(Value::Int(x as i32))
}

fn within(x: f64, bound: f64) -> Fallible<f64> {
    if !(-bound..=bound).contains(&x) {
        return Err(format!("{x} is not in [-{bound}, {bound}]"));
    }
    Ok(x)
}

pub(crate) fn number(value: &Value) -> Fallible<f64> {
    value.number().ok_or_else(|| format!("expected a number, got {}", value.kind()))
}

fn numbers(value: &Value) -> Fallible<Vec<f64>> {
    match value {
        Value::List(items) => items.iter().map(number).collect(),
        other => Err(format!("expected a list of numbers, got {}", other.kind())),
    }
}

fn text(value: &Value) -> Fallible<&str> {
    match value {
        Value::Text(text) => Ok(text),
        other => Err(format!("expected a string, got {}", other.kind())),
    }
}

fn index(value: &Value) -> Fallible<usize> {
    match value {
        Value::Int(i) if *i >= 0 => Ok(*i as usize),
        other => Err(format!("expected a count, got {other}")),
    }
}

fn pose(value: &Value) -> Fallible<Pose> {
    match value {
        Value::Pose(p) => Ok(value_to_pose(p)),
        other => Err(format!("expected a pose p[…], got {}", other.kind())),
    }
}

fn of_pose(pose: &Pose) -> Value {
    Value::Pose(pose_to_value(pose))
}
