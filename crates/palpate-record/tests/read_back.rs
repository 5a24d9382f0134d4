//! What is written reads back: by the MCAP library, by protobuf descriptions, by a URDF parser.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::time::Duration;

use foxglove::messages::{FrameTransforms, PointCloud, SceneUpdate};
use palpate_record::{Body, Form, Level, RecordError, Recording, urdf};
use palpate_spatial::{Pose, Vector3};
use prost::Message as _;
use prost_types::FileDescriptorSet;

const EPOCH: Duration = Duration::from_secs(1_700_000_000);

fn bodies() -> Vec<Body> {
    let half_turn = Pose::rotation(Vector3::x() * std::f64::consts::PI);
    vec![
        Body::new("arm", "link & 1", [0.5, 0.5, 0.5, 1.0])
            .with_capsule(Vector3::zeros(), Vector3::new(0.0, 0.3, 0.0), 0.05)
            .with_capsule(Vector3::zeros(), Vector3::new(0.0, 0.0, -0.1), 0.04),
        Body::new("board", "hole", [0.1, 0.2, 0.3, 0.4])
            .with(half_turn, Form::Box { size: Vector3::new(0.1, 0.2, 0.01) }),
    ]
}

/// Topic, schema name, schema, log time and bytes of every message.
type Message = (String, String, Vec<u8>, u64, Vec<u8>);

fn messages(file: &[u8]) -> Vec<Message> {
    mcap::MessageStream::new(file)
        .unwrap()
        .map(|message| {
            let m = message.unwrap();
            let schema = m.channel.schema.as_ref().unwrap();
            let (name, data) = (schema.name.clone(), schema.data.to_vec());
            (m.channel.topic.clone(), name, data, m.log_time, m.data.to_vec())
        })
        .collect()
}

#[test]
fn numbers_carry_their_description_and_keep_what_is_missing_apart_from_zero() {
    let recording = Recording::new(EPOCH).unwrap();
    let numbers =
        recording.numbers("/action", "palpate.Action", &["motion.x", "gain", "s"]).unwrap();
    numbers.put(0.5, &[1.5, f64::NAN, 0.0]).unwrap();
    let wrong = numbers.put(0.5, &[1.0]).unwrap_err();
    assert!(matches!(wrong, RecordError::Fields { expected: 3, found: 1, .. }), "{wrong}");
    let file = recording.finish().unwrap();
    let messages = messages(&file);
    let [(topic, name, schema, time, bytes)] = &messages[..] else { panic!("{messages:?}") };
    assert_eq!((topic.as_str(), name.as_str()), ("/action", "palpate.Action"));
    assert_eq!(*time, 1_700_000_000_500_000_000);

    let described = FileDescriptorSet::decode(&schema[..]).unwrap();
    let file = &described.file[0];
    assert_eq!((file.package(), file.message_type[0].name()), ("palpate", "Action"));
    let fields: Vec<_> =
        file.message_type[0].field.iter().map(|f| (f.name(), f.number())).collect();
    assert_eq!(fields, [("motion_x", 1), ("gain", 2), ("s", 3)]);

    // Tag 1 and 3 as fixed 64-bit numbers; nothing for the NaN; zero is said.
    let mut expected = vec![1 << 3 | 1];
    expected.extend(1.5f64.to_le_bytes());
    expected.push(3 << 3 | 1);
    expected.extend(0f64.to_le_bytes());
    assert_eq!(*bytes, expected);
}

#[test]
fn frames_points_and_texts_are_foxgloves() {
    let recording = Recording::new(EPOCH).unwrap();
    let p = Pose::translation(0.1, 0.2, 0.3);
    recording.frames("/frames").unwrap().put(1.25, "base", [("tool", &p), ("hole", &p)]);
    let points = recording.points("/line", "base").unwrap();
    points.put(2.0, &[Vector3::new(1.0, 2.0, 3.0)], [1.0, 0.0, 0.5, 1.0]);
    recording.texts("/log").unwrap().put(3.0, Level::Error, "stopped");
    let file = recording.finish().unwrap();
    let messages = messages(&file);
    let names: Vec<_> = messages.iter().map(|m| m.1.as_str()).collect();
    assert_eq!(names, ["foxglove.FrameTransforms", "foxglove.PointCloud", "foxglove.Log"]);

    let frames = FrameTransforms::decode(&messages[0].4[..]).unwrap();
    let tool = &frames.transforms[0];
    assert_eq!((tool.parent_frame_id.as_str(), tool.child_frame_id.as_str()), ("base", "tool"));
    assert_eq!(tool.timestamp.unwrap().total_nanos(), messages[0].3);
    assert_eq!(tool.translation.unwrap().z, 0.3);
    assert_eq!(frames.transforms.len(), 2);

    let cloud = PointCloud::decode(&messages[1].4[..]).unwrap();
    assert_eq!((cloud.point_stride, cloud.data.len()), (16, 16));
    assert_eq!(cloud.data[4..8], 2f32.to_le_bytes());
    assert_eq!(cloud.data[12..], [255, 0, 128, 255]);
    let offsets: Vec<_> = cloud.fields.iter().map(|f| f.offset).collect();
    assert_eq!(offsets, [0, 4, 8, 12, 13, 14, 15]);
}

#[test]
fn shapes_are_a_scene_and_a_urdf_that_parses() {
    let recording = Recording::new(EPOCH).unwrap();
    recording.describe("demo", "base", &bodies()).unwrap();
    recording.facts("about", BTreeMap::from([("task".into(), "peg".into())])).unwrap();
    let file = recording.finish().unwrap();
    let messages = messages(&file);
    let scene = SceneUpdate::decode(&messages[0].4[..]).unwrap();
    assert_eq!(scene.entities[0].frame_id, "link & 1");
    assert_eq!((scene.entities[0].cylinders.len(), scene.entities[0].spheres.len()), (2, 4));
    assert_eq!(scene.entities[1].cubes[0].color.unwrap().a, f64::from(0.4f32));

    let (_, name, schema, _, bytes) = &messages[1];
    assert_eq!((name.as_str(), &schema[..]), ("std_msgs/msg/String", &b"string data"[..]));
    let text = urdf("demo", "base", &bodies());
    assert_eq!(bytes[..4], [0, 1, 0, 0], "little-endian CDR");
    assert_eq!(u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize, text.len() + 1);
    assert_eq!(bytes[8..bytes.len() - 1], *text.as_bytes());
    assert_eq!(bytes.last(), Some(&0));

    let robot = urdf_rs::read_from_string(&text).unwrap();
    let links: Vec<_> = robot.links.iter().map(|l| (l.name.as_str(), l.visual.len())).collect();
    assert_eq!(links, [("base", 0), ("link & 1", 6), ("hole", 1)]);
    assert!(robot.joints.iter().all(|j| j.joint_type == urdf_rs::JointType::Floating));
    // The cylinder along y: its z axis is turned there.
    let rpy = robot.links[1].visual[0].origin.rpy;
    let turn = nalgebra::UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    assert!((turn * Vector3::z() - Vector3::y()).norm() < 1e-12);
    let about = mcap::Summary::read(&file).unwrap().unwrap();
    assert_eq!(about.metadata_indexes.len(), 1);
}
