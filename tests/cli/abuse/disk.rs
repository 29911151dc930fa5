//! What is on the disk when a run is killed, the power goes or the disk is full: at every change that a run makes
//! there.
//!
//! `tests/c/disk.c` stands between the program and the system. It writes down every change in order; the disk as it is
//! after a part of them is made from that here, as often as is wanted, and so is the disk that a power cut leaves: of
//! each file what was synchronised and some of the rest, of each folder the first so many of its unsynchronised names.

use std::collections::{BTreeMap, HashMap};
use std::sync::OnceLock;

use shutterbug_diagnose::out::sha256_hex;

use super::mutations::Dice;
use super::*;

/// The library that is loaded before the system's, or nothing where there is no compiler.
fn shim(test: &str) -> Option<&'static Path> {
    static BUILT: OnceLock<Option<PathBuf>> = OnceLock::new();
    let built = BUILT.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/c/disk.c");
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join("disk.so");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&library).arg(source);
        let made = cc.args(["-ldl", "-lpthread"]).output().ok()?;
        assert!(made.status.success(), "{}", said(&made));
        Some(library)
    });
    if built.is_none() {
        eprintln!("SKIPPED {test}: no C compiler");
    }
    built.as_deref()
}

/// A command whose changes below `root` are looked at; `how`: variables of `disk.c`.
fn watched(mut command: Command, shim: &Path, root: &Path, how: &[(&str, String)]) -> Output {
    command.env("LD_PRELOAD", shim).env("DISK_ROOT", root).envs(how.iter().map(|(k, v)| (k, v)));
    command.output().unwrap()
}

/// A change on the disk.
#[derive(Clone, Debug)]
enum Op {
    Open(u32, String),
    Write(u32, usize, Vec<u8>),
    Cut(u32, usize),
    Sync(u32),
    SyncNames(String),
    Rename(String, String),
    Link(String, String),
    Remove(String),
    RemoveFolder(String),
}

/// The log of `disk.c`; names are below `root`.
fn log(path: &Path, root: &Path) -> Vec<Op> {
    let bytes = fs::read(path).unwrap();
    let (mut at, mut ops) = (0, Vec::new());
    let name = |bytes: &[u8]| {
        let path = PathBuf::from(String::from_utf8(bytes.to_vec()).unwrap());
        path.strip_prefix(root).unwrap().to_str().unwrap().to_owned()
    };
    while at < bytes.len() {
        let word = |from: usize| u32::from_le_bytes(bytes[at + from..at + from + 4].try_into().unwrap());
        let (file, offset) = (word(1), word(5) as usize);
        let (middle, end) = (at + 21 + word(13) as usize, at + 21 + (word(13) + word(17)) as usize);
        let (a, b) = (&bytes[at + 21..middle], &bytes[middle..end]);
        match bytes[at] {
            b'O' => ops.push(Op::Open(file, name(a))),
            b'W' => ops.push(Op::Write(file, offset, a.to_vec())),
            b'T' => ops.push(Op::Cut(file, offset)),
            b'S' => ops.push(Op::Sync(file)),
            b'D' => ops.push(Op::SyncNames(name(a))),
            b'R' => ops.push(Op::Rename(name(a), name(b))),
            b'L' => ops.push(Op::Link(name(a), name(b))),
            b'U' => ops.push(Op::Remove(name(a))),
            b'X' => ops.push(Op::RemoveFolder(name(a))),
            // Folders are made as their files are.
            b'M' => {}
            other => panic!("record `{}`", char::from(other)),
        }
        at = end;
    }
    ops
}

/// What a file holds, and what of it is sure to be there after a power cut.
#[derive(Clone, Default)]
struct Content {
    now: Vec<u8>,
    sure: Vec<u8>,
}

fn contents_of(ops: &[Op]) -> HashMap<u32, Content> {
    let mut files: HashMap<u32, Content> = HashMap::new();
    for op in ops {
        match op {
            Op::Open(file, _) => files.entry(*file).or_default().now.clear(),
            Op::Write(file, at, bytes) => {
                let now = &mut files.entry(*file).or_default().now;
                now.resize(now.len().max(at + bytes.len()), 0);
                now[*at..at + bytes.len()].copy_from_slice(bytes);
            }
            Op::Cut(file, length) => files.entry(*file).or_default().now.resize(*length, 0),
            Op::Sync(file) => {
                let content = files.entry(*file).or_default();
                content.sure.clone_from(&content.now);
            }
            _ => {}
        }
    }
    files
}

