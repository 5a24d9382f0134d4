//! Force and torque.

use crate::{UnitQuaternion, Vector3, Vector6};

/// Force and torque, in the axes and about the point the name says.
///
/// Contact wrenches in this project are what the **environment does to the tool**: a tool pressed
/// down on a table feels a force up.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Wrench {
    /// Force, N.
    pub force: Vector3,
    /// Torque, N·m.
    pub torque: Vector3,
}

impl Wrench {
    /// Builds a wrench from force (N) and torque (N·m).
    pub fn new(force: Vector3, torque: Vector3) -> Self {
        Self { force, torque }
    }

    /// No load.
    pub fn zero() -> Self {
        Self::default()
    }

    /// (f, τ) as one six-vector.
    pub fn vector(&self) -> Vector6 {
        let (f, t) = (self.force, self.torque);
        Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z)
    }

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.force.iter().chain(&self.torque).all(|x| x.is_finite())
    }

    /// The same wrench about the same point, in the axes of `parent` given `parent_R_child`.
    pub fn rotated(&self, parent_R_child: &UnitQuaternion) -> Self {
        Self::new(parent_R_child * self.force, parent_R_child * self.torque)
    }

    /// The same load about a point displaced by `offset` (m, same axes): τ' = τ − offset × f.
    pub fn about(&self, offset: &Vector3) -> Self {
        Self::new(self.force, self.torque - offset.cross(&self.force))
    }
}

impl From<Vector6> for Wrench {
    fn from(v: Vector6) -> Self {
        Self::new(v.fixed_rows::<3>(0).into(), v.fixed_rows::<3>(3).into())
    }
}

impl std::ops::Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.force + other.force, self.torque + other.torque)
    }
}

impl std::ops::Sub for Wrench {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.force - other.force, self.torque - other.torque)
    }
}

impl std::ops::Mul<f64> for Wrench {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self::new(self.force * k, self.torque * k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moving_the_reference_point_removes_the_lever_arm() {
        // A force at the tool tip, 0.15 m along z from the sensor, seen by the sensor as a torque.
        let tip = Vector3::new(0.0, 0.0, 0.15);
        let force = Vector3::new(4.0, -2.0, 7.0);
        let at_sensor = Wrench::new(force, tip.cross(&force));
        assert!(at_sensor.about(&tip).torque.norm() < 1e-15);
        assert!((at_sensor.torque - Vector3::new(0.3, 0.6, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn power_is_the_same_in_every_frame() {
        let wrench = Wrench::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(-0.1, 0.2, 0.3));
        let (v, w) = (Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.5, 0.1, -0.7));
        let R = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
        let offset = Vector3::new(0.1, 0.2, -0.4);
        let power = wrench.force.dot(&v) + wrench.torque.dot(&w);
        let moved = wrench.about(&offset).rotated(&R);
        let (v2, w2) = (R * (v + w.cross(&offset)), R * w);
        assert!((moved.force.dot(&v2) + moved.torque.dot(&w2) - power).abs() < 1e-14);
    }
}
