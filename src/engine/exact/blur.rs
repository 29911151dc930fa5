//! The blur of `--method exact`: paths of the texels over their line's exposure, tiles that say where surfaces part,
//! and the gather.

use bytemuck::{Pod, Zeroable};

use super::Input;
use super::uncover::Uncover;
use crate::assert_push_layout;
use crate::camera::{Intrinsics, NEAR_M, ScanOrder, ShutterTiming};
use crate::engine::flight::Room;
use crate::engine::scene::Stage;
use crate::engine::scene::lens::Channel;
use crate::error::{Error, Result};
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Format, Image, ImageSpec, Location, Recorder, RenderArea,
    Sampler, Usage,
};
use crate::kernels::kernel;
use crate::raster::{LensPush, RasterKind, RasterTarget};
use crate::reference::exact_push::{GatherPush, NeighboursPush, TilesPush};

/// `EXACT_TILE` of `exact_tile.glsl`.
const TILE: u32 = 8;
/// Most samples of a pixel.
const MAX_SAMPLES: i32 = 256;
/// Two matrices of three rows.
const TEXELS_A_GROUP: u32 = 6;
/// Farthest that tiles look for what may come, in tiles.
const MAX_RADIUS: f64 = 8.0;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PathsPush {
    size: [u32; 2],
    line_count: u32,
    columns: u32,
    lens: LensPush,
    share_per_row: [f32; 2],
    near_m: f32,
}
assert_push_layout!(
    "exact_paths_ms.comp",
    PathsPush { size, line_count, columns, lens, share_per_row, near_m }
);

assert_push_layout!("exact_tiles.comp", TilesPush { size, share_per_px, grid });

assert_push_layout!("exact_neighbours.comp", NeighboursPush { size, first, end, radius, tile_px });

assert_push_layout!(
    "exact_gather.comp",
    GatherPush {
        size,
        margin_px,
        picture_px,
        share_per_px,
        tau_per_px,
        drawn_from_px,
        drawn_to_px,
        most,
        tiles_across
    }
);

/// `WAY` of `exact_gather.comp`: how a tile is gathered.
const VARIANTS: [(u32, &str); 3] = [(0, "resting"), (1, "smooth_tiles"), (2, "layered")];

/// Place in [`VARIANTS`] of tiles of several surfaces: the last.
const LAYERED: usize = 2;

/// Images of one margin, and the kernels that work on them.
pub(super) struct Blur {
    pub(super) inputs: Vec<Input>,
    /// Without and with a lens; the bindings are the same.
    paths: [ComputePipeline; 2],
    groups: [BindGroup; 3],
    kernels: [ComputePipeline; 2],
    /// By [`VARIANTS`].
    gathers: Vec<(ComputePipeline, BindGroup)>,
    /// Several surfaces, with what objects uncover.
    layered: Option<(ComputePipeline, BindGroup)>,
    _samplers: [Sampler; 2],
    pub(super) target: RasterTarget,
    pub(super) uncover: Option<Uncover>,
    images: Images,
    pub(super) margin_px: [u32; 2],
}

struct Images {
    texels: Image,
    relatives: Image,
    paths: Image,
    inverses: Image,
    tiles: [Image; 4],
    around: [Image; 2],
    /// Tiles by [`VARIANTS`], after the size of the dispatch that gathers them.
    lists: Vec<Buffer>,
}

impl Images {
    fn new(stage: &Stage, picture: [u32; 2], group_count: usize) -> Result<Self> {
        let image = |name: &str, size: [u32; 2], format: Format| {
            Image::new(&stage.context, name, ImageSpec::storage(size, format))
        };
        let tiles = picture.map(|s| s.div_ceil(TILE));
        let path = |name: &str| image(name, tiles, Format::Rgba16f);
        // Whole texels of four words.
        let list_bytes = u64::from(4 + tiles[0] * tiles[1]).next_multiple_of(4) * size_of::<u32>() as u64;
        let most = stage.context.info().max_texels;
        if list_bytes / 16 > most {
            let why = format!("maxTexelBufferElements of {}", stage.context.info().name);
            return Err(Error::Limit {
                what: "tiles of a picture",
                value: list_bytes / 4,
                limit: 4 * most,
                why,
            });
        }
        let list = |(_, name): &(u32, &str)| {
            Buffer::new(&stage.context, name, list_bytes, Usage::StorageTexels, Location::Device)
        };
        Ok(Self {
            lists: VARIANTS.iter().map(list).collect::<Result<_>>()?,
            texels: image("texels", picture.map(|s| s * stage.plan.grid), Format::Rg32ui)?,
            relatives: image(
                "relatives",
                [TEXELS_A_GROUP * group_count as u32, picture[0].max(picture[1])],
                Format::Rgba32f,
            )?,
            paths: image("paths", picture, Format::Rgba16f)?,
            inverses: image("inverses", picture, Format::R32f)?,
            tiles: [
                path("tile_near")?,
                path("tile_far")?,
                image("tile_facts", tiles, Format::Rgba32f)?,
                path("tile_colors")?,
            ],
            around: [path("around_near")?, path("around_far")?],
        })
    }
}

