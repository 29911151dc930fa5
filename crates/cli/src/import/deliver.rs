//! Writes an import to disk: the pictures one by one, each completely or not at all, then the tables that name them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::Damage;
use super::messages::picture;
use super::pixels::{PictureFile, file_of};
use super::prepared::{Pictures, Prepared};
use super::wire::Fault;
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, read, write_atomic};
use shutterbug_diagnose::out::{Out, make_folder};

/// Pictures that are worked on at a time, and bytes of them.
const BATCH: usize = 32;
const BATCH_BYTES: usize = 256 << 20;

/// Called with frames done and wanted; an error stops the work.
pub type Watch<'a> = dyn FnMut(usize, usize) -> Result<()> + 'a;

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Delivered {
    /// Frames that are in `frames.csv`.
    pub frames: usize,
    /// Further files, by name.
    pub files: Vec<&'static str>,
    /// Pictures that could not be made, and why the first could not.
    pub left_out: Option<Damage>,
    /// What a reader should know of the pictures' sizes.
    pub note: Option<String>,
    /// What became apparent only while the pictures were read.
    pub broken: Option<Damage>,
}

/// Makes a picture's file.
type Make<'a> = Box<dyn FnOnce() -> std::result::Result<PictureFile, Fault> + Send + 'a>;

/// Names that files got, and work in hand.
struct Writer<'w, 'a> {
    folder: PathBuf,
    fixed: Option<&'a [String]>,
    names: Vec<Option<String>>,
    done: usize,
    batch: Vec<(usize, Make<'a>)>,
    batch_bytes: usize,
    faults: Vec<(usize, Fault)>,
    sizes: Sizes,
    watch: &'w mut Watch<'a>,
}

/// Writes all files below `folder`, pictures into its folder `pictures` (empty: beside the tables). What `out` has as
/// it was made is kept if the run goes on.
///
/// # Errors
/// Files that cannot be written; a recording that cannot be read; no picture at all; what `watch` returns.
pub fn deliver(
    prepared: &Prepared,
    (folder, pictures): (&Path, &str),
    (out, goes_on): (&Out, bool),
    watch: &mut Watch<'_>,
) -> Result<Delivered> {
    let count = prepared.times_ns.len();
    let mut names = vec![None; count];
    if goes_on {
        kept(prepared, pictures, out, &mut names);
    }
    let place = if pictures.is_empty() { folder.to_owned() } else { folder.join(pictures) };
    if !matches!(prepared.pictures, Pictures::Missing) {
        make_folder(&place)?;
    }
    let done = names.iter().flatten().count();
    let fixed = prepared.names.as_deref();
    let (batch, faults, sizes) = (Vec::new(), Vec::new(), Sizes::default());
    let mut writer =
        Writer { folder: place, fixed, names, done, batch, batch_bytes: 0, faults, sizes, watch };
    let broken = writer.pictures(prepared)?;
    let (names, faults) = (writer.names, writer.faults);
    let note = writer.sizes.note(prepared)?;
    Ok(Delivered { note, ..finish(prepared, folder, names, faults, broken)? })
}

/// Frames that an earlier run has finished.
fn kept(prepared: &Prepared, pictures: &str, out: &Out, names: &mut [Option<String>]) {
    for (frame, name) in names.iter_mut().enumerate() {
        let candidates = match &prepared.names {
            Some(fixed) => vec![fixed[frame].clone()],
            None => ["png", "jpg"].iter().map(|e| format!("{frame:06}.{e}")).collect(),
        };
        let below = |n: &String| if pictures.is_empty() { n.clone() } else { format!("{pictures}/{n}") };
        *name = candidates.into_iter().find(|n| out.has(&below(n)));
    }
}

/// The tables, last: a folder with `frames.csv` is whole.
fn finish(
    prepared: &Prepared,
    folder: &Path,
    mut names: Vec<Option<String>>,
    faults: Vec<(usize, Fault)>,
    broken: Option<Damage>,
) -> Result<Delivered> {
    if matches!(prepared.pictures, Pictures::Missing) {
        names = prepared.names.iter().flatten().cloned().map(Some).collect();
    }
    let motion = prepared.motion(&names);
    let left_out = faults.first().map(|(frame, fault)| {
        let (count, time_ns) = (faults.len(), prepared.times_ns[*frame]);
        let all = prepared.times_ns.len();
        let found = format!(
            "{count} of {} that cannot be used, the first, of {time_ns} ns, with {}",
            counted(all, "picture", "pictures"),
            fault.found
        );
        (found, fault.expected.clone())
    });
    if motion.frames.is_empty() {
        let none = || ("no picture".to_owned(), "at least one frame".to_owned());
        let (found, expected) = left_out.unwrap_or_else(none);
        return Err(Error::input(&prepared.path, None, found, expected));
    }
    let left_out =
        left_out.map(|(found, expected)| (format!("{found}; what is whole was imported"), expected));
    let mut files = Vec::new();
    let mut texts: Vec<(&'static str, String)> = prepared.texts.clone();
    if !prepared.poses.is_empty() {
        texts.push(("trajectory.tum", motion.trajectory_tum()));
    }
    texts.push(("frames.csv", motion.frames_csv()));
    for (name, text) in texts {
        write_atomic(&folder.join(name), text.as_bytes())?;
        files.push(name);
    }
    Ok(Delivered { frames: motion.frames.len(), files, left_out, note: None, broken })
}

impl<'a> Writer<'_, 'a> {
    fn pictures(&mut self, prepared: &'a Prepared) -> Result<Option<Damage>> {
        let mut broken = None;
        match &prepared.pictures {
            Pictures::Log { log, topic, frame_of } => {
                let mut number = 0;
                log.each(&mut |_| Ok(()), &mut |topics, message| {
                    if message.topic != *topic {
                        return Ok(());
                    }
                    let frame = frame_of.get(number).copied().flatten();
                    number += 1;
                    let Some(frame) = self.wanted(frame) else { return Ok(()) };
                    let (topic, data) = (topics[*topic].clone(), message.data.to_vec());
                    let bytes = data.len();
                    self.add(frame, bytes, Box::new(move || file_of(&picture(&topic, &data)?.body)))
                })?;
            }
            Pictures::Files(paths) => {
                for (frame, path) in paths.iter().enumerate() {
                    if self.wanted(Some(frame)).is_some() {
                        self.add(frame, 0, Box::new(move || copied(path)))?;
                    }
                }
            }
            Pictures::Video { video, frame_of } => {
                broken = video.each(&mut |number, size, values| {
                    let Some(frame) = self.wanted(frame_of.get(number).copied().flatten()) else {
                        return Ok(());
                    };
                    let bytes = values.len();
                    self.add(frame, bytes, Box::new(move || super::video::png_of(size, &values)))
                })?;
            }
            Pictures::Missing => {}
        }
        self.flush()?;
        Ok(broken)
    }

    /// The frame, if it is one and is not there yet.
    fn wanted(&self, frame: Option<usize>) -> Option<usize> {
        frame.filter(|f| self.names.get(*f).is_some_and(Option::is_none))
    }

    fn add(&mut self, frame: usize, bytes: usize, make: Make<'a>) -> Result<()> {
        self.batch.push((frame, make));
        self.batch_bytes += bytes;
        if self.batch.len() >= BATCH || self.batch_bytes >= BATCH_BYTES { self.flush() } else { Ok(()) }
    }

    /// Makes and writes what is in hand, at once.
    fn flush(&mut self) -> Result<()> {
        let batch = std::mem::take(&mut self.batch);
        self.batch_bytes = 0;
        let (folder, fixed) = (&self.folder, self.fixed);
        let made: Vec<(usize, Result<Made>)> = batch
            .into_par_iter()
            .map(|(frame, make)| (frame, written(folder, fixed.map(|f| f[frame].as_str()), frame, make)))
            .collect();
        for (frame, result) in made {
            match result? {
                Ok((name, size)) => {
                    self.sizes.add(size, &name);
                    self.names[frame] = Some(name);
                    self.done += 1;
                }
                Err(fault) => self.faults.push((frame, fault)),
            }
        }
        (self.watch)(self.done, self.names.len())
    }
}

/// Columns and rows of pictures, px, with how many have them and the first of these.
#[derive(Default)]
struct Sizes(BTreeMap<[u32; 2], (usize, String)>);

impl Sizes {
    fn add(&mut self, size: [u32; 2], name: &str) {
        self.0.entry(size).or_insert_with(|| (0, name.to_owned())).0 += 1;
    }

