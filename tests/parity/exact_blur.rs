//! Kernels of the blur of `--method exact` against their CPU twins: tiles, what may come into them, the gather. On
//! random and edge input and odd sizes; with controls.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::bench::{Bench, Scatter, differing};
use glam::{Vec2, Vec3, Vec4};
use shutterbug::gpu::{Bound, Format, Sampler, Usage};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::reference::exact_gather::{self, exact_gather};
use shutterbug::reference::exact_neighbours::{Around, Way, exact_neighbours};
use shutterbug::reference::exact_push::{GatherPush, NeighboursPush, TilesPush};
use shutterbug::reference::exact_tiles::{TILE, Tile, exact_tiles};
use shutterbug::reference::rgb9e5;

/// Half floats hold eleven bits.
const HALF: f32 = 1e-3;
/// `EXACT_JUMPS` of `exact_tile.glsl`.
const JUMPS: f32 = 8192.0;

/// A picture of walls and things before them, each with paths of its own; some at rest.
struct Scene {
    texels: Plane<f32>,
    inverses: Plane<f32>,
    paths: Plane<f32>,
    grid: usize,
}

/// Rounds to what a half float holds, so that images of half floats hold it.
fn half(value: f32) -> f32 {
    f32::from_bits((value.to_bits() + 0x1000) & !0x1fff)
}

fn scene(size: [usize; 2], grid: usize, speed_px: f32, scatter: &mut Scatter) -> Scene {
    let mut paths_of = |fast: f32| {
        let mut v = || scatter.between(-speed_px, speed_px) * fast;
        Vec4::new(v(), v(), v(), v())
    };
    let layers = [paths_of(0.3), paths_of(1.0), Vec4::ZERO];
    // A wall on the left, a thing across it, rest on the right.
    let layer_at = |x: usize, y: usize| match (x, y) {
        _ if x > 3 * size[0] / 4 => 2,
        _ if (x + y / 3) % 61 > 40 && y % 67 > 30 => 1,
        _ => 0,
    };
    let slope = scatter.between(-0.02, 0.02);
    let paths = Plane::from_fn(size[0], size[1], |x, y| {
        let path = layers[layer_at(x, y)];
        if path == Vec4::ZERO { [0.0; 4] } else { (path + slope * y as f32).to_array().map(half) }
    });
    let inverses = Plane::from_fn(size[0], size[1], |x, y| {
        [1.0 / ([4.0, 1.5, 8.0][layer_at(x, y)] + 0.01 * (x % 5) as f32)]
    });
    let texels = Plane::from_fn(size[0] * grid, size[1] * grid, |x, y| {
        let bright = if (x / 7 + y / 5) % 2 == 0 { 1.0 } else { 0.1 };
        // Below, one colour, nearly.
        if y / grid > 2 * size[1] / 3 {
            return stored([0.5, 0.25, 1.0 + 0.001 * scatter.number()]);
        }
        stored([bright * scatter.number(), bright, 6.0 * scatter.number()])
    });
    Scene { texels, inverses, paths, grid }
}

/// As far as words hold it.
fn stored(color: [f32; 3]) -> [f32; 4] {
    rgb9e5::color(rgb9e5::rgb9e5(color.into(), 0.5)).extend(0.0).to_array()
}

/// Texels as the kernels read them: words of each and of the one to its right.
fn pairs(texels: &Plane<f32>) -> Plane<f32> {
    Plane::from_fn(texels.width, texels.height, |x, y| {
        [x, (x + 1).min(texels.width - 1)]
            .map(|x| f32::from_bits(rgb9e5::rgb9e5(Vec3::from_slice(texels.pixel(x, y)), 0.5)))
    })
}

