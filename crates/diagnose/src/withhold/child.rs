//! Commands that a run starts, and that stop when it does.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::child::{heard, last_line, pid_of};
use shutterbug::error::{Error, Result};

/// From one look at a command to the next.
const LOOK: Duration = Duration::from_millis(50);

/// Runs a command to its end; its last line is what an error says. Once `stop` says so the command is asked to stop
/// (SIGTERM), and waited for: it keeps what it has worked out. A signal may reach this process alone.
///
/// # Errors
/// A command that fails; [`Error::CasesInterrupted`], of the one case, where it was stopped.
pub(super) fn made(mut command: Command, what: &str, capture: &Path, stop: &dyn Fn() -> bool) -> Result<()> {
    let program = PathBuf::from(command.get_program());
    let started = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = started.map_err(|e| Error::io(&program, "run", e))?;
    let said = heard(child.stderr.take());
    let mut asked = false;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| Error::io(&program, "wait for", e))? {
            break status;
        }
        if !asked && stop() {
            ask_to_stop(&child);
            asked = true;
        }
        std::thread::sleep(LOOK);
    };
    if status.success() {
        return Ok(());
    }
    if stop() {
        return Err(Error::CasesInterrupted { done: 0, total: 1 });
    }
    let last = last_line(&said.recv().unwrap_or_default()).unwrap_or_else(|| "no message".to_owned());
    let found = format!("a {what} that ended with {status}: {last}");
    let expected = "one that comes to its end; mend the cause and run the same command again";
    Err(Error::input(capture, None, found, expected))
}

fn ask_to_stop(child: &Child) {
    if let Some(pid) = pid_of(child) {
        // It may have ended by itself.
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
    }
}
