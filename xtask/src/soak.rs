//! Long tests that are not part of every run.

use std::ffi::OsString;

use xshell::cmd;

use crate::workspace;

pub(crate) fn command(args: &[OsString]) -> anyhow::Result<()> {
    let Some((what, rest)) = args.split_first() else {
        anyhow::bail!("soak what? There is: shield");
    };
    anyhow::ensure!(what == "shield", "there is no soak `{}`, only `shield`", what.display());
    let sh = workspace::shell()?;
    cmd!(sh, "cargo run --release -p palpate-safety --example soak_shield -- {rest...}").run()?;
    Ok(())
}
