//! The warp of `--method fast` on its own: it takes a picture, the paths of what it shows and their depth, wherever
//! these come from (a renderer's, or frames from outside), and writes radiance. Twins: `reference/fast_seeds.rs`,
//! `reference/fast_gather.rs`.

use std::sync::Arc;

use crate::assert_push_layout;
use crate::camera::{ScanOrder, ShutterTiming};
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Image, Location, Recorder, Sampler, Usage,
};
use crate::kernels::kernel;
use crate::reference::fast_push::Push;

/// Push constants, the same for all three kernels.
macro_rules! assert_push_of {
    ($($file:literal),+) => {
        $(assert_push_layout!(
            $file,
            Push {
                size,
                margin_px,
                start_s,
                readout_time_s,
                exposure_time_s,
                knot_step_s,
                reference_knot,
                last_knot,
                scan_order,
                max_samples,
                slots,
                picture_s,
                from_s,
                to_s,
                first
            }
        );)+
    };
}
assert_push_of!("fast_seeds.comp", "fast_gather.comp", "fast_silhouettes.comp");

/// Most path images: two knots each.
pub const MAX_PATH_IMAGES: usize = 3;
/// Where paths follow from depth: steps between the knots of a frame, so many that the matrices of two are linear
/// between them. A camera that shakes at 60 Hz is then where it is within a thousandth of its way over 50 ms.
pub const MOVED_STEPS: u32 = 64;
/// Bytes of the matrices of one body over a frame: three rows a knot.
pub const MOVED_BYTES: u64 = (MOVED_STEPS as u64 + 1) * 3 * 16;

/// The images of one warp. All but `radiance` cover the picture and `margin_px` more on every side.
pub struct FastImages<'a> {
    /// Linear radiance at the reference instant; `color_scale` texels a px. Frames without exposure read it texel by
    /// texel.
    pub color: &'a Image,
    /// The same picture for frames with an exposure, which read between texels: its format must be one that the device
    /// filters (four half floats always are). May be `color`.
    pub filtered: &'a Image,
    /// One to three images of four floats, `path_scale` texels a px: the displacements (px, from the reference instant)
    /// of what is seen there to two other instants (first two and last two channels). All instants, in order of time
    /// and without the reference instant, are equally spaced knots when the reference instant is put back in its place.
    /// None where the warp was made for paths from depth.
    pub paths: Vec<&'a Image>,
    /// Where the warp was made for paths from depth: a buffer of texels, rows x, y and w of the matrices that take
    /// `(ndc x, ndc y, inverse depth, 1)` at the reference instant to clip space at each of [`MOVED_STEPS`] + 1 knots,
    /// those of one body after the other.
    pub moved: Option<&'a Buffer>,
    /// One float, `path_scale` texels a px: grows towards the camera (near distance over distance), 0 infinitely far.
    /// With bodies two floats; the second is the number of the body.
    pub inverse_depth: &'a Image,
    /// Where the warp was made for a lens: where each pixel of the result looks (px of the picture, margin included),
    /// and where the lens shows each pixel of the picture (px of the result); two floats each.
    pub lens: Option<[&'a Image; 2]>,
    /// Where the result goes, four floats: linear RGB and the number of samples, negative where one left the picture.
    pub radiance: &'a Image,
}

/// When lines are exposed and where the knots lie, all relative to the reference instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FastTiming {
    /// The shutter; `start_s` on any clock.
    pub shutter: ShutterTiming,
    /// The reference instant on the same clock, s.
    pub reference_s: f64,
    /// Time from one knot to the next, s.
    pub knot_step_s: f64,
    /// Which knot is the reference instant.
    pub reference_knot: u32,
    /// Number of knots less one.
    pub last_knot: u32,
    /// When the picture was rendered, and those before and after it, on the same clock, s; where there are several.
    pub pictures_s: [f64; 3],
}

/// Where there is no picture before, and none after, s from the frame's start.
pub const NO_PICTURE_S: f64 = 1e9;

/// Kernels and claims of the warp.
pub struct FastGather {
    seeds: ComputePipeline,
    /// Without and with blur.
    gather: [ComputePipeline; 2],
    silhouettes: [ComputePipeline; 2],
    claims: Buffer,
    /// Stands where texels of claims would, on a device that has fewer texels than pixels.
    no_claims: Buffer,
    /// Pixels that see several surfaces, after the size of the dispatch that handles them and their number.
    listed: Buffer,
    sampler: Sampler,
    /// Linear, in shares of the picture.
    between: Sampler,
    kind: FastKind,
    /// Stands where matrices would.
    unmoved: Buffer,
    size: [u32; 2],
}