impl Blur {
    pub(super) fn new(
        stage: &Stage,
        room: &mut Room<'_>,
        group_count: usize,
        (margin_px, uncovers): ([u32; 2], bool),
    ) -> Result<Self> {
        let context = &stage.context;
        let size = [0, 1].map(|i| [stage.intrinsics.width, stage.intrinsics.height][i] + 2 * margin_px[i]);
        let target = RasterTarget::new(context, &stage.buffers, RasterKind::Exact, size, stage.plan)?;
        let images = Images::new(stage, size, group_count)?;
        let all = target.attachments.images().chain([
            &images.texels,
            &images.relatives,
            &images.paths,
            &images.inverses,
        ]);
        room.prepare(all.chain(&images.tiles).chain(&images.around))?;
        let multisampled = const { kernel("exact_paths_ms.comp") };
        let plain = const { kernel("exact_paths.comp") };
        let paths = if stage.plan.msaa > 1 { multisampled } else { plain };
        let paths = |lens: u32| {
            ComputePipeline::specialized(context, paths, &[stage.plan.grid, stage.plan.msaa, lens])
        };
        let paths = [paths(0)?, paths(1)?];
        let kernels = [
            ComputePipeline::new(context, const { kernel("exact_tiles.comp") })?,
            ComputePipeline::new(context, const { kernel("exact_neighbours.comp") })?,
        ];
        let (sampler, linear) = (Sampler::new(context, false)?, Sampler::in_shares(context)?);
        let inputs =
            room.slots.iter().map(|_| Input::new(stage, &target, group_count)).collect::<Result<Vec<_>>>()?;
        let uncover = uncovers.then(|| Uncover::new(stage, room, size, &inputs)).transpose()?;
        let groups = bind(&paths[0], &kernels, &target, &images, &sampler)?;
        let gather = |way: u32, uncover: Option<&Uncover>| {
            let constants = [way, uncover.is_some().into(), stage.plan.grid];
            let kernel =
                ComputePipeline::specialized(context, const { kernel("exact_gather.comp") }, &constants)?;
            let list = &images.lists[way as usize];
            let group = bind_gather(&kernel, (&images, list), uncover, room.radiance, (&sampler, &linear))?;
            Ok((kernel, group))
        };
        let gathers = VARIANTS.iter().map(|(way, _)| gather(*way, None)).collect::<Result<_>>()?;
        let layered = uncover.as_ref().map(|u| gather(LAYERED as u32, Some(u))).transpose()?;
        Ok(Self {
            inputs,
            paths,
            groups,
            kernels,
            gathers,
            layered,
            _samplers: [sampler, linear],
            target,
            uncover,
            images,
            margin_px,
        })
    }

    /// Records everything after the raster.
    pub(super) fn record(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        slot: usize,
        shutter: &ShutterTiming,
        part: &Part,
    ) {
        let picture = self.target.size;
        let tiles = self.images.tiles[0].spec().size;
        recorder.mark("exact_paths");
        let lens = stage.lens_push(part.channel, picture);
        let push = PathsPush { lens, ..self.paths_push(shutter, part) };
        let along_and_across = if push.columns == 0 { picture } else { [picture[1], picture[0]] };
        recorder.copy_buffer_to_image(&self.inputs[slot].relative, &self.images.relatives);
        recorder.dispatch(&self.paths[lens.index()], &self.groups[0], &push, along_and_across);
        recorder.mark("exact_tiles");
        let share_per_px = picture.map(|s| 1.0 / s as f32);
        let push = TilesPush { size: tiles, share_per_px, grid: stage.plan.grid as f32 };
        recorder.dispatch(&self.kernels[0], &self.groups[1], &push, tiles);
        let tile_px = f64::from(TILE);
        let radius = (part.reach_px / tile_px).ceil().clamp(1.0, MAX_RADIUS) as i32;
        let delivered = [stage.intrinsics.width, stage.intrinsics.height];
        let push = NeighboursPush {
            size: tiles,
            first: self.margin_px.map(|m| m / TILE),
            end: [0, 1].map(|i| (self.margin_px[i] + delivered[i]).div_ceil(TILE)),
            radius,
            tile_px: tile_px as f32,
        };
        for list in &self.images.lists {
            recorder.clear_buffer(list);
        }
        recorder.dispatch(&self.kernels[1], &self.groups[2], &push, tiles);
        recorder.mark("exact_gather");
        let push = self.gather_push(&stage.intrinsics, shutter, part);
        let layered =
            self.layered.as_ref().filter(|_| part.uncovered.is_some()).unwrap_or(&self.gathers[LAYERED]);
        let gathers = self.gathers[..LAYERED].iter().chain([layered]);
        for ((kernel, group), list) in gathers.zip(&self.images.lists) {
            recorder.dispatch_indirect(kernel, group, &push, list);
        }
    }

