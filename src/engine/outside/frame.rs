//! The parts of a frame from outside.

use std::sync::Arc;

use crate::camera::{Intrinsics, Pose, Trajectory};
use crate::engine::delivery::Delivery;
use crate::engine::frame::FrameRequest;
use crate::gpu::{Buffer, SharedImage};
use crate::plane::PixelFormat;
use crate::reference::paper_gather::Push as GatherPush;
use crate::reference::unpack::Encoding;

/// Most motion images of a frame.
pub const MAX_OUTSIDE_MOTIONS: usize = 6;

/// Where the bytes of a picture are.
#[derive(Clone, Copy)]
pub enum PixelSource<'a> {
    /// In host memory; copied before `submit` returns.
    Host(&'a [u8]),
    /// In a buffer that the device reads, from this byte on (a multiple of 4). Must not be written until the frame is
    /// collected.
    Shared(&'a Arc<Buffer>, u64),
    /// In an image of the host's, of the picture's size and a format that lies like the picture's. Copied on the
    /// device.
    Image(&'a Arc<SharedImage>),
}

/// A picture of the caller.
#[derive(Clone, Copy)]
pub struct OutsidePixels<'a> {
    /// Layout of a pixel.
    pub format: PixelFormat,
    /// From one row to the next, bytes.
    pub stride_bytes: usize,
    /// Whether the last row comes first in memory.
    pub bottom_up: bool,
    /// The bytes: the first row in memory starts at the first.
    pub source: PixelSource<'a>,
}

/// How a frame's content moves.
pub enum OutsideMotion<'a> {
    /// One to six motion images, equally spaced in time.
    Images {
        /// Their pixels.
        images: Vec<OutsidePixels<'a>>,
        /// What turns the values given into px per frame interval, content from its previous to its current place.
        scale: [f32; 2],
        /// Time of the first, s.
        first_time_s: f64,
        /// Time from one to the next, s; unused with one.
        step_s: f64,
    },
    /// Depth of the colour's instant, of a resting scene.
    Depth {
        /// Its pixels ([`PixelFormat::R32f`]).
        image: OutsidePixels<'a>,
        /// `None`: metres along the optical axis. Else metres = n / (c + s value), given as `[n, c, s]`.
        decode: Option<[f32; 3]>,
        /// World from camera at two times (s) of the frame, the earlier first. The colour's instant lies between them.
        poses: [(f64, Pose); 2],
    },
    /// Depth of the colour's instant, of a scene that rests, and the camera's poses over all of the frame: the warp of
    /// `--method fast`.
    Path {
        /// Its pixels ([`PixelFormat::R32f`]).
        image: OutsidePixels<'a>,
        /// As for `Depth`.
        decode: Option<[f32; 3]>,
        /// World from camera, for all of the frame and the colour's instant.
        path: Arc<Trajectory>,
        /// What moves by itself.
        bodies: Option<OutsideBodies<'a>>,
        /// The same scene at later instants, in order of time; fewer than [`MAX_PICTURES`].
        further: Vec<OutsidePicture<'a>>,
        /// Nothing that comes in at the border is nearer, m: what the margin is reckoned with. Infinite: not known.
        nearest_m: f64,
        /// A margin that is too small is no error: what lies beyond is the picture's repeated border.
        repeat_border: bool,
    },
}

/// Most pictures of a frame.
pub const MAX_PICTURES: usize = 8;

/// A further picture of a frame, at its own instant. Size, margin, encoding and conventions are those of the first.
#[derive(Clone, Copy)]
pub struct OutsidePicture<'a> {
    /// When it was rendered, s.
    pub time_s: f64,
    /// Its colour.
    pub color: OutsidePixels<'a>,
    /// Its depth ([`PixelFormat::R32f`]).
    pub depth: OutsidePixels<'a>,
    /// Whose surface each pixel shows, with bodies.
    pub ids: Option<OutsidePixels<'a>>,
}

/// Most bodies of a frame.
pub const MAX_BODIES: usize = 255;

/// What moves by itself in a frame.
pub struct OutsideBodies<'a> {
    /// Whose surface each pixel shows ([`PixelFormat::R8u`], `R16u` or `R32u`), at the colour's instant.
    pub ids: OutsidePixels<'a>,
    /// Id and world-from-body of each; [`MAX_BODIES`] at most, in rising order of their ids. Ids without a body belong
    /// to what rests.
    pub paths: Vec<(u32, Trajectory)>,
}

