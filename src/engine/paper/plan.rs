//! Chooses the instants that the paper's method renders for a frame.

use crate::camera::{ShutterTiming, Trajectory};
use crate::engine::frame::FrameRequest;
use crate::engine::paper::{MotionSource, PaperOptions, Shift};
use crate::engine::scene::Stage;
use crate::engine::scene::covered_span_s;
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

/// When the picture of a frame is taken, s.
pub(super) fn reference_s(options: &PaperOptions, shutter: &ShutterTiming) -> f64 {
    match options.shift {
        Shift::Start => shutter.start_s,
        Shift::Middle => shutter.middle_s(),
    }
}

/// The instants of a frame: the picture's, and those of the motion images, equally spaced over the frame.
pub(super) fn plan(stage: &Stage, options: &PaperOptions, request: &FrameRequest, path: &Trajectory) -> Plan {
    let shutter = &request.shutter;
    let (start_s, end_s) = (shutter.start_s, shutter.end_s());
    let span_s = end_s - start_s;
    let reference_s = reference_s(options, shutter);
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
