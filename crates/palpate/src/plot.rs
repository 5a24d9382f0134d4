//! `plot`: learning curves of one or more runs.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use palpate_runs::plot::{Curve, Panel, draw};
use palpate_runs::{Csv, RunDir};

use crate::Config;

/// A column of metrics.csv and how it is drawn.
struct Figure {
    column: &'static str,
    file: &'static str,
    title: &'static str,
    y_label: &'static str,
    y_range: Option<(f64, f64)>,
}

const RATE: Option<(f64, f64)> = Some((0.0, 1.0));

const FIGURES: &[Figure] = &[
    Figure {
        column: "rollout/ep_rew_mean",
        file: "return",
        title: "Return while training",
        y_label: "mean of the last 20 episodes",
        y_range: None,
    },
    Figure {
        column: "rollout/success_rate",
        file: "success",
        title: "Success while training",
        y_label: "share of the last 20 episodes",
        y_range: RATE,
    },
    Figure {
        column: "eval/success_rate",
        file: "evaluation",
        title: "Success of the deterministic policy",
        y_label: "share of the frozen starts",
        y_range: RATE,
    },
    Figure {
        column: "rollout/peak_force_mean",
        file: "peak_force",
        title: "Peak contact force while training",
        y_label: "N, mean of the last 20 episodes",
        y_range: None,
    },
    Figure {
        column: "safety/collisions",
        file: "collisions",
        title: "Collisions",
        y_label: "so far",
        y_range: None,
    },
    Figure {
        column: "eval/q_minus_return",
        file: "q_minus_return",
        title: "Q minus the return that followed",
        y_label: "scaled reward, at the start",
        y_range: None,
    },
];

/// Draws every figure whose column has a value and says where.
pub fn run(runs: &[PathBuf], out: Option<&Path>, ema: f64) -> anyhow::Result<Vec<PathBuf>> {
    if !(0.0..1.0).contains(&ema) {
        bail!("--ema is {ema}, but it must be in [0, 1)");
    }
    let groups = grouped(runs)?;
    let folder = match (out, runs.first()) {
        (Some(out), _) => out.to_owned(),
        (None, Some(first)) => first.join("plots"),
        (None, None) => bail!("name at least one run"),
    };
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let mut written = Vec::new();
    for figure in FIGURES {
        let mut curves = Vec::new();
        for group in &groups {
            let points = |run: &PathBuf| -> anyhow::Result<Vec<(f64, f64)>> {
                Ok(Csv::read(&run.join("metrics.csv"))?
                    .points("time/total_timesteps", figure.column)?)
            };
            let runs = group.runs.iter().map(points).collect::<anyhow::Result<_>>()?;
            curves.push(Curve { label: group.label.clone(), runs });
        }
        let panel = Panel {
            title: figure.title.into(),
            x_label: "environment steps".into(),
            y_label: figure.y_label.into(),
            y_range: figure.y_range,
            ema,
            ..Panel::default()
        };
        let Some(svg) = draw(&panel, &curves) else { continue };
        let path = folder.join(format!("{}.svg", figure.file));
        std::fs::write(&path, svg).with_context(|| format!("cannot write {}", path.display()))?;
        written.push(path);
    }
    if written.is_empty() {
        bail!(
            "there is nothing to draw yet: metrics.csv gets its first row after run.log_every steps"
        );
    }
    Ok(written)
}

/// Runs that differ in their seed and length alone.
pub(crate) struct Group {
    pub(crate) label: String,
    config: Config,
    pub(crate) runs: Vec<PathBuf>,
}

pub(crate) fn grouped(runs: &[PathBuf]) -> anyhow::Result<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::new();
    for run in runs {
        RunDir::view(run)?;
        let mut config = Config::of_run(run, &[])?;
        (config.run.seed, config.run.steps) = (0, 1);
        match groups.iter_mut().find(|g| g.config == config) {
            Some(group) => group.runs.push(run.clone()),
            None => groups.push(Group { label: label(&config), config, runs: vec![run.clone()] }),
        }
    }
    // Two settings under one name: their first run's folder tells them apart.
    let labels: Vec<String> = groups.iter().map(|g| g.label.clone()).collect();
    for group in &mut groups {
        if labels.iter().filter(|label| **label == group.label).count() > 1
            && let Some(name) = group.runs.first().and_then(|run| run.file_name())
        {
            group.label = format!("{} ({})", group.label, name.to_string_lossy());
        }
    }
    Ok(groups)
}

fn label(config: &Config) -> String {
    let penalty = if config.reward.violation == 0.0 { ", no penalty" } else { "" };
    format!("{}, {}{penalty}", config.policy.name, config.task.name)
}
