//! From a tape to a file.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime};

use anyhow::Context as _;
use palpate_control::{Gains, Law};
use palpate_env::{Beat, Outcome, Tape, Tick};
use palpate_kinematics::SerialChain;
use palpate_record::{Body, Level, Points, Recording};
use palpate_safety::Cause;
use palpate_sim::SimArm;
use palpate_spatial::{DOF, Pose, Vector3, Wrench, pose_error_vector_part};

use super::scene::{self, HOLE, TOOL};
use crate::Config;

/// Frames told per second.
const FRAME_RATE: f64 = 50.0;
/// Length of a drawn force, m/N.
const FORCE_SCALE: f64 = 0.005;
const FORCE_COLOUR: [f32; 4] = [0.85, 0.1, 0.1, 1.0];

const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
const WRENCH: &[&str] =
    &["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z", "force", "force_limit"];

/// What all recordings of a configuration share.
pub(super) struct Setup {
    config: Config,
    text: String,
    /// Base to tool centre point.
    chain: SerialChain<DOF>,
    links: Vec<String>,
    bodies: Vec<Body>,
    labels: Vec<String>,
    /// Control periods per sample and per telling of the frames.
    strides: (usize, usize),
}

impl Setup {
    pub(super) fn new(config: &Config, chain: SerialChain<DOF>) -> anyhow::Result<Self> {
        let tcp = Vector3::from(config.robot.tcp);
        let chain = chain.with_tool(Pose::translation(tcp.x, tcp.y, tcp.z));
        let stride =
            |rate: f64| ((1.0 / (rate * SimArm::PERIOD.as_secs_f64())).round() as usize).max(1);
        Ok(Self {
            text: config.to_toml()?,
            links: scene::link_names(&chain),
            bodies: scene::bodies(config, &chain)?,
            labels: palpate_control::ActionMap::new(&config.policy)?.labels(),
            chain,
            strides: (stride(config.record.rate), stride(FRAME_RATE)),
            config: config.clone(),
        })
    }

    /// The file of an episode.
    pub(super) fn encode(&self, tape: &Tape, name: &str) -> anyhow::Result<Vec<u8>> {
        let start = tape.start().context("the tape is empty")?;
        let ticks = tape.ticks();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let last = ticks.last().map_or(0.0, |t| t.measurement.state.time - tape.began());
        let r = Recording::new(now.saturating_sub(Duration::from_secs_f64(last.max(0.0))))?;
        let base = self.config.robot.base_link.as_str();
        r.describe(&self.config.robot.urdf, base, &self.bodies)?;
        let task = &self.config.task;
        let fixed = [
            (HOLE, &task.base_T_hole()),
            ("goal", &task.base_T_goal()),
            ("believed_goal", &start.base_T_believed),
            ("start", &start.base_T_start),
        ];
        r.frames("/frames/fixed")?.put(0.0, base, fixed);
        self.samples(&r, tape)?;
        self.frames(&r, tape)?;
        self.actions(&r, tape)?;
        Self::story(&r, tape)?;
        r.facts("palpate", self.facts(tape, name))?;
        Ok(r.finish()?)
    }

    /// What was sensed and asked for.
    fn samples(&self, r: &Recording, tape: &Tape) -> anyhow::Result<()> {
        let base = self.config.robot.base_link.as_str();
        let names = self.chain.joint_names();
        let (joints, targets) = (r.joints("/joints", names)?, r.joints("/joints/target", names)?);
        let (tool, command) = (r.poses("/tool/pose", base)?, r.poses("/tool/command", base)?);
        let wrench = r.numbers("/wrench", "palpate.Wrench", WRENCH)?;
        let raw = r.numbers("/wrench/unfiltered", "palpate.Wrench", WRENCH)?;
        let error = r.numbers("/error", "palpate.PoseError", &AXES)?;
        let start = tape.start().context("the tape is empty")?;
        let limit = self.config.safety.force_max;
        for tick in tape.ticks().iter().step_by(self.strides.0) {
            let Tick { measurement: m, base_T_command, .. } = tick;
            let (t, s) = (m.state.time - tape.began(), &m.state);
            joints.put(t, s.q.as_slice(), s.dq.as_slice());
            targets.put(t, s.q_target.as_slice(), &[0.0; DOF]);
            tool.put(t, &m.base_T_tool);
            command.put(t, base_T_command);
            wrench.put(t, &numbers(&m.wrench, limit))?;
            raw.put(t, &numbers(&m.raw_wrench, limit))?;
            let e = pose_error_vector_part(&start.base_T_believed, &m.base_T_tool);
            error.put(t, e.as_slice())?;
        }
        Ok(())
    }

    /// Where the arm is, and the force as a line from the tool's tip.
    fn frames(&self, r: &Recording, tape: &Tape) -> anyhow::Result<()> {
        let base = self.config.robot.base_link.as_str();
        let (frames, line) = (r.frames("/frames")?, r.points("/contact_force", base)?);
        for tick in tape.ticks().iter().step_by(self.strides.1) {
            let m = &tick.measurement;
            let t = m.state.time - tape.began();
            let (links, _) = self.chain.frames(&m.state.q);
            let poses = links.map(|link| {
                let turn = nalgebra::Rotation3::from_matrix_unchecked(link.rotation);
                Pose::from_parts(link.origin.into(), turn.into())
            });
            let named = self.links.iter().map(String::as_str).zip(&poses);
            frames.put(t, base, named.chain([(TOOL, &m.base_T_tool)]));
            draw(&line, t, &m.base_T_tool, &m.wrench);
        }
        Ok(())
    }

