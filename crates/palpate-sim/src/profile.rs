//! Half sections: the faces of a peg and of the body around a hole, each in its own frame.
//!
//! Both are described by a distance ρ from their axis and a height z along it. For a round part ρ is the
//! distance; for a prism with n sides it is the largest of n coordinates across the axis. In the (ρ, z) plane
//! the material of either part is convex, so that a point's depth is the least of its depths under the faces.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use rapier3d_f64::math::Vector;

use crate::config::{PegShape, SimConfig};

/// A face: depth(ρ, z) = offset − radial·ρ − axial·z, with (radial, axial) the normal out of the material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Face {
    pub(crate) radial: f64,
    pub(crate) axial: f64,
    /// m.
    pub(crate) offset: f64,
}

impl Face {
    pub(crate) fn depth(&self, rho: f64, z: f64) -> f64 {
        self.offset - self.radial * rho - self.axial * z
    }

    /// Across the axis: a peg's end, a board's top.
    pub(crate) fn is_flat(&self) -> bool {
        self.axial.abs() > 0.99
    }
}

const fn face(radial: f64, axial: f64, offset: f64) -> Face {
    Face { radial, axial, offset }
}

/// How a part goes round its axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outline {
    Round,
    /// Unit normals of the sides across the axis, and the corners between them for an inradius of 1.
    Prism {
        normals: Vec<Vector>,
        corners: Vec<Vector>,
    },
}

impl Outline {
    pub(crate) fn new(shape: PegShape) -> Self {
        let sides = match shape {
            PegShape::Round => return Self::Round,
            PegShape::Square => 4,
            PegShape::Hexagonal => 6,
        };
        let step = TAU / f64::from(sides);
        let at =
            |angle: f64, length: f64| Vector::new(angle.cos() * length, angle.sin() * length, 0.0);
        let normals = (0..sides).map(|i| at(step * f64::from(i), 1.0)).collect();
        let reach = 1.0 / (step / 2.0).cos();
        let corners = (0..sides).map(|i| at(step * (f64::from(i) + 0.5), reach)).collect();
        Self::Prism { normals, corners }
    }

    /// Largest distance from the axis for an inradius of 1.
    pub(crate) fn reach(&self) -> f64 {
        match self {
            Self::Round => 1.0,
            Self::Prism { corners, .. } => corners[0].length(),
        }
    }
}

/// A part: its outline, its faces in order along the half section and the corners (ρ, z) that can touch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    pub(crate) outline: Outline,
    pub(crate) faces: Vec<Face>,
    /// Corner between two neighbouring faces, m.
    pub(crate) corners: Vec<(f64, f64)>,
    /// Bounds: largest ρ, lowest and highest z, m.
    pub(crate) bounds: (f64, f64, f64),
    pub(crate) is_hole: bool,
}

impl Part {
    /// The peg: tip at z = 0, material below.
    pub(crate) fn peg(config: &SimConfig) -> Self {
        let peg = &config.peg;
        let (r, e, length) = (peg.width / 2.0, peg.chamfer, peg.length);
        let mut faces = vec![face(0.0, -1.0, length), face(1.0, 0.0, r)];
        let mut corners = vec![(r, -e)];
        if e > 0.0 {
            faces.push(face(FRAC_1_SQRT_2, FRAC_1_SQRT_2, (r - e) * FRAC_1_SQRT_2));
            corners.push((r - e, 0.0));
        }
        faces.push(face(0.0, 1.0, 0.0));
        let outline = Outline::new(peg.shape);
        let bounds = (r * outline.reach(), -length, 0.0);
        Self { outline, faces, corners, bounds, is_hole: false }
    }

    /// The body around the hole: mouth at z = 0, material below. Held by the tool it is a ring with an outside.
    pub(crate) fn hole(config: &SimConfig) -> Self {
        let hole = &config.hole;
        let (r, c, d, outer) =
            (config.hole_half_width(), hole.chamfer, hole.depth, hole.board_half_width);
        let mut faces = vec![face(0.0, 1.0, 0.0)];
        let mut corners = Vec::new();
        if c > 0.0 {
            faces.push(face(-FRAC_1_SQRT_2, FRAC_1_SQRT_2, -(r + c) * FRAC_1_SQRT_2));
            corners.push((r + c, 0.0));
        }
        faces.push(face(-1.0, 0.0, -r));
        corners.push((r, -c));
        faces.push(face(0.0, -1.0, d));
        corners.push((r, -d));
        let outline = Outline::new(config.peg.shape);
        let bounds = (outer * outline.reach(), -d, 0.0);
        if config.ring_on_tool() {
            faces.push(face(1.0, 0.0, outer));
            corners.extend([(outer, -d), (outer, 0.0)]);
        }
        Self { outline, faces, corners, bounds, is_hole: true }
    }
}
