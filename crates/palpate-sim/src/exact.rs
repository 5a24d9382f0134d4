//! Peg and hole as shapes of rapier's, and who finds their contacts.
//!
//! rapier asks a dispatcher for the contacts of two shapes. This one answers for a peg and a hole from their
//! closed forms and leaves every other pair to parry. A manifold has one normal, so each family of contacts
//! ([`Family`]) has manifolds of its own at fixed places of the pair's list; a contact that is found again gets
//! the impulses of its predecessor, which the solver starts from.

use rapier3d_f64::math::{Pose, Real, Vector};
use rapier3d_f64::parry::bounding_volume::{Aabb, BoundingSphere};
use rapier3d_f64::parry::mass_properties::MassProperties;
use rapier3d_f64::parry::query::details::{NormalConstraints, ShapeCastOptions};
use rapier3d_f64::parry::query::{
    ClosestPoints, Contact, ContactManifold, ContactManifoldsWorkspace, NonlinearRigidMotion,
    PersistentQueryDispatcher, PointProjection, PointQuery, QueryDispatcher, Ray, RayCast,
    RayIntersection, ShapeCastHit, ShapeDistance, ShapeIntersection, TrackedContact, Unsupported,
};
use rapier3d_f64::parry::shape::{FeatureId, PackedFeatureId, Shape, ShapeType, TypedShape};

use crate::profile::{Outline, Part};
use crate::touch::{Family, Layout, Touch};
use crate::{prism, round};

/// Reports the contacts of `peg` and `hole` nearer than `prediction` (m), in the hole's frame.
pub(crate) fn touches(
    peg: &Part,
    hole: &Part,
    hole_T_peg: &Pose,
    prediction: f64,
    found: impl FnMut(Touch),
) {
    match hole.outline {
        Outline::Round => round::touches(peg, hole, hole_T_peg, prediction, found),
        Outline::Prism { .. } => prism::touches(peg, hole, hole_T_peg, prediction, found),
    }
}

/// Where the manifolds of the contacts of `peg` and `hole` lie.
pub(crate) fn layout(peg: &Part, hole: &Part) -> Layout {
    match &hole.outline {
        Outline::Round => round::layout(peg, hole),
        Outline::Prism { normals, .. } => prism::layout(normals.len()),
    }
}

/// A peg or a hole as a shape. Rays and points, which nothing here asks for, see its bounding box.
#[derive(Clone)]
pub(crate) struct PartShape {
    pub(crate) part: Part,
    /// Of the pair it belongs to.
    pub(crate) layout: Layout,
}

impl PartShape {
    fn bounds(&self) -> Aabb {
        let (rho, low, high) = self.part.bounds;
        Aabb::new(Vector::new(-rho, -rho, low), Vector::new(rho, rho, high))
    }
}

impl Shape for PartShape {
    fn compute_local_aabb(&self) -> Aabb {
        self.bounds()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.bounds().bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, _: Vector, _: u32) -> Option<Box<dyn Shape>> {
        None
    }

    fn mass_properties(&self, _: Real) -> MassProperties {
        MassProperties::default()
    }

    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }

    fn ccd_thickness(&self) -> Real {
        0.0
    }

    fn ccd_angular_thickness(&self) -> Real {
        0.0
    }
}

impl RayCast for PartShape {
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        max_time_of_impact: Real,
        solid: bool,
    ) -> Option<RayIntersection> {
        self.bounds().cast_local_ray_and_get_normal(ray, max_time_of_impact, solid)
    }
}

impl PointQuery for PartShape {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.bounds().project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        self.bounds().project_local_point_and_get_feature(point)
    }
}

/// Finds the contacts of peg and hole; every other pair and query is somebody else's.
pub(crate) struct Exact;

