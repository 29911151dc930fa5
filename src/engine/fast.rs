//! `--method fast`: one render and a warp. The picture is rendered at the middle of the frame, with twice the pixels a
//! side where the samples allow; beside it, displacements of every surface point FROM that instant to up to six others of
//! the frame. They are rendered with the geometry at the reference instant, so that each texel holds the path of the very
//! point that the picture shows there: no path is pieced together from chords, and one motion pass gives two of its
//! points. `fast_pass` does the warp, which knows nothing of the scene.
//!
//! What it gets wrong: what the picture does not show (behind a silhouette at the reference instant) is taken from beside
//! it; shading does not change during the frame; silhouettes are as fine as the path images.

use super::Stage;
use super::fast_pass::{FastBinding, FastGather, FastImages, FastTiming};
use super::finish::{Finish, prepare};
use super::frame::FrameRequest;
use super::lens::Channel;
use super::margin::reach_of;
use super::paper::{MARGIN_FACTOR, MARGIN_GUARD_PX, ResolveColorPush, larger};
use super::planes::{Ending, PlanesPass};
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::camera::Trajectory;
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder, RenderArea, Sampler,
};
use crate::kernels::kernel;
use crate::raster::{Instant, RasterInput, RasterKind, RasterTarget, SamplePlan};

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
pub(super) struct Fast {
    images: Images,
    kernels: Kernels,
    options: FastOptions,
}

struct Kernels {
    /// For frames without and with an exposure.
    resolve_color: [ComputePipeline; 2],
    warp: FastGather,
    sampler: Sampler,
    color_scale: u32,
    path_scale: u32,
}

/// Everything whose size depends on the margin.
struct Images {
    margin_px: [u32; 2],
    /// Instants of the picture and of the paths, by slot.
    inputs: Vec<(RasterInput, Vec<RasterInput>)>,
    /// For frames without and with an exposure.
    resolve_color: [BindGroup; 2],
    warp: FastBinding,
    picture: RasterTarget,
    /// Two knots each.
    paths: Vec<RasterTarget>,
    /// The picture for frames without exposure, whose texels are read as they are, and with one, to be filtered.
    color: [Image; 2],
}

impl Fast {
    pub(super) fn new(
        stage: &Stage,
        options: &FastOptions,
        slots: &mut [FrameSlot],
        radiance: &Image,
        expected: &[FrameRequest],
    ) -> Result<Self> {
        let mut options = *options;
        options.motion_images = options.motion_images.clamp(2, 6).next_multiple_of(2);
        let resolve_color = match stage.plan.msaa > 1 {
            true => const { [kernel("resolve_color_ms.comp"), kernel("resolve_color_half_ms.comp")] },
            false => const { [kernel("resolve_color.comp"), kernel("resolve_color_half.comp")] },
        };
        let resolve_color = resolve_color.map(|kernel| ComputePipeline::new(&stage.context, kernel));
        let [exact, half] = resolve_color;
        options.path_scale = options.path_scale.clamp(1, 2);
        let (color_scale, path_scale) = (stage.plan.grid.min(2), options.path_scale);
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let paths = (options.motion_images as usize / 2, path_scale);
        let kernels = Kernels {
            resolve_color: [exact?, half?],
            warp: FastGather::new(&stage.context, size, paths, color_scale)?,
            sampler: Sampler::new(&stage.context, false)?,
            color_scale,
            path_scale,
        };
        let margin_px = expected.iter().map(|r| needed_margin_px(stage, r)).fold([0, 0], larger);
        let images = Images::new(stage, &kernels, paths.0, slots, radiance, margin_px)?;
        Ok(Self { images, kernels, options })
    }

    pub(super) fn margin_px(&self) -> [u32; 2] {
        self.images.margin_px
    }

    /// The margin to grow to, where the frame needs a wider one.
    pub(super) fn needs_wider(&self, stage: &Stage, request: &FrameRequest) -> Option<[u32; 2]> {
        let (needed, have) = (needed_margin_px(stage, request), self.images.margin_px);
        (needed[0] > have[0] || needed[1] > have[1]).then(|| larger(needed, have))
    }

    /// Makes the images anew; nothing must be in flight.
    pub(super) fn widen(
        &mut self,
        stage: &Stage,
        slots: &mut [FrameSlot],
        radiance: &Image,
        margin_px: [u32; 2],
    ) -> Result<()> {
        self.images = Images::new(stage, &self.kernels, self.images.paths.len(), slots, radiance, margin_px)?;
        Ok(())
    }

