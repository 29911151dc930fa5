//! Paths and the frame without exposure of `--method exact` against their CPU twins, on random and edge input, odd
//! sizes, lines that are rows or columns, with and without a lens; with controls.
#![allow(clippy::unwrap_used)]

use crate::exact_support::TestLens;
use crate::gpu_support::bench::{Bench, Scatter, differing};
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use shutterbug::assert_push_layout;
use shutterbug::camera::{Distortion, NEAR_M};
use shutterbug::gpu::{Bound, Format, Sampler};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::raster::LensPush;
use shutterbug::reference::exact_paths::{self, Outputs, Relative, exact_paths};
use shutterbug::reference::exact_still::exact_still;

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
assert_push_layout!("exact_paths.comp", PathsPush { size, line_count, columns, lens, share_per_row, near_m });

/// Matrices near the identity: what a camera does within an exposure.
fn relatives(count: usize, scatter: &mut Scatter) -> Vec<Relative> {
    let mut rows = || {
        let mut row = |x: f32, y: f32, w: f32| {
            Vec4::new(
                x + scatter.between(-0.05, 0.05),
                y + scatter.between(-0.05, 0.05),
                scatter.between(-3.0, 3.0),
                w + scatter.between(-0.2, 0.2),
            )
        };
        [row(1.0, 0.0, 0.0), row(0.0, 1.0, 0.0), row(0.0, 0.0, 1.0)]
    };
    (0..count).map(|_| Relative { begin: rows(), end: rows() }).collect()
}

struct PathsCase {
    color: Plane<f32>,
    depth: Plane<f32>,
    relatives: Vec<Relative>,
    groups: usize,
    line_count: usize,
    columns: bool,
    grid: usize,
}

fn paths_case(
    size: [usize; 2],
    grid: usize,
    groups: usize,
    columns: bool,
    scatter: &mut Scatter,
) -> PathsCase {
    let [w, h] = size.map(|s| s * grid);
    // Background, one depth twice, anything.
    let depth = Plane::from_fn(w, h, |x, y| match (x * 3 + y * 5) % 7 {
        0 | 1 => [0.0],
        2 => [0.004],
        _ => [scatter.between(1e-4, 0.1)],
    });
    let color = Plane::from_fn(w, h, |x, y| {
        let group = if depth.pixel(x, y)[0] > 0.0 { 1.0 + ((x / 3 + y) % groups) as f32 } else { 0.0 };
        [scatter.number(), 4.0 * scatter.number(), 0.5, group]
    });
    let line_count = if scatter.number() < 0.3 {
        1
    } else if columns {
        size[0]
    } else {
        size[1]
    };
    PathsCase {
        color,
        depth,
        relatives: relatives(line_count * groups, scatter),
        groups,
        line_count,
        columns,
        grid,
    }
}

fn run_paths(bench: &mut Bench, case: &PathsCase, lens: &TestLens) -> Outputs {
    let size = [case.color.width / case.grid, case.color.height / case.grid];
    let color = bench.upload(std::slice::from_ref(&case.color), Format::Rgba32f, false);
    let depth = bench.upload(std::slice::from_ref(&case.depth), Format::R32f, false);
    let row = |line: usize, texel: usize| {
        let relative = &case.relatives[line * case.groups + texel / 6];
        [relative.begin, relative.end][texel % 6 / 3][texel % 3].to_array()
    };
    let matrices = Plane::from_fn(6 * case.groups, case.line_count, |x, y| row(y, x));
    let matrices = bench.upload(std::slice::from_ref(&matrices), Format::Rgba32f, false);
    let texels = bench.empty([case.color.width, case.color.height], Format::Rg32ui, 1, false);
    let inverses = bench.empty(size, Format::R32f, 1, false);
    let paths = bench.empty(size, Format::Rgba16f, 1, false);
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let resources = [
        ("color_samples", Bound::Sampled(&color, &sampler)),
        ("depth_samples", Bound::Sampled(&depth, &sampler)),
        ("texels", Bound::Storage(&texels)),
        ("paths", Bound::Storage(&paths)),
        ("inverses", Bound::Storage(&inverses)),
        ("relatives", Bound::Sampled(&matrices, &sampler)),
    ];
    let push = PathsPush {
        size: size.map(|s| s as u32),
        line_count: case.line_count as u32,
        columns: case.columns.into(),
        lens: lens.push,
        share_per_row: [1.0 / (6 * case.groups) as f32, 1.0 / case.line_count as f32],
        near_m: NEAR_M as f32,
    };
    let constants = [case.grid as u32, 1, u32::from(lens.extended.is_some())];
    let along = if case.columns { [push.size[1], push.size[0]] } else { push.size };
    bench.run(const { kernel("exact_paths.comp") }, &constants, &resources, &push, along);
    let words = bench.read(&texels).remove(0).data;
    Outputs {
        words: words.chunks_exact(2).map(|pair| [pair[0].to_bits(), pair[1].to_bits()]).collect(),
        inverses: bench.read(&inverses).remove(0),
        paths: bench.read(&paths).remove(0),
    }
}

