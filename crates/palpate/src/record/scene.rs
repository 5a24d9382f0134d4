//! How the arm, its tool and the part look, from the same figures that the simulator and the shield use.

use anyhow::Context as _;
use nalgebra::UnitQuaternion;
use palpate_kinematics::SerialChain;
use palpate_record::{Body, Form};
use palpate_safety::shield::ArmShape;
use palpate_sim::{PegShape, SimConfig};
use palpate_spatial::{DOF, Pose, Vector3};

use crate::Config;

/// Frame of the tool centre point.
pub(super) const TOOL: &str = "tool";
/// Frame of the hole.
pub(super) const HOLE: &str = "hole";

const ARM: [f32; 4] = [0.66, 0.70, 0.75, 1.0];
const GRIPPER: [f32; 4] = [0.28, 0.30, 0.33, 1.0];
/// So that the tool shows through.
const BOARD: [f32; 4] = [0.35, 0.55, 0.80, 0.45];
const PART: [f32; 4] = [0.90, 0.55, 0.15, 1.0];

/// Names of the frames that the joints move, base to tip: the joints' without `_joint`.
pub(super) fn link_names(chain: &SerialChain<DOF>) -> Vec<String> {
    let name = |joint: &String| joint.strip_suffix("_joint").unwrap_or(joint).to_owned();
    chain.joint_names().iter().map(name).collect()
}

/// Everything there is to see.
pub(super) fn bodies(config: &Config, chain: &SerialChain<DOF>) -> anyhow::Result<Vec<Body>> {
    let mut bodies = arm(config, chain)?;
    let sim = &config.sim;
    let (held, fixed) =
        if sim.ring_on_tool() { (ring(sim), peg(sim)) } else { (peg(sim), ring(sim)) };
    let part = if sim.ring_on_tool() { sim.hole.depth } else { sim.peg.length };
    let body = (sim.tool.length - part).max(0.0);
    let (side, middle) = (2.0 * sim.tool.half_width, -part - body / 2.0);
    let gripper = Form::Box { size: Vector3::new(side, side, body) };
    bodies.push(Body::new("gripper", TOOL, GRIPPER).with(along_z(middle), gripper));
    // The tool's z axis points into the hole, the hole's out of it.
    let turned = Pose::rotation(Vector3::x() * std::f64::consts::PI);
    let shapes = |body: Body, shapes: Vec<(Pose, Form)>, at: Pose| {
        shapes.into_iter().fold(body, |body, (pose, form)| body.with(at * pose, form))
    };
    bodies.push(shapes(Body::new("held part", TOOL, PART), held, turned));
    bodies.push(shapes(Body::new("fixed part", HOLE, BOARD), fixed, Pose::identity()));
    for (i, obstacle) in sim.obstacles.iter().enumerate() {
        // Tables are drawn as thin as a plate and no wider than a picture bears.
        let half = Vector3::from(obstacle.half);
        let top = obstacle.centre[2] + half.z;
        let shown = Vector3::new(half.x.min(0.35), half.y.min(0.35), half.z.min(0.005));
        let at = Pose::translation(obstacle.centre[0], obstacle.centre[1], top - shown.z);
        let form = Form::Box { size: shown * 2.0 };
        bodies.push(
            Body::new(&format!("obstacle {i}"), HOLE, [0.85, 0.85, 0.82, 1.0]).with(at, form),
        );
    }
    Ok(bodies)
}

/// The arm's capsules; none for an arm whose shape nobody knows.
fn arm(config: &Config, chain: &SerialChain<DOF>) -> anyhow::Result<Vec<Body>> {
    let shape = match &config.safety.shield {
        Some(shield) => ArmShape::named(&shield.shape).context("safety.shield.shape")?,
        None => match ArmShape::named(&config.robot.urdf) {
            Ok(shape) => shape,
            Err(_) => return Ok(Vec::new()),
        },
    };
    let links = link_names(chain);
    let frame = |joint: usize| match joint.checked_sub(1).and_then(|i| links.get(i)) {
        Some(link) => link.as_str(),
        None => config.robot.base_link.as_str(),
    };
    let body = |c: &palpate_safety::shield::LinkCapsule| {
        Body::new(&c.name, frame(c.joint), ARM).with_capsule(c.from, c.to, c.radius)
    };
    Ok(shape.capsules.iter().map(body).collect())
}

fn along_z(z: f64) -> Pose {
    Pose::translation(0.0, 0.0, z)
}

fn turned_z(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

/// A peg with its tip in the origin, the rest of it in −z: as a bolt seen from outside and, turned, as a peg in a tool.
fn peg(sim: &SimConfig) -> Vec<(Pose, Form)> {
    let (width, length) = (sim.peg.width, sim.peg.length);
    // A held peg reaches back from the tip, a bolt up from its foot.
    let middle = if sim.ring_on_tool() { along_z(-length / 2.0) } else { along_z(length / 2.0) };
    match sim.peg.shape {
        PegShape::Square => vec![(middle, Form::Box { size: Vector3::new(width, width, length) })],
        PegShape::Round => vec![(middle, Form::Cylinder { radius: width / 2.0, length })],
        PegShape::Hexagonal => (0..3)
            .map(|k| {
                let turn = turned_z(f64::from(k) * std::f64::consts::FRAC_PI_3);
                let side = width / 3f64.sqrt();
                let pose = Pose::from_parts(middle.translation, turn);
                (pose, Form::Box { size: Vector3::new(width, side, length) })
            })
            .collect(),
    }
}

/// A board or ring with its mouth in the origin, its body in −z.
fn ring(sim: &SimConfig) -> Vec<(Pose, Form)> {
    let (inner, outer, depth) = (sim.hole_half_width(), sim.hole.board_half_width, sim.hole.depth);
    // A held ring is drawn from its mouth back into the tool: the mouth lies at the tool's tip.
    let z = if sim.ring_on_tool() { depth / 2.0 } else { -depth / 2.0 };
    let sides = match sim.peg.shape {
        PegShape::Square => 4,
        PegShape::Hexagonal => 6,
        PegShape::Round => 24,
    };
    let step = std::f64::consts::TAU / f64::from(sides);
    // Slabs around the hole; those of a square board meet at its corners.
    let thick = outer - inner;
    (0..sides)
        .map(|k| {
            let turn = turned_z(f64::from(k) * step);
            let at = turn * Vector3::new(inner + thick / 2.0, 0.0, z);
            let width = if sides == 4 && k % 2 == 1 {
                2.0 * inner
            } else {
                2.0 * outer * (step / 2.0).tan()
            };
            (
                Pose::from_parts(at.into(), turn),
                Form::Box { size: Vector3::new(thick, width, depth) },
            )
        })
        .collect()
}
