//! Warps frames from outside as `--method fast` does: colour and depth of one or several instants, and the camera's
//! poses over the frame. Lens, shutter and blur are applied in one reading of the colour. Depth keeps silhouettes
//! apart.

use crate::camera::{Intrinsics, ShutterTiming, Trajectory};
use crate::engine::fast::depth::turns_only;
use crate::engine::fast::pass::{
    FastBinding, FastGather, FastImages, FastKind, FastTiming, MOVED_BYTES, NO_PICTURE_S,
};
use crate::engine::flight::Room;
use crate::engine::outside::blend::{Blend, span_of, windows};
use crate::engine::outside::frame::{MAX_BODIES, OutsideBodies, OutsideFrame};
use crate::engine::outside::lens::{BorderRays, MarginNeed, OutsideLens};
use crate::engine::scene::lens::Merge;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Recorder, Usage};
use crate::raster::moved_row;
use std::sync::Arc;

/// How the camera moves over one frame, and what it sees.
pub(super) struct WarpPlan {
    /// In order of time.
    pictures: Vec<PicturePlan>,
    /// See [`windows`].
    windows: Vec<[f64; 2]>,
    /// Ids in rising order, then the number of each.
    numbers: Vec<u32>,
}

/// One picture's share.
struct PicturePlan {
    timing: FastTiming,
    /// Whether the camera only turns, before what rests.
    turns: bool,
    /// Matrices over the frame, of what rests and then of each body.
    rows: Vec<[[f32; 4]; 3]>,
}

/// Paths of the camera and of bodies.
type Paths<'a> = (&'a Trajectory, &'a [(u32, Trajectory)]);

