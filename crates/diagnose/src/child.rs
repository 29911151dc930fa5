//! Commands that are started: what they say, and who they are.

use std::io::Read;
use std::process::Child;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use rustix::process::Pid;
use shutterbug::error::one_line;

/// What is kept of the end of what a command prints, bytes.
const KEPT: usize = 1 << 16;

/// The number of a process.
pub(crate) fn pid_of(child: &Child) -> Option<Pid> {
    i32::try_from(child.id()).ok().and_then(Pid::from_raw)
}

/// The end of what a stream says, once it is over.
pub(crate) fn heard(stream: Option<impl Read + Send + 'static>) -> Receiver<Vec<u8>> {
    let (send, receive) = channel();
    thread::spawn(move || {
        let (mut kept, mut some) = (Vec::new(), [0; 4096]);
        if let Some(mut stream) = stream {
            while let Ok(n @ 1..) = stream.read(&mut some) {
                kept.extend_from_slice(&some[..n]);
                let beyond = kept.len().saturating_sub(KEPT);
                kept.drain(..beyond);
            }
        }
        // Nobody waits any more where the command was stopped.
        let _ = send.send(kept);
    });
    receive
}

/// The last line that is not blank.
pub(crate) fn last_line(said: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(said);
    let line = text.lines().rev().map(str::trim).find(|l| !l.is_empty())?;
    Some(one_line(line))
}
