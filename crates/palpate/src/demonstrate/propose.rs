//! What demonstrations say about a configuration.
//!
//! A proposal is a place to start from, made by rules that are printed with it. It never widens a limit.

use std::fmt::Write as _;

use palpate_control::{Decoded, Gains, RangeMap, Tie};
use palpate_env::Tape;
use palpate_spatial::{Pose, UnitQuaternion, Vector3, Vector6};

use crate::Config;
use crate::stack::{chain, tool0_T_tool};

/// The force limit is so many times the largest force that was shown, …
const FORCE_FACTOR: f64 = 2.0;
/// … at least this much: N, N·m.
const LEAST: [f64; 2] = [5.0, 0.5];
/// Steps that limits are rounded up to: N, N·m.
const STEPS: [f64; 2] = [1.0, 0.1];
/// The workspace reaches this far beyond what was shown, besides the height that the way back takes, m.
const MARGIN: f64 = 0.02;

/// What is seen of demonstrations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observed {
    /// Tool poses in which episodes ended.
    ends: Vec<Pose>,
    /// Box of all tool positions, base axes, m.
    tool: Option<(Vector3, Vector3)>,
    /// Largest of any base axis of the filtered wrench: N, N·m.
    peak: [f64; 2],
    /// Least and largest gains that the source chose.
    gains: Vec<(&'static str, Vector6, Vector6)>,
}

impl Observed {
    /// Looks at an episode that is kept.
    pub(super) fn look(&mut self, tape: &Tape, gains: bool) {
        let mut poses = tape.ticks().iter().map(|tick| &tick.measurement.base_T_tool);
        self.ends.extend(poses.next_back());
        for tick in tape.ticks() {
            let m = &tick.measurement;
            let p = m.base_T_tool.translation.vector;
            let (low, high) = self.tool.unwrap_or((p, p));
            self.tool = Some((low.inf(&p), high.sup(&p)));
            for (peak, part) in self.peak.iter_mut().zip([m.wrench.force, m.wrench.torque]) {
                *peak = peak.max(part.amax());
            }
        }
        let chosen = tape.beats().iter().filter(|_| gains);
        for (name, gain) in chosen.flat_map(|beat| named(&beat.decoded)) {
            match self.gains.iter_mut().find(|(known, ..)| *known == name) {
                Some((_, low, high)) => (*low, *high) = (low.inf(&gain), high.sup(&gain)),
                None => self.gains.push((name, gain, gain)),
            }
        }
    }

    /// As a configuration file: what `--config` takes, with the rules beside the numbers.
    pub fn fragment(&self, config: &Config, by: &str) -> anyhow::Result<String> {
        let mut text = format!(
            "# Proposed from {} demonstrations by {by} ({}, {}).\n# Numbers to start from, no more: read them. Demonstrations recorded under other limits or gains do not fit a\n# training under these; record them again with this file as --config.\n",
            self.ends.len(),
            config.task.name,
            config.policy.name
        );
        self.goal(config, &mut text);
        self.force(config, &mut text);
        self.workspace(config, &mut text)?;
        self.gains(config, &mut text);
        Ok(text)
    }

    fn goal(&self, config: &Config, out: &mut String) {
        let Some((mean, spread, turn)) = self.end() else { return };
        // Where the hole would have to be for its goal to lie there.
        let hole = mean * config.task.base_T_goal().inverse() * config.task.base_T_hole();
        let (roll, pitch, yaw) = hole.rotation.euler_angles();
        let rpy = Vector3::new(roll, pitch, yaw).map(f64::to_degrees);
        let _ = write!(
            out,
            "\n# Goal: episodes ended around {} m, up to {} mm and {:.1}° from that.\n# An episode ends up to task.success_distance ({:.1} mm) before the goal, so the goal lies that much further on. For a\n# cell whose goal is not known better, in place of the task's:\n# [task]\n# hole_position = {}\n# hole_rpy_deg = {}\n",
            array(&mean.translation.vector, 4),
            array(&(1e3 * spread), 1),
            turn.to_degrees(),
            1e3 * config.task.success_distance,
            array(&hole.translation.vector, 4),
            array(&rpy, 2),
        );
    }

