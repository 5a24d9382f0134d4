//! Poses as scripts write them: position and rotation vector.

use palpate_spatial::{Pose, UnitQuaternion, Vector3};

/// p[x, y, z, rx, ry, rz], m and rad.
pub fn value_to_pose(p: &[f64; 6]) -> Pose {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(p[3], p[4], p[5]));
    Pose::from_parts(Vector3::new(p[0], p[1], p[2]).into(), rotation)
}

/// The inverse of [`value_to_pose`]; the rotation vector is at most π long.
pub fn pose_to_value(pose: &Pose) -> [f64; 6] {
    let t = pose.translation.vector;
    let r = pose.rotation.scaled_axis();
    [t.x, t.y, t.z, r.x, r.y, r.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back() {
        for p in [[0.1, -0.2, 0.3, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, -2.0, 0.5]] {
            let back = pose_to_value(&value_to_pose(&p));
            assert!(p.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-15), "{back:?}");
        }
    }
}
