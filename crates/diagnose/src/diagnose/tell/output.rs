//! A diagnosis as files: `report.json`, `camera.toml`, and pictures of every frame.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::entries::Parts;
use super::places::{measures, places};
use super::task::FramePercepts;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::budget::{Budgeted, Stage, in_time};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::compared::{Compared, Shown, bytes};
use crate::diagnose::expect::model::P;
use crate::diagnose::judge::Scores;
use crate::diagnose::report::{FrameEntry, FramePictures, Maps, Report, Verdict};
use crate::diagnose::search::Search;
use crate::diagnose::search::found::{Found, PICTURES};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::error::{Error, Result};
use shutterbug::plane::{Plane, write_atomic, write_png_atomic};

/// Frames (places) before and after: pictures and scores.
struct Both {
    frames: Vec<usize>,
    pictures: [Vec<Arc<Plane<f32>>>; 2],
    scores: [Scores; 2],
}

/// Simulates and scores all frames, or those of the report where there is no time for more.
fn both(search: &mut Search<'_>, found: &mut Found, evidence: &Evidence) -> Result<Both> {
    let quality = found.quality;
    let points = [search.base.clone(), found.fit.theta.clone()];
    let frames: Vec<usize> = (0..evidence.frames.len()).collect();
    let seen = if search.forward.budget.affords(frames.len(), quality) {
        let [before, after] = search.within(Stage::End, |search| {
            points.each_ref().map(|t| in_time(search.judge.seen_on(search.forward, t, &frames)))
        });
        before?.zip(after?)
    } else {
        None
    };
    if let Some(((worse, before), (better, after))) = seen {
        return Ok(Both { frames, pictures: [before, after], scores: [worse, better] });
    }
    // These have been scored, and rendered, for the report.
    found.leave_out(PICTURES);
    let frames = evidence.report.clone();
    let [before, after] = points.each_ref().map(|t| search.forward.pictures(&frames, t, quality));
    let (before, mut after) = (before?, after?);
    if found.fit.theta.get(P::Hot) > 0.0 {
        after.iter_mut().for_each(|m| search.judge.hot.put(Arc::make_mut(m)));
    }
    Ok(Both { frames, pictures: [before, after], scores: [found.before.clone(), found.after.clone()] })
}

/// Simulates all frames of the evidence before and after, and says where they differ.
pub(crate) fn show(
    search: &mut Search<'_>,
    found: &mut Found,
    evidence: &Evidence,
    report: &mut Report,
) -> Result<Vec<Shown>> {
    // As `simulate` does it, if there was time for that.
    let quality = found.quality;
    (search.judge.quality, search.forward.native) = (quality, quality == Quality::Fine);
    search.forward.ends_search();
    let Both { frames: all, pictures: [before, after], scores } = both(search, found, evidence)?;
    let held: Vec<Compared<'_>> = all
        .iter()
        .enumerate()
        .filter(|(_, at)| evidence.report.contains(at))
        .map(|(i, &at)| Compared {
            index: evidence.frames[at].index,
            real: &evidence.frames[at].dn,
            before: &before[i],
            after: &after[i],
            mask: search.judge.masks.map(|m| &m[at]),
            sharp: &search.forward.sharp[at],
        })
        .collect();
    report.places = places(&held, search.forward, evidence, report.verdict == Verdict::NoGap);
    report.measures = measures(&held);
    let pictures = before.into_iter().zip(after).enumerate();
    let shown = all.iter().zip(pictures).map(|(&at, (i, (before, after)))| Shown {
        index: evidence.frames[at].index,
        start_s: evidence.frames[at].start_s,
        held_out: evidence.report.contains(&at),
        scores: scores.each_ref().map(|s| s.0[i].score),
        real: evidence.frames[at].dn.clone(),
        before,
        after,
    });
    Ok(shown.collect())
}

/// What encoding a picture as it is written takes.
pub(crate) fn time_of_writing(picture: &Plane<f32>) -> Duration {
    let (clock, plane) = (Instant::now(), bytes(picture));
    let encoder = image::codecs::png::PngEncoder::new(std::io::sink());
    let [w, h] = [plane.width as u32, plane.height as u32];
    // What cannot be encoded comes up where it is written.
    let _ = image::ImageEncoder::write_image(encoder, &plane.data, w, h, image::ExtendedColorType::Rgb8);
    clock.elapsed()
}

/// A finished diagnosis.
pub struct Diagnosis {
    /// What was found.
    pub report: Report,
    /// The given camera with the effects found.
    pub camera: CameraFile,
    /// What [`Diagnosis::write`] makes pictures of.
    pub(crate) frames: Vec<Shown>,
    /// What the description should be.
    pub(crate) description: Parts,
    /// By frame.
    pub(crate) percepts: Vec<FramePercepts>,
}

impl Diagnosis {
    /// Writes `camera.toml`, the pictures and, last, `report.json` into a folder; returns the report with the pictures'
    /// paths.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(mut self, folder: &Path, capture: &Capture) -> Result<Report> {
        make_folders(folder, ["real", "simulated", "diagnosed", "difference_before", "difference_after"])?;
        write_atomic(&folder.join("camera.toml"), self.camera.to_toml().as_bytes())?;
        self.description.write(folder, capture)?;
        self.report.description = self.description.draw(folder, &self.frames)?;
        let scale_dn = scale(&self.frames);
        self.report.frames = self
            .frames
            .par_iter()
            .map(|f| write_frame(folder, f, capture, scale_dn))
            .collect::<Result<_>>()?;
        self.report.maps = write_maps(folder, &self.frames, scale_dn)?;
        super::task::write(folder, &self.frames, &self.percepts)?;
        self.report.write(folder)?;
        Ok(self.report)
    }
}

