//! Frames from outside: colour with motion, or colour with depth and two poses, through the same gather and the same
//! last passes as the engine's own; or colour with depth and the camera's path, through the warp of `--method fast`. The
//! engine's own planes handed back in give the engine's own picture.

mod blend;
pub(crate) mod frame;
mod kernels;
pub(crate) mod lens;
mod motion;
mod warp;

use std::sync::Arc;
use std::time::Duration;

use crate::camera::{Intrinsics, Pose, ShutterTiming, Trajectory};
use crate::effects::Defocus;
use crate::engine::Ticket;
use crate::engine::delivery::Delivery;
use crate::engine::finish::{Finish, prepare};
use crate::engine::frame::{Frame, FrameInstants};
use crate::engine::outside::frame::{
    MAX_OUTSIDE_MOTIONS, MAX_PLACES, OutsideFrame, OutsideMotion, PixelSource, gather_push, pictures, place,
};
use crate::engine::outside::kernels::{Groups, Kernels, Role, Unpacked};
use crate::engine::outside::lens::{BorderRays, OutsideLens};
use crate::engine::outside::motion::{MotionPass, shared};
use crate::engine::outside::warp::{OutsideWarp, WarpKind, WarpPlan};
use crate::engine::scene::Stage;
use crate::engine::slots::{FrameSlot, free_slot};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Recorder, Shared, Usage};
use crate::raster::{SamplePlan, SceneBuffers};
use crate::reference::motion_from_depth::Push as FromDepthPush;
use crate::scene::Scene;

/// Processes frames from outside for one camera.
pub struct OutsideEngine {
    slots: Vec<FrameSlot>,
    uploads: Vec<Vec<Option<Buffer>>>,
    /// What the frames in flight use of the caller's, by slot.
    kept: Vec<Kept>,
    images: Option<Images>,
    kernels: Kernels,
    finish: Finish,
    /// Of the last frame that brought a path.
    border: Option<BorderRays>,
    next: usize,
    time_limit: Duration,
    stage: Stage,
}

/// The caller's things that a frame in flight uses.
type Kept = (Delivery, Vec<Shared>);

/// Everything whose size depends on the margin.
struct Images {
    margin_px: [u32; 2],
    groups: Groups,
    color: Image,
    motion: Image,
    depth: Image,
    /// Made with the first frame that brings a path.
    warp: Option<OutsideWarp>,
}

/// What makes the radiance of a frame.
enum Plan {
    Gather(Option<FromDepthPush>),
    Warp(WarpPlan),
}

impl OutsideEngine {
    /// Makes what frames of this size need; `frames_in_flight` is 1 to 8.
    ///
    /// # Errors
    /// Sizes that the device cannot do, out of memory.
    pub fn new(
        context: &Arc<Context>,
        intrinsics: Intrinsics,
        frames_in_flight: u32,
        time_limit: Duration,
    ) -> Result<Self> {
        crate::engine::check_size(&intrinsics)?;
        let scene = Scene::default();
        let stage = Stage {
            buffers: SceneBuffers::new(context, &scene)?,
            plan: SamplePlan { grid: 1, msaa: 1 },
            scene: Arc::new(scene),
            trajectory: Arc::new(Trajectory::fixed(Pose::IDENTITY)),
            intrinsics,
            lens: None,
            context: context.clone(),
        };
        let count = frames_in_flight.clamp(1, 8) as usize;
        let mut slots = (0..count).map(|i| FrameSlot::new(&stage, i)).collect::<Result<Vec<_>>>()?;
        let size = [intrinsics.width, intrinsics.height];
        let finish = Finish::new(context, size, count, &mut slots[0].gpu)?;
        let kernels = Kernels::new(context)?;
        let uploads = (0..count).map(|_| (0..MAX_PLACES).map(|_| None).collect()).collect();
        let kept = (0..count).map(|_| Kept::default()).collect();
        let (images, border) = (None, None);
        Ok(Self { slots, uploads, kept, images, kernels, finish, border, next: 0, time_limit, stage })
    }

    /// Whether another frame can be submitted before one is collected.
    pub fn has_room(&self) -> bool {
        free_slot(&self.slots, self.next).is_some()
    }

    /// How many frames were submitted and not collected.
    pub fn pending(&self) -> usize {
        self.slots.iter().filter(|s| s.pending()).count()
    }

