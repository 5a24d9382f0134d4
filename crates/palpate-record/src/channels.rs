//! Topics with Foxglove's schemas.

use foxglove::Channel;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    FrameTransform, FrameTransforms, JointState, JointStates, Log, PackedElementField, PointCloud,
    PoseInFrame, SceneUpdate, Timestamp, log,
};
use palpate_spatial::{Pose, Vector3};

use crate::body::{Body, entity};
use crate::recording::Epoch;

fn stamp(nanos: u64) -> Timestamp {
    Timestamp::new((nanos / 1_000_000_000) as u32, (nanos % 1_000_000_000) as u32)
}

pub(crate) fn vector(v: &Vector3) -> foxglove::messages::Vector3 {
    foxglove::messages::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(crate) fn pose(p: &Pose) -> foxglove::messages::Pose {
    let q = p.rotation.quaternion();
    foxglove::messages::Pose {
        position: Some(vector(&p.translation.vector)),
        orientation: Some(foxglove::messages::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
    }
}

/// A topic of frames.
#[derive(Debug)]
pub struct Frames {
    pub(crate) channel: Channel<FrameTransforms>,
    pub(crate) epoch: Epoch,
}

impl Frames {
    /// Writes where the `children` are in `parent`: name and parent_T_child.
    pub fn put<'a>(
        &self,
        t: f64,
        parent: &str,
        children: impl IntoIterator<Item = (&'a str, &'a Pose)>,
    ) {
        let at = self.epoch.at(t);
        let one = |(child, p): (&str, &Pose)| {
            let p = pose(p);
            FrameTransform {
                timestamp: Some(stamp(at)),
                parent_frame_id: parent.into(),
                child_frame_id: child.into(),
                translation: p.position,
                rotation: p.orientation,
            }
        };
        let transforms = children.into_iter().map(one).collect();
        self.channel.log_with_time(&FrameTransforms { transforms }, at);
    }
}

/// A topic of poses.
#[derive(Debug)]
pub struct Poses {
    pub(crate) channel: Channel<PoseInFrame>,
    pub(crate) epoch: Epoch,
    pub(crate) frame: String,
}

impl Poses {
    /// Writes a pose.
    pub fn put(&self, t: f64, p: &Pose) {
        let at = self.epoch.at(t);
        let (timestamp, frame_id) = (Some(stamp(at)), self.frame.clone());
        self.channel.log_with_time(&PoseInFrame { timestamp, frame_id, pose: Some(pose(p)) }, at);
    }
}

/// A topic of joint states.
#[derive(Debug)]
pub struct Joints {
    pub(crate) channel: Channel<JointStates>,
    pub(crate) epoch: Epoch,
    pub(crate) names: Vec<String>,
}

impl Joints {
    /// Writes positions (rad) and velocities (rad/s).
    pub fn put(&self, t: f64, position: &[f64], velocity: &[f64]) {
        let at = self.epoch.at(t);
        let values = position.iter().zip(velocity);
        let joints = self.names.iter().zip(values).map(|(name, (q, dq))| JointState {
            name: name.clone(),
            position: Some(*q),
            velocity: Some(*dq),
            acceleration: None,
            effort: None,
        });
        let joints = joints.collect();
        self.channel.log_with_time(&JointStates { timestamp: Some(stamp(at)), joints }, at);
    }
}

/// A topic of shapes.
#[derive(Debug)]
pub struct Scene {
    pub(crate) channel: Channel<SceneUpdate>,
    pub(crate) epoch: Epoch,
}

impl Scene {
    /// Writes how bodies look from now on; each moves with its frame.
    pub fn put(&self, t: f64, bodies: &[Body]) {
        let at = self.epoch.at(t);
        let entities = bodies.iter().map(|body| entity(body, stamp(at))).collect();
        self.channel.log_with_time(&SceneUpdate { deletions: Vec::new(), entities }, at);
    }
}

/// A topic of coloured points.
#[derive(Debug)]
pub struct Points {
    pub(crate) channel: Channel<PointCloud>,
    pub(crate) epoch: Epoch,
    pub(crate) frame: String,
}

impl Points {
    /// Writes points (m) of one colour (red, green, blue, alpha in 0 … 1).
    pub fn put(&self, t: f64, points: &[Vector3], colour: [f32; 4]) {
        let at = self.epoch.at(t);
        let field = |(i, name): (u32, &str)| PackedElementField {
            name: name.into(),
            offset: if i < 3 { 4 * i } else { 9 + i },
            r#type: if i < 3 { NumericType::Float32 } else { NumericType::Uint8 } as i32,
        };
        let names = ["x", "y", "z", "red", "green", "blue", "alpha"];
        let mut data = Vec::with_capacity(16 * points.len());
        for p in points {
            data.extend(p.iter().flat_map(|x| (*x as f32).to_le_bytes()));
            data.extend(colour.map(|c| (c * 255.0).round() as u8));
        }
        let cloud = PointCloud {
            timestamp: Some(stamp(at)),
            frame_id: self.frame.clone(),
            pose: Some(pose(&Pose::identity())),
            point_stride: 16,
            fields: (0..).zip(names).map(field).collect(),
            data: data.into(),
        };
        self.channel.log_with_time(&cloud, at);
    }
}

/// How loud a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// As it should be.
    Info,
    /// Worth a look.
    Warning,
    /// Stopped.
    Error,
}

/// A topic of lines of text.
#[derive(Debug)]
pub struct Texts {
    pub(crate) channel: Channel<Log>,
    pub(crate) epoch: Epoch,
    pub(crate) name: String,
}

impl Texts {
    /// Writes a line.
    pub fn put(&self, t: f64, level: Level, message: &str) {
        let at = self.epoch.at(t);
        let level = match level {
            Level::Info => log::Level::Info,
            Level::Warning => log::Level::Warning,
            Level::Error => log::Level::Error,
        };
        let line = Log {
            timestamp: Some(stamp(at)),
            level: level as i32,
            message: message.into(),
            name: self.name.clone(),
            file: String::new(),
            line: 0,
        };
        self.channel.log_with_time(&line, at);
    }
}
