//! `--method fast`: one render and a warp. The picture is rendered at the middle of the frame, with twice the pixels a
//! side where the samples allow; beside it, displacements of every surface point FROM that instant to up to six others
//! of the frame. They follow from the picture's depth (`fast_depth`), or, where something moves by itself, are rendered
//! with the geometry at the reference instant, so that each texel holds the path of the very point that the picture
//! shows there: no path is pieced together from chords, and one motion pass gives two of its points. `fast_pass` does
//! the warp, which knows nothing of the scene.
//!
//! What it gets wrong: what the picture does not show (behind a silhouette at the reference instant) is taken from
//! beside it; shading does not change during the frame; silhouettes are as fine as the path images.

pub(crate) mod depth;
pub(crate) mod pass;

use crate::assert_push_layout;
use crate::camera::{Intrinsics, Trajectory};
use crate::engine::fast::depth::{DepthKernels, DepthPaths, turns_only};
use crate::engine::fast::pass::{FastBinding, FastGather, FastImages, FastKind, FastTiming};
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::lens::Channel;
use crate::engine::scene::margin::{holds, larger, needed_px};
use crate::engine::scene::resolve::{ResolveColorPush, resolve_constants};
use crate::engine::scene::taps::Taps;
use crate::engine::scene::{Choices, Renderer, Shot, Stage};
use crate::engine::slots::FrameSlot;
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder, RenderArea, Sampler,
};
use crate::kernels::kernel;
use crate::raster::{Instant, MotionGroups, RasterInput, RasterKind, RasterTarget, SamplePlan, View};

/// Choices of the method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FastOptions {
    /// Instants beside the reference at which displacements are rendered: 2, 4 or 6.
    pub motion_images: u32,
    /// Texels a px of the displacement images, 1 or 2: how finely silhouettes are known. 2 is worth 0.1 to 0.8 dB
    /// where surfaces pass each other, and costs four times the fragments of the motion passes.
    pub path_scale: u32,
    /// Most samples of the blur; the count follows the path's length.
    pub max_samples: u32,
}

impl Default for FastOptions {
    fn default() -> Self {
        Self { motion_images: 4, path_scale: 2, max_samples: 240 }
    }
}

assert_push_layout!("resolve_color_ms.comp", ResolveColorPush { size, grid });

/// The method.
struct Fast {
    images: Images,
    kernels: Kernels,
    options: FastOptions,
}

struct Kernels {
    /// For frames without and with an exposure.
    resolve_color: [ComputePipeline; 2],
    warp: FastGather,
    /// Where nothing moves by itself.
    resting: Option<DepthKernels>,
    sampler: Sampler,
    color_scale: u32,
    path_scale: u32,
    path_images: usize,
}

/// Everything whose size depends on the margin.
struct Images {
    margin_px: [u32; 2],
    /// The picture's instant, by slot.
    inputs: Vec<RasterInput>,
    /// For frames without and with an exposure.
    resolve_color: [BindGroup; 2],
    picture: RasterTarget,
    /// Where nothing moves by itself.
    resting: Option<DepthPaths>,
    /// Where something does, and for a lens, which bends the ways of what is seen.
    drawn: Option<DrawnPaths>,
    /// The picture for frames without exposure, whose texels are read as they are, and with one, to be filtered.
    color: [Image; 2],
}

/// What a frame in flight knows of its knots.
enum Knots {
    Resting {
        turns: bool,
        timing: FastTiming,
    },
    /// Rows of the instants that are drawn.
    Drawn(Vec<(u32, u32)>),
}

/// Two knots a target; the instants by slot.
struct DrawnPaths {
    targets: Vec<RasterTarget>,
    inputs: Vec<Vec<RasterInput>>,
    warp: FastBinding,
}

