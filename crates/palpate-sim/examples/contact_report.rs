//! What you learn: how exact the simulated contact is, and what the solver's settings do to it.
//! Run: `cargo run --release -p palpate-sim --example contact_report`
//! You should see: the tables of `docs/results/contact.md`, in about a minute.
#![expect(clippy::print_stdout, reason = "a report for a terminal")]

#[path = "../tests/contact/rig.rs"]
mod rig;

use palpate_sim::SimConfig;
use palpate_spatial::Vector3;
use rig::{CLEARANCES, DT, Rig, config, ring, round, soft, sprung};
use rustix::time::{ClockId, clock_gettime};

type Make = fn(f64, f64) -> SimConfig;

fn main() {
    let kinds: [(&str, Make); 4] =
        [("square", config), ("round", round), ("ring", ring), ("sprung", sprung)];
    println!(
        "closed forms: two-point jam at 1° (mm), wedge kept over 0.3 s, lateral force at 0.15 mm (N)"
    );
    for (kind, make) in kinds {
        for clearance in CLEARANCES {
            closed_forms(kind, &make(clearance, 0.0));
        }
    }
    println!(
        "\nflat press of 20 N and slide: stiffness (N/mm), false force (N) and torque (N·m), ratio/μ − 1 (%)"
    );
    for (kind, config) in [
        ("square", config(2e-4, 0.0)),
        ("round", round(2e-4, 0.0)),
        ("soft square", soft(2e-4, 0.0)),
    ] {
        let p = press(&config);
        println!(
            "{kind:<12} {:7.2} {:6.4} {:7.5} {:+7.3} worst {:6.3}",
            p.stiffness, p.force, p.torque, p.slide[0], p.slide[1]
        );
    }
    println!(
        "\nsolver effort, stiff rig: square and round; jams at 0.2 and 0.05 mm; CPU µs per tick jammed"
    );
    for effort in [
        (1, 4, 2),
        (1, 4, 4),
        (1, 4, 6),
        (1, 4, 8),
        (1, 4, 16),
        (1, 2, 12),
        (1, 3, 8),
        (2, 2, 8),
        (4, 1, 8),
    ] {
        println!("{}", solver_effort(effort));
    }
    println!(
        "\ncontact frequency (Hz): press penetration (µm), jam at 0.05 mm (mm), for square and round"
    );
    for frequency in [500.0, 1000.0, 2000.0] {
        let row = [config as Make, round].map(|make| {
            let with = |clearance| {
                let mut config = make(clearance, 0.0);
                config.solver.contact_frequency = frequency;
                config
            };
            let (jam, _) = jam(&with(5e-5), 0.020);
            format!("{:5.2} {:6.3}", press(&with(2e-4)).penetration * 1e6, jam.depth() * 1e3)
        });
        println!("{frequency:6} {}", row.join("  "));
    }
    println!(
        "\nhow stiff: (h·c + h²·k)/J per pass, false torque of a press (N·m), false lateral force (N), left after retreat (N)"
    );
    for scale in [0.1, 1.0, 2.0, 4.0, 8.0, 16.0] {
        for passes in [2, 4, 8, 16] {
            how_stiff(scale, passes);
        }
    }
}

/// Pushed down at 10 mm/s to 20 N while tilted by a degree, and the force kept 0.3 s after it came to rest.
fn jam(config: &SimConfig, depth: f64) -> (Rig, [f64; 2]) {
    let mut rig = Rig::new(config, [0.0, 0.0, 0.004], [0.0, 1f64.to_radians(), 0.0]);
    rig.push_down(20.0, depth);
    let mut held = Rig::new(config, [0.0, 0.0, 0.004], [0.0, 1f64.to_radians(), 0.0]);
    held.push_down(20.0, depth);
    let before = held.hold(25).force.z;
    (rig, [before, held.hold(150).force.z])
}

fn closed_forms(kind: &str, config: &SimConfig) {
    let clearance = config.hole.clearance;
    let expected = |tilt: f64| (0.020 + clearance - 0.020 * tilt.cos()) / tilt.sin() * 1e3;
    let jammed = if clearance < 5e-4 {
        let (rig, kept) = jam(config, 0.020);
        format!(
            "jam {:7.3}, form {:7.3} (true tilt {:7.3}), kept {:5.2} → {:5.2} N",
            rig.depth() * 1e3,
            expected(1f64.to_radians()),
            expected(rig.true_tilt()),
            kept[0],
            kept[1]
        )
    } else {
        "does not jam".into()
    };
    let mut rig = Rig::new(config, [0.0, 0.0, 0.002], [0.0; 3]);
    rig.push_down(20.0, 0.010);
    let (centre, mut peak) = (rig.tip, 0.0f64);
    for tick in 0..500 {
        let phase = std::f64::consts::TAU * 2.0 * f64::from(tick) * DT;
        let wrench = rig.to(centre + Vector3::new(0.15e-3 * phase.sin(), 0.0, 0.0), rig.tilt);
        if tick > 100 {
            peak = peak.max(wrench.force.x.abs());
        }
    }
    let mut stiffness = 1.0 / (1.0 / 1e5 + 0.14f64.powi(2) / 1000.0);
    if let Some(receptacle) = &config.receptacle {
        stiffness = 1.0 / (1.0 / stiffness + 1.0 / receptacle.compliance.linear_stiffness);
    }
    let sway = (stiffness * (0.15e-3 - clearance / 2.0)).max(0.0);
    println!("{kind:<7} {:5} mm: {jammed}; sway {peak:5.3}, form {sway:5.3}", clearance * 1e3);
}