fn run_tiles(bench: &mut Bench, scene: &Scene) -> [Plane<f32>; 4] {
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let texels = bench.upload(&[pairs(&scene.texels)], Format::Rg32ui, false);
    let inverses = bench.upload(std::slice::from_ref(&scene.inverses), Format::R32f, false);
    let paths = bench.upload(std::slice::from_ref(&scene.paths), Format::Rgba32f, false);
    let tiles = [scene.paths.width.div_ceil(TILE), scene.paths.height.div_ceil(TILE)];
    let near = bench.empty(tiles, Format::Rgba16f, 1, false);
    let far = bench.empty(tiles, Format::Rgba16f, 1, false);
    let facts = bench.empty(tiles, Format::Rgba32f, 1, false);
    let colors = bench.empty(tiles, Format::Rgba16f, 1, false);
    let resources = [
        ("texels", Bound::Sampled(&texels, &sampler)),
        ("paths", Bound::Sampled(&paths, &sampler)),
        ("inverses", Bound::Sampled(&inverses, &sampler)),
        ("tile_near", Bound::Storage(&near)),
        ("tile_far", Bound::Storage(&far)),
        ("tile_facts", Bound::Storage(&facts)),
        ("tile_colors", Bound::Storage(&colors)),
    ];
    let push = TilesPush {
        size: tiles.map(|s| s as u32),
        share_per_px: [1.0 / scene.paths.width as f32, 1.0 / scene.paths.height as f32],
        grid: scene.grid as f32,
    };
    bench.run(const { kernel("exact_tiles.comp") }, &[], &resources, &push, push.size);
    [near, far, facts, colors].map(|image| bench.read(&image).remove(0))
}

/// Tiles as the kernels keep them.
fn planes([width, height]: [usize; 2], tiles: &[Tile]) -> [Plane<f32>; 4] {
    let plane =
        |f: &dyn Fn(&Tile) -> [f32; 4]| Plane::from_fn(width, height, |x, y| f(&tiles[y * width + x]));
    [
        plane(&|t| t.near.to_array()),
        plane(&|t| t.far.to_array()),
        plane(&|t| {
            let jumps = if t.jumps { JUMPS } else { 0.0 };
            [t.near_inverse, t.far_inverse, t.reach.x, t.reach.y + jumps]
        }),
        plane(&|t| t.color.extend(t.away).to_array()),
    ]
}

const SIZES: [([usize; 2], usize); 5] =
    [([1, 1], 1), ([37, 23], 2), ([129, 71], 2), ([63, 9], 4), ([320, 240], 2)];

#[test]
fn exact_tiles_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_tiles_is_its_twin") else { return };
    let mut scatter = Scatter(41);
    for (size, grid) in SIZES {
        for speed_px in [0.01, 0.4, 12.0, 900.0] {
            let scene = scene(size, grid, speed_px, &mut scatter);
            let tiles = size.map(|s| s.div_ceil(TILE));
            let want = exact_tiles(&scene.texels, &scene.inverses, &scene.paths, grid);
            let label = format!("{size:?}, grid {grid}, {speed_px} px");
            let got = run_tiles(&mut bench, &scene);
            // Paths are halves already, and the sum with the mark is a float's; colours are rounded to halves.
            let want_planes = planes(tiles, &want);
            for (i, (got, want)) in got.iter().zip(&want_planes).enumerate() {
                assert_eq!(differing(got, want, if i < 3 { 1e-7 } else { HALF }).1, 0, "{label}, {i}");
            }
            if size[0] > 60 && speed_px > 10.0 {
                let shifted = Plane::from_fn(size[0], size[1], |x, y| {
                    std::array::from_fn::<f32, 4, _>(|c| scene.paths.pixel(x.saturating_sub(1), y)[c])
                });
                let wrong = exact_tiles(&scene.texels, &scene.inverses, &shifted, grid);
                assert_ne!(wrong, want, "control: {label}: a px to the side");
            }
        }
    }
}

/// Near, far, and the three lists (sorted: nothing depends on their order).
type Neighbours = (Plane<f32>, Plane<f32>, [Vec<u32>; 3]);