/// A frame from outside.
pub struct OutsideFrame<'a> {
    /// Index, shutter, frame interval, seed, pixel effects. (`planes` and `static_camera` mean nothing here.)
    pub request: FrameRequest,
    /// Colour of one instant, with the margin on every side.
    pub color: OutsidePixels<'a>,
    /// What its 8-bit values mean.
    pub encoding: Encoding,
    /// When it was rendered, s.
    pub color_time_s: f64,
    /// Columns and rows that colour, motion and depth hold beyond each side of the frame.
    pub margin_px: [u32; 2],
    /// Motion, or what it is computed from.
    pub motion: OutsideMotion<'a>,
    /// Most samples of the blur.
    pub max_samples: u32,
    /// Semaphores around it, and where the picture goes as well.
    pub delivery: Delivery,
}

impl OutsideFrame<'_> {
    /// Puts its pictures in order of time.
    pub fn sort_pictures(&mut self) {
        let OutsideMotion::Path { image, bodies, further, .. } = &mut self.motion else { return };
        let ids = bodies.as_ref().map(|b| b.ids);
        further.push(OutsidePicture { time_s: self.color_time_s, color: self.color, depth: *image, ids });
        further.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let first = further.remove(0);
        (self.color_time_s, self.color, *image) = (first.time_s, first.color, first.depth);
        if let (Some(bodies), Some(ids)) = (bodies, first.ids) {
            bodies.ids = ids;
        }
    }

    /// When its pictures were rendered, the first one first, s.
    pub(super) fn picture_times_s(&self) -> Vec<f64> {
        let further = match &self.motion {
            OutsideMotion::Path { further, .. } => further.as_slice(),
            OutsideMotion::Images { .. } | OutsideMotion::Depth { .. } => &[],
        };
        let all = std::iter::once(self.color_time_s).chain(further.iter().map(|p| p.time_s));
        all.take(MAX_PICTURES).collect()
    }
}

/// Most pictures, motion and depth images of a frame together: colour, depth and ids of each instant.
pub(super) const MAX_PLACES: usize = 3 * MAX_PICTURES;

/// Colour first, then motion or depth, then what other instants bring: the order of the staging buffers.
pub(super) fn pictures<'a>(frame: &OutsideFrame<'a>) -> Vec<OutsidePixels<'a>> {
    let mut all = vec![frame.color];
    match &frame.motion {
        OutsideMotion::Images { images, .. } => all.extend(images.iter().take(MAX_OUTSIDE_MOTIONS)),
        OutsideMotion::Depth { image, .. } => all.push(*image),
        OutsideMotion::Path { image, bodies, further, .. } => {
            all.push(*image);
            all.extend(bodies.as_ref().map(|b| b.ids));
            for picture in further.iter().take(MAX_PICTURES - 1) {
                all.extend([picture.color, picture.depth]);
                all.extend(bodies.as_ref().and(picture.ids));
            }
        }
    }
    all
}

/// First byte of the top row and stride of a picture where the kernel reads it; `size` with margin. Kernels count in
/// words of 32 bits that wrap, so a stride may be below 0.
pub(super) fn place(pixels: &OutsidePixels<'_>, size: [u32; 2]) -> (u32, u32) {
    let (first_byte, stride_bytes) = match pixels.source {
        PixelSource::Host(_) | PixelSource::Image(_) => {
            (0, (size[0] as usize * pixels.format.bytes()).next_multiple_of(4) as u32)
        }
        PixelSource::Shared(_, first_byte) => (first_byte as u32, pixels.stride_bytes as u32),
    };
    match pixels.bottom_up {
        true => {
            (first_byte.wrapping_add(stride_bytes.wrapping_mul(size[1] - 1)), stride_bytes.wrapping_neg())
        }
        false => (first_byte, stride_bytes),
    }
}

/// Parameters of the gather.
pub(super) fn gather_push(intrinsics: &Intrinsics, frame: &OutsideFrame<'_>) -> GatherPush {
    let shutter = &frame.request.shutter;
    let (first_s, step_s, count) = match &frame.motion {
        OutsideMotion::Images { images, first_time_s, step_s, .. } => (*first_time_s, *step_s, images.len()),
        OutsideMotion::Depth { .. } | OutsideMotion::Path { .. } => (shutter.start_s, 1.0, 1),
    };
    GatherPush {
        size: [intrinsics.width, intrinsics.height],
        margin_px: frame.margin_px.map(|m| m as i32),
        start_s: (shutter.start_s - frame.color_time_s) as f32,
        readout_time_s: shutter.readout_time_s as f32,
        exposure_time_s: shutter.exposure_time_s as f32,
        frame_interval_s: frame.request.frame_interval_s as f32,
        first_motion_s: (first_s - frame.color_time_s) as f32,
        motion_step_s: step_s as f32,
        motion_count: count.clamp(1, MAX_OUTSIDE_MOTIONS) as u32,
        scan_order: shutter.scan_order as u32,
        max_samples: frame.max_samples.max(1),
        pixel_time: 0,
    }
}
