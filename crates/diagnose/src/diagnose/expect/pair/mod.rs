//! Frames of any simulator beside real ones (docs/pairs.md): two folders of pictures instead of a scene.
//!
//! The simulated frames are the scene. With depth and the camera's path, or with motion, they say what each line of a
//! sensor would have seen (see [`warp`]), so that effects of geometry are candidates as they are in a capture. Without
//! either, effects on values, noise and sharpness are; the rest is `undetermined`.

mod agree;
mod align;
mod beside;
mod field;
mod frames;
pub(crate) mod given;
mod grey;
mod guess;
mod kinds;
mod left_over;
mod matched;
mod outside;
mod planes;
mod sample;
mod sharpness;
mod stills;
mod track;
mod warp;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;

use super::forward::Forward;
use super::options::DiagnoseOptions;
use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::evidence::{Evidence, LEAST_SIDE_PX};
use crate::diagnose::report::Alignment;
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::capture::{CameraFile, Capture, FrameEntry};
use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug::plane::{Plane, read_rgb8, srgb_decode, srgb_encode};
use shutterbug::scene::Scene;

use align::residual_px;
pub(crate) use align::slopes_to;
pub(crate) use align::{Lies, lies};
use frames::SimFrame;
pub(crate) use frames::{Geometry, SimFrames};
pub(crate) use kinds::notes as notes_of_kind;
pub(crate) use left_over::{copies, of_other_formats};
pub use matched::Matched;
pub(crate) use matched::{one_a_name, pictures};
pub(crate) use outside::Outside;
pub(crate) use sample::{channel_at, depth_at};
pub(crate) use stills::{FEW, needs_more};

/// Frame period that is taken where nobody states one, s.
const ASSUMED_PERIOD_S: f64 = 1.0 / 30.0;

/// Least share of a frame that its mask may leave: less is no frame to judge a picture by.
const LEAST_OPEN: f64 = 0.1;
/// Frames that are looked at to see whether both folders show the same place.
const LOOKED_AT: usize = 6;

/// Nothing, as long as there is time and nobody asked to stop. Asked between steps that take a second at most: what is
/// read and measured before the first comparison may take hours.
pub(crate) type GoOn<'a> = &'a (dyn Fn() -> Result<()> + Sync);

/// What a diagnosis asks while it reads and aligns pairs.
fn going_on(options: &DiagnoseOptions) -> impl Fn() -> Result<()> + Sync + use<> {
    let budget = Budget::new(options.begun.unwrap_or_else(Instant::now), options.time_limit);
    let stop = options.stop.clone();
    move || match &stop {
        Some(stop) if stop.load(Ordering::SeqCst) => {
            Err(Error::DiagnosisInterrupted { at: "reading the pairs".to_owned(), kept: None })
        }
        _ => budget.go_on(),
    }
}

/// Two folders, matched frame by frame.
pub struct Pair {
    /// What stands for a capture: camera, path and times, without a scene.
    pub capture: Capture,
    /// Folder of the real frames.
    pub real: PathBuf,
    pub(crate) sim: Arc<SimFrames>,
    /// Whether there are so few frames that each is divided into parts.
    pub(crate) stills: bool,
    /// What a reader should know about how the frames were taken.
    pub(crate) notes: Vec<String>,
}

/// What a reader should know of the files of two folders.
fn notes_of(sim: &Path, real: &Path, matched: &[Matched]) -> Result<Vec<String>> {
    let mut notes = kinds::notes(sim, &matched[0].sim)?;
    notes.extend(kinds::notes(real, &matched[0].real)?);
    notes.extend(beside::notes(sim, real, matched)?);
    notes.extend(left_over::notes(sim, real, matched)?);
    let names: Vec<[&str; 2]> = matched.iter().map(|m| [&m.sim[..], &m.real[..]]).collect();
    notes.extend(left_over::copies(sim, real, &names)?);
    Ok(notes)
}