impl Choices for FastOptions {
    fn make(
        &self,
        stage: &Stage,
        room: &mut Room<'_>,
        expected: &[FrameRequest],
    ) -> Result<Box<dyn Renderer>> {
        let options = Self {
            motion_images: self.motion_images.clamp(2, 6).next_multiple_of(2),
            path_scale: self.path_scale.clamp(1, 2),
            ..*self
        };
        let kernels = Kernels::new(stage, &options)?;
        let margin_px = expected.iter().map(|r| needed_margin_px(stage, r)).fold([0, 0], larger);
        let images = Images::new(stage, &kernels, room, margin_px)?;
        Ok(Box::new(Fast { images, kernels, options }))
    }
}

/// Around the picture, which is of the middle of the frame.
fn needed_margin_px(stage: &Stage, request: &FrameRequest) -> [u32; 2] {
    needed_px(stage, request, request.shutter.middle_s())
}

impl Kernels {
    fn new(stage: &Stage, options: &FastOptions) -> Result<Self> {
        let resolve_color = match stage.plan.msaa > 1 {
            true => const { [kernel("resolve_color_ms.comp"), kernel("resolve_color_half_ms.comp")] },
            false => const { [kernel("resolve_color.comp"), kernel("resolve_color_half.comp")] },
        };
        let (context, grid) = (&stage.context, stage.plan.grid);
        let of_texel = SamplePlan { grid: grid / grid.min(2), ..stage.plan };
        let constants = resolve_constants(of_texel);
        let [exact, half] =
            resolve_color.map(|kernel| ComputePipeline::specialized(context, kernel, &constants));
        let rests = MotionGroups::new(&stage.scene).count() == 1;
        let (color_scale, path_scale) = (grid.min(2), options.path_scale);
        let path_images = options.motion_images as usize / 2;
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let kind = FastKind::default();
        // Depth is as fine as the picture is.
        let from_depth = (path_images, path_scale.min(grid));
        let resting = || DepthKernels::new(context, size, from_depth, (color_scale, stage.plan.msaa));
        Ok(Self {
            resolve_color: [exact?, half?],
            warp: FastGather::new(context, size, (path_images, path_scale), color_scale, kind)?,
            resting: rests.then(resting).transpose()?,
            sampler: Sampler::new(context, false)?,
            color_scale,
            path_scale,
            path_images,
        })
    }
}

impl Renderer for Fast {
    fn margin_px(&self) -> [u32; 2] {
        self.images.margin_px
    }

    fn fits(&mut self, stage: &Stage, request: &FrameRequest) -> bool {
        let lacks = stage.lens.is_some() && self.images.drawn.is_none();
        !lacks && holds(self.images.margin_px, needed_margin_px(stage, request))
    }

    fn fit(&mut self, stage: &Stage, room: &mut Room<'_>, request: &FrameRequest) -> Result<()> {
        let margin_px = larger(needed_margin_px(stage, request), self.images.margin_px);
        self.images = Images::new(stage, &self.kernels, room, margin_px)?;
        Ok(())
    }

    fn submit(&mut self, mut shot: Shot<'_>) -> Result<()> {
        let (stage, request, index) = (shot.stage, shot.request, shot.slot.index);
        let camera = stage.intrinsics.with_margin(self.images.margin_px);
        let (timing, knots) = plan(request, self.options.motion_images);
        let row = shot.add(&camera, &Instant::still(timing.reference_s));
        let knots = self.images.write_knots(&mut shot, &camera, (&timing, &knots));
        let ending = shot.ending();
        let blurs = request.shutter.exposure_time_s > 0.0;
        shot.submit(&ending, false, |recorder, channel| {
            self.images.draw_picture(stage, &self.kernels, recorder, index, (row, channel, blurs));
            let with = (&timing, self.options.max_samples);
            self.images.record_warp(stage, &self.kernels, recorder, (index, channel), &knots, with);
        })
    }

