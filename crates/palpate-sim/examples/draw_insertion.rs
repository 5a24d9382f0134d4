//! What you learn: what a tight insertion looks like, and what its sensor feels.
//! Run: `cargo run --release -p palpate-sim --example draw_insertion -- round insertion.html` (or `square`,
//! `ring`, `sprung`), then open the file in a browser.
//! You should see: the peg meeting the mouth beside the middle and tilted, sliding in, and jamming where theory
//! says; contact forces as arrows, the wrench as curves, the play magnified.
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a tool for a terminal, on our own settings"
)]

#[expect(dead_code, reason = "the rig is shared with the tests")]
#[path = "../tests/contact/rig.rs"]
mod rig;

use std::fmt::Write as _;

use palpate_sim::SimConfig;
use palpate_spatial::Vector3;
use rig::{DT, Rig};

/// Ticks between two pictures.
const EVERY: usize = 5;

fn main() {
    let mut args = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let kind = args.next().unwrap_or_else(|| "round".into());
    let path = args.next();
    let config = match kind.as_str() {
        "square" => rig::config(2e-4, 1e-3),
        "ring" => rig::ring(2e-4, 1e-3),
        "sprung" => rig::sprung(2e-4, 1e-3),
        _ => rig::round(2e-4, 1e-3),
    };
    let frames = record(&config);
    println!("{kind}: {} pictures, deepest {:.2} mm", frames.count, frames.deepest * 1e3);
    if let Some(path) = path {
        let page = include_str!("draw_insertion.html")
            .replace("/*SHAPE*/", &shape(&config))
            .replace("/*FRAMES*/", &frames.json);
        std::fs::write(&path, page).unwrap();
        println!("wrote {path}");
    }
}

struct Frames {
    json: String,
    count: usize,
    deepest: f64,
}

/// 0.15 mm beside the middle and 1° tilted: down to 18 N, straightened, down, and out again.
fn record(config: &SimConfig) -> Frames {
    let tilt = 1f64.to_radians();
    let mut rig = Rig::new(config, [0.15e-3, 0.0, 0.003], [0.0, tilt, 0.0]);
    let mut frames = Frames { json: String::new(), count: 0, deepest: 0.0 };
    let mut tick = 0;
    let mut step = |rig: &mut Rig, move_by: Vector3, turn_to: f64| {
        let felt = rig.to(rig.tip + move_by * DT, Vector3::new(0.0, turn_to, 0.0));
        frames.deepest = frames.deepest.max(rig.depth());
        if tick % EVERY == 0 {
            let tip = rig.world.tip_pose();
            let (p, axis) = (tip.translation.vector * 1e3, tip.rotation * Vector3::z());
            let base = rig.world.receptacle_pose().translation.vector * 1e3;
            let seconds = tick as f64 * DT;
            write!(
                frames.json,
                "{{t:{seconds:.3},p:[{:.5},{:.5},{:.5}],a:[{:.6},{:.6}],b:[{:.5},{:.5}],w:[{:.3},{:.3},{:.3},{:.4}],c:[",
                p.x, p.y, p.z, axis.x, axis.y, base.x, base.z, felt.force.x, felt.force.y, felt.force.z, felt.torque.y
            )
            .unwrap();
            for contact in rig.world.contacts() {
                let (at, push) = (contact.position * 1e3, contact.normal * contact.force);
                write!(frames.json, "[{:.3},{:.3},{:.2},{:.2}],", at.x, at.z, push.x, push.z)
                    .unwrap();
            }
            frames.json.push_str("]},\n");
            frames.count += 1;
        }
        tick += 1;
        felt
    };
    let down = Vector3::new(0.0, 0.0, -0.010);
    while rig.tip.z > -0.016 && step(&mut rig, down, tilt).force.z < 18.0 {}
    for i in 0..200 {
        step(&mut rig, Vector3::zeros(), tilt * (1.0 - f64::from(i + 1) / 200.0));
    }
    let sideways = Vector3::new(-rig.tip.x / (100.0 * DT), 0.0, 0.0);
    for _ in 0..100 {
        step(&mut rig, sideways, 0.0);
    }
    while rig.tip.z > -0.016 && step(&mut rig, down, 0.0).force.z < 18.0 {}
    while rig.tip.z < 0.003 {
        step(&mut rig, -down * 3.0, 0.0);
    }
    frames
}

/// Half sections (across, along) of peg and hole in mm, each in its own frame.
fn shape(config: &SimConfig) -> String {
    let mm = |x: f64| x * 1e3;
    let (peg, hole) = (&config.peg, &config.hole);
    let (r, e) = (mm(peg.width / 2.0), mm(peg.chamfer));
    let (bore, c, outer) =
        (mm(config.hole_half_width()), mm(hole.chamfer), mm(hole.board_half_width));
    format!(
        "{{ring:{},clearance:{:.4},square:{},peg:[[0,0],[{:.3},0],[{r:.3},{:.3}],[{r:.3},{:.3}],[0,{:.3}]],\
         hole:[[{:.3},0],[{outer:.3},0],[{outer:.3},{:.3}],[{bore:.4},{:.3}],[{bore:.4},{:.3}]]}}",
        config.ring_on_tool(),
        mm(hole.clearance),
        peg.shape == palpate_sim::PegShape::Square,
        r - e,
        -e,
        -mm(peg.length),
        -mm(peg.length),
        bore + c,
        -mm(hole.depth),
        -mm(hole.depth),
        -c
    )
}
