//! What decoded photos may take in memory where nobody says.

use std::fs;

/// What was asked for, else half of the memory that this process may have, where the system tells: photos that are
/// not used for a while are let go before there is none left.
pub(super) fn of_photos(asked: Option<u64>) -> Option<u64> {
    asked.or_else(|| Some(usable()? / 2))
}

/// Bytes of memory that the machine has, or the process' group may take if that is less.
fn usable() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo").ok();
    let machine = machine.and_then(|text| of_meminfo(&text));
    // As the second and the first version of control groups have it, in containers.
    let group = [
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ];
    let group = group.into_iter().filter_map(|file| {
        let text = fs::read_to_string(file).ok()?;
        // "max" where there is no limit.
        text.trim().parse().ok()
    });
    machine.into_iter().chain(group).min()
}

fn of_meminfo(text: &str) -> Option<u64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_holds() {
        assert_eq!(of_photos(Some(5)), Some(5));
        if cfg!(target_os = "linux") {
            let usable = usable().unwrap();
            assert!(usable > 1 << 20);
            assert_eq!(of_photos(None), Some(usable / 2));
        }
    }

    #[test]
    fn the_machine_tells_in_kibibytes() {
        let text = "MemTotal:       24731708 kB\nMemFree:        16428240 kB\n";
        assert_eq!(of_meminfo(text), Some(24_731_708 * 1024));
        for text in ["", "MemFree: 3 kB", "MemTotal: ? kB", "MemTotal: 3"] {
            assert_eq!(of_meminfo(text), None, "{text}");
        }
    }
}