    fn paths_push(&self, shutter: &ShutterTiming, part: &Part) -> PathsPush {
        PathsPush {
            size: self.target.size,
            line_count: part.line_count,
            columns: u32::from(!shutter.scan_order.lines_are_rows()),
            near_m: NEAR_M as f32,
            lens: LensPush::NONE,
            share_per_row: self.images.relatives.spec().size.map(|s| 1.0 / s as f32),
        }
    }

    fn gather_push(&self, camera: &Intrinsics, shutter: &ShutterTiming, part: &Part) -> GatherPush {
        let drawn = part.uncovered.map_or([(0, 0); 2], |a| [(a.x, a.width), (a.y, a.height)]);
        let (rows, reversed) = orientation(shutter.scan_order);
        let per_px = shutter.line_delay_s() / part.exposure_s * if reversed { -1.0 } else { 1.0 };
        GatherPush {
            size: [camera.width, camera.height],
            margin_px: self.margin_px.map(|m| m as f32),
            picture_px: self.target.size.map(|s| s as f32),
            share_per_px: self.target.size.map(|s| 1.0 / s as f32),
            tau_per_px: if rows { [0.0, per_px as f32] } else { [per_px as f32, 0.0] },
            drawn_from_px: drawn.map(|(from, _)| from as f32 + 0.5),
            drawn_to_px: drawn.map(|(from, side)| (from + side) as f32 - 0.5),
            most: MAX_SAMPLES,
            tiles_across: self.images.tiles[0].spec().size[0],
        }
    }
}

/// The resources of the kernels ahead of the gather.
fn bind(
    paths: &ComputePipeline,
    kernels: &[ComputePipeline; 2],
    target: &RasterTarget,
    images: &Images,
    sampler: &Sampler,
) -> Result<[BindGroup; 3]> {
    let fetched = |image| Bound::Sampled(image, sampler);
    let ([near, far, facts, colors], [around_near, around_far]) = (&images.tiles, &images.around);
    Ok([
        paths.bind(&[
            ("color_samples", fetched(&target.attachments.colors()[0])),
            ("depth_samples", fetched(target.attachments.depth())),
            ("texels", Bound::Storage(&images.texels)),
            ("paths", Bound::Storage(&images.paths)),
            ("inverses", Bound::Storage(&images.inverses)),
            ("relatives", fetched(&images.relatives)),
        ])?,
        kernels[0].bind(&[
            ("texels", fetched(&images.texels)),
            ("paths", fetched(&images.paths)),
            ("inverses", fetched(&images.inverses)),
            ("tile_near", Bound::Storage(near)),
            ("tile_far", Bound::Storage(far)),
            ("tile_facts", Bound::Storage(facts)),
            ("tile_colors", Bound::Storage(colors)),
        ])?,
        kernels[1].bind(&[
            ("tile_near", fetched(near)),
            ("tile_far", fetched(far)),
            ("tile_facts", fetched(facts)),
            ("tile_colors", fetched(colors)),
            ("around_near", Bound::Storage(around_near)),
            ("around_far", Bound::Storage(around_far)),
            ("resting", Bound::Buffer(&images.lists[0])),
            ("smooth_tiles", Bound::Buffer(&images.lists[1])),
            ("layered", Bound::Buffer(&images.lists[2])),
        ])?,
    ])
}

fn bind_gather(
    kernel: &ComputePipeline,
    (images, list): (&Images, &Buffer),
    uncover: Option<&Uncover>,
    radiance: &Image,
    (sampler, linear): (&Sampler, &Sampler),
) -> Result<BindGroup> {
    let fetched = |image| Bound::Sampled(image, sampler);
    let [around_near, around_far] = &images.around;
    // A kernel that is compiled without them reads neither.
    let [early, late] = [0, 1].map(|i| uncover.map_or(&images.paths, |u| u.picture(i)));
    kernel.bind(&[
        ("texels", fetched(&images.texels)),
        ("inverses", fetched(&images.inverses)),
        ("paths", fetched(&images.paths)),
        ("around_near", fetched(around_near)),
        ("around_far", fetched(around_far)),
        ("radiance", Bound::Storage(radiance)),
        ("listed", Bound::Buffer(list)),
        ("early", Bound::Sampled(early, linear)),
        ("late", Bound::Sampled(late, linear)),
    ])
}

/// What a frame tells the kernels.
pub(super) struct Part {
    /// Number of lines whose matrices were written.
    pub(super) line_count: u32,
    /// Time that its paths span, s.
    pub(super) exposure_s: f64,
    /// Longest way from the middle of a path to an end, px.
    pub(super) reach_px: f64,
    /// Where the pictures of the exposure's begin and end were drawn, px of the attachment.
    pub(super) uncovered: Option<RenderArea>,
    /// The colour that is drawn.
    pub(super) channel: Channel,
}

/// Whether lines are rows, and whether the last one is read first.
pub(super) fn orientation(order: ScanOrder) -> (bool, bool) {
    (order.lines_are_rows(), matches!(order, ScanOrder::BottomToTop | ScanOrder::RightToLeft))
}