fn run_neighbours(bench: &mut Bench, tiles: &[Plane<f32>; 4], push: &NeighboursPush) -> Neighbours {
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let images = tiles.each_ref().map(|p| bench.upload(std::slice::from_ref(p), Format::Rgba32f, false));
    let size = push.size.map(|s| s as usize);
    let [near, far] = [0; 2].map(|_| bench.empty(size, Format::Rgba16f, 1, false));
    let length = 4 + size[0] * size[1];
    let lists = [0; 3].map(|_| bench.filled(Usage::Storage, &vec![0_u32; length]));
    let resources = [
        ("tile_near", Bound::Sampled(&images[0], &sampler)),
        ("tile_far", Bound::Sampled(&images[1], &sampler)),
        ("tile_facts", Bound::Sampled(&images[2], &sampler)),
        ("tile_colors", Bound::Sampled(&images[3], &sampler)),
        ("around_near", Bound::Storage(&near)),
        ("around_far", Bound::Storage(&far)),
        ("resting", Bound::Buffer(&lists[0])),
        ("smooth_tiles", Bound::Buffer(&lists[1])),
        ("layered", Bound::Buffer(&lists[2])),
    ];
    bench.run(const { kernel("exact_neighbours.comp") }, &[], &resources, push, push.size);
    let lists = lists.map(|list| {
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bench.read_buffer(&list, 4 * length));
        let count = words[3] as usize;
        let groups = if count == 0 { [0; 3] } else { [count as u32, 1, 1] };
        assert_eq!(words[..3], groups, "a workgroup a tile");
        let mut tiles = words[4..4 + count].to_vec();
        tiles.sort_unstable();
        tiles
    });
    (bench.read(&near).remove(0), bench.read(&far).remove(0), lists)
}

fn neighbours_twin(tiles: &[Tile], push: &NeighboursPush) -> (Vec<Around>, Neighbours) {
    let size = push.size.map(|s| s as usize);
    let delivered = [0, 1].map(|i| push.first[i] as usize..push.end[i] as usize);
    let around = exact_neighbours(tiles, size, delivered, push.radius as usize);
    let plane = |f: &dyn Fn(&Around) -> Vec4| {
        Plane::from_fn(size[0], size[1], |x, y| f(&around[y * size[0] + x]).to_array())
    };
    let lists = [Way::Resting, Way::Smooth, Way::Layered].map(|way| {
        (0_u32..).zip(&around).filter(|(_, a)| a.way == Some(way)).map(|(i, _)| i).collect::<Vec<_>>()
    });
    let planes = (plane(&|a| a.near), plane(&|a| a.far), lists);
    (around, planes)
}

#[test]
fn exact_neighbours_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_neighbours_is_its_twin") else { return };
    let mut scatter = Scatter(43);
    let mut most = [0; 3];
    for (size, grid) in SIZES {
        for (speed_px, radius) in [(0.01, 1), (3.0, 1), (12.0, 2), (40.0, 8)] {
            let scene = scene(size, grid, speed_px, &mut scatter);
            let tiles = exact_tiles(&scene.texels, &scene.inverses, &scene.paths, grid);
            let counts = size.map(|s| s.div_ceil(TILE) as u32);
            let first = counts.map(|c| c / 5);
            let push = NeighboursPush {
                size: counts,
                first,
                end: [0, 1].map(|i| (counts[i] - first[i]).max(first[i] + 1)),
                radius,
                tile_px: TILE as f32,
            };
            let label = format!("{size:?}, {speed_px} px, radius {radius}");
            let (near, far, lists) =
                run_neighbours(&mut bench, &planes(counts.map(|s| s as usize), &tiles), &push);
            let (_, (want_near, want_far, want_lists)) = neighbours_twin(&tiles, &push);
            assert_eq!(differing(&near, &want_near, 1e-7).1, 0, "{label}: near");
            assert_eq!(differing(&far, &want_far, 1e-7).1, 0, "{label}: far");
            assert_eq!(lists, want_lists, "{label}");
            for (most, list) in most.iter_mut().zip(&lists) {
                *most = list.len().max(*most);
            }
            if size[0] >= 129 && speed_px > 10.0 {
                let (_, alone) = neighbours_twin(&tiles, &NeighboursPush { radius: 0, ..push });
                assert_ne!(lists, alone.2, "control: {label}: each tile by itself is listed otherwise");
            }
        }
    }
    assert!(most.iter().all(|m| *m >= 10), "every way was met: {most:?}");
}

