//! Contacts of a round peg with a round hole: circles against faces, exactly.
//!
//! Two solids of revolution touch where a circular edge of one is deepest under the faces of the other. Along
//! a circle the depth is the least of a few smooth functions; each of its local maxima is a contact. On a
//! single face the normal is the face's. Where two faces meet, edge lies on edge, and the normal is the
//! one mixture of theirs that the circle's tangent is perpendicular to: it turns from one face's to the other's
//! as the peg tilts, without a jump.

use rapier3d_f64::math::{Pose, Vector};

use crate::profile::{Face, Part};
use crate::touch::{Family, Layout, Touch, is_near};

/// Directions in which a circle is sampled before its maxima are refined.
const SAMPLES: usize = 32;
/// tan of the angle between two of them.
const REACH: f64 = 0.198_912_367_379_658;
/// Maxima lower than this at the nearest sample cannot be in contact, m.
const HOPELESS: f64 = -2e-3;
/// A flat landing gets a fifth point where it is lower than its four by this part of the prediction distance.
const LEANING: f64 = 0.02;
/// Bisections of a bracket: from 0.4 rad to 1e-10 rad.
const BISECTIONS: u32 = 32;
/// Simultaneous contacts along one edge of the peg, and of the hole.
const PER_RIM: usize = 6;
const PER_EDGE: usize = 4;
/// tan of the largest angle from a contact to where it presses.
const WIDEST: f64 = 0.7;
/// The hole's top is its first face.
const TOP: usize = 0;

/// (cos, sin) of the samples, by turning (1, 0) 31 times.
const CIRCLE: [(f64, f64); SAMPLES] = {
    const COS: f64 = 0.980_785_280_403_230_4;
    const SIN: f64 = 0.195_090_322_016_128_27;
    let mut table = [(1.0, 0.0); SAMPLES];
    let mut i = 1;
    while i < SAMPLES {
        let (c, s) = table[i - 1];
        table[i] = (c * COS - s * SIN, s * COS + c * SIN);
        i += 1;
    }
    table
};

/// An edge of one part in the frame of the other.
struct Circle {
    centre: Vector,
    /// Radii at 0° and 90°.
    u: Vector,
    v: Vector,
    radius: f64,
}

/// A place on a circle under the faces of the other part.
#[derive(Clone, Copy)]
struct Place {
    /// (cos, sin) along the circle.
    direction: (f64, f64),
    point: Vector,
    rho: f64,
    depth: f64,
    /// Least depth under the other faces.
    next: f64,
    face: usize,
    /// d(depth)/dφ of the face.
    slope: f64,
}

impl Circle {
    /// The corner (ρ, z) of a part whose pose in the other's frame is given.
    fn new((rho, z): (f64, f64), pose: &Pose) -> Self {
        Self {
            centre: *pose * Vector::new(0.0, 0.0, z),
            u: pose.rotation * Vector::new(rho, 0.0, 0.0),
            v: pose.rotation * Vector::new(0.0, rho, 0.0),
            radius: rho,
        }
    }

    /// No point of the circle can be deeper than this, from bounds on ρ and z.
    fn deepest_bound(&self, faces: &[Face]) -> f64 {
        let axis = self.u.cross(self.v).z / (self.radius * self.radius);
        let off = self.centre.x.hypot(self.centre.y);
        let lift = self.radius * (1.0 - axis * axis).max(0.0).sqrt();
        let (near, far) = ((self.radius * axis.abs() - off).max(0.0), off + self.radius);
        let (low, high) = (self.centre.z - lift, self.centre.z + lift);
        faces.iter().fold(f64::INFINITY, |bound, f| {
            bound.min(f.depth(
                if f.radial > 0.0 { near } else { far },
                if f.axial > 0.0 { low } else { high },
            ))
        })
    }

    fn at(&self, direction: (f64, f64), faces: &[Face]) -> Place {
        let (c, s) = direction;
        let point = self.centre + self.u * c + self.v * s;
        let tangent = self.v * c - self.u * s;
        let rho = point.truncate().length();
        let (mut depth, mut next, mut index) = (f64::INFINITY, f64::INFINITY, 0);
        for (i, f) in faces.iter().enumerate() {
            let d = f.depth(rho, point.z);
            if d < depth {
                (depth, next, index) = (d, depth, i);
            } else if d < next {
                next = d;
            }
        }
        let outward = (point.x * tangent.x + point.y * tangent.y) / rho.max(1e-12);
        let slope = -faces[index].radial * outward - faces[index].axial * tangent.z;
        Place { direction, point, rho, depth, next, face: index, slope }
    }

