//! The same scripted motions in MuJoCo (`tests/data/make_mujoco.py`), and where the two differ.
#![expect(clippy::unwrap_used, reason = "our own fixture loads")]

use palpate_spatial::{Vector3, Wrench};

use crate::rig::{DT, Rig, config};

#[derive(serde::Deserialize)]
struct File {
    every: usize,
    motions: Vec<Motion>,
}

#[derive(serde::Deserialize)]
struct Motion {
    name: String,
    clearance: f64,
    start: [f64; 3],
    tilt: f64,
    script: Vec<Segment>,
    wrenches: Vec<[f64; 6]>,
}

#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Segment {
    Line { velocity: [f64; 3], ticks: usize },
    Sine { amplitude: f64, hertz: f64, ticks: usize },
}

/// Our wrench every `every` ticks.
fn replay(motion: &Motion, every: usize) -> Vec<Wrench> {
    let mut rig = Rig::new(&config(motion.clearance, 0.0), motion.start, [0.0, motion.tilt, 0.0]);
    let mut all = Vec::new();
    for segment in &motion.script {
        match *segment {
            Segment::Line { velocity, ticks } => {
                all.extend((0..ticks).map(|_| rig.slide(velocity)));
            }
            Segment::Sine { amplitude, hertz, ticks } => {
                let centre = rig.tip;
                for i in 1..=ticks {
                    let phase = std::f64::consts::TAU * hertz * i as f64 * DT;
                    all.push(
                        rig.to(centre + Vector3::new(amplitude * phase.sin(), 0.0, 0.0), rig.tilt),
                    );
                }
            }
        }
    }
    all.into_iter().skip(every - 1).step_by(every).collect()
}

const FX: usize = 0;
const FZ: usize = 2;
const TY: usize = 4;

/// A motion in both engines.
struct Both {
    ours: Vec<Wrench>,
    theirs: Vec<[f64; 6]>,
}

impl Both {
    fn new(file: &File, name: &str) -> Self {
        let motion = file.motions.iter().find(|m| m.name == name).unwrap();
        let ours = replay(motion, file.every);
        assert_eq!(ours.len(), motion.wrenches.len(), "{name}");
        Self { ours, theirs: motion.wrenches.clone() }
    }

    /// Largest difference of a component over samples.
    fn off(&self, axis: usize, samples: std::ops::Range<usize>) -> f64 {
        let difference = |i: usize| (self.ours[i].vector()[axis] - self.theirs[i][axis]).abs();
        samples.map(difference).fold(0.0, f64::max)
    }
}

fn file() -> File {
    serde_json::from_str(include_str!("../data/mujoco.json")).unwrap()
}

#[test]
fn where_nothing_slides_the_wrenches_are_mujocos() {
    let file = file();
    // At rest on the board: MuJoCo's contact gives way by 0.6 % of the press, ours by 0.1 %.
    let press = Both::new(&file, "press");
    assert!(
        press.off(FZ, 9..21) < 0.2 && press.off(FX, 9..21) < 0.01 && press.off(TY, 9..21) < 0.01
    );
    // Swaying in a tight hole, 10 mm deep: forces of 4 N, torques of 0.57 N·m.
    let wiggle = Both::new(&file, "wiggle");
    assert!(wiggle.off(FX, 61..110) < 0.3, "{:.3} N", wiggle.off(FX, 61..110));
    assert!(wiggle.off(TY, 61..110) < 0.03, "{:.3} N·m", wiggle.off(TY, 61..110));
    // A tilted peg on its way in, one wall touching. In F_z MuJoCo's servo lags by a step of motion, 0.5 N.
    let jam = Both::new(&file, "jam");
    assert!(jam.off(FX, 0..65) < 0.15, "{:.3} N", jam.off(FX, 0..65));
    assert!(jam.off(TY, 0..65) < 0.05, "{:.3} N·m", jam.off(TY, 0..65));
    assert!(jam.off(FZ, 1..65) < 0.6, "{:.3} N", jam.off(FZ, 1..65));
    // Just jammed: lateral forces of 1 and 4 N, torques of 0.1 and 0.4 N·m.
    let tight = Both::new(&file, "tight jam");
    for both in [&jam, &tight] {
        let samples = both.ours.len() - 15..both.ours.len() - 14;
        assert!(both.off(FX, samples.clone()) < 0.7, "{:.3} N", both.off(FX, samples.clone()));
        assert!(both.off(TY, samples.clone()) < 0.05, "{:.3} N·m", both.off(TY, samples));
    }
    // On the rim the lateral pull, at first.
    let rim = Both::new(&file, "rim");
    assert!(rim.off(FX, 8..9) < 0.1 && rim.off(FZ, 8..9) < 0.2 && rim.off(TY, 8..9) < 0.02);
}

/// MuJoCo's friction is soft: a sliding peg feels less of it, and a held one creeps.
#[test]
fn friction_is_coulombs_here_and_less_in_mujoco() {
    let file = file();
    let slide = Both::new(&file, "slide");
    let ratio = |f: &[f64]| f[0].hypot(f[1]) / f[2];
    for i in 20..55 {
        let (ours, theirs) = (ratio(slide.ours[i].vector().as_slice()), ratio(&slide.theirs[i]));
        assert!((ours / 0.3 - 1.0).abs() < 0.01, "{ours:.4} in sample {i}");
        assert!(theirs < 0.27, "MuJoCo improved: {theirs:.4} in sample {i}");
    }
    for (name, kept) in [("jam", 0.8), ("tight jam", 0.8), ("rim", 0.97)] {
        let both = Both::new(&file, name);
        let (last, axis) = (both.ours.len() - 1, if name == "rim" { FX } else { FZ });
        let ours = both.ours[last].vector()[axis] / both.ours[last - 10].vector()[axis];
        let theirs = both.theirs[last][axis] / both.theirs[last - 10][axis];
        assert!((ours - 1.0).abs() < 0.01, "{name}: {ours:.3} of the force is left after 0.2 s");
        assert!(theirs < kept, "{name}: MuJoCo keeps {theirs:.3}");
    }
}
