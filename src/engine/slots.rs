//! What each frame in flight has of its own: commands, mapped inputs, mapped readback.

use std::time::{Duration, Instant as Clock};

use crate::camera::{Intrinsics, Trajectory};
use crate::effects;
use crate::engine::delivery::{After, Delivery};
use crate::engine::finish::Finish;
use crate::engine::frame::{Frame, FrameInstants, FrameRequest, FrameStatistics, Planes};
use crate::engine::scene::Stage;
use crate::error::Result;
use crate::gpu::{Buffer, Location, PassTime, Slot, Usage};
use crate::plane::Plane;
use crate::raster::{CameraRow, Instant, ObjectRow, instant_rows};
use crate::reference::chain::develop_on_host;

/// The slot that the next frame takes: the first from `from` on, in turn, that holds no frame and has nothing in flight. Frames
/// may be collected in any order, so the next in turn may be taken while another one is free.
pub(super) fn free_slot(slots: &[FrameSlot], from: usize) -> Option<usize> {
    // Where it cannot be asked, the submission says why.
    let free = |s: &FrameSlot| !s.pending() && s.finished().unwrap_or(true);
    (0..slots.len()).map(|i| (from + i) % slots.len()).find(|&i| free(&slots[i]))
}

/// Instants that one submission can hold: a chunk of the accumulation, or the paper's pictures and the sharp planes.
pub(super) const MAX_INSTANTS: u32 = 40;

/// A frame in flight.
pub(super) struct FrameSlot {
    /// Made when a frame first goes elsewhere too.
    after: Option<After>,
    pub(super) gpu: Slot,
    pub(super) index: usize,
    pub(super) inputs: SlotInputs,
    /// 8-bit picture, RGBA.
    pub(super) picture: Buffer,
    /// Radiance with statistics in alpha.
    pub(super) radiance: Buffer,
    request: Option<(FrameRequest, FrameInstants, Clock)>,
    earlier: Vec<PassTime>,
}

/// Mapped buffers that the host writes before it submits.
pub(super) struct SlotInputs {
    pub(super) instants: Buffer,
    pub(super) cameras: Buffer,
    pub(super) weights: Buffer,
    object_count: u32,
    used: u32,
    used_weights: u32,
}

impl FrameSlot {
    pub(super) fn new(stage: &Stage, index: usize) -> Result<Self> {
        let (width, height) = (u64::from(stage.intrinsics.width), u64::from(stage.intrinsics.height));
        let objects = stage.scene.objects.len() as u64;
        let upload = |name: &str, bytes: u64, usage: Usage| {
            Buffer::new(&stage.context, name, bytes, usage, Location::Upload)
        };
        let rows = u64::from(MAX_INSTANTS);
        let readback = |name: &str, bytes: u64| {
            Buffer::new(&stage.context, name, bytes, Usage::Transfer, Location::Readback)
        };
        Ok(Self {
            after: None,
            gpu: Slot::new(&stage.context, &format!("frame {index}"))?,
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
        })
    }

    /// Whether it holds a frame that was not collected.
    pub(super) fn pending(&self) -> bool {
        self.request.is_some()
    }

    /// Sends the picture elsewhere too, behind the frame's own work.
    pub(super) fn deliver(&mut self, stage: &Stage, delivery: &Delivery) -> Result<()> {
        if delivery.is_empty() {
            return Ok(());
        }
        if self.after.is_none() {
            self.after = Some(After::new(&stage.context)?);
        }
        self.after.as_mut().expect("just made").submit(delivery, &self.picture)
    }

    /// Whether all of the frame's work has finished; does not wait.
    pub(super) fn finished(&self) -> Result<bool> {
        Ok(self.gpu.finished()? && self.after.as_ref().map_or(Ok(true), |a| a.gpu.finished())?)
    }

    /// Waits for all of the frame's work.
    pub(super) fn wait(&mut self, limit: Duration) -> Result<()> {
        let start = Clock::now();
        self.gpu.wait(limit)?;
        if let Some(after) = &mut self.after {
            after.gpu.wait(limit.saturating_sub(start.elapsed()))?;
            after.release();
        }
        Ok(())
    }

    pub(super) fn start(&mut self, request: &FrameRequest, instants: FrameInstants) {
        self.request = Some((request.clone(), instants, Clock::now()));
        self.earlier.clear();
        self.inputs.clear();
    }

    /// Forgets a frame that could not be submitted, or that nobody will collect.
    pub(super) fn cancel(&mut self) {
        self.request = None;
    }

    pub(super) fn wants_planes(&self) -> bool {
        self.request.as_ref().is_some_and(|(r, ..)| r.planes)
    }

    /// Keeps the times of a finished submission before the slot is recorded anew: its frame's next part, or new images.
    pub(super) fn keep_times(&mut self) -> Result<()> {
        let times = self.gpu.take_times()?;
        add_times(&mut self.earlier, times);
        Ok(())
    }

    /// Waits for the work in flight, so that what it uses may be made anew; its frame, if any, can still be collected.
    pub(super) fn settle(&mut self, limit: Duration) -> Result<()> {
        self.gpu.wait(limit)?;
        self.keep_times()
    }

    /// Waits for the frame; times of all its submissions. On failure the frame is given up: its ticket is gone, and the slot
    /// must not stay taken.
    pub(super) fn finish(&mut self, limit: Duration) -> Result<Vec<PassTime>> {
        let done = self.wait(limit).and_then(|()| self.keep_times());
        if done.is_err() {
            self.cancel();
        }
        done.map(|()| std::mem::take(&mut self.earlier))
    }

    /// The finished frame.
    pub(super) fn take_frame(
        &mut self,
        size: [u32; 2],
        times: Vec<PassTime>,
        planes: Option<Planes>,
        finish: &Finish,
    ) -> Frame {
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
    pub(super) fn clear(&mut self) {
        (self.used, self.used_weights) = (0, 0);
    }

    /// Adds weights; returns the place of the first.
    pub(super) fn add_weights(&mut self, weights: &[f32]) -> u32 {
        let first = self.used_weights;
        self.weights.write(first as usize * size_of::<f32>(), weights);
        self.used_weights += weights.len() as u32;
        first
    }

    /// Adds the rows of an instant; returns its number and the number of objects, as the vertex stage wants them.
    pub(super) fn add(
        &mut self,
        stage: &Stage,
        path: &Trajectory,
        camera: &Intrinsics,
        instant: &Instant,
    ) -> (u32, u32) {
        assert!(self.used < MAX_INSTANTS, "a submission holds at most {MAX_INSTANTS} instants");
        let (rows, eye) = instant_rows(instant, camera, path, &stage.scene.objects);
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
