//! The one error type. Every variant carries what a person needs to mend the cause: where, what was found, what was
//! expected. `Display` is one line and needs no context to be understood.

mod counted;
mod nearest;

use std::fmt;
use std::path::{Path, PathBuf};

pub use counted::counted;
use nearest::nearest;

/// Result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A file holds something that cannot be used.
    Input {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1, where the format has lines.
        line: Option<usize>,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// A name that is not known, with the nearest one that is.
    UnknownName {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: Option<usize>,
        /// What the name should have named: "key", "effect", "parameter".
        kind: &'static str,
        /// The name as written.
        name: String,
        /// The nearest known name.
        nearest: Option<String>,
        /// All known names, where they are few.
        few: Box<[String]>,
    },
    /// A trajectory that does not cover the time that a frame needs. Times in seconds on the capture's clock.
    TrajectoryTooShort {
        /// The trajectory's file.
        path: PathBuf,
        /// Whose time is not covered: "frame 3 (000003.png)".
        what: String,
        /// Start of the needed span.
        needed_from_s: f64,
        /// End of the needed span.
        needed_to_s: f64,
        /// First pose.
        covered_from_s: f64,
        /// Last pose.
        covered_to_s: f64,
    },
    /// Something that a frame from outside shows comes in from beyond what it holds.
    MarginTooSmall {
        /// Columns and rows that are needed.
        needed_px: [u32; 2],
        /// Columns and rows that there are.
        given_px: [u32; 2],
    },
    /// The operating system refused a file operation.
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: "read", "write", "create the folder".
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A picture file that cannot be decoded or encoded.
    Picture {
        /// The file.
        path: PathBuf,
        /// "decode" or "encode".
        action: &'static str,
        /// The codec's reason.
        reason: String,
    },
    /// A parameter of an effect outside its range.
    Parameter {
        /// Stem of the effect.
        effect: &'static str,
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
        /// Unit of the three.
        unit: &'static str,
    },
    /// A parameter that counts something, with a fraction.
    NotWhole {
        /// Stem of the effect.
        effect: &'static str,
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// Choices that contradict each other.
    Contradiction {
        /// Stem of the effect.
        effect: &'static str,
        /// What does not go together.
        what: String,
    },
    /// A list of effects in an order that light cannot take.
    ChainOrder {
        /// Stem of the effect.
        effect: &'static str,
        /// What it needs.
        needs: String,
        /// What the picture is at its place.
        reached: String,
    },
    /// A lens that cannot be inverted inside the picture, and where.
    LensFolds(Box<LensFold>),
    /// Another error, with the place in a file that caused it.
    At {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: Option<usize>,
        /// What is wrong there.
        problem: Box<Error>,
        /// What the writer may have meant ("; is it in ms?"), or nothing.
        hint: String,
    },
    /// A size that this program or the device cannot handle.
    Limit {
        /// What is too large or too small.
        what: &'static str,
        /// Its value.
        value: u64,
        /// The limit.
        limit: u64,
        /// Whose limit it is.
        why: String,
    },
    /// No Vulkan loader on this machine.
    NoVulkanLoader {
        /// The system's reason.
        reason: String,
    },
    /// No usable device, or none that matches the request.
    NoDevice {
        /// What was asked for.
        wanted: String,
        /// What there is, and why it cannot be used.
        present: String,
    },
    /// The device lacks something that is needed.
    DeviceLacks {
        /// The device's name.
        device: String,
        /// Everything that is missing.
        missing: Vec<String>,
    },
    /// The device was lost during work.
    DeviceLost {
        /// The call that reported it.
        call: &'static str,
    },
    /// Memory ran out.
    OutOfMemory {
        /// "device" or "host".
        pool: &'static str,
        /// The call that reported it.
        call: &'static str,
    },
    /// Any other result of a Vulkan call.
    Vulkan {
        /// The call.
        call: &'static str,
        /// The result's name.
        result: String,
    },
    /// The system starts no more threads.
    Threads {
        /// The system's reason.
        reason: String,
    },
    /// The user asked to stop.
    Interrupted {
        /// Frames finished and on disk.
        done: usize,
        /// Frames wanted.
        total: usize,
    },
    /// The user asked to stop before there was anything to write.
    Stopped {
        /// Pictures looked at.
        done: usize,
        /// Pictures given.
        total: usize,
    },
    /// The user asked a run of cases to stop.
    CasesInterrupted {
        /// Cases finished and on disk.
        done: usize,
        /// Cases wanted.
        total: usize,
    },
    /// The user asked a diagnosis to stop.
    DiagnosisInterrupted {
        /// Stage and step.
        at: String,
        /// The file that holds what was worked out; nothing if it was kept nowhere.
        kept: Option<PathBuf>,
    },
    /// A time limit came before there was anything to say.
    OutOfTime {
        /// The limit, s.
        limit_s: f64,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input { path, line, found, expected } => {
                write!(f, "{}: found {found}; expected {expected}", place(path, *line))
            }
            Self::UnknownName { path, line, kind, name, nearest, few } => {
                let hint = suggestion(nearest.as_deref(), few);
                write!(f, "{}: unknown {kind} `{name}`{hint}", place(path, *line))
            }
            Self::TrajectoryTooShort { .. } | Self::MarginTooSmall { .. } => self.fmt_too_little(f),
            Self::Io { path, action, source } => write!(f, "{}: cannot {action}: {source}", path.display()),
            Self::Picture { path, action, reason } => {
                write!(f, "{}: cannot {action} the picture: {reason}", path.display())
            }
            Self::Parameter { effect, name, value, min, max, unit } => write!(
                f,
                "{effect}.{name} = {}{} is outside {min} to {max}{}",
                Quoted(*value),
                spaced(unit),
                spaced(unit)
            ),
            Self::NotWhole { effect, name, value } => {
                write!(f, "{effect}.{name} = {} is not a whole number", Quoted(*value))
            }
            Self::Contradiction { effect, what } => write!(f, "{effect}: {what}"),
            Self::ChainOrder { effect, needs, reached } => {
                write!(f, "{effect} acts on {needs}, but stands where the picture is {reached} already")
            }
            Self::LensFolds(fold) => write!(f, "{fold}"),
            Self::At { path, line, problem, hint } => write!(f, "{}: {problem}{hint}", place(path, *line)),
            Self::Limit { what, value, limit, why } => {
                write!(f, "{what} is {value}, the limit is {limit} ({why})")
            }
            Self::NoVulkanLoader { .. }
            | Self::NoDevice { .. }
            | Self::DeviceLacks { .. }
            | Self::DeviceLost { .. }
            | Self::OutOfMemory { .. }
            | Self::Vulkan { .. }
            | Self::Threads { .. } => self.fmt_machine(f),
            Self::Interrupted { done, total } => {
                write!(f, "interrupted after {done} of {total} frames; run again with --resume to go on")
            }
            Self::Stopped { done, total } => {
                write!(f, "interrupted after {done} of {total} pictures; nothing was written")
            }
            Self::CasesInterrupted { done, total } => {
                write!(f, "interrupted after {done} of {total} cases; run the same command again to go on")
            }
            Self::DiagnosisInterrupted { at, kept } => {
                write!(f, "interrupted at `{at}`; {}", kept_text(kept))
            }
            Self::OutOfTime { limit_s } => write!(
                f,
                "the time limit of {limit_s:.0} s came before the frames had been compared once; expected a longer \
                 --time-limit-s, or smaller frames"
            ),
        }
    }
}

