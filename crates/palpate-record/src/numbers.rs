//! Named numbers as protobuf messages whose description travels with the file.

use std::sync::Arc;

use foxglove::RawChannel;
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use crate::recording::{Epoch, RecordError, meta};

/// A topic of named numbers.
#[derive(Debug)]
pub struct Numbers {
    channel: Arc<RawChannel>,
    epoch: Epoch,
    fields: usize,
}

impl Numbers {
    pub(crate) fn new(channel: Arc<RawChannel>, epoch: Epoch, fields: usize) -> Self {
        Self { channel, epoch, fields }
    }

    /// Writes all numbers, in the order of the fields. A NaN is left out and reads as nothing.
    pub fn put(&self, t: f64, values: &[f64]) -> Result<(), RecordError> {
        if values.len() != self.fields {
            return Err(RecordError::Fields {
                topic: self.channel.topic().into(),
                expected: self.fields,
                found: values.len(),
            });
        }
        let mut bytes = Vec::with_capacity(10 * values.len());
        for (tag, value) in (1..).zip(values).filter(|(_, value)| !value.is_nan()) {
            prost::encoding::double::encode(tag, value, &mut bytes);
        }
        self.channel.log_with_meta(&bytes, meta(self.epoch.at(t)));
        Ok(())
    }
}

/// The description of a message `package.Name` with these f64 fields.
pub(crate) fn describe<S: AsRef<str>>(schema: &str, fields: &[S]) -> Vec<u8> {
    let (package, name) = schema.rsplit_once('.').unwrap_or(("", schema));
    let field = |(number, label): (i32, &S)| FieldDescriptorProto {
        name: Some(identifier(label.as_ref())),
        number: Some(number),
        label: Some(Label::Optional as i32),
        r#type: Some(Type::Double as i32),
        // Told apart from zero: a number that is missing stays missing.
        proto3_optional: Some(true),
        oneof_index: Some(number - 1),
        ..FieldDescriptorProto::default()
    };
    let oneof = |label: &S| prost_types::OneofDescriptorProto {
        name: Some(format!("_{}", identifier(label.as_ref()))),
        ..prost_types::OneofDescriptorProto::default()
    };
    let message = DescriptorProto {
        name: Some(name.into()),
        field: (1..).zip(fields).map(field).collect(),
        oneof_decl: fields.iter().map(oneof).collect(),
        ..DescriptorProto::default()
    };
    let file = FileDescriptorProto {
        name: Some(format!("{}.proto", schema.replace('.', "/"))),
        package: Some(package.into()),
        message_type: vec![message],
        syntax: Some("proto3".into()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// A name that protobuf takes: `motion.x` becomes `motion_x`.
fn identifier(label: &str) -> String {
    label.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}
