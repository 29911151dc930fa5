//! When lines are exposed, and how far content moves meanwhile, in the units of the kernels.

use glam::DVec2;

use super::blur::orientation;
use crate::camera::{Intrinsics, NEAR_M, ShutterTiming};
use crate::engine::frame::FrameRequest;
use crate::engine::scene::Stage;
use crate::engine::scene::clusters::Sought;
use crate::engine::scene::{camera_path, check_coverage};
use crate::gpu::RenderArea;
use crate::raster::{LensPush, PlacePush, View, spaced};

/// Lines beyond the picture whose time is still extended, as a share of all: vertices there are ends of edges that
/// cross the border, and a time that stopped at the border would bend those edges inside.
const LINES_BEYOND: f64 = 0.25;
/// Px beyond the reach of the blur: bilinear reading, and paths between the instants at which reach was measured.
const MARGIN_GUARD_PX: f64 = 2.0;
/// Where something moves this far from the middle of its exposure, chords may be coarser.
const HIDING_PX: f64 = 2.0;
/// Where less moves than this, blur cannot be seen, px.
const UNSEEN_PX: f64 = 1e-3;

/// How far the blur of a frame reaches.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlurReach {
    pub(super) margin_px: [u32; 2],
    pub(super) reach_px: f64,
    /// Where objects uncover what is seen: low and high x and y, px of the picture (not limited to it).
    pub(super) uncovered: Option<[DVec2; 2]>,
}

/// Lines of the attachment, margin included.
pub(super) fn lines_of(camera: &Intrinsics, shutter: &ShutterTiming) -> u32 {
    if shutter.scan_order.lines_are_rows() { camera.height } else { camera.width }
}

/// Begin, middle and end of the exposure of `count` lines, equally spaced from the middle of the attachment's first
/// line (in scan order) to that of its last.
pub(super) fn exposures(
    view: &View<'_>,
    shutter: &ShutterTiming,
    count: usize,
    covered_s: (f64, f64),
) -> Vec<[f64; 3]> {
    let lines = f64::from(shutter.line_count);
    let beyond = 0.5 * (f64::from(lines_of(view.camera, shutter)) - lines);
    let inside = |time_s: f64| time_s.clamp(covered_s.0, covered_s.1);
    let half_s = 0.5 * shutter.exposure_time_s;
    let middles = if count > 1 {
        let at_s = |line: f64| shutter.start_s + half_s + shutter.line_delay_s() * line;
        spaced(at_s(-beyond), at_s(lines + beyond - 1.0), count - 1)
    } else {
        vec![shutter.middle_s()]
    };
    middles.into_iter().map(|m| [inside(m - half_s), inside(m), inside(m + half_s)]).collect()
}

impl BlurReach {
    /// Where objects uncover what is seen, with all that may be read for it, px of an attachment of `camera`'s size.
    pub(super) fn uncovered_area(&self, camera: &Intrinsics, margin_px: [u32; 2]) -> Option<RenderArea> {
        let [low, high] = self.uncovered?;
        let beyond = self.reach_px + MARGIN_GUARD_PX;
        let side = |low: f64, high: f64, margin: u32, size: u32| {
            let at = |px: f64| (px + f64::from(margin)).clamp(0.0, f64::from(size)) as u32;
            let from = at((low - beyond).floor()).min(size - 1);
            (from, at((high + beyond).ceil()).max(from + 1) - from)
        };
        let (x, width) = side(low.x, high.x, margin_px[0], camera.width);
        let (y, height) = side(low.y, high.y, margin_px[1], camera.height);
        Some(RenderArea { x, y, width, height })
    }

    /// Whether blur hides what straight edges between vertices are off by.
    pub(super) fn hides_chords(&self) -> bool {
        self.reach_px > HIDING_PX
    }
}

/// From exposures at the begin, the middle and the end of the readout.
pub(super) fn measure_reach(stage: &Stage, request: &FrameRequest) -> BlurReach {
    let shutter = &request.shutter;
    if shutter.exposure_time_s <= 0.0 || check_coverage(stage, request).is_err() {
        return BlurReach::default();
    }
    let path = camera_path(stage, request);
    let half_s = 0.5 * shutter.exposure_time_s;
    let mut found = BlurReach::default();
    let middles = if shutter.readout_time_s > 0.0 { vec![0.0, 0.5, 1.0] } else { vec![0.0] };
    for at in middles {
        let from_s = shutter.start_s + at * (shutter.end_s() - shutter.start_s - 2.0 * half_s);
        let to_s = (from_s + 2.0 * half_s).min(shutter.end_s());
        // Where what is in view at the middle is at the ends, and what is in view at the ends at the middle: both bound
        // how far beyond the border the gather reads.
        let seen = stage.reach(&path, (from_s + half_s, &[from_s, to_s]), Sought::All);
        let limit = [stage.intrinsics.width, stage.intrinsics.height];
        for (i, limit) in limit.into_iter().enumerate() {
            let needed = if seen.largest_px < UNSEEN_PX { 0.0 } else { seen.beyond_px[i] + MARGIN_GUARD_PX };
            found.margin_px[i] = found.margin_px[i].max((needed.ceil() as u32).min(limit / 2));
        }
        found.reach_px = found.reach_px.max(seen.largest_px);
    }
    found
}

/// Where the vertex stage finds the time of a line: the instant `tau` of its exposure (-0.5 to 0.5), in places among
/// knots that are spread from the first line's start to the last line's end. Line l of the picture covers [l, l + 1) px
/// in scan order, and its time belongs to its middle.
pub(super) fn place_push(
    camera: &Intrinsics,
    shutter: &ShutterTiming,
    knot_count: usize,
    tau: f64,
) -> PlacePush {
    let span_s = shutter.end_s() - shutter.start_s;
    if knot_count < 2 {
        return PlacePush {
            vertex_count: 0,
            knot_count: 1,
            place_low: 0.0,
            place_high: 0.0,
            place_from_ndc: [0.0; 2],
            place_offset: 0.0,
            near_m: NEAR_M as f32,
            lens: LensPush::NONE,
        };
    }
    let per_s = (knot_count - 1) as f64 / span_s;
    let lines = f64::from(shutter.line_count);
    let delay_s = shutter.line_delay_s();
    let place = |line: f64| per_s * ((0.5 + tau) * shutter.exposure_time_s + delay_s * (line - 0.5));
    let (rows, reversed) = orientation(shutter.scan_order);
    let side = f64::from(if rows { camera.height } else { camera.width });
    let per_ndc = (per_s * delay_s * 0.5 * side * if reversed { -1.0 } else { 1.0 }) as f32;
    let beyond = 0.5 * (side - lines) + LINES_BEYOND * lines;
    PlacePush {
        vertex_count: 0,
        knot_count: knot_count as u32,
        place_low: place(-beyond) as f32,
        place_high: place(lines + beyond) as f32,
        place_from_ndc: if rows { [0.0, per_ndc] } else { [per_ndc, 0.0] },
        // The margin is the same on both sides, so the middle of the attachment is that of the picture.
        place_offset: place(0.5 * lines) as f32,
        near_m: NEAR_M as f32,
        lens: LensPush::NONE,
    }
}
