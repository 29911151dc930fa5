//! `--method paper`: the paper's section 3 as published, in seconds. One picture at a reference instant, up to six
//! motion images over the frame's interval, remap (eq. 4 to 7) and blur as one gather. Twins:
//! `reference/paper_gather.rs`, `reference/motion_from_depth.rs`.
//!
//! What it gets wrong, by construction: one motion vector a pixel is read at the destination, so silhouettes tear;
//! motion is a difference of the past (eq. 3), so acceleration lags; what no picture saw is invented.

mod fast;
pub(crate) mod gather;
pub(crate) mod kernels;
mod plan;

use crate::assert_push_layout;
use crate::camera::{Intrinsics, Trajectory};
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::paper::fast::PaperFast;
use crate::engine::paper::gather::choose_gather;
use crate::engine::paper::kernels::{Gather, GatherKernel};
use crate::engine::paper::plan::{Plan, picture_kind, plan, reference_s};
use crate::engine::scene::lens::Channel;
use crate::engine::scene::margin::{holds, larger, needed_px};
use crate::engine::scene::resolve::{ResolveColorPush, ResolveMotion, resolve_constants};
use crate::engine::scene::taps::{GatherTimes, Taps};
use crate::engine::scene::{Choices, Renderer, Shot, Stage};
use crate::engine::slots::FrameSlot;
use crate::error::{Error, Result};
use crate::gpu::{
    BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder, RenderArea, Sampler,
};
use crate::kernels::kernel;
use crate::raster::{Instant, RasterInput, RasterKind, RasterTarget, SamplePlan};
use crate::reference::motion_from_depth::Push as DepthPush;
use crate::reference::paper_gather::{Push as GatherPush, assert_gather_push};

/// Most motion images kept for a frame (the paper's section 3).
pub const MAX_MOTION_IMAGES: u32 = 6;
/// Which instant of the frame the picture is rendered at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shift {
    /// The frame's start: eq. 7 with f.
    Start,
    /// Its middle: f - 0.5 (section 3.2), which halves the longest displacement.
    #[default]
    Middle,
}

/// Where motion images come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum MotionSource {
    /// Rasterized: projections of every surface point at two times (eq. 3); knows objects that move.
    #[default]
    Rasterized,
    /// Reconstructed from depth and two camera matrices: knows the camera's motion only.
    Depth,
}

/// The paper's choices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperOptions {
    /// Motion images, 1 (constant velocity) to 6.
    pub motion_images: u32,
    /// Reference instant.
    pub shift: Shift,
    /// Most samples of the blur; the count follows the path's length.
    pub max_samples: u32,
    /// Whether the place in the line counts in the pixel's time (eq. 5) or not (eq. 6).
    pub pixel_time: bool,
    /// Where motion comes from.
    pub motion_source: MotionSource,
    /// What the gather may give up for speed.
    pub gather: Gather,
    /// Its kernel; `None`: the fastest on the device, by measurement. Of the exact gather there is one.
    pub gather_kernel: Option<GatherKernel>,
}

impl Default for PaperOptions {
    fn default() -> Self {
        Self {
            motion_images: 2,
            shift: Shift::Middle,
            max_samples: 240,
            pixel_time: false,
            motion_source: MotionSource::Rasterized,
            gather: Gather::Exact,
            gather_kernel: None,
        }
    }
}

assert_gather_push!("paper_gather.comp");

assert_push_layout!(
    "motion_from_depth.comp",
    DepthPush {
        size,
        layer,
        scale,
        intrinsics,
        from_row_0,
        from_row_1,
        from_row_2,
        to_row_0,
        to_row_1,
        to_row_2
    }
);

/// One sample a pixel: of motion.
const PLAIN: SamplePlan = SamplePlan { grid: 1, msaa: 1 };

/// The method.
struct Paper {
    images: Images,
    kernels: Kernels,
    /// The gather, if it is not the exact one.
    fast: Option<PaperFast>,
    options: PaperOptions,
}

struct Kernels {
    resolve_color: ComputePipeline,
    resolve_motion: ResolveMotion,
    resolve_motion_plain: ResolveMotion,
    motion_from_depth: ComputePipeline,
    gather: ComputePipeline,
    sampler: Sampler,
}

/// Everything whose size depends on the margin.
struct Images {
    margin_px: [u32; 2],
    inputs: Vec<[RasterInput; 2]>,
    groups: Groups,
    /// Colour, with the motion of the same instant if that is wanted.
    picture: RasterTarget,
    /// Motion of the other instants, one sample a pixel.
    motion_only: RasterTarget,
    color: Image,
    /// Motion and depth: bound by the groups, kept alive here.
    bound: [Image; 2],
}

