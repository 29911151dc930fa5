//! A distance of the user's own between two folders of pictures (an FID, say), before and after: a command that is
//! given the folders and prints a number. It is split into words here and started without a shell: `$`, `*`, `|`, `;`
//! and the like are but letters, and a folder's name stays one argument whatever is in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::choose::Chosen;
use super::marked::Mark;
use super::simulated::Simulated;
use super::{Folder, radiance_of};
use crate::child::{heard, last_line, pid_of};
use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::expect::compared::bytes;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::pair::pictures;
use crate::diagnose::report::{Measure, Report};
use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug::plane::write_png_atomic;

/// What stands for the folders in the command: real frames, and those that they are compared with.
const PLACES: [&str; 2] = ["{a}", "{b}"];
/// Words that mean something to a shell alone.
const OF_A_SHELL: [&str; 9] = ["|", "||", "&", "&&", ";", "<", ">", ">>", "2>&1"];
/// Most pictures of a folder that are handed over.
const MOST_PICTURES: usize = 1000;
/// How often a command is looked after.
const LOOK: Duration = Duration::from_millis(20);
/// How long its last words are waited for when it has ended.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Most letters of what a command printed that an error repeats.
const MOST_LETTERS: usize = 160;

/// The command, split into words.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Own(Vec<String>);

/// The command, what it said at the beginning, and the folders.
pub(super) struct Begun {
    own: Own,
    folder: TempDir,
    /// Of the real frames from the simulated ones as they are, and from other real ones.
    before: f64,
    among_real: f64,
    /// What running it once takes.
    pub took: Duration,
    real: usize,
    simulated: usize,
}

/// What a run may take, and what stops it.
pub(super) struct Limits<'a> {
    pub budget: &'a Budget,
    pub stop: Option<&'a Arc<AtomicBool>>,
}

fn refused(found: String, expected: impl Into<String>) -> Error {
    Error::input(Path::new("--distance"), None, found, expected)
}

/// Of a command that was run.
fn failed(found: String, expected: impl Into<String>) -> Error {
    Error::input(Path::new("distance"), None, found, expected)
}

impl Own {
    /// Splits by blanks; quotes (single, double) and backslashes keep words together as in a shell, and nothing else
    /// is special.
    ///
    /// # Errors
    /// No word, a quote that is not closed, a place of a folder that is missing.
    pub(super) fn parse(text: &str) -> Result<Self> {
        let expected = "a command with {a} and {b} in the places of two folders, as \"fid {a} {b}\"";
        let Some(words) = shlex::split(text) else {
            return Err(refused(format!("`{text}`, in which a quote is not closed"), expected));
        };
        if words.is_empty() {
            return Err(refused("no command".to_owned(), expected));
        }
        if let Some(word) = words.iter().find(|w| OF_A_SHELL.contains(&w.as_str())) {
            let expected = "a program and its arguments: no shell is used, so pipes and redirections need a script, \
                or sh -c '...' with the folders as \"$1\" and \"$2\" behind it";
            return Err(refused(format!("`{word}` as a word of its own"), expected));
        }
        let is_there = |place: &str| words[1..].iter().any(|w| w.contains(place));
        match PLACES.into_iter().find(|p| !is_there(p)) {
            Some(place) => Err(refused(format!("`{text}`, without {place} behind its first word"), expected)),
            None => Ok(Self(words)),
        }
    }

    /// The command's first word.
    fn name(&self) -> &str {
        Path::new(&self.0[0]).file_name().and_then(|n| n.to_str()).unwrap_or(&self.0[0])
    }

