//! What the ladder films: three families of scenes, so that no method is judged only where it was chosen.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use shutterbug::camera::{Intrinsics, Trajectory};
use shutterbug::capture::Capture;
use shutterbug::scene::Scene;

use super::{checkers, room};

/// Who was chosen where.
#[derive(Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// `room.rs`: the options of `exact` were chosen on it. Held out for `fast`.
    Room,
    /// `tests/support/checkers`: the options of `fast` were chosen on it. Held out for `exact`.
    Checkers,
    /// Captures made by others, with their own motion. Held out for every method.
    Captures,
}

/// Something to film, and how the camera moves.
#[derive(Clone)]
pub struct Take {
    pub name: String,
    pub family: Family,
    pub scene: Arc<Scene>,
    pub path: Arc<Trajectory>,
    pub intrinsics: Intrinsics,
    /// Start of the frame, s.
    pub start_s: f64,
    pub readout_s: f64,
    pub exposure_s: f64,
}

/// All takes; those whose data is absent are left out, loudly.
pub fn all() -> Vec<Take> {
    room::takes().into_iter().chain(checkers_takes()).chain(captures()).collect()
}

fn checkers_takes() -> impl Iterator<Item = Take> {
    checkers::rows().into_iter().map(|row| Take {
        name: format!("checkers_{}", row.name),
        family: Family::Checkers,
        scene: row.scene,
        path: row.path,
        intrinsics: checkers::intrinsics(),
        start_s: 0.0,
        readout_s: checkers::READOUT_S,
        exposure_s: checkers::EXPOSURE_S,
    })
}

/// Scene, camera and motion of captures that a path tracer's authors made: flat faces, textures, and one with an object
/// that moves. One frame of each, fixed before any method was run on it: the middle one.
fn captures() -> Vec<Take> {
    const NAMES: [&str; 4] = ["d01", "d04", "d08", "d09"];
    // Shutter and exposure of a cheap camera; the captures' own differ from one to the next.
    const READOUT_S: f64 = 0.025;
    const EXPOSURE_S: f64 = 0.015;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/cycles-dev");
    if !folder.is_dir() {
        eprintln!("SKIPPED captures: {} is absent", folder.display());
        return Vec::new();
    }
    let take = |name: &str| {
        let capture = Capture::read(&folder.join(name), None).expect("a capture of others reads");
        let start_s = capture.shutter(capture.frames.len() / 2).start_s;
        Take {
            name: format!("capture_{name}"),
            family: Family::Captures,
            intrinsics: capture.true_intrinsics(),
            path: Arc::new(capture.true_trajectory()),
            scene: Arc::new(capture.scene),
            start_s,
            readout_s: READOUT_S,
            exposure_s: EXPOSURE_S,
        }
    };
    NAMES.map(take).into()
}

/// The camera with `scale` times the pixels a side.
pub fn scaled(k: Intrinsics, scale: u32) -> Intrinsics {
    let s = f64::from(scale);
    Intrinsics {
        width: k.width * scale,
        height: k.height * scale,
        fx: k.fx * s,
        fy: k.fy * s,
        cx: k.cx * s,
        cy: k.cy * s,
    }
}
