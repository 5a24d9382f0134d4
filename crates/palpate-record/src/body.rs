//! How things look: boxes, cylinders and spheres that move with a frame.

use std::fmt::Write as _;

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, SceneEntity, SpherePrimitive, Timestamp,
};
use nalgebra::UnitQuaternion;
use palpate_spatial::{Pose, Vector3};

use crate::channels::{pose, vector};

/// A shape, its middle in the origin and its axis along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A box with these sides, m.
    Box {
        /// Along x, y and z.
        size: Vector3,
    },
    /// A cylinder.
    Cylinder {
        /// m.
        radius: f64,
        /// m.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// m.
        radius: f64,
    },
}

/// Shapes of one colour that move with a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    name: String,
    frame: String,
    colour: [f32; 4],
    shapes: Vec<(Pose, Form)>,
}

impl Body {
    /// A body without shapes. The colour is red, green, blue and alpha in 0 … 1.
    pub fn new(name: &str, frame: &str, colour: [f32; 4]) -> Self {
        Self { name: name.into(), frame: frame.into(), colour, shapes: Vec::new() }
    }

    /// The body with one shape more, at `frame_T_shape`.
    pub fn with(mut self, frame_T_shape: Pose, form: Form) -> Self {
        self.shapes.push((frame_T_shape, form));
        self
    }

    /// The body with a cylinder more that has balls at its ends.
    pub fn with_capsule(self, from: Vector3, to: Vector3, radius: f64) -> Self {
        let axis = to - from;
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_else(|| {
            // Against z: any half turn about an axis across it.
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        });
        let middle = Pose::from_parts(((from + to) * 0.5).into(), turn);
        let end = |p: Vector3| Pose::translation(p.x, p.y, p.z);
        self.with(middle, Form::Cylinder { radius, length: axis.norm() })
            .with(end(from), Form::Sphere { radius })
            .with(end(to), Form::Sphere { radius })
    }
}

/// A body as Foxglove draws it.
pub(crate) fn entity(body: &Body, timestamp: Timestamp) -> SceneEntity {
    let [r, g, b, a] = body.colour.map(f64::from);
    let color = Some(Color { r, g, b, a });
    let mut entity = SceneEntity {
        timestamp: Some(timestamp),
        frame_id: body.frame.clone(),
        id: body.name.clone(),
        frame_locked: true,
        ..SceneEntity::default()
    };
    for (at, form) in &body.shapes {
        let pose = Some(pose(at));
        let ball = |r: f64, length: f64| Some(vector(&Vector3::new(2.0 * r, 2.0 * r, length)));
        match *form {
            Form::Box { size } => {
                entity.cubes.push(CubePrimitive { pose, size: Some(vector(&size)), color });
            }
            Form::Cylinder { radius, length } => entity.cylinders.push(CylinderPrimitive {
                pose,
                size: ball(radius, length),
                bottom_scale: 1.0,
                top_scale: 1.0,
                color,
            }),
            Form::Sphere { radius } => entity.spheres.push(SpherePrimitive {
                pose,
                size: ball(radius, 2.0 * radius),
                color,
            }),
        }
    }
    entity
}

/// The bodies as a URDF whose links are their frames. All joints float: where the frames are is said elsewhere.
pub fn urdf(name: &str, root: &str, bodies: &[Body]) -> String {
    let mut frames: Vec<&str> = vec![root];
    for body in bodies {
        if !frames.contains(&body.frame.as_str()) {
            frames.push(&body.frame);
        }
    }
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escape(name));
    for frame in &frames {
        _ = writeln!(text, "  <link name=\"{}\">", escape(frame));
        for body in bodies.iter().filter(|body| body.frame == *frame) {
            for (i, (at, form)) in body.shapes.iter().enumerate() {
                visual(&mut text, body, i, at, form);
            }
        }
        text += "  </link>\n";
    }
    for frame in &frames[1..] {
        let (parent, child) = (escape(root), escape(frame));
        _ = writeln!(
            text,
            "  <joint name=\"{parent}_{child}\" type=\"floating\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>"
        );
    }
    text + "</robot>\n"
}

fn visual(text: &mut String, body: &Body, number: usize, at: &Pose, form: &Form) {
    let p = at.translation.vector;
    let (roll, pitch, yaw) = at.rotation.euler_angles();
    let shape = match form {
        Form::Box { size } => format!("<box size=\"{} {} {}\"/>", size.x, size.y, size.z),
        Form::Cylinder { radius, length } => {
            format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
        }
        Form::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
    };
    let [r, g, b, a] = body.colour;
    let name = escape(&body.name);
    _ = writeln!(
        text,
        "    <visual name=\"{name}_{number}\"><origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>\
         <geometry>{shape}</geometry>\
         <material name=\"{name}\"><color rgba=\"{r} {g} {b} {a}\"/></material></visual>",
        p.x, p.y, p.z
    );
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
