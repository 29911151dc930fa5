//! Frames from outside: colour with motion, or colour with depth and two poses, through the same gather and the same
//! last passes as the engine's own; or colour with depth and the camera's path, through the warp of `--method fast`.
//! The engine's own planes handed back in give the engine's own picture. What is read and delivered takes part in the
//! one submission of the frame.

mod blend;
pub(crate) mod frame;
mod kernels;
pub(crate) mod lens;
mod motion;
mod warp;

use std::sync::Arc;
use std::time::Duration;

use super::delivery::Delivery;
use super::finish::Finish;
use super::flight::{Flight, Room, Ticket};
use super::frame::{FrameInstants, FrameRequest};
use super::slots::FrameSlot;
use super::source::Source;
use super::{EngineOf, OutsideEngine};
use crate::camera::{Intrinsics, Pose, ShutterTiming, Trajectory};
use crate::effects::Defocus;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Usage};
use crate::reference::motion_from_depth::Push as FromDepthPush;

use frame::{
    MAX_OUTSIDE_MOTIONS, MAX_PLACES, OutsideFrame, OutsideMotion, PixelSource, gather_push, pictures, place,
};
use kernels::{Groups, Kernels, Role, Unpacked};
use lens::{BorderRays, OutsideLens};
use motion::{MotionPass, shared};
use warp::{OutsideWarp, WarpKind, WarpPlan};

/// Frames from outside.
pub struct Outside {
    uploads: Vec<Vec<Option<Buffer>>>,
    images: Option<Images>,
    kernels: Kernels,
    /// Of the last frame that brought a path.
    border: Option<BorderRays>,
    /// How the frame that is being made gets its radiance.
    plan: Option<Plan>,
    intrinsics: Intrinsics,
    context: Arc<Context>,
}

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
        let count = frames_in_flight.clamp(1, 8);
        let flight = Flight::new(context, &intrinsics, (count, 0), time_limit)?;
        let source = Outside {
            uploads: (0..count).map(|_| (0..MAX_PLACES).map(|_| None).collect()).collect(),
            images: None,
            kernels: Kernels::new(context)?,
            border: None,
            plan: None,
            intrinsics,
            context: context.clone(),
        };
        Ok(EngineOf { source, flight })
    }

    /// Records a frame and hands it to the device.
    ///
    /// # Errors
    /// A margin beyond the device's limits; a depth's poses that do not enclose the colour's instant; device lost; out
    /// of memory.
    ///
    /// # Panics
    /// If there is no room, a picture is shorter than its size and stride say, or pictures are not in order of time.
    pub fn submit(&mut self, frame: &OutsideFrame<'_>) -> Result<Ticket> {
        self.send(frame)
    }
}

impl Source for Outside {
    type Frame<'a> = OutsideFrame<'a>;

    fn asked<'f>(frame: &'f OutsideFrame<'_>) -> (&'f FrameRequest, &'f Delivery) {
        (&frame.request, &frame.delivery)
    }

    fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    fn fit(&mut self, frame: &OutsideFrame<'_>, mut room: Room<'_>, index: usize) -> Result<FrameInstants> {
        if Defocus::needs_depth(&frame.request.settings) {
            let what =
                "by distance needs a scene: frames from outside have a fixed sigma_px or disc_radius_px"
                    .to_owned();
            return Err(Error::Contradiction { effect: "defocus", what });
        }
        assert!(frame.picture_times_s().is_sorted(), "pictures in order of time");
        let lens = OutsideLens::of(&frame.request.settings, &self.intrinsics);
        let is_path = matches!(frame.motion, OutsideMotion::Path { .. });
        if is_path && !self.border.as_ref().is_some_and(|b| b.is_of(&self.intrinsics, lens.as_ref())) {
            self.border = Some(BorderRays::new(&self.intrinsics, lens.as_ref())?);
        }
        let plan = self.plan(frame)?;
        self.kernels.fit(&frame.motion)?;
        self.fit_images(frame, &mut room)?;
        if let Plan::Warp(plan) = &plan {
            let pictures = frame.picture_times_s().len();
            let kind = WarpKind { margin_px: frame.margin_px, lens, bodies: plan.body_count() > 0, pictures };
            self.fit_warp(kind, &mut room)?.write(index, plan);
        }
        self.plan = Some(plan);
        Ok(instants(&frame.request.shutter))
    }

    fn submit(
        &mut self,
        frame: &OutsideFrame<'_>,
        slot: &mut FrameSlot,
        finish: &Finish,
        _: Duration,
    ) -> Result<()> {
        self.upload(slot.index, frame)?;
        self.bind(slot.index, frame, finish.radiance())?;
        self.record(slot, frame, finish)
    }
}

impl Outside {
    fn plan(&self, frame: &OutsideFrame<'_>) -> Result<Plan> {
        match &frame.motion {
            OutsideMotion::Images { .. } => Ok(Plan::Gather(None)),
            OutsideMotion::Depth { poses, .. } => Ok(Plan::Gather(Some(self.depth_push(frame, poses)?))),
            OutsideMotion::Path { path, bodies, nearest_m, repeat_border, .. } => {
                let camera = (&self.intrinsics, self.border.as_ref().expect("made by `submit`"));
                let (seen, border) = ((&**path, bodies.as_ref()), (*nearest_m, *repeat_border));
                Ok(Plan::Warp(WarpPlan::new(camera, frame, seen, border)?))
            }
        }
    }