    /// What the command says of two folders, and how long it took.
    ///
    /// # Errors
    /// A command that cannot be started, fails, prints no number, or takes longer than there is time.
    fn distance(&self, folders: [&Path; 2], limits: &Limits<'_>) -> Result<(f64, Duration)> {
        let word = |w: &String| {
            let places = PLACES.into_iter().zip(folders);
            places.fold(w.clone(), |w, (place, folder)| w.replace(place, &folder.to_string_lossy()))
        };
        let mut command = Command::new(&self.0[0]);
        command.args(self.0[1..].iter().map(word));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A group of its own, and a mark for what leaves it: what the command starts ends with it.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mark = Mark::new();
        command.env(&mark.0, "1");
        let begun = Instant::now();
        let mut child = command.spawn().map_err(|e| {
            let expected =
                "a program that can be started (no shell is used: pipes and variables need a script)";
            failed(format!("`{}`: {e}", self.0[0]), expected)
        })?;
        let streams = [heard(child.stdout.take()), heard(child.stderr.take())];
        let status = self.wait(&mut child, limits);
        end_group(&child);
        mark.end_all();
        // Not yet, where it was stopped.
        let _ = child.wait();
        let status = status?;
        let [said, complained] = streams.map(|s| s.recv_timeout(LAST_WORDS).unwrap_or_default());
        if !status.success() {
            let last = last_line(&complained).or_else(|| last_line(&said)).unwrap_or_default();
            let how = status.code().map_or_else(|| "a signal".to_owned(), |c| format!("exit code {c}"));
            let last = if last.is_empty() { "without a word".to_owned() } else { shortened(&last) };
            let found = format!("`{}` ended with {how}: {last}", self.name());
            return Err(failed(found, "a command that succeeds"));
        }
        let line = last_line(&said).unwrap_or_default();
        let number = number_in(&line).ok_or_else(|| {
            let found = format!("`{}` printed as its last line `{}`", self.name(), shortened(&line));
            failed(found, "a line with one number")
        })?;
        Ok((number, begun.elapsed()))
    }

    fn wait(&self, child: &mut Child, limits: &Limits<'_>) -> Result<std::process::ExitStatus> {
        loop {
            let status =
                child.try_wait().map_err(|e| failed(format!("`{}`: {e}", self.name()), "its end"))?;
            if let Some(status) = status {
                return Ok(status);
            }
            let stopped = limits.stop.is_some_and(|s| s.load(Ordering::Relaxed));
            if stopped {
                let at = format!("the distance by {}", self.name());
                return Err(Error::DiagnosisInterrupted { at, kept: None });
            }
            if limits.budget.left_s() <= 0.0 {
                let found = format!("`{}` was not done when the time limit came", self.name());
                return Err(failed(found, "a faster command, or a longer --time-limit-s"));
            }
            thread::sleep(LOOK);
        }
    }

    /// Writes the frames that were not used to fit, and measures what nothing was put on.
    ///
    /// # Errors
    /// Those of reading and writing, and of the command.
    pub(super) fn begin(
        self,
        (sim, sims): (&Path, &Folder),
        (real, reals): (&Path, &Folder),
        linear: bool,
        limits: &Limits<'_>,
    ) -> Result<Begun> {
        let folder = tempfile::tempdir().map_err(|e| Error::io(&std::env::temp_dir(), "make a folder", e))?;
        let (held, fit) = (unused(real, reals)?, reals.fit.iter().map(|i| reals.names[*i].clone()));
        copy(real, held.iter(), &folder.path().join("real"))?;
        copy(real, fit.collect::<Vec<_>>().iter(), &folder.path().join("real_fit"))?;
        let (real, simulated) = (held.len(), unused(sim, sims)?.len());
        let mut begun =
            Begun { own: self, folder, before: 0.0, among_real: 0.0, took: Duration::ZERO, real, simulated };
        begun.put((sim, sims), linear, "before", &Theta::neutral(), limits)?;
        (begun.before, begun.took) = begun.to("before", limits)?;
        (begun.among_real, _) = begun.to("real_fit", limits)?;
        Ok(begun)
    }
}

impl Begun {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Distance of the real frames from those of a folder.
    fn to(&self, name: &str, limits: &Limits<'_>) -> Result<(f64, Duration)> {
        self.own.distance([&self.path("real"), &self.path(name)], limits)
    }

