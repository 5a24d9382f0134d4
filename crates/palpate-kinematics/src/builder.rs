//! Collects fixed and moving transforms, base to tip, into a chain in normal form.

use nalgebra::SVector;
use palpate_spatial::{Pose, UnitQuaternion};

use crate::chain::{JointKind, JointLimits, Link, SerialChain};
use crate::error::ModelError;
use crate::rigid::Rigid;

/// Position and speed limits of one joint; see [`JointLimits`] for the units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) velocity: f64,
}

/// Normal form: every joint moves about or along its +z, fixed transforms are folded away, and every
/// joint's origin is the point of its axis nearest to the origin before it.
///
/// The last rule changes no pose. It keeps the sum of the offsets, and with it the reach, small even where
/// nearly parallel axes make calibrated Denavit-Hartenberg offsets hundreds of metres long.
#[derive(Debug)]
pub(crate) struct ChainBuilder {
    /// Since the last moving joint.
    pending: Pose,
    links: Vec<Link>,
    names: Vec<String>,
    limits: Vec<Limit>,
}

impl ChainBuilder {
    pub(crate) fn new() -> Self {
        Self { pending: Pose::identity(), links: Vec::new(), names: Vec::new(), limits: Vec::new() }
    }

    /// Appends a fixed transform.
    pub(crate) fn fixed(&mut self, parent_T_child: &Pose) {
        self.pending *= parent_T_child;
    }

    /// Appends a joint; `joint_R_axis` turns +z onto its axis.
    pub(crate) fn joint(
        &mut self,
        name: &str,
        kind: JointKind,
        joint_R_axis: UnitQuaternion,
        limit: Limit,
    ) {
        let mut before = Rigid::from(&(self.pending * joint_R_axis));
        let slide = before.z.dot(&before.p);
        before.p -= before.z * slide;
        self.links.push(Link { before, kind });
        // Sliding along and turning about z commute with the joint's own motion.
        self.pending = Pose::translation(0.0, 0.0, slide) * joint_R_axis.inverse();
        self.names.push(name.to_owned());
        self.limits.push(limit);
    }

    pub(crate) fn finish<const N: usize>(self) -> Result<SerialChain<N>, ModelError> {
        let Self { pending, links, names, limits } = self;
        let links = match <[Link; N]>::try_from(links) {
            Ok(links) => links,
            Err(links) => {
                return Err(ModelError::WrongDof { found: links.len(), expected: N, names });
            }
        };
        let column = |f: fn(&Limit) -> f64| SVector::<f64, N>::from_fn(|i, _| f(&limits[i]));
        let limits = JointLimits {
            lower: column(|l| l.lower),
            upper: column(|l| l.upper),
            velocity: column(|l| l.velocity),
        };
        Ok(SerialChain::new(links, Rigid::from(&pending), limits, names))
    }
}