impl Error {
    /// What was handed in ends too early.
    fn fmt_too_little(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TrajectoryTooShort {
                path,
                what,
                needed_from_s,
                needed_to_s,
                covered_from_s,
                covered_to_s,
            } => write!(
                f,
                "{}: {what} needs poses from {needed_from_s:.9} s to {needed_to_s:.9} s, but the trajectory covers \
                 only {covered_from_s:.9} s to {covered_to_s:.9} s: {} (times on the frames' clock; poses are \
                 never extrapolated)",
                path.display(),
                missing_span([*needed_from_s, *needed_to_s], [*covered_from_s, *covered_to_s])
            ),
            Self::MarginTooSmall { needed_px, given_px } => write!(
                f,
                "a margin of {} columns and {} rows on each side is too small: this frame needs {} and {}",
                given_px[0], given_px[1], needed_px[0], needed_px[1]
            ),
            _ => unreachable!("covers enough"),
        }
    }

    /// What the machine lacks or did.
    fn fmt_machine(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoVulkanLoader { reason } => write!(
                f,
                "no Vulkan loader: {reason}. Install it (Debian: apt-get install libvulkan1 mesa-vulkan-drivers)"
            ),
            Self::NoDevice { wanted, present } => write!(f, "no Vulkan device {wanted}. Present: {present}"),
            Self::DeviceLacks { device, missing } => {
                write!(f, "device {device} lacks {}", missing.join(", "))
            }
            Self::DeviceLost { call } => write!(
                f,
                "the Vulkan device was lost in {call}: the driver reset it or crashed; frames already written are \
                 complete"
            ),
            Self::OutOfMemory { pool, call } => write!(
                f,
                "out of {pool} memory in {call}: reduce the size, the samples per pixel or the frames in flight"
            ),
            Self::Vulkan { call, result } => write!(f, "{call} failed: {result}"),
            Self::Threads { reason } => write!(
                f,
                "no thread can be started ({reason}): allow more processes (ulimit -u) or free some"
            ),
            _ => unreachable!("no fault of the machine"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// At most 40 characters of what stands in a file: a number may be written with any count of digits.
pub(crate) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short += "...";
    }
    short
}

/// A number as a message quotes it, in the precision that is asked for: 1e300 written out has 301 digits.
#[derive(Clone, Copy, Debug)]
pub struct Quoted(pub f64);