    /// Mean pose of the ends, and the largest distance from it: by axis, m, and rad.
    pub(super) fn end(&self) -> Option<(Pose, Vector3, f64)> {
        let first = self.ends.first()?;
        let n = self.ends.len() as f64;
        let position = self.ends.iter().map(|p| p.translation.vector).sum::<Vector3>() / n;
        let turned =
            self.ends.iter().map(|p| (p.rotation * first.rotation.inverse()).scaled_axis());
        let turn = turned.sum::<Vector3>() / n;
        let rotation = UnitQuaternion::from_scaled_axis(turn) * first.rotation;
        let far = |from: Vector3, p: &Pose| from.sup(&(p.translation.vector - position).abs());
        let spread = self.ends.iter().fold(Vector3::zeros(), far);
        let angles = self.ends.iter().map(|p| p.rotation.angle_to(&rotation));
        Some((Pose::from_parts(position.into(), rotation), spread, angles.fold(0.0, f64::max)))
    }

    /// Limits in the order of the safety table: N, N·m.
    fn limits(&self, config: &Config) -> [f64; 2] {
        let now = [config.safety.force_max, config.safety.torque_max];
        std::array::from_fn(|i| {
            let limit = (FORCE_FACTOR * self.peak[i] / STEPS[i]).ceil() * STEPS[i];
            limit.max(LEAST[i]).min(now[i])
        })
    }

    fn force(&self, config: &Config, out: &mut String) {
        let ([force, torque], [f, t]) = (self.limits(config), self.peak);
        let s = &config.safety;
        let _ = write!(
            out,
            "\n# Force: {FORCE_FACTOR} times the largest axis that was shown ({f:.1} N, {t:.2} N m), rounded up, at least {} N and {} N m, and\n# never above the configuration's own ({} N, {} N m). A policy that still has to learn presses harder than a script.\n[safety]\nforce_max = {force:.1}\ntorque_max = {torque:.1}\n",
            LEAST[0], LEAST[1], s.force_max, s.torque_max
        );
        if let Some(shield) = &s.shield {
            let norm = |limit: f64, norm: f64, axis: f64| limit * norm / axis;
            let _ = write!(
                out,
                "\n[safety.shield.force]             # in the same proportion to the above as they were\nforce_norm_max = {:.3}\ntorque_norm_max = {:.3}\n",
                norm(force, shield.force.force_norm_max, s.force_max),
                norm(torque, shield.force.torque_norm_max, s.torque_max),
            );
        }
    }

    fn workspace(&self, config: &Config, out: &mut String) -> anyhow::Result<()> {
        let Some((low, high)) = self.tool else { return Ok(()) };
        // The way to the start begins there.
        let home = chain(&config.robot)?.forward(&config.task.q_home) * tool0_T_tool(&config.robot);
        let home = home.translation.vector;
        let margin = Vector3::repeat(MARGIN + config.env.reset.clearance);
        let (low, high) = (low.inf(&home) - margin, high.sup(&home) + margin);
        let note = "what was shown and the tool at task.q_home";
        let reach = 1e3 * margin.x;
        let (low, high) = match &config.safety.shield {
            Some(shield) => (low.sup(&shield.workspace.min), high.inf(&shield.workspace.max)),
            None => (low, high),
        };
        let _ = write!(
            out,
            "\n# Workspace of the tool centre point: {note}, and {reach:.0} mm on every side;"
        );
        let dash = if config.safety.shield.is_some() {
            let _ = writeln!(
                out,
                " never beyond the\n# configuration's own. The shield keeps it (safety.mode = \"shield\")."
            );
            ""
        } else {
            let _ = writeln!(out, "\n# this preset has no shield to keep it.");
            "# "
        };
        let _ = writeln!(
            out,
            "{dash}[safety.shield.workspace]\n{dash}min = {}\n{dash}max = {}",
            array(&low, 3),
            array(&high, 3)
        );
        Ok(())
    }

    fn gains(&self, config: &Config, out: &mut String) {
        if self.gains.is_empty() {
            out.push_str("\n# Gains: the source left them at their base, so these demonstrations cannot tell.\n");
            return;
        }
        out.push_str("\n# Gains: between the least and the largest that the source chose. A policy that was trained under other ranges does\n# not fit them.\n");
        let table = &config.policy.gains;
        for (name, low, high) in &self.gains {
            let spec = match *name {
                "position" => Some(&table.position),
                "force" => table.force.as_ref(),
                "selection" => table.selection.as_ref(),
                _ => table.stiffness.as_ref(),
            };
            if spec.is_none_or(|spec| spec.tie == Tie::Fixed) {
                continue;
            }
            let (base, range) = within(config.policy.range_map, low, high);
            let _ = write!(
                out,
                "[policy.gains.{name}]\nbase = {}\nrange = {}\n",
                array6(&base),
                array6(&range)
            );
        }
    }

