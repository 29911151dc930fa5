//! Which instants the paper's method renders for a frame, and how much beyond its borders.

use super::Stage;
use super::frame::{FrameRequest, camera_path, check_coverage, covered_span_s};
use super::margin::reach_of;
use super::paper::{MARGIN_FACTOR, MARGIN_GUARD_PX, MotionSource, PaperOptions, Shift};
use crate::camera::Trajectory;
use crate::raster::{Instant, RasterKind};

/// Instants of one frame.
pub(super) struct Plan {
    pub(super) reference_s: f64,
    pub(super) first_motion_s: f64,
    pub(super) step_s: f64,
    /// Instant and scale (px per frame interval over px in the span) of each motion image.
    pub(super) motions: Vec<(Instant, f64)>,
}

/// Motion is drawn with the picture only where an instant of motion is the picture's: a second attachment costs a fifth
/// of the raster.
pub(super) fn picture_kind(options: &PaperOptions) -> RasterKind {
    let shared = options.motion_images % 2 == 1 || options.shift == Shift::Start;
    match shared && options.motion_source == MotionSource::Rasterized {
        true => RasterKind::ColorMotion,
        false => RasterKind::Color,
    }
}

/// The instants of a frame: the picture's, and those of the motion images, equally spaced over the frame.
pub(super) fn plan(stage: &Stage, options: &PaperOptions, request: &FrameRequest, path: &Trajectory) -> Plan {
    let shutter = &request.shutter;
    let (start_s, end_s) = (shutter.start_s, shutter.end_s());
    let span_s = end_s - start_s;
    let reference_s = match options.shift {
        Shift::Start => start_s,
        Shift::Middle => shutter.middle_s(),
    };
    if span_s <= 0.0 {
        let still = vec![(Instant::still(reference_s), 0.0)];
        return Plan { reference_s, first_motion_s: start_s, step_s: 1.0, motions: still };
    }
    let count = options.motion_images;
    let step_s = span_s / f64::from(count.max(2) - 1);
    let covered = covered_span_s(stage, path);
    let motions = (0..count).map(|k| {
        let time_s = match count {
            1 => reference_s,
            // Exactly the reference where they coincide: picture and motion are then drawn in one pass.
            _ if 2 * k + 1 == count && options.shift == Shift::Middle => reference_s,
            _ => (start_s + step_s * f64::from(k)).min(end_s),
        };
        motion_instant(time_s, step_s, covered, request.frame_interval_s)
    });
    Plan { reference_s, first_motion_s: start_s, step_s, motions: motions.collect() }
}

/// Eq. 3: the difference to the projection one step earlier, per frame interval; to the one later where no earlier
/// pose exists.
fn motion_instant(
    time_s: f64,
    step_s: f64,
    (first_s, last_s): (f64, f64),
    interval_s: f64,
) -> (Instant, f64) {
    let mut from_s = (time_s - step_s).max(first_s);
    let mut to_s = time_s;
    // Less than a tenth of the step is too short a base for a difference.
    if to_s - from_s < 0.1 * step_s {
        (from_s, to_s) = (time_s, (time_s + step_s).min(last_s));
    }
    let scale = if to_s > from_s { interval_s / (to_s - from_s) } else { 0.0 };
    (Instant { time_s, motion_from_s: from_s, motion_to_s: to_s }, scale)
}

/// The margin that a frame's motion asks for, px; at most the picture's own size.
pub(super) fn needed_margin_px(stage: &Stage, options: &PaperOptions, request: &FrameRequest) -> [u32; 2] {
    let shutter = &request.shutter;
    if shutter.end_s() <= shutter.start_s || check_coverage(stage, request).is_err() {
        return [0, 0];
    }
    let path = camera_path(stage, request);
    let reference_s = match options.shift {
        Shift::Start => shutter.start_s,
        Shift::Middle => shutter.middle_s(),
    };
    let quarter_s = 0.25 * (shutter.end_s() - shutter.start_s);
    let times: Vec<_> =
        (0..=4).map(|i| (shutter.start_s + quarter_s * f64::from(i)).min(shutter.end_s())).collect();
    let reach = reach_of(stage, &path, reference_s, &times);
    let size = [stage.intrinsics.width, stage.intrinsics.height];
    let needed = reach.beyond_px.map(|px| (px * MARGIN_FACTOR + MARGIN_GUARD_PX).ceil() as u32);
    [needed[0].min(size[0]), needed[1].min(size[1])]
}
