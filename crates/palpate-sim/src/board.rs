//! The board: a square hole with an optional 45° lead-in.

use palpate_spatial::{Pose, UnitQuaternion, Vector3};

use crate::config::{PegConfig, SimConfig};

/// A box of the board: half extents (m) and pose in the hole frame.
pub(crate) type BoardBox = (Vector3, Pose);

/// A board with a square hole; the hole frame has its origin in the middle of the mouth, z out of the board.
///
/// Its material is |x| ≥ w(z) or |y| ≥ w(z) between z = −depth and 0, where w is the half width of the hole
/// and widens by the chamfer towards the mouth.
#[derive(Clone, Debug)]
pub struct Board {
    /// Half the width of the hole, m.
    half_hole: f64,
    chamfer: f64,
    depth: f64,
    half_board: f64,
}

impl Board {
    /// The board of a configuration.
    pub fn new(config: &SimConfig) -> Self {
        Self {
            half_hole: config.hole_half_width(),
            chamfer: config.hole.chamfer,
            depth: config.hole.depth,
            half_board: config.hole.board_half_width,
        }
    }

    /// Half the width of the mouth, m.
    pub(crate) fn half_mouth(&self) -> f64 {
        self.half_hole + self.chamfer
    }

    /// The four sides as boxes: a plate beside the mouth and, with a chamfer, a wall below it and a slab
    /// whose face it is.
    ///
    /// Boxes only: rapier's box-box contacts are exact, its general polyhedra are not.
    pub(crate) fn boxes(&self) -> Vec<BoardBox> {
        let (h, c, d, w) = (self.half_hole, self.chamfer, self.depth, self.half_board);
        let mut side = Vec::new();
        // Along +x, before turning.
        let mut block = |x: [f64; 2], z: [f64; 2]| {
            let half = Vector3::new((x[1] - x[0]) / 2.0, w, (z[1] - z[0]) / 2.0);
            let centre = Vector3::new(f64::midpoint(x[0], x[1]), 0.0, f64::midpoint(z[0], z[1]));
            side.push((half, Pose::from_parts(centre.into(), UnitQuaternion::identity())));
        };
        block([self.half_mouth(), w], [-d, 0.0]);
        if c > 0.0 {
            block([h, w], [-d, -c]);
            side.push(self.slab());
        }
        (0..4)
            .flat_map(|quarter| {
                let turn = quarter_turns(quarter);
                side.iter().map(move |(half, pose)| (*half, turn * pose))
            })
            .collect()
    }

    /// Its upper face spans from the throat (h, −c) to the mouth (h + c, 0); the rest is buried.
    fn slab(&self) -> BoardBox {
        let (h, c) = (self.half_hole, self.chamfer);
        let thickness = (self.depth - c) / 4.0;
        let half =
            Vector3::new(c * std::f64::consts::FRAC_1_SQRT_2, self.half_board, thickness / 2.0);
        // Local x runs up the chamfer, local z out of it.
        let rotation =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_4);
        let face = Vector3::new(h + c / 2.0, 0.0, -c / 2.0);
        let centre = face - rotation * Vector3::new(0.0, 0.0, thickness / 2.0);
        (half, Pose::from_parts(centre.into(), rotation))
    }

    /// How deep the peg is in the material, m; 0 where it is not. Closed form, not rapier's.
    ///
    /// The depth under one side's faces is a minimum of linear functions, so along an edge of the peg its
    /// maximum is at an end or where two of them cross.
    pub fn penetration(&self, hole_T_tip: &Pose, peg: &PegConfig) -> f64 {
        let mut deepest: f64 = 0.0;
        for quarter in 0..4 {
            let side_T_tip = quarter_turns(quarter) * hole_T_tip;
            for [from, to] in edges(peg) {
                let from = self.depths(&(side_T_tip * from));
                let to = self.depths(&(side_T_tip * to));
                let mut try_at = |t: f64| {
                    if (0.0..=1.0).contains(&t) {
                        let depth = |i: usize| from[i] + t * (to[i] - from[i]);
                        deepest = deepest.max((0..4).map(depth).fold(f64::INFINITY, f64::min));
                    }
                };
                try_at(0.0);
                try_at(1.0);
                for i in 0..4 {
                    for j in 0..i {
                        let (a, b) = (from[i] - from[j], to[i] - to[j]);
                        try_at(a / (a - b));
                    }
                }
            }
        }
        deepest
    }

    /// Depth of a point under the top, the bottom, the wall and the chamfer of the +x side.
    fn depths(&self, p: &nalgebra::Point3<f64>) -> [f64; 4] {
        let wall = p.x - self.half_hole;
        // Never the nearest where there is no chamfer.
        let chamfer = (wall - self.chamfer - p.z) * std::f64::consts::FRAC_1_SQRT_2;
        [-p.z, p.z + self.depth, wall, chamfer]
    }
}

/// Long edges and tip edges, tip frame.
fn edges(peg: &PegConfig) -> [[nalgebra::Point3<f64>; 2]; 8] {
    let half = peg.width / 2.0;
    std::array::from_fn(|i| {
        let corner = |i: usize, z: f64| {
            let (x, y) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][i % 4];
            nalgebra::Point3::new(x * half, y * half, z)
        };
        if i < 4 {
            [corner(i, 0.0), corner(i, -peg.length)]
        } else {
            [corner(i, 0.0), corner(i + 1, 0.0)]
        }
    })
}

fn quarter_turns(n: u32) -> UnitQuaternion {
    let angle = f64::from(n) * std::f64::consts::FRAC_PI_2;
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}