/// The images of a warp, bound.
pub struct FastBinding {
    seeds: BindGroup,
    gather: [BindGroup; 2],
    silhouettes: [BindGroup; 2],
}

/// What a warp may rely on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FastKind {
    /// Nothing in the picture moves against what is beside it, as before a camera that only turns: pixels then need no
    /// claims, and no silhouettes are looked for.
    pub one_surface: bool,
    /// All that is seen moves rigidly: there are no path images, as displacements follow from depth and matrices.
    pub from_depth: bool,
    /// There is more than one body, and the depth says which is seen where.
    pub bodies: bool,
    /// The picture was rendered without the lens.
    pub lens: bool,
    /// The picture is one of several of a frame: results hold what they are worth instead of their number of samples.
    pub one_of_several: bool,
}

impl FastGather {
    /// A warp that delivers `size` px from pictures of `color_scale` (1 or 2) and path images of `path_scale` texels a
    /// px.
    ///
    /// # Errors
    /// Out of memory.
    ///
    /// # Panics
    /// If there are no path images, or more than three; another colour scale than 1 or 2.
    pub fn new(
        context: &Arc<Context>,
        size: [u32; 2],
        (path_images, path_scale): (usize, u32),
        color_scale: u32,
        kind: FastKind,
    ) -> Result<Self> {
        assert!((1..=MAX_PATH_IMAGES).contains(&path_images), "{path_images} path images");
        assert!([1, 2].contains(&color_scale) && path_scale > 0, "a colour scale of {color_scale}");
        let FastKind { one_surface, from_depth, bodies, lens, one_of_several } = kind;
        let pixels = if one_surface { 0 } else { u64::from(size[0]) * u64::from(size[1]) };
        let buffer = |name: &str, words: u64, usage: Usage| {
            Buffer::new(context, name, 4 * words, usage, Location::Device)
        };
        // One claim a pixel at each of up to three moments of the exposure, and one word that is not used.
        let claims = buffer("fast claims", 4 * pixels, Usage::StorageTexels)?;
        let blurring = |kernel, blur: u32| {
            let texels = claims.has_texels();
            let own = [one_surface, from_depth, texels, bodies, lens, one_of_several].map(u32::from);
            let flags = [&[blur][..], &own].concat();
            let scales = [path_images as u32, path_scale, color_scale];
            ComputePipeline::specialized(context, kernel, &[&scales[..], &flags[..]].concat())
        };
        let both = |kernel| -> Result<_> { Ok([blurring(kernel, 0)?, blurring(kernel, 1)?]) };
        Ok(Self {
            seeds: blurring(const { kernel("fast_seeds.comp") }, 0)?,
            gather: both(const { kernel("fast_gather.comp") })?,
            silhouettes: both(const { kernel("fast_silhouettes.comp") })?,
            no_claims: buffer("no claims", 4, Usage::Texels)?,
            listed: buffer("fast silhouettes", 4 + pixels, Usage::Storage)?,
            claims,
            kind,
            unmoved: Buffer::new(context, "fast moved", MOVED_BYTES, Usage::Texels, Location::Device)?,
            sampler: Sampler::new(context, false)?,
            between: Sampler::in_shares(context)?,
            size,
        })
    }