impl fmt::Display for Quoted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if (1e-9..1e15).contains(&size) || size == 0.0 || !size.is_finite() {
            fmt::Display::fmt(&self.0, f)
        } else {
            fmt::LowerExp::fmt(&self.0, f)
        }
    }
}

/// A text as one line that steers no terminal: what comes from a file may hold line ends and escape sequences.
pub fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        // Also the marks that turn the direction of writing round, which hide what a line says.
        if c.is_control()
            || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
        {
            line.extend(c.escape_default());
        } else {
            line.push(c);
        }
    }
    line
}

fn kept_text(kept: &Option<PathBuf>) -> String {
    match kept {
        Some(path) => {
            format!("what was worked out is kept in {}: run the same command again to go on", path.display())
        }
        None => "nothing was kept".to_owned(),
    }
}

impl Error {
    /// Whether the command line itself asks for what cannot be, whatever the files hold: the "file" that is named is an
    /// option or an argument, as help writes it.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Input { path, .. } | Self::UnknownName { path, .. } => {
                let name = path.to_string_lossy();
                name.starts_with("--") || (name.starts_with('<') && name.ends_with('>'))
            }
            _ => false,
        }
    }

    /// Bad content at a line of a file.
    pub fn input(
        path: &Path,
        line: impl Into<Option<usize>>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Input {
            path: path.to_owned(),
            line: line.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// A name that is not among `known`; the nearest of them is suggested if it is near enough to have been meant.
    pub fn unknown_name<'a>(
        path: &Path,
        line: impl Into<Option<usize>>,
        kind: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        let known: Vec<&str> = known.into_iter().collect();
        let nearest = nearest(name, known.iter().copied()).map(str::to_owned);
        let listed = if known.len() <= FEW_NAMES { known } else { Vec::new() };
        let few = listed.into_iter().map(str::to_owned).collect();
        Self::UnknownName {
            path: path.to_owned(),
            line: line.into(),
            kind,
            name: name.to_owned(),
            nearest,
            few,
        }
    }

    /// A failed file operation.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }
}

fn place(path: &Path, line: Option<usize>) -> String {
    match line {
        Some(line) => format!("{}:{line}", path.display()),
        None => path.display().to_string(),
    }
}

fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// Most known names that a message lists.
const FEW_NAMES: usize = 8;

fn suggestion(nearest: Option<&str>, few: &[String]) -> String {
    match nearest {
        Some(nearest) => format!("; did you mean `{nearest}`?"),
        None if few.is_empty() => String::new(),
        None => format!("; expected one of {}", few.join(", ")),
    }
}

/// Says how much of `needed` lies before and after `covered`.
fn missing_span(needed: [f64; 2], covered: [f64; 2]) -> String {
    let before = (needed[0] < covered[0]).then(|| (needed[0], needed[1].min(covered[0])));
    let after = (needed[1] > covered[1]).then(|| (needed[0].max(covered[1]), needed[1]));
    let spans: Vec<_> =
        [before, after].into_iter().flatten().map(|(from, to)| format!("{from:.9} s to {to:.9} s")).collect();
    format!("missing {}", spans.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_line_steers_no_terminal_and_keeps_letters() {
        assert_eq!(one_line("a\nb\u{1b}[31m\u{7}\u{202e}x"), "a\\nb\\u{1b}[31m\\u{7}\\u{202e}x");
        assert_eq!(one_line("K\u{e4}fig \u{1f4f7}, 1 m"), "K\u{e4}fig \u{1f4f7}, 1 m");
    }

    #[test]
    fn missing_spans_name_both_ends() {
        assert_eq!(
            missing_span([0.0, 2.0], [0.5, 1.0]),
            "missing 0.000000000 s to 0.500000000 s and 1.000000000 s to 2.000000000 s"
        );
        assert_eq!(missing_span([3.0, 4.0], [0.5, 1.0]), "missing 3.000000000 s to 4.000000000 s");
        assert_eq!(missing_span([0.6, 1.1], [0.5, 1.0]), "missing 1.000000000 s to 1.100000000 s");
    }
}

/// Where a lens stops being invertible inside a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct LensFold {
    /// The pixel nearest to the principal point that no ray reaches: column, row.
    pub pixel: [i64; 2],
    /// Its distance from the principal point, px.
    pub radius_px: f64,
    /// The ideal radius at which the mapping turns back, normalised; infinite if it only tends to 90 degrees.
    pub ideal_radius: f64,
    /// The coefficients, by name.
    pub coefficients: String,
}

impl fmt::Display for LensFold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y] = self.pixel;
        write!(
            f,
            "the lens ({}) is not invertible inside the picture: no ray reaches pixel ({x}, {y}), {:.1} px from (cx, \
             cy), ",
            self.coefficients, self.radius_px
        )?;
        if self.ideal_radius.is_finite() {
            write!(
                f,
                "because the mapping turns back at {:.4} focal lengths from the axis",
                self.ideal_radius
            )
        } else {
            write!(f, "because it would lie 90 degrees or more from the axis, where no flat picture is")
        }
    }
}
