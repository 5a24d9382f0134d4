//! Policy steps (25 control ticks of 2 ms) per second of one core, in thread CPU time.
//!
//! `cargo bench -p palpate-sim`; figures in `docs/results/contact.md`. "Jammed" wedges the peg 1° tilted near
//! 15 N and keeps it moving by ±20 µm; the worst an episode can cost.

#[expect(dead_code, reason = "the rig is shared with the tests")]
#[path = "../tests/contact/rig.rs"]
mod rig;

use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use palpate_spatial::Vector3;
use rig::{Rig, config, soft};
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
    let mut measure = |name: &str, rig: &mut Rig, amplitude: f64| {
        let centre = rig.tip;
        let mut tick = 0u32;
        group.bench_function(name, |b| {
            b.iter_custom(|steps| {
                let start = cpu_time();
                for _ in 0..steps * u64::from(TICKS) {
                    tick = (tick + 1) % 100;
                    let phase = std::f64::consts::TAU * f64::from(tick) / 100.0;
                    let aside = Vector3::new(amplitude * phase.sin(), 0.0, 0.0);
                    rig.to(centre + aside, rig.tilt);
                }
                cpu_time().saturating_sub(start)
            });
        });
    };
    for clearance in [1e-3, 2e-4, 5e-5] {
        let mm = clearance * 1e3;
        let mut free = Rig::new(&config(clearance, 0.0), [0.0, 0.0, 0.010], [0.0; 3]);
        measure(&format!("free/{mm} mm"), &mut free, 20e-6);
        let tilt = [0.0, if clearance > 5e-4 { 3f64.to_radians() } else { 1f64.to_radians() }, 0.0];
        let mut jammed = Rig::new(&config(clearance, 0.0), [0.0, 0.0, 0.002], tilt);
        jammed.push_down(17.0, 0.024);
        measure(&format!("jammed/{mm} mm"), &mut jammed, 20e-6);
    }
    // What training meets: the soft sensor, a chamfer, resting on its slope.
    let mut chamfer = Rig::new(&soft(1e-3, 1e-3), [1.2e-3, 0.0, 0.002], [0.03, 0.02, 0.0]);
    chamfer.push_down(5.0, 0.010);
    measure("chamfer/1 mm", &mut chamfer, 20e-6);
    group.finish();
}

criterion_group!(benches, contact);
criterion_main!(benches);
