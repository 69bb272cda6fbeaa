//! The command line.

mod cli;
mod memory;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: memory::OrSay = memory::OrSay;

fn main() -> ExitCode {
    silence_device_select();
    cli::main()
}

/// Keeps a Vulkan layer of Mesa's from printing "error: XDG_RUNTIME_DIR is invalid or not
/// set" wherever there is no desktop. All that it does is to put the desktop's device
/// first.
#[expect(
    unsafe_code,
    reason = "there is no other way to switch off a Vulkan layer"
)]
fn silence_device_select() {
    let unset = |name| std::env::var_os(name).is_none();
    if unset("XDG_RUNTIME_DIR") && unset("MESA_VK_DEVICE_SELECT") && unset("NODEVICE_SELECT") {
        // SAFETY: this runs first thing in `main`, while there is but one thread.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
