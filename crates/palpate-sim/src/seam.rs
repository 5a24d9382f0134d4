//! Seams between the boxes of the board, made invisible.

use rapier3d_f64::geometry::SolverContact;
use rapier3d_f64::prelude::{ColliderHandle, ContactModificationContext, PhysicsHooks, Vector};

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

/// A normal steeper than this belongs to the top face; a 45° chamfer's does not.
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
        let outside = |p: &Vector| p.x.abs() > edge || p.y.abs() > edge;
        let peg_point = |c: &SolverContact| if peg_is_first { c.anchor1 } else { c.anchor2 };
        if !contacts.solver_contacts.iter().all(|c| outside(&peg_point(c))) {
            return;
        }
        // The normal points out of the first collider.
        *contacts.normal = if peg_is_first { -Vector::Z } else { Vector::Z };
        for contact in contacts.solver_contacts.iter_mut() {
            let point = peg_point(contact);
            let top = Vector::new(point.x, point.y, 0.0);
            contact.dist = point.z;
            (contact.anchor1, contact.anchor2) =
                if peg_is_first { (point, top) } else { (top, point) };
        }
    }
}