struct Groups {
    resolve_color: BindGroup,
    resolve_picture_motion: BindGroup,
    resolve_motion: BindGroup,
    motion_from_depth: BindGroup,
    gather: BindGroup,
}

impl Choices for PaperOptions {
    fn make(
        &self,
        stage: &Stage,
        room: &mut Room<'_>,
        expected: &[FrameRequest],
    ) -> Result<Box<dyn Renderer>> {
        let options = Self { motion_images: self.motion_images.clamp(1, MAX_MOTION_IMAGES), ..*self };
        let kernels = Kernels::new(stage, &options)?;
        let needed = |r: &FrameRequest| needed_px(stage, r, reference_s(&options, &r.shutter));
        let margin_px = expected.iter().map(needed).fold([0, 0], larger);
        let images = Images::new(stage, &kernels, room, (&options, margin_px))?;
        let context = &stage.context;
        let fast = match (options.gather, options.gather_kernel) {
            (Gather::Exact, _) => None,
            (_, Some(kernel)) => Some(PaperFast::new(context, kernel)?),
            (gather, None) => Some(PaperFast::new(context, choose_gather(context, gather, None)?.kernel)?),
        };
        Ok(Box::new(Paper { images, kernels, fast, options }))
    }

    fn check_lens(&self) -> Result<()> {
        match self.motion_source {
            MotionSource::Rasterized => Ok(()),
            MotionSource::Depth => Err(Error::Contradiction {
                effect: "lens_distortion",
                what: "motion from depth (the paper's reconstruction) knows only the ideal pinhole; use rasterized \
                    motion"
                    .to_owned(),
            }),
        }
    }
}

impl Kernels {
    fn new(stage: &Stage, options: &PaperOptions) -> Result<Self> {
        let resolve_color = match (options.gather == Gather::Exact, stage.plan.msaa > 1) {
            (true, true) => const { kernel("resolve_color_ms.comp") },
            (true, false) => const { kernel("resolve_color.comp") },
            (false, true) => const { kernel("resolve_color_half_ms.comp") },
            (false, false) => const { kernel("resolve_color_half.comp") },
        };
        let context = &stage.context;
        let constants = resolve_constants(stage.plan);
        Ok(Self {
            resolve_color: ComputePipeline::specialized(context, resolve_color, &constants)?,
            resolve_motion: ResolveMotion::new(stage, stage.plan)?,
            resolve_motion_plain: ResolveMotion::new(stage, PLAIN)?,
            motion_from_depth: ComputePipeline::new(context, const { kernel("motion_from_depth.comp") })?,
            gather: ComputePipeline::new(context, const { kernel("paper_gather.comp") })?,
            sampler: Sampler::new(context, false)?,
        })
    }
}

/// A frame's instants, and where their rows are.
struct Rows {
    plan: Plan,
    /// Which motion image is drawn with the picture.
    in_picture: Option<usize>,
    picture: (u32, u32),
    /// Of the motion images that are drawn by themselves.
    motions: Vec<Option<(u32, u32)>>,
}

impl Renderer for Paper {
    fn margin_px(&self) -> [u32; 2] {
        self.images.margin_px
    }

    fn fits(&mut self, stage: &Stage, request: &FrameRequest) -> bool {
        holds(self.images.margin_px, self.needed_margin_px(stage, request))
    }

    fn fit(&mut self, stage: &Stage, room: &mut Room<'_>, request: &FrameRequest) -> Result<()> {
        let margin_px = larger(self.needed_margin_px(stage, request), self.images.margin_px);
        self.images = Images::new(stage, &self.kernels, room, (&self.options, margin_px))?;
        if let Some(fast) = &mut self.fast {
            fast.forget();
        }
        Ok(())
    }

