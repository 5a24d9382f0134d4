//! Why a model or a pose was refused.

/// A description of an arm that cannot be used as asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The text is not a URDF.
    #[error("not a readable URDF: {0}")]
    Urdf(#[from] urdf_rs::UrdfError),
    /// A link does not exist.
    #[error("the URDF has no link `{name}`; {}its links are: {}", suggestion(nearest.as_deref()), links.join(", "))]
    NoLink {
        /// The link asked for.
        name: String,
        /// The link whose name is most like it, if one is.
        nearest: Option<String>,
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
    /// Two joints carry the same link.
    #[error("link `{0}` is the child of more than one joint")]
    TwoParents(String),
    /// A joint of a kind that a serial chain cannot have.
    #[error(
        "joint `{joint}` is {kind}; only revolute, continuous, prismatic and fixed joints are supported"
    )]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// What it is.
        kind: &'static str,
    },
    /// A joint axis without direction, a frame that is not finite, or an empty range.
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
    /// The chain is not the Universal Robots arm it was said to be.
    #[error(
        "the chain is not a {model}: it departs from its figures by {position:.3} m and {rotation:.3} rad, \
         more than a calibration explains"
    )]
    NotThisArm {
        /// The arm it should be.
        model: &'static str,
        /// Largest departure found, m.
        position: f64,
        /// Largest departure found, rad.
        rotation: f64,
    },
}

impl ModelError {
    pub(crate) fn no_link(name: &str, links: Vec<String>) -> Self {
        let likeness =
            |link: &str| strsim::jaro_winkler(&name.to_lowercase(), &link.to_lowercase());
        let nearest = links.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        let nearest = nearest.filter(|link| likeness(link) > 0.8).cloned();
        Self::NoLink { name: name.into(), nearest, links }
    }
}

fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |link| format!("did you mean `{link}`? "))
}

/// Why no joint configuration was returned.
///
/// Joints are counted from 0 at the base. Of a prismatic joint, read m for rad.
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
    /// No configuration reaches the target, whatever the limits.
    #[error("the target is {beyond:.4} m beyond the arm's reach")]
    Unreachable {
        /// By how much the arm is too short (or, next to its own base, too long), m.
        beyond: f64,
    },
    /// The iteration did not settle.
    #[error(
        "no solution near the seed after {iterations} iterations: {position:.2e} m and {rotation:.2e} rad remain"
    )]
    NotConverged {
        /// Iterations used.
        iterations: u32,
        /// Position error left, m.
        position: f64,
        /// Rotation error left, rad.
        rotation: f64,
    },
    /// The solution leaves the joint limits, or comes nearer to them than the margin.
    #[error("joint {joint} would be at {value:.4} rad, outside [{lower:.4}, {upper:.4}]")]
    LimitViolation {
        /// Joint index.
        joint: usize,
        /// Its value.
        value: f64,
        /// Lower limit, margin included.
        lower: f64,
        /// Upper limit, margin included.
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
    /// The solution is nearer to a singularity than allowed.
    #[error(
        "the smallest singular value would be {sigma_min:.2e}, below the required {required:.2e}"
    )]
    NearSingular {
        /// Smallest singular value of the Jacobian at the solution.
        sigma_min: f64,
        /// Least value that the options accept.
        required: f64,
    },
}