    /// The local maximum within a sample's spacing, and the faces that are least on its two sides.
    fn refine(&self, sample: (f64, f64), start: &Place, faces: &[Face]) -> (Place, Place, Place) {
        let (mut low, mut high) = (-REACH, REACH);
        let (mut before, mut after, mut middle) = (*start, *start, *start);
        for _ in 0..BISECTIONS {
            let x = f64::midpoint(low, high);
            middle = self.at(turned(sample, x), faces);
            if middle.slope > 0.0 {
                (low, before) = (x, middle);
            } else {
                (high, after) = (x, middle);
            }
        }
        (middle, before, after)
    }
}

impl Circle {
    /// Where a contact on a single face presses: a point while apart, two points once they overlap.
    ///
    /// Circles that nearly fit overlap along an arc. As the peg slips sideways the normal turns within
    /// micrometres, faster than the engine, which fixes it for a step, could follow: a single point would throw the
    /// peg from side to side. Two points half way out on the arc know the curvature: depth − ½·bend·φ² there is
    /// ¾ of the depth, and together they are as stiff sideways as the turning normal.
    fn presses(&self, top: &Place, faces: &[Face]) -> [Option<Place>; 2] {
        if top.depth <= 0.0 {
            return [Some(*top), None];
        }
        let face = &faces[top.face];
        let beside = |x: f64| {
            let place = self.at(turned(top.direction, x), faces);
            face.depth(place.rho, place.point.z)
        };
        let bend = (2.0 * top.depth - beside(REACH) - beside(-REACH)) / (REACH * REACH);
        let half = (top.depth / (2.0 * bend)).sqrt();
        let half = if half > WIDEST { WIDEST } else { half };
        [half, -half].map(|x| {
            let place = self.at(turned(top.direction, x), faces);
            let depth = face.depth(place.rho, place.point.z);
            Some(Place { depth, face: top.face, ..place })
        })
    }
}

/// A direction turned by atan x.
fn turned((c, s): (f64, f64), x: f64) -> (f64, f64) {
    let norm = 1.0 / (1.0 + x * x).sqrt();
    ((c - x * s) * norm, (s + x * c) * norm)
}

/// Normal at a place: a face's, or a mixture.
fn normal(place: &Place, radial: f64, axial: f64) -> Vector {
    let outward = radial / place.rho.max(1e-12);
    Vector::new(place.point.x * outward, place.point.y * outward, axial)
}

/// The families of contacts between two round parts: two flat patches, then the edges of the peg, then those
/// of the hole.
pub(crate) fn layout(peg: &Part, hole: &Part) -> Layout {
    let mut families = vec![Family::Patch, Family::Patch];
    families.extend(peg.corners.iter().map(|_| Family::Wandering(PER_RIM)));
    families.extend(hole.corners.iter().map(|_| Family::Wandering(PER_EDGE)));
    Layout::new(families)
}

/// Every contact nearer than `prediction` (m).
pub(crate) fn touches(
    peg: &Part,
    hole: &Part,
    hole_T_peg: &Pose,
    prediction: f64,
    mut found: impl FnMut(Touch),
) {
    for (i, corner) in peg.corners.iter().enumerate() {
        let circle = Circle::new(*corner, hole_T_peg);
        if circle.deepest_bound(&hole.faces) > HOPELESS {
            rim(&circle, &hole.faces, 2 + i, prediction, &mut found);
        }
    }
    let peg_T_hole = hole_T_peg.inverse();
    for (i, corner) in hole.corners.iter().enumerate() {
        let circle = Circle::new(*corner, &peg_T_hole);
        if circle.deepest_bound(&peg.faces) > HOPELESS {
            let family = 2 + peg.corners.len() + i;
            edge(&circle, &peg.faces, family, prediction, hole_T_peg, &mut found);
        }
    }
}