    /// What the console says.
    pub fn lines(&self, config: &Config) -> String {
        let mut out = String::new();
        if let Some((mean, spread, turn)) = self.end() {
            let _ = writeln!(
                out,
                "  end        {} m, up to {} mm and {:.1}° from it",
                array(&mean.translation.vector, 4),
                array(&(1e3 * spread), 1),
                turn.to_degrees()
            );
        }
        if let Some((low, high)) = self.tool {
            let _ = writeln!(out, "  tool       {} to {} m", array(&low, 3), array(&high, 3));
        }
        let ([f, t], [force, torque]) = (self.peak, self.limits(config));
        let _ = writeln!(
            out,
            "  force      {f:.1} N, {t:.2} N m in the largest axis: limits of {force:.0} N, {torque:.1} N m would do for it"
        );
        out.push_str(if self.gains.is_empty() {
            "  gains      left at their base by the source: which would do, these demonstrations cannot tell\n"
        } else {
            "  gains      chosen by the source: --propose writes their ranges\n"
        });
        out
    }
}

fn named(decoded: &Decoded) -> Vec<(&'static str, Vector6)> {
    match decoded.gains {
        Gains::Parallel(g) => {
            vec![("position", g.kp_x), ("force", g.kp_f), ("selection", g.selection)]
        }
        Gains::Admittance(g) => vec![("position", g.kp_x), ("stiffness", g.stiffness)],
    }
}

/// Base and range that reach no further than from `low` to `high`, six digits after the point.
fn within(map: RangeMap, low: &Vector6, high: &Vector6) -> (Vector6, Vector6) {
    let round = |x: f64| (1e6 * x).round() / 1e6;
    let down = |x: f64| (1e6 * x).floor() / 1e6;
    match map {
        RangeMap::Additive => {
            let base = ((low + high) / 2.0).map(round);
            let range = (high - base).inf(&(base - low)).map(|x| down(x).max(0.0));
            (base, range)
        }
        RangeMap::Multiplicative => {
            let base = low.zip_map(high, |l, h| round((l * h).sqrt()));
            let factor = Vector6::from_fn(|i, _| (high[i] / base[i]).min(base[i] / low[i]));
            (base, factor.map(|x| down(x).max(1.0)))
        }
    }
}

fn array(v: &Vector3, digits: usize) -> String {
    format!("[{:.digits$}, {:.digits$}, {:.digits$}]", v.x, v.y, v.z)
}

fn array6(v: &Vector6) -> String {
    let numbers: Vec<String> = v.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", numbers.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposed_gains_stay_between_what_was_chosen() {
        let low = Vector6::new(0.1, 0.001, 1.0 / 3.0, 0.0, 1.0, 2.0);
        let high = Vector6::new(0.9, 0.009, 2.0 / 3.0, 1.0, 1.0, 2.0 + 1e-9);
        let (base, range) = within(RangeMap::Additive, &low, &high);
        for i in 0..6 {
            assert!(base[i] - range[i] >= low[i] - 1e-12, "axis {i}");
            assert!(base[i] + range[i] <= high[i] + 1e-12, "axis {i}");
            assert!(base[i] + range[i] >= high[i] - 4e-6, "axis {i}: too narrow");
        }
        let low = Vector6::new(0.1, 0.1, 0.3, 0.5, 1.0, 2.0);
        let (base, factor) = within(RangeMap::Multiplicative, &low, &high.sup(&low));
        for i in 0..6 {
            assert!(factor[i] >= 1.0 && base[i] / factor[i] >= low[i] - 1e-6, "axis {i}");
        }
    }

    #[test]
    fn the_end_is_the_mean_and_its_spread_the_farthest() {
        let pose = |x: f64, angle: f64| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, angle));
            Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), rotation)
        };
        let ends = vec![pose(0.1, 0.2), pose(0.3, -0.2), pose(0.2, 0.0)];
        let (mean, spread, turn) = Observed { ends, ..Observed::default() }.end().unwrap();
        assert!((mean.translation.x - 0.2).abs() < 1e-12 && mean.rotation.angle() < 1e-12);
        assert!((spread.x - 0.1).abs() < 1e-12 && (turn - 0.2).abs() < 1e-12);
    }
}