    fn submit(&mut self, mut shot: Shot<'_>) -> Result<()> {
        let (stage, request, path) = (shot.stage, shot.request, shot.path);
        let camera = stage.intrinsics.with_margin(self.images.margin_px);
        let rows = self.write_rows(&mut shot, &camera);
        let ending = shot.ending();
        let index = shot.slot.index;
        let push = self.gather_push(stage, request, &rows.plan);
        // One kernel can do gather and chain where nothing else is done to the radiance or asks for it.
        let fuse = stage.channels().len() == 1 && !request.statistics && !ending.needs_depth();
        let images = [&self.images.color, &self.images.bound[0]];
        let fast = self.fast.as_mut();
        let fitted = fast.map(|f| f.fit(images, shot.finish, push.motion_count, fuse)).transpose()?;
        let developed = fitted.as_ref().is_some_and(|f| f.develops());
        shot.submit(&ending, developed, |recorder, channel| {
            let scale = rows.in_picture.map_or(0.0, |k| rows.plan.motions[k].1);
            self.images.draw_picture(stage, &self.kernels, recorder, index, (rows.picture, channel), scale);
            recorder.mark("motion");
            self.record_motion(stage, recorder, (index, channel), &rows, (&camera, path));
            recorder.mark("paper_gather");
            match (&self.fast, &fitted) {
                (Some(fast), Some(fitted)) => {
                    fast.record(recorder, fitted, index, &push, (request.index, request.seed));
                }
                _ => recorder.dispatch(&self.kernels.gather, &self.images.groups.gather, &push, push.size),
            }
        })
    }

    /// What the gather reads: colour, motion, and the depth of the motion image drawn last.
    fn taps(&self, stage: &Stage, request: &FrameRequest, path: &Trajectory) -> Option<Taps<'_>> {
        let Plan { reference_s, first_motion_s, step_s, motions } = plan(stage, &self.options, request, path);
        let times = GatherTimes { reference_s, first_motion_s, step_s, count: motions.len() };
        let [motion, depth] = &self.images.bound;
        Some(Taps::Gather([&self.images.color, motion, depth], times))
    }
}

impl Paper {
    fn needed_margin_px(&self, stage: &Stage, request: &FrameRequest) -> [u32; 2] {
        needed_px(stage, request, reference_s(&self.options, &request.shutter))
    }

    fn write_rows(&self, shot: &mut Shot<'_>, camera: &Intrinsics) -> Rows {
        let plan = plan(shot.stage, &self.options, shot.request, shot.path);
        // A still frame's motion coincides with a picture that may have been made to hold none.
        let holds_motion = self.images.picture.kind == RasterKind::ColorMotion;
        let in_picture = plan.motions.iter().position(|(i, _)| holds_motion && i.time_s == plan.reference_s);
        let picture = in_picture.map_or(Instant::still(plan.reference_s), |k| plan.motions[k].0);
        let picture = shot.add(camera, &picture);
        let from_depth = self.options.motion_source == MotionSource::Depth;
        let row = |(k, (instant, _)): (usize, &(Instant, f64))| {
            (Some(k) != in_picture || from_depth).then(|| shot.add(camera, instant))
        };
        let motions = plan.motions.iter().enumerate().map(row).collect();
        Rows { plan, in_picture, picture, motions }
    }

    /// All motion images of a frame.
    fn record_motion(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        (slot, channel): (usize, Channel),
        rows: &Rows,
        (camera, path): (&Intrinsics, &Trajectory),
    ) {
        let rasterized = self.options.motion_source == MotionSource::Rasterized;
        if let Some(layer) = rows.in_picture.filter(|_| rasterized) {
            let (pass, group) = (&self.kernels.resolve_motion, &self.images.groups.resolve_picture_motion);
            pass.record(recorder, group, &self.images.picture, layer as u32);
        }
        for (layer, (row, (instant, scale))) in rows.motions.iter().zip(&rows.plan.motions).enumerate() {
            let Some(row) = row else { continue };
            let to = (layer as u32, *scale);
            self.images.draw_motion(stage, &self.kernels, recorder, slot, (*row, channel), to);
            if !rasterized {
                let push = depth_push(camera, path, instant, to.0, *scale);
                let group = &self.images.groups.motion_from_depth;
                recorder.dispatch(&self.kernels.motion_from_depth, group, &push, push.size);
            }
        }
    }

    fn gather_push(&self, stage: &Stage, request: &FrameRequest, plan: &Plan) -> GatherPush {
        let shutter = &request.shutter;
        GatherPush {
            size: [stage.intrinsics.width, stage.intrinsics.height],
            margin_px: self.images.margin_px.map(|m| m as i32),
            start_s: (shutter.start_s - plan.reference_s) as f32,
            readout_time_s: shutter.readout_time_s as f32,
            exposure_time_s: shutter.exposure_time_s as f32,
            frame_interval_s: request.frame_interval_s as f32,
            first_motion_s: (plan.first_motion_s - plan.reference_s) as f32,
            motion_step_s: plan.step_s as f32,
            motion_count: plan.motions.len() as u32,
            scan_order: shutter.scan_order as u32,
            max_samples: self.options.max_samples.max(1),
            pixel_time: self.options.pixel_time.into(),
        }
    }
}

