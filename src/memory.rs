//! What happens where the system has no more memory: a message that says what to do, and the exit
//! code of bad data, in place of an abort.

#![expect(unsafe_code, reason = "an allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
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
        let _ = writeln!(
            std::io::stderr(),
            "error: out of memory: the system has no {:.1} MB more; try a smaller --size, fewer \
             --threads, --cpu-memory SIZE for photos, or a higher limit (ulimit -v)",
            size as f64 / 1e6
        );
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
