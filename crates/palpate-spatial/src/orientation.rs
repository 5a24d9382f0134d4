//! Attitude errors and pose integration, safe against quaternion double cover.

use crate::{Pose, Twist, UnitQuaternion, Vector3, Vector6};

/// Attitude error of `base_R_goal` against `base_R_tool`, base axes: sin(θ/2)·n.
///
/// The vector part of Qg ⊗ Q⁻¹, with the sign that takes the short way round (sign(0) = +1, so a
/// half turn is never a standstill). This is the error the paper's controllers use.
///
/// # References
/// Beltran-Hernandez et al. 2020, Sect. III-B.1; Siciliano et al., *Robotics*, Sect. 3.7.3.
pub fn rotation_error_vector_part(
    base_R_goal: &UnitQuaternion,
    base_R_tool: &UnitQuaternion,
) -> Vector3 {
    let e = base_R_goal * base_R_tool.inverse();
    let vector = Vector3::new(e.i, e.j, e.k);
    if e.w < 0.0 { -vector } else { vector }
}

/// Attitude error of `base_R_goal` against `base_R_tool`, base axes: θ·n with θ in [0, π].
pub fn rotation_error_log(base_R_goal: &UnitQuaternion, base_R_tool: &UnitQuaternion) -> Vector3 {
    let vector = rotation_error_vector_part(base_R_goal, base_R_tool);
    let sine = vector.norm();
    if sine < 1e-300 {
        return Vector3::zeros();
    }
    let e = base_R_goal * base_R_tool.inverse();
    // atan2 keeps full precision for tiny angles, where 2·acos(w) returns 0.
    vector * (2.0 * sine.atan2(e.w.abs()) / sine)
}

/// x_e = x_g − x: position error (m) above [`rotation_error_vector_part`], base axes.
pub fn pose_error_vector_part(base_T_goal: &Pose, base_T_tool: &Pose) -> Vector6 {
    stack(
        base_T_goal.translation.vector - base_T_tool.translation.vector,
        rotation_error_vector_part(&base_T_goal.rotation, &base_T_tool.rotation),
    )
}

/// Position error (m) above [`rotation_error_log`] (rad), base axes.
pub fn pose_error_log(base_T_goal: &Pose, base_T_tool: &Pose) -> Vector6 {
    stack(
        base_T_goal.translation.vector - base_T_tool.translation.vector,
        rotation_error_log(&base_T_goal.rotation, &base_T_tool.rotation),
    )
}

/// The pose after moving with a constant twist (base axes, about the tool's origin) for `dt` seconds.
///
/// The attitude is multiplied by the exact exponential of ω·dt and renormalised.
pub fn integrate(base_T_tool: &Pose, twist: &Twist, dt: f64) -> Pose {
    let translation = base_T_tool.translation.vector + twist.linear * dt;
    let mut rotation = UnitQuaternion::from_scaled_axis(twist.angular * dt) * base_T_tool.rotation;
    rotation.renormalize();
    Pose::from_parts(translation.into(), rotation)
}

fn stack(linear: Vector3, angular: Vector3) -> Vector6 {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Unit;
    use proptest::prelude::*;

    fn attitude(seed: [f64; 4]) -> UnitQuaternion {
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(
            seed[0],
            seed[1],
            seed[2],
            seed[3] + 1e-3,
        ))
    }

    fn negated(q: &UnitQuaternion) -> UnitQuaternion {
        UnitQuaternion::new_unchecked(-q.into_inner())
    }

    proptest! {
        #[test]
        fn double_cover_never_changes_the_error(a in prop::array::uniform4(-1.0..1.0f64), b in prop::array::uniform4(-1.0..1.0f64)) {
            let (goal, tool) = (attitude(a), attitude(b));
            for f in [rotation_error_vector_part, rotation_error_log] {
                prop_assert_eq!(f(&goal, &tool), f(&negated(&goal), &tool));
                prop_assert_eq!(f(&goal, &tool), f(&goal, &negated(&tool)));
            }
        }

        #[test]
        fn turning_by_the_log_error_reaches_the_goal(a in prop::array::uniform4(-1.0..1.0f64), b in prop::array::uniform4(-1.0..1.0f64)) {
            let (goal, tool) = (attitude(a), attitude(b));
            let twist = Twist::new(Vector3::zeros(), rotation_error_log(&goal, &tool));
            let reached = integrate(&Pose::from_parts(Vector3::zeros().into(), tool), &twist, 1.0);
            prop_assert!(reached.rotation.angle_to(&goal) < 1e-7);
        }
    }

    #[test]
    fn goes_the_short_way_from_350_degrees() {
        let axis = Unit::new_normalize(Vector3::new(1.0, 2.0, -0.5));
        let goal = UnitQuaternion::from_axis_angle(&axis, 350f64.to_radians());
        let e = rotation_error_log(&goal, &UnitQuaternion::identity());
        assert_relative_eq!(e, axis.into_inner() * -10f64.to_radians(), epsilon = 1e-12);
    }

    #[test]
    fn half_turn_still_asks_for_motion() {
        let goal = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 1.0, 0.0));
        assert_relative_eq!(
            rotation_error_vector_part(&goal, &UnitQuaternion::identity()).norm(),
            1.0
        );
        assert_relative_eq!(
            rotation_error_log(&goal, &UnitQuaternion::identity()).norm(),
            std::f64::consts::PI
        );
    }

    #[test]
    fn tiny_angles_keep_their_size() {
        let goal = UnitQuaternion::from_scaled_axis(Vector3::new(1e-9, 0.0, 0.0));
        assert_relative_eq!(
            rotation_error_log(&goal, &UnitQuaternion::identity()).x,
            1e-9,
            max_relative = 1e-9
        );
    }
}
