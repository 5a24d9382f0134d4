//! `cargo xtask soak shield [ACTIONS [SEED]]`: adversaries against the shield, 10⁷ actions unless told otherwise.
//! Exit code 1 if a single set-point was illegal.
#![expect(clippy::print_stdout, reason = "a report")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::process::ExitCode;

use support::{adversary, judge, soak};

fn main() -> ExitCode {
    let mut args = std::env::args().skip(1).map(|a| a.replace('_', ""));
    let mut number = |default: u64| args.next().map_or(Ok(default), |a| a.parse());
    let (Ok(actions), Ok(seed)) = (number(10_000_000), number(1)) else {
        println!("usage: cargo xtask soak shield [ACTIONS [SEED]]");
        return ExitCode::from(2);
    };
    let mut violations = 0;
    for (name, safety, seed) in
        [("preset", support::preset(), seed), ("wide", support::wide(), seed + 1_000_000)]
    {
        let start = std::time::Instant::now();
        let mut report = soak::run(&safety, seed, actions / 2, false);
        let seconds = start.elapsed().as_secs_f64();
        println!("{name} workspace: {} actions in {seconds:.0} s", report.ticks);
        for (kind, n) in adversary::KINDS.iter().zip(report.by_kind) {
            println!("  {:<20} {n:>9} actions", format!("{kind:?}"));
        }
        for (cause, n) in report.counts.iter() {
            println!("  {:<20} {n:>9} verdicts", cause.name());
        }
        for (kind, n) in judge::KINDS.iter().zip(report.judge.counts) {
            println!("  {:<20} {n:>9} violations", format!("{kind:?}"));
        }
        report.nanoseconds.sort_unstable();
        let percentile =
            |p: f64| report.nanoseconds[(p * (report.nanoseconds.len() - 1) as f64) as usize];
        let (p50, p99, p999) = (percentile(0.5), percentile(0.99), percentile(0.999));
        println!("  cost of a tick       p50 {p50} ns, p99 {p99} ns, p99.9 {p999} ns");
        let [v, a, j] = report.judge.peaks;
        println!("  of the limits        speed {v:.6}, acceleration {a:.6}, jerk {j:.6}");
        let [wall, plane, own] = report.judge.least;
        println!(
            "  least clearance      box {wall:.1e} m, planes {plane:.1e} m, itself {own:.1e} m"
        );
        println!("  least |det J|        {:.2e}", report.least_manipulability);
        violations += report.judge.total();
    }
    println!("{violations} violations in {actions} actions");
    if violations == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
