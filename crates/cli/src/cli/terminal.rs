//! Output to the user. Messages go to stderr; a closed stderr is ignored. Results that the user asked for go to stdout;
//! if they cannot be written, that is an error, unless the reader has closed the pipe.

use std::fmt;
use std::io::{self, ErrorKind, IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::Mutex;

use tracing::{Metadata, Subscriber};
use tracing_subscriber::Layer as _;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::layer::{Context, Filter, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt as _;

use shutterbug::error::{Error, Result, counted, one_line};

/// Warnings of one kind that are written out; further ones are counted.
const WARNINGS_OF_A_KIND: usize = 10;

/// A message, one line on stderr. What comes from the input in it cannot steer a terminal.
pub fn say(message: impl fmt::Display) {
    // Nobody reads it, or the disk is full: the work goes on.
    let _ = writeln!(io::stderr().lock(), "{}", one_line(&message.to_string()));
}

/// A result, to stdout.
///
/// # Errors
/// A full disk. A reader that has gone is none.
pub fn print(text: impl fmt::Display) -> Result<()> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(Path::new("standard output"), "write", e)),
    }
}

/// Warnings go to stderr; `RUST_LOG` asks for more or less. Colours are for terminals alone, and not where `NO_COLOR`
/// is set.
pub fn start_log() {
    let asked = std::env::var("RUST_LOG").ok().and_then(|levels| levels.parse::<Targets>().ok());
    let filter = asked.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
    let color = io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(Stderr)
        .with_ansi(color)
        .log_internal_errors(false)
        .without_time()
        .with_target(false)
        .with_filter(filter)
        .with_filter(Counted);
    // A second logger in one process is a caller's choice and no reason to stop.
    let _ = tracing_subscriber::registry().with(lines).try_init();
}

/// Says how many warnings were only counted.
pub fn end_log() {
    let left_out: usize = counts().iter().map(|(_, n)| n.saturating_sub(WARNINGS_OF_A_KIND)).sum();
    if left_out > 0 {
        say(format_args!(
            "{} like these, {WARNINGS_OF_A_KIND} of each kind are shown",
            counted(left_out, "more warning", "more warnings")
        ));
    }
}

/// How often each place in the program has warned.
static COUNTS: Mutex<Vec<(tracing::callsite::Identifier, usize)>> = Mutex::new(Vec::new());

fn counts() -> std::sync::MutexGuard<'static, Vec<(tracing::callsite::Identifier, usize)>> {
    COUNTS.lock().unwrap_or_else(|e| e.into_inner())
}

/// Lets the first warnings of each kind through. A hostile file can cause one a word.
struct Counted;

impl<S: Subscriber + for<'a> LookupSpan<'a>> Filter<S> for Counted {
    fn enabled(&self, about: &Metadata<'_>, _: &Context<'_, S>) -> bool {
        // What nobody has asked for is not shown, and must not be counted as if it were.
        if !about.is_event() || *about.level() > tracing::Level::WARN {
            return true;
        }
        let mut counts = counts();
        let place = about.callsite();
        let at = counts.iter().position(|(p, _)| *p == place).unwrap_or_else(|| {
            counts.push((place, 0));
            counts.len() - 1
        });
        counts[at].1 += 1;
        counts[at].1 <= WARNINGS_OF_A_KIND
    }
}

/// A line of the log whose message steers no terminal. The log's own colours are escape sequences; it has escaped those
/// of messages itself, but neither line ends nor what moves the cursor back.
fn steerless(line: &[u8]) -> Vec<u8> {
    let body = line.strip_suffix(b"\n").unwrap_or(line);
    let mut out = Vec::with_capacity(line.len());
    for &byte in body {
        if (byte < b' ' && byte != 0x1b) || byte == 0x7f {
            out.extend(byte.escape_ascii());
        } else {
            out.push(byte);
        }
    }
    out.extend(&line[body.len()..]);
    out
}

/// Stderr for the log: a line cannot fail.
struct Stderr;

impl<'a> MakeWriter<'a> for Stderr {
    type Writer = Self;

    fn make_writer(&'a self) -> Self {
        Self
    }
}

impl io::Write for Stderr {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().lock().write_all(&steerless(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::steerless;

    #[test]
    fn a_message_moves_no_cursor_and_keeps_its_letters() {
        assert_eq!(
            steerless(b"\x1b[33m WARN\x1b[0m a\x08\r\x07\n\x7fb\n"),
            b"\x1b[33m WARN\x1b[0m a\\x08\\r\\x07\\n\\x7fb\n"
        );
        assert_eq!(steerless("Käfig".as_bytes()), "Käfig".as_bytes());
    }
}