fn run_gather(bench: &mut Bench, inputs: &exact_gather::Inputs<'_>) -> Plane<f32> {
    let (sampler, linear) =
        (Sampler::new(&bench.watched.0, false).unwrap(), Sampler::in_shares(&bench.watched.0).unwrap());
    let texels = bench.upload(&[pairs(inputs.texels)], Format::Rg32ui, false);
    let inverses = bench.upload(std::slice::from_ref(inputs.inverses), Format::R32f, false);
    let paths = bench.upload(std::slice::from_ref(inputs.paths), Format::Rgba32f, false);
    let picture = [inputs.paths.width, inputs.paths.height];
    let tiles = picture.map(|s| s.div_ceil(TILE));
    let plane = |f: &dyn Fn(&Around) -> Vec4| {
        Plane::from_fn(tiles[0], tiles[1], |x, y| f(&inputs.around[y * tiles[0] + x]).to_array())
    };
    let near = bench.upload(&[plane(&|a| a.near)], Format::Rgba32f, false);
    let far = bench.upload(&[plane(&|a| a.far)], Format::Rgba32f, false);
    let [early, late] = inputs.uncovered.unwrap_or([inputs.paths; 2]);
    let [early, late] = [early, late].map(|p| bench.upload(std::slice::from_ref(p), Format::Rgba32f, false));
    let size = [0, 1].map(|i| picture[i] - 2 * inputs.margin_px[i]);
    let radiance = bench.empty(size, Format::Rgba32f, 1, false);
    let push = GatherPush {
        size: size.map(|s| s as u32),
        margin_px: inputs.margin_px.map(|m| m as f32),
        picture_px: picture.map(|s| s as f32),
        share_per_px: picture.map(|s| 1.0 / s as f32),
        tau_per_px: inputs.tau_per_px.to_array(),
        drawn_from_px: inputs.drawn_px[0].to_array(),
        drawn_to_px: inputs.drawn_px[1].to_array(),
        most: inputs.most,
        tiles_across: tiles[0] as u32,
    };
    for way in [Way::Resting, Way::Smooth, Way::Layered] {
        let listed: Vec<u32> =
            (0_u32..).zip(inputs.around).filter(|(_, a)| a.way == Some(way)).map(|(i, _)| i).collect();
        let mut words = vec![0, 0, 0, listed.len() as u32];
        words.extend(listed.iter().rev());
        words.resize(words.len().next_multiple_of(4), 0);
        let list = bench.filled(Usage::StorageTexels, &words);
        let resources = [
            ("texels", Bound::Sampled(&texels, &sampler)),
            ("inverses", Bound::Sampled(&inverses, &sampler)),
            ("paths", Bound::Sampled(&paths, &sampler)),
            ("around_near", Bound::Sampled(&near, &sampler)),
            ("around_far", Bound::Sampled(&far, &sampler)),
            ("radiance", Bound::Storage(&radiance)),
            ("listed", Bound::Buffer(&list)),
            ("early", Bound::Sampled(&early, &linear)),
            ("late", Bound::Sampled(&late, &linear)),
        ];
        // Fewer workgroups than tiles: each takes several.
        let groups = (listed.len() as u32).div_ceil(3).max(1);
        let constants = [way as u32, inputs.uncovered.is_some().into(), inputs.grid as u32];
        bench.run(const { kernel("exact_gather.comp") }, &constants, &resources, &push, [8 * groups, 8]);
    }
    bench.read(&radiance).remove(0)
}

