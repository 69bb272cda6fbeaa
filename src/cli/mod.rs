//! One file a subcommand. Options, progress, reports and messages live here and nowhere
//! else; results go to stdout, all else to stderr.

mod bench;
mod captured;
mod demo;
mod evaluate;
mod export;
mod exposure;
mod field;
mod film;
mod frames;
mod generate;
mod import;
mod info;
mod info_of_file;
mod inputs;
mod interior;
mod ldis;
mod ledger;
mod made;
mod npz;
mod options;
mod output;
mod path;
mod plan;
mod plot;
mod proxy;
mod references;
mod render;
mod report;
mod session;
mod stamp;
mod surface;
mod targets;
mod time;
mod uncalibrated;
#[cfg(feature = "window")]
mod view;
mod walk;

use anyhow::Context as _;
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches as _, Parser, Subcommand};
use output::say;
use std::fmt::Write as _;
use std::num::NonZero;
use std::process::ExitCode;

/// Unstructured lumigraph rendering: calibrated photos in, novel views out.
#[derive(Parser)]
#[command(name = "lumigraph", version, arg_required_else_help = true)]
struct Cli {
    /// Worker threads [default: one a processor core]; pictures do not depend on it
    #[arg(long, global = true, value_name = "N")]
    threads: Option<NonZero<usize>>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Args),
    Import(import::Args),
    Info(info::Args),
    Proxy(proxy::Args),
    Render(render::Args),
    Field(field::Args),
    Evaluate(evaluate::Args),
    Bench(bench::Args),
    Export(export::Args),
    Path(path::Args),
    Interior(interior::Args),
    Plan(plan::Args),
    Ldis(ldis::Args),
    Walk(walk::Args),
    #[cfg(feature = "window")]
    View(view::Args),
    Generate(generate::Args),
}

/// What is asked for makes no sense, whatever the data: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// Parses the command line, runs the command, and says what went wrong: exit code 2 for
/// usage, 1 for bad data.
pub(super) fn main() -> ExitCode {
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let done = start_threads(cli.threads).and_then(|()| run(cli));
    let Err(error) = done else {
        return ExitCode::SUCCESS;
    };
    if let Some(Usage(message)) = error.downcast_ref() {
        // With the usage of the command that was given.
        let mut all = Cli::command();
        all.build();
        let name = matches.subcommand_name().unwrap_or_default();
        let command = match all.find_subcommand_mut(name) {
            Some(command) => command,
            None => &mut all,
        };
        let _ = command.error(ErrorKind::ValueValidation, message).print();
        return ExitCode::from(2);
    }
    if output::is_closed_pipe(&error) {
        return ExitCode::SUCCESS;
    }
    say!("error: {}", one_line(&error));
    ExitCode::from(1)
}

/// At once, as later there is nobody to tell that no more threads can be had.
fn start_threads(threads: Option<NonZero<usize>>) -> anyhow::Result<()> {
    let threads = threads.map_or(0, NonZero::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build_global().context(
        "worker threads cannot be started; try fewer --threads, or a higher limit (ulimit -u, -v)",
    )
}

fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Demo(args) => demo::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Proxy(args) => proxy::run(&args),
        Command::Render(args) => render::run(&args),
        Command::Field(args) => field::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Path(args) => path::run(&args),
        Command::Interior(args) => interior::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Ldis(args) => ldis::run(&args),
        Command::Walk(args) => walk::run(&args),
        #[cfg(feature = "window")]
        Command::View(args) => view::run(&args),
        Command::Generate(args) => generate::run(&args),
    }
}

/// An error and its causes, but for those that the text before already quotes.
fn one_line(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            let _ = write!(text, ": {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn causes_are_said_once() {
        let io = std::io::Error::other("disk on fire");
        let error = anyhow::Error::new(io).context("a.jpg: cannot read: disk on fire");
        let error = error.context("importing");
        assert_eq!(
            one_line(&error),
            "importing: a.jpg: cannot read: disk on fire"
        );
    }
}