    pub(super) fn submit(
        &self,
        stage: &Stage,
        slot: &mut FrameSlot,
        request: &FrameRequest,
        path: &Trajectory,
        (finish, planes): (&Finish, Option<&PlanesPass>),
    ) -> Result<()> {
        let camera = stage.intrinsics.with_margin(self.images.margin_px);
        let (timing, knots) = plan(request, self.options.motion_images);
        let row = slot.inputs.add(stage, path, &camera, &Instant::still(timing.reference_s));
        let pair_rows: Vec<_> = knots
            .chunks_exact(2)
            .map(|k| Instant { time_s: timing.reference_s, motion_from_s: k[0], motion_to_s: k[1] })
            .map(|instant| slot.inputs.add(stage, path, &camera, &instant))
            .collect();
        let ending = Ending::new(planes, stage, slot, request, path);
        let index = slot.index;
        let blurs = request.shutter.exposure_time_s > 0.0;
        let mut recorder = slot.gpu.begin()?;
        for channel in stage.channels() {
            self.images.draw_picture(stage, &self.kernels, &mut recorder, index, (row, channel, blurs));
            recorder.mark("motion");
            self.images.draw_paths(stage, &mut recorder, index, (&pair_rows, channel));
            let warp = &self.kernels.warp;
            let (binding, margin_px) = (&self.images.warp, self.images.margin_px);
            warp.record(&mut recorder, binding, margin_px, &timing, self.options.max_samples);
            stage.merge(&mut recorder, channel);
        }
        ending.record(stage, &mut recorder, index, (finish, request, false), (&slot.picture, &slot.radiance));
        recorder.finish();
        slot.gpu.submit()
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
    let timing = FastTiming { shutter, reference_s, knot_step_s, reference_knot, last_knot: motion_images };
    (timing, knots)
}

/// The margin that a frame's motion asks for, px; at most the picture's own size.
fn needed_margin_px(stage: &Stage, request: &FrameRequest) -> [u32; 2] {
    let shutter = &request.shutter;
    if shutter.end_s() <= shutter.start_s || super::frame::check_coverage(stage, request).is_err() {
        return [0, 0];
    }
    let path = super::frame::camera_path(stage, request);
    let quarter_s = 0.25 * (shutter.end_s() - shutter.start_s);
    let times: Vec<_> =
        (0..=4).map(|i| (shutter.start_s + quarter_s * f64::from(i)).min(shutter.end_s())).collect();
    let reach = reach_of(stage, &path, shutter.middle_s(), &times);
    let size = [stage.intrinsics.width, stage.intrinsics.height];
    let needed = reach.beyond_px.map(|px| (px * MARGIN_FACTOR + MARGIN_GUARD_PX).ceil() as u32);
    [needed[0].min(size[0]), needed[1].min(size[1])]
}

impl Images {
    fn new(
        stage: &Stage,
        kernels: &Kernels,
        path_images: usize,
        slots: &mut [FrameSlot],
        radiance: &Image,
        margin_px: [u32; 2],
    ) -> Result<Self> {
        let (context, scene) = (&stage.context, &stage.buffers);
        let camera = stage.intrinsics.with_margin(margin_px);
        let size = [camera.width, camera.height];
        let picture = RasterTarget::new(context, scene, RasterKind::Color, size, stage.plan)?;
        let path_plan = SamplePlan { grid: kernels.path_scale, msaa: 1 };
        let path = |_| RasterTarget::new(context, scene, RasterKind::Path, size, path_plan);
        let paths = (0..path_images).map(path).collect::<Result<Vec<_>>>()?;
        let texels = size.map(|s| s * kernels.color_scale);
        let color = |format| Image::new(context, "color", ImageSpec::storage(texels, format));
        let color = [color(Format::Rgba32f)?, color(Format::Rgba16f)?];
        let images = paths.iter().flat_map(|t| t.attachments.images());
        prepare(&mut slots[0].gpu, picture.attachments.images().chain(images).chain(&color))?;
        let resolve = |blurs: usize| {
            kernels.resolve_color[blurs].bind(&[
                ("color_samples", Bound::Sampled(&picture.attachments.colors()[0], &kernels.sampler)),
                ("color", Bound::Storage(&color[blurs])),
            ])
        };
        let resolve_color = [resolve(0)?, resolve(1)?];
        let warp = kernels.warp.bind(&FastImages {
            color: &color[0],
            filtered: &color[1],
            paths: paths.iter().map(|t| &t.attachments.colors()[0]).collect(),
            inverse_depth: paths[0].attachments.depth(),
            radiance,
        })?;
        let bind = |slot: &FrameSlot| {
            let (instants, cameras) = (&slot.inputs.instants, &slot.inputs.cameras);
            let one = |target: &RasterTarget| target.bind(scene, instants, cameras);
            Ok((one(&picture)?, paths.iter().map(one).collect::<Result<Vec<_>>>()?))
        };
        let inputs = slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        Ok(Self { margin_px, inputs, resolve_color, warp, picture, paths, color })
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
        let input = &self.inputs[slot].0;
        self.picture.draw(recorder, &stage.drawn(channel), input, row, 0.0, self.area());
        recorder.mark("resolve");
        let size = self.color[0].spec().size;
        let grid = (self.picture.plan.grid / kernels.color_scale) as i32;
        let push = ResolveColorPush { size, grid: [grid; 2] };
        let blurs = usize::from(blurs);
        recorder.dispatch(&kernels.resolve_color[blurs], &self.resolve_color[blurs], &push, size);
    }

    /// All path images show the reference instant; each holds the way to two others.
    fn draw_paths(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (rows, channel): (&[(u32, u32)], Channel),
    ) {
        let drawn = stage.drawn(channel);
        for ((target, input), row) in self.paths.iter().zip(&self.inputs[slot].1).zip(rows) {
            target.draw(recorder, &drawn, input, *row, 1.0, self.area());
        }
    }
}