/// The simulated frames with their times, but for those that masks and clipping leave next to nothing of; all where
/// they leave nothing of any.
fn frames_of(
    sim: &Path,
    matched: &[Matched],
    camera: &CameraFile,
    notes: &mut Vec<String>,
    go_on: GoOn<'_>,
) -> Result<(Vec<Matched>, Vec<f64>, Vec<SimFrame>)> {
    let size = [camera.intrinsics.width, camera.intrinsics.height];
    let times_s = matched::times_s(sim, matched, camera.frame_period_s)?;
    let mut frames = Vec::new();
    for m in matched {
        go_on()?;
        frames.push(planes::read(sim, m, size, camera.linear)?);
    }
    let share =
        |f: &SimFrame| f.open.data.iter().filter(|v| **v > 0.5).count() as f64 / f.open.data.len() as f64;
    let shares: Vec<f64> = frames.iter().map(share).collect();
    let none = shares.iter().all(|share| *share < LEAST_OPEN);
    let kept: Vec<bool> = shares.iter().map(|share| none || *share >= LEAST_OPEN).collect();
    for i in (0..kept.len()).filter(|&i| !kept[i]) {
        notes.push(format!(
            "{}: its mask, and what is clipped, leave {:.0} % of it: the frame is left out",
            one_line(&matched[i].sim),
            100.0 * shares[i]
        ));
    }
    fn of<T>(all: Vec<T>, kept: &[bool]) -> Vec<T> {
        all.into_iter().zip(kept).filter(|(_, kept)| **kept).map(|(one, _)| one).collect()
    }
    Ok((of(matched.to_vec(), &kept), of(times_s, &kept), of(frames, &kept)))
}

impl Pair {
    /// Reads and matches the frames of two folders. `matches` is a file with lines `sim,real`; `camera` replaces the
    /// sim folder's `camera.toml`. Of `options` the time limit counts, and whether to stop.
    ///
    /// # Errors
    /// Folders that are empty, names that do not match, pictures of different sizes or a few px high, planes of another
    /// size, files that cannot be read; with the file and what was expected. [`Error::OutOfTime`].
    pub fn read(
        sim: &Path,
        real: &Path,
        matches: Option<&Path>,
        camera: Option<&Path>,
        options: &DiagnoseOptions,
    ) -> Result<Self> {
        let go_on = going_on(options);
        let matched = matched::matched(sim, real, matches)?;
        let size = size_of(&sim.join(&matched[0].sim))?;
        let mut notes = notes_of(sim, real, &matched)?;
        let camera = Self::camera_of(sim, camera, size, &mut notes)?;
        let period_s = camera.frame_period_s;
        notes.extend(matched::doubt_of_period(sim, real, period_s)?);
        let (matched, times_s, frames) = frames_of(sim, &matched, &camera, &mut notes, &go_on)?;
        let mut sim_frames =
            SimFrames { frames, times_s, period_s, geometry: Geometry::None, linear: camera.linear };
        let path = sim_frames.find_geometry(sim, &camera.intrinsics, &mut notes, &go_on)?;
        notes.extend(agree::notes(sim, &sim_frames, &camera.intrinsics, path.as_ref(), &go_on)?);
        if sim_frames.geometry == Geometry::None && stills::parts(matched.len()) == 1 {
            let real_of = |i: usize| read_rgb8(&real.join(&matched[i].real));
            notes.extend(guess::motion(&mut sim_frames, &real_of, &go_on)?);
        }
        let parts = stills::parts(matched.len());
        if parts > 1 {
            let count = counted(matched.len(), "picture", "pictures");
            notes.push(format!(
                "{count}: each is divided into {parts} parts, some to fit and others to judge by"
            ));
            sim_frames.divide(parts);
        }
        let geometry = sim_frames.geometry;
        sim_frames.frames.par_iter_mut().for_each(|f| f.jumps = frames::Jumps::of(f, geometry));
        let entry = |(m, &start_s): (&Matched, &f64)| FrameEntry {
            timestamp_ns: (start_s * 1e9).round() as i64,
            start_s,
            filename: m.real.clone(),
        };
        let taken = matched.iter().flat_map(|m| std::iter::repeat_n(m, parts));
        let frames = taken.zip(&sim_frames.times_s).map(entry).collect();
        let capture = Capture {
            root: sim.to_owned(),
            camera,
            scene: Scene::default(),
            trajectory: path.unwrap_or_else(|| Trajectory::fixed(Pose::IDENTITY)),
            frames,
            epoch_ns: 0,
        };
        Ok(Self { capture, real: real.to_owned(), sim: Arc::new(sim_frames), stills: parts > 1, notes })
    }

