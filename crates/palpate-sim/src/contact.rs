//! The contact world: flange, sensor spring, tool, and what the tool meets.

use std::panic::{AssertUnwindSafe, catch_unwind};

use palpate_spatial::{Pose, Twist, UnitQuaternion, Vector3, Wrench, rotation_error_log};
use rapier3d_f64::parry::query::{DefaultQueryDispatcher, QueryDispatcher};
use rapier3d_f64::prelude::{
    FrictionModel, IntegrationParameters, NarrowPhase, PhysicsWorld, SpringCoefficients,
};

use crate::build::{Bodies, insert};
use crate::config::SimConfig;
use crate::exact::{Exact, touches};
use crate::profile::Part;
use crate::{EngineFault, SimError, build, convert};

/// A tool on a compliant sensor under a position-driven flange, over a board with a hole or a bolt.
///
/// Everything is in the hole frame (origin in the middle of the mouth or of the bolt's top, z out), within a
/// fifth of a metre of its origin. Gravity is left out: a tared sensor does not see it.
pub struct ContactWorld {
    world: PhysicsWorld,
    bodies: Bodies,
    peg: Part,
    hole: Part,
    /// hole_T_flange at the end of the last tick.
    flange_pose: Pose,
    config: SimConfig,
}

impl std::fmt::Debug for ContactWorld {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ContactWorld")
            .field("flange_pose", &self.flange_pose)
            .finish_non_exhaustive()
    }
}

/// A contact as the solver left it, hole frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// m.
    pub position: Vector3,
    /// Environment on tool, unit.
    pub normal: Vector3,
    /// Normal force in the last world step, N. Substeps make it jump: the wrench is the sensor's.
    pub force: f64,
}

impl ContactWorld {
    /// A world with a relaxed sensor and the flange (tool0) at `hole_T_flange`.
    ///
    /// # Errors
    /// A setting that makes no sense, or a tool that starts inside something.
    pub fn new(config: &SimConfig, hole_T_flange: &Pose) -> Result<Self, SimError> {
        config.validate()?;
        build::check_start(config, hole_T_flange)?;
        let world = Self::build(config, hole_T_flange);
        let depth = world.penetration();
        if depth > 0.0 {
            return Err(SimError::Overlap { depth });
        }
        Ok(world)
    }

    /// The same for settings that were checked, wherever the flange is.
    pub(crate) fn build(config: &SimConfig, hole_T_flange: &Pose) -> Self {
        let mut world = PhysicsWorld {
            narrow_phase: NarrowPhase::with_query_dispatcher(Exact.chain(DefaultQueryDispatcher)),
            gravity: rapier3d_f64::math::Vector::ZERO,
            integration_parameters: parameters(config),
            ..PhysicsWorld::default()
        };
        let (peg, hole) = (Part::peg(config), Part::hole(config));
        let bodies = insert(&mut world, config, (&peg, &hole), hole_T_flange);
        Self { world, bodies, peg, hole, flange_pose: *hole_T_flange, config: config.clone() }
    }

    /// Moves the flange to `hole_T_flange` in `dt` seconds and returns what the sensor feels on the way:
    /// environment on tool, averaged over the tick, flange (tool0) axes, about the tool0 origin.
    ///
    /// F = −(K·δ + D·δ̇) with δ = flange − tool: contact, and the tool's inertia, as a real sensor shows.
    ///
    /// # Errors
    /// [`SimError::Engine`] if rapier panicked or a result is not finite: build a new world.
    pub fn tick(&mut self, hole_T_flange: &Pose, dt: f64) -> Result<Wrench, SimError> {
        // What the panic leaves behind is never stepped again: the caller drops this world.
        let wrench = catch_unwind(AssertUnwindSafe(|| self.steps(hole_T_flange, dt)))
            .map_err(|_panic| SimError::Engine { what: EngineFault::Panic })?;
        let place = self.tool_pose().translation.vector;
        wrench
            .filter(|w| w.is_finite() && place.iter().all(|x| x.is_finite()))
            .ok_or(SimError::Engine { what: EngineFault::NotFinite })
    }

    fn steps(&mut self, hole_T_flange: &Pose, dt: f64) -> Option<Wrench> {
        let steps = self.config.solver.steps_per_tick;
        let from = self.flange_pose;
        let hole_T_flange = &continued(hole_T_flange, &from);
        let velocity = Twist::new(
            (hole_T_flange.translation.vector - from.translation.vector) / dt,
            rotation_error_log(&hole_T_flange.rotation, &from.rotation) / dt,
        );
        self.world.integration_parameters.dt = dt / f64::from(steps);
        let mut sum = Wrench::zero();
        for step in 1..=steps {
            let part = f64::from(step) / f64::from(steps);
            let pose =
                if step == steps { *hole_T_flange } else { from.lerp_slerp(hole_T_flange, part) };
            self.world.bodies[self.bodies.flange].set_next_kinematic_position(convert::pose(&pose));
            self.world.step();
            // rapier quietly disables a body whose state is not finite, and would go on without it.
            if !self.world.quarantine().is_empty() {
                return None;
            }
            sum = sum + self.spring(&pose, &velocity);
        }
        self.flange_pose = *hole_T_flange;
        Some((sum * (1.0 / f64::from(steps))).rotated(&hole_T_flange.rotation.inverse()))
    }

    /// hole_T_tool0 of the tool itself, which the spring holds near the flange.
    pub fn tool_pose(&self) -> Pose {
        convert::pose_from(self.world.bodies[self.bodies.tool].position())
    }

