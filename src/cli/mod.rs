//! What `tyndall` understands, and how it ends.

mod adapter;
mod convert;
mod doctor;
mod exposure;
mod failure;
mod healthcheck;
mod output;
mod print;
mod progress;
mod render;
mod scene;
mod serve;
mod simulate;

use std::io::{self, IsTerminal};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{self, ExitCode};

use clap::{Parser, Subcommand};

/// Grows living volumes, path traces them on the GPU, and streams the converging picture to any browser.
#[derive(Parser)]
#[command(version, after_help = "Exit codes: 0 done, 1 failed, 2 usage, 3 no adapter, 4 bad input, 5 a limit was reached.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Serve(serve::Args),
    Render(render::Args),
    Simulate(simulate::Args),
    /// Tell what a volume file holds.
    Info {
        /// An .nrrd or .npy file.
        file: PathBuf,
    },
    /// Turn a volume file into another format.
    Convert {
        /// An .nrrd or .npy file.
        input: PathBuf,
        /// An .nrrd or .npy file.
        output: PathBuf,
    },
    /// Print the JSON Schema of a scene document.
    Schema,
    /// List the scenes inside the program.
    Presets {
        /// Names alone.
        #[arg(long)]
        names: bool,
    },
    /// Tell which adapters there are, what fits on them, and what is missing.
    Doctor,
    Healthcheck(healthcheck::Args),
}

/// Runs the command line of this process.
pub(crate) fn run() -> ExitCode {
    let cli = Cli::parse();
    if matches!(cli.command, Command::Serve(_) | Command::Render(_) | Command::Simulate(_) | Command::Doctor) {
        silence_display_layer();
    }
    log_to_stderr(&cli.command);
    let done = match &cli.command {
        Command::Serve(args) => serve::run(args),
        Command::Render(args) => render::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Info { file } => convert::info(file),
        Command::Convert { input, output } => convert::convert(input, output),
        Command::Schema => print::schema(),
        Command::Presets { names } => print::presets(*names),
        Command::Doctor => doctor::run(),
        Command::Healthcheck(args) => healthcheck::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("tyndall: {failure}");
            ExitCode::from(failure.code)
        }
    }
}

/// A server logs what it does. Any other command speaks for itself: a refusal is one line on stderr.
fn log_to_stderr(command: &Command) {
    let default = if matches!(command, Command::Serve(_)) { "warn,tyndall=info" } else { "off" };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| default.into());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).with_ansi(io::stderr().is_terminal()).init();
}

/// Mesa's layer that chooses between GPUs asks for a desktop, and libwayland complains on stderr where there is none. The
/// variable that switches the layer off counts only if it was there when the process began, so it begins again.
fn silence_display_layer() {
    const SWITCH: &str = "NODEVICE_SELECT";
    if std::env::var_os("XDG_RUNTIME_DIR").is_some() || std::env::var_os(SWITCH).is_some() {
        return;
    }
    let mut args = std::env::args_os();
    let (Some(name), Ok(program)) = (args.next(), std::env::current_exe()) else { return };
    // Comes back only where it failed, and the complaint is then the lesser evil.
    let _ = process::Command::new(program).arg0(name).args(args).env(SWITCH, "1").exec();
}
