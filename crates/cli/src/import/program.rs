//! Programs that read videos, run beside this one: what they write, and how long it may take them.

use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use shutterbug::error::{Error, Result};

/// A program that writes nothing for so long is taken for one that never ends. ffprobe writes a line a frame, 32 KiB
/// at a time: some 800 frames, which it decodes.
const PATIENCE: Duration = Duration::from_mins(10);
/// What is left to do at its end.
const AT_THE_END: Duration = Duration::from_secs(10);

/// A running program. Reading is from its stdout. Its stderr is read aside so that it never waits for us.
pub(super) struct Running {
    program: &'static str,
    child: Child,
    out: ChildStdout,
    said: Receiver<String>,
    patience: Duration,
}

impl Running {
    /// Starts a program; what follows `-i` in the arguments is for the video at `path`.
    ///
    /// # Errors
    /// There is no such program, or it cannot be started.
    pub(super) fn start(program: &'static str, arguments: &[&str], path: &Path) -> Result<Self> {
        // `file:` and the list keep a file's content from sending the program elsewhere.
        let mut input = std::ffi::OsString::from("file:");
        input.push(path);
        let (before, after) =
            arguments.split_at(arguments.iter().position(|a| *a == "-i").map_or(0, |i| i + 1));
        let mut command = Command::new(program);
        command.args(["-v", "error", "-protocol_whitelist", "file"]).args(before).arg(input).args(after);
        Self::of(program, command, PATIENCE).map_err(|e| match e.kind() {
            ErrorKind::NotFound => {
                let found = format!("what may be a video, and no program `{program}` on this machine");
                Error::input(path, None, found, "ffmpeg with ffprobe (Debian: apt-get install ffmpeg)")
            }
            _ => Error::io(Path::new(program), "start", e),
        })
    }

    fn of(program: &'static str, mut command: Command, patience: Duration) -> io::Result<Self> {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn()?;
        let (out, mut errors) = (child.stdout.take().expect("piped"), child.stderr.take().expect("piped"));
        let (send, said) = channel();
        std::thread::spawn(move || {
            let (mut kept, mut part) = (Vec::new(), [0; 4096]);
            while let Ok(count @ 1..) = errors.read(&mut part) {
                if kept.len() < 1 << 16 {
                    kept.extend(&part[..count]);
                }
            }
            // Nobody waits any more where the program was stopped.
            let _ = send.send(String::from_utf8_lossy(&kept).into_owned());
        });
        Ok(Self { program, child, out, said, patience })
    }

    /// Waits for the end: whether it went well, and what was said. A program that has closed its stdout and goes on is
    /// stopped.
    pub(super) fn end(mut self) -> (bool, String) {
        let until = Instant::now() + self.patience.min(AT_THE_END);
        let mut ended = self.child.try_wait();
        while matches!(ended, Ok(None)) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
            ended = self.child.try_wait();
        }
        let well = ended.is_ok_and(|s| s.is_some_and(|s| s.success()));
        // What it started itself may hold its stderr open.
        let said = self.said.recv_timeout(until.saturating_duration_since(Instant::now()));
        (well, said.unwrap_or_default())
    }
}

impl Read for Running {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let patience = Timespec::try_from(self.patience).expect("minutes fit");
        let ready = loop {
            match poll(&mut [PollFd::new(&self.out, PollFlags::IN)], Some(&patience)) {
                Err(rustix::io::Errno::INTR) => {}
                other => break other?,
            }
        };
        if ready == 0 {
            let (program, s) = (self.program, self.patience.as_secs_f64());
            let said = format!("`{program}` wrote nothing for {s} s and was stopped");
            return Err(io::Error::new(ErrorKind::TimedOut, said));
        }
        self.out.read(into)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Where it has ended already nothing happens.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(line: &str) -> Running {
        let mut command = Command::new("sh");
        command.args(["-c", line]);
        Running::of("sh", command, Duration::from_millis(300)).unwrap()
    }

    #[test]
    fn a_program_that_never_ends_is_given_up() {
        let mut text = String::new();
        let mut running = shell("echo one; exec sleep 60");
        let error = running.read_to_string(&mut text).unwrap_err();
        assert_eq!((error.kind(), text.as_str()), (ErrorKind::TimedOut, "one\n"));
        assert!(error.to_string().contains("`sh` wrote nothing for 0.3 s"), "{error}");

        // It has closed its stdout, or another holds its stderr: what it wrote counts, and it went well or not.
        for (line, well) in [("echo one; exec sleep 60 >&-", false), ("echo one; sleep 60 >&- &", true)] {
            let (mut text, mut running) = (String::new(), shell(line));
            running.read_to_string(&mut text).unwrap();
            assert_eq!((text.as_str(), running.end()), ("one\n", (well, String::new())), "{line}");
        }

        // Control: one that writes and ends, slowly.
        let (mut text, mut running) =
            (String::new(), shell("for i in 1 2 3; do sleep 0.1; echo $i; done; echo no >&2"));
        running.read_to_string(&mut text).unwrap();
        assert_eq!((text.as_str(), running.end()), ("1\n2\n3\n", (true, "no\n".to_owned())));
    }
}