    /// Makes what the warp needs for frames of a kind.
    fn fit_warp(&mut self, kind: WarpKind, room: &mut Room<'_>) -> Result<&mut OutsideWarp> {
        let images = self.images.as_mut().expect("made by `fit_images`");
        if !images.warp.as_ref().is_some_and(|w| w.fits(&kind)) {
            room.settle()?;
            // What was bound to the old images goes before them.
            images.groups.forget_warp();
            images.warp = None;
            images.warp = Some(OutsideWarp::new(&self.intrinsics, room, kind, &images.color)?);
        }
        Ok(images.warp.as_mut().expect("just made"))
    }

    /// Makes the images for the frame's margin.
    fn fit_images(&mut self, frame: &OutsideFrame<'_>, room: &mut Room<'_>) -> Result<()> {
        if self.images.as_ref().is_some_and(|i| i.margin_px == frame.margin_px) {
            return Ok(());
        }
        room.settle()?;
        // The old ones first: both might not fit.
        self.images = None;
        self.images = Some(self.make_images(frame.margin_px, room)?);
        Ok(())
    }

    fn make_images(&self, margin_px: [u32; 2], room: &mut Room<'_>) -> Result<Images> {
        let context = room.context;
        let camera = self.intrinsics.with_margin(margin_px);
        let size = [camera.width, camera.height];
        let color = Image::new(context, "outside color", ImageSpec::storage(size, Format::Rgba32f))?;
        let layers =
            ImageSpec { layers: MAX_OUTSIDE_MOTIONS as u32, ..ImageSpec::storage(size, Format::Rg32f) };
        let motion = Image::new(context, "outside motion", layers)?;
        let depth = Image::new(context, "outside depth", ImageSpec::storage(size, Format::R32f))?;
        // A slot that holds a finished frame may be recorded again: from now on only its buffers are read.
        room.prepare([&color, &motion, &depth])?;
        let to = Unpacked { color: &color, motion: &motion, depth: &depth, warp: None };
        let groups = Groups::new(&self.kernels, to, room.radiance, room.slots.len())?;
        Ok(Images { margin_px, groups, color, motion, depth, warp: None })
    }

    /// Copies the caller's host memory into the slot's staging buffers; makes them for images. Shared buffers are read
    /// where they are.
    fn upload(&mut self, slot: usize, frame: &OutsideFrame<'_>) -> Result<()> {
        let camera = self.intrinsics.with_margin(frame.margin_px);
        for (i, pixels) in pictures(frame).into_iter().enumerate() {
            if let PixelSource::Shared(..) = pixels.source {
                continue;
            }
            let row = camera.width as usize * pixels.format.bytes();
            let stride = row.next_multiple_of(4);
            let needed = (stride * camera.height as usize) as u64;
            let staging = &mut self.uploads[slot][i];
            if staging.as_ref().is_none_or(|b| b.bytes() < needed) {
                let made =
                    Buffer::new(&self.context, "outside upload", needed, Usage::Storage, Location::Upload)?;
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
        let camera = self.intrinsics.with_margin(frame.margin_px);
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

    /// Binds what the frame of a slot is read from.
    fn bind(&mut self, index: usize, frame: &OutsideFrame<'_>, radiance: &Image) -> Result<()> {
        let pictures = pictures(frame);
        let Images { groups, color, motion, depth, warp, .. } =
            self.images.as_mut().expect("made by `fit_images`");
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
        match frame.motion {
            OutsideMotion::Images { .. } => groups.fit_integrated(&self.kernels, to, radiance),
            OutsideMotion::Depth { .. } => groups.fit_depth(&self.kernels, to),
            OutsideMotion::Path { .. } => Ok(()),
        }
    }

    fn record(&mut self, slot: &mut FrameSlot, frame: &OutsideFrame<'_>, finish: &Finish) -> Result<()> {
        let camera = self.intrinsics.with_margin(frame.margin_px);
        let size = [camera.width, camera.height];
        let (index, pictures) = (slot.index, pictures(frame));
        let Images { groups, warp, .. } = self.images.as_ref().expect("made by `fit_images`");
        let placed: Vec<_> = pictures.iter().map(|p| place(p, size)).collect();
        slot.kept = (frame.delivery.clone(), pictures.iter().filter_map(shared).collect());
        let (mut recorder, to) = slot.begin()?;
        recorder.mark("unpack");
        for (pixels, staging) in pictures.iter().zip(&self.uploads[index]) {
            if let (PixelSource::Image(image), Some(staging)) = (pixels.source, staging) {
                recorder.copy_shared_to_buffer(image, staging);
            }
        }
        let motion = MotionPass { kernels: &self.kernels, groups, index, size, placed: &placed };
        motion.record_pictures(&mut recorder, frame, &pictures);
        match (self.plan.as_ref().expect("made by `fit`"), warp) {
            (Plan::Warp(plan), Some(warp)) => {
                warp.record(&mut recorder, index, plan, frame.max_samples);
            }
            (Plan::Warp(_), None) => unreachable!("made by `fit_warp`"),
            (Plan::Gather(from_depth), _) => {
                motion.record(&mut recorder, &frame.motion, *from_depth);
                let push = gather_push(&self.intrinsics, frame);
                let (name, gather, group) = groups.gather_of(&self.kernels, push.motion_count);
                recorder.mark(name);
                recorder.dispatch(gather, group, &push, push.size);
            }
        }
        finish.record(&mut recorder, &frame.request, (to.picture, to.radiance));
        frame.delivery.record(&mut recorder, to.picture);
        recorder.finish();
        let Delivery { wait, signal, .. } = &frame.delivery;
        slot.gpu.submit_between(wait.as_ref(), signal.as_ref())
    }
}

fn instants(shutter: &ShutterTiming) -> FrameInstants {
    let at = |time_s: f64| (time_s, Pose::IDENTITY);
    FrameInstants {
        first_line_start: at(shutter.start_s),
        middle: at(shutter.middle_s()),
        last_line_end: at(shutter.end_s()),
    }
}
