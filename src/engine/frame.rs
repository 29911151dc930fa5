//! A frame's request and its result.

use crate::camera::{Intrinsics, Pose, ShutterTiming};
use crate::chain::{Settings, View};
use crate::gpu::PassTime;
use crate::plane::Plane;

/// One frame to be made. Everything it depends on stands here.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRequest {
    /// Number of the frame: noise that changes from frame to frame is drawn for it.
    pub index: u32,
    /// When its lines are exposed.
    pub shutter: ShutterTiming,
    /// Time from one frame to the next, s: the unit of motion vectors.
    pub frame_interval_s: f64,
    /// Seed of all noise.
    pub seed: u64,
    /// Effects that act on pixels.
    pub settings: Settings,
    /// The camera rests at its pose of the frame's start.
    pub static_camera: bool,
    /// Whether the sharp planes are wanted too (the engine must have been made with `planes`).
    pub planes: bool,
    /// Whether statistics of the gather are wanted (reads the radiance back, which costs time).
    pub statistics: bool,
}

impl FrameRequest {
    /// What the pixel effects know of the frame.
    pub fn view(&self, intrinsics: Intrinsics) -> View {
        View { intrinsics, shutter: self.shutter, frame: self.index, seed: self.seed }
    }
}

/// The instants of a delivered frame, and the camera's pose at each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameInstants {
    /// Start of exposure of the first line read, s, and the pose then.
    pub first_line_start: (f64, Pose),
    /// Half way between the first line's start and the last line's end, s, and the pose then.
    pub middle: (f64, Pose),
    /// End of exposure of the last line read, s, and the pose then.
    pub last_line_end: (f64, Pose),
}

/// Counts over the pixels of a frame made by a gather.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStatistics {
    /// Mean number of samples read a pixel.
    pub taps_mean: f64,
    /// Share of pixels that read beyond the rendered picture and got its border instead, 0..1.
    pub invalid_share: f64,
}

/// The camera's picture at the frame's timestamp: through its lens (in the size of green), but no shutter, no blur, no
/// noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    /// Linear RGB and coverage, shape `[height, width, 4]`.
    pub color: Plane<f32>,
    /// Motion from this frame to the next, px, shape `[height, width, 2]`; that of the pixel's nearest sample.
    pub motion_px: Plane<f32>,
    /// Distance along the optical axis, m, of the pixel's nearest sample; infinite where nothing is.
    pub depth_m: Plane<f32>,
}

/// A delivered frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Number of the frame, as requested.
    pub index: u32,
    /// 8-bit sRGB, shape `[height, width, 3]`.
    pub picture: Plane<u8>,
    /// When it was taken.
    pub instants: FrameInstants,
    /// Time of each pass on the device; empty where it has no timestamps.
    pub times: Vec<PassTime>,
    /// From submission to the end of the wait by the host's clock, ms. Frames in flight overlap.
    pub host_ms: f64,
    /// If they were asked for and the method gathers.
    pub statistics: Option<FrameStatistics>,
    /// If they were asked for.
    pub planes: Option<Planes>,
    /// Linear radiance before noise and encoding, shape `[height, width, 4]` (alpha is the method's own), if statistics
    /// were asked for.
    pub radiance: Option<Plane<f32>>,
    /// The picture's encoded values before they are rounded to 8 bits, shape `[height, width, 4]`, if they were asked
    /// for.
    pub values: Option<Plane<f32>>,
    /// What the converter delivers of each pixel, 1 = full scale, behind its filter of `bayer_mosaic`, shape
    /// `[height, width, 1]`, if it was asked for.
    pub raw: Option<Plane<f32>>,
}
