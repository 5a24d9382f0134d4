//! nalgebra (this project) ↔ glam (rapier).

use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose as GlamPose, Rotation as GlamRotation, Vector as GlamVector};

pub(crate) fn vector(v: &Vector3) -> GlamVector {
    GlamVector::new(v.x, v.y, v.z)
}

pub(crate) fn vector_from(v: GlamVector) -> Vector3 {
    Vector3::new(v.x, v.y, v.z)
}

pub(crate) fn pose(p: &Pose) -> GlamPose {
    let q = &p.rotation;
    GlamPose::from_parts(vector(&p.translation.vector), GlamRotation::from_xyzw(q.i, q.j, q.k, q.w))
}

pub(crate) fn pose_from(p: &GlamPose) -> Pose {
    let q = p.rotation;
    let rotation = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    Pose::from_parts(vector_from(p.translation).into(), rotation)
}
