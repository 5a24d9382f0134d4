//! Why a model or a pose was refused.

/// A URDF that cannot be used as asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The text is not a URDF.
    #[error("not a readable URDF: {0}")]
    Urdf(#[from] urdf_rs::UrdfError),
    /// A link does not exist.
    #[error("the URDF has no link `{name}`; its links are: {}", links.join(", "))]
    NoLink {
        /// The link asked for.
        name: String,
        /// The links there are.
        links: Vec<String>,
    },
    /// The tip does not hang below the base.
    #[error("link `{tip}` does not hang below link `{base}`")]
    NotConnected {
        /// Base link.
        base: String,
        /// Tip link.
        tip: String,
    },
    /// The joints form a loop.
    #[error("the joints above link `{0}` form a loop")]
    Loop(String),
    /// A joint of a kind that a serial chain cannot have.
    #[error("joint `{joint}` is {kind}; only revolute, continuous, prismatic and fixed joints are supported")]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// What it is.
        kind: String,
    },
    /// A joint axis without direction.
    #[error("joint `{joint}` has the axis {axis:?}, which has no direction")]
    BadAxis {
        /// The joint.
        joint: String,
        /// Its axis.
        axis: [f64; 3],
    },
    /// A joint frame or limit that is not a number, or an empty range.
    #[error("joint `{joint}`: {what}")]
    BadJoint {
        /// The joint.
        joint: String,
        /// What is wrong.
        what: String,
    },
    /// The chain has another number of joints than the type says.
    #[error("the chain has {found} moving joints ({}), but {expected} were expected", names.join(", "))]
    WrongDof {
        /// Joints found.
        found: usize,
        /// Joints expected.
        expected: usize,
        /// Their names.
        names: Vec<String>,
    },
}

/// Why no joint configuration was returned.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IkError {
    /// The target pose is not finite or its quaternion is not of unit length.
    #[error("the target pose is not a finite rigid transform")]
    InvalidTarget,
    /// The seed is not finite or lies outside the joint limits.
    #[error("the seed has joint {joint} at {value:.4} rad, outside [{lower:.4}, {upper:.4}]")]
    SeedOutOfLimits {
        /// Joint index.
        joint: usize,
        /// Its value.
        value: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The target is farther away than the arm stretched out.
    #[error("the target is {beyond:.4} m beyond the arm's reach")]
    Unreachable {
        /// Distance beyond the reach, m.
        beyond: f64,
    },
    /// The iteration did not settle.
    #[error("no solution near the seed after {iterations} iterations: {position:.2e} m and {rotation:.2e} rad remain")]
    NotConverged {
        /// Iterations used.
        iterations: u32,
        /// Position error left, m.
        position: f64,
        /// Rotation error left, rad.
        rotation: f64,
    },
    /// The solution leaves the joint limits.
    #[error("joint {joint} would be at {value:.4} rad, outside [{lower:.4}, {upper:.4}]")]
    LimitViolation {
        /// Joint index.
        joint: usize,
        /// Its value.
        value: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The solution is too far from the seed.
    #[error("joint {joint} would step by {step:.4} rad, more than the allowed {allowed:.4} rad")]
    Discontinuous {
        /// Joint index.
        joint: usize,
        /// Step, rad.
        step: f64,
        /// Allowed step, rad.
        allowed: f64,
    },
}
