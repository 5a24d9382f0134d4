//! The same motion gives the same bits: in one process, in two, and on a second world.

use std::process::Command;

use crate::exploration::Wanderer;
use crate::rig::{config, ring, round, sprung};

/// Every bit of the wrench over a thousand ticks of exploration with every kind of part, folded.
fn fingerprint() -> u64 {
    [config, round, ring, sprung].iter().fold(0, |hash, make| {
        let mut wanderer = Wanderer::new(&make(5e-5, 1e-3), 5);
        (0..1000).fold(hash, |hash: u64, _| {
            let wrench = wanderer.step().vector();
            wrench
                .iter()
                .fold(hash, |h, x| h.rotate_left(7).wrapping_mul(0x9E37_79B9) ^ x.to_bits())
        })
    })
}

#[test]
fn two_worlds_give_the_same_bits() {
    assert_eq!(fingerprint(), fingerprint());
}

const CHILD: &str = "PALPATE_SIM_FINGERPRINT";

#[test]
fn two_processes_give_the_same_bits() {
    let own = format!("fingerprint {:016x}", fingerprint());
    if std::env::var_os(CHILD).is_some() {
        println!("{own}");
        return;
    }
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "repeat::two_processes_give_the_same_bits", "--nocapture"])
        .env(CHILD, "1")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&child.stdout);
    assert!(text.contains(&own), "{own} here, but the other process says:\n{text}");
}
