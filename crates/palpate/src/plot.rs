//! `plot`: learning curves of one or more runs.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use palpate_runs::RunDir;
use palpate_runs::plot::{Curve, Panel, draw};

use crate::Config;

/// Panels: column of metrics.csv, file name, title, y label, fixed y range.
const PANELS: &[(&str, &str, &str)] = &[
    ("rollout/ep_rew_mean", "return", "Return, mean of the last 20 episodes"),
    ("rollout/success_rate", "success", "Success rate of the last 20 training episodes"),
    ("eval/success_rate", "evaluation", "Success rate of the deterministic policy, frozen starts"),
    ("safety/collisions", "collisions", "Collisions so far"),
    ("eval/q_minus_return", "q_minus_return", "Q minus observed return at the start (scaled reward)"),
];