    /// What the policy did, which gains that meant, and what it was paid.
    fn actions(&self, r: &Recording, tape: &Tape) -> anyhow::Result<()> {
        let action = r.numbers("/action", "palpate.Action", &self.labels)?;
        let motion = r.numbers("/action/motion", "palpate.Motion", &AXES)?;
        let gains = r.numbers("/gains", "palpate.Gains", &gain_names(self.config.policy.law))?;
        let terms = ["distance", "action", "force", "step", "terminal", "verdicts", "total"];
        let reward = r.numbers("/reward", "palpate.Reward", &terms)?;
        for (beat, given) in tape.beats().iter().zip(tape.actions()) {
            let t = beat.time - tape.began();
            action.put(t, given)?;
            motion.put(t, beat.decoded.motion.vector().as_slice())?;
            gains.put(t, &gain_values(beat))?;
            let w = &beat.reward;
            let paid = [w.distance, w.action, w.force, w.step, w.terminal, w.verdicts, w.total()];
            // It is paid at the end of the action.
            reward.put(t + self.config.env.policy_period, &paid)?;
        }
        Ok(())
    }

    /// What the fail-safe layer said, as a number by cause and, where it changes, in words.
    fn story(r: &Recording, tape: &Tape) -> anyhow::Result<()> {
        let causes: Vec<&str> = Cause::ALL.iter().map(|c| c.name()).collect();
        let (verdicts, log) =
            (r.numbers("/verdict", "palpate.Verdict", &causes)?, r.texts("/log")?);
        let (mut said, mut t) = (None, 0.0);
        for tick in tape.ticks() {
            t = tick.measurement.state.time - tape.began();
            if tick.cause != said || t == 0.0 {
                let flags = Cause::ALL.iter().map(|c| f64::from(tick.cause == Some(*c)));
                verdicts.put(t, &flags.collect::<Vec<_>>())?;
            }
            if let Some(cause) = tick.cause.filter(|cause| said != Some(*cause)) {
                let force = tick.measurement.wrench.force.norm();
                let level = if cause.is_slowed() { Level::Info } else { Level::Warning };
                log.put(t, level, &format!("fail-safe layer: {} at {force:.1} N", cause.name()));
            }
            said = tick.cause;
        }
        if let Some(s) = tape.summary() {
            let level = match s.outcome {
                Outcome::Success => Level::Info,
                Outcome::TimeLimit => Level::Warning,
                Outcome::Collision | Outcome::Fault => Level::Error,
            };
            let text = format!(
                "{:?} after {:.2} s, peak force {:.1} N, return {:.1}",
                s.outcome, s.seconds, s.peak_force, s.total_reward
            );
            log.put(t, level, &text);
        }
        Ok(())
    }

    fn facts(&self, tape: &Tape, name: &str) -> BTreeMap<String, String> {
        let mut facts = BTreeMap::from([
            ("recording".to_owned(), name.to_owned()),
            ("task".to_owned(), self.config.task.name.clone()),
            ("policy model".to_owned(), self.config.policy.name.clone()),
            ("episode".to_owned(), tape.episode().to_string()),
            ("missed control periods".to_owned(), tape.missed().to_string()),
            ("config.toml".to_owned(), self.text.clone()),
        ]);
        if let Some(s) = tape.summary() {
            facts.insert("outcome".into(), format!("{:?}", s.outcome));
            facts.insert("peak force N".into(), format!("{:.3}", s.peak_force));
        }
        facts
    }
}

fn numbers(w: &Wrench, limit: f64) -> [f64; 8] {
    let (f, n) = (w.force, w.torque);
    [f.x, f.y, f.z, n.x, n.y, n.z, f.norm(), limit]
}

fn draw(line: &Points, t: f64, base_T_tool: &Pose, wrench: &Wrench) {
    let (from, along) = (base_T_tool.translation.vector, wrench.force * FORCE_SCALE);
    let points: Vec<Vector3> = (0..40).map(|k| from + along * (f64::from(k) / 39.0)).collect();
    line.put(t, &points, FORCE_COLOUR);
}

fn gain_names(law: Law) -> Vec<String> {
    let sets: &[&str] = match law {
        Law::Parallel => &["position", "force", "selection"],
        Law::Admittance => &["position", "stiffness"],
    };
    sets.iter().flat_map(|set| AXES.map(|axis| format!("{set}_{axis}"))).collect()
}

fn gain_values(beat: &Beat) -> Vec<f64> {
    match beat.decoded.gains {
        Gains::Parallel(g) => [g.kp_x, g.kp_f, g.selection].iter().flatten().copied().collect(),
        Gains::Admittance(g) => [g.kp_x, g.stiffness].iter().flatten().copied().collect(),
    }
}