/// The reconstruction method's matrices: where the camera was and will be, from where it is.
fn depth_push(
    camera: &Intrinsics,
    path: &Trajectory,
    instant: &Instant,
    layer: u32,
    scale: f64,
) -> DepthPush {
    let now = path.pose_at(instant.time_s);
    let camera_from_now = |time_s: f64| path.pose_at(time_s).inverse().then_from(&now);
    let (from, to) = (camera_from_now(instant.motion_from_s), camera_from_now(instant.motion_to_s));
    DepthPush { scale: scale as f32, ..DepthPush::new(camera, layer, 1.0, &from, &to) }
}

impl Images {
    fn new(
        stage: &Stage,
        kernels: &Kernels,
        room: &mut Room<'_>,
        (options, margin_px): (&PaperOptions, [u32; 2]),
    ) -> Result<Self> {
        let (context, scene) = (&stage.context, &stage.buffers);
        let size = [0, 1].map(|i| [stage.intrinsics.width, stage.intrinsics.height][i] + 2 * margin_px[i]);
        let picture = RasterTarget::new(context, scene, picture_kind(options), size, stage.plan)?;
        let motion_only = RasterTarget::new(context, scene, RasterKind::Motion, size, PLAIN)?;
        // Floats: a frame without motion is the still picture bit for bit, which half floats would round once more.
        let format = if options.gather == Gather::Exact { Format::Rgba32f } else { Format::Rgba16f };
        let color = Image::new(context, "color", ImageSpec::storage(size, format))?;
        let layers = ImageSpec { layers: MAX_MOTION_IMAGES, ..ImageSpec::storage(size, Format::Rg32f) };
        let motion = Image::new(context, "motion", layers)?;
        let depth = Image::new(context, "depth", ImageSpec::storage(size, Format::R32f))?;
        let all = picture.attachments.images().chain(motion_only.attachments.images());
        room.prepare(all.chain([&color, &motion, &depth]))?;
        let groups = Groups {
            resolve_color: kernels.resolve_color.bind(&[
                ("color_samples", Bound::Sampled(&picture.attachments.colors()[0], &kernels.sampler)),
                ("color", Bound::Storage(&color)),
            ])?,
            resolve_picture_motion: kernels.resolve_motion.bind(&picture, &motion, &depth)?,
            resolve_motion: kernels.resolve_motion_plain.bind(&motion_only, &motion, &depth)?,
            motion_from_depth: kernels
                .motion_from_depth
                .bind(&[("depth", Bound::Storage(&depth)), ("motion", Bound::Storage(&motion))])?,
            gather: kernels.gather.bind(&[
                ("color", Bound::Sampled(&color, &kernels.sampler)),
                ("motion", Bound::Storage(&motion)),
                ("radiance", Bound::Storage(room.radiance)),
            ])?,
        };
        let bind = |slot: &FrameSlot| {
            let (instants, cameras) = (&slot.inputs.instants, &slot.inputs.cameras);
            Ok([picture.bind(scene, instants, cameras)?, motion_only.bind(scene, instants, cameras)?])
        };
        let inputs = room.slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        Ok(Self { margin_px, inputs, groups, picture, motion_only, color, bound: [motion, depth] })
    }

    fn area(&self) -> RenderArea {
        let [width, height] = self.color.spec().size;
        RenderArea { x: 0, y: 0, width, height }
    }

    fn draw_picture(
        &self,
        stage: &Stage,
        kernels: &Kernels,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (row, channel): ((u32, u32), Channel),
        scale: f64,
    ) {
        recorder.mark("raster");
        self.picture.draw(recorder, &stage.drawn(channel), &self.inputs[slot][0], row, scale, self.area());
        recorder.mark("resolve");
        let size = self.picture.size;
        let push = ResolveColorPush { size, grid: [self.picture.plan.grid as i32; 2] };
        recorder.dispatch(&kernels.resolve_color, &self.groups.resolve_color, &push, size);
    }

    fn draw_motion(
        &self,
        stage: &Stage,
        kernels: &Kernels,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (row, channel): ((u32, u32), Channel),
        (layer, scale): (u32, f64),
    ) {
        let input = &self.inputs[slot][1];
        self.motion_only.draw(recorder, &stage.drawn(channel), input, row, scale, self.area());
        kernels.resolve_motion_plain.record(recorder, &self.groups.resolve_motion, &self.motion_only, layer);
    }
}
