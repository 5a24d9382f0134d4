//! The contact world: flange, sensor spring, tool, board.

use std::panic::{AssertUnwindSafe, catch_unwind};

use palpate_spatial::{Pose, Twist, UnitQuaternion, Vector3, Wrench, rotation_error_log};
use rapier3d_f64::prelude::{
    ActiveHooks, CoefficientCombineRule, ColliderBuilder, FrictionModel, GenericJoint,
    IntegrationParameters, JointAxesMask, JointAxis, MassProperties, MotorModel, PhysicsWorld,
    RigidBodyBuilder, RigidBodyHandle, SpringCoefficients,
};

use crate::board::Board;
use crate::config::SimConfig;
use crate::seam::SeamFilter;
use crate::{EngineFault, SimError, convert};

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
        f.debug_struct("ContactWorld")
            .field("flange_pose", &self.flange_pose)
            .finish_non_exhaustive()
    }
}

impl ContactWorld {
    /// A world with a relaxed sensor and the flange (tool0) at `hole_T_flange`.
    ///
    /// # Errors
    /// A setting that makes no sense, or a peg that starts inside the board.
    pub fn new(config: &SimConfig, hole_T_flange: &Pose) -> Result<Self, SimError> {
        config.validate()?;
        let hole_T_tip = hole_T_flange * flange_T_tip(config);
        let depth = Board::new(config).penetration(&hole_T_tip, &config.peg);
        if depth > 0.0 {
            return Err(SimError::Overlap { depth });
        }
        Ok(Self::build(config, hole_T_flange))
    }

    /// The same for settings that were checked, wherever the flange is.
    pub(crate) fn build(config: &SimConfig, hole_T_flange: &Pose) -> Self {
        let mut world = PhysicsWorld::default();
        world.gravity = rapier3d_f64::math::Vector::ZERO;
        world.integration_parameters = parameters(config);
        let board = Board::new(config);
        let fixed = world.insert_body(RigidBodyBuilder::fixed());
        for (half, pose) in board.boxes() {
            let collider =
                ColliderBuilder::cuboid(half.x, half.y, half.z).position(convert::pose(&pose));
            world.insert_collider(surface(collider, config), Some(fixed));
        }
        let start = convert::pose(hole_T_flange);
        let flange = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(start));
        let tool = world.insert_body(tool_body(config).pose(start));
        let peg = world.insert_collider(surface(peg(config), config), Some(tool));
        world.insert_impulse_joint(flange, tool, sensor_spring(config));
        let filter = SeamFilter { peg, half_mouth: board.half_mouth() };
        Self { world, filter, flange, tool, flange_pose: *hole_T_flange, config: config.clone() }
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
        if !(wrench.is_finite() && self.tool_pose().translation.vector.amax() < f64::INFINITY) {
            return Err(SimError::Engine { what: EngineFault::NotFinite });
        }
        Ok(wrench)
    }

    fn steps(&mut self, hole_T_flange: &Pose, dt: f64) -> Wrench {
        let steps = self.config.solver.steps_per_tick;
        let from = self.flange_pose;
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
            self.world.bodies[self.flange].set_next_kinematic_position(convert::pose(&pose));
            self.world.step_with_events(&self.filter, &());
            sum = sum + self.spring(&pose, &velocity);
        }
        self.flange_pose = *hole_T_flange;
        (sum * (1.0 / f64::from(steps))).rotated(&hole_T_flange.rotation.inverse())
    }

    /// hole_T_tool0 of the tool itself, which the spring holds near the flange.
    pub fn tool_pose(&self) -> Pose {
        convert::pose_from(self.world.bodies[self.tool].position())
    }

    /// The tip's pose in the hole frame.
    pub fn tip_pose(&self) -> Pose {
        self.tool_pose() * flange_T_tip(&self.config)
    }

    /// How deep the peg is in the board, m: the contacts' own give, in closed form.
    pub fn penetration(&self) -> f64 {
        Board::new(&self.config).penetration(&self.tip_pose(), &self.config.peg)
    }

    /// Load on the spring between flange and tool, hole axes.
    fn spring(&self, flange: &Pose, flange_velocity: &Twist) -> Wrench {
        let body = &self.world.bodies[self.tool];
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

fn flange_T_tip(config: &SimConfig) -> Pose {
    Pose::translation(0.0, 0.0, config.tool.length)
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

/// Gripper and peg as one body with the mass that the configuration states.
fn tool_body(config: &SimConfig) -> RigidBodyBuilder {
    let tool = &config.tool;
    let mass = MassProperties::new(
        convert::vector(&Vector3::new(0.0, 0.0, tool.centre_of_mass)),
        tool.mass,
        convert::vector(&Vector3::from(tool.inertia)),
    );
    RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false).ccd_enabled(false)
}

/// The only part of the tool that collides.
fn peg(config: &SimConfig) -> ColliderBuilder {
    let (half, length) = (config.peg.width / 2.0, config.peg.length);
    let middle = Vector3::new(0.0, 0.0, config.tool.length - length / 2.0);
    let pose = Pose::from_parts(middle.into(), UnitQuaternion::identity());
    ColliderBuilder::cuboid(half, half, length / 2.0)
        .position(convert::pose(&pose))
        .density(0.0)
        .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
}

fn surface(collider: ColliderBuilder, config: &SimConfig) -> ColliderBuilder {
    collider
        .friction(config.friction)
        .friction_combine_rule(CoefficientCombineRule::Average)
        .restitution(0.0)
}

/// No locked axis, six implicit springs.
fn sensor_spring(config: &SimConfig) -> GenericJoint {
    let c = &config.compliance;
    let linear = (c.linear_stiffness, c.linear_damping);
    let angular = (c.angular_stiffness, c.angular_damping);
    let mut joint = GenericJoint::new(JointAxesMask::empty());
    for (axis, (stiffness, damping)) in [
        (JointAxis::LinX, linear),
        (JointAxis::LinY, linear),
        (JointAxis::LinZ, linear),
        (JointAxis::AngX, angular),
        (JointAxis::AngY, angular),
        (JointAxis::AngZ, angular),
    ] {
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor_position(axis, 0.0, stiffness, damping);
    }
    joint
}

#[cfg(test)]
impl ContactWorld {
    /// Makes the next tick panic inside.
    pub(crate) fn sabotage(&mut self) {
        self.world.remove_body(self.flange);
    }

    /// Makes the next tick's result infinite.
    pub(crate) fn poison(&mut self) {
        self.world.bodies[self.tool].set_linvel(rapier3d_f64::math::Vector::splat(f64::NAN), true);
    }
}
