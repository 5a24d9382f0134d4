//! The bodies of the contact world, and what may touch what.

use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use rapier3d_f64::math::Vector;
use rapier3d_f64::parry::query::contact;
use rapier3d_f64::parry::shape::{Cuboid, SharedShape};
use rapier3d_f64::prelude::{
    CoefficientCombineRule, ColliderBuilder, ColliderHandle, GenericJoint, Group,
    InteractionGroups, InteractionTestMode, JointAxesMask, JointAxis, MassProperties, MotorModel,
    PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

use crate::config::{ComplianceConfig, SimConfig};
use crate::exact::{PartShape, layout};
use crate::profile::Part;
use crate::{SimError, convert};

/// Peg and hole: only each other.
const PARTS: Group = Group::GROUP_1;
/// The tool's coarse outline: obstacles.
const OUTLINE: Group = Group::GROUP_2;
/// Obstacles: the tool's outline.
const OBSTACLE: Group = Group::GROUP_3;

/// Handles into the world.
pub(crate) struct Bodies {
    pub(crate) flange: RigidBodyHandle,
    pub(crate) tool: RigidBodyHandle,
    /// What carries the other part: fixed, or sprung.
    pub(crate) fixture: RigidBodyHandle,
    /// The part on the tool.
    pub(crate) held: ColliderHandle,
    /// The part on the fixture.
    pub(crate) fixed: ColliderHandle,
}

pub(crate) fn flange_T_tip(config: &SimConfig) -> Pose {
    Pose::translation(0.0, 0.0, config.tool.length)
}

/// Fills an empty world.
pub(crate) fn insert(
    world: &mut PhysicsWorld,
    config: &SimConfig,
    (peg, hole): (&Part, &Part),
    hole_T_flange: &Pose,
) -> Bodies {
    let ground = world.insert_body(RigidBodyBuilder::fixed());
    let fixture = match &config.receptacle {
        None => ground,
        Some(r) => {
            let middle = Vector3::new(0.0, 0.0, -config.receptacle_lever());
            let body = world.insert_body(dynamic(r.mass, middle, r.inertia));
            world.insert_impulse_joint(ground, body, spring(&r.compliance));
            body
        }
    };
    let start = convert::pose(hole_T_flange);
    let flange = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(start));
    let com = Vector3::new(0.0, 0.0, config.tool.centre_of_mass);
    let body = dynamic(config.tool.mass, com, config.tool.inertia).pose(start);
    let tool = world.insert_body(body);
    world.insert_impulse_joint(flange, tool, spring(&config.compliance));

    let (held, fixed) = if config.ring_on_tool() { (hole, peg) } else { (peg, hole) };
    let part = |part: &Part| {
        let shape = PartShape { part: part.clone(), layout: layout(peg, hole) };
        surface(ColliderBuilder::new(SharedShape::new(shape)), config, PARTS, PARTS)
    };
    let tip = convert::pose(&flange_T_tip(config));
    let held = world.insert_collider(part(held).position(tip), Some(tool));
    let fixed = world.insert_collider(part(fixed), Some(fixture));
    for (half, pose) in outline(config) {
        let collider =
            ColliderBuilder::cuboid(half.x, half.y, half.z).position(convert::pose(&pose));
        world.insert_collider(surface(collider, config, OUTLINE, OBSTACLE), Some(tool));
    }
    for obstacle in &config.obstacles {
        let [x, y, z] = obstacle.half;
        let pose =
            Pose::from_parts(Vector3::from(obstacle.centre).into(), UnitQuaternion::identity());
        let collider = ColliderBuilder::cuboid(x, y, z).position(convert::pose(&pose));
        world.insert_collider(surface(collider, config, OBSTACLE, OUTLINE), Some(ground));
    }
    Bodies { flange, tool, fixture, held, fixed }
}

/// Refuses a tool that starts inside an obstacle.
pub(crate) fn check_start(config: &SimConfig, hole_T_flange: &Pose) -> Result<(), SimError> {
    for (index, obstacle) in config.obstacles.iter().enumerate() {
        let half = |v: [f64; 3]| Cuboid::new(Vector::new(v[0], v[1], v[2]));
        let place =
            Pose::from_parts(Vector3::from(obstacle.centre).into(), UnitQuaternion::identity());
        for (size, pose) in outline(config) {
            let (a, b) = (convert::pose(&place), convert::pose(&(hole_T_flange * pose)));
            let found = contact(&a, &half(obstacle.half), &b, &half(size.into()), 0.0);
            if let Ok(Some(contact)) = found
                && contact.dist < 0.0
            {
                return Err(SimError::Obstructed { index, depth: -contact.dist });
            }
        }
    }
    Ok(())
}

/// What obstacles see of the tool, tool0 axes: the body behind the held part, and a box around that part.
fn outline(config: &SimConfig) -> Vec<(Vector3, Pose)> {
    let (length, held) = (config.tool.length, config.held_length());
    let across =
        if config.ring_on_tool() { config.hole.board_half_width } else { config.peg.width / 2.0 };
    let span = |half: f64, from: f64, to: f64| {
        let middle = Vector3::new(0.0, 0.0, f64::midpoint(from, to));
        let half = Vector3::new(half, half, (to - from) / 2.0);
        (half, Pose::from_parts(middle.into(), UnitQuaternion::identity()))
    };
    let mut boxes = vec![span(across, length - held, length)];
    if length > held {
        boxes.push(span(config.tool.half_width, 0.0, length - held));
    }
    boxes
}

/// A body with a stated mass; its colliders weigh nothing.
fn dynamic(mass: f64, centre: Vector3, inertia: [f64; 3]) -> RigidBodyBuilder {
    let mass = MassProperties::new(
        convert::vector(&centre),
        mass,
        convert::vector(&Vector3::from(inertia)),
    );
    RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false).ccd_enabled(false)
}

fn surface(
    collider: ColliderBuilder,
    config: &SimConfig,
    member: Group,
    meets: Group,
) -> ColliderBuilder {
    collider
        .density(0.0)
        .friction(config.friction)
        .friction_combine_rule(CoefficientCombineRule::Average)
        .restitution(0.0)
        .collision_groups(InteractionGroups::new(member, meets, InteractionTestMode::And))
}

/// No locked axis, six implicit springs.
fn spring(c: &ComplianceConfig) -> GenericJoint {
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