/// Full white of the difference pictures: what 97 % of the differences before stay below, at least 8 DN. (More, and a
/// gap at edges leaves all else black.)
fn scale(frames: &[Shown]) -> f64 {
    let mut all: Vec<f32> = frames
        .iter()
        .flat_map(|f| f.real.data.iter().zip(&f.before.data).step_by(17).map(|(r, s)| (r - s).abs()))
        .collect();
    if all.is_empty() {
        return 8.0;
    }
    f64::from(percentile(&mut all, 97)).max(8.0).ceil()
}

fn percentile(values: &mut [f32], percent: usize) -> f32 {
    let at = values.len() * percent / 100;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// Makes the folders of a report's pictures.
pub(crate) fn make_folders(folder: &Path, kinds: [&str; 5]) -> Result<()> {
    for kind in kinds {
        let path = folder.join(kind);
        fs::create_dir_all(&path).map_err(|e| Error::io(&path, "create the folder", e))?;
    }
    Ok(())
}

/// Writes five pictures of a frame, DN, to `KIND/NNNNNN.png` each; returns where they are, for the report.
pub(crate) fn write_five(
    folder: &Path,
    kinds: [&str; 5],
    index: usize,
    pictures: &[Plane<f32>; 5],
) -> Result<FramePictures> {
    let names = kinds.map(|kind| format!("{kind}/{index:06}.png"));
    for (name, picture) in names.iter().zip(pictures) {
        write_png_atomic(&folder.join(name), &bytes(picture))?;
    }
    let [real, simulated, diagnosed, difference_before, difference_after] = names;
    Ok(FramePictures { real, simulated, diagnosed, difference_before, difference_after })
}

fn difference(real: &Plane<f32>, other: &Plane<f32>, scale_dn: f64) -> Plane<u8> {
    let factor = (255.0 / scale_dn) as f32;
    let data = real.data.iter().zip(&other.data).map(|(r, s)| ((r - s).abs() * factor).min(255.0) as u8);
    Plane { width: real.width, height: real.height, channels: 3, data: data.collect() }
}

fn write_frame(folder: &Path, f: &Shown, capture: &Capture, scale_dn: f64) -> Result<FrameEntry> {
    let name = |kind: &str| format!("{kind}/{:06}.png", f.index);
    let pictures = FramePictures {
        real: name("real"),
        simulated: name("simulated"),
        diagnosed: name("diagnosed"),
        difference_before: name("difference_before"),
        difference_after: name("difference_after"),
    };
    write_png_atomic(&folder.join(&pictures.real), &bytes(&f.real))?;
    write_png_atomic(&folder.join(&pictures.simulated), &bytes(&f.before))?;
    write_png_atomic(&folder.join(&pictures.diagnosed), &bytes(&f.after))?;
    let to = folder.join(&pictures.difference_before);
    write_png_atomic(&to, &difference(&f.real, &f.before, scale_dn))?;
    let to = folder.join(&pictures.difference_after);
    write_png_atomic(&to, &difference(&f.real, &f.after, scale_dn))?;
    Ok(FrameEntry {
        index: f.index,
        filename: capture.frames[f.index].filename.clone(),
        time_s: f.start_s,
        held_out: f.held_out,
        before: f.scores[0],
        after: f.scores[1],
        pictures,
    })
}

/// Mean maps over the held-out frames.
fn write_maps(folder: &Path, frames: &[Shown], scale_dn: f64) -> Result<Maps> {
    let held: Vec<&Shown> = frames.iter().filter(|f| f.held_out).collect();
    let Some(first) = held.first() else { return Ok(Maps::default()) };
    let (w, h) = (first.real.width, first.real.height);
    let mut sums = [[0.0f32; 4].to_vec(), Vec::new(), Vec::new(), Vec::new()];
    sums.iter_mut().for_each(|s| *s = vec![0.0f32; w * h * 3]);
    for f in &held {
        for i in 0..w * h * 3 {
            let (b, a) = (f.real.data[i] - f.before.data[i], f.real.data[i] - f.after.data[i]);
            sums[0][i] += b.abs();
            sums[1][i] += a.abs();
            sums[2][i] += b;
            sums[3][i] += a;
        }
    }
    // Both pairs on one scale of their own: means are smaller than what single frames differ by.
    let mut means: Vec<f32> = sums[0].iter().map(|v| v / held.len() as f32).collect();
    let mean_scale_dn = f64::from(percentile(&mut means, 98)).max(4.0).ceil();
    let factor = 255.0 / mean_scale_dn as f32 / held.len() as f32;
    let names = ["map_before.png", "map_after.png", "bias_before.png", "bias_after.png"];
    for (i, (sum, name)) in sums.iter().zip(names).enumerate() {
        let shade = |v: f32| if i < 2 { v * factor } else { 128.0 + 0.5 * v * factor };
        let data = sum.iter().map(|&v| shade(v).clamp(0.0, 255.0) as u8).collect();
        write_png_atomic(&folder.join(name), &Plane { width: w, height: h, channels: 3, data })?;
    }
    let [before, after, bias_before, bias_after] = names.map(str::to_owned);
    Ok(Maps { scale_dn, mean_scale_dn, before, after, bias_before, bias_after })
}