    /// Colour and inverse depth that the warp reads, where its paths follow from depth.
    fn taps(&self, stage: &Stage, request: &FrameRequest, path: &Trajectory) -> Option<Taps<'_>> {
        let paths = self.images.resting.as_ref().filter(|_| stage.lens.is_none())?;
        let blurs = usize::from(request.shutter.exposure_time_s > 0.0);
        let (_, knots_s) = FastTiming::spaced(request.shutter);
        let turns = turns_only(&stage.intrinsics, path, request.shutter.middle_s(), &knots_s);
        Some(Taps::Warp([&self.images.color[blurs], paths.inverse_depth(turns)], knots_s.to_vec()))
    }
}

/// The reference instant in the middle of the frame, and the times of the other knots, equally spaced over it.
fn plan(request: &FrameRequest, motion_images: u32) -> (FastTiming, Vec<f64>) {
    let shutter = request.shutter;
    let (start_s, end_s, reference_s) = (shutter.start_s, shutter.end_s(), shutter.middle_s());
    let step_s = (end_s - start_s) / f64::from(motion_images);
    let reference_knot = motion_images / 2;
    let time_s = |k: u32| (start_s + step_s * f64::from(k)).min(end_s);
    let knots = (0..=motion_images).filter(|&k| k != reference_knot).map(time_s).collect();
    // A frame without duration has all its knots at once; any step places its only instant at the reference.
    let knot_step_s = if step_s > 0.0 { step_s } else { 1.0 };
    let last_knot = motion_images;
    let pictures_s = [reference_s; 3];
    let timing = FastTiming { shutter, reference_s, knot_step_s, reference_knot, last_knot, pictures_s };
    (timing, knots)
}

impl Images {
    fn new(stage: &Stage, kernels: &Kernels, room: &mut Room<'_>, margin_px: [u32; 2]) -> Result<Self> {
        let (context, scene) = (&stage.context, &stage.buffers);
        let camera = stage.intrinsics.with_margin(margin_px);
        let size = [camera.width, camera.height];
        let picture = RasterTarget::new(context, scene, RasterKind::Color, size, stage.plan)?;
        let texels = size.map(|s| s * kernels.color_scale);
        let color = |format| Image::new(context, "color", ImageSpec::storage(texels, format));
        let color = [color(Format::Rgba32f)?, color(Format::Rgba16f)?];
        room.prepare(picture.attachments.images().chain(&color))?;
        let resolve = |blurs: usize| {
            kernels.resolve_color[blurs].bind(&[
                ("color_samples", Bound::Sampled(&picture.attachments.colors()[0], &kernels.sampler)),
                ("color", Bound::Storage(&color[blurs])),
            ])
        };
        let resolve_color = [resolve(0)?, resolve(1)?];
        let resting = kernels.resting.as_ref().map(|k| DepthPaths::new(k, room, &picture, &color));
        let resting = resting.transpose()?;
        let drawn = (resting.is_none() || stage.lens.is_some())
            .then(|| DrawnPaths::new(stage, kernels, room, size, &color))
            .transpose()?;
        let inputs = room.slots.iter().map(|s| picture.bind(scene, &s.inputs.instants, &s.inputs.cameras));
        let inputs = inputs.collect::<Result<Vec<_>>>()?;
        Ok(Self { margin_px, inputs, resolve_color, picture, resting, drawn, color })
    }

    /// Says when the knots of a frame are: whether the camera only turns, or the rows of drawn paths.
    fn write_knots(
        &mut self,
        shot: &mut Shot<'_>,
        camera: &Intrinsics,
        (timing, knots_s): (&FastTiming, &[f64]),
    ) -> Knots {
        let (stage, reference_s) = (shot.stage, timing.reference_s);
        if let Some(paths) = self.resting.as_mut().filter(|_| stage.lens.is_none()) {
            let (timing, knots_s) = FastTiming::spaced(timing.shutter);
            paths.write(shot.slot.index, &View { camera, path: shot.path }, reference_s, &knots_s);
            let turns = turns_only(&stage.intrinsics, shot.path, reference_s, &knots_s);
            return Knots::Resting { turns, timing };
        }
        let rows = knots_s.chunks_exact(2).map(|k| {
            let instant = Instant { time_s: reference_s, motion_from_s: k[0], motion_to_s: k[1] };
            shot.add(camera, &instant)
        });
        Knots::Drawn(rows.collect())
    }