impl WarpPlan {
    /// `camera` has the frame's margin.
    ///
    /// # Errors
    /// Poses that do not cover the frame and the instants of its pictures; a margin that is too small for them.
    pub(super) fn new(
        (nominal, border): (&Intrinsics, &BorderRays),
        frame: &OutsideFrame<'_>,
        (path, bodies): (&Trajectory, Option<&OutsideBodies<'_>>),
        (nearest_m, repeat_border): (f64, bool),
    ) -> Result<Self> {
        let times_s = frame.picture_times_s();
        check_spans(path, "", frame, &times_s)?;
        let bodies = bodies.map_or(&[][..], |b| &b.paths);
        let check = |(id, own): &(u32, _)| check_spans(own, &format!(", body {id}"), frame, &times_s);
        bodies.iter().try_for_each(check)?;
        let shutter = &frame.request.shutter;
        let needed = MarginNeed { border, nearest_m }.of_frame(path, &times_s, shutter);
        let given = frame.margin_px;
        if !repeat_border && (needed[0] > given[0] || needed[1] > given[1]) {
            return Err(Error::MarginTooSmall { needed_px: needed, given_px: given });
        }
        let camera = nominal.with_margin(given);
        let never_s = [shutter.start_s - NO_PICTURE_S, shutter.start_s + NO_PICTURE_S];
        let windows = windows(&times_s, never_s);
        let picture = |(k, &at_s): (usize, &f64)| {
            PicturePlan::new(&camera, shutter, (path, bodies), (at_s, span_of(&windows, k)))
        };
        let numbers = bodies.iter().map(|(id, _)| *id).chain(1..=bodies.len() as u32).collect();
        let pictures = times_s.iter().enumerate().map(picture).collect();
        Ok(Self { pictures, windows, numbers })
    }

    /// How many bodies move by themselves.
    pub(super) fn body_count(&self) -> u32 {
        self.numbers.len() as u32 / 2
    }
}

impl PicturePlan {
    /// `at_s`: its instant, and when it is needed, s.
    fn new(
        camera: &Intrinsics,
        shutter: &ShutterTiming,
        (path, bodies): Paths<'_>,
        (at_s, [from_s, to_s]): (f64, [f64; 2]),
    ) -> Self {
        let (mut timing, times_s) = FastTiming::spaced(*shutter);
        timing.pictures_s = [at_s, from_s, to_s];
        let now = path.pose_at(at_s);
        let mut rows = Vec::with_capacity(times_s.len() * (bodies.len() + 1));
        rows.extend(times_s.iter().map(|&t| moved_row(camera, &path.pose_at(t).relative(&now))));
        for (_, own) in bodies {
            let body_from_camera = own.pose_at(at_s).relative(&now);
            let moved = |&t: &f64| path.pose_at(t).relative(&own.pose_at(t)).then_from(&body_from_camera);
            rows.extend(times_s.iter().map(|t| moved_row(camera, &moved(t))));
        }
        let turns = bodies.is_empty() && turns_only(camera, path, at_s, &times_s);
        Self { timing, turns, rows }
    }
}

fn check_spans(path: &Trajectory, whose: &str, frame: &OutsideFrame<'_>, times_s: &[f64]) -> Result<()> {
    let (index, shutter) = (frame.request.index, &frame.request.shutter);
    path.require(shutter.start_s, shutter.end_s(), &format!("frame {index}{whose}"))?;
    times_s.iter().try_for_each(|&t| path.require(t, t, &format!("the colour of frame {index}{whose}")))
}

/// What frames are made by one warp.
#[derive(Clone, PartialEq)]
pub(super) struct WarpKind {
    pub(super) margin_px: [u32; 2],
    pub(super) lens: Option<OutsideLens>,
    /// Whether there may be bodies.
    pub(super) bodies: bool,
    /// How many pictures a frame has.
    pub(super) pictures: usize,
}

/// A picture on the device.
pub(super) struct PictureImages {
    /// As floats, for frames without exposure; `None` of the first, whose colour all frames from outside have.
    pub(super) color: Option<Image>,
    /// Colour that is filtered, for frames with an exposure.
    pub(super) half: Image,
    pub(super) inverse_depth: Image,
}

impl PictureImages {
    fn new(room: &mut Room<'_>, wider: [u32; 2], first: bool) -> Result<Self> {
        let image = |name, format| Image::new(room.context, name, ImageSpec::storage(wider, format));
        let color = (!first).then(|| image("outside color", Format::Rgba32f)).transpose()?;
        let half = image("outside half color", Format::Rgba16f)?;
        let inverse_depth = image("outside inverse depth", Format::Rg32f)?;
        room.prepare([&half, &inverse_depth].into_iter().chain(&color))?;
        Ok(Self { color, half, inverse_depth })
    }
}

/// Everything that such frames need beside what all frames from outside need.
pub(super) struct OutsideWarp {
    kind: WarpKind,
    size: [u32; 2],
    pub(super) pictures: Vec<PictureImages>,
    /// Bound by the warps, kept alive here; by colour.
    _tables: Vec<[Image; 2]>,
    /// By frame in flight and picture.
    moved: Vec<Vec<Buffer>>,
    /// Ids and numbers of bodies, by frame in flight.
    pub(super) numbers: Vec<Buffer>,
    /// Of a camera that passes what it sees, and of one that only turns.
    warps: [FastGather; 2],
    /// By frame in flight, warp, picture and colour.
    bindings: Vec<[Vec<Vec<FastBinding>>; 2]>,
    /// Of several pictures.
    blend: Option<Blend>,
    merge: Option<Merge>,
}

impl OutsideWarp {
    /// For pictures of `color`'s size; nothing may be in flight.
    pub(super) fn new(
        nominal: &Intrinsics,
        room: &mut Room<'_>,
        kind: WarpKind,
        color: &Image,
    ) -> Result<Self> {
        let (context, radiance) = (room.context, room.radiance);
        let wider = color.spec().size;
        let pictures = (0..kind.pictures).map(|k| PictureImages::new(room, wider, k == 0));
        let pictures = pictures.collect::<Result<Vec<_>>>()?;
        let tables = match &kind.lens {
            Some(lens) => tables(nominal, room, lens, kind.margin_px)?,
            None => Vec::new(),
        };
        let colors: Vec<_> = pictures.iter().map(|p| p.color.as_ref().unwrap_or(color)).collect();
        let blend = (kind.pictures > 1).then(|| Blend::new(room, &colors)).transpose()?;
        let size = [nominal.width, nominal.height];
        let warps = [warp(context, size, &kind, false)?, warp(context, size, &kind, true)?];
        let buffers = || (0..kind.pictures).map(|_| moved_buffer(context, kind.bodies)).collect();
        let moved = room.slots.iter().map(|_| buffers()).collect::<Result<Vec<Vec<_>>>>()?;
        let numbers = room.slots.iter().map(|_| numbers_buffer(context)).collect::<Result<Vec<_>>>()?;
        let to = |k: usize| blend.as_ref().map_or(radiance, |b| &b.warped[k]);
        let images: Vec<_> = (0..kind.pictures).map(|k| (&pictures[k], colors[k], to(k))).collect();
        let both = |moved: &Vec<Buffer>| -> Result<_> {
            Ok([bind(&warps[0], moved, &images, &tables)?, bind(&warps[1], moved, &images, &tables)?])
        };
        let bindings = moved.iter().map(both).collect::<Result<Vec<_>>>()?;
        let merge = (tables.len() > 1).then(|| Merge::new(room)).transpose()?;
        let _tables = tables;
        Ok(Self { kind, size, pictures, _tables, moved, numbers, warps, bindings, blend, merge })
    }

    /// Whether frames of this kind are made by it.
    pub(super) fn fits(&self, kind: &WarpKind) -> bool {
        self.kind == *kind
    }

