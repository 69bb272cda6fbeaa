//! One file a subcommand. Options, progress, reports and messages live here and nowhere
//! else; results go to stdout, all else to stderr.

mod bench;
mod budget;
mod captured;
mod damaged;
mod demo;
mod evaluate;
mod export;
mod exposure;
mod field;
mod film;
mod frames;
mod generate;
mod hold;
mod import;
mod info;
mod info_of_file;
mod inputs;
mod interior;
mod ldis;
mod ledger;
mod made;
mod notes;
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
mod shape;
mod shot;
mod stamp;
mod surface;
mod targets;
mod time;
mod took;
mod uncalibrated;
mod unused;
#[cfg(feature = "window")]
mod view;
mod walk;

use anyhow::Context as _;
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches as _, Parser, Subcommand};
use output::say;
use std::fmt::Write as _;
use std::io;
use std::num::NonZero;
use std::process::ExitCode;

/// Unstructured lumigraph rendering: calibrated photos in, novel views out.
#[derive(Parser)]
#[command(name = "lumigraph", version, arg_required_else_help = true)]
struct Cli {
    /// Worker threads [default: one a processor core]; pictures do not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = threads)]
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
    let all = command();
    let matches = all.clone().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    if let Some((command, given)) = matches.subcommand() {
        unused::say_unused(command, given);
        let options = all.find_subcommand(command).into_iter();
        let options = options.flat_map(|command| command.get_arguments());
        let names: Vec<&str> = options.filter_map(|option| option.get_long()).collect();
        crate::memory::set_remedies(names.contains(&"size"), names.contains(&"cpu-memory"));
    }
    let done = start_threads(cli.threads).and_then(|()| run(cli));
    let Err(error) = done else {
        return ExitCode::SUCCESS;
    };
    if let Some(Usage(message)) = error.downcast_ref() {
        // With the usage of the command that was given.
        let mut all = command();
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
    say!("error: {}{}", one_line(&error), remedy(&error));
    ExitCode::from(1)
}

/// The command line. A negative number after an option is its value, which it may refuse, and no option that
/// nobody knows.
fn command() -> clap::Command {
    let of_option = |arg: clap::Arg| match arg.get_long().is_some() && !arg.is_positional() {
        true if arg.get_action().takes_values() => arg.allow_negative_numbers(true),
        _ => arg,
    };
    let mut all = Cli::command().mut_args(of_option);
    let names = all.get_subcommands().map(|c| c.get_name().to_owned());
    for name in names.collect::<Vec<String>>() {
        all = all.mut_subcommand(name, |command| command.mut_args(of_option));
    }
    all
}

/// More worker threads than these are refused, unless there are cores for them: looking for work at one another, a
/// thousand on two cores took half a minute for what two did at once, and four thousand minutes.
const MOST_THREADS: usize = 256;
const MOST_THREADS_PER_CORE: usize = 16;

/// How many worker threads.
fn threads(text: &str) -> Result<NonZero<usize>, String> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let most = MOST_THREADS.max(MOST_THREADS_PER_CORE * cores);
    match text.parse::<NonZero<usize>>() {
        Ok(count) if count.get() <= most => Ok(count),
        _ => Err(format!("expected a whole number in 1..={most}")),
    }
}

/// What sets the number of worker threads where `--threads` does not.
const THREADS_VARIABLE: &str = "RAYON_NUM_THREADS";

/// At once, as later there is nobody to tell that no more threads can be had.
fn start_threads(threads: Option<NonZero<usize>>) -> anyhow::Result<()> {
    let by_cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let count = match threads {
        Some(count) => count.get(),
        None => threads_by_variable()?.unwrap_or(by_cores),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count);
    pool.build_global().context(
        "worker threads cannot be started; try fewer --threads, or a higher limit (ulimit -u, -v)",
    )
}

/// The number that [`THREADS_VARIABLE`] holds, if it holds one that is not zero.
fn threads_by_variable() -> anyhow::Result<Option<usize>> {
    let text = std::env::var(THREADS_VARIABLE).unwrap_or_default();
    let is_number = text.parse::<usize>().is_ok_and(|count| count > 0);
    let count = is_number.then(|| threads(&text)).transpose();
    let count =
        count.map_err(|expected| Usage(format!("{THREADS_VARIABLE}={text}: {expected}")))?;
    Ok(count.map(NonZero::get))
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

/// What to do about an error of the system's, whichever file it met: that may have been a hidden one.
fn remedy(error: &anyhow::Error) -> &'static str {
    let mut causes = error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>());
    let is_full = |cause: &io::Error| {
        matches!(
            cause.kind(),
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
        )
    };
    match causes.any(is_full) {
        true => "; make room on that disk, or write to another",
        false => "",
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
        command().debug_assert();
    }

    /// What an option requires nobody asks for where it conflicts with another that is given: the option itself
    /// is to conflict with that.
    #[test]
    fn no_option_goes_without_what_it_requires() {
        let parsed = |line: &str| {
            let words = ["lumigraph"].into_iter().chain(line.split(' '));
            command().try_get_matches_from(words)
        };
        let through = "--through 0,0,4 --through 1,0,4 --through 0,1,4";
        for (line, option) in [
            ("bench scene".to_owned(), "--seed 4"),
            ("bench --quick".to_owned(), "--seed 4"),
            ("bench --full".to_owned(), "--seed 4"),
            ("bench --scaling".to_owned(), "--seed 4"),
            ("bench --long-side 480".to_owned(), "--seed 4"),
            ("walk house --held-out -o out".to_owned(), "--fps 10"),
            (
                "field scene --view a.jpg --without-view -o f.png".to_owned(),
                "--frames 5",
            ),
            (
                "proxy scene plane --focus a.jpg:9,9".to_owned(),
                "--normal 0,0,1",
            ),
            (
                "proxy scene plane --focus a.jpg:9,9".to_owned(),
                "--point 0,0,4",
            ),
            (format!("proxy scene plane {through}"), "--normal 0,0,1"),
            (format!("proxy scene plane {through}"), "--point 0,0,4"),
        ] {
            assert!(parsed(&line).is_ok(), "{line}");
            let line = format!("{line} {option}");
            let error = parsed(&line).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::ArgumentConflict, "{line}: {error}");
        }
        for line in [
            "bench --stress 1 --seed 4",
            "walk house --video film.mp4 --fps 10 -o out",
            "field scene --view frame_0000 --path sweep --frames 5 -o f.png",
            "proxy scene plane --point 0,0,4 --normal 0,0,1",
        ] {
            assert!(parsed(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn as_many_threads_are_started_as_have_work() {
        assert_eq!(threads("1"), Ok(NonZero::<usize>::MIN));
        assert_eq!(threads("256").map(NonZero::get), Ok(256));
        for bad in ["0", "-1", "nan", "1000000", "99999999999999999999"] {
            let error = threads(bad).unwrap_err();
            assert!(
                error.starts_with("expected a whole number in 1..="),
                "{error}"
            );
        }
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
