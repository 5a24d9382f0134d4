//! The fail-safe layer's ledger, as it is written with a run.

use anyhow::Result;
use palpate_kinematics::SerialChain;
use palpate_runs::{Console, Mark, RunDir, Table};
use palpate_safety::{Cause, Entry};
use palpate_spatial::DOF;

use super::disk::insist;
use super::tables::LEDGER;
use crate::Config;
use crate::stack;

/// File of a run with every verdict that was not a plain pass.
pub(crate) const FILE: &str = "ledger.csv";

/// ledger.csv.
pub(super) struct Book {
    table: Table,
    /// Base to tool centre point: rows say where it happened.
    chain: SerialChain<DOF>,
}

impl Book {
    pub(super) fn open(config: &Config, dir: &RunDir, mark: Mark) -> Result<Self> {
        let chain = stack::chain(&config.robot)?.with_tool(stack::tool0_T_tool(&config.robot));
        Ok(Self { table: Table::open(&dir.path().join(FILE), LEDGER, mark)?, chain })
    }

    /// Writes a row per verdict of an episode that ended at `step`; their times count from the episode's first tick.
    ///
    /// A command that was only shaped by acceleration and jerk is a pass in all but name: those are counted in
    /// summary.json and not listed.
    pub(super) fn write(
        &mut self,
        console: &mut Console,
        (episode, step): (u64, u64),
        entries: &[Entry],
    ) -> Result<()> {
        for e in entries.iter().filter(|e| e.cause != Cause::Shaped) {
            let position = self.chain.forward(&e.executed).translation.vector;
            let (force, torque) = (e.wrench.force, e.wrench.torque);
            let proposed = |i: usize| e.proposed.map(|q| q[i]);
            let mut row = vec![
                Some(episode as f64),
                Some(step as f64),
                Some(rounded(e.time, 1e4)),
                Some(f64::from(e.ticks)),
                Some(e.distance).filter(|d| d.is_finite()).map(|d| rounded(d, 1e6)),
            ];
            row.extend(position.iter().map(|x| Some(rounded(*x, 1e6))));
            row.extend(force.iter().chain(torque.iter()).map(|x| Some(rounded(*x, 1e4))));
            row.extend((0..DOF).map(|i| proposed(i).map(|q| rounded(q, 1e6))));
            row.extend(e.executed.iter().map(|q| Some(rounded(*q, 1e6))));
            insist(console, || self.table.write_labelled(e.cause.name(), &row))?;
        }
        Ok(())
    }

    pub(super) fn mark(&self) -> Mark {
        self.table.mark()
    }

    pub(super) fn sync(&mut self) -> Result<(), palpate_runs::RunError> {
        self.table.sync()
    }
}

/// To a multiple of 1/`per`: what a person reads, and a tenth of the bytes.
fn rounded(value: f64, per: f64) -> f64 {
    // Plus zero: no minus in front of a 0.
    (value * per).round() / per + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_and_zero_has_no_sign() {
        assert_eq!(rounded(1.234_567_89, 1e6), 1.234_568);
        assert!(rounded(-1e-9, 1e6).is_sign_positive());
    }
}