    /// Whether real and simulated frames show the same place, so that they can be compared as pairs. Depth or motion
    /// beside the simulated frames says that they are meant to.
    ///
    /// # Errors
    /// Real frames that cannot be read. [`Error::OutOfTime`].
    pub(crate) fn shows_one_place(&self, options: &DiagnoseOptions) -> Result<bool> {
        let go_on = going_on(options);
        if self.sim.geometry != Geometry::None {
            return Ok(true);
        }
        let count = self.sim.frames.len();
        let some: Vec<usize> = (0..count.min(LOOKED_AT)).map(|k| k * count / count.min(LOOKED_AT)).collect();
        let mut alike = 0;
        for &i in &some {
            let picture = read_rgb8(&self.real.join(&self.capture.frames[i].filename))?;
            let radiance = &self.sim.frames[i].radiance;
            if [picture.width, picture.height] != [radiance.width, radiance.height] {
                // Pairs have one size: that is said where they are compared.
                return Ok(true);
            }
            alike += usize::from(lies(&picture.to_f32(), &encoded(radiance), &go_on)?.rms_px.is_some());
        }
        Ok(2 * alike >= some.len())
    }

    /// The camera of the simulator; a guess without a file, which is enough for effects on values.
    pub(crate) fn camera_of(
        sim: &Path,
        given: Option<&Path>,
        [width, height]: [u32; 2],
        notes: &mut Vec<String>,
    ) -> Result<CameraFile> {
        let path = given.map_or_else(|| sim.join("camera.toml"), Path::to_owned);
        if given.is_some() || path.exists() {
            let mut camera = CameraFile::read(&path)?;
            let k = &camera.intrinsics;
            if [k.width, k.height] != [width, height] {
                let found = format!("a camera of {}x{} px", k.width, k.height);
                return Err(Error::input(
                    &path,
                    None,
                    found,
                    format!("{width}x{height} px, as the frames beside it have"),
                ));
            }
            if camera.settings.iter().next().is_some() {
                notes.push(format!(
                    "the simulated frames are taken to show the effects of {} already: what is found comes on top of \
                     them",
                    path.display()
                ));
            }
            camera.static_camera = false;
            return Ok(camera);
        }
        notes.push(format!(
            "{} is not there: a field of view of 53 degrees about the middle and {:.0} frames a second are taken; \
             give a camera.toml for readout times in s and for lenses",
            path.display(),
            1.0 / ASSUMED_PERIOD_S
        ));
        let (w, h) = (f64::from(width), f64::from(height));
        let intrinsics = Intrinsics { width, height, fx: w, fy: w, cx: 0.5 * w, cy: 0.5 * h };
        Ok(CameraFile::pinhole(path, intrinsics, ASSUMED_PERIOD_S))
    }
}

impl SimFrames {
    /// Finds out what the planes tell of geometry; the camera's path where they do.
    fn find_geometry(
        &mut self,
        sim: &Path,
        k: &Intrinsics,
        notes: &mut Vec<String>,
        go_on: GoOn<'_>,
    ) -> Result<Option<Trajectory>> {
        let depth = self.frames.iter().all(|f| f.depth.is_some());
        let motion = self.frames.iter().any(|f| f.motion[0].is_some());
        let path = sim.join("trajectory.tum");
        if depth && path.exists() {
            let trajectory = planes::trajectory(&path)?;
            let (first_s, last_s) = (self.times_s[0], self.times_s[self.times_s.len() - 1]);
            trajectory.require(first_s, last_s, "the simulated frames")?;
            self.geometry = Geometry::Depth;
            return Ok(Some(trajectory));
        }
        if motion {
            self.add_backward_motion(go_on)?;
        }
        if depth && motion {
            if let Some(tracked) = track::track(self, k, go_on)? {
                notes.push(format!(
                    "the camera's path was worked out from depth and motion (it leaves {:.2} px): give \
                     trajectory.tum for what it does between frames",
                    tracked.left_px
                ));
                self.geometry = Geometry::Depth;
                return Ok(Some(tracked.path));
            }
            notes.push(
                "depth and motion do not agree on a path of the camera: motion alone is used".to_owned(),
            );
        }
        if motion {
            self.geometry = Geometry::Motion;
        } else if depth {
            notes.push(
                "depth without poses or motion says nothing of time: give trajectory.tum or motion/"
                    .to_owned(),
            );
        }
        Ok(None)
    }