/// An edge of the peg under the faces of the hole.
fn rim(
    circle: &Circle,
    faces: &[Face],
    family: usize,
    prediction: f64,
    found: &mut impl FnMut(Touch),
) {
    let places: [Place; SAMPLES] = std::array::from_fn(|i| circle.at(CIRCLE[i], faces));
    let key = |i: usize| (family * SAMPLES + i) as u32;
    let flat = |place: &Place| place.face == TOP;
    // A flat landing rests on four fixed points of the rim ...
    let mut supported = f64::NEG_INFINITY;
    for i in (0..SAMPLES).step_by(SAMPLES / 4) {
        let place = &places[i];
        if flat(place) && is_near((place.depth, place.next), prediction) {
            supported = supported.max(place.depth);
            let n = normal(place, 0.0, 1.0);
            found(Touch::of_peg(0, key(i), place.point, n, place.depth));
        }
    }
    for i in 0..SAMPLES {
        let (last, place, next) =
            (&places[(i + SAMPLES - 1) % SAMPLES], &places[i], &places[(i + 1) % SAMPLES]);
        // ... and, partly over the hole, on the two where the rim crosses the mouth.
        if flat(place) != flat(next) {
            let crossing = crossing(circle, CIRCLE[i], place.face, next.face, faces);
            if crossing.depth > -prediction && is_level(circle, prediction) {
                let n = normal(&crossing, 0.0, 1.0);
                found(Touch::of_peg(1, key(i), crossing.point, n, crossing.depth));
                continue;
            }
        }
        if place.depth > last.depth && place.depth >= next.depth && place.depth > HOPELESS {
            let (top, before, after) = circle.refine(CIRCLE[i], place, faces);
            let (a, b) = (&faces[before.face], &faces[after.face]);
            if before.face == after.face {
                if !is_near((top.depth, top.next), prediction) {
                    continue;
                }
                if before.face != TOP {
                    for place in circle.presses(&top, faces).iter().flatten() {
                        let n = normal(place, a.radial, a.axial);
                        let touch = Touch::of_peg(family, key(i), place.point, n, place.depth);
                        found(Touch { inside: top.depth, ..touch });
                    }
                } else if top.depth > supported + prediction * LEANING {
                    let n = normal(&top, 0.0, 1.0);
                    found(Touch::of_peg(1, key(i), top.point, n, top.depth));
                }
            } else if top.depth > -prediction && !is_level(circle, prediction) {
                let share = after.slope / (after.slope - before.slope);
                let mix = |a: f64, b: f64| share * a + (1.0 - share) * b;
                let (radial, axial) = (mix(a.radial, b.radial), mix(a.axial, b.axial));
                let size = radial.hypot(axial);
                let n = normal(&top, radial / size, axial / size);
                let touch = Touch::of_peg(family, key(i), top.point, n, top.depth / size);
                found(Touch { inside: top.depth, ..touch });
            }
        }
    }
}

/// Whether the whole rim is about as high: then a flat landing is a patch and not a point.
fn is_level(circle: &Circle, prediction: f64) -> bool {
    circle.u.z.hypot(circle.v.z) < prediction / 2.0
}

/// Where two faces are equally deep, between a sample and the next.
fn crossing(
    circle: &Circle,
    sample: (f64, f64),
    first: usize,
    second: usize,
    faces: &[Face],
) -> Place {
    let ahead = |x: f64| {
        let place = circle.at(turned(sample, x), faces);
        let depth = |f: usize| faces[f].depth(place.rho, place.point.z);
        (depth(first) < depth(second), place)
    };
    let (mut low, mut high) = (0.0, REACH);
    let mut place = ahead(0.0).1;
    for _ in 0..BISECTIONS {
        let x = f64::midpoint(low, high);
        let (is_first, at) = ahead(x);
        if is_first {
            low = x;
        } else {
            high = x;
        }
        place = at;
    }
    place
}

/// An edge of the hole under the faces of the peg. Edge on edge was found from the peg's side.
fn edge(
    circle: &Circle,
    faces: &[Face],
    family: usize,
    prediction: f64,
    hole_T_peg: &Pose,
    found: &mut impl FnMut(Touch),
) {
    let places: [Place; SAMPLES] = std::array::from_fn(|i| circle.at(CIRCLE[i], faces));
    for i in 0..SAMPLES {
        let (last, place, next) =
            (&places[(i + SAMPLES - 1) % SAMPLES], &places[i], &places[(i + 1) % SAMPLES]);
        if !(place.depth > last.depth && place.depth >= next.depth && place.depth > HOPELESS) {
            continue;
        }
        let (top, before, after) = circle.refine(CIRCLE[i], place, faces);
        let f = &faces[before.face];
        // A level landing was found from the peg's side too.
        let level = f.is_flat() && is_level(circle, prediction);
        if is_near((top.depth, top.next), prediction) && before.face == after.face && !level {
            let key = (family * SAMPLES + i) as u32;
            for place in circle.presses(&top, faces).iter().flatten() {
                let n = normal(place, f.radial, f.axial);
                let touch = Touch::of_hole(family, key, place.point, n, place.depth, hole_T_peg);
                found(Touch { inside: top.depth, ..touch });
            }
        }
    }
}
