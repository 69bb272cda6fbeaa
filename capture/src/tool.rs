use std::collections::VecDeque;
use std::ffi::OsStr;
use std::fs::{self, OpenOptions};
use std::io::{self, BufRead, BufReader, PipeReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};

/// How many of the last lines that a program printed an error quotes.
const LINES_QUOTED: usize = 8;

/// Another program that this one runs.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Its name, to be looked up on the PATH, or its path.
    pub program: PathBuf,
    /// How to install it, for the message that it is missing.
    pub install: &'static str,
}

/// Why a program could not be run to a good end.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// There is no such program.
    #[error("{}: no such program on the PATH; {install}", program.display())]
    Missing {
        /// Its name or path.
        program: PathBuf,
        /// How to install it.
        install: &'static str,
    },
    /// The program cannot be started, or what it says cannot be read.
    #[error("{}: cannot run the program: {source}", program.display())]
    Run {
        /// Its name or path.
        program: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// What it is to read cannot be had, or not be given to it.
    #[error("what {} was to read is not to be had: {source}", program.display())]
    Input {
        /// Its name or path.
        program: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Its log cannot be written.
    #[error("{}: cannot write the log: {source}", path.display())]
    Log {
        /// The log.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The program reports failure, or was stopped.
    #[error("`{command}` failed ({status}); {}", quoted(last_lines, log.as_deref()))]
    Failed {
        /// The program and its subcommand, if any.
        command: String,
        /// How it ended.
        status: ExitStatus,
        /// What it said last.
        last_lines: Vec<String>,
        /// Where all is that it said, if that was kept.
        log: Option<PathBuf>,
    },
}

fn quoted(last_lines: &[String], log: Option<&Path>) -> String {
    let of = log.map_or(String::new(), |log| format!(" of {}", log.display()));
    if last_lines.is_empty() {
        return format!("it said nothing{}", of.replace(" of ", " in "));
    }
    format!("the last lines{of}:\n    {}", last_lines.join("\n    "))
}

impl Tool {
    /// Runs the program to its end, whatever it says of its success, and returns what it
    /// printed on both streams: for help texts and versions.
    ///
    /// # Errors
    /// The program is missing or cannot be started.
    pub fn text(&self, arguments: &[&str]) -> Result<String, ToolError> {
        let (mut child, mut pipe) = self.start_merged(arguments)?;
        let mut bytes = Vec::new();
        let read = pipe.read_to_end(&mut bytes);
        read.and_then(|_| child.wait())
            .map_err(|source| self.run_error(source))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Runs the program. Each line that it prints on either stream is appended to `log`
    /// and handed on.
    ///
    /// # Errors
    /// The program is missing, cannot be started or fails; the log cannot be written.
    pub fn run(
        &self,
        arguments: &[impl AsRef<OsStr>],
        log: &Path,
        on_line: &mut dyn FnMut(&str),
    ) -> Result<(), ToolError> {
        let log_error = |source| ToolError::Log {
            path: log.to_owned(),
            source,
        };
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(log)
            .map_err(log_error)?;
        let (mut child, pipe) = self.start_merged(arguments)?;
        let mut last_lines = LastLines::default();
        let mut written = Ok(());
        for_each_line(pipe, |line| {
            if written.is_ok() {
                written = writeln!(file, "{line}");
            }
            last_lines.push(line);
            on_line(line);
        })
        .map_err(|source| self.run_error(source))?;
        let status = child.wait().map_err(|source| self.run_error(source))?;
        written.map_err(log_error)?;
        self.check(arguments, status, last_lines, Some(log))
    }

    /// Runs the program; hands what it prints on stdout to `read_stdout`, on a thread of
    /// its own, and each line of stderr to `on_line`. Where `read_stdout` fails the program
    /// is stopped.
    ///
    /// # Errors
    /// The program is missing, cannot be started or fails, or `read_stdout` does.
    pub fn stream<T: Send>(
        &self,
        arguments: &[impl AsRef<OsStr>],
        on_line: &mut dyn FnMut(&str),
        read_stdout: impl FnOnce(ChildStdout) -> io::Result<T> + Send,
    ) -> Result<T, ToolError> {
        let mut command = self.command(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|source| self.run_error(source))?;
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        let (Some(stdout), Some(stderr)) = (stdout, stderr) else {
            return Err(self.run_error(io::Error::other("its output is not to be had")));
        };
        let mut last_lines = LastLines::default();
        let (read, lines) = std::thread::scope(|scope| {
            // Where the reader gives up, it drops the pipe, and the program ends by itself.
            let reader = scope.spawn(move || read_stdout(stdout));
            let lines = for_each_line(stderr, |line| {
                last_lines.push(line);
                on_line(line);
            });
            let panicked = |_| Err(io::Error::other("reading its output panicked"));
            (reader.join().unwrap_or_else(panicked), lines)
        });
        let status = child.wait().map_err(|source| self.run_error(source))?;
        self.check(arguments, status, last_lines, None)?;
        lines.and(read).map_err(|source| self.run_error(source))
    }

    /// Runs the program; what `write_stdin` writes, on a thread of its own, is its input. What it
    /// prints is only kept for its error.
    ///
    /// # Errors
    /// The program is missing, cannot be started or fails, or `write_stdin` does, which is told apart.
    pub fn feed(
        &self,
        arguments: &[impl AsRef<OsStr>],
        write_stdin: impl FnOnce(ChildStdin) -> io::Result<()> + Send,
    ) -> Result<(), ToolError> {
        let mut command = self.command(arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::null());
        command.stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|source| self.run_error(source))?;
        let (stdin, stderr) = (child.stdin.take(), child.stderr.take());
        let (Some(stdin), Some(stderr)) = (stdin, stderr) else {
            return Err(self.run_error(io::Error::other("its input is not to be had")));
        };
        let mut last_lines = LastLines::default();
        let (written, lines) = std::thread::scope(|scope| {
            let writer = scope.spawn(move || write_stdin(stdin));
            let lines = for_each_line(stderr, |line| last_lines.push(line));
            let panicked = |_| Err(io::Error::other("writing its input panicked"));
            (writer.join().unwrap_or_else(panicked), lines)
        });
        let status = child.wait().map_err(|source| self.run_error(source))?;
        // A program that fails closes its input: that is the consequence, not the cause.
        match written {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                let program = self.program.clone();
                return Err(ToolError::Input {
                    program,
                    source: error,
                });
            }
            _ => self.check(arguments, status, last_lines, None)?,
        }
        lines.and(written).map_err(|source| self.run_error(source))
    }

    fn command(&self, arguments: &[impl AsRef<OsStr>]) -> Command {
        let mut command = Command::new(&self.program);
        command
            .args(arguments)
            .stdin(Stdio::null())
            // Programs with a window, COLMAP for one, would look for a screen.
            .env("QT_QPA_PLATFORM", "offscreen");
        command
    }

    /// Starts the program with both of its streams in one pipe, lines in their order.
    fn start_merged(
        &self,
        arguments: &[impl AsRef<OsStr>],
    ) -> Result<(Child, PipeReader), ToolError> {
        let start = || {
            let (reader, writer) = io::pipe()?;
            // The command holds the writing end: the pipe ends once it has gone.
            let mut command = self.command(arguments);
            command.stdout(writer.try_clone()?).stderr(writer);
            Ok((command.spawn()?, reader))
        };
        start().map_err(|source| self.run_error(source))
    }

    fn run_error(&self, source: io::Error) -> ToolError {
        let program = self.program.clone();
        let install = self.install;
        if source.kind() == io::ErrorKind::NotFound {
            ToolError::Missing { program, install }
        } else {
            ToolError::Run { program, source }
        }
    }

    fn check(
        &self,
        arguments: &[impl AsRef<OsStr>],
        status: ExitStatus,
        last_lines: LastLines,
        log: Option<&Path>,
    ) -> Result<(), ToolError> {
        if status.success() {
            return Ok(());
        }
        let name = self.program.file_name().unwrap_or_default();
        let mut command = name.to_string_lossy().into_owned();
        let subcommand = arguments.first().map(|a| a.as_ref().to_string_lossy());
        if let Some(subcommand) = subcommand.filter(|s| !s.starts_with('-')) {
            command = format!("{command} {subcommand}");
        }
        Err(ToolError::Failed {
            command,
            status,
            last_lines: last_lines.0.into(),
            log: log.map(Path::to_owned),
        })
    }
}

/// The last lines that say something.
#[derive(Default)]
struct LastLines(VecDeque<String>);

impl LastLines {
    fn push(&mut self, line: &str) {
        if line.trim().is_empty() {
            return;
        }
        if self.0.len() == LINES_QUOTED {
            self.0.pop_front();
        }
        self.0.push_back(line.trim_end().to_owned());
    }
}

/// Lines end with a line feed; what is no UTF-8 is replaced.
fn for_each_line(stream: impl Read, mut each: impl FnMut(&str)) -> io::Result<()> {
    let mut stream = BufReader::new(stream);
    let mut line = Vec::new();
    while stream.read_until(b'\n', &mut line)? > 0 {
        each(String::from_utf8_lossy(&line).trim_end_matches(['\n', '\r']));
        line.clear();
    }
    Ok(())
}

/// Length in bytes and time of modification of a file, as text: tells whether it is still
/// the same without reading it.
///
/// # Errors
/// The file cannot be examined.
pub fn fingerprint(path: &Path) -> io::Result<String> {
    let file = fs::metadata(path)?;
    let modified = file.modified()?.duration_since(std::time::UNIX_EPOCH);
    let (sign, span) = match modified {
        Ok(after) => ("", after),
        Err(before) => ("-", before.duration()),
    };
    Ok(format!(
        "{} bytes of {sign}{} ns",
        file.len(),
        span.as_nanos()
    ))
}