fn folder_of(name: &str) -> &str {
    name.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// Which file stands under each name, if of each folder only the first changes are there: all that were synchronised,
/// and of the rest as many as `more` says of so many. What was in a folder that has gone is gone.
fn names_of(ops: &[Op], mut more: impl FnMut(usize) -> usize) -> BTreeMap<String, u32> {
    let mut by_folder: BTreeMap<&str, (usize, Vec<usize>)> = BTreeMap::new();
    for (at, op) in ops.iter().enumerate() {
        match op {
            Op::Open(_, name)
            | Op::Rename(_, name)
            | Op::Link(_, name)
            | Op::Remove(name)
            | Op::RemoveFolder(name) => {
                by_folder.entry(folder_of(name)).or_default().1.push(at);
            }
            Op::SyncNames(folder) => {
                let known = by_folder.entry(folder).or_default();
                known.0 = known.1.len();
            }
            _ => {}
        }
    }
    let (mut names, mut gone) = (BTreeMap::new(), HashMap::new());
    // A folder comes before those in it.
    for (folder, (sure, changes)) in by_folder {
        let kept = sure + more(changes.len() - sure);
        let begins = gone.get(folder).copied().unwrap_or(0);
        for &at in changes[..kept].iter().filter(|at| **at >= begins) {
            match &ops[at] {
                Op::Open(file, name) => drop(names.insert(name.clone(), *file)),
                Op::Rename(from, to) => {
                    let file = names.remove(from).expect("renamed where it was made");
                    names.insert(to.clone(), file);
                }
                Op::Link(from, to) => drop(names.insert(to.clone(), names[from])),
                Op::Remove(name) => drop(names.remove(name)),
                Op::RemoveFolder(name) => drop(gone.insert(name.as_str(), at)),
                _ => {}
            }
        }
    }
    names
}

/// The files of a disk by name.
type Files = BTreeMap<String, Vec<u8>>;

/// What is there after these changes if the system lives on.
fn killed(ops: &[Op]) -> Files {
    let files = contents_of(ops);
    names_of(ops, |rest| rest).into_iter().map(|(name, file)| (name, files[&file].now.clone())).collect()
}

/// What may be there after these changes and a power cut.
fn without_power(ops: &[Op], dice: &mut Dice) -> Files {
    let files = contents_of(ops);
    let names = names_of(ops, |rest| dice.roll(rest + 1));
    let mut there = |file: &u32| {
        let content = &files[file];
        // What was written since may be there in part, or as zeros, or not at all.
        match (dice.roll(4), content.now.strip_prefix(content.sure.as_slice())) {
            (0, _) | (_, None) => content.sure.clone(),
            (1, Some(rest)) => [content.sure.as_slice(), &vec![0; rest.len()]].concat(),
            (_, Some(rest)) => [content.sure.as_slice(), &rest[..dice.roll(rest.len() + 1)]].concat(),
        }
    };
    names.into_iter().map(|(name, file)| (name, there(&file))).collect()
}

/// What the manifest names must be whole or not there, and what is there must be named.
fn judged(files: &Files) -> Result<(), String> {
    let manifest = files.get("manifest.jsonl").cloned().unwrap_or_default();
    let mut lines: HashMap<String, Vec<(u64, String)>> = HashMap::new();
    for line in String::from_utf8_lossy(&manifest).lines() {
        let Ok(line) = serde_json::from_str::<serde_json::Value>(line) else { continue };
        if let (Some(name), Some(bytes), Some(sha256)) =
            (line["name"].as_str(), line["bytes"].as_u64(), line["sha256"].as_str())
        {
            lines.entry(name.to_owned()).or_default().push((bytes, sha256.to_owned()));
        }
    }
    for (name, bytes) in files {
        let own = name == "manifest.jsonl" || name.rsplit('/').next().unwrap().starts_with(".shutterbug");
        if own {
            continue;
        }
        let Some(lines) = lines.get(name) else { return Err(format!("{name}: in no line of the manifest")) };
        if !lines.contains(&(bytes.len() as u64, sha256_hex(bytes))) {
            return Err(format!("{name}: {} bytes that no line names", bytes.len()));
        }
    }
    Ok(())
}

fn files_of(folder: &Path) -> Files {
    let below = |path: PathBuf| path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
    contents(folder).into_iter().map(|(path, bytes)| (below(path), bytes)).collect()
}

/// Files whose bytes do not depend on when they were made.
fn results(files: &Files) -> Files {
    let kept = |name: &String| name.ends_with(".png") || name.ends_with(".exr");
    files.iter().filter(|(name, _)| kept(name)).map(|(n, b)| (n.clone(), b.clone())).collect()
}

/// A capture, its whole results, and the changes that a run over an earlier, longer one makes.
struct Trial {
    capture: Capture,
    shim: &'static Path,
    whole: Files,
    ops: Vec<Op>,
    /// How many of them the first run made.
    first: usize,
}

const PLANES: [&str; 2] = ["--planes", "depth"];

impl Trial {
    fn new(test: &str) -> Option<Self> {
        let shim = shim(test)?;
        if !device_is_there(test) {
            return None;
        }
        let capture = Capture::new();
        let out = capture.beside("watched");
        let log_file = capture.beside("log");
        let how = [("DISK_LOG", log_file.to_str().unwrap().to_owned())];
        // Twice, so that the second removes what the first has made.
        let runs = [0, 1].map(|_| {
            assert_done(&watched(capture.command(&out, &PLANES), shim, &out, &how));
            log(&log_file, &out)
        });
        let [first, ops] = runs;
        let whole = results(&files_of(&out));
        assert!(whole.len() == 8 && ops.len() > 60, "{} files, {} changes", whole.len(), ops.len());
        Some(Self { capture, shim, whole, ops, first: first.len() })
    }

    /// Goes on from a disk in this state, and comes to the same end.
    fn goes_on(&self, out: &Path, what: &str) {
        let more: Vec<&str> = PLANES.into_iter().chain(["--resume"]).collect();
        let done = self.capture.simulate(out, &more);
        assert_eq!(done.status.code(), Some(0), "{what}: {}", said(&done));
        let files = files_of(out);
        assert_eq!(judged(&files), Ok(()), "{what}");
        assert!(results(&files) == self.whole, "{what}: other results");
    }
}

fn put(folder: &Path, files: &Files) {
    let _ = fs::remove_dir_all(folder);
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// Power cut and kill -9 after every single change, in a model; some of the disks are gone on from.
#[test]
fn what_the_manifest_names_is_whole_after_every_change() {
    let Some(trial) = Trial::new("what_the_manifest_names_is_whole_after_every_change") else { return };
    let (ops, mut dice) = (&trial.ops, Dice(7));
    for end in 0..=ops.len() {
        judged(&killed(&ops[..end])).unwrap_or_else(|e| panic!("killed after change {end}: {e}"));
        for cut in 0..8 {
            let left = without_power(&ops[..end], &mut dice);
            judged(&left).unwrap_or_else(|e| panic!("power cut {cut} after change {end}: {e}"));
        }
    }
    let out = trial.capture.beside("cut");
    for part in 1..5 {
        let end = part * ops.len() / 5;
        put(&out, &without_power(&ops[..end], &mut dice));
        trial.goes_on(&out, &format!("power cut after change {end} of {}", ops.len()));
    }
    controls(ops);
}

/// A writer that synchronises nothing, one that synchronises no names, and one that writes under the final name are
/// found out.
fn controls(ops: &[Op]) {
    let mut dice = Dice(8);
    let mut fails = |ops: &[Op]| {
        (0..ops.len()).any(|end| (0..8).any(|_| judged(&without_power(&ops[..end], &mut dice)).is_err()))
    };
    let keep = |kept: fn(&Op) -> bool| ops.iter().filter(|op| kept(op)).cloned().collect::<Vec<_>>();
    assert!(fails(&keep(|op| !matches!(op, Op::Sync(_)))), "files that are not synchronised");
    assert!(fails(&keep(|op| !matches!(op, Op::SyncNames(_)))), "names that are not synchronised");
    let finals: HashMap<&String, &String> = ops
        .iter()
        .filter_map(|op| match op {
            Op::Rename(from, to) | Op::Link(from, to) => Some((from, to)),
            _ => None,
        })
        .collect();
    let in_place: Vec<Op> = ops
        .iter()
        .filter(|op| !matches!(op, Op::Rename(..) | Op::Link(..)))
        .map(|op| match op {
            Op::Open(file, name) => Op::Open(*file, finals.get(name).map_or(name, |n| *n).clone()),
            other => other.clone(),
        })
        .collect();
    let fails = (0..in_place.len()).any(|end| judged(&killed(&in_place[..end])).is_err());
    assert!(fails, "files that are written under their final name");
}

/// The program itself, killed before one of its changes, and gone on with.
fn killed_at(trial: &Trial, moments: impl Iterator<Item = usize>) {
    let out = trial.capture.beside("killed");
    for at in moments {
        let _ = fs::remove_dir_all(&out);
        let how = [("DISK_KILL_AT", at.to_string())];
        let ended = watched(trial.capture.command(&out, &PLANES), trial.shim, &out, &how);
        assert_eq!(ended.status.code(), None, "killed before change {at}: {}", said(&ended));
        assert_eq!(judged(&files_of(&out)), Ok(()), "killed before change {at}");
        trial.goes_on(&out, &format!("killed before change {at}"));
    }
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_same_end() {
    let Some(trial) = Trial::new("a_run_that_is_killed_goes_on_to_the_same_end") else { return };
    killed_at(&trial, [3, 20, 40, 50].into_iter());
}

#[test]
#[ignore = "long: a minute or two"]
fn a_hundred_kills_lose_nothing() {
    let Some(trial) = Trial::new("a_hundred_kills_lose_nothing") else { return };
    let mut dice = Dice(22);
    killed_at(&trial, (0..100).map(|_| 1 + dice.roll(trial.first)));
}

/// The disk is full from the n-th call that needs room on, or at that one alone.
fn full_at(trial: &Trial, moments: impl Iterator<Item = usize>) {
    let out = trial.capture.beside("full");
    for (at, once) in moments.flat_map(|at| [(at, false), (at, true)]) {
        let _ = fs::remove_dir_all(&out);
        let mut how = vec![("DISK_FULL_AT", at.to_string())];
        how.extend(once.then(|| ("DISK_FULL_ONCE", "1".to_owned())));
        let ended = watched(trial.capture.command(&out, &PLANES), trial.shim, &out, &how);
        let what = format!("full at call {at}, once: {once}");
        assert!(matches!(ended.status.code(), Some(0 | 1)), "{what}: {}", said(&ended));
        if ended.status.code() == Some(1) {
            assert!(said(&ended).contains("o space left"), "{what}: {}", said(&ended));
        }
        assert!(once || ended.status.code() == Some(1), "{what}: said nothing");
        assert_eq!(judged(&files_of(&out)), Ok(()), "{what}");
        trial.goes_on(&out, &what);
    }
}

#[test]
fn a_full_disk_is_an_error_and_loses_nothing() {
    let Some(trial) = Trial::new("a_full_disk_is_an_error_and_loses_nothing") else { return };
    full_at(&trial, [1, 4, 30].into_iter());
}

#[test]
#[ignore = "long: some minutes"]
fn a_disk_that_is_full_at_any_write_loses_nothing() {
    let Some(trial) = Trial::new("a_disk_that_is_full_at_any_write_loses_nothing") else { return };
    let needs_room = |op: &&Op| !matches!(op, Op::Cut(..) | Op::Remove(_) | Op::RemoveFolder(_));
    full_at(&trial, 1..=trial.ops[..trial.first].iter().filter(needs_room).count());
}

/// A single file that the user named: the earlier one or the new one, whatever happens.
#[test]
fn a_single_file_is_the_earlier_one_or_the_new_one() {
    let Some(shim) = shim("a_single_file_is_the_earlier_one_or_the_new_one") else { return };
    let capture = Capture::new();
    let (out, log_file) = (capture.beside("single"), capture.beside("log"));
    fs::create_dir(&out).unwrap();
    let file = out.join("camera.yaml");
    let convert = |to: &str, how: &[(&str, String)]| {
        let mut command = shutterbug();
        command
            .args(["camera", "convert", "--overwrite", "--to", to])
            .arg(capture.root().join("camera.toml"));
        command.arg("--out").arg(&file);
        watched(command, shim, &out, how)
    };
    assert_done(&convert("ros", &[]));
    let before = fs::read(&file).unwrap();
    assert_done(&convert("kalibr", &[("DISK_LOG", log_file.to_str().unwrap().to_owned())]));
    let (after, ops) = (fs::read(&file).unwrap(), log(&log_file, &out));
    assert_ne!(before, after);
    let mut dice = Dice(9);
    let mut fails = |ops: &[Op]| {
        let mut left = (0..=ops.len()).flat_map(|end| (0..20).map(move |_| end));
        left.any(|end| {
            let left = without_power(&ops[..end], &mut dice);
            left.get("camera.yaml").is_some_and(|bytes| *bytes != after)
        })
    };
    assert!(!fails(&ops), "a power cut leaves a part of a file");
    let unsafe_ops: Vec<Op> = ops.iter().filter(|op| !matches!(op, Op::Sync(_))).cloned().collect();
    assert!(fails(&unsafe_ops), "control: without synchronising");
    for at in 1..=ops.len() {
        fs::write(&file, &before).unwrap();
        let ended = convert("kalibr", &[("DISK_FULL_AT", at.to_string())]);
        let now = fs::read(&file).unwrap();
        let code = ended.status.code();
        assert!(
            (code == Some(1) && now == before) || (code == Some(0) && now == after),
            "full at {at}: exit {code:?}, {} bytes: {}",
            now.len(),
            said(&ended)
        );
        assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "full at {at}: leftovers");
    }
}