    /// What there is to say where sizes differ: from the camera's, else from most others'.
    ///
    /// # Errors
    /// No picture has the camera's size.
    fn note(&self, prepared: &Prepared) -> Result<Option<String>> {
        let most = self.0.iter().max_by_key(|(_, (count, _))| *count).map(|(size, _)| *size);
        let Some(usual) = prepared.camera_px.or(most) else { return Ok(None) };
        let others = || self.0.iter().filter(|(size, _)| **size != usual);
        let Some((size, (_, name))) = others().max_by_key(|(_, (count, _))| *count) else { return Ok(None) };
        let count: usize = others().map(|(_, (count, _))| count).sum();
        let all: usize = self.0.values().map(|(count, _)| count).sum();
        let found = format!("{count} of {all} pictures of another size ({name}: {}x{} px)", size[0], size[1]);
        let whose = if prepared.camera_px.is_some() { "the camera has" } else { "most have" };
        let expected = format!("{}x{} px, as {whose}", usual[0], usual[1]);
        if count == all && !self.0.is_empty() {
            return Err(Error::input(&prepared.path, None, found, expected));
        }
        Ok(Some(format!("found {found}; expected {expected}")))
    }
}

/// A picture's name and size, or what is wrong with it.
type Made = std::result::Result<(String, [u32; 2]), Fault>;

fn written(folder: &Path, fixed: Option<&str>, frame: usize, make: Make<'_>) -> Result<Made> {
    let file = match make() {
        Ok(file) => file,
        Err(fault) => return Ok(Err(fault)),
    };
    let name = fixed.map_or_else(|| format!("{frame:06}.{}", file.ending), str::to_owned);
    write_atomic(&folder.join(&name), &file.bytes)?;
    Ok(Ok((name, file.size)))
}

/// A picture's file as it is, looked at once.
fn copied(path: &Path) -> std::result::Result<PictureFile, Fault> {
    let fault = |e: Error| Fault::new(e.to_string(), "a whole JPEG or PNG");
    let bytes = read(path, Limit::PICTURE).map_err(fault)?;
    let picture = shutterbug::plane::decode_picture(path, &bytes).map_err(fault)?;
    Ok(PictureFile { ending: "", bytes, size: [picture.width(), picture.height()] })
}
