//! How far a picture has to reach beyond its borders: the paper's extended field of view (Fig. 3), computed from the
//! motion.

use crate::engine::frame::FrameRequest;
use crate::engine::scene::clusters::Sought;
use crate::engine::scene::{Stage, camera_path, check_coverage};

/// Px beyond the computed margin: bilinear reading and the chord's deviation from the path.
const MARGIN_GUARD_PX: f64 = 4.0;
/// Motion differences deviate from the true path under acceleration: so much more is rendered.
const MARGIN_FACTOR: f64 = 1.15;

/// The margin that a frame's motion asks for around a picture of the instant `reference_s`, px; at most the picture's
/// own size.
pub(crate) fn needed_px(stage: &Stage, request: &FrameRequest, reference_s: f64) -> [u32; 2] {
    let shutter = &request.shutter;
    if shutter.end_s() <= shutter.start_s || check_coverage(stage, request).is_err() {
        return [0, 0];
    }
    let path = camera_path(stage, request);
    let quarter_s = 0.25 * (shutter.end_s() - shutter.start_s);
    let times: Vec<_> =
        (0..=4).map(|i| (shutter.start_s + quarter_s * f64::from(i)).min(shutter.end_s())).collect();
    let reach = stage.reach(&path, (reference_s, &times), Sought::Beyond);
    let size = [stage.intrinsics.width, stage.intrinsics.height];
    let needed = reach.beyond_px.map(|px| (px * MARGIN_FACTOR + MARGIN_GUARD_PX).ceil() as u32);
    [needed[0].min(size[0]), needed[1].min(size[1])]
}

/// Whether a margin is as wide as what is needed.
pub(crate) fn holds(have: [u32; 2], needed: [u32; 2]) -> bool {
    needed[0] <= have[0] && needed[1] <= have[1]
}

/// What holds both.
pub(crate) fn larger(a: [u32; 2], b: [u32; 2]) -> [u32; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}
