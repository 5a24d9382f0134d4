//! Rigid transforms as three axes and an origin: cheaper to chain than quaternions.

use nalgebra::{Matrix3, Rotation3};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

/// `parent_T_child`: the child's axes and origin in parent axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rigid {
    pub(crate) x: Vector3,
    pub(crate) y: Vector3,
    pub(crate) z: Vector3,
    pub(crate) p: Vector3,
}

impl Rigid {
    /// Turns a vector from child axes to parent axes.
    #[inline]
    pub(crate) fn rotate(&self, v: &Vector3) -> Vector3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// Turns a vector from parent axes to child axes.
    #[inline]
    pub(crate) fn unrotate(&self, v: &Vector3) -> Vector3 {
        Vector3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    #[inline]
    pub(crate) fn then(&self, next: &Self) -> Self {
        Self {
            x: self.rotate(&next.x),
            y: self.rotate(&next.y),
            z: self.rotate(&next.z),
            p: self.p + self.rotate(&next.p),
        }
    }

    /// Turns about the own z axis.
    #[inline]
    pub(crate) fn turn(&mut self, sin: f64, cos: f64) {
        let (x, y) = (self.x, self.y);
        self.x = x * cos + y * sin;
        self.y = y * cos - x * sin;
    }

    pub(crate) fn pose(&self) -> Pose {
        let R = Rotation3::from_matrix_unchecked(self.matrix());
        Pose::from_parts(self.p.into(), UnitQuaternion::from_rotation_matrix(&R))
    }

    pub(crate) fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&[self.x, self.y, self.z])
    }
}

impl From<&Pose> for Rigid {
    #[inline]
    fn from(pose: &Pose) -> Self {
        let R = pose.rotation.to_rotation_matrix().into_inner();
        Self {
            x: R.column(0).into(),
            y: R.column(1).into(),
            z: R.column(2).into(),
            p: pose.translation.vector,
        }
    }
}