    /// Draws the paths of a frame where they are not known from depth, and warps the picture along them.
    fn record_warp(
        &self,
        stage: &Stage,
        kernels: &Kernels,
        recorder: &mut Recorder<'_>,
        (slot, channel): (usize, Channel),
        knots: &Knots,
        with: (&FastTiming, u32),
    ) {
        match (knots, &self.resting, &kernels.resting, &self.drawn) {
            (Knots::Resting { turns, timing }, Some(paths), Some(kernels), _) => {
                paths.record(kernels, recorder, (slot, *turns), self.margin_px, (timing, with.1));
            }
            (Knots::Drawn(rows), .., Some(paths)) => {
                recorder.mark("motion");
                paths.draw(stage, recorder, slot, (rows, channel), self.area());
                kernels.warp.record(recorder, &paths.warp, self.margin_px, with.0, with.1);
            }
            _ => unreachable!("the images of this kind of frame were made"),
        }
    }

    fn area(&self) -> RenderArea {
        let [width, height] = self.picture.size;
        RenderArea { x: 0, y: 0, width, height }
    }

    fn draw_picture(
        &self,
        stage: &Stage,
        kernels: &Kernels,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (row, channel, blurs): ((u32, u32), Channel, bool),
    ) {
        recorder.mark("raster");
        let input = &self.inputs[slot];
        self.picture.draw(recorder, &stage.drawn(channel), input, row, 0.0, self.area());
        recorder.mark("resolve");
        let size = self.color[0].spec().size;
        let grid = (self.picture.plan.grid / kernels.color_scale) as i32;
        let push = ResolveColorPush { size, grid: [grid; 2] };
        let blurs = usize::from(blurs);
        recorder.dispatch(&kernels.resolve_color[blurs], &self.resolve_color[blurs], &push, size);
    }
}

impl DrawnPaths {
    fn new(
        stage: &Stage,
        kernels: &Kernels,
        room: &mut Room<'_>,
        size: [u32; 2],
        color: &[Image; 2],
    ) -> Result<Self> {
        let scene = &stage.buffers;
        let plan = SamplePlan { grid: kernels.path_scale, msaa: 1 };
        let target = |_| RasterTarget::new(&stage.context, scene, RasterKind::Path, size, plan);
        let targets = (0..kernels.path_images).map(target).collect::<Result<Vec<_>>>()?;
        room.prepare(targets.iter().flat_map(|t| t.attachments.images()))?;
        let bind = |slot: &FrameSlot| {
            let one = |t: &RasterTarget| t.bind(scene, &slot.inputs.instants, &slot.inputs.cameras);
            targets.iter().map(one).collect::<Result<Vec<_>>>()
        };
        let inputs = room.slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        let warp = kernels.warp.bind(&FastImages {
            color: &color[0],
            filtered: &color[1],
            paths: targets.iter().map(|t| &t.attachments.colors()[0]).collect(),
            moved: None,
            inverse_depth: targets[0].attachments.depth(),
            lens: None,
            radiance: room.radiance,
        })?;
        Ok(Self { targets, inputs, warp })
    }

    /// All path images show the reference instant; each holds the way to two others.
    fn draw(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (rows, channel): (&[(u32, u32)], Channel),
        area: RenderArea,
    ) {
        let drawn = stage.drawn(channel);
        for ((target, input), row) in self.targets.iter().zip(&self.inputs[slot]).zip(rows) {
            target.draw(recorder, &drawn, input, *row, 1.0, area);
        }
    }
}
