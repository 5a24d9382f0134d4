//! What the policy does along an insertion, before and after training, as the paper's last figure shows it.

use std::path::Path;

use anyhow::Context as _;
use palpate_control::Gains;
use palpate_env::Tape;
use palpate_runs::plot::{Curve, Panel, Shade, draw};
use palpate_runs::{CheckpointStore, LAST};
use palpate_sac::{Policy, Sac};
use serde::{Deserialize, Serialize};

use crate::Config;
use crate::baselines::Actor;
use crate::report::behaviour::Phase;
use crate::stack::{Purpose, sim_env};
use crate::study::folder::Folder;
use crate::study::plan::{Kind, Planned};
use crate::study::rows::{self, rounded};

const FILE: &str = "evolution.csv";
/// The models whose policies are shown.
const SHOWN: [&str; 2] = ["P-14", "A-13pd"];

/// One action of one episode on a frozen start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Motion {
    run: String,
    model: String,
    /// `first` or `last`.
    policy: String,
    /// s.
    time: f64,
    /// `search`, `contact` or `insertion`.
    phase: String,
    /// Of the tip above the mouth, mm.
    height: f64,
    /// Of the tip from the hole's axis, mm.
    offset: f64,
    /// N.
    force: f64,
    /// a_x in hole axes, mm/s.
    ax_x: f64,
    ax_y: f64,
    ax_z: f64,
    /// 1/s.
    kp_xy: f64,
    kp_z: f64,
    /// k_d, N·s/m, or the selection S.
    second_xy: f64,
    second_z: f64,
}

