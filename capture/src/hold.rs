//! Folders that one run at a time may change.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::Duration;

/// How often, and how far apart, a run tries to hold a folder: ten seconds together. Others hold it for as long as
/// writing the plan of a film and removing its frames takes, or looking whether it is left of an import.
const TRIES: u32 = 1000;
const BETWEEN: Duration = Duration::from_millis(10);

/// Another run holds the folder.
#[derive(Debug)]
pub struct Taken;

/// Holds a folder, until what comes back is dropped or the process ends, against other runs that hold it to change
/// what lies there. `None` where that cannot be: systems and disks that lock no folders.
///
/// # Errors
/// Another run holds it now.
pub fn hold_now(folder: &Path) -> Result<Option<File>, Taken> {
    let Ok(folder) = File::open(folder) else {
        return Ok(None);
    };
    match folder.try_lock() {
        Ok(()) => Ok(Some(folder)),
        Err(TryLockError::WouldBlock) => Err(Taken),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// [`hold_now`], once others no longer hold the folder; `None` also where another run was stopped meanwhile. Then a change that
/// another run makes at the same moment may be lost.
pub fn hold(folder: &Path) -> Option<File> {
    for _ in 0..TRIES {
        match hold_now(folder) {
            Ok(held) => return held,
            Err(Taken) => std::thread::sleep(BETWEEN),
        }
    }
    None
}
