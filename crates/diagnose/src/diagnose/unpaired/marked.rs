//! Processes that a command has started, wherever they are now: a mark in their environment, which children inherit,
//! stays with a process that leaves its group, its session and its parent. What changes its environment as well
//! (`env -i`) is not found.

use std::fs;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// How long processes that start others while they are ended are gone after.
const LONGEST: Duration = Duration::from_secs(1);

/// Name of a variable that nobody else sets.
pub(super) struct Mark(pub String);

impl Mark {
    pub(super) fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        Self(format!("SHUTTERBUG_DISTANCE_{}_{count}_{}", std::process::id(), now.as_nanos()))
    }

    /// Ends every process with the mark, also those that others start meanwhile.
    pub(super) fn end_all(&self) {
        let begun = Instant::now();
        while self.end_those_there() > 0 && begun.elapsed() < LONGEST {
            // What was ended is gone from /proc a little later.
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// How many were found and ended.
    fn end_those_there(&self) -> usize {
        let Ok(all) = fs::read_dir("/proc") else { return 0 };
        let names = all.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        names.filter_map(|name| name.parse::<i32>().ok()).filter(|pid| self.end(*pid)).count()
    }

    /// Ends a process if it has the mark.
    #[cfg(target_os = "linux")]
    fn end(&self, pid: i32) -> bool {
        use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
        let Some(own) = Pid::from_raw(pid) else { return false };
        // Held before it is looked at: a number may pass to another process in between.
        let Ok(held) = pidfd_open(own, PidfdFlags::empty()) else { return false };
        let variable = format!("{}=1", self.0);
        let environment = fs::read(format!("/proc/{pid}/environ"));
        let is_ours = environment.is_ok_and(|e| e.split(|b| *b == 0).any(|v| v == variable.as_bytes()));
        is_ours && pidfd_send_signal(&held, Signal::KILL).is_ok()
    }

    /// Other systems do not show the environment of a process.
    #[cfg(not(target_os = "linux"))]
    fn end(&self, _: i32) -> bool {
        false
    }
}
