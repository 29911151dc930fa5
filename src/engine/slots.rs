//! The resources of each frame in flight: command buffer, mapped inputs, mapped readback.

use std::sync::Arc;
use std::time::{Duration, Instant as Clock};

use crate::camera::{Intrinsics, Trajectory};
use crate::effects;
use crate::engine::delivery::{After, Delivery};
use crate::engine::finish::Finish;
use crate::engine::frame::{Frame, FrameInstants, FrameRequest, FrameStatistics, Planes};
use crate::error::Result;
use crate::gpu::{Buffer, Context, Format, Location, PassTime, Recorder, Shared, Slot, Usage};
use crate::plane::Plane;
use crate::raster::{CameraRow, Instant, ObjectRow, instant_rows};
use crate::reference::chain::develop_on_host;
use crate::scene::Object;

/// Instants that one submission can hold: a chunk of the accumulation, or the paper's pictures and the sharp planes.
pub(crate) const MAX_INSTANTS: u32 = 40;

/// A frame in flight.
pub(crate) struct FrameSlot {
    /// Made when a frame first goes elsewhere too.
    after: Option<After>,
    pub(crate) gpu: Slot,
    pub(crate) index: usize,
    pub(crate) inputs: SlotInputs,
    /// 8-bit picture, RGBA.
    pub(crate) picture: Buffer,
    /// Radiance with statistics in alpha.
    pub(crate) radiance: Buffer,
    request: Option<(FrameRequest, FrameInstants, Clock)>,
    earlier: Vec<PassTime>,
    /// Sharp planes on their way down, if the engine makes them.
    pub(crate) planes: Option<PlanesReadback>,
    /// What of the caller's the work in flight uses.
    pub(crate) kept: (Delivery, Vec<Shared>),
}

/// Where a frame goes in host memory.
#[derive(Clone, Copy)]
pub(crate) struct ReadTo<'a> {
    pub(crate) picture: &'a Buffer,
    pub(crate) radiance: &'a Buffer,
    pub(crate) planes: Option<&'a PlanesReadback>,
}

/// Mapped buffers of the sharp planes.
pub(crate) struct PlanesReadback {
    pub(crate) color: Buffer,
    pub(crate) motion: Buffer,
    pub(crate) depth: Buffer,
    size: [u32; 2],
}

impl PlanesReadback {
    pub(crate) fn new(context: &Arc<Context>, size: [u32; 2]) -> Result<Self> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |name: &str, format: Format| {
            Buffer::new(context, name, pixels * format.texel_bytes(), Usage::Transfer, Location::Readback)
        };
        Ok(Self {
            color: buffer("plane color", Format::Rgba32f)?,
            motion: buffer("plane motion", Format::Rg32f)?,
            depth: buffer("plane depth", Format::R32f)?,
            size,
        })
    }

    /// Those of a finished frame.
    fn read(&self) -> Planes {
        let [width, height] = self.size.map(|s| s as usize);
        let plane = |buffer: &Buffer, channels: usize| {
            let values: &[f32] = bytemuck::cast_slice(buffer.mapped());
            Plane { width, height, channels, data: values[..width * height * channels].to_vec() }
        };
        Planes {
            color: plane(&self.color, 4),
            motion_px: plane(&self.motion, 2),
            depth_m: plane(&self.depth, 1),
        }
    }
}

/// Mapped buffers that the host writes before it submits.
pub(crate) struct SlotInputs {
    pub(crate) instants: Buffer,
    pub(crate) cameras: Buffer,
    pub(crate) weights: Buffer,
    object_count: u32,
    used: u32,
    used_weights: u32,
}

impl FrameSlot {
    /// For pictures of `size`, of scenes with `objects` objects.
    pub(crate) fn new(context: &Arc<Context>, size: [u32; 2], objects: usize, index: usize) -> Result<Self> {
        let ([width, height], objects) = (size.map(u64::from), objects as u64);
        let upload =
            |name: &str, bytes: u64, usage: Usage| Buffer::new(context, name, bytes, usage, Location::Upload);
        let rows = u64::from(MAX_INSTANTS);
        let readback =
            |name: &str, bytes: u64| Buffer::new(context, name, bytes, Usage::Transfer, Location::Readback);
        Ok(Self {
            after: None,
            gpu: Slot::new(context, &format!("frame {index}"))?,
            index,
            inputs: SlotInputs {
                instants: upload(
                    "instants",
                    rows * objects * size_of::<ObjectRow>() as u64,
                    Usage::StorageTexels,
                )?,
                cameras: upload("cameras", rows * size_of::<CameraRow>() as u64, Usage::Texels)?,
                weights: upload("weights", rows * width.max(height) * 4, Usage::Storage)?,
                object_count: objects as u32,
                used: 0,
                used_weights: 0,
            },
            picture: readback("picture", width * height * 4)?,
            radiance: readback("radiance", width * height * 16)?,
            request: None,
            earlier: Vec::new(),
            planes: None,
            kept: Default::default(),
        })
    }

    /// What its next submission is recorded with, and where its frame goes.
    pub(crate) fn begin(&mut self) -> Result<(Recorder<'_>, ReadTo<'_>)> {
        let to = ReadTo { picture: &self.picture, radiance: &self.radiance, planes: self.planes.as_ref() };
        Ok((self.gpu.begin()?, to))
    }

    /// Whether it holds a frame that was not collected.
    pub(crate) fn pending(&self) -> bool {
        self.request.is_some()
    }

    /// Sends the picture elsewhere too, behind the frame's own work.
    pub(crate) fn deliver(&mut self, context: &Arc<Context>, delivery: &Delivery) -> Result<()> {
        if delivery.is_empty() {
            return Ok(());
        }
        if self.after.is_none() {
            self.after = Some(After::new(context)?);
        }
        self.after.as_mut().expect("just made").submit(delivery, &self.picture)
    }

