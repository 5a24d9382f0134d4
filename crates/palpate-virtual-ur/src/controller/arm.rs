//! Kinematics in the controller's frame *Base*, with the active tool centre point.

use palpate_kinematics::{Frame, IkOptions, ModelError, SerialChain, UR_JOINTS, UrModel, UrSolver};
use palpate_spatial::{JointVector, Pose, Vector6};

use super::config::ControllerConfig;
use crate::script::{pose_to_value, value_to_pose};

/// The arm as the controller knows it.
#[derive(Clone, Debug)]
pub struct ArmModel {
    model: UrModel,
    flange: SerialChain<6>,
    solver: UrSolver,
    tcp_offset: [f64; 6],
}

/// Joints and tool at one moment, base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// rad.
    pub q: JointVector,
    /// rad/s.
    pub dq: JointVector,
    /// base_T_tcp as position and rotation vector, m and rad.
    pub tcp: [f64; 6],
    /// m/s and rad/s.
    pub tcp_speed: [f64; 6],
}

impl ArmModel {
    pub(crate) fn new(config: &ControllerConfig) -> Result<Self, ModelError> {
        let dh = config.model.dh().calibrated(&config.calibration);
        let limits = config.model.limits();
        let flange = SerialChain::from_dh(&dh, &Pose::identity(), &limits, UR_JOINTS)?;
        let solver = UrSolver::new(flange.clone(), config.model)?;
        let mut arm = Self { model: config.model, flange, solver, tcp_offset: [0.0; 6] };
        arm.set_tcp(config.tcp_offset)?;
        Ok(arm)
    }

    /// Makes `flange_T_tcp` the active tool centre point.
    pub(crate) fn set_tcp(&mut self, offset: [f64; 6]) -> Result<(), ModelError> {
        let chain = self.flange.clone().with_tool(value_to_pose(&offset));
        self.solver = UrSolver::new(chain, self.model)?;
        self.tcp_offset = offset;
        Ok(())
    }

    pub(crate) fn tcp_offset(&self) -> [f64; 6] {
        self.tcp_offset
    }

    /// base_T_flange.
    pub(crate) fn flange(&self, q: &JointVector) -> Pose {
        self.flange.forward(q)
    }

    /// base_T_tcp with another offset than the active one.
    pub(crate) fn forward(&self, q: &JointVector, tcp: Option<[f64; 6]>) -> Pose {
        self.flange(q) * value_to_pose(&tcp.unwrap_or(self.tcp_offset))
    }

    pub(crate) fn sample(&self, q: &JointVector, dq: &JointVector) -> Sample {
        let kinematics = self.solver.chain().kinematics(q);
        let speed: Vector6 = kinematics.jacobian(Frame::BaseAligned) * dq;
        Sample { q: *q, dq: *dq, tcp: pose_to_value(&kinematics.pose()), tcp_speed: speed.into() }
    }

    /// Joint speeds of a tool speed, base axes; `None` near a singularity.
    pub(crate) fn joint_speeds(
        &self,
        q: &JointVector,
        tcp_speed: &[f64; 6],
    ) -> Option<JointVector> {
        let J = self.solver.chain().kinematics(q).jacobian(Frame::BaseAligned);
        J.lu().solve(&Vector6::from(*tcp_speed)).filter(|dq| dq.iter().all(|x| x.is_finite()))
    }

    /// Joints that put the tool centre point at `base_T_tcp`, nearest to `near`.
    pub(crate) fn inverse(
        &self,
        base_T_tcp: &Pose,
        near: &JointVector,
        tcp: Option<[f64; 6]>,
    ) -> Result<JointVector, String> {
        let tcp = value_to_pose(&tcp.unwrap_or(self.tcp_offset));
        let goal = base_T_tcp * tcp.inverse() * value_to_pose(&self.tcp_offset);
        self.solver
            .solve_near(&goal, near, &IkOptions::default())
            .map(|s| s.q)
            .map_err(|e| e.to_string())
    }
}