impl<M, C> PersistentQueryDispatcher<M, C> for Exact
where
    M: Default + Clone,
    C: Default + Copy,
{
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        prediction: Real,
        manifolds: &mut Vec<ContactManifold<M, C>>,
        _: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        let (Some(first), Some(second)) = (g1.as_shape::<PartShape>(), g2.as_shape::<PartShape>())
        else {
            return Err(Unsupported);
        };
        let layout = &first.layout;
        let (first, second) = (&first.part, &second.part);
        let hole_first = first.is_hole;
        let (hole, peg) = if hole_first { (first, second) } else { (second, first) };
        let hole_T_peg = if hole_first { *pos12 } else { pos12.inverse() };
        let mut slots = Slots { layout, manifolds, hole_first, hole_T_peg };
        slots.begin();
        touches(peg, hole, &hole_T_peg, prediction, |touch| slots.put(&touch));
        slots.finish();
        Ok(())
    }

    fn contact_manifold_convex_convex(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Option<&dyn NormalConstraints>,
        _: Option<&dyn NormalConstraints>,
        _: Real,
        _: &mut ContactManifold<M, C>,
    ) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

/// A pair's manifolds while they are refilled. A point that was not found again is marked by this distance.
const STALE: f64 = f64::INFINITY;

struct Slots<'a, M, C> {
    layout: &'a Layout,
    manifolds: &'a mut Vec<ContactManifold<M, C>>,
    hole_first: bool,
    hole_T_peg: Pose,
}

impl<M: Default + Clone, C: Default + Copy> Slots<'_, M, C> {
    fn begin(&mut self) {
        let count = self.layout.count;
        if self.manifolds.len() != count {
            self.manifolds.clear();
            self.manifolds.resize_with(count, || ContactManifold::with_data(0, 0, M::default()));
        }
        for point in self.manifolds.iter_mut().flat_map(|m| &mut m.points) {
            point.dist = STALE;
        }
    }

    fn put(&mut self, touch: &Touch) {
        let (family, start) = self.layout.families[touch.family];
        let to_peg = self.hole_T_peg.rotation.inverse();
        let on_peg = self.hole_T_peg.inverse_transform_point(touch.on_peg);
        let contact = TrackedContact::flipped(
            touch.on_hole,
            on_peg,
            PackedFeatureId::vertex(touch.key),
            PackedFeatureId::vertex(touch.key),
            -touch.depth,
            !self.hole_first,
        );
        let (manifold, point) = match family {
            Family::Patch => {
                let points = &self.manifolds[start].points;
                (start, points.iter().position(|p| p.fid1 == contact.fid1))
            }
            Family::Wandering(count) => {
                let Some(slot) = self.nearest(start, count, contact.local_p1) else { return };
                (slot, (!self.manifolds[slot].points.is_empty()).then_some(0))
            }
        };
        let manifold = &mut self.manifolds[manifold];
        let (n_hole, n_peg) = (touch.normal, to_peg * -touch.normal);
        (manifold.local_n1, manifold.local_n2) =
            if self.hole_first { (n_hole, n_peg) } else { (n_peg, n_hole) };
        if let Some(i) = point {
            manifold.points[i].copy_geometry_from(contact);
        } else {
            manifold.points.push(contact);
        }
    }

    /// The manifold whose unclaimed point is nearest, or else an empty one; none if all are taken.
    fn nearest(&self, start: usize, count: usize, place: Vector) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        for slot in start..start + count {
            let distance = match self.manifolds[slot].points.first() {
                Some(p) if p.dist == STALE => p.local_p1.distance(place),
                Some(_) => continue,
                None => f64::MAX,
            };
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, slot));
            }
        }
        best.map(|(_, slot)| slot)
    }

    fn finish(&mut self) {
        for manifold in self.manifolds.iter_mut() {
            manifold.points.retain(|p| p.dist < STALE);
        }
    }
}

impl QueryDispatcher for Exact {
    fn intersection_test(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        Err(Unsupported)
    }

    fn distance(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
    ) -> Result<ShapeDistance, Unsupported> {
        Err(Unsupported)
    }

    fn contact(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Real,
    ) -> Result<Option<Contact>, Unsupported> {
        Err(Unsupported)
    }

    fn closest_points(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Real,
    ) -> Result<ClosestPoints, Unsupported> {
        Err(Unsupported)
    }

    fn cast_shapes(
        &self,
        _: &Pose,
        _: Vector,
        _: &dyn Shape,
        _: &dyn Shape,
        _: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }

    fn cast_shapes_nonlinear(
        &self,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: Real,
        _: Real,
        _: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }
}
