//! URDF → chain: fixed joints folded away, every axis turned to +z.

use std::path::Path;

use nalgebra::{SVector, Unit};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use urdf_rs::{Joint, JointType, Robot};

use crate::chain::{JointKind, JointLimits, Link, SerialChain};
use crate::error::ModelError;

impl<const N: usize> SerialChain<N> {
    /// Builds the chain from `base` to `tip` out of a URDF file.
    pub fn from_urdf_file(path: impl AsRef<Path>, base: &str, tip: &str) -> Result<Self, ModelError> {
        Self::from_urdf(&urdf_rs::read_file(path)?, base, tip)
    }

    /// Builds the chain from `base` to `tip` out of URDF text.
    pub fn from_urdf_str(text: &str, base: &str, tip: &str) -> Result<Self, ModelError> {
        Self::from_urdf(&urdf_rs::read_from_string(text)?, base, tip)
    }

    /// Builds the chain from `base` to `tip`.
    ///
    /// # Errors
    /// A missing link (with the links there are), a tip that is not below the base, a joint kind that a
    /// serial chain cannot have, a bad axis, frame or limit, or another number of joints than `N`.
    pub fn from_urdf(robot: &Robot, base: &str, tip: &str) -> Result<Self, ModelError> {
        let path = joints_between(robot, base, tip)?;
        let mut links = Vec::new();
        let mut names = Vec::new();
        let mut limits = Vec::new();
        // What lies between the last moving joint and the next: fixed joints, left to right.
        let mut pending = Pose::identity();
        for joint in path {
            pending *= origin(joint)?;
            let kind = match joint.joint_type {
                JointType::Fixed => continue,
                JointType::Revolute | JointType::Continuous => JointKind::Revolute,
                JointType::Prismatic => JointKind::Prismatic,
                ref other => return Err(unsupported(joint, format!("{other:?}").to_lowercase())),
            };
            if joint.mimic.is_some() {
                return Err(unsupported(joint, "a mimic joint".into()));
            }
            // Turn the frame so that the axis is +z; turn back after the joint.
            let align = Pose::from_parts(Vector3::zeros().into(), z_to(joint)?);
            links.push(Link { before: (pending * align).into(), kind });
            pending = align.inverse();
            names.push(joint.name.clone());
            limits.push(limit(joint)?);
        }
        let wrong = |found| ModelError::WrongDof { found, expected: N, names: names.clone() };
        let found = links.len();
        let links: [Link; N] = links.try_into().map_err(|_: Vec<Link>| wrong(found))?;
        let column = |f: fn(&[f64; 3]) -> f64| SVector::<f64, N>::from_fn(|i, _| f(&limits[i]));
        let limits = JointLimits { lower: column(|l| l[0]), upper: column(|l| l[1]), velocity: column(|l| l[2]) };
        Ok(Self::new(links, pending, limits, names))
    }
}

/// The joints from `base` down to `tip`, in that order.
fn joints_between<'a>(robot: &'a Robot, base: &str, tip: &str) -> Result<Vec<&'a Joint>, ModelError> {
    for name in [base, tip] {
        if !robot.links.iter().any(|l| l.name == name) {
            let links = robot.links.iter().map(|l| l.name.clone()).collect();
            return Err(ModelError::NoLink { name: name.into(), links });
        }
    }
    let mut path = Vec::new();
    let mut link = tip;
    while link != base {
        let Some(joint) = robot.joints.iter().find(|j| j.child.link == link) else {
            return Err(ModelError::NotConnected { base: base.into(), tip: tip.into() });
        };
        if path.len() > robot.joints.len() {
            return Err(ModelError::Loop(tip.into()));
        }
        path.push(joint);
        link = &joint.parent.link;
    }
    path.reverse();
    Ok(path)
}

fn origin(joint: &Joint) -> Result<Pose, ModelError> {
    let ([x, y, z], [roll, pitch, yaw]) = (*joint.origin.xyz, *joint.origin.rpy);
    if ![x, y, z, roll, pitch, yaw].iter().all(|v| v.is_finite()) {
        return Err(ModelError::BadJoint { joint: joint.name.clone(), what: "its origin is not finite".into() });
    }
    Ok(Pose::from_parts(Vector3::new(x, y, z).into(), UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
}

fn z_to(joint: &Joint) -> Result<UnitQuaternion, ModelError> {
    let axis = Vector3::from(*joint.axis.xyz);
    let bad = || ModelError::BadAxis { joint: joint.name.clone(), axis: *joint.axis.xyz };
    if !(axis.norm() > 1e-9 && axis.norm().is_finite()) {
        return Err(bad());
    }
    let axis = Unit::new_normalize(axis);
    // A half turn has no unique axis: any across z will do.
    Ok(UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)))
}

/// [lower, upper, velocity]; a continuous joint has no position limits, whatever its `limit` element says.
fn limit(joint: &Joint) -> Result<[f64; 3], ModelError> {
    let l = &joint.limit;
    let (lower, upper) = match joint.joint_type {
        JointType::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (l.lower, l.upper),
    };
    if !(lower < upper) {
        let what = format!("its limits [{lower}, {upper}] are empty");
        return Err(ModelError::BadJoint { joint: joint.name.clone(), what });
    }
    if !(l.velocity > 0.0) {
        let what = format!("its velocity limit is {}, but it must be positive", l.velocity);
        return Err(ModelError::BadJoint { joint: joint.name.clone(), what });
    }
    Ok([lower, upper, l.velocity])
}

fn unsupported(joint: &Joint, kind: String) -> ModelError {
    ModelError::UnsupportedJoint { joint: joint.name.clone(), kind }
}
