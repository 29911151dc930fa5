//! Commands that a run starts, and that stop when it does.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

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
    let mut said = child.stderr.take().expect("it is piped");
    let heard = std::thread::spawn(move || {
        let mut text = Vec::new();
        said.read_to_end(&mut text).map(|_| text)
    });
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
    let text = heard.join().expect("it only reads").map_err(|e| Error::io(&program, "read from", e))?;
    if status.success() {
        return Ok(());
    }
    if stop() {
        return Err(Error::CasesInterrupted { done: 0, total: 1 });
    }
    let text = String::from_utf8_lossy(&text);
    let last = text.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("no message");
    let found = format!("a {what} that ended with {status}: {last}");
    let expected = "one that comes to its end; mend the cause and run the same command again";
    Err(Error::input(capture, None, found, expected))
}

fn ask_to_stop(child: &Child) {
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        // It may have ended by itself.
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
    }
}
