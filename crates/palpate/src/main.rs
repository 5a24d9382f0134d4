//! The `palpate` command.

mod commands;
mod training;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use palpate::real::{self, Address};
use palpate::{evaluate, interrupt, plot, report, study, virtual_ur};
use training::{Settings, TrainSim, Training};

/// Teach a position-controlled robot arm to feel its way.
///
/// Reinforcement learning picks, 20 times a second, a motion command and the gains of a 500 Hz force
/// controller, while a fail-safe layer stands between every command and the arm.
#[derive(Debug, Parser)]
#[command(name = "palpate", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a policy in simulation.
    ///
    /// Without arguments: policy model P-14 on the peg insertion (1 mm clearance, uncertain start and
    /// goal), 20 000 steps. Ctrl-C, SIGTERM or SIGUSR1 once finishes the episode and writes a checkpoint that
    /// --resume continues; Ctrl-C twice stops at once. A full disk is waited for.
    TrainSim(TrainSim),
    /// Train on a UR e-Series arm, or on a virtual one. Nothing here has moved a real arm.
    ///
    /// Examines the arm as `doctor` does, prints the limits and asks; then drives to the start and learns.
    /// Enter pauses after the episode and resumes; Ctrl-C brakes at once and writes a checkpoint. A stop of the
    /// arm's safety system is never cleared here: a person does that at the arm, and then presses Enter.
    TrainReal(TrainReal),
    /// Run a trained policy on an arm, without the trainer.
    RunPolicy(RunPolicy),
    /// Examine an arm before it moves: versions, modes, payload, kinematics, sensor, link. Moves nothing.
    Doctor(Doctor),
    /// A virtual UR with the simulator's contact behind it, on a UR's own ports, until Ctrl-C.
    VirtualUr(VirtualUr),
    /// What this computer can hold at 500 Hz: how late it wakes a thread, and which limits follow for an arm.
    ///
    /// An arm is commanded every 2 ms. A thread that wakes late misses cycles: after 5 of them the link counts as
    /// lost, after 10 the arm brakes by itself. This measures wake-ups as the control thread of train-real has them,
    /// alone and beside a busy learner, says whether SCHED_FIFO and locked memory are permitted, and which
    /// ur.stale_ticks, ur.stall_ticks and joint speeds this computer can answer for. Moves nothing.
    RtProbe(commands::RtProbe),
    /// Long tests of what stands between the trainer and an arm. Needs no arm.
    #[command(subcommand)]
    Soak(commands::Soak),
    /// Record how a task is done in simulation, by a script or a trained policy, to learn from.
    Demonstrate(commands::Demonstrate),
    /// Measure a trained policy on fresh episodes, beside three baselines on the same ones.
    ///
    /// Shows the last policy and the kept one (the latest of the best evaluations during training), and: a = 0 (the
    /// force controller alone), uniform random actions, and a scripted align–descend–spiral.
    Evaluate(Evaluate),
    /// Draw learning curves (SVG) of one or more runs.
    ///
    /// Runs that differ only in their seed are drawn as one curve: mean and spread.
    Plot(Plot),
    /// Show what the fail-safe layer refused, slowed and stopped during a run, by cause.
    ///
    /// From ledger.csv of the run, one row per event: cause, time in the episode, ticks in a row, distance to the limit,
    /// place of the tool, wrench, proposed and executed joints.
    Ledger(Ledger),
    /// Tell the story of one or more runs on one page of HTML that needs no network.
    ///
    /// Curves, force against its limit, gains by phase, what the fail-safe layer did and where, the policy before and
    /// after training, configuration and provenance. Several runs are compared.
    Report(report::Options),
    /// Do many runs from one file, resumable and shared out by any scheduler, and report them with statistics.
    #[command(subcommand)]
    Study(study::Study),
    /// Look after run directories: list, verify, repair, copy, export.
    #[command(subcommand)]
    Runs(commands::Runs),
}

#[derive(Debug, Args)]
struct TrainReal {
    /// Address of the controller: HOST or HOST:PORT.
    #[arg(long, value_name = "ADDRESS")]
    rtde: Address,
    #[command(flatten)]
    training: Training,
    /// Start from the learner of this run, usually a simulated one, with its configuration, --config and --set over it.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["demonstrations"])]
    from: Option<PathBuf>,
    /// Continue a run of train-real from its last checkpoint; --steps may extend it.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["preset", "task", "model", "config", "no_penalty", "device", "seed", "out", "from"])]
    resume: Option<PathBuf>,
    /// Connect, examine, print the limits, and move nothing.
    #[arg(long)]
    dry_run: bool,
    /// Do not ask before the arm moves.
    #[arg(long)]
    yes: bool,
}