    /// Records a frame and hands it to the device.
    ///
    /// # Errors
    /// A margin beyond the device's limits; a depth's poses that do not enclose the colour's instant; device lost; out of
    /// memory.
    ///
    /// # Panics
    /// If there is no room, a picture is shorter than its size and stride say, or pictures are not in order of time.
    pub fn submit(&mut self, frame: &OutsideFrame<'_>) -> Result<Ticket> {
        let index = free_slot(&self.slots, self.next);
        let index = index.expect("collect a frame before submitting more than fit in flight");
        if Defocus::needs_depth(&frame.request.settings) {
            let what =
                "by distance needs a scene: frames from outside have a fixed sigma_px or disc_radius_px"
                    .to_owned();
            return Err(Error::Contradiction { effect: "defocus", what });
        }
        self.slots[index].gpu.wait(self.time_limit)?;
        assert!(frame.picture_times_s().is_sorted(), "pictures in order of time");
        let lens = OutsideLens::of(&frame.request.settings, &self.stage.intrinsics);
        let is_path = matches!(frame.motion, OutsideMotion::Path { .. });
        if is_path && !self.border.as_ref().is_some_and(|b| b.is_of(&self.stage.intrinsics, lens.as_ref())) {
            self.border = Some(BorderRays::new(&self.stage.intrinsics, lens.as_ref())?);
        }
        let plan = self.plan(frame)?;
        self.kernels.fit(&frame.motion)?;
        self.fit(frame)?;
        if let Plan::Warp(plan) = &plan {
            let pictures = frame.picture_times_s().len();
            let kind = WarpKind { margin_px: frame.margin_px, lens, bodies: plan.body_count() > 0, pictures };
            self.fit_warp(kind)?.write(index, plan);
        }
        let view = frame.request.view(self.stage.intrinsics);
        let slot = &mut self.slots[index];
        let wanted = frame.delivery.wanted();
        self.finish.fit((&frame.request.settings, &view), wanted, (&mut slot.gpu, slot.index))?;
        self.upload(index, frame)?;
        self.slots[index].start(&frame.request, instants(&frame.request.shutter));
        if let Err(error) = self.record(index, frame, &plan) {
            self.slots[index].cancel();
            return Err(error);
        }
        self.next = (index + 1) % self.slots.len();
        Ok(Ticket { slot: index })
    }

    /// Whether a frame can be collected without waiting.
    ///
    /// # Errors
    /// Device lost.
    pub fn finished(&self, ticket: &Ticket) -> Result<bool> {
        self.slots[ticket.slot].gpu.finished()
    }

    /// Waits for a frame without taking it.
    ///
    /// # Errors
    /// Device lost; not finished within `limit`: then it can be waited for again.
    pub fn wait(&mut self, ticket: &Ticket, limit: Duration) -> Result<()> {
        self.slots[ticket.slot].gpu.wait(limit)
    }

    /// A frame that nobody will collect: its slot is free again once the device is done with it.
    pub fn give_up(&mut self, ticket: &Ticket) {
        self.slots[ticket.slot].cancel();
    }

    /// Waits for a frame and reads it back. Poses in its instants are the identity: this engine knows none.
    ///
    /// # Errors
    /// Device lost, or the time limit passed.
    pub fn collect(&mut self, ticket: Ticket) -> Result<Frame> {
        let slot = &mut self.slots[ticket.slot];
        let times = slot.finish(self.time_limit)?;
        self.kept[ticket.slot] = Kept::default();
        let size = [self.stage.intrinsics.width, self.stage.intrinsics.height];
        Ok(slot.take_frame(size, times, None, &self.finish))
    }

    fn plan(&self, frame: &OutsideFrame<'_>) -> Result<Plan> {
        match &frame.motion {
            OutsideMotion::Images { .. } => Ok(Plan::Gather(None)),
            OutsideMotion::Depth { poses, .. } => Ok(Plan::Gather(Some(self.depth_push(frame, poses)?))),
            OutsideMotion::Path { path, bodies, nearest_m, repeat_border, .. } => {
                let camera = (&self.stage.intrinsics, self.border.as_ref().expect("made by `submit`"));
                let (seen, border) = ((&**path, bodies.as_ref()), (*nearest_m, *repeat_border));
                Ok(Plan::Warp(WarpPlan::new(camera, frame, seen, border)?))
            }
        }
    }

