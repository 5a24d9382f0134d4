//! Velocity of a rigid body.

use crate::{Vector3, Vector6};

/// Velocity of a frame's origin and angular velocity, in the axes and about the point the name says.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Twist {
    /// Linear velocity, m/s.
    pub linear: Vector3,
    /// Angular velocity, rad/s.
    pub angular: Vector3,
}

impl Twist {
    /// Builds a twist from linear (m/s) and angular (rad/s) velocity.
    pub fn new(linear: Vector3, angular: Vector3) -> Self {
        Self { linear, angular }
    }

    /// No motion.
    pub fn zero() -> Self {
        Self::default()
    }

    /// (v, ω) as one six-vector.
    pub fn vector(&self) -> Vector6 {
        let (v, w) = (self.linear, self.angular);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|x| x.is_finite())
    }

    /// Shortens each part to at most `linear_max` (m/s) and `angular_max` (rad/s), keeping its direction.
    ///
    /// A non-finite part stays non-finite: refusing it is the fail-safe layer's business.
    pub fn limited(&self, linear_max: f64, angular_max: f64) -> Self {
        Self {
            linear: shorten(self.linear, linear_max),
            angular: shorten(self.angular, angular_max),
        }
    }
}

impl From<Vector6> for Twist {
    fn from(v: Vector6) -> Self {
        Self::new(v.fixed_rows::<3>(0).into(), v.fixed_rows::<3>(3).into())
    }
}

fn shorten(v: Vector3, max: f64) -> Vector3 {
    let norm = v.norm();
    if norm > max { v * (max / norm) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limiting_keeps_direction_and_passes_small_twists() {
        let t = Twist::new(Vector3::new(3.0, 4.0, 0.0), Vector3::new(0.0, 0.0, 0.1));
        let limited = t.limited(1.0, 1.0);
        assert!((limited.linear - Vector3::new(0.6, 0.8, 0.0)).norm() < 1e-15);
        assert_eq!(limited.angular, t.angular);
    }

    #[test]
    fn limiting_does_not_hide_nan() {
        let t = Twist::new(Vector3::new(f64::NAN, 0.0, 0.0), Vector3::zeros());
        assert!(!t.limited(1.0, 1.0).is_finite());
    }
}