    /// Each frame so many times, with another part of it open.
    fn divide(&mut self, parts: usize) {
        let times = self.times_s.iter().flat_map(|t| std::iter::repeat_n(*t, parts)).collect();
        self.times_s = times;
        let frames = std::mem::take(&mut self.frames);
        self.frames = frames.into_iter().flat_map(|f| stills::divided(f, parts)).collect();
    }

    /// Where content was one period before, from where that of the frame before went.
    fn add_backward_motion(&mut self, go_on: GoOn<'_>) -> Result<()> {
        for i in 1..self.frames.len() {
            go_on()?;
            if !self.follows(i) {
                continue;
            }
            let Some(forward) = self.frames[i - 1].motion[0].clone() else { continue };
            self.frames[i].motion[1] = Some(sample::backward(&forward));
        }
        Ok(())
    }

    /// Of all pictures and planes.
    pub(crate) fn sha256(&self) -> String {
        let mut bytes: Vec<u8> = Vec::new();
        for f in &self.frames {
            let planes = [Some(&*f.radiance), f.depth.as_ref(), f.motion[0].as_ref(), Some(&f.open)];
            let all: Vec<u8> =
                planes.into_iter().flatten().flat_map(|p| bytemuck::cast_slice(&p.data).to_vec()).collect();
            bytes.extend(crate::out::sha256_hex(&all).into_bytes());
        }
        crate::out::sha256_hex(&bytes)
    }

    /// Whether a frame comes one period behind the one before it.
    pub(crate) fn follows(&self, i: usize) -> bool {
        let step_s = self.times_s[i] - self.times_s[i - 1];
        (step_s / self.period_s - 1.0).abs() < 0.5
    }
}

/// Columns and rows of the simulated frames, px, by the first of them.
fn size_of(first: &Path) -> Result<[u32; 2]> {
    let size = planes::size_of(first)?;
    if size.iter().min() < Some(&LEAST_SIDE_PX) {
        let found = format!("a picture of {}x{} px", size[0], size[1]);
        let expected = format!("at least {LEAST_SIDE_PX} px a side, or nothing can be told apart");
        return Err(Error::input(first, None, found, expected));
    }
    Ok(size)
}

/// Values of linear radiance, DN.
pub(crate) fn encoded(plane: &Plane<f32>) -> Plane<f32> {
    Plane { data: plane.data.iter().map(|v| 255.0 * srgb_encode(*v)).collect(), ..*plane }
}

/// Root mean square; there are some.
fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Linear radiance of a picture.
pub(crate) fn linear_of(path: &Path, linear: bool) -> Result<Plane<f32>> {
    let picture = read_rgb8(path)?;
    let decode = |v: &u8| if linear { f32::from(*v) / 255.0 } else { srgb_decode(f32::from(*v) / 255.0) };
    let data = picture.data.iter().map(decode).collect();
    Ok(Plane { width: picture.width, height: picture.height, channels: 3, data })
}

/// How real and simulated frames were found to lie on each other.
pub(crate) struct Aligned {
    /// What was measured before anything was compared, px.
    before_px: Option<f64>,
    /// Whether simulated frames were warped.
    warped: bool,
    /// How frames come about.
    pub method: &'static str,
}

impl Aligned {
    pub(crate) fn is_rough(&self) -> bool {
        self.warped
    }

    /// For the report: of frames that were warped what was measured before, else what is left of the places in the end.
    pub(crate) fn of(&self, frames: &[super::compared::Shown]) -> Alignment {
        let (kind, rms_px) = match (self.warped, self.before_px) {
            (_, None) => ("none", None),
            (true, before) => ("rough", before),
            (false, _) => {
                let left: Vec<f64> = frames.iter().filter_map(|f| residual_px(&f.real, &f.after)).collect();
                let rms_px = (!left.is_empty()).then(|| rms(&left));
                (if rms_px.is_none_or(|r| r < align::EXACT_PX) { "exact" } else { "rough" }, rms_px)
            }
        };
        Alignment { kind: kind.to_owned(), rms_px }
    }
}

