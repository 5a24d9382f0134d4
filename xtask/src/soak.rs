//! Long tests that are not part of every run.

use std::ffi::OsString;
use std::process::ExitCode;

use xshell::cmd;

use crate::{palpate, workspace};

pub(crate) fn command(args: &[OsString]) -> anyhow::Result<ExitCode> {
    let Some((what, rest)) = args.split_first() else {
        anyhow::bail!("soak what? There are: shield, link, packets, stops");
    };
    match what.to_str() {
        Some("shield") => {
            let sh = workspace::shell()?;
            cmd!(sh, "cargo run --release -p palpate-safety --example soak_shield -- {rest...}")
                .run()?;
            Ok(ExitCode::SUCCESS)
        }
        Some("link" | "packets" | "stops") => palpate::exec(&[&["soak".into()], args].concat()),
        _ => anyhow::bail!(
            "there is no soak `{}`; there are: shield, link, packets, stops",
            what.display()
        ),
    }
}
