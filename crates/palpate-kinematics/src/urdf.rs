//! URDF → chain.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must be refused")]

use std::path::Path;

use nalgebra::Unit;
use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use urdf_rs::{Joint, JointType, Robot};

use crate::builder::{ChainBuilder, Limit};
use crate::chain::{JointKind, SerialChain};
use crate::error::ModelError;

impl<const N: usize> SerialChain<N> {
    /// Builds the chain from `base` to `tip` out of a URDF file.
    ///
    /// # Errors
    /// As [`from_urdf`](Self::from_urdf), or a file that cannot be read as a URDF.
    pub fn from_urdf_file(
        path: impl AsRef<Path>,
        base: &str,
        tip: &str,
    ) -> Result<Self, ModelError> {
        Self::from_urdf(&urdf_rs::read_file(path)?, base, tip)
    }

    /// Builds the chain from `base` to `tip` out of URDF text.
    ///
    /// # Errors
    /// As [`from_urdf`](Self::from_urdf), or a text that is not a URDF.
    pub fn from_urdf_str(text: &str, base: &str, tip: &str) -> Result<Self, ModelError> {
        Self::from_urdf(&urdf_rs::read_from_string(text)?, base, tip)
    }

    /// Builds the chain from link `base` to link `tip`, wherever in the tree they are.
    ///
    /// Revolute, continuous, prismatic and fixed joints about any axis. A calibrated arm is a URDF with
    /// calibrated joint origins; nothing here assumes parallel or intersecting axes.
    ///
    /// ```
    /// # use palpate_kinematics::SerialChain;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let error = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool").unwrap_err();
    /// assert!(error.to_string().starts_with("the URDF has no link `tool`; did you mean `tool0`?"));
    /// ```
    ///
    /// # Errors
    /// A missing link (with the links there are), a tip that is not below the base, a joint kind that a
    /// serial chain cannot have, a bad axis, frame or limit, or another number of joints than `N`.
    pub fn from_urdf(robot: &Robot, base: &str, tip: &str) -> Result<Self, ModelError> {
        let mut chain = ChainBuilder::new();
        for joint in joints_between(robot, base, tip)? {
            chain.fixed(&origin(joint)?);
            let kind = match joint.joint_type {
                JointType::Fixed => continue,
                JointType::Revolute | JointType::Continuous => JointKind::Revolute,
                JointType::Prismatic => JointKind::Prismatic,
                JointType::Floating => return Err(unsupported(joint, "a floating joint")),
                JointType::Planar => return Err(unsupported(joint, "a planar joint")),
                JointType::Spherical => return Err(unsupported(joint, "a spherical joint")),
            };
            if joint.mimic.is_some() {
                return Err(unsupported(joint, "a mimic joint"));
            }
            chain.joint(&joint.name, kind, z_to_axis(joint)?, limit(joint)?);
        }
        chain.finish()
    }
}

/// The joints from `base` down to `tip`, in that order.
fn joints_between<'a>(
    robot: &'a Robot,
    base: &str,
    tip: &str,
) -> Result<Vec<&'a Joint>, ModelError> {
    for name in [base, tip] {
        if !robot.links.iter().any(|l| l.name == name) {
            return Err(ModelError::no_link(
                name,
                robot.links.iter().map(|l| l.name.clone()).collect(),
            ));
        }
    }
    let mut path = Vec::new();
    let mut link = tip;
    while link != base {
        let mut above = robot.joints.iter().filter(|j| j.child.link == link);
        let Some(joint) = above.next() else {
            return Err(ModelError::NotConnected { base: base.into(), tip: tip.into() });
        };
        if above.next().is_some() {
            return Err(ModelError::TwoParents(link.into()));
        }
        if path.len() == robot.joints.len() {
            return Err(ModelError::Loop(tip.into()));
        }
        path.push(joint);
        link = &joint.parent.link;
    }
    path.reverse();
    Ok(path)
}

/// Fixed-axis roll, pitch, yaw, as the URDF specification has it: R = Rz(yaw)·Ry(pitch)·Rx(roll).
fn origin(joint: &Joint) -> Result<Pose, ModelError> {
    let ([x, y, z], [roll, pitch, yaw]) = (*joint.origin.xyz, *joint.origin.rpy);
    if ![x, y, z, roll, pitch, yaw].iter().all(|v| v.is_finite()) {
        return Err(bad(joint, "its origin is not finite".into()));
    }
    Ok(Pose::from_parts(
        Vector3::new(x, y, z).into(),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    ))
}

fn z_to_axis(joint: &Joint) -> Result<UnitQuaternion, ModelError> {
    let axis = Vector3::from(*joint.axis.xyz);
    let norm = axis.norm();
    if !(norm > 1e-9 && norm.is_finite()) {
        return Err(bad(joint, format!("its axis {:?} has no direction", *joint.axis.xyz)));
    }
    let axis = Unit::new_unchecked(axis / norm);
    // A half turn has no unique axis: any across z will do.
    Ok(UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &axis).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    }))
}

/// A continuous joint has no position limits, whatever its `limit` element says.
fn limit(joint: &Joint) -> Result<Limit, ModelError> {
    let l = &joint.limit;
    let (lower, upper) = match joint.joint_type {
        JointType::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (l.lower, l.upper),
    };
    if !(lower < upper) {
        return Err(bad(
            joint,
            format!("its position limits [{lower}, {upper}] are empty or missing"),
        ));
    }
    if !(l.velocity > 0.0) {
        return Err(bad(joint, format!("its velocity limit must be positive, not {}", l.velocity)));
    }
    Ok(Limit { lower, upper, velocity: l.velocity })
}

fn unsupported(joint: &Joint, kind: &'static str) -> ModelError {
    ModelError::UnsupportedJoint { joint: joint.name.clone(), kind }
}

fn bad(joint: &Joint, what: String) -> ModelError {
    ModelError::BadJoint { joint: joint.name.clone(), what }
}