    /// Writes the simulated frames that were not used to fit with effects on them.
    fn put(
        &self,
        (sim, sims): (&Path, &Folder),
        linear: bool,
        name: &str,
        theta: &Theta,
        limits: &Limits<'_>,
    ) -> Result<()> {
        let folder = self.path(name);
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "create the folder", e))?;
        for (i, name) in unused(sim, sims)?.iter().enumerate() {
            if limits.budget.left_s() <= 0.0 {
                let found = "the time limit, before the frames for it were written".to_owned();
                return Err(failed(found, "fewer frames, or a longer --time-limit-s"));
            }
            let frame = Simulated(vec![radiance_of(&sim.join(name), linear)?]);
            for made in frame.delivered_from(theta, SEED, i as u32) {
                write_png_atomic(&folder.join(format!("{i:06}.png")), &bytes(&made))?;
            }
        }
        Ok(())
    }

    /// Measures what the effects found were put on, and tells of both. What fails now does not cost the diagnosis: it
    /// is said.
    ///
    /// # Errors
    /// An interruption.
    pub(super) fn tell(
        &self,
        (sim, sims): (&Path, &Folder),
        linear: bool,
        chosen: &Chosen,
        limits: &Limits<'_>,
        report: &mut Report,
    ) -> Result<()> {
        let name = one_line(self.own.name());
        let after = if report.effects.is_empty() {
            Ok(self.before)
        } else {
            let put = self.put((sim, sims), linear, "after", &chosen.theta, limits);
            put.and_then(|()| self.to("after", limits)).map(|(after, _)| after)
        };
        let after = match after {
            Err(Error::DiagnosisInterrupted { at, kept }) => {
                return Err(Error::DiagnosisInterrupted { at, kept });
            }
            Err(e) => {
                report.warnings.push(format!(
                    "by {name} the real frames were {:.4} from the simulated ones; with what was found it was \
                    not measured: {e}",
                    self.before
                ));
                return Ok(());
            }
            Ok(after) => after,
        };
        let (before, among, real, simulated) = (self.before, self.among_real, self.real, self.simulated);
        report.sentence += &format!(
            " By {name}, the distance of {} that no fit has seen from {} is {before:.4} as they are, {after:.4} with \
             what was found, and {among:.4} from other real ones.",
            counted(real, "real frame", "real frames"),
            counted(simulated, "simulated one", "simulated ones")
        );
        report.measures.push(Measure {
            name: format!("distance by {name}"),
            unit: String::new(),
            before,
            after,
        });
        Ok(())
    }
}

/// Seed of the noise on simulated frames that are judged.
const SEED: u64 = 2;

/// Names of a folder's pictures that were not used to fit, at most so many, evenly.
fn unused(path: &Path, folder: &Folder) -> Result<Vec<String>> {
    let fit: Vec<&String> = folder.fit.iter().map(|i| &folder.names[*i]).collect();
    let all: Vec<String> = pictures(path)?.into_iter().filter(|n| !fit.contains(&n)).collect();
    let count = all.len().min(MOST_PICTURES);
    Ok((0..count).map(|i| all[i * all.len() / count].clone()).collect())
}

/// Copies pictures as they are.
fn copy<'a>(from: &Path, names: impl Iterator<Item = &'a String>, to: &Path) -> Result<()> {
    fs::create_dir_all(to).map_err(|e| Error::io(to, "create the folder", e))?;
    for name in names {
        let path = to.join(name);
        fs::copy(from.join(name), &path).map_err(|e| Error::io(&path, "write", e))?;
    }
    Ok(())
}

