//! The simulated environment for Python. `palpate_gym/__init__.py` makes a Gymnasium environment of it.

use std::collections::HashMap;

use palpate::Config;
use palpate::config::Choice;
use palpate::stack::{Purpose, SimEnv, sim_env};
use palpate_env::Outcome;
use pyo3::prelude::*;

/// Observation, reward, terminated, truncated, info.
type Step = (Vec<f32>, f64, bool, bool, HashMap<String, f64>);

/// One simulated arm behind its force controller and fail-safe layer.
#[pyclass(unsendable)]
struct Sim {
    config: Config,
    env: SimEnv,
}

#[pymethods]
impl Sim {
    /// Builds it from named settings and `key=value` overrides, as the command line does.
    #[new]
    fn new(preset: String, task: String, model: String, set: Vec<String>) -> anyhow::Result<Self> {
        let config = Config::load(&Choice { preset, task, model, file: None, set })?;
        let env = sim_env(&config, config.run.seed, Purpose::Train)?;
        Ok(Self { config, env })
    }

    #[getter]
    fn observation_dim(&self) -> usize {
        self.env.observation_dim()
    }

    #[getter]
    fn action_dim(&self) -> usize {
        self.env.action_dim()
    }

    /// What each component of an action moves.
    #[getter]
    fn action_labels(&self) -> Vec<String> {
        self.env.action_labels()
    }

    /// Starts the next episode; with a seed, the first of that seed's.
    #[pyo3(signature = (seed=None))]
    fn reset(&mut self, seed: Option<u64>) -> anyhow::Result<Vec<f32>> {
        if let Some(seed) = seed {
            self.env = sim_env(&self.config, seed, Purpose::Train)?;
        }
        self.env.reset()?;
        Ok(self.env.observation().to_vec())
    }

    /// Holds an action for one policy period.
    fn step(&mut self, action: Vec<f64>) -> anyhow::Result<Step> {
        let step = self.env.step(&action)?;
        let r = &step.reward;
        let mut info = HashMap::from([
            ("reward_distance".to_owned(), r.distance),
            ("reward_action".to_owned(), r.action),
            ("reward_force".to_owned(), r.force),
        ]);
        if let Some(m) = self.env.measurement() {
            info.insert("force".to_owned(), m.wrench.force.norm());
        }
        if let Some(s) = &step.summary {
            let flag = |outcome| f64::from(u8::from(s.outcome == outcome));
            info.insert("is_success".to_owned(), flag(Outcome::Success));
            info.insert("is_collision".to_owned(), flag(Outcome::Collision));
            info.insert("peak_force".to_owned(), s.peak_force);
        }
        let observation = self.env.observation().to_vec();
        Ok((observation, r.total(), step.terminated, step.truncated, info))
    }
}

#[pymodule]
fn _palpate(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Sim>()
}