#[derive(Debug, Args)]
struct RunPolicy {
    /// Run directory.
    run: PathBuf,
    /// Address of the controller: HOST or HOST:PORT.
    #[arg(long, value_name = "ADDRESS")]
    rtde: Address,
    /// Which policy: `last`, `best` (the latest of the best evaluations during training) or a checkpoint's name.
    #[arg(long, default_value = "last")]
    checkpoint: String,
    /// Episodes.
    #[arg(long, default_value_t = 10)]
    episodes: u64,
    /// Seed of the episodes' starts.
    #[arg(long, default_value_t = evaluate::DEFAULT_SEED)]
    seed: u64,
    /// TOML file whose keys override the run's: your cell.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Change one key of the run's configuration. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Connect, examine, print the limits, and move nothing.
    #[arg(long)]
    dry_run: bool,
    /// Do not ask before the arm moves.
    #[arg(long)]
    yes: bool,
    /// Record the episodes as MCAP in this folder.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Doctor {
    /// Address of the controller: HOST or HOST:PORT.
    #[arg(long, value_name = "ADDRESS")]
    rtde: Address,
    #[command(flatten)]
    settings: Settings,
    /// Print JSON instead of lines.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct VirtualUr {
    /// What goes wrong, and when.
    #[arg(value_name = "SECONDS:FAULT", long_help = palpate_virtual_ur::FAULT_HELP)]
    faults: Vec<palpate_virtual_ur::TimedFault>,
    #[command(flatten)]
    settings: Settings,
    /// Address to listen on.
    #[arg(long, default_value = "127.0.0.1")]
    address: std::net::IpAddr,
    /// Listen on any free ports instead of a UR's own.
    #[arg(long)]
    any_ports: bool,
}

#[derive(Debug, Args)]
struct Evaluate {
    /// Run directory.
    run: PathBuf,
    /// Episodes per policy.
    #[arg(long, default_value_t = 100)]
    episodes: u64,
    /// Seed of the episodes; the default is never used in training.
    #[arg(long, default_value_t = evaluate::DEFAULT_SEED)]
    seed: u64,
    /// Change the conditions, e.g. --set sim.friction=0.5. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Sample the policy's actions instead of taking their mean.
    #[arg(long)]
    stochastic: bool,
    /// Record every policy's first 3 episodes and those that failed, at most 10 of each, as MCAP in this folder.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Ledger {
    /// Run directory.
    run: PathBuf,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Plot {
    /// Run directories.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// Folder for the SVG files. Default: plots/ in the first run.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Weight of an exponential moving average over the curves (the paper: 0.6).
    #[arg(long, default_value_t = 0.0)]
    ema: f64,
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into()),
        )
        .with_writer(std::io::stderr)
        // A terminal that went away is no reason to panic.
        .log_internal_errors(false)
        .init();
    let cli = Cli::parse();
    match run(cli.command) {
        Ok(code) => code,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "error: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    interrupt::install()?;
    let done: anyhow::Result<()> = match command {
        Command::Study(what) => return what.run(),
        Command::TrainSim(args) => args.run(),
        Command::TrainReal(args) => real::train_real(&real::TrainReal {
            address: args.rtde,
            choice: args.training.going_on(args.from.is_some())?,
            from: args.from,
            resume: args.resume,
            demonstrations: args.training.demonstrations,
            out: args.training.out,
            dry_run: args.dry_run,
            yes: args.yes,
        }),
        Command::RunPolicy(args) => real::run_policy(&real::PolicyRun {
            run: args.run,
            checkpoint: args.checkpoint,
            address: args.rtde,
            episodes: args.episodes,
            seed: args.seed,
            file: args.config,
            set: args.set,
            dry_run: args.dry_run,
            yes: args.yes,
            record: args.record,
            json: args.json,
        }),
        Command::Doctor(args) => {
            real::doctor::command(&args.rtde, &args.settings.choice(), args.json)
        }
        Command::VirtualUr(args) => virtual_ur::command(
            &args.settings.choice(),
            virtual_ur::Setup {
                address: args.address,
                any_ports: args.any_ports,
                faults: args.faults,
            },
        ),
        Command::RtProbe(args) => args.run(),
        Command::Soak(what) => what.run(),
        Command::Demonstrate(args) => args.run(),
        Command::Evaluate(args) => evaluate::command(
            &args.run,
            &evaluate::Options {
                episodes: args.episodes,
                seed: args.seed,
                set: args.set,
                stochastic: args.stochastic,
                record: args.record,
            },
            args.json,
        ),
        Command::Report(options) => report::command(&options),
        Command::Runs(what) => what.run(),
        Command::Ledger(args) => {
            palpate::ledger::command(&args.run, args.json, &mut std::io::stdout().lock())
        }
        Command::Plot(args) => {
            for path in plot::run(&args.runs, args.out.as_deref(), args.ema)? {
                writeln!(std::io::stdout(), "{}", path.display())?;
            }
            Ok(())
        }
    };
    done.map(|()| ExitCode::SUCCESS)
}