/// Ends a command and whatever it started that is still there.
fn end_group(child: &Child) {
    if let Some(group) = pid_of(child) {
        // Nothing may be left to end.
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
}

fn shortened(line: &str) -> String {
    line.chars().take(MOST_LETTERS).collect()
}

/// The one finite number of a line, between words that are none; `None` of none or several.
fn number_in(line: &str) -> Option<f64> {
    let words = line.split(|c: char| c.is_whitespace() || "=:,;()[]".contains(c));
    let is_number = |w: &&str| w.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let mut numbers = words.filter(is_number).filter_map(|w| w.parse::<f64>().ok());
    let first = numbers.next()?;
    (numbers.next().is_none() && first.is_finite()).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_split_as_a_shell_would_and_nothing_is_expanded() {
        let own = Own::parse("python3 'my fid.py' --x=\"$HOME; ls\" {a} --to={b}").expect("a command");
        assert_eq!(own.0, ["python3", "my fid.py", "--x=$HOME; ls", "{a}", "--to={b}"]);
        for (text, said) in [
            ("", "no command"),
            ("fid {a}", "without {b}"),
            ("{a} {b}", "without {a}"),
            ("fid '{a} {b}", "a quote is not closed"),
            ("echo 1 | cat {a} {b}", "`|` as a word of its own"),
        ] {
            let error = Own::parse(text).expect_err(text).to_string();
            assert!(error.contains("--distance") && error.contains(said), "{error}");
        }
    }

    #[test]
    fn a_line_has_one_number() {
        let read = ["12.5", "FID: 12.5", "fid = 1.25e1 (n)", " -3 "].map(number_in);
        assert_eq!(read, [Some(12.5), Some(12.5), Some(12.5), Some(-3.0)]);
        let none = ["", "done", "1 2", "nan", "inf", "FID: 1 +- 2", "mp4"].map(number_in);
        assert_eq!(none, [None; 7]);
    }

    #[test]
    fn what_a_command_does_wrong_is_said() {
        let (a, budget) = (Path::new("/tmp/x; y"), Budget::default());
        let of = |text: &str, budget: &Budget| {
            let limits = Limits { budget, stop: None };
            Own::parse(text).expect("a command").distance([a, a], &limits).map(|(v, _)| v)
        };
        // The folder's name is one argument and is not run.
        let echoed =
            of("sh -c 'test \"$1\" = \"/tmp/x; y\" && echo 4' _ {a} {b}", &budget).expect("a number");
        assert_eq!(echoed, 4.0);
        let said = |text: &str| of(text, &budget).expect_err(text).to_string();
        assert!(said("sh -c 'echo oh no >&2; exit 3' {a} {b}").contains("exit code 3: oh no"));
        assert!(said("sh -c 'exit 3' {a} {b}").contains("exit code 3: without a word"));
        assert!(said("sh -c 'echo 4; echo done' {a} {b}").contains("last line `done`"));
        assert!(said("/no/such/program {a} {b}").contains("/no/such/program"));
        let short = Budget::new(Instant::now(), Some(Duration::from_millis(300)));
        let begun = Instant::now();
        let late = of("sleep 30 {a} {b}", &short);
        // `sleep` may refuse the folders; it may not outlive the limit.
        assert!(late.is_err() && begun.elapsed() < Duration::from_secs(5));
        let late =
            of("sh -c 'sleep 30' {a} {b}", &Budget::new(Instant::now(), Some(Duration::from_millis(300))));
        assert!(late.expect_err("late").to_string().contains("the time limit"));
    }

    /// Whether a process is there and has not ended.
    fn lives(pid: &str) -> bool {
        let stat = fs::read_to_string(format!("/proc/{}/stat", pid.trim())).unwrap_or_default();
        stat.rsplit(')').next().is_some_and(|s| !s.is_empty() && !s.trim().starts_with('Z'))
    }

    #[test]
    fn what_a_command_started_ends_with_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let pid = folder.path().join("pid");
        // In time and late: the first command ends by itself and leaves a process behind. A session of its own is
        // another group, whose leader has no parent any more.
        let cases = [("echo 1", 10_000), ("sleep 30", 3_000)];
        for ((end, limit_ms), own) in cases.into_iter().flat_map(|c| [(c, ""), (c, "setsid ")]) {
            let _ = fs::remove_file(&pid);
            let text = format!(
                "sh -c '{own}sh -c \"echo \\$\\$ > {pid}; exec sleep 30\" >/dev/null 2>&1 & \
                 while ! test -s {pid}; do sleep 0.01; done; {end}' _ {{a}} {{b}}",
                pid = pid.display()
            );
            let budget = Budget::new(Instant::now(), Some(Duration::from_millis(limit_ms)));
            let limits = Limits { budget: &budget, stop: None };
            let said = Own::parse(&text).expect("a command").distance([Path::new("a"); 2], &limits);
            assert_eq!(said.is_ok(), end == "echo 1", "{end}");
            let pid = fs::read_to_string(&pid).expect("the process was started");
            let gone = (0..100).any(|_| {
                thread::sleep(LOOK);
                !lives(&pid)
            });
            assert!(gone, "{end}: {pid}");
        }
    }
}
