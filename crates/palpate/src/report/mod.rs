//! `report`: the story of one or more runs on one page of HTML that needs no network.
//!
//! Figures come from the run's tables; what the policy does before and after training comes from running a fresh policy
//! with the run's seed, and the run's last one, on the same frozen starts in simulation.

pub(crate) mod behaviour;
mod charts;
mod live;
mod origin;
pub(crate) mod page;
mod run;

use std::io::Write as _;
use std::net::IpAddr;
use std::path::{Path, PathBuf};

use anyhow::Context as _;

use run::Run;

/// What to report, and where to.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Run directories.
    #[arg(required = true)]
    pub runs: Vec<PathBuf>,
    /// HTML file to write. Default: report.html in the first run.
    #[arg(long, value_name = "FILE", conflicts_with = "live")]
    pub out: Option<PathBuf>,
    /// Serve the page over HTTP and draw it anew as the runs go on.
    #[arg(long)]
    pub live: bool,
    /// Address to serve on; other machines see it only if this is not loopback.
    #[arg(long, default_value = "127.0.0.1", requires = "live")]
    pub address: IpAddr,
    /// Port to serve on; 0: any free one.
    #[arg(long, default_value_t = 8642, requires = "live")]
    pub port: u16,
}

/// The `report` command.
pub fn command(options: &Options) -> anyhow::Result<()> {
    if options.live {
        return live::serve(&options.runs, options.address, options.port);
    }
    let first = options.runs.first().context("name at least one run")?;
    let path = options.out.clone().unwrap_or_else(|| first.join("report.html"));
    let html = render(&options.runs)?;
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    writeln!(std::io::stdout(), "{}", path.display())?;
    Ok(())
}

/// The page.
pub fn render(runs: &[PathBuf]) -> anyhow::Result<String> {
    let mut read = Vec::new();
    for path in runs {
        read.push(Run::read(path).with_context(|| format!("cannot report {}", path.display()))?);
    }
    let groups = crate::plot::grouped(runs)?;
    page::page(&read, &groups)
}

/// What changes whenever the page would: lengths of the tables and the newest checkpoint.
fn version(runs: &[PathBuf]) -> String {
    let length = |path: &Path| std::fs::metadata(path).map_or(0, |m| m.len());
    let of = |run: &PathBuf| {
        let tables: u64 = ["metrics.csv", "episodes.csv", "summary.json"]
            .iter()
            .map(|name| length(&run.join(name)))
            .sum();
        format!("{tables}")
    };
    runs.iter().map(of).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests;
