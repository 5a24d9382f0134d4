//! Files that are not as they were written.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, ensure};

use super::rig::{Print, Rig, files, newest, print, refused_well, said, same};

const BEFORE: u64 = 120;
const AFTER: u64 = 150;

/// What became of damaged runs.
#[derive(Default)]
struct Count {
    recovered: u64,
    refused: u64,
}

impl std::fmt::Display for Count {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { recovered, refused } = self;
        write!(f, "{} ({recovered} recovered, {refused} refused)", recovered + refused)
    }
}

pub(super) fn torture(
    rig: &Rig,
    stride: usize,
    damages: u64,
    random: &mut fastrand::Rng,
) -> anyhow::Result<String> {
    let base = rig.path("base");
    rig.finish(&base, BEFORE)?;
    let straight = rig.finish(&rig.copy(&base, "undamaged")?, AFTER)?;
    let manifest = format!("checkpoints/{}/manifest.json", newest(&base)?);
    let text = fs::read(base.join(&manifest))?;
    let trial = Trial { rig, straight: &straight };

    let (mut cuts, mut flips, mut others) = (Count::default(), Count::default(), Count::default());
    for at in (0..text.len()).step_by(stride) {
        let run = rig.copy(&base, "damaged")?;
        fs::write(run.join(&manifest), &text[..at])?;
        trial.judge(&mut cuts, &[Harm::new(&manifest, &format!("cut to {at} bytes"))], &run)?;

        let run = rig.copy(&base, "damaged")?;
        let mut flipped = text.clone();
        flipped[at] ^= 1 << random.u8(0..8);
        fs::write(run.join(&manifest), &flipped)?;
        trial.judge(&mut flips, &[Harm::new(&manifest, &format!("flipped in byte {at}"))], &run)?;
        if at % 100 == 0 {
            println!("  manifest, byte {at} of {}", text.len());
        }
    }
    for n in 0..damages {
        let run = rig.copy(&base, "damaged")?;
        let times = random.usize(1..=3);
        let done: Vec<_> = (0..times).map(|_| harm(&run, random)).collect::<Result<_, _>>()?;
        trial.judge(&mut others, &done, &run)?;
        if n % 100 == 99 {
            println!("  {} of {damages} random damages", n + 1);
        }
    }
    Ok(format!(
        "damage: cuts of the manifest {cuts}, flips in it {flips}, random damage elsewhere {others}"
    ))
}

struct Trial<'a> {
    rig: &'a Rig,
    straight: &'a Print,
}

impl Trial<'_> {
    /// Goes on with a damaged run: it ends as the straight one, or it says that it cannot.
    fn judge(&self, count: &mut Count, harms: &[Harm], run: &Path) -> anyhow::Result<()> {
        let what = || harms.iter().map(Harm::to_string).collect::<Vec<_>>().join(", ");
        let output = self.rig.go_on(run, AFTER, &[]).output()?;
        if output.status.success() {
            // A kept policy is nothing that a run goes on from: one that was harmed stays so.
            let lost = |name: &str| harms.iter().any(|harm| harm.name == name);
            let keep = |print: &Print| -> Print {
                let kept = print
                    .iter()
                    .filter(|(name, _)| !(name.starts_with("checkpoints/best_") && lost(name)));
                kept.map(|(name, bytes)| (name.clone(), bytes.clone())).collect()
            };
            print(run)
                .and_then(|found| same(&keep(self.straight), &keep(&found)))
                .with_context(what)?;
            count.recovered += 1;
        } else {
            let text = said(&output);
            // An error has to name something of the run.
            let named = text.contains(&*run.to_string_lossy());
            ensure!(refused_well(&output) && named, "{}: {}: {text}", what(), output.status);
            count.refused += 1;
        }
        Ok(())
    }
}

/// What was done to a file.
struct Harm {
    name: String,
    what: String,
}

impl Harm {
    fn new(name: &str, what: &str) -> Self {
        Self { name: name.into(), what: what.into() }
    }
}

impl std::fmt::Display for Harm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, self.what)
    }
}

/// Does something to one file of a run.
fn harm(run: &Path, random: &mut fastrand::Rng) -> anyhow::Result<Harm> {
    let all = files(run)?;
    let name = &all[random.usize(..all.len())];
    let path = run.join(name);
    let mut bytes = fs::read(&path)?;
    let at = random.usize(..=bytes.len());
    let what = match random.u8(0..4) {
        0 if at < bytes.len() => {
            bytes[at] ^= 1 << random.u8(0..8);
            format!("flipped in byte {at}")
        }
        1 => {
            bytes.truncate(at);
            format!("cut to {at} bytes")
        }
        2 => {
            // A block that never reached the disk.
            let end = bytes.len().min(at + 512);
            bytes[at..end].fill(0);
            format!("zero from {at} to {end}")
        }
        _ => {
            fs::remove_file(&path)?;
            return Ok(Harm::new(name, "gone"));
        }
    };
    fs::write(&path, bytes)?;
    Ok(Harm::new(name, &what))
}
