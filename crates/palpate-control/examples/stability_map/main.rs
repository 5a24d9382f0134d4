//! What you learn: which contacts make the force loop oscillate, and which limit foretells it.
//! Run: `cargo xtask stability` (or `cargo run --release -p palpate-control --example stability_map`).
//! You should see: three heat maps in docs/results/stability/ and the tables of docs/results/stability.md,
//! the same at every run, after about 2 s.
#![expect(clippy::print_stdout, reason = "a report for a terminal")]

mod picture;
mod preset;
mod press;
mod tables;

use std::f64::consts::{SQRT_2, TAU};

use palpate_control::{
    AdmittanceGains, AdmittanceOutput, ControlConfig, ForceLoop, Gains, ParallelGains,
};
use palpate_spatial::Vector6;
use picture::{CUTOFFS, Line, Panel};
use preset::Preset;
use press::Press;

/// Cells of a panel, along each edge.
const CELLS: u32 = 20;
/// Length of a press of the maps, s.
const SECONDS: f64 = 8.0;
/// K_p^x and S of the maps and limits.
const KP: f64 = 1.0;
const SELECTION: f64 = 0.5;

const TITLE: &str =
    "Swing of the contact force, greatest less least by mean, after 7 s of pressing";

/// A law in one form, and the gains of its three panels.
#[derive(Debug)]
pub(crate) struct Form {
    pub(crate) name: &'static str,
    pub(crate) file: &'static str,
    pub(crate) control: ControlConfig,
    /// log₁₀ of N/m at the edges of its maps.
    pub(crate) stiffnesses: (f64, f64),
    /// K_p^f or k_d: how it reads, the gains, and (1−S)·K_p^f or 1/k_d.
    pub(crate) gains: Vec<(String, Gains, f64)>,
}

fn main() -> anyhow::Result<()> {
    let preset = Preset::load("palpate")?;
    let forms = forms(&preset.control);
    let folder = preset::root().join("docs/results/stability");
    std::fs::create_dir_all(&folder)?;
    for form in &forms {
        let panels = form
            .gains
            .iter()
            .map(|(title, gains, gain)| panel(&preset, form, title, gains, *gain))
            .collect::<anyhow::Result<_>>()?;
        let path = folder.join(format!("{}.svg", form.file));
        std::fs::write(&path, picture::draw(&format!("{TITLE} ({})", form.name), panels))?;
        println!("docs/results/stability/{}.svg", form.file);
    }
    let limits = tables::limits(&preset, &forms)?;
    let corners = tables::corners(&preset)?;
    let least = tables::least_stiffness(&preset)?;
    let paper = tables::corners(&Preset::load("paper")?)?;
    println!("{limits}\n{corners}\n{least}\n{paper}");
    tables::write(&[
        ("limits", &limits),
        ("corners", &corners),
        ("least k_d", &least),
        ("corners of paper", &paper),
    ])
}

fn forms(control: &ControlConfig) -> Vec<Form> {
    let parallel = [1e-3, 5e-3, 9e-3].map(|kf| {
        let gains = Gains::Parallel(ParallelGains {
            kp_x: Vector6::repeat(KP),
            kp_f: Vector6::repeat(kf),
            selection: Vector6::repeat(SELECTION),
        });
        (format!("K_f {kf} (m/s)/N"), gains, (1.0 - SELECTION) * kf)
    });
    let admittance = [100.0, 300.0, 500.0].map(|kd| {
        let gains = Gains::Admittance(AdmittanceGains {
            kp_x: Vector6::repeat(KP),
            stiffness: Vector6::repeat(kd),
        });
        (format!("k_d {kd}"), gains, 1.0 / kd)
    });
    let with = |output| {
        let mut control = control.clone();
        control.admittance.output = output;
        control
    };
    vec![
        Form {
            name: "parallel, S 0.5",
            file: "parallel",
            control: control.clone(),
            stiffnesses: (3.0, 6.0),
            gains: parallel.to_vec(),
        },
        Form {
            name: "admittance, velocity",
            file: "admittance-velocity",
            control: with(AdmittanceOutput::Velocity),
            stiffnesses: (3.0, 6.0),
            gains: admittance.to_vec(),
        },
        Form {
            name: "admittance, displacement",
            file: "admittance-displacement",
            control: with(AdmittanceOutput::Displacement),
            stiffnesses: (2.0, 5.0),
            gains: admittance.to_vec(),
        },
    ]
}

/// K_f·k or k/k_d below √2·2π·cutoff: the loop is an integrator behind a Butterworth filter.
pub(crate) fn simple_limit(gain: f64, cutoff: f64) -> f64 {
    SQRT_2 * TAU * cutoff / gain
}

fn panel(
    preset: &Preset,
    form: &Form,
    title: &str,
    gains: &Gains,
    gain: f64,
) -> anyhow::Result<Panel> {
    let at = |(low, high): (f64, f64), cell: f64| low + (high - low) * cell / f64::from(CELLS);
    let force_loop = |cutoff| ForceLoop { cutoff, ..preset.force_loop };
    let mut swing = Vec::new();
    for row in 0..CELLS {
        let stiffness = 10f64.powf(at(form.stiffnesses, f64::from(row) + 0.5));
        let cells = (0..CELLS).map(|column| {
            let cutoff = 10f64.powf(at(CUTOFFS, f64::from(column) + 0.5));
            let press = Press { stiffness, damping: 0.0, force_loop: force_loop(cutoff) };
            Ok(press.run(&form.control, gains, 0.0, SECONDS)?.swing)
        });
        swing.push(cells.collect::<anyhow::Result<Vec<f64>>>()?);
    }
    let line = |name, color, dashed, limit: &dyn Fn(f64) -> f64| Line {
        name,
        color,
        dashed,
        points: (0..=4 * CELLS)
            .map(|step| at(CUTOFFS, 0.25 * f64::from(step)))
            .map(|x| (x, limit(10f64.powf(x)).log10()))
            .collect(),
    };
    Ok(Panel {
        title: title.into(),
        stiffnesses: form.stiffnesses,
        swing,
        lines: vec![
            line("(1-S)·K_f·k = √2·2π·f_c (admittance: k/k_d)", "#1f4e9c", true, &|cutoff| {
                simple_limit(gain, cutoff)
            }),
            line("limit of the sampled loop with servo lag", "#111111", false, &|cutoff| {
                force_loop(cutoff).contact_limit(&form.control, gains, 2)
            }),
        ],
    })
}
