//! Capsules, the arm's stand-in for collision checks.

use palpate_spatial::Vector3;

/// All points within a radius of a segment.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capsule {
    /// One end of the segment, m.
    pub from: Vector3,
    /// The other end, m.
    pub to: Vector3,
    /// Radius, m.
    pub radius: f64,
}

/// Distance between the segments a + s·u and b + t·w, s and t in [0, 1].
///
/// # References
/// Ericson, *Real-Time Collision Detection*, 2005, Sect. 5.1.9 (closest points of two segments).
#[inline]
pub(crate) fn segment_distance(a: &[Vector3; 2], b: &[Vector3; 2]) -> f64 {
    let (u, w, r) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, ww, uw, ur, wr) = (u.dot(&u), w.dot(&w), u.dot(&w), u.dot(&r), w.dot(&r));
    let inside = |numerator: f64, denominator: f64| {
        if denominator > 0.0 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    // The best s on the infinite line, then the best t for it, then s again if t was clamped.
    let mut s = inside(uw * wr - ur * ww, uu * ww - uw * uw);
    let mut t = if ww > 0.0 { (uw * s + wr) / ww } else { 0.0 };
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = inside(uw * t - ur, uu);
    } else if ww == 0.0 {
        s = inside(-ur, uu);
    }
    (r + u * s - w * t).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector3> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from)
    }

    /// min over s of the distance of a point to a segment: convex, by golden section.
    fn by_search(a: &[Vector3; 2], b: &[Vector3; 2]) -> f64 {
        let to_b = |s: f64| {
            let (p, w) = (a[0] + (a[1] - a[0]) * s, b[1] - b[0]);
            let t =
                if w.norm_squared() > 0.0 { (p - b[0]).dot(&w) / w.norm_squared() } else { 0.0 };
            (p - b[0] - w * t.clamp(0.0, 1.0)).norm()
        };
        let (mut low, mut high) = (0.0f64, 1.0f64);
        for _ in 0..100 {
            let third = (high - low) / 3.0;
            if to_b(low + third) < to_b(high - third) { high -= third } else { low += third }
        }
        to_b(0.5 * (low + high))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn agrees_with_a_search(a in point(), b in point(), c in point(), d in point(), kind in 0u8..5) {
            let (first, second) = match kind {
                0 => ([a, a], [c, d]),
                1 => ([a, b], [c, c]),
                2 => ([a, b], [c, c + (b - a) * 0.7]),
                3 => ([a, b], [a + (b - a) * 0.3, d]),
                _ => ([a, b], [c, d]),
            };
            let (told, found) = (segment_distance(&first, &second), by_search(&first, &second));
            prop_assert!((told - found).abs() < 1e-7, "{told} but {found}");
            prop_assert!((segment_distance(&second, &first) - told).abs() < 1e-7);
        }
    }
}
