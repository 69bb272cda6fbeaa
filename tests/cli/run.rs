//! Running the program, and captures to run it on.

use crate::once::Once;
use datasets::Options;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// What a run left.
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ran {
    /// The result of a run that must have worked.
    #[track_caller]
    pub(crate) fn ok(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }

    /// The one `error: …` line of a run that must have failed with an exit code.
    #[track_caller]
    pub(crate) fn error(&self, code: i32) -> String {
        assert_eq!(self.code, code, "{}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        let errors: Vec<&str> = self
            .stderr
            .lines()
            .filter_map(|line| line.strip_prefix("error: "))
            // Some graphics libraries have their say first.
            .filter(|line| !line.starts_with("XDG_RUNTIME_DIR"))
            .collect();
        assert_eq!(errors.len(), 1, "{}", self.stderr);
        errors[0].to_owned()
    }

    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).expect("stdout holds JSON and nothing else")
    }
}

/// Runs `lumigraph` in a folder, on the CPU path whatever the machine has, with words
/// separated by spaces.
pub(crate) fn lumigraph(folder: &Path, line: &str) -> Ran {
    run(folder, &line.split(' ').collect::<Vec<_>>(), &[])
}

pub(crate) fn run(folder: &Path, words: &[&str], variables: &[(&str, &str)]) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumigraph"));
    command.current_dir(folder).args(words);
    let name = if words[0] == "--threads" {
        words[2]
    } else {
        words[0]
    };
    if matches!(name, "render" | "evaluate" | "walk" | "ldis") && !words.contains(&"--device") {
        command.args(["--device", "cpu"]);
    }
    let Output {
        status,
        stdout,
        stderr,
    } = command.envs(variables.iter().copied()).output().unwrap();
    Ran {
        code: status.code().expect("the program was not killed"),
        stdout: String::from_utf8(stdout).unwrap(),
        stderr: String::from_utf8(stderr).unwrap(),
    }
}

/// Puts a script in a program's place, in a folder `bin` within this one: the `PATH` on which it comes first.
#[cfg(unix)]
pub(crate) fn with_script(folder: &Path, program: &str, script: &str) -> String {
    let bin = folder.join("bin");
    std::fs::create_dir_all(&bin).unwrap();
    std::fs::write(bin.join("script"), script).unwrap();
    // What this process has open to write, for an instant in others that it starts too, cannot be run.
    let copy = format!("cp script {program} && chmod +x {program}");
    let copied = Command::new("sh")
        .args(["-c", &copy])
        .current_dir(&bin)
        .status();
    assert!(copied.unwrap().success());
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(bin).chain(std::env::split_paths(&paths));
    std::env::join_paths(paths).unwrap().into_string().unwrap()
}

/// A folder with what `make` puts into it. What has the same `name` is made once, as many tests begin
/// with it.
pub(crate) fn folder_with(name: &str, make: impl FnOnce(&Path)) -> TempDir {
    static MADE: Once<String, BTreeMap<PathBuf, Vec<u8>>> = Once::new();
    let made = MADE.get(name.to_owned(), || {
        let folder = tempfile::tempdir().unwrap();
        make(folder.path());
        files(folder.path())
    });
    let folder = tempfile::tempdir().unwrap();
    for (file, bytes) in made {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    folder
}

/// A folder with what `lumigraph generate` writes there.
pub(crate) fn with_generated(options: &str) -> TempDir {
    folder_with(options, |folder| {
        lumigraph(folder, &format!("generate {options}")).ok();
    })
}

/// A folder with `wall`, a capture of nine 96 × 72 photos of which 0000.png and 0008.png
/// are to be held out.
pub(crate) fn with_wall() -> TempDir {
    folder_with("a small wall", |folder| {
        let options = Options {
            size: Some((96, 72)),
            samples_per_side: Some(1),
            ..Options::default()
        };
        let wall = datasets::by_name("wall", &options).unwrap();
        datasets::write(&wall, &folder.join("wall")).unwrap();
    })
}

/// Every file below a folder with its bytes.
pub(crate) fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}