    /// Binds the images of a warp.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, images: &FastImages<'_>) -> Result<FastBinding> {
        let sampled = |image| Bound::Sampled(image, &self.sampler);
        // Images that do not exist are never read; the set still wants something there.
        let first = images.paths.first().copied().unwrap_or(images.inverse_depth);
        let lens = images.lens.unwrap_or([images.inverse_depth; 2]);
        let path = |k: usize| sampled(images.paths.get(k).copied().unwrap_or(first));
        let bind = |pipeline: &ComputePipeline, color: &Image, sampler: &Sampler| {
            pipeline.bind(&[
                ("Seeds", Bound::Buffer(&self.claims)),
                (
                    "claims",
                    Bound::Buffer(if self.claims.has_texels() { &self.claims } else { &self.no_claims }),
                ),
                ("ClaimWords", Bound::Buffer(&self.claims)),
                ("listed", Bound::Buffer(&self.listed)),
                ("moved", Bound::Buffer(images.moved.unwrap_or(&self.unmoved))),
                ("path_0", path(0)),
                ("path_1", path(1)),
                ("path_2", path(2)),
                ("inverse_depth", sampled(images.inverse_depth)),
                ("color", Bound::Sampled(color, sampler)),
                ("radiance", Bound::Storage(images.radiance)),
                ("ideal", sampled(lens[0])),
                ("sensed", sampled(lens[1])),
            ])
        };
        let blurring = |[sharp, blur]: &[ComputePipeline; 2]| -> Result<_> {
            let sharp = bind(sharp, images.color, &self.sampler)?;
            Ok([sharp, bind(blur, images.filtered, &self.between)?])
        };
        Ok(FastBinding {
            seeds: bind(&self.seeds, images.color, &self.sampler)?,
            gather: blurring(&self.gather)?,
            silhouettes: blurring(&self.silhouettes)?,
        })
    }

    /// Records the warp: claims, the gather, and the pixels at silhouettes.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        binding: &FastBinding,
        margin_px: [u32; 2],
        timing: &FastTiming,
        max_samples: u32,
    ) {
        let push = timing.push(self.size, margin_px, max_samples);
        let blur = usize::from(push.exposure_time_s > 0.0);
        if !self.kind.one_surface {
            recorder.mark("fast_seeds");
            recorder.clear_buffer(&self.claims);
            recorder.clear_buffer(&self.listed);
            let full = [self.size[0] + 2 * margin_px[0], self.size[1] + 2 * margin_px[1]];
            recorder.dispatch(&self.seeds, &binding.seeds, &push, full);
        }
        recorder.mark("fast_gather");
        let (first, lines) = match self.kind.one_of_several {
            true => lines_between(&timing.shutter, self.size, [timing.pictures_s[1], timing.pictures_s[2]]),
            false => ([0; 2], self.size),
        };
        let of_lines = Push { first, ..push };
        recorder.dispatch(&self.gather[blur], &binding.gather[blur], &of_lines, lines);
        if !self.kind.one_surface {
            recorder.mark("fast_silhouettes");
            let group = &binding.silhouettes[blur];
            recorder.dispatch_indirect(&self.silhouettes[blur], group, &push, &self.listed);
        }
    }
}

/// First pixel and size of what holds all lines whose exposures' middles lie between two times, s; a line more on each
/// side.
pub(crate) fn lines_between(
    shutter: &ShutterTiming,
    size: [u32; 2],
    [from_s, to_s]: [f64; 2],
) -> ([u32; 2], [u32; 2]) {
    let axis = usize::from(shutter.scan_order.lines_are_rows());
    let count = size[axis];
    let middle_s = shutter.start_s + 0.5 * shutter.exposure_time_s;
    let line = |t: f64| (t - middle_s) / shutter.readout_time_s * f64::from(count);
    let (mut low, mut high) = (0, count);
    // Without a readout all lines are read at once.
    if shutter.readout_time_s > 0.0 {
        low = (line(from_s) - 1.0).clamp(0.0, f64::from(count - 1)) as u32;
        high = (line(to_s) + 2.0).clamp(f64::from(low) + 1.0, f64::from(count)) as u32;
    }
    if matches!(shutter.scan_order, ScanOrder::BottomToTop | ScanOrder::RightToLeft) {
        (low, high) = (count - high, count - low);
    }
    let (mut first, mut extent) = ([0; 2], size);
    (first[axis], extent[axis]) = (low, high - low);
    (first, extent)
}

impl FastTiming {
    /// Of paths from depth: [`MOVED_STEPS`] knots after the frame's start, and their times, s. What a frame without
    /// duration has is all at once; any step places its only instant at the first knot.
    pub fn spaced(shutter: ShutterTiming) -> (Self, [f64; MOVED_STEPS as usize + 1]) {
        let (start_s, end_s) = (shutter.start_s, shutter.end_s());
        let step_s = (end_s - start_s) / f64::from(MOVED_STEPS);
        let times_s = std::array::from_fn(|k| (start_s + step_s * k as f64).min(end_s));
        let knot_step_s = if step_s > 0.0 { step_s } else { 1.0 };
        let timing = Self {
            shutter,
            reference_s: start_s,
            knot_step_s,
            reference_knot: 0,
            last_knot: MOVED_STEPS,
            pictures_s: [start_s; 3],
        };
        (timing, times_s)
    }

    /// The kernels' parameters.
    pub fn push(&self, size: [u32; 2], margin_px: [u32; 2], max_samples: u32) -> Push {
        let [picture_s, from_s, to_s] = self.pictures_s.map(|t| (t - self.reference_s) as f32);
        Push {
            size,
            margin_px: margin_px.map(|m| m as i32),
            start_s: (self.shutter.start_s - self.reference_s) as f32,
            readout_time_s: self.shutter.readout_time_s as f32,
            exposure_time_s: self.shutter.exposure_time_s as f32,
            knot_step_s: self.knot_step_s as f32,
            reference_knot: self.reference_knot,
            last_knot: self.last_knot,
            scan_order: self.shutter.scan_order as u32,
            max_samples: max_samples.max(1),
            slots: if self.shutter.exposure_time_s > 0.0 { 3 } else { 1 },
            picture_s,
            from_s,
            to_s,
            first: [0; 2],
        }
    }
}
