//! Percepts of the real, the simulated and the corrected frames, and how far they agree.

use std::path::Path;

use rayon::prelude::*;
use serde_json::json;

use super::percepts::{Agreement, PictureOf, compare, find, tolerance_px};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::compared::{Shown, bytes};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::report::{PerceptGap, Percepts};
use shutterbug::chain::{Settings, View};
use shutterbug::effects;
use shutterbug::error::Result;
use shutterbug::plane::{Plane, write_atomic};
use shutterbug::reference::chain;

/// Name of the file with all percepts, in the folder of the report.
pub(crate) const PERCEPTS_FILE: &str = "percepts.json";
/// Kinds, in the order of [`compare`].
const KINDS: [&str; 3] = ["corners", "lines", "blobs"];

/// Percepts of one frame: real, simulated, with the effects found; and how the latter two agree with the first.
pub(crate) struct FramePercepts {
    pub found: [PictureOf; 3],
    pub agrees: [[Agreement; 3]; 2],
    /// How two frames of the corrected model, which differ by their noise alone, agree.
    pub floor: [Agreement; 3],
}

/// A camera for which frames are drawn.
pub(crate) struct Drawn<'a> {
    pub theta: &'a Theta,
    pub settings: &'a Settings,
}

/// Finds the percepts of all frames; `means` of the frames are as developed without noise.
pub(crate) fn percepts(
    forward: &mut Forward,
    frames: &[Shown],
    before: &Drawn<'_>,
    after: &Drawn<'_>,
) -> Result<Vec<FramePercepts>> {
    let simulated = delivered(forward, frames, |f| &f.before, before, 1)?;
    let corrected = delivered(forward, frames, |f| &f.after, after, 1)?;
    let again = if Tone::new(after.theta).is_noisy() {
        Some(delivered(forward, frames, |f| &f.after, after, 2)?)
    } else {
        None
    };
    let budget = &forward.budget;
    let find = |picture: &Plane<u8>| budget.go_on().map(|()| find(picture));
    let all = (0..frames.len()).into_par_iter().map(|i| {
        let found = [find(&bytes(&frames[i].real))?, find(&simulated[i])?, find(&corrected[i])?];
        let tolerance = tolerance_px(frames[i].real.width);
        let agrees = [1, 2].map(|k| compare(&found[k], &found[0], tolerance));
        let other = match &again {
            Some(again) => find(&again[i])?,
            None => found[2].clone(),
        };
        let floor = compare(&other, &found[2], tolerance);
        Ok(FramePercepts { found, agrees, floor })
    });
    all.collect()
}

/// Frames as the camera delivers them: with their noise, by the references of the effects.
fn delivered<'a>(
    forward: &mut Forward,
    frames: &'a [Shown],
    mean: impl Fn(&'a Shown) -> &'a Plane<f32>,
    camera: &Drawn<'_>,
    seed: u64,
) -> Result<Vec<Plane<u8>>> {
    if !Tone::new(camera.theta).is_noisy() {
        return Ok(frames.iter().map(|f| bytes(mean(f))).collect());
    }
    let places: Vec<usize> = (0..frames.len()).collect();
    let radiance = forward.radiance(&places, camera.theta, Quality::Fine)?;
    let shared = &*forward;
    let pictures = places.par_iter().zip(&radiance).map(|(&at, r)| {
        let data = r.data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 1.0]).collect();
        let radiance = Plane { width: r.width, height: r.height, channels: 4, data };
        let shutter = shared.shutter(at, camera.theta);
        let view = View { intrinsics: shared.intrinsics, shutter, frame: frames[at].index as u32, seed };
        chain::picture(effects::LIST, camera.settings, &view, &radiance)
    });
    Ok(pictures.collect())
}

/// The figures over the held-out frames.
pub(crate) fn figures(frames: &[Shown], percepts: &[FramePercepts]) -> Percepts {
    let held: Vec<&FramePercepts> =
        percepts.iter().zip(frames).filter(|(_, f)| f.held_out).map(|(p, _)| p).collect();
    let n = held.len().max(1) as f64;
    let mean = |f: &dyn Fn(&FramePercepts) -> f64| held.iter().map(|p| f(p)).sum::<f64>() / n;
    let count = |p: &PictureOf, kind: usize| [p.corners.len(), p.lines.len(), p.blobs.len()][kind] as f64;
    // Distances over all pairs; frames with none say nothing.
    let offset = |side: usize, kind: usize| {
        let pairs = held.iter().map(|p| {
            let a = &p.agrees[side][kind];
            let matched = a.matched.iter().filter(|m| **m).count() as f64;
            (a.offset_px * matched, matched)
        });
        let (sum, matched) = pairs.fold((0.0, 0.0), |a, p| (a.0 + p.0, a.1 + p.1));
        (matched > 0.0).then(|| sum / matched)
    };
    let kind = |k: usize| PerceptGap {
        name: KINDS[k].to_owned(),
        real: mean(&|p| count(&p.found[0], k)),
        before: mean(&|p| count(&p.found[1], k)),
        after: mean(&|p| count(&p.found[2], k)),
        matched_before: mean(&|p| p.agrees[0][k].share),
        matched_after: mean(&|p| p.agrees[1][k].share),
        matched_floor: mean(&|p| p.floor[k].share),
        offset_before_px: offset(0, k),
        offset_after_px: offset(1, k),
    };
    Percepts {
        file: PERCEPTS_FILE.to_owned(),
        tolerance_px: frames
            .first()
            .map_or(0.0, |f| 0.01 * (100.0 * f64::from(tolerance_px(f.real.width))).round()),
        kinds: (0..KINDS.len()).map(kind).collect(),
    }
}

/// Writes all percepts: a frame an entry, px to a tenth.
///
/// # Errors
/// A file that cannot be written.
pub(crate) fn write(folder: &Path, frames: &[Shown], percepts: &[FramePercepts]) -> Result<()> {
    let tenth = |v: &[f32]| v.iter().map(|x| (f64::from(*x) * 10.0).round() / 10.0).collect::<Vec<_>>();
    let picture = |p: &PictureOf, agrees: Option<&[Agreement; 3]>| {
        let kind = |k: usize, places: Vec<Vec<f64>>| match agrees {
            Some(a) => json!({ "at": places, "matched": a[k].matched }),
            None => json!({ "at": places }),
        };
        json!({
            "corners": kind(0, p.corners.iter().map(|v| tenth(v)).collect()),
            "lines": kind(1, p.lines.iter().map(|v| tenth(v)).collect()),
            "blobs": kind(2, p.blobs.iter().map(|v| tenth(v)).collect()),
        })
    };
    let frame = |(f, p): (&Shown, &FramePercepts)| {
        json!({
            "index": f.index,
            "real": picture(&p.found[0], None),
            "simulated": picture(&p.found[1], Some(&p.agrees[0])),
            "diagnosed": picture(&p.found[2], Some(&p.agrees[1])),
        })
    };
    let all: Vec<_> = frames.iter().zip(percepts).map(frame).collect();
    write_atomic(&folder.join(PERCEPTS_FILE), json!({ "frames": all }).to_string().as_bytes())
}
