//! How far the arm is from where it must not be, and how fast that can change.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::SerialChain;
use palpate_spatial::{DOF, JointVector, Vector3};

use super::capsule::segment_distance;
use super::config::{Plane, Workspace};
use super::shape::{ArmShape, ShapeError};

/// More than an arm and its tool need; the geometry of a tick lives on the stack.
const MAX_CAPSULES: usize = 12;

/// What the arm would come too near to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// A face of the workspace box: axis 0–2, upper or lower.
    Workspace {
        /// Base axis.
        axis: usize,
        /// Whether it is the upper face.
        upper: bool,
    },
    /// A plane, by its place in the configuration.
    Plane(usize),
    /// Two capsules, by their places in the shape; the tool comes last.
    Pair(usize, usize),
}

impl std::fmt::Display for Obstacle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Workspace { axis, upper } => {
                let (side, axis) =
                    (if *upper { "upper" } else { "lower" }, ["x", "y", "z"][axis % 3]);
                write!(f, "the {side} {axis} face of the workspace")
            }
            Self::Plane(i) => write!(f, "plane {i}"),
            Self::Pair(a, b) => write!(f, "itself (capsules {a} and {b})"),
        }
    }
}

/// The least distance, beyond the configured clearance, and to what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// m; negative: too near.
    pub distance: f64,
    /// The nearest obstacle.
    pub obstacle: Obstacle,
}

#[derive(Clone, Copy, Debug)]
struct Body {
    /// Moving link, or none for the base.
    link: Option<usize>,
    ends: [Vector3; 2],
    radius: f64,
}

#[derive(Clone, Debug)]
struct HalfSpace {
    normal: Vector3,
    offset: f64,
    capsules: Vec<usize>,
}

/// Box, planes and capsules of one arm.
#[derive(Clone, Debug)]
pub struct Geometry {
    bodies: Vec<Body>,
    pairs: Vec<(usize, usize)>,
    planes: Vec<HalfSpace>,
    workspace: Workspace,
    margin: f64,
    /// No checked point moves farther per radian of a joint than this, m/rad.
    levers: JointVector,
}

impl Geometry {
    /// Of `shape` (tool included) on `chain` (base to tool centre point).
    pub fn new(
        chain: &SerialChain<DOF>,
        shape: &ArmShape,
        workspace: Workspace,
        planes: &[Plane],
        margin: f64,
    ) -> Result<Self, ShapeError> {
        let bad = |name: &str, what: &str| ShapeError::Bad { name: name.into(), what: what.into() };
        if shape.capsules.len() > MAX_CAPSULES {
            return Err(bad("tool", &format!("more than {MAX_CAPSULES} capsules")));
        }
        for c in &shape.capsules {
            if c.joint > DOF {
                return Err(bad(&c.name, &format!("joint {} of {DOF}", c.joint)));
            }
            let finite = c.from.iter().chain(&c.to).all(|x| x.is_finite());
            if !(finite && c.radius > 0.0 && c.radius.is_finite()) {
                return Err(bad(&c.name, "its figures must be finite and its radius positive"));
            }
        }
        let body = |c: &super::shape::LinkCapsule| Body {
            link: c.joint.checked_sub(1),
            ends: [c.from, c.to],
            radius: c.radius,
        };
        let pair = |[a, b]: &[String; 2]| Ok((shape.index(a)?, shape.index(b)?));
        let half_space = |p: &Plane| {
            Ok(HalfSpace {
                normal: p.normal,
                offset: p.offset,
                capsules: p.capsules.iter().map(|c| shape.index(c)).collect::<Result<_, _>>()?,
            })
        };
        let bodies: Vec<Body> = shape.capsules.iter().map(body).collect();
        Ok(Self {
            levers: levers(chain, &bodies),
            bodies,
            pairs: shape.pairs.iter().map(pair).collect::<Result<_, ShapeError>>()?,
            planes: planes.iter().map(half_space).collect::<Result<_, ShapeError>>()?,
            workspace,
            margin,
        })
    }

    /// The least distance at joints `q`; NaN joints are too near to everything.
    pub fn clearance(&self, chain: &SerialChain<DOF>, q: &JointVector) -> Clearance {
        let (links, tip) = chain.frames(q);
        let mut least =
            Clearance { distance: f64::INFINITY, obstacle: Obstacle::Plane(usize::MAX) };
        let mut near = |distance: f64, obstacle| {
            if !(distance >= least.distance) {
                least = Clearance { distance, obstacle };
            }
        };
        for axis in 0..3 {
            let (x, min, max) =
                (tip.origin[axis], self.workspace.min[axis], self.workspace.max[axis]);
            near(x - min, Obstacle::Workspace { axis, upper: false });
            near(max - x, Obstacle::Workspace { axis, upper: true });
        }
        let mut ends = [[Vector3::zeros(); 2]; MAX_CAPSULES];
        for (end, body) in ends.iter_mut().zip(&self.bodies) {
            *end = match body.link {
                Some(i) => [links[i].point(&body.ends[0]), links[i].point(&body.ends[1])],
                None => body.ends,
            };
        }
        for (i, plane) in self.planes.iter().enumerate() {
            for &c in &plane.capsules {
                let height = plane.normal.dot(&ends[c][0]).min(plane.normal.dot(&ends[c][1]));
                let distance = height - plane.offset - self.bodies[c].radius - self.margin;
                near(distance, Obstacle::Plane(i));
            }
        }
        for &(a, b) in &self.pairs {
            let radii = self.bodies[a].radius + self.bodies[b].radius;
            let distance = segment_distance(&ends[a], &ends[b]) - radii - self.margin;
            near(distance, Obstacle::Pair(a, b));
        }
        least
    }

    /// No distance shrinks by more than this while the joints move by `sweep` (rad each), m.
    pub fn travel(&self, sweep: &JointVector) -> f64 {
        self.levers.dot(sweep)
    }

    /// Capsule ends in base axes and radii, for drawing and for independent checks.
    pub fn capsules(&self, chain: &SerialChain<DOF>, q: &JointVector) -> Vec<([Vector3; 2], f64)> {
        let (links, _) = chain.frames(q);
        let place = |b: &Body| match b.link {
            Some(i) => (b.ends.map(|e| links[i].point(&e)), b.radius),
            None => (b.ends, b.radius),
        };
        self.bodies.iter().map(place).collect()
    }
}

/// For each joint the farthest that a checked point can be from its axis.
///
/// The first offset counts without its part along the axis, later ones in full: offsets between joint
/// origins do not change with revolute joints.
fn levers(chain: &SerialChain<DOF>, bodies: &[Body]) -> JointVector {
    let (links, tip) = chain.frames(&JointVector::zeros());
    JointVector::from_fn(|joint, _| {
        let off_axis = |v: Vector3| {
            let axis = links[joint].rotation.column(2);
            (v - axis * axis.dot(&v)).norm()
        };
        // From the joint's origin to that of a later link, the last piece being a point on that link.
        let reach = |link: usize, end: Vector3| {
            let mut points: Vec<Vector3> = (joint..=link).map(|i| links[i].origin).collect();
            points.push(end);
            let pieces = points.windows(2).map(|w| w[1] - w[0]).enumerate();
            pieces
                .map(|(k, piece)| if k == 0 { off_axis(piece) } else { piece.norm() })
                .sum::<f64>()
        };
        let mut farthest = reach(DOF - 1, tip.origin);
        for body in bodies {
            if let Some(link) = body.link.filter(|&l| l >= joint) {
                for end in &body.ends {
                    farthest = farthest.max(reach(link, links[link].point(end)));
                }
            }
        }
        farthest
    })
}