    /// Makes what the warp needs for frames of a kind.
    fn fit_warp(&mut self, kind: WarpKind) -> Result<&mut OutsideWarp> {
        let images = self.images.as_mut().expect("made by `fit`");
        if !images.warp.as_ref().is_some_and(|w| w.fits(&kind)) {
            for slot in &mut self.slots {
                slot.settle(self.time_limit)?;
            }
            // What was bound to the old images goes before them.
            images.groups.forget_warp();
            images.warp = None;
            let to = (&images.color, self.finish.radiance());
            images.warp = Some(OutsideWarp::new(&self.stage, &mut self.slots, kind, to)?);
        }
        Ok(images.warp.as_mut().expect("just made"))
    }

    /// Makes the images for the frame's margin.
    fn fit(&mut self, frame: &OutsideFrame<'_>) -> Result<()> {
        if self.images.as_ref().is_some_and(|i| i.margin_px == frame.margin_px) {
            return Ok(());
        }
        for slot in &mut self.slots {
            slot.settle(self.time_limit)?;
        }
        // The old ones first: both might not fit.
        self.images = None;
        self.images = Some(self.make_images(frame.margin_px)?);
        Ok(())
    }

    fn make_images(&mut self, margin_px: [u32; 2]) -> Result<Images> {
        let context = &self.stage.context;
        let camera = self.stage.intrinsics.with_margin(margin_px);
        let size = [camera.width, camera.height];
        let color = Image::new(context, "outside color", ImageSpec::storage(size, Format::Rgba32f))?;
        let layers =
            ImageSpec { layers: MAX_OUTSIDE_MOTIONS as u32, ..ImageSpec::storage(size, Format::Rg32f) };
        let motion = Image::new(context, "outside motion", layers)?;
        let depth = Image::new(context, "outside depth", ImageSpec::storage(size, Format::R32f))?;
        // A slot that holds a finished frame may be recorded anew: only its buffers are read from now on.
        prepare(&mut self.slots[0].gpu, [&color, &motion, &depth])?;
        let to = Unpacked { color: &color, motion: &motion, depth: &depth, warp: None };
        let groups = Groups::new(&self.kernels, to, self.finish.radiance(), self.slots.len())?;
        Ok(Images { margin_px, groups, color, motion, depth, warp: None })
    }

    /// Copies the caller's host memory into the slot's staging buffers; makes them for images. Shared buffers are read
    /// where they are.
    fn upload(&mut self, slot: usize, frame: &OutsideFrame<'_>) -> Result<()> {
        let camera = self.stage.intrinsics.with_margin(frame.margin_px);
        for (i, pixels) in pictures(frame).into_iter().enumerate() {
            if let PixelSource::Shared(..) = pixels.source {
                continue;
            }
            let row = camera.width as usize * pixels.format.bytes();
            let stride = row.next_multiple_of(4);
            let needed = (stride * camera.height as usize) as u64;
            let staging = &mut self.uploads[slot][i];
            if staging.as_ref().is_none_or(|b| b.bytes() < needed) {
                let made = Buffer::new(
                    &self.stage.context,
                    "outside upload",
                    needed,
                    Usage::Storage,
                    Location::Upload,
                )?;
                *staging = Some(made);
                if let Some(images) = &mut self.images {
                    images.groups.forget(slot, i);
                }
            }
            // Images are copied there by the device.
            let PixelSource::Host(bytes) = pixels.source else { continue };
            let staging = staging.as_mut().expect("just made");
            if stride == pixels.stride_bytes && bytes.len() >= stride * camera.height as usize {
                staging.write(0, &bytes[..stride * camera.height as usize]);
                continue;
            }
            for y in 0..camera.height as usize {
                staging.write(y * stride, &bytes[y * pixels.stride_bytes..][..row]);
            }
        }
        Ok(())
    }