    /// Whether all of the frame's work has finished; does not wait.
    pub(crate) fn finished(&self) -> Result<bool> {
        Ok(self.gpu.finished()? && self.after.as_ref().map_or(Ok(true), |a| a.gpu.finished())?)
    }

    /// Waits for all of the frame's work.
    pub(crate) fn wait(&mut self, limit: Duration) -> Result<()> {
        let start = Clock::now();
        self.gpu.wait(limit)?;
        if let Some(after) = &mut self.after {
            after.gpu.wait(limit.saturating_sub(start.elapsed()))?;
            after.release();
        }
        Ok(())
    }

    pub(crate) fn start(&mut self, request: &FrameRequest, instants: FrameInstants) {
        self.request = Some((request.clone(), instants, Clock::now()));
        self.earlier.clear();
        self.inputs.clear();
    }

    /// Forgets a frame that could not be submitted, or that nobody will collect.
    pub(crate) fn cancel(&mut self) {
        self.request = None;
    }

    /// Keeps the times of a finished submission before the slot is recorded again: for the frame's next part, or after
    /// new images.
    pub(crate) fn keep_times(&mut self) -> Result<()> {
        let times = self.gpu.take_times()?;
        add_times(&mut self.earlier, times);
        Ok(())
    }

    /// Waits for the work in flight, so that what it uses may be replaced. Its frame, if any, can still be collected.
    pub(crate) fn settle(&mut self, limit: Duration) -> Result<()> {
        self.gpu.wait(limit)?;
        self.keep_times()
    }

    /// Waits for the frame; times of all its submissions. On failure the frame is given up: its ticket is gone, and the
    /// slot must not stay taken.
    pub(crate) fn finish(&mut self, limit: Duration) -> Result<Vec<PassTime>> {
        let done = self.wait(limit).and_then(|()| self.keep_times());
        if done.is_err() {
            self.cancel();
        }
        done.map(|()| std::mem::take(&mut self.earlier))
    }

    /// The finished frame.
    pub(crate) fn take_frame(&mut self, size: [u32; 2], times: Vec<PassTime>, finish: &Finish) -> Frame {
        let (request, instants, clock) = self.request.take().expect("the ticket of this slot's frame");
        // A buffer is a little larger than the smallest pictures.
        let pixels = size[0] as usize * size[1] as usize;
        let rgb =
            self.picture.mapped().chunks_exact(4).take(pixels).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mapped = self.radiance.mapped();
        let radiance = &mapped[..mapped.len().min(16 * pixels)];
        let mut picture = Plane { width: size[0] as usize, height: size[1] as usize, channels: 3, data: rgb };
        develop_on_host(effects::LIST, &request.settings, &mut picture);
        // Its alpha holds distances then.
        let counted = request.statistics && !effects::Defocus::needs_depth(&request.settings);
        let statistics = counted.then(|| statistics(bytemuck::cast_slice(radiance)));
        let radiance = request.statistics.then(|| Plane {
            width: size[0] as usize,
            height: size[1] as usize,
            channels: 4,
            data: bytemuck::cast_slice(radiance).to_vec(),
        });
        let planes = self.planes.as_ref().filter(|_| request.planes).map(PlanesReadback::read);
        self.kept = Default::default();
        let [values, raw] = finish.take_kept(self.index, &request.settings);
        Frame {
            radiance,
            values,
            raw,
            index: request.index,
            picture,
            instants,
            times,
            host_ms: clock.elapsed().as_secs_f64() * 1e3,
            statistics,
            planes,
        }
    }
}

impl SlotInputs {
    /// Forgets the rows of the last submission, which must have finished.
    pub(crate) fn clear(&mut self) {
        (self.used, self.used_weights) = (0, 0);
    }

    /// Adds weights; returns the place of the first.
    pub(crate) fn add_weights(&mut self, weights: &[f32]) -> u32 {
        let first = self.used_weights;
        self.weights.write(first as usize * size_of::<f32>(), weights);
        self.used_weights += weights.len() as u32;
        first
    }

    /// Adds the rows of an instant; returns its number and the number of objects, as the vertex stage wants them.
    pub(crate) fn add(
        &mut self,
        (path, objects): (&Trajectory, &[Object]),
        camera: &Intrinsics,
        instant: &Instant,
    ) -> (u32, u32) {
        assert!(self.used < MAX_INSTANTS, "a submission holds at most {MAX_INSTANTS} instants");
        let (rows, eye) = instant_rows(instant, camera, path, objects);
        let at = self.used as usize;
        self.instants.write(at * rows.len() * size_of::<ObjectRow>(), &rows);
        self.cameras.write(at * size_of::<CameraRow>(), &[eye]);
        self.used += 1;
        (at as u32, self.object_count)
    }
}

fn add_times(sums: &mut Vec<PassTime>, times: Vec<PassTime>) {
    for time in times {
        match sums.iter_mut().find(|t| t.name == time.name) {
            Some(sum) => sum.ms += time.ms,
            None => sums.push(time),
        }
    }
}

/// From alpha as `paper_gather` writes it: the number of samples, negative where one left the rendered picture.
fn statistics(radiance: &[[f32; 4]]) -> FrameStatistics {
    let taps: f64 = radiance.iter().map(|p| f64::from(p[3].abs())).sum();
    let invalid = radiance.iter().filter(|p| p[3] < 0.0).count();
    let count = radiance.len() as f64;
    FrameStatistics { taps_mean: taps / count, invalid_share: invalid as f64 / count }
}