/// Measures how the frames lie on each other. Where the simulator says nothing of geometry and they do not lie on each
/// other, each simulated frame is warped to its real one, and what does not fit then is closed.
pub(crate) fn align(forward: &mut Forward, evidence: &Evidence) -> Result<Aligned> {
    let outside = forward.outside.clone().expect("a pair has simulated frames");
    let method = match outside.sim.geometry {
        Geometry::Depth => "given frames, depth and poses",
        Geometry::Motion => "given frames and motion",
        Geometry::None => "given frames",
    };
    let go_on = || {
        forward.journal.lock().unwrap_or_else(|e| e.into_inner()).go_on()?;
        forward.budget.go_on()
    };
    let mut all: Vec<Lies> = Vec::new();
    for at in 0..evidence.frames.len() {
        // Parts of a still lie as it does.
        let pictures = |at: usize| (&evidence.frames[at].dn, &outside.frame(at).radiance);
        let (real, sim) = pictures(at);
        let before = all.last().filter(|_| {
            let (other, sim_other) = pictures(at - 1);
            Arc::ptr_eq(real, other) && Arc::ptr_eq(sim, sim_other)
        });
        let one = match before {
            Some(lies) => lies.clone(),
            None => lies(real, &encoded(sim), &go_on)?,
        };
        all.push(one);
    }
    let seen: Vec<f64> = all.iter().filter_map(|l| l.rms_px).collect();
    let before_px = (2 * seen.len() > all.len()).then(|| rms(&seen));
    let warped = outside.sim.geometry == Geometry::None && before_px.is_some_and(|px| px > align::EXACT_PX);
    tracing::info!("alignment before: {before_px:.3?} px, warped: {warped}");
    if warped {
        let mut aligned = Outside::new(&outside.sim, evidence);
        for (at, lies) in all.into_iter().enumerate() {
            tracing::info!("frame {at}: {:.3?} px, behind the warp {:.3?}", lies.rms_px, lies.left_px);
            let open = &mut forward.sharp[at].coverage.data;
            open.iter_mut().zip(&lies.alike.data).for_each(|(o, a)| *o *= a);
            aligned.left_px[at] = lies.left_px.unwrap_or(0.0) as f32;
            aligned.shift[at] = Some(lies.shift);
        }
        forward.outside = Some(Arc::new(aligned));
    }
    Ok(Aligned { before_px, warped, method })
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::plane::write_png_atomic;

    #[test]
    fn a_frame_that_its_mask_covers_is_left_out_and_keeps_its_time() {
        let sim = tempfile::tempdir().unwrap();
        std::fs::create_dir(sim.path().join("mask")).unwrap();
        let save = |name: &str, rows: usize| {
            let picture = Plane::from_fn(32, 24, |_, y| [if y < rows { 180u8 } else { 0 }; 3]);
            write_png_atomic(&sim.path().join(name), &picture).unwrap();
        };
        let matched: Vec<Matched> = (0..4)
            .map(|i| {
                let name = format!("{i}.png");
                save(&name, 24);
                save(&format!("mask/{name}"), [24, 2, 12, 24][i]);
                Matched { sim: name.clone(), real: name }
            })
            .collect();
        let k = Intrinsics { width: 32, height: 24, fx: 32.0, fy: 32.0, cx: 16.0, cy: 12.0 };
        let camera = CameraFile::pinhole(sim.path().to_owned(), k, 0.1);
        let mut notes = Vec::new();
        let (names, times_s, frames) =
            frames_of(sim.path(), &matched, &camera, &mut notes, &|| Ok(())).unwrap();
        assert_eq!((names.len(), frames.len()), (3, 3));
        assert!(times_s.iter().zip([0.0, 0.2, 0.3]).all(|(a, b)| (a - b).abs() < 1e-9), "{times_s:?}");
        assert!(notes.len() == 1 && notes[0].contains("1.png: its mask"), "{notes:?}");
        (0..4).for_each(|i| save(&format!("mask/{i}.png"), 0));
        // What nothing can be said of is said later, by its cause.
        let all = frames_of(sim.path(), &matched, &camera, &mut notes, &|| Ok(())).unwrap();
        assert_eq!((all.0.len(), notes.len()), (4, 1));
    }
}