    fn depth_push(&self, frame: &OutsideFrame<'_>, poses: &[(f64, Pose); 2]) -> Result<FromDepthPush> {
        let [(from_s, _), (to_s, _)] = *poses;
        let path = Trajectory::new(
            std::path::Path::new("the two poses of the depth"),
            vec![from_s, to_s],
            poses.iter().map(|p| p.1).collect(),
        )?;
        path.require(frame.color_time_s, frame.color_time_s, &format!("frame {}", frame.request.index))?;
        let now = path.pose_at(frame.color_time_s);
        let camera_from_now = |pose: &Pose| pose.inverse().then_from(&now);
        let camera = self.stage.intrinsics.with_margin(frame.margin_px);
        let (from, to) = (camera_from_now(&poses[0].1), camera_from_now(&poses[1].1));
        // As the engine's own path rounds it, so that equal input gives equal bits.
        let scale = (frame.request.frame_interval_s / (to_s - from_s)) as f32;
        if !scale.is_finite() {
            let value = ((to_s - from_s) * 1e9) as u64;
            let why = "two poses so near in time give no motion".to_owned();
            return Err(Error::Limit { what: "time between the two poses, ns", value, limit: 1, why });
        }
        Ok(FromDepthPush { scale, ..FromDepthPush::new(&camera, 0, 1.0, &from, &to) })
    }

    fn record(&mut self, index: usize, frame: &OutsideFrame<'_>, plan: &Plan) -> Result<()> {
        let camera = self.stage.intrinsics.with_margin(frame.margin_px);
        let size = [camera.width, camera.height];
        let pictures = pictures(frame);
        let Images { groups, color, motion, depth, warp, .. } = self.images.as_mut().expect("made by `fit`");
        let to = Unpacked { color, motion, depth, warp: warp.as_ref() };
        let blurs = frame.request.shutter.exposure_time_s > 0.0;
        let role = |place: usize| Role::of(place, &frame.motion, blurs);
        for (place, pixels) in pictures.iter().enumerate() {
            match role(place).0 {
                Role::Color => self.kernels.fit_color(pixels.format, false)?,
                Role::HalfColor => self.kernels.fit_color(pixels.format, true)?,
                _ => {}
            }
        }
        groups.bind_sources(&self.kernels, index, to, (&pictures, role), &self.uploads[index])?;
        if let Plan::Gather(Some(_)) = plan {
            groups.fit_depth(&self.kernels, to)?;
        }
        if let OutsideMotion::Images { .. } = frame.motion {
            groups.fit_integrated(&self.kernels, to, self.finish.radiance())?;
        }
        let placed: Vec<_> = pictures.iter().map(|p| place(p, size)).collect();
        let slot = &mut self.slots[index];
        let mut recorder = slot.gpu.begin()?;
        recorder.mark("unpack");
        for (pixels, staging) in pictures.iter().zip(&self.uploads[index]) {
            if let (PixelSource::Image(image), Some(staging)) = (pixels.source, staging) {
                recorder.copy_shared_to_buffer(image, staging);
            }
        }
        let motion = MotionPass { kernels: &self.kernels, groups, index, size, placed: &placed };
        motion.record_pictures(&mut recorder, frame, &pictures);
        match (plan, warp) {
            (Plan::Warp(plan), Some(warp)) => {
                warp.record(&mut recorder, index, plan, frame.max_samples);
            }
            (Plan::Warp(_), None) => unreachable!("made by `fit_warp`"),
            (Plan::Gather(from_depth), _) => {
                motion.record(&mut recorder, &frame.motion, *from_depth);
                let push = gather_push(&self.stage.intrinsics, frame);
                let (name, gather, group) = groups.gather_of(&self.kernels, push.motion_count);
                recorder.mark(name);
                recorder.dispatch(gather, group, &push, push.size);
            }
        }
        finish_frame(&self.finish, recorder, frame, (&slot.picture, &slot.radiance));
        self.kept[index] = (frame.delivery.clone(), pictures.iter().filter_map(shared).collect());
        let Delivery { wait, signal, .. } = &frame.delivery;
        slot.gpu.submit_between(wait.as_ref(), signal.as_ref())
    }
}

impl Drop for OutsideEngine {
    fn drop(&mut self) {
        // Slots wait for their work when they are dropped; what the work uses goes after them.
        self.slots.clear();
    }
}

fn finish_frame(
    finish: &Finish,
    mut recorder: Recorder<'_>,
    frame: &OutsideFrame<'_>,
    to: (&Buffer, &Buffer),
) {
    finish.record(&mut recorder, &frame.request, to);
    frame.delivery.record(&mut recorder, to.0);
    recorder.finish();
}

fn instants(shutter: &ShutterTiming) -> FrameInstants {
    let at = |time_s: f64| (time_s, Pose::IDENTITY);
    FrameInstants {
        first_line_start: at(shutter.start_s),
        middle: at(shutter.middle_s()),
        last_line_end: at(shutter.end_s()),
    }
}
