//! Where the actions of demonstrations come from.

use std::ops::ControlFlow;

use palpate_env::Env;
use palpate_safety::Guarded;
use palpate_spatial::{Pose, Vector6, Wrench};

use crate::baselines::Actor;

/// What there is to act on, 20 times a second.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// What a policy sees.
    pub observation: &'a [f32],
    /// x_e: from the tool to the goal as the robot believes it, base axes; m, and sin(θ/2)·n for the attitude.
    pub error: Vector6,
    /// Environment on tool at the tool centre point, base axes, filtered.
    pub wrench: Wrench,
    /// The tool centre point.
    pub base_T_tool: Pose,
}

impl<'a> View<'a> {
    /// What an environment shows now.
    pub fn of<R: Guarded>(env: &'a Env<R>) -> Self {
        let measurement = env.measurement();
        Self {
            observation: env.observation(),
            error: env.believed_error().unwrap_or_default(),
            wrench: measurement.map(|m| m.wrench).unwrap_or_default(),
            base_T_tool: measurement.map_or_else(Pose::identity, |m| m.base_T_tool),
        }
    }
}

/// Somebody or something that shows how a task is done.
///
/// A script and a trained policy are sources ([`Actor`]). A person is one too: whatever the hand moves (a space mouse,
/// a pendant, the arm itself) is asked for its state here and becomes the next action. What an arm does of it still
/// passes the force controller and the fail-safe layer.
///
/// # Contract
/// - `act` is called once per policy period, on the thread that drives the arm: it must not wait for a device. A thread
///   of its own reads the device, and `act` takes the latest value.
/// - Numbers of an action lie in [−1, 1]. The first six are a_x, as parts of `policy.motion.linear` and `.angular`, base
///   axes; the others move gains ([`Env::action_labels`] names them). 0 leaves a gain at its base.
///
/// ```
/// use std::ops::ControlFlow;
/// use std::sync::{Arc, Mutex};
///
/// use palpate::Config;
/// use palpate::config::Choice;
/// use palpate::demonstrate::{Options, Source, View, record};
/// use palpate::stack::{Purpose, sim_env};
///
/// /// The six axes of a device, as its thread last read them, and whether its button is held.
/// #[derive(Default)]
/// struct Device { axes: [f64; 6], give_up: bool }
///
/// /// A person who pushes the cap of a device.
/// struct Hand(Arc<Mutex<Device>>);
///
/// impl Source for Hand {
///     fn name(&self) -> String {
///         "hand".into()
///     }
///     fn act(&mut self, _: &View<'_>, action: &mut [f64]) -> ControlFlow<()> {
///         // A device that is being written keeps the last action: no waiting here.
///         if let Ok(device) = self.0.try_lock() {
///             if device.give_up {
///                 return ControlFlow::Break(());
///             }
///             action[..6].copy_from_slice(&device.axes);
///         }
///         ControlFlow::Continue(())
///     }
/// }
///
/// # fn main() -> anyhow::Result<()> {
/// # let choice = Choice {
/// #     preset: "palpate".into(), task: "peg-insertion".into(), model: "P-14".into(), file: None,
/// #     set: vec!["env.max_steps=20".into()],
/// # };
/// # let folder = tempfile::tempdir()?;
/// # let file = folder.path().join("by-hand.demo");
/// let config = Config::load(&choice)?;
/// // On an arm: the environment around its backend.
/// let mut env = sim_env(&config, 1, Purpose::Demonstrate)?;
/// // The device's thread writes here; this person pushes down and no more.
/// let device = Arc::new(Mutex::new(Device { axes: [0.0, 0.0, -0.5, 0.0, 0.0, 0.0], give_up: false }));
/// let options = Options { episodes: 1, only_successes: false };
/// let account = record(&mut env, &mut Hand(device), &config, &options, &file, |_, _| {})?;
/// assert_eq!((account.kept, account.steps), (1, 20));
/// # Ok(())
/// # }
/// ```
pub trait Source {
    /// What to call it, in the file and on the screen.
    fn name(&self) -> String;

    /// Prepares for an episode; the arm is at its start.
    fn begin(&mut self, _episode: u64) {}

    /// Writes the next action over the last one (zeros at first), or gives the episode up: nothing is kept of it.
    fn act(&mut self, view: &View<'_>, action: &mut [f64]) -> ControlFlow<()>;

    /// Whether it chooses gains. One that leaves them at their base says nothing about them.
    fn chooses_gains(&self) -> bool {
        false
    }
}

/// The policies to compare with, and the learned ones.
impl Source for Actor {
    fn name(&self) -> String {
        match self {
            Self::Zero(_) => "zero",
            Self::Random(..) => "random",
            Self::Scripted(_) => "scripted",
            Self::Learned(_) => "policy",
        }
        .into()
    }

    fn begin(&mut self, episode: u64) {
        self.reset(episode);
    }

    fn act(&mut self, view: &View<'_>, action: &mut [f64]) -> ControlFlow<()> {
        action.copy_from_slice(self.decide(view));
        ControlFlow::Continue(())
    }

    fn chooses_gains(&self) -> bool {
        matches!(self, Self::Random(..) | Self::Learned(_))
    }
}
