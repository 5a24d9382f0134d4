//! Tells the crate which compiler and which Cargo.lock it is built with, for provenance.json.

use std::process::Command;

const LOCK: &str = "../../Cargo.lock";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={LOCK}");
    let rustc = std::env::var_os("RUSTC")
        .and_then(|rustc| Command::new(rustc).arg("-V").output().ok())
        .and_then(|said| String::from_utf8(said.stdout).ok())
        .unwrap_or_default();
    let lock = std::fs::read(LOCK).map(|bytes| format!("{:08x}", crc32c::crc32c(&bytes)));
    println!("cargo::rustc-env=PALPATE_RUSTC={}", rustc.trim());
    println!("cargo::rustc-env=PALPATE_CARGO_LOCK={}", lock.unwrap_or_default());
}
