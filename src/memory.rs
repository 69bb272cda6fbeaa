//! What happens where the system has no more memory: a message that says what to do, and the exit
//! code of bad data, in place of an abort.

#![expect(unsafe_code, reason = "an allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The system's allocator, which ends the program where there is no more: outputs are renamed into
/// place only when they are whole, so nothing half-written stays under its name.
pub(crate) struct OrSay;

// SAFETY: all of it is the system's allocator; where that returns null nothing is returned.
unsafe impl GlobalAlloc for OrSay {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        had(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        had(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as the caller promises.
        had(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[inline]
fn had(pointer: *mut u8, size: usize) -> *mut u8 {
    if pointer.is_null() {
        give_up(size);
    }
    pointer
}

static HAS_SIZE: AtomicBool = AtomicBool::new(false);
static HAS_CPU_MEMORY: AtomicBool = AtomicBool::new(false);

/// Which of the options that take less memory the command has: those are named where there is no more.
pub(crate) fn set_remedies(size: bool, cpu_memory: bool) {
    HAS_SIZE.store(size, Ordering::Relaxed);
    HAS_CPU_MEMORY.store(cpu_memory, Ordering::Relaxed);
}

/// What is said where so many bytes more were asked for.
struct Told {
    bytes: usize,
    has_size: bool,
    has_cpu_memory: bool,
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("out of memory: the system has no ")?;
        match self.bytes {
            bytes @ ..1000 => write!(f, "{bytes} bytes")?,
            bytes @ 1000..100_000 => write!(f, "{:.1} kB", bytes as f64 / 1e3)?,
            bytes => write!(f, "{:.1} MB", bytes as f64 / 1e6)?,
        }
        f.write_str(" more; try ")?;
        if self.has_size {
            f.write_str("a smaller --size, ")?;
        }
        f.write_str("fewer --threads, ")?;
        if self.has_cpu_memory {
            f.write_str("--cpu-memory SIZE for photos, ")?;
        }
        f.write_str("or a higher limit (ulimit -v)")
    }
}

/// Says so and ends the program, without allocating.
#[cold]
fn give_up(size: usize) -> ! {
    static SAID: AtomicBool = AtomicBool::new(false);
    if SAID.swap(true, Ordering::Relaxed) {
        // Another thread is about to end the program; if it is this one, while it speaks, no more
        // can be said.
        std::thread::sleep(Duration::from_secs(1));
    } else {
        // Standard error is not buffered, so nothing is allocated; where it is closed nobody reads.
        let told = Told {
            bytes: size,
            has_size: HAS_SIZE.load(Ordering::Relaxed),
            has_cpu_memory: HAS_CPU_MEMORY.load(Ordering::Relaxed),
        };
        let _ = writeln!(std::io::stderr(), "error: {told}");
    }
    exit()
}

/// At once: what other threads do must not keep it from ending.
#[cfg(unix)]
fn exit() -> ! {
    unsafe extern "C" {
        safe fn _exit(code: i32) -> !;
    }
    _exit(1)
}

#[cfg(not(unix))]
fn exit() -> ! {
    std::process::exit(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_options_of_the_command_are_named() {
        let told = |bytes, has_size, has_cpu_memory| {
            let told = Told {
                bytes,
                has_size,
                has_cpu_memory,
            };
            told.to_string()
        };
        assert_eq!(
            told(12_340_000, true, true),
            "out of memory: the system has no 12.3 MB more; try a smaller --size, fewer --threads, \
             --cpu-memory SIZE for photos, or a higher limit (ulimit -v)"
        );
        assert_eq!(
            told(32_768, true, false),
            "out of memory: the system has no 32.8 kB more; try a smaller --size, fewer --threads, \
             or a higher limit (ulimit -v)"
        );
        assert_eq!(
            told(64, false, false),
            "out of memory: the system has no 64 bytes more; try fewer --threads, or a higher limit (ulimit -v)"
        );
    }
}
