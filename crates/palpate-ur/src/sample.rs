//! One data packet of the controller, by name.

use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3, Wrench};

use crate::UrError;
use crate::config::ForcePoint;
use crate::proto::{DataType, Recipe, Record, RobotMode, RuntimeState, SafetyStatus, Value};
use crate::registers::{REPORT, Status};

/// What the arm reports every cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Controller clock, s.
    pub timestamp: f64,
    /// Measured joints, rad.
    pub actual_q: [f64; 6],
    /// Measured joint speeds, rad/s.
    pub actual_qd: [f64; 6],
    /// Joints that the controller is steering to, rad.
    pub target_q: [f64; 6],
    /// Tool centre point in the controller's base frame: m and a rotation vector in rad.
    pub tcp_pose: [f64; 6],
    /// External wrench in base axes, N and N·m; see [`ForcePoint`].
    pub tcp_force: [f64; 6],
    /// Tool centre point in force, seen from the flange: m and a rotation vector in rad.
    pub tcp_offset: [f64; 6],
    /// Payload in force, kg.
    pub payload: f64,
    /// Power and brakes.
    pub robot_mode: RobotMode,
    /// The safety system.
    pub safety: SafetyStatus,
    /// The program.
    pub runtime: RuntimeState,
    /// Position of the speed slider, 0 to 1.
    pub speed_slider: f64,
    /// Scaling that the controller itself applies, 0 to 1.
    pub speed_scaling: f64,
    /// What the control program reports.
    pub report: Report,
}

/// The control program's output registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// Version of the program; 0 before any has run.
    pub version: i32,
    /// The last command taken.
    pub sequence: i32,
    /// What it is doing.
    pub status: Status,
    /// One more every cycle.
    pub heartbeat: i32,
    /// Whose commands it takes.
    pub token: i32,
    /// Sensor tares since it started.
    pub tares: i32,
}

/// The outputs that a [`Sample`] is made of, in order.
const OUTPUTS: [(&str, DataType); 13] = [
    ("timestamp", DataType::Double),
    ("actual_q", DataType::Vector6d),
    ("actual_qd", DataType::Vector6d),
    ("target_q", DataType::Vector6d),
    ("actual_TCP_pose", DataType::Vector6d),
    ("actual_TCP_force", DataType::Vector6d),
    ("tcp_offset", DataType::Vector6d),
    ("payload", DataType::Double),
    ("robot_mode", DataType::Int32),
    ("safety_status", DataType::Int32),
    ("runtime_state", DataType::Uint32),
    ("target_speed_fraction", DataType::Double),
    ("speed_scaling", DataType::Double),
];

impl Sample {
    /// Names of the outputs to ask for.
    pub fn outputs() -> Vec<String> {
        let named = OUTPUTS.iter().map(|(name, _)| (*name).to_owned());
        named.chain(REPORT.map(|n| format!("output_int_register_{n}"))).collect()
    }

    /// Whether the controller granted them with the documented types.
    pub fn check(recipe: &Recipe) -> Result<(), UrError> {
        let kinds = OUTPUTS.iter().map(|(_, kind)| *kind).chain(REPORT.map(|_| DataType::Int32));
        for (field, want) in recipe.fields().iter().zip(kinds) {
            if field.data_type != want {
                return Err(UrError::Type { name: field.name.clone(), got: field.data_type, want });
            }
        }
        Ok(())
    }

    /// Reads a packet of a recipe that has passed [`check`](Self::check).
    pub fn read(record: &Record<'_>) -> Self {
        let double = |n| match record.value(n) {
            Value::Double(x) => x,
            _ => f64::NAN,
        };
        let six = |n| match record.value(n) {
            Value::Vector6d(v) => v,
            _ => [f64::NAN; 6],
        };
        let int = |n| match record.value(n) {
            Value::Int32(n) => n,
            _ => i32::MIN,
        };
        let unsigned = |n| match record.value(n) {
            Value::Uint32(n) => n,
            _ => u32::MAX,
        };
        let register = |n| int(OUTPUTS.len() + n);
        Self {
            timestamp: double(0),
            actual_q: six(1),
            actual_qd: six(2),
            target_q: six(3),
            tcp_pose: six(4),
            tcp_force: six(5),
            tcp_offset: six(6),
            payload: double(7),
            robot_mode: int(8).into(),
            safety: int(9).into(),
            runtime: unsigned(10).into(),
            speed_slider: double(11),
            speed_scaling: double(12),
            report: Report {
                version: register(0),
                sequence: register(1),
                status: Status::new(register(2), register(6)),
                heartbeat: register(3),
                token: register(4),
                tares: register(5),
            },
        }
    }

    /// Measured joints, rad.
    pub fn q(&self) -> JointVector {
        self.actual_q.into()
    }

    /// Measured joint speeds, rad/s.
    pub fn dq(&self) -> JointVector {
        self.actual_qd.into()
    }

