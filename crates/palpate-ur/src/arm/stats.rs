//! Counts of the link.

/// What an arm's link has done since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LinkStats {
    /// Samples received.
    pub samples: u64,
    /// Samples received that a newer one had already overtaken.
    pub skipped: u64,
    /// Cycles that the controller did not report, by its own clock.
    pub missed: u64,
    /// Samples that repeated a time.
    pub duplicates: u64,
    /// Commands sent.
    pub sent: u64,
    /// Commands that the network did not take.
    pub unsent: u64,
    /// Commands that the control program took, as its echo shows.
    pub taken: u64,
    /// Commands that a later one replaced before the control program saw them.
    pub overwritten: u64,
}

impl LinkStats {
    /// Part of the commands that the control program saw. 1 before there were any.
    pub fn success_rate(&self) -> f64 {
        let lost = self.overwritten + self.unsent;
        if self.taken + lost == 0 { 1.0 } else { self.taken as f64 / (self.taken + lost) as f64 }
    }
}