    /// Says how the camera moves in a frame whose slot is not in flight.
    pub(super) fn write(&mut self, slot: usize, plan: &WarpPlan) {
        for (moved, picture) in self.moved[slot].iter_mut().zip(&plan.pictures) {
            moved.write(0, picture.rows.as_slice());
        }
        if !plan.numbers.is_empty() {
            self.numbers[slot].write(0, plan.numbers.as_slice());
        }
    }

    pub(super) fn record(&self, recorder: &mut Recorder<'_>, slot: usize, plan: &WarpPlan, max_samples: u32) {
        let Some(merge) = &self.merge else {
            self.record_color(recorder, (slot, 0), plan, max_samples);
            return;
        };
        for channel in [0, 2, 1] {
            self.record_color(recorder, (slot, channel), plan, max_samples);
            merge.record(recorder, self.size, channel as u32);
        }
    }

    /// One colour, or all of them, from all pictures.
    fn record_color(
        &self,
        recorder: &mut Recorder<'_>,
        (slot, channel): (usize, usize),
        plan: &WarpPlan,
        max_samples: u32,
    ) {
        for (k, picture) in plan.pictures.iter().enumerate() {
            let turns = usize::from(picture.turns);
            let binding = &self.bindings[slot][turns][k][channel];
            self.warps[turns].record(recorder, binding, self.kind.margin_px, &picture.timing, max_samples);
        }
        if let Some(blend) = &self.blend {
            blend.record(recorder, &plan.pictures[0].timing, &plan.windows);
        }
    }
}

fn warp(context: &Arc<Context>, size: [u32; 2], of: &WarpKind, one_surface: bool) -> Result<FastGather> {
    let kind = FastKind {
        one_surface,
        from_depth: true,
        bodies: of.bodies && !one_surface,
        lens: of.lens.is_some(),
        one_of_several: of.pictures > 1,
    };
    FastGather::new(context, size, (1, 1), 1, kind)
}

/// By picture and colour; `moved`: by picture; `images`: each picture, its colour, and where its warp goes.
fn bind(
    warp: &FastGather,
    moved: &[Buffer],
    images: &[(&PictureImages, &Image, &Image)],
    tables: &[[Image; 2]],
) -> Result<Vec<Vec<FastBinding>>> {
    let bind = |(picture, color, to): &(&PictureImages, &Image, &Image), moved, lens| {
        warp.bind(&FastImages {
            color,
            filtered: &picture.half,
            paths: Vec::new(),
            moved: Some(moved),
            inverse_depth: &picture.inverse_depth,
            lens,
            radiance: to,
        })
    };
    let colours = |(images, moved)| match tables.is_empty() {
        true => Ok(vec![bind(images, moved, None)?]),
        false => tables.iter().map(|t| bind(images, moved, Some(t.each_ref()))).collect(),
    };
    images.iter().zip(moved).map(colours).collect()
}

fn moved_buffer(context: &Arc<Context>, bodies: bool) -> Result<Buffer> {
    let count = if bodies { MAX_BODIES as u64 + 1 } else { 1 };
    Buffer::new(context, "outside moved", count * MOVED_BYTES, Usage::Texels, Location::Upload)
}

fn numbers_buffer(context: &Arc<Context>) -> Result<Buffer> {
    Buffer::new(context, "outside bodies", 8 * MAX_BODIES as u64, Usage::Storage, Location::Upload)
}

/// The lens's two tables by colour, on the device.
fn tables(
    nominal: &Intrinsics,
    room: &mut Room<'_>,
    lens: &OutsideLens,
    margin_px: [u32; 2],
) -> Result<Vec<[Image; 2]>> {
    let (context, slot) = (room.context, &mut room.slots[0]);
    let wider = nominal.with_margin(margin_px);
    let sizes = [[nominal.width, nominal.height], [wider.width, wider.height]];
    let rays = lens.rays()?;
    let mut made = Vec::new();
    for scale in lens.scales() {
        let mut upload = |values: &[[f32; 2]], size: [u32; 2]| {
            let image = Image::new(context, "outside lens", ImageSpec::storage(size, Format::Rg32f))?;
            let bytes = size_of_val(values) as u64;
            let mut staging = Buffer::new(context, "outside lens", bytes, Usage::Transfer, Location::Upload)?;
            staging.write(0, values);
            let mut recorder = slot.gpu.begin()?;
            recorder.prepare([&image]);
            recorder.copy_buffer_to_image(&staging, &image);
            recorder.barrier();
            recorder.finish();
            slot.gpu.submit()?;
            let done = slot.gpu.wait(std::time::Duration::from_secs(60));
            if done.is_err() {
                // Image and buffer are dropped now.
                slot.gpu.let_go();
            }
            done.map(|()| image)
        };
        let [ideal, sensed] = rays.tables(&wider, scale);
        made.push([upload(&ideal, sizes[0])?, upload(&sensed, sizes[1])?]);
    }
    Ok(made)
}