    /// What the environment does to the tool, in tool0 axes, about the tool0 origin.
    ///
    /// The controller reports it in base axes. With b the base, f the flange (tool0) and t the tool centre
    /// point: b_R_f = b_R_t · f_R_tᵀ; f and τ are turned by b_R_fᵀ; a torque about the tool centre point
    /// at p (flange axes) becomes τ + p × f at the flange. Only the controller's own frames are used, so
    /// that a calibrated arm needs no model here.
    ///
    /// # References
    ///
    /// Universal Robots ROS 2 driver, pull request 566: base axes on every generation; about the flange on
    /// an e-Series, about the tool centre point on CB3.
    pub fn wrench(&self, point: ForcePoint) -> Wrench {
        let [fx, fy, fz, tx, ty, tz] = self.tcp_force;
        let in_base = Wrench::new([fx, fy, fz].into(), [tx, ty, tz].into());
        let flange_T_tcp = pose(&self.tcp_offset);
        let base_R_flange = pose(&self.tcp_pose).rotation * flange_T_tcp.rotation.inverse();
        let wrench = in_base.rotated(&base_R_flange.inverse());
        match point {
            ForcePoint::Flange => wrench,
            ForcePoint::Tcp => wrench.about(&-flange_T_tcp.translation.vector),
        }
    }

    /// base_T_flange as the controller's own (calibrated) model has it.
    pub fn base_T_flange(&self) -> Pose {
        pose(&self.tcp_pose) * pose(&self.tcp_offset).inverse()
    }
}

/// m and a rotation vector in rad, as the controller writes poses.
pub fn pose(v: &[f64; 6]) -> Pose {
    let [x, y, z, rx, ry, rz] = *v;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
    Pose::from_parts(Vector3::new(x, y, z).into(), rotation)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::proto::Recipe;

    pub(crate) fn sample(tcp_pose: [f64; 6], tcp_offset: [f64; 6], tcp_force: [f64; 6]) -> Sample {
        let types = OUTPUTS.iter().map(|(_, t)| *t).chain(REPORT.map(|_| DataType::Int32));
        let names = Sample::outputs();
        let recipe = Recipe::new(1, names.iter().map(String::as_str).zip(types));
        Sample::check(&recipe).unwrap();
        let mut bytes = Vec::new();
        for field in recipe.fields() {
            match field.name.as_str() {
                "actual_TCP_pose" => Value::Vector6d(tcp_pose),
                "actual_TCP_force" => Value::Vector6d(tcp_force),
                "tcp_offset" => Value::Vector6d(tcp_offset),
                _ => field.data_type.zero(),
            }
            .write(&mut bytes);
        }
        Sample::read(&recipe.record(&bytes).unwrap())
    }

    const PI: f64 = std::f64::consts::PI;

    fn close(a: Wrench, force: [f64; 3], torque: [f64; 3]) {
        let want = Wrench::new(force.into(), torque.into());
        assert!((a.vector() - want.vector()).norm() < 1e-12, "{a:?} is not {want:?}");
    }

    /// A tool that points down and presses on a table: the table pushes up, which is −z of the tool.
    #[test]
    fn a_table_pushes_a_tool_that_points_down_along_minus_z() {
        let s = sample([0.3, 0.1, 0.2, PI, 0.0, 0.0], [0.0; 6], [0.0, 0.0, 12.0, 0.0, 0.0, 0.0]);
        close(s.wrench(ForcePoint::Flange), [0.0, 0.0, -12.0], [0.0; 3]);
    }

    /// The same with axes worked out by hand: Rx(π) maps y to −y and z to −z.
    #[test]
    fn base_axes_become_tool_axes() {
        let s = sample([0.0, 0.0, 0.0, PI, 0.0, 0.0], [0.0; 6], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        close(s.wrench(ForcePoint::Flange), [1.0, -2.0, -3.0], [0.1, -0.2, -0.3]);
        let s =
            sample([0.0, 0.0, 0.0, 0.0, 0.0, PI / 2.0], [0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        close(s.wrench(ForcePoint::Flange), [0.0, -1.0, 0.0], [0.0; 3]);
    }

    /// A turned tool centre point turns the reported pose, not the sensor.
    #[test]
    fn the_tool_offset_does_not_turn_the_wrench() {
        let offset = [0.02, 0.0, 0.15, 0.0, 0.0, PI / 2.0];
        let base_T_flange = pose(&[0.3, 0.1, 0.2, 0.0, PI, 0.0]);
        let base_T_tcp = base_T_flange * pose(&offset);
        let r = base_T_tcp.rotation.scaled_axis();
        let p = base_T_tcp.translation.vector;
        let tcp_pose = [p.x, p.y, p.z, r.x, r.y, r.z];
        // Ry(π) maps x to −x and z to −z.
        let s = sample(tcp_pose, offset, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        close(s.wrench(ForcePoint::Flange), [-1.0, 2.0, -3.0], [0.0; 3]);
        // About the tool centre point there is no torque, so about the flange it is p × f.
        close(s.wrench(ForcePoint::Tcp), [-1.0, 2.0, -3.0], [-0.3, -0.15 + 0.06, 0.04]);
        assert!(
            (s.base_T_flange().translation.vector - base_T_flange.translation.vector).norm()
                < 1e-12
        );
    }

    #[test]
    fn a_variable_of_another_type_is_named() {
        let names = Sample::outputs();
        let recipe = Recipe::new(1, names.iter().map(|n| (n.as_str(), DataType::Double)));
        let error = Sample::check(&recipe).unwrap_err().to_string();
        assert!(error.contains("actual_q as Double, expected Vector6d"), "{error}");
    }
}
