//! The tables of docs/results/stability.md.

use std::fmt::Write as _;

use anyhow::Context as _;
use palpate_control::{AdmittanceGains, ControlConfig, ForceLoop, Gains};
use palpate_spatial::Vector6;

use crate::preset::{self, MODELS, Preset};
use crate::press::{Press, bisect};
use crate::{Form, simple_limit};

/// Cut-offs of the table of limits, Hz: the authors', and the default preset's.
const CUTOFFS: [f64; 3] = [2.5, 10.0, 50.0];

/// Limits foretold and measured.
pub(crate) fn limits(preset: &Preset, forms: &[Form]) -> anyhow::Result<String> {
    let mut table = String::from(
        "| law | gain | f_c, Hz | √2·2π·f_c bound | closed form | sampled, no lag | measured | sampled, 10 ms lag | measured |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for form in forms {
        for (title, gains, gain) in &form.gains {
            for cutoff in CUTOFFS {
                write!(table, "| {} | {title} | {cutoff} |", form.name)?;
                write!(table, " {} |", engineering(simple_limit(*gain, cutoff)))?;
                write!(table, " {} |", engineering(closed_form(&form.control, gains, cutoff)))?;
                for servo_lag in [0.0, preset.force_loop.servo_lag] {
                    let force_loop = ForceLoop { cutoff, servo_lag, ..preset.force_loop };
                    let press = Press { stiffness: 0.0, damping: 0.0, force_loop };
                    let foretold = force_loop.contact_limit(&form.control, gains, 2);
                    let measured = press.measured_limit(&form.control, gains)?;
                    write!(table, " {} | {} |", engineering(foretold), engineering(measured))?;
                }
                table.push('\n');
            }
        }
    }
    Ok(table)
}

fn closed_form(control: &ControlConfig, gains: &Gains, cutoff: f64) -> f64 {
    match gains {
        Gains::Parallel(g) => {
            control.parallel.contact_limit(g.kp_x.z, g.kp_f.z, g.selection.z, cutoff)
        }
        Gains::Admittance(g) => control.admittance.contact_limit(g.stiffness.z, cutoff),
    }
}

/// Two digits and a power of ten.
fn engineering(x: f64) -> String {
    format!("{x:.1e}")
}

/// What the corners of the models' gain ranges do in the preset's contact.
pub(crate) fn corners(preset: &Preset) -> anyhow::Result<String> {
    let mut table = String::from(
        "| model | corners | softest limit, N/m | oscillate: spring alone | peak, N | with the damper | peak, N |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for name in MODELS {
        let model = preset::model(name)?;
        let limit = model.least_contact_limit(&preset.control, &preset.force_loop, 2);
        let corners = preset::corners(&model)?;
        write!(table, "| {} | {} | {} |", model.name, corners.len(), engineering(limit))?;
        for damping in [0.0, preset.damping] {
            let press = preset.press(damping);
            let (mut which, mut peak) = (Vec::new(), 0.0f64);
            for gains in &corners {
                // The policy pushes as hard as it can, so that no corner hovers.
                let outcome = press.run(&preset.control, gains, model.motion.linear, 20.0)?;
                if outcome.is_limit_cycle() {
                    let how = if outcome.opens { "opens" } else { "stays closed" };
                    which.push(format!("{} ({how})", named(gains)));
                    peak = peak.max(outcome.peak);
                }
            }
            if which.is_empty() {
                table.push_str(" none | – |");
            } else {
                write!(table, " {} | {peak:.0} |", which.join("; "))?;
            }
        }
        table.push('\n');
    }
    Ok(table)
}

fn named(gains: &Gains) -> String {
    match gains {
        Gains::Parallel(g) => {
            format!("K_p {:.1}, K_f {:.3}, S {:.1}", g.kp_x.z, g.kp_f.z, g.selection.z)
        }
        Gains::Admittance(g) => format!("K_p {:.1}, k_d {:.0}", g.kp_x.z, g.stiffness.z),
    }
}

/// The least k_d with which the admittance law settles in the preset's contact.
pub(crate) fn least_stiffness(preset: &Preset) -> anyhow::Result<String> {
    let mut table = String::from("| contact | K_p | foretold | measured |\n|---|---|---|---|\n");
    let gains = |kp, kd| {
        Gains::Admittance(AdmittanceGains {
            kp_x: Vector6::repeat(kp),
            stiffness: Vector6::repeat(kd),
        })
    };
    for damping in [0.0, preset.damping] {
        for kp in [0.2, 1.8] {
            let press = preset.press(damping);
            let settles =
                |kd| Ok(!press.run(&preset.control, &gains(kp, kd), 0.02, 20.0)?.is_limit_cycle());
            let foretold = bisect(1000.0, 10.0, |kd| {
                let limit = preset.force_loop.contact_limit(&preset.control, &gains(kp, kd), 2);
                Ok(preset.stiffness < limit)
            })?;
            let (contact, foretold) = if damping == 0.0 {
                ("spring alone", format!("{foretold:.0}"))
            } else {
                ("spring and damper", "–".into())
            };
            writeln!(
                table,
                "| {contact} | {kp} | {foretold} | {:.0} |",
                bisect(1000.0, 10.0, settles)?
            )?;
        }
    }
    Ok(table)
}

/// Puts each table between its markers in docs/results/stability.md.
pub(crate) fn write(tables: &[(&str, &str)]) -> anyhow::Result<()> {
    let path = preset::root().join("docs/results/stability.md");
    let mut text = std::fs::read_to_string(&path)?;
    for (name, table) in tables {
        let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
        let from = text.find(&start).with_context(|| format!("no marker {start:?}"))? + start.len();
        let to = text.find(&end).with_context(|| format!("no marker {end:?}"))?;
        text.replace_range(from..to, &format!("\n{table}\n"));
    }
    std::fs::write(path, text)?;
    println!("docs/results/stability.md");
    Ok(())
}
