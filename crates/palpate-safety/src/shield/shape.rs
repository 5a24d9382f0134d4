//! The arm's shape as capsules, from a TOML text.

use palpate_spatial::Vector3;

use super::capsule::Capsule;

/// Capsules of an arm and the pairs of them that could collide.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmShape {
    /// Where the figures come from.
    pub source: String,
    /// The capsules.
    pub capsules: Vec<LinkCapsule>,
    /// Names of capsules that must keep their distance. The tool is `tool`.
    pub pairs: Vec<[String; 2]>,
}

/// A capsule that moves with a link.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkCapsule {
    /// Its name.
    pub name: String,
    /// The joint that moves it, 1 at the base; 0: it stands still.
    pub joint: usize,
    /// One end, m, in the frame of that joint's child link (0: base axes).
    pub from: Vector3,
    /// The other end, m.
    pub to: Vector3,
    /// Radius, m.
    pub radius: f64,
}

/// A shape that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// Neither a built-in name nor a readable file.
    #[error("`{name}` is neither built in (ur3e, ur5e, ur10e) nor a readable file: {error}")]
    Unknown {
        /// The name.
        name: String,
        /// What the file system said.
        error: std::io::Error,
    },
    /// Not a shape.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// A name that no capsule has.
    #[error("there is no capsule `{name}`; there are: {known}")]
    NoCapsule {
        /// The name.
        name: String,
        /// Those that exist.
        known: String,
    },
    /// A figure out of range.
    #[error("capsule `{name}`: {what}")]
    Bad {
        /// The capsule.
        name: String,
        /// What is wrong.
        what: String,
    },
}

impl ArmShape {
    /// A built-in shape, or one from a file.
    pub fn named(name: &str) -> Result<Self, ShapeError> {
        let text = match name {
            "ur3e" => include_str!("../../../../assets/robots/ur3e.capsules.toml"),
            "ur5e" => include_str!("../../../../assets/robots/ur5e.capsules.toml"),
            "ur10e" => include_str!("../../../../assets/robots/ur10e.capsules.toml"),
            path => {
                let text = std::fs::read_to_string(path)
                    .map_err(|error| ShapeError::Unknown { name: path.into(), error })?;
                return Self::from_toml(&text);
            }
        };
        Self::from_toml(text)
    }

    /// A shape from its text.
    pub fn from_toml(text: &str) -> Result<Self, ShapeError> {
        Ok(toml::from_str(text)?)
    }

    /// The same with a tool on the flange; `last_T_tool0` maps tool0 axes to the last link's.
    pub(crate) fn with_tool(
        mut self,
        tool: &Capsule,
        last_T_tool0: &palpate_spatial::Pose,
    ) -> Self {
        self.capsules.push(LinkCapsule {
            name: "tool".into(),
            joint: palpate_spatial::DOF,
            from: last_T_tool0 * nalgebra::Point3::from(tool.from) - nalgebra::Point3::origin(),
            to: last_T_tool0 * nalgebra::Point3::from(tool.to) - nalgebra::Point3::origin(),
            radius: tool.radius,
        });
        self
    }

    /// Index of a capsule.
    pub(crate) fn index(&self, name: &str) -> Result<usize, ShapeError> {
        self.capsules.iter().position(|c| c.name == name).ok_or_else(|| ShapeError::NoCapsule {
            name: name.into(),
            known: self.capsules.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", "),
        })
    }
}