fn paths_twin(case: &PathsCase, lens: &TestLens) -> Outputs {
    exact_paths(&exact_paths::Inputs {
        color: &case.color,
        depth: &case.depth,
        relatives: &case.relatives,
        line_count: case.line_count,
        columns: case.columns,
        grid: case.grid,
        near_m: NEAR_M as f32,
        ideal: &|ndc| lens.ideal(ndc),
        sensor: &|clip| lens.sensor(clip),
    })
}

/// Half floats hold eleven bits.
const HALF: f32 = 1e-3;

#[test]
fn exact_paths_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_paths_is_its_twin") else { return };
    let mut scatter = Scatter(33);
    for (size, grid) in [([1, 1], 1), ([37, 23], 2), ([129, 71], 1), ([130, 5], 4), ([9, 140], 2)] {
        for (groups, columns) in [(1, false), (3, true), (2, false), (7, true)] {
            for lens in &TestLens::all(size.map(|s| s as u32)) {
                let case = paths_case(size, grid, groups, columns, &mut scatter);
                let label = format!(
                    "{size:?}, grid {grid}, {groups} groups, columns {columns}, lens {:?}",
                    lens.extended.as_ref().map(|l| l.lens().distortion())
                );
                let Outputs { words, inverses, paths } = run_paths(&mut bench, &case, lens);
                let want = paths_twin(&case, lens);
                let others = words.iter().zip(&want.words).filter(|(a, b)| a != b).count();
                assert!(others == 0, "{label}: {others} pairs of texels");
                assert_eq!(differing(&inverses, &want.inverses, 1e-6).1, 0, "{label}: inverse distances");
                // Vulkan lets the arc tangent be off by 4096 units in the last place.
                let fisheye = lens.extended.as_ref().map(|l| l.lens().distortion());
                let allowed = if matches!(fisheye, Some(Distortion::Equidistant { .. })) { 2.0 } else { 1.0 };
                assert_eq!(differing(&paths, &want.paths, allowed * HALF).1, 0, "{label}: paths");
                if size == [1, 1] {
                    continue;
                }
                let mut wrong = paths_case(size, grid, groups, columns, &mut scatter);
                wrong.color.clone_from(&case.color);
                wrong.depth.clone_from(&case.depth);
                wrong.relatives =
                    case.relatives.iter().map(|r| Relative { begin: r.end, end: r.end }).collect();
                (wrong.line_count, wrong.groups) = (case.line_count, case.groups);
                let seen = differing(&paths, &paths_twin(&wrong, lens).paths, HALF).1;
                assert!(2 * seen > size[0] * size[1], "control: {label}: begin for end is seen in {seen} px");
                wrong.relatives = case.relatives.iter().rev().copied().collect();
                let seen = differing(&paths, &paths_twin(&wrong, lens).paths, HALF).1;
                let one = case.relatives.len() == 1;
                assert!(one || 2 * seen > size[0] * size[1], "control: {label}: lines in reverse: {seen} px");
            }
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct StillPush {
    size: [u32; 2],
    margin_px: [i32; 2],
    grid: [i32; 2],
}
assert_push_layout!("exact_still.comp", StillPush { size, margin_px, grid });

#[test]
fn exact_still_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_still_is_its_twin") else { return };
    let (mut scatter, sampler) = (Scatter(35), Sampler::new(&bench.watched.0, false).unwrap());
    for (size, margin, grid) in [([1, 1], [0, 0], 1), ([37, 23], [3, 5], 2), ([129, 71], [0, 2], 4)] {
        let [w, h] = [0, 1].map(|i| (size[i] + 2 * margin[i]) * grid);
        let samples = Plane::from_fn(w, h, |x, _| {
            let bright = if x % 13 == 0 { 6e4 } else { 1.0 };
            [bright * scatter.number(), scatter.number(), scatter.number(), 3.0]
        });
        let image = bench.upload(std::slice::from_ref(&samples), Format::Rgba32f, false);
        let radiance = bench.empty(size, Format::Rgba32f, 1, false);
        let resources =
            [("color_samples", Bound::Sampled(&image, &sampler)), ("radiance", Bound::Storage(&radiance))];
        let push = StillPush {
            size: size.map(|s| s as u32),
            margin_px: margin.map(|m| m as i32),
            grid: [grid as i32; 2],
        };
        bench.run(const { kernel("exact_still.comp") }, &[], &resources, &push, push.size);
        let got = bench.read(&radiance).remove(0);
        assert_eq!(differing(&got, &exact_still(&samples, grid, size, margin), 2e-6).1, 0, "{size:?}");
        if size != [1, 1] {
            let shifted = exact_still(&samples, grid, size, [margin[0], margin[1] - 1]);
            let seen = differing(&got, &shifted, 2e-6).1;
            assert!(2 * seen > size[0] * size[1], "control: {size:?}: a line higher is seen in {seen} px");
        }
    }
}
