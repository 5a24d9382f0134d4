//! `cargo xtask bench`: an update beside the machine's limit and its peers, then every criterion bench.

use std::ffi::OsString;

use xshell::{Shell, cmd};

use crate::workspace;

pub(crate) fn command(args: &[OsString]) -> anyhow::Result<()> {
    let sh = workspace::shell()?;
    let peers: Vec<&str> = ["torch", "jax"].into_iter().filter(|peer| has(&sh, peer)).collect();
    if peers.is_empty() {
        println!("peers: none; `pip install torch jax` brings them (PYTHON names another Python)");
    }
    let update_cost = ["run", "--release", "-p", "palpate-sac", "--example", "update_cost"];
    cmd!(sh, "cargo {update_cost...} -- 40 {peers...}").run()?;
    cmd!(sh, "cargo bench --workspace --bench * {args...}").run()?;
    Ok(())
}

/// Whether Python has this module.
fn has(sh: &Shell, module: &str) -> bool {
    let python = sh.var("PYTHON").unwrap_or_else(|_| "python3".into());
    let look =
        format!("import importlib.util as i, sys; sys.exit(i.find_spec('{module}') is None)");
    cmd!(sh, "{python} -c {look}").quiet().ignore_stderr().run().is_ok()
}
