//! Copies of the planes that the paper's gather and the warp of `fast` have read: for hosts that hand the same planes
//! back in, and for tests.

use std::sync::Arc;
use std::time::Duration;

use crate::engine::slots::FrameSlot;
use crate::error::Result;
use crate::gpu::{Buffer, Context, Format, Image, Location, Usage};
use crate::plane::Plane;

/// Everything that the gather of a frame was given. Pictures hold `margin_px` more on every side than the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct GatherInputs {
    /// Linear RGBA, shape `[height, width, 4]`, at [`Self::color_time_s`].
    pub color: Plane<f32>,
    /// One to six motion images, px per frame interval, shape `[height, width, 2]`.
    pub motion_px: Vec<Plane<f32>>,
    /// Distance along the optical axis, m, of the motion image that was drawn last (of the colour's instant where there
    /// is one motion image); infinite where nothing is.
    pub depth_m: Plane<f32>,
    /// Columns and rows beyond each side.
    pub margin_px: [u32; 2],
    /// Instant of the colour, s.
    pub color_time_s: f64,
    /// Instant of the first motion image, s.
    pub first_motion_time_s: f64,
    /// Time from one motion image to the next, s.
    pub motion_step_s: f64,
}

/// Everything that the warp of a frame of `--method fast` was given, where it took its paths from depth.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpInputs {
    /// Linear RGBA, shape `[height, width, 4]`, at [`Self::color_time_s`].
    pub color: Plane<f32>,
    /// Near distance over distance along the optical axis; 0 where nothing is.
    pub inverse_depth: Plane<f32>,
    /// Columns and rows beyond each side.
    pub margin_px: [u32; 2],
    /// Instant of both, s.
    pub color_time_s: f64,
    /// Times at which the camera's pose was asked for, s.
    pub knots_s: Vec<f64>,
}

/// The images of a frame, and when they are of.
pub(crate) enum Taps<'a> {
    /// Colour, motion, and the depth of the motion image drawn last.
    Gather([&'a Image; 3], GatherTimes),
    /// Colour and inverse depth.
    Warp([&'a Image; 2], Vec<f64>),
}

/// The layers of an image that no frame in flight uses.
pub(crate) fn read_back(
    context: &Arc<Context>,
    slot: &mut FrameSlot,
    image: &Image,
    limit: Duration,
) -> Result<Vec<Plane<f32>>> {
    let spec = *image.spec();
    let texels = u64::from(spec.size[0]) * u64::from(spec.size[1]) * u64::from(spec.layers);
    let bytes = texels * spec.format.texel_bytes();
    let to = Buffer::new(context, "inputs", bytes, Usage::Transfer, Location::Readback)?;
    let mut recorder = slot.gpu.begin()?;
    recorder.copy_image_to_buffer(image, [0, 0], spec.size, &to);
    recorder.barrier();
    recorder.finish();
    slot.gpu.submit()?;
    slot.gpu.wait(limit)?;
    Ok(layers(image, &to.mapped()[..bytes as usize]))
}

/// Times of a gather's pictures.
pub(crate) struct GatherTimes {
    pub(crate) reference_s: f64,
    pub(crate) first_motion_s: f64,
    pub(crate) step_s: f64,
    pub(crate) count: usize,
}

/// The layers of an image that was copied out.
fn layers(image: &Image, bytes: &[u8]) -> Vec<Plane<f32>> {
    let spec = image.spec();
    let values: Vec<f32> = match spec.format {
        Format::Rgba16f => {
            let half = |h: &[u8]| exr::prelude::f16::from_le_bytes([h[0], h[1]]).to_f32();
            bytes.chunks_exact(2).map(half).collect()
        }
        _ => bytemuck::pod_collect_to_vec(bytes),
    };
    let [width, height] = spec.size.map(|s| s as usize);
    let one = values.len() / spec.layers as usize;
    let channels = one / (width * height);
    values.chunks_exact(one).map(|data| Plane { width, height, channels, data: data.to_vec() }).collect()
}