/// Name and value of a line in a picture.
type Line = (&'static str, fn(&Motion) -> f64);

/// Runs the first and the last policy of one run of each shown model; what was collected before where the run's folder
/// is not here.
pub(super) fn collect(folder: &Folder) -> anyhow::Result<Vec<Motion>> {
    let path = folder.path.join(FILE);
    let mut all: Vec<Motion> = if path.is_file() { rows::read(&path)? } else { Vec::new() };
    for model in SHOWN {
        let is = |run: &&Planned| {
            run.model == model && run.kind == Kind::Learned && run.penalty && run.varied.is_empty()
        };
        let Some(run) = folder.plan.iter().find(is) else { continue };
        let dir = folder.dir(run);
        if !folder.is_done(run) || !dir.join("config.toml").is_file() {
            continue;
        }
        all.retain(|motion| motion.model != model);
        all.extend(of_run(run, &dir).with_context(|| format!("run {}", run.id))?);
    }
    if !all.is_empty() {
        rows::write(&path, &all)?;
    }
    Ok(all)
}

fn of_run(run: &Planned, dir: &Path) -> anyhow::Result<Vec<Motion>> {
    let config = Config::of_run(dir, &[])?;
    let mut env = sim_env(&config, config.run.seed, Purpose::Monitor)?;
    let (observation, action) = (env.observation_dim(), env.action_dim());
    let fresh = Sac::new(&config.sac, observation, action, config.run.seed)?.policy();
    let last = CheckpointStore::open(dir)?.find(LAST)?.context("it has no checkpoint")?;
    let mut all = Vec::new();
    for (name, policy) in [("first", fresh), ("last", Policy::load(&last)?)] {
        let mut actor = Actor::learned(policy, None);
        let tape = env.new_tape();
        env.swap_tape(Some(tape));
        env.set_next_episode(0);
        env.reset()?;
        actor.reset(0);
        loop {
            let action = actor.act(&env).to_vec();
            if env.step(&action)?.summary.is_some() {
                break;
            }
        }
        let tape = env.swap_tape(None).context("the tape is gone")?;
        all.extend(motions(run, name, &config, &tape));
    }
    Ok(all)
}

fn motions(run: &Planned, policy: &str, config: &Config, tape: &Tape) -> Vec<Motion> {
    let hole_T_base = config.task.base_T_hole().inverse();
    let motion = |beat: &palpate_env::Beat| {
        let tick = tape.ticks().iter().find(|t| t.measurement.state.time >= beat.time)?;
        let m = &tick.measurement;
        let p = hole_T_base * nalgebra::Point3::from(m.base_T_tool.translation.vector);
        let force = m.wrench.force.norm();
        let a_x = hole_T_base.rotation * beat.decoded.motion.linear;
        let (kp, second) = match &beat.decoded.gains {
            Gains::Parallel(g) => (g.kp_x, g.selection),
            Gains::Admittance(g) => (g.kp_x, g.stiffness),
        };
        Some(Motion {
            run: run.id.clone(),
            model: run.model.clone(),
            policy: policy.into(),
            time: rounded(beat.time - tape.began()),
            phase: match Phase::of(p.z, force) {
                Phase::Free => "search",
                Phase::Contact => "contact",
                Phase::Inside => "insertion",
            }
            .into(),
            height: rounded(1e3 * p.z),
            offset: rounded(1e3 * p.x.hypot(p.y)),
            force: rounded(force),
            ax_x: rounded(1e3 * a_x.x),
            ax_y: rounded(1e3 * a_x.y),
            ax_z: rounded(1e3 * a_x.z),
            kp_xy: rounded(f64::midpoint(kp[0], kp[1])),
            kp_z: rounded(kp[2]),
            second_xy: rounded(f64::midpoint(second[0], second[1])),
            second_z: rounded(second[2]),
        })
    };
    tape.beats().iter().filter_map(motion).collect()
}

/// Names and pictures: what is seen, a_x, K_p and the second gain along one insertion of each shown model, first and
/// last policy.
pub(super) fn figures(motions: &[Motion]) -> Vec<(String, Option<String>, String)> {
    let mut all = Vec::new();
    for model in SHOWN {
        let second = if model.starts_with('A') { "k_d, N·s/m" } else { "S" };
        for policy in ["first", "last"] {
            let of: Vec<&Motion> =
                motions.iter().filter(|m| m.model == model && m.policy == policy).collect();
            if of.is_empty() {
                continue;
            }
            let panels: [(&str, &str, &[Line]); 4] = [
                (
                    "observation",
                    "mm and N",
                    &[
                        ("height, mm", |m| m.height),
                        ("offset, mm", |m| m.offset),
                        ("force, N", |m| m.force),
                    ],
                ),
                ("a_x", "mm/s", &[("x", |m| m.ax_x), ("y", |m| m.ax_y), ("z", |m| m.ax_z)]),
                ("K_p", "1/s", &[("x and y", |m| m.kp_xy), ("z", |m| m.kp_z)]),
                ("second gain", second, &[("x and y", |m| m.second_xy), ("z", |m| m.second_z)]),
            ];
            for (what, label, lines) in panels {
                let what = if what == "second gain" {
                    second.split(',').next().unwrap_or(what)
                } else {
                    what
                };
                let title = format!("{model}, {policy} policy: {what}");
                let file = format!("evolution-{model}-{policy}-{}.svg", what.to_lowercase());
                all.push((file, panel(&title, label, lines, &of), title));
            }
        }
    }
    all
}

fn panel(title: &str, label: &str, lines: &[Line], of: &[&Motion]) -> Option<String> {
    let curve = |(name, value): &Line| Curve {
        label: (*name).into(),
        runs: vec![of.iter().map(|m| (m.time, value(m))).collect()],
    };
    let panel = Panel {
        title: title.into(),
        x_label: "s".into(),
        y_label: label.into(),
        shades: shades(of),
        ..Panel::default()
    };
    draw(&panel, &lines.iter().map(curve).collect::<Vec<_>>())
}

/// Where the phases are: search is left white.
fn shades(of: &[&Motion]) -> Vec<Shade> {
    let mut all: Vec<(String, Shade)> = Vec::new();
    for (i, motion) in of.iter().enumerate() {
        let colour = match motion.phase.as_str() {
            "contact" => "#e69f00",
            "insertion" => "#009e73",
            _ => continue,
        };
        let to = of.get(i + 1).map_or(motion.time, |next| next.time);
        match all.last_mut() {
            Some((phase, shade)) if *phase == motion.phase && shade.to == motion.time => {
                shade.to = to;
            }
            _ => all.push((
                motion.phase.clone(),
                Shade { from: motion.time, to, colour: colour.into() },
            )),
        }
    }
    all.into_iter().map(|(_, shade)| shade).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(time: f64, phase: &str) -> Motion {
        Motion {
            run: "r".into(),
            model: "P-14".into(),
            policy: "last".into(),
            time,
            phase: phase.into(),
            height: 1.0,
            offset: 2.0,
            force: 3.0,
            ax_x: 0.0,
            ax_y: 0.0,
            ax_z: 0.0,
            kp_xy: 1.0,
            kp_z: 1.0,
            second_xy: 0.5,
            second_z: 0.5,
        }
    }

    #[test]
    fn phases_are_shaded_from_their_beginning_to_the_next() {
        let phases =
            ["search", "contact", "contact", "search", "contact", "insertion", "insertion"];
        let of: Vec<Motion> = (0..).zip(phases).map(|(i, p)| motion(f64::from(i), p)).collect();
        let shades = shades(&of.iter().collect::<Vec<_>>());
        let found: Vec<_> = shades.iter().map(|s| (s.from, s.to, s.colour.as_str())).collect();
        let (contact, insertion) = ("#e69f00", "#009e73");
        assert_eq!(found, [(1.0, 3.0, contact), (4.0, 5.0, contact), (5.0, 6.0, insertion)]);
    }

    #[test]
    fn every_shown_model_has_its_pictures() {
        let of = [motion(0.0, "search"), motion(0.05, "contact")];
        let names: Vec<String> = figures(&of).into_iter().map(|(name, ..)| name).collect();
        let expected = ["observation", "a_x", "k_p", "s"];
        assert_eq!(names, expected.map(|what| format!("evolution-P-14-last-{what}.svg")));
    }
}
