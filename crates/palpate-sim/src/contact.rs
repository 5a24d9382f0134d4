//! The contact world: flange, sensor spring, tool, board.

use std::panic::{AssertUnwindSafe, catch_unwind};

use palpate_spatial::{Pose, Vector3, Wrench, rotation_error_log};
use rapier3d_f64::prelude::{
    ActiveHooks, CoefficientCombineRule, ColliderBuilder, FrictionModel, GenericJoint, IntegrationParameters, JointAxesMask,
    JointAxis, MassProperties, MotorModel, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, SpringCoefficients,
};

use crate::board::{Board, SeamFilter};
use crate::config::SimConfig;
use crate::convert;

const AXES: [JointAxis; 6] =
    [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ, JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];

/// A tool on a compliant sensor under a position-driven flange, over a board with a hole.
///
/// Everything is in the hole frame (origin in the middle of the mouth, z out of the board), within a
/// fifth of a metre of its origin. Gravity is left out: a tared sensor does not see it.
pub struct ContactWorld {
    world: PhysicsWorld,
    filter: SeamFilter,
    flange: RigidBodyHandle,
    tool: RigidBodyHandle,
    /// hole_T_flange at the end of the last tick.
    flange_pose: Pose,
    config: SimConfig,
}

impl std::fmt::Debug for ContactWorld {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ContactWorld").field("flange_pose", &self.flange_pose).finish_non_exhaustive()
    }
}

impl ContactWorld {
    /// A world with a relaxed sensor, the flange (tool0) at `hole_T_flange`. The configuration must be valid.
    pub fn new(config: &SimConfig, hole_T_flange: &Pose) -> Self {
        let mut world = PhysicsWorld::default();
        world.gravity = rapier3d_f64::math::Vector::ZERO;
        world.integration_parameters = parameters(config);
        let board = Board::new(config);
        let fixed = world.insert_body(RigidBodyBuilder::fixed());
        for (half, pose) in board.boxes() {
            let collider = ColliderBuilder::cuboid(half.x, half.y, half.z).position(convert::pose(&pose));
            world.insert_collider(surface(collider, config.friction), Some(fixed));
        }
        let start = convert::pose(hole_T_flange);
        let flange = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(start));
        let tool = &config.tool;
        let mass = MassProperties::new(
            convert::vector(&Vector3::new(0.0, 0.0, tool.centre_of_mass)),
            tool.mass,
            convert::vector(&Vector3::from(tool.inertia)),
        );
        let body =
            RigidBodyBuilder::dynamic().pose(start).additional_mass_properties(mass).can_sleep(false).ccd_enabled(false);
        let tool_body = world.insert_body(body);
        let half = config.peg.width / 2.0;
        let middle = Vector3::new(0.0, 0.0, tool.length - config.peg.length / 2.0);
        let peg = ColliderBuilder::cuboid(half, half, config.peg.length / 2.0)
            .position(convert::pose(&Pose::from_parts(middle.into(), palpate_spatial::UnitQuaternion::identity())))
            .density(0.0)
            .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS);
        let peg = world.insert_collider(surface(peg, config.friction), Some(tool_body));
        world.insert_impulse_joint(flange, tool_body, sensor(config));
        let filter = SeamFilter { peg, half_mouth: config.hole_half_width() + config.hole.chamfer };
        Self { world, filter, flange, tool: tool_body, flange_pose: *hole_T_flange, config: config.clone() }
    }

    /// Moves the flange to `hole_T_flange` in `dt` seconds and returns what the sensor feels on the way:
    /// environment on tool, averaged over the tick, flange (tool0) axes, about the tool0 origin.
    ///
    /// F = −(K·δ + D·δ̇) with δ = flange − tool: contact, and the tool's inertia, as a real sensor shows.
    /// `None` if the engine broke down (a panic, or a result that is not finite): build a new world.
    #[must_use]
    pub fn tick(&mut self, hole_T_flange: &Pose, dt: f64) -> Option<Wrench> {
        let steps = self.config.solver.steps_per_tick;
        let from = self.flange_pose;
        let linear = (hole_T_flange.translation.vector - from.translation.vector) / dt;
        let angular = rotation_error_log(&hole_T_flange.rotation, &from.rotation) / dt;
        self.world.integration_parameters.dt = dt / f64::from(steps);
        let mut sum = Wrench::zero();
        for step in 1..=steps {
            let part = f64::from(step) / f64::from(steps);
            let pose = if step == steps { *hole_T_flange } else { from.lerp_slerp(hole_T_flange, part) };
            self.world.bodies[self.flange].set_next_kinematic_position(convert::pose(&pose));
            catch_unwind(AssertUnwindSafe(|| self.world.step_with_events(&self.filter, &()))).ok()?;
            sum = sum + self.spring(&pose, &linear, &angular);
        }
        self.flange_pose = *hole_T_flange;
        let wrench = (sum * (1.0 / f64::from(steps))).rotated(&hole_T_flange.rotation.inverse());
        wrench.is_finite().then_some(wrench)
    }

    /// hole_T_tool0 of the tool itself, which the spring holds near the flange.
    pub fn tool_pose(&self) -> Pose {
        convert::pose_from(self.world.bodies[self.tool].position())
    }

    /// The tip's pose in the hole frame.
    pub fn tip_pose(&self) -> Pose {
        self.tool_pose() * Pose::translation(0.0, 0.0, self.config.tool.length)
    }

    /// Load on the spring, hole axes.
    fn spring(&self, flange: &Pose, linear: &Vector3, angular: &Vector3) -> Wrench {
        let body = &self.world.bodies[self.tool];
        let tool = convert::pose_from(body.position());
        let velocity = convert::vector_from(body.velocity_at_point(body.position().translation));
        let spin = convert::vector_from(body.angvel());
        let c = &self.config.compliance;
        let stretch = flange.translation.vector - tool.translation.vector;
        let twist = rotation_error_log(&flange.rotation, &tool.rotation);
        Wrench::new(
            -(stretch * c.linear_stiffness + (linear - velocity) * c.linear_damping),
            -(twist * c.angular_stiffness + (angular - spin) * c.angular_damping),
        )
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
        friction_in_bias_pass: false,
        warmstart_joints: true,
        ..IntegrationParameters::default()
    }
}

fn surface(collider: ColliderBuilder, friction: f64) -> ColliderBuilder {
    collider.friction(friction).friction_combine_rule(CoefficientCombineRule::Average).restitution(0.0)
}

/// No locked axis, six implicit springs.
fn sensor(config: &SimConfig) -> GenericJoint {
    let c = &config.compliance;
    let mut joint = GenericJoint::new(JointAxesMask::empty());
    for (i, axis) in AXES.into_iter().enumerate() {
        let (stiffness, damping) = if i < 3 {
            (c.linear_stiffness, c.linear_damping)
        } else {
            (c.angular_stiffness, c.angular_damping)
        };
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor_position(axis, 0.0, stiffness, damping);
    }
    joint
}
