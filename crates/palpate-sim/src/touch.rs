//! A contact between peg and hole, and the list a search fills.

use rapier3d_f64::math::{Pose, Vector};

/// A point this far from a face that it is heading for is reported, m: a quarter of a metre per second for a
/// tick. The engine keeps it if the two would meet within the step.
pub(crate) const REACH: f64 = 5e-4;

/// Whether a point is worth reporting: near a face, or above it and well within the bounds of all others, so
/// that nothing else can come first. `depths`: the least and the next. "Well within" is more than contacts give
/// way: or the edge of a peg on the board would stumble over the far edge of the mouth.
pub(crate) fn is_near(depths: (f64, f64), prediction: f64) -> bool {
    depths.0 > -prediction || (depths.0 > -REACH && depths.1 > 4.0 * prediction)
}

/// Two points that touch or are about to, in the hole's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Contacts of a family share manifolds: see [`Family`].
    pub(crate) family: usize,
    /// Which of the family's points; the same feature keeps its key.
    pub(crate) key: u32,
    /// Out of the hole's material, unit.
    pub(crate) normal: Vector,
    pub(crate) on_hole: Vector,
    pub(crate) on_peg: Vector,
    /// How far along the normal they overlap, m; negative while apart.
    pub(crate) depth: f64,
    /// How far the point is from the nearest face, m: less than `depth` where edge lies on edge.
    pub(crate) inside: f64,
}

impl Touch {
    /// A point of the peg under a face of the hole; everything in the hole's frame.
    pub(crate) fn of_peg(
        family: usize,
        key: u32,
        point: Vector,
        normal: Vector,
        depth: f64,
    ) -> Self {
        Self {
            family,
            key,
            normal,
            on_hole: point + normal * depth,
            on_peg: point,
            depth,
            inside: depth,
        }
    }

    /// A point of the hole under a face of the peg; `point` and `normal` (out of the peg) in the peg's frame.
    pub(crate) fn of_hole(
        family: usize,
        key: u32,
        point: Vector,
        normal: Vector,
        depth: f64,
        hole_T_peg: &Pose,
    ) -> Self {
        Self {
            family,
            key,
            normal: -(hole_T_peg.rotation * normal),
            on_hole: *hole_T_peg * point,
            on_peg: *hole_T_peg * (point + normal * depth),
            depth,
            inside: depth,
        }
    }
}

/// How many manifolds a family may fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// One manifold of a few points with a common normal, known by their keys.
    Patch,
    /// This many manifolds of one point each: a point that wanders along its edge, known by its place.
    Wandering(usize),
}

/// Where the manifolds of each family lie in a pair's list.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    /// With the place of its first manifold.
    pub(crate) families: Vec<(Family, usize)>,
    pub(crate) count: usize,
}

impl Layout {
    pub(crate) fn new(families: impl IntoIterator<Item = Family>) -> Self {
        let mut count = 0;
        let placed = families.into_iter().map(|family| {
            let start = count;
            count += match family {
                Family::Patch => 1,
                Family::Wandering(n) => n,
            };
            (family, start)
        });
        let families = placed.collect();
        Self { families, count }
    }
}
