//! The file.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;
use std::time::Duration;

use foxglove::{
    Channel, ChannelBuilder, Context, Encode, FoxgloveError, McapWriteOptions, McapWriterHandle,
    RawChannel, Schema,
};

use crate::body::{Body, urdf};
use crate::channels::{Frames, Joints, Points, Poses, Scene, Texts};
use crate::numbers::{self, Numbers};

/// Why a recording cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The writer or a channel refused.
    #[error("cannot record: {0}")]
    Writer(#[from] FoxgloveError),
    /// Another number of values than fields.
    #[error("{topic} has {expected} fields, but {found} values were given")]
    Fields {
        /// The topic.
        topic: String,
        /// Its fields.
        expected: usize,
        /// Values given.
        found: usize,
    },
}

/// When a recording began, as a time of the world, ns since 1970: what all its times count from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Epoch(u64);

impl Epoch {
    /// A time of the recording, s, as one of the world, ns.
    pub(crate) fn at(self, seconds: f64) -> u64 {
        self.0.saturating_add_signed((seconds * 1e9).round() as i64)
    }
}

/// An MCAP file in the making.
#[derive(Debug)]
pub struct Recording {
    context: Arc<Context>,
    writer: McapWriterHandle<Cursor<Vec<u8>>>,
    epoch: Epoch,
}

impl Recording {
    /// A recording that began at this time since 1970.
    pub fn new(epoch: Duration) -> Result<Self, RecordError> {
        let context = Context::new();
        let options = McapWriteOptions::new().compression(None);
        let writer = context.mcap_writer_with_options(options).create(Cursor::new(Vec::new()))?;
        let epoch = Epoch(u64::try_from(epoch.as_nanos()).unwrap_or(u64::MAX));
        Ok(Self { context, writer, epoch })
    }

    fn channel<T: Encode>(&self, topic: &str) -> Channel<T> {
        ChannelBuilder::new(topic).context(&self.context).build()
    }

    fn raw(
        &self,
        topic: &str,
        encoding: &str,
        schema: Schema,
    ) -> Result<Arc<RawChannel>, RecordError> {
        let channel = ChannelBuilder::new(topic).context(&self.context);
        Ok(channel.message_encoding(encoding).schema(schema).build_raw()?)
    }

    /// A topic of numbers with names, all f64. `schema` is their message's name, like `palpate.Wrench`.
    pub fn numbers<S: AsRef<str>>(
        &self,
        topic: &str,
        schema: &str,
        fields: &[S],
    ) -> Result<Numbers, RecordError> {
        let description = Schema::new(schema, "protobuf", numbers::describe(schema, fields));
        let channel = self.raw(topic, "protobuf", description)?;
        Ok(Numbers::new(channel, self.epoch, fields.len()))
    }

    /// A topic of frames, `foxglove.FrameTransforms`.
    pub fn frames(&self, topic: &str) -> Result<Frames, RecordError> {
        Ok(Frames { channel: self.channel(topic), epoch: self.epoch })
    }

    /// A topic of poses in `frame`, `foxglove.PoseInFrame`.
    pub fn poses(&self, topic: &str, frame: &str) -> Result<Poses, RecordError> {
        Ok(Poses { channel: self.channel(topic), epoch: self.epoch, frame: frame.into() })
    }

    /// A topic of joint states, `foxglove.JointStates`.
    pub fn joints(&self, topic: &str, names: &[String]) -> Result<Joints, RecordError> {
        Ok(Joints { channel: self.channel(topic), epoch: self.epoch, names: names.to_vec() })
    }

    /// A topic of shapes, `foxglove.SceneUpdate`: Foxglove draws it, Rerun 0.41 does not.
    pub fn scene(&self, topic: &str) -> Result<Scene, RecordError> {
        Ok(Scene { channel: self.channel(topic), epoch: self.epoch })
    }

    /// A topic of coloured points in `frame`, `foxglove.PointCloud`.
    pub fn points(&self, topic: &str, frame: &str) -> Result<Points, RecordError> {
        Ok(Points { channel: self.channel(topic), epoch: self.epoch, frame: frame.into() })
    }

    /// A topic of lines of text, `foxglove.Log`.
    pub fn texts(&self, topic: &str) -> Result<Texts, RecordError> {
        Ok(Texts { channel: self.channel(topic), epoch: self.epoch, name: topic.into() })
    }

    /// Says once how everything looks: as shapes on `/scene`, and as a URDF of the robot `name` on
    /// `/robot_description`, which Rerun draws and Foxglove can. Where the shapes' frames are is told by
    /// [`frames`](Self::frames), never by the URDF.
    pub fn describe(&self, name: &str, root: &str, bodies: &[Body]) -> Result<(), RecordError> {
        self.scene("/scene")?.put(0.0, bodies);
        let schema = Schema::new("std_msgs/msg/String", "ros2msg", &b"string data"[..]);
        let channel = self.raw("/robot_description", "cdr", schema)?;
        let text = cdr_string(&urdf(name, root, bodies));
        channel.log_with_meta(&text, meta(self.epoch.at(0.0)));
        Ok(())
    }

    /// Facts about the whole recording.
    pub fn facts(&self, name: &str, facts: BTreeMap<String, String>) -> Result<(), RecordError> {
        Ok(self.writer.write_metadata(name, facts)?)
    }

    /// The file.
    pub fn finish(self) -> Result<Vec<u8>, RecordError> {
        Ok(self.writer.close()?.into_inner())
    }
}

pub(crate) fn meta(log_time: u64) -> foxglove::PartialMetadata {
    foxglove::PartialMetadata::with_log_time(log_time)
}

/// A ROS 2 string: encapsulation header (little-endian CDR), length with the terminating zero, text, zero.
fn cdr_string(text: &str) -> Vec<u8> {
    let length = u32::try_from(text.len() + 1).unwrap_or(u32::MAX);
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(length.to_le_bytes());
    bytes.extend(text.bytes());
    bytes.push(0);
    bytes
}
