//! The board: a square hole made of boxes, and the seams between them made invisible.

use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use rapier3d_f64::prelude::{
    ColliderHandle, ContactModificationContext, PhysicsHooks, Vector as GlamVector,
};

use crate::config::SimConfig;

/// A box of the board: half extents (m) and pose in the hole frame.
pub(crate) type BoardBox = (Vector3, Pose);

/// A board with a square hole; the hole frame has its origin in the middle of the mouth, z out of the board.
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

    /// Four sides of material, |x| ≥ w(z) and |y| ≥ w(z), where w widens along the 45° chamfer.
    ///
    /// Each side is a plate beside the mouth, a wall below the chamfer, and a slab whose face is the chamfer.
    /// Boxes only: rapier's box-box contacts are exact, its general polyhedra are not.
    pub(crate) fn boxes(&self) -> Vec<BoardBox> {
        let (h, c, d, w) = (self.half_hole, self.chamfer, self.depth, self.half_board);
        let mouth = h + c;
        let mut side = Vec::new();
        // Along +x, before turning; `across` is the half extent along y.
        let mut block = |x: [f64; 2], across: f64, z: [f64; 2]| {
            let half = Vector3::new((x[1] - x[0]) / 2.0, across, (z[1] - z[0]) / 2.0);
            let centre = Vector3::new(f64::midpoint(x[0], x[1]), 0.0, f64::midpoint(z[0], z[1]));
            side.push((half, Pose::from_parts(centre.into(), UnitQuaternion::identity())));
        };
        block([mouth, w], w, [-d, 0.0]);
        if c > 0.0 {
            block([h, w], w, [-d, -c]);
            side.push(self.slab());
        }
        (0..4)
            .flat_map(|quarter| {
                let turn = UnitQuaternion::from_axis_angle(
                    &Vector3::z_axis(),
                    f64::from(quarter) * std::f64::consts::FRAC_PI_2,
                );
                side.iter().map(move |(half, pose)| (*half, Pose::from_parts(Vector3::zeros().into(), turn) * pose))
            })
            .collect()
    }

    /// Its upper face spans from the throat (h, −c) to the mouth (h + c, 0); the rest is buried.
    fn slab(&self) -> BoardBox {
        let (h, c) = (self.half_hole, self.chamfer);
        let thickness = (self.depth - c) / 4.0;
        let half = Vector3::new(c * std::f64::consts::FRAC_1_SQRT_2, self.half_board, thickness / 2.0);
        // Local x runs up the chamfer, local z out of it.
        let rotation =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_4);
        let face = Vector3::new(h + c / 2.0, 0.0, -c / 2.0);
        let centre = face - rotation * Vector3::new(0.0, 0.0, thickness / 2.0);
        (half, Pose::from_parts(centre.into(), rotation))
    }
}

/// Flattens contacts with faces that are hidden inside the board.
///
/// A peg that slides over the seam of two boxes touches, a micrometre deep, the side of the next one, and
/// would be pushed sideways with up to 100 N. Such a contact has a normal that is not vertical and lies
/// wholly outside the mouth, where the board's only face is its top.
pub(crate) struct SeamFilter {
    pub(crate) peg: ColliderHandle,
    /// Half the width of the mouth, m.
    pub(crate) half_mouth: f64,
}

/// A normal steeper than this belongs to the top face.
const VERTICAL: f64 = 0.95;
/// Distance beyond the mouth's edge from which a contact counts as outside, m.
const MARGIN: f64 = 1e-4;

impl PhysicsHooks for SeamFilter {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let peg_is_first = context.collider1 == self.peg;
        let Some(contacts) = context.rigid_mut() else { return };
        if contacts.normal.z.abs() > VERTICAL {
            return;
        }
        let edge = self.half_mouth + MARGIN;
        let outside = |p: &GlamVector| p.x.abs() > edge || p.y.abs() > edge;
        let peg_point = |c: &rapier3d_f64::geometry::SolverContact| if peg_is_first { c.anchor1 } else { c.anchor2 };
        if !contacts.solver_contacts.iter().all(|c| outside(&peg_point(c))) {
            return;
        }
        // The normal points out of the first collider.
        *contacts.normal = if peg_is_first { -GlamVector::Z } else { GlamVector::Z };
        for contact in contacts.solver_contacts.iter_mut() {
            let point = peg_point(contact);
            let top = GlamVector::new(point.x, point.y, 0.0);
            contact.dist = point.z;
            (contact.anchor1, contact.anchor2) = if peg_is_first { (point, top) } else { (top, point) };
        }
    }
}
