//! Policy steps (25 control ticks of 2 ms) per second of one core, in thread CPU time.
//!
//! `cargo bench -p palpate-sim`; figures in `docs/results/contact.md`. "Jammed" wedges a peg 1° tilted near
//! 15 N and keeps it moving by ±20 µm; the worst an episode can cost.

#[expect(dead_code, reason = "the rig is shared with the tests")]
#[path = "../tests/contact/rig.rs"]
mod rig;

use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use palpate_sim::SimConfig;
use palpate_spatial::Vector3;
use rig::{Rig, config, ring, round, soft, sprung};
use rustix::time::{ClockId, clock_gettime};

const TICKS: u32 = 25;

/// CPU time of this thread: wall time lies on a machine that does something else besides.
fn cpu_time() -> Duration {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(now.tv_sec.try_into().unwrap_or(0), now.tv_nsec.try_into().unwrap_or(0))
}

fn contact(c: &mut Criterion) {
    let mut group = c.benchmark_group("policy_step");
    group.throughput(Throughput::Elements(1)).sampling_mode(SamplingMode::Flat).sample_size(20);
    let mut measure = |name: &str, rig: &mut Rig| {
        let centre = rig.tip;
        let mut tick = 0u32;
        group.bench_function(name, |b| {
            b.iter_custom(|steps| {
                let start = cpu_time();
                for _ in 0..steps * u64::from(TICKS) {
                    tick = (tick + 1) % 100;
                    let phase = std::f64::consts::TAU * f64::from(tick) / 100.0;
                    rig.to(centre + Vector3::new(20e-6 * phase.sin(), 0.0, 0.0), rig.tilt);
                }
                cpu_time().saturating_sub(start)
            });
        });
    };
    let jammed = |config: &SimConfig, force: f64| {
        let tilt = if config.hole.clearance > 5e-4 { 3f64 } else { 1f64 }.to_radians();
        let mut rig = Rig::new(config, [0.0, 0.0, 0.004], [0.0, tilt, 0.0]);
        rig.push_down(force, 0.024);
        rig
    };
    type Make = fn(f64, f64) -> SimConfig;
    let kinds: [(&str, Make); 4] =
        [("square", config), ("round", round), ("ring", ring), ("sprung round", sprung)];
    for (kind, make) in kinds {
        for clearance in [1e-3, 2e-4, 5e-5] {
            let mm = clearance * 1e3;
            let config = make(clearance, 0.0);
            measure(
                &format!("free {kind}/{mm} mm"),
                &mut Rig::new(&config, [0.0, 0.0, 0.010], [0.0; 3]),
            );
            measure(&format!("jammed {kind}/{mm} mm"), &mut jammed(&config, 17.0));
        }
    }
    // What training meets: the soft sensor and a chamfer, jammed and on the slope.
    for (kind, peg) in [("square", config(1e-3, 0.0).peg), ("round", round(1e-3, 0.0).peg)] {
        for clearance in [1e-3, 5e-5] {
            let mm = clearance * 1e3;
            let mut config = SimConfig { peg: peg.clone(), ..soft(clearance, 1e-3) };
            config.solver.pgs_iterations = 4;
            measure(
                &format!("jammed {kind} on the training sensor/{mm} mm"),
                &mut jammed(&config, 5.0),
            );
        }
    }
    let mut chamfer = Rig::new(&soft(1e-3, 1e-3), [1.2e-3, 0.0, 0.002], [0.03, 0.02, 0.0]);
    chamfer.push_down(5.0, 0.010);
    measure("on the chamfer, training sensor/1 mm", &mut chamfer);
    group.finish();
}

criterion_group!(benches, contact);
criterion_main!(benches);