struct Press {
    stiffness: f64,
    force: f64,
    torque: f64,
    penetration: f64,
    /// Mean and largest departure of the friction ratio, %.
    slide: [f64; 2],
    left: f64,
}

fn press(config: &SimConfig) -> Press {
    let mut rig = Rig::new(config, [0.05, 0.0, 0.001], [0.0; 3]);
    rig.push_down(20.0, 1.0);
    let felt = rig.hold(600);
    let (stiffness, penetration) = (felt.force.z / -rig.tip.z / 1e3, rig.world.penetration());
    let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0);
    for tick in 0..1000 {
        let wrench = rig.slide([0.006, 0.008, 0.0]);
        if tick > 250 {
            let off = (wrench.force.xy().norm() / wrench.force.z / config.friction - 1.0) * 100.0;
            (sum, worst, count) = (sum + off, worst.max(off.abs()), count + 1);
        }
    }
    while rig.tip.z < 0.001 {
        rig.slide([0.0, 0.0, 0.020]);
    }
    Press {
        stiffness,
        force: felt.force.xy().norm(),
        torque: felt.torque.norm(),
        penetration,
        slide: [sum / f64::from(count), worst],
        left: rig.hold(300).force.norm(),
    }
}

fn solver_effort((steps, iterations, passes): (u32, usize, usize)) -> String {
    let mut line = format!("{steps}×{iterations}, {passes:2} passes:");
    for make in [config as Make, round] {
        let with = |clearance| {
            let mut config = make(clearance, 0.0);
            config.solver.steps_per_tick = steps;
            config.solver.iterations = iterations;
            config.solver.pgs_iterations = passes;
            config
        };
        if with(2e-4).validate().is_err() {
            line += "  refused";
            continue;
        }
        let p = press(&with(2e-4));
        let (ratio, worst) = (p.slide[0], p.slide[1]);
        let pressed = format!("  torque {:7.5} ratio {ratio:+6.3} % worst {worst:5.2}", p.torque);
        line.push_str(&pressed);
        for clearance in [2e-4, 5e-5] {
            let (mut rig, _) = jam(&with(clearance), 0.020);
            let depth = rig.depth();
            let jam = format!(" jam {:6.3} {:4.1} µs", depth * 1e3, cost(&mut rig));
            line.push_str(&jam);
        }
    }
    line
}

/// CPU time of a tick, µs, swaying by 20 µm.
fn cost(rig: &mut Rig) -> f64 {
    let cpu = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
    };
    let (centre, start) = (rig.tip, cpu());
    for tick in 0..5000 {
        let phase = std::f64::consts::TAU * f64::from(tick % 100) / 100.0;
        rig.to(centre + Vector3::new(20e-6 * phase.sin(), 0.0, 0.0), rig.tilt);
    }
    (cpu() - start) / 5000.0 * 1e6
}

fn how_stiff(scale: f64, passes: usize) {
    let mut config = config(2e-4, 0.0);
    let c = &mut config.compliance;
    c.linear_stiffness *= scale;
    c.angular_stiffness *= scale;
    c.linear_damping *= scale.sqrt();
    c.angular_damping *= scale.sqrt();
    config.solver.pgs_iterations = passes;
    config.solver.contact_frequency = 1000.0 * scale.sqrt().max(1.0);
    let lever = config.tool.centre_of_mass.powi(2);
    let c = &config.compliance;
    let h = DT / config.solver.iterations as f64;
    let damping = c.angular_damping + c.linear_damping * lever;
    let stiffness = c.angular_stiffness + c.linear_stiffness * lever;
    let ratio = (h * damping + h * h * stiffness) / config.tool.inertia[0] / passes as f64;
    let verdict = match config.validate() {
        Ok(()) => {
            let p = press(&config);
            format!("{:7.5} {:7.5} {:7.5}", p.torque, p.force, p.left)
        }
        Err(_) => "refused".into(),
    };
    println!("{scale:5} × stiffness, {passes:2} passes: {ratio:5.2}  {verdict}");
}
