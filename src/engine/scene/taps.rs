//! What a caller that keeps frames in flight asks an engine, and what the paper's gather has read: for hosts that hand
//! the same planes back in, and for the tests that compare.

use std::sync::Arc;
use std::time::Duration;

use crate::engine::fast::pass::FastTiming;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::camera_path;
use crate::engine::slots::{FrameSlot, free_slot};
use crate::engine::{Engine, Renderer, Ticket};
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

impl Engine {
    /// Renders a frame by the method `fast` and reads back what its warp was given; `None` for other methods, and where paths
    /// are drawn.
    ///
    /// # Errors
    /// As for [`Engine::render`].
    ///
    /// # Panics
    /// If frames are in flight.
    pub fn warp_inputs(&mut self, request: &FrameRequest) -> Result<Option<WarpInputs>> {
        assert_eq!(self.pending(), 0, "inputs are read between frames");
        self.render(request)?;
        let Renderer::Fast(fast) = &self.renderer else { return Ok(None) };
        let path = camera_path(&self.stage, request);
        let Some([color, depth]) = fast.warp_images(&self.stage, request, &path) else { return Ok(None) };
        let (slot, limit) = (&mut self.slots[0], self.options.time_limit);
        let color = read_back(&self.stage.context, slot, color, limit)?.swap_remove(0);
        let inverse_depth = read_back(&self.stage.context, slot, depth, limit)?.swap_remove(0);
        Ok(Some(WarpInputs {
            color,
            inverse_depth,
            margin_px: fast.margin_px(),
            color_time_s: request.shutter.middle_s(),
            knots_s: FastTiming::spaced(request.shutter).1.to_vec(),
        }))
    }

    /// Whether another frame can be submitted before one is collected.
    pub fn has_room(&self) -> bool {
        free_slot(&self.slots, self.next).is_some()
    }

    /// How many frames were submitted and not collected.
    pub fn pending(&self) -> usize {
        self.slots.iter().filter(|s| s.pending()).count()
    }

    /// Whether a frame can be collected without waiting.
    ///
    /// # Errors
    /// Device lost.
    pub fn finished(&self, ticket: &Ticket) -> Result<bool> {
        self.slots[ticket.slot].finished()
    }

    /// Waits for a frame without taking it.
    ///
    /// # Errors
    /// Device lost; not finished within `limit`: then it can be waited for again.
    pub fn wait(&mut self, ticket: &Ticket, limit: Duration) -> Result<()> {
        self.slots[ticket.slot].wait(limit)
    }

    /// A frame that nobody will collect: its slot is free again once the device is done with it.
    pub fn give_up(&mut self, ticket: &Ticket) {
        self.slots[ticket.slot].cancel();
    }

    /// Renders a frame by the paper's method and reads back what its gather was given; `None` for other methods.
    ///
    /// # Errors
    /// As for [`Engine::render`].
    ///
    /// # Panics
    /// If frames are in flight.
    pub fn gather_inputs(&mut self, request: &FrameRequest) -> Result<Option<GatherInputs>> {
        assert_eq!(self.pending(), 0, "inputs are read between frames");
        self.render(request)?;
        let Renderer::Paper(paper) = &self.renderer else { return Ok(None) };
        let path = camera_path(&self.stage, request);
        let times = paper.gather_times(&self.stage, request, &path);
        let [color, motion, depth] = paper.gather_images();
        let (slot, limit) = (&mut self.slots[0], self.options.time_limit);
        let mut read = |image: &Image| read_back(&self.stage.context, slot, image, limit);
        let mut motion_px = read(motion)?;
        motion_px.truncate(times.count);
        Ok(Some(GatherInputs {
            color: read(color)?.swap_remove(0),
            motion_px,
            depth_m: read(depth)?.swap_remove(0),
            margin_px: paper.margin_px(),
            color_time_s: times.reference_s,
            first_motion_time_s: times.first_motion_s,
            motion_step_s: times.step_s,
        }))
    }
}

/// The layers of an image that no frame in flight uses.
fn read_back(
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