    /// The tip's pose in the hole frame.
    pub fn tip_pose(&self) -> Pose {
        self.tool_pose() * build::flange_T_tip(&self.config)
    }

    /// Where the compliant receptacle has been pushed to; the identity for a rigid one.
    pub fn receptacle_pose(&self) -> Pose {
        convert::pose_from(self.world.bodies[self.bodies.fixture].position())
    }

    /// How deep peg and hole overlap, m: the contacts' own give, in closed form.
    pub fn penetration(&self) -> f64 {
        overlap(&self.config, (&self.peg, &self.hole), &self.receptacle_pose(), &self.tip_pose())
    }

    /// The contacts between peg and hole in which the solver found a force, for diagnostics.
    pub fn contacts(&self) -> Vec<ContactPoint> {
        let dt = self.world.integration_parameters.dt;
        let (tool, fixture) = (self.bodies.held, self.bodies.fixed);
        let mut points = Vec::new();
        let pairs = self.world.narrow_phase.contact_pair(tool, fixture);
        for manifold in pairs.iter().filter_map(|p| p.rigid()).flat_map(|p| &p.manifolds) {
            let first = self.world.narrow_phase.contact_pair(tool, fixture).map(|p| p.collider1);
            // The normal leaves the first collider.
            let towards_tool = if first == Some(tool) { -1.0 } else { 1.0 };
            let Some(place) = first.map(|c| *self.world.colliders[c].position()) else { continue };
            for point in manifold.points.iter().filter(|p| p.data.impulse > 0.0) {
                points.push(ContactPoint {
                    position: convert::vector_from(place * point.local_p1),
                    normal: convert::vector_from(manifold.data.normal) * towards_tool,
                    force: point.data.impulse / dt,
                });
            }
        }
        points
    }

    /// Load on the spring between flange and tool, hole axes.
    fn spring(&self, flange: &Pose, flange_velocity: &Twist) -> Wrench {
        let body = &self.world.bodies[self.bodies.tool];
        let tool = convert::pose_from(body.position());
        let velocity = convert::vector_from(body.velocity_at_point(body.position().translation));
        let spin = convert::vector_from(body.angvel());
        let c = &self.config.compliance;
        let stretch = flange.translation.vector - tool.translation.vector;
        let twist = rotation_error_log(&flange.rotation, &tool.rotation);
        let (slide, turn) = (flange_velocity.linear - velocity, flange_velocity.angular - spin);
        Wrench::new(
            -(stretch * c.linear_stiffness + slide * c.linear_damping),
            -(twist * c.angular_stiffness + turn * c.angular_damping),
        )
    }
}

/// How deep the part at the tip overlaps the fixture's, m; 0 where it does not. All poses in one frame.
fn overlap(config: &SimConfig, parts: (&Part, &Part), fixture: &Pose, tip: &Pose) -> f64 {
    let (peg, hole) = parts;
    let hole_T_peg =
        if config.ring_on_tool() { tip.inverse() * fixture } else { fixture.inverse() * tip };
    let mut deepest: f64 = 0.0;
    touches(peg, hole, &convert::pose(&hole_T_peg), 0.0, |t| deepest = deepest.max(t.inside));
    deepest
}

impl SimConfig {
    /// How deep the part at the tool's tip overlaps the one in the fixture, m; 0 where it does not.
    pub fn overlap(&self, hole_T_tip: &Pose) -> f64 {
        overlap(self, (&Part::peg(self), &Part::hole(self)), &Pose::identity(), hole_T_tip)
    }
}

/// The settings that carry a peg into a hole with micrometres to spare; see the crate's documentation.
fn parameters(config: &SimConfig) -> IntegrationParameters {
    let solver = &config.solver;
    let softness = SpringCoefficients {
        natural_frequency: solver.contact_frequency,
        damping_ratio: solver.contact_damping_ratio,
    };
    IntegrationParameters {
        contact_softness: softness,
        static_contact_softness: softness,
        num_solver_iterations: solver.iterations,
        num_internal_pgs_iterations: solver.pgs_iterations,
        num_internal_stabilization_iterations: 1,
        normalized_prediction_distance: solver.prediction_distance,
        normalized_allowed_linear_error: 1e-6,
        contact_recycling: false,
        contact_clustering: false,
        max_ccd_substeps: 0,
        friction_model: FrictionModel::Coulomb,
        friction_in_bias_pass: true,
        warmstart_joints: true,
        ..IntegrationParameters::default()
    }
}

/// The same pose with the quaternion of the pair (q, −q) that is nearer to the last one: rapier would take
/// the other for a full turn within a step.
fn continued(pose: &Pose, last: &Pose) -> Pose {
    let (q, before) = (pose.rotation.quaternion(), last.rotation.quaternion());
    let nearer = if q.dot(before) < 0.0 { -q } else { *q };
    Pose::from_parts(pose.translation, UnitQuaternion::new_unchecked(nearer))
}

#[cfg(test)]
impl ContactWorld {
    /// Makes the next tick panic inside.
    pub(crate) fn sabotage(&mut self) {
        self.world.remove_body(self.bodies.flange);
    }

    /// Makes the next tick's result infinite.
    pub(crate) fn poison(&mut self) {
        self.world.bodies[self.bodies.tool]
            .set_linvel(rapier3d_f64::math::Vector::splat(f64::NAN), true);
    }
}