#[test]
fn exact_gather_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_gather_is_its_twin") else { return };
    let mut scatter = Scatter(47);
    let (mut caught, mut cases, mut beyond, mut filled) = (0, 0, 0, 0);
    for (size, grid, margin_px) in
        [([17, 9], 1, [2, 0]), ([37, 23], 2, [4, 3]), ([129, 71], 2, [0, 9]), ([200, 150], 2, [20, 16])]
    {
        for speed_px in [0.01, 0.6, 3.0, 14.0, 60.0] {
            for tau_per_px in [Vec2::ZERO, Vec2::new(0.0, 0.006), Vec2::new(-0.009, 0.0)] {
                let scene = scene(size, grid, speed_px, &mut scatter);
                let tiles = exact_tiles(&scene.texels, &scene.inverses, &scene.paths, grid);
                let counts = size.map(|s| s.div_ceil(TILE) as u32);
                let push = NeighboursPush {
                    size: counts,
                    first: [0; 2],
                    end: counts,
                    radius: 8,
                    tile_px: TILE as f32,
                };
                let (around, _) = neighbours_twin(&tiles, &push);
                let (texels, inverses, paths) = (&scene.texels, &scene.inverses, &scene.paths);
                let most = if speed_px == 14.0 { 6 } else { 256 };
                // Nothing of the scene has this much red.
                let other =
                    |red: f32| Plane::from_fn(size[0], size[1], |x, _| [red, 0.01 * x as f32, 0.0, 1.0]);
                let (early, late) = (other(20.0), other(30.0));
                let uncovered = (tau_per_px != Vec2::ZERO).then_some([&early, &late]);
                let around = &around[..];
                // Not at the borders.
                let drawn_px = [Vec2::new(3.5, 1.5), Vec2::new(size[0] as f32 - 6.5, size[1] as f32 - 0.5)];
                let inputs = exact_gather::Inputs {
                    texels,
                    inverses,
                    paths,
                    uncovered,
                    drawn_px,
                    around,
                    margin_px,
                    tau_per_px,
                    most,
                    grid,
                };
                let got = run_gather(&mut bench, &inputs);
                let want = exact_gather(&inputs);
                let (_, outliers) = differing(&got, &want, HALF);
                let pixels = got.width * got.height;
                // Rounding decides which of two surfaces is hit, and how many samples a path of a whole length has.
                // A device that rounds in its own way decides twice as often otherwise as one that rounds as we do.
                let allowed = 1 + pixels / if bench.exact() { 200 } else { 100 };
                let label = format!("{size:?}, {speed_px} px, {tau_per_px}");
                assert!(outliers <= allowed, "{label}: {outliers} of {pixels}");
                beyond += want.data.chunks(4).filter(|p| p[3] < 0.0).count();
                if uncovered.is_some() {
                    let guessed = exact_gather(&exact_gather::Inputs { uncovered: None, ..inputs });
                    let swapped =
                        exact_gather(&exact_gather::Inputs { uncovered: Some([&late, &early]), ..inputs });
                    filled += differing(&got, &guessed, HALF).1.min(differing(&got, &swapped, HALF).1);
                }
                if speed_px >= 0.6 {
                    let longer =
                        Plane { data: paths.data.iter().map(|v| 1.1 * v).collect(), ..paths.clone() };
                    let wrong = exact_gather(&exact_gather::Inputs { paths: &longer, ..inputs });
                    caught += usize::from(differing(&got, &wrong, HALF).1 > 10 * allowed);
                    cases += 1;
                }
            }
        }
    }
    assert!(caught == cases, "control: paths a tenth longer are seen in {caught} of {cases} cases");
    assert!(filled > 1000, "control: what is uncovered, and when, is seen in {filled} px");
    assert!(beyond > 100, "samples beyond the picture are told: {beyond}");
}
