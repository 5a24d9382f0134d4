//! ẋ_e as a backward difference, without a kick at the first tick.

use palpate_spatial::Vector6;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Derivative {
    last: Option<Vector6>,
    before: Option<Vector6>,
}

impl Derivative {
    /// (x − x_last) / dt; zero at the first tick, when there is no last.
    pub(crate) fn update(&mut self, x: &Vector6, dt: f64) -> Vector6 {
        self.before = self.last;
        self.last = Some(*x);
        self.before.map_or_else(Vector6::zeros, |last| (x - last) / dt)
    }

    /// Takes back the last update.
    pub(crate) fn undo(&mut self) {
        self.last = self.before;
    }
}
