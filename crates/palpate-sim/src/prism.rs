//! Contacts of a prismatic peg with a hole of the same outline: straight edges against faces, exactly.
//!
//! The body around the hole is the union of one wedge per side (half planes top, chamfer, wall, bottom).
//! Against a wedge the peg's corners and edges matter: along an edge the depth is the least of linear functions
//! and its maximum lies at an end or where two faces meet. There edge lies on edge; the normal is the
//! mixture of the two faces' that is perpendicular to the peg's edge. What a wedge's face hides inside another
//! wedge is no contact, so there are no seams.

use rapier3d_f64::math::{Pose, Vector};

use crate::profile::{Face, Outline, Part};
use crate::touch::{Family, Layout, REACH, Touch, is_near};

/// The families of contacts between a prism of `sides` and its hole: the top, then per side the wall, the
/// chamfer, what the long edges do and what each tip edge does.
pub(crate) fn layout(sides: usize) -> Layout {
    Layout::new(vec![Family::Patch; 1 + sides * (3 + sides)])
}

/// A straight edge of the peg in the hole's frame.
struct Edge {
    from: Vector,
    along: Vector,
    is_long: bool,
    /// Its number: long edges first, then tip edges.
    index: usize,
}

/// One side of the hole.
struct Wedge<'a> {
    side: usize,
    normals: &'a [Vector],
    faces: &'a [Face],
}

impl Wedge<'_> {
    /// Least and next depth of a point in a wedge, and the face of the least.
    fn depth_in(&self, side: usize, point: Vector) -> ((f64, f64), usize) {
        let across = self.normals[side].dot(point);
        let (mut depths, mut face) = ((f64::INFINITY, f64::INFINITY), 0);
        for (i, f) in self.faces.iter().enumerate() {
            let depth = f.depth(across, point.z);
            if depth < depths.0 {
                (depths, face) = ((depth, depths.0), i);
            } else if depth < depths.1 {
                depths.1 = depth;
            }
        }
        (depths, face)
    }

    /// Whether another wedge holds the point under its top, where this one's other faces do not exist.
    fn is_hidden(&self, point: Vector, is_top: bool) -> bool {
        (0..self.normals.len()).any(|k| {
            if k == self.side {
                return false;
            }
            let ((depth, _), face) = self.depth_in(k, point);
            if is_top {
                // The same top: the side that lies farther out reports it, of equal ones the first.
                let (own, other) = (self.normals[self.side].dot(point), self.normals[k].dot(point));
                return other > own || (other == own && k < self.side);
            }
            face == 0 && depth > 0.0
        })
    }

    fn normal(&self, radial: f64, axial: f64) -> Vector {
        self.normals[self.side] * radial + Vector::new(0.0, 0.0, axial)
    }
}

/// Every contact nearer than `prediction` (m).
pub(crate) fn touches(
    peg: &Part,
    hole: &Part,
    hole_T_peg: &Pose,
    prediction: f64,
    mut found: impl FnMut(Touch),
) {
    let Outline::Prism { normals, corners } = &hole.outline else { return };
    let (half, length) = (peg.bounds.0 / hole.outline.reach(), -peg.bounds.1);
    let sides = normals.len();
    let along = hole_T_peg.rotation * Vector::new(0.0, 0.0, -length);
    let tip = |i: usize| *hole_T_peg * (corners[i % sides] * half);
    for side in 0..sides {
        let wedge = Wedge { side, normals, faces: &hole.faces };
        let family = |what: usize| 1 + side * (3 + sides) + what;
        for i in 0..sides {
            let point = tip(i);
            let (depths, face) = wedge.depth_in(side, point);
            if is_near(depths, prediction) && !wedge.is_hidden(point, face == 0) {
                let f = &hole.faces[face];
                let kind = match (face, f.axial == 0.0) {
                    (0, _) => 0,
                    (_, true) => family(0),
                    (_, false) => family(1),
                };
                let n = wedge.normal(f.radial, f.axial);
                found(Touch::of_peg(kind, i as u32, point, n, depths.0));
            }
        }
        for i in 0..sides {
            let from = tip(i);
            let long = Edge { from, along, is_long: true, index: i };
            crossings(&wedge, &long, family(2), prediction, &mut found);
            let across = Edge { from, along: tip(i + 1) - from, is_long: false, index: sides + i };
            crossings(&wedge, &across, family(3 + i), prediction, &mut found);
        }
    }
}

/// Where an edge of the peg crosses the edges of a wedge.
fn crossings(
    wedge: &Wedge<'_>,
    edge: &Edge,
    family: usize,
    prediction: f64,
    found: &mut impl FnMut(Touch),
) {
    let side = wedge.normals[wedge.side];
    let (start, slope) = ((side.dot(edge.from), edge.from.z), (side.dot(edge.along), edge.along.z));
    for (i, pair) in wedge.faces.windows(2).enumerate() {
        let [a, b] = pair else { continue };
        let depth = |f: &Face| f.depth(start.0, start.1);
        let change = |f: &Face| -f.radial * slope.0 - f.axial * slope.1;
        let (rise_a, rise_b) = (change(a), change(b));
        let t = (depth(b) - depth(a)) / (rise_a - rise_b);
        if !(t > 0.0 && t < 1.0) {
            continue;
        }
        let deep = depth(a) + t * rise_a;
        // A maximum along the edge, or the end of a stretch that lies flat.
        let share = (rise_b / (rise_b - rise_a)).clamp(0.0, 1.0);
        let is_end = rise_a.abs().min(rise_b.abs()) < prediction;
        let is_maximum = rise_a * rise_b < 0.0;
        // Away from its ends a long edge can meet the hole's edge within the step.
        let is_inside =
            edge.is_long && is_maximum && t.min(1.0 - t) * edge.along.length() > 4.0 * prediction;
        if !((is_end || is_maximum) && (deep > -prediction || is_inside && deep > -REACH)) {
            continue;
        }
        let point = edge.from + edge.along * t;
        let ((least, _), _) = wedge.depth_in(wedge.side, point);
        if least < deep - 1e-12 || wedge.is_hidden(point, false) || outside_opening(wedge, point) {
            continue;
        }
        let mix = |a: f64, b: f64| share * a + (1.0 - share) * b;
        let (radial, axial) = (mix(a.radial, b.radial), mix(a.axial, b.axial));
        let size = radial.hypot(axial);
        let n = wedge.normal(radial / size, axial / size);
        let key = (edge.index * wedge.faces.len() + i) as u32;
        found(Touch { inside: deep, ..Touch::of_peg(family, key, point, n, deep / size) });
    }
}

/// Whether a point of this wedge's edge lies inside another wedge: the edge ends where they meet.
fn outside_opening(wedge: &Wedge<'_>, point: Vector) -> bool {
    let own = wedge.normals[wedge.side].dot(point);
    wedge.normals.iter().enumerate().any(|(k, n)| k != wedge.side && n.dot(point) > own + 1e-9)
}
