//! Kernels of `--method exact` ahead of the gather against their CPU twins: placing of vertices, paths, the frame without
//! exposure. On random and edge input, odd sizes, both orders of lines; with controls.
#![allow(clippy::unwrap_used)]

mod gpu_support;

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DQuat, DVec2, DVec3, Mat4, Vec2, Vec3, Vec4};
use gpu_support::bench::{Bench, Scatter, differing};
use shutterbug::assert_push_layout;
use shutterbug::camera::{Distortion, ExtendedLens, Intrinsics, Lens, NEAR_M};
use shutterbug::gpu::{Bound, Format, Sampler, Usage};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::raster::LensPush;
use shutterbug::reference::exact_paths::{self, Relative, exact_paths};
use shutterbug::reference::exact_place::{self, Knot, exact_place};
use shutterbug::reference::exact_still::exact_still;

const CAMERA: Intrinsics = Intrinsics { width: 37, height: 23, fx: 40.0, fy: 40.0, cx: 18.5, cy: 11.5 };

/// A lens for kernel and twin: the push constants, and the map in double precision.
struct TestLens {
    push: LensPush,
    extended: Option<ExtendedLens>,
    size: Vec2,
}

impl TestLens {
    fn all(size: [u32; 2]) -> [Self; 2] {
        let pixels = Vec2::new(size[0] as f32, size[1] as f32);
        let distortion = Distortion::BrownConrady { k: [-0.12, 0.02, 0.0], p: [1e-3, -2e-3] };
        let k = Intrinsics {
            width: size[0],
            height: size[1],
            cx: 0.5 * f64::from(size[0]),
            cy: 0.5 * f64::from(size[1]),
            ..CAMERA
        };
        let extended = ExtendedLens::new(Lens::new(k, distortion).unwrap());
        [
            Self { push: LensPush::NONE, extended: None, size: pixels },
            Self { push: LensPush::new(&extended, size, 1.0), extended: Some(extended), size: pixels },
        ]
    }

    fn camera(&self) -> Option<(&ExtendedLens, DVec2, DVec2)> {
        let lens = self.extended.as_ref()?;
        let k = lens.lens().intrinsics();
        let size = self.size.as_dvec2();
        let scale = 2.0 * DVec2::new(k.fx, k.fy) / size;
        Some((lens, scale, 2.0 * DVec2::new(k.cx, k.cy) / size - 1.0))
    }

    fn sensor(&self, clip: Vec4) -> Vec4 {
        let Some((lens, scale, centre)) = self.camera() else { return clip };
        let (xy, w) = (DVec2::new(clip.x.into(), clip.y.into()), f64::from(clip.w));
        let at = (xy - centre * w) / scale;
        // Behind the camera the map goes on in straight lines.
        let seen = match w > 0.0 {
            true => lens.sensor(at / w) * w,
            false => {
                let edge = at * (lens.radius() / at.length());
                (lens.sensor(edge) - lens.slope() * edge) * w + lens.slope() * at
            }
        };
        let ndc = (centre * w + scale * seen).as_vec2();
        Vec4::new(ndc.x, ndc.y, clip.z, clip.w)
    }

    fn ideal(&self, ndc: Vec2) -> Vec2 {
        let Some((lens, scale, centre)) = self.camera() else { return ndc };
        let seen = (ndc.as_dvec2() - centre) / scale;
        let mut at = seen;
        for _ in 0..200 {
            at += seen - lens.sensor(at);
        }
        (centre + scale * at).as_vec2()
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PlacePush {
    vertex_count: u32,
    knot_count: u32,
    place_low: f32,
    place_high: f32,
    place_from_ndc: [f32; 2],
    place_offset: f32,
    near_m: f32,
    lens: LensPush,
}
assert_push_layout!(
    "exact_place.comp",
    PlacePush { vertex_count, knot_count, place_low, place_high, place_from_ndc, place_offset, near_m, lens }
);

/// Floats of a placed vertex.
const PLACED: usize = 22;

/// A camera that turns, passes and accelerates over the knots, in front of an object that turns by itself.
fn knots(groups: u32, count: u32, scatter: &mut Scatter) -> Vec<Knot> {
    let mut knots = Vec::new();
    for _ in 0..groups {
        let rates = [0; 6].map(|_| f64::from(scatter.between(-0.6, 0.6)));
        for k in 0..count {
            let t = if count > 1 { f64::from(k) / f64::from(count - 1) } else { 0.0 };
            let turn = DQuat::from_euler(
                glam::EulerRot::YXZ,
                rates[0] * t + rates[1] * t * t,
                rates[2] * t,
                0.3 * t,
            );
            let eye = DVec3::new(rates[3] * t, rates[4] * t, rates[5] * t);
            let (fx, fy) =
                (2.0 * CAMERA.fx / f64::from(CAMERA.width), 2.0 * CAMERA.fy / f64::from(CAMERA.height));
            let projection = DMat4::from_cols_array(&[
                fx, 0.0, 0.0, 0.0, 0.0, fy, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, NEAR_M, 0.0,
            ]);
            let world = DMat4::from_rotation_translation(turn, eye);
            knots.push(Knot {
                clip_from_object: (projection * world.inverse()).as_mat4(),
                centred_from_object: DMat4::from_rotation_z(rates[5] * t).as_mat4(),
                eye_m: eye.as_vec3(),
            });
        }
    }
    knots
}

/// In view, beside it, and behind the camera.
fn vertices(groups: u32, scatter: &mut Scatter) -> Vec<exact_place::Vertex> {
    let vertex = |i: u32| exact_place::Vertex {
        position_m: match i % 9 {
            0 => {
                Vec3::new(scatter.between(-2.0, 2.0), scatter.between(-2.0, 2.0), scatter.between(-3.0, -0.1))
            }
            1 => Vec3::new(scatter.between(-9.0, 9.0), 0.0, 0.011),
            _ => Vec3::new(scatter.between(-2.0, 2.0), scatter.between(-1.0, 1.0), scatter.between(0.5, 9.0)),
        },
        normal: Vec3::new(scatter.number(), scatter.number(), -1.0),
        group: i % groups,
    };
    (0..331).map(vertex).collect()
}

fn run_place(
    bench: &mut Bench,
    (push, lens): (&exact_place::Push, &TestLens),
    knots: &[Knot],
    vertices: &[exact_place::Vertex],
) -> Plane<f32> {
    let rows: Vec<f32> = knots
        .iter()
        .flat_map(|k| {
            let matrices = [k.clip_from_object, k.centred_from_object].map(|m: Mat4| m.to_cols_array());
            [matrices.concat(), k.eye_m.extend(0.0).to_array().to_vec()].concat()
        })
        .collect();
    let raw: Vec<u32> = vertices
        .iter()
        .flat_map(|v| {
            let mut words: Vec<u32> = v.position_m.to_array().map(f32::to_bits).to_vec();
            words.push(v.group);
            words.extend(v.normal.to_array().map(f32::to_bits));
            words.push(v.group % 2);
            words.extend([0.25_f32, 0.75].map(f32::to_bits));
            words
        })
        .collect();
    let materials: Vec<f32> = (0..16).map(|i| i as f32).collect();
    let [knots, raw, materials] = [
        bench.filled(Usage::Storage, &rows),
        bench.filled(Usage::Storage, &raw),
        bench.filled(Usage::Storage, &materials),
    ];
    let placed = bench.buffer(vertices.len() * PLACED * 4);
    let resources = [
        ("Vertices", Bound::Buffer(&raw)),
        ("Knots", Bound::Buffer(&knots)),
        ("Materials", Bound::Buffer(&materials)),
        ("PlacedVertices", Bound::Buffer(&placed)),
    ];
    let full = PlacePush {
        vertex_count: vertices.len() as u32,
        knot_count: push.knot_count,
        place_low: push.place_low,
        place_high: push.place_high,
        place_from_ndc: push.place_from_ndc.to_array(),
        place_offset: push.place_offset,
        near_m: push.near_m,
        lens: lens.push,
    };
    let constants = [1, u32::from(lens.extended.is_some())];
    let size = [vertices.len() as u32, 1];
    bench.run(const { kernel("exact_place.comp") }, &constants, &resources, &full, size);
    let bytes = bench.read_buffer(&placed, vertices.len() * PLACED * 4);
    let mut data: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    for (i, v) in data.chunks_exact_mut(PLACED).enumerate() {
        let material = (vertices[i].group % 2) as f32 * 8.0;
        assert_eq!(
            v[12..21],
            [
                0.25,
                0.75,
                material,
                material + 1.0,
                material + 2.0,
                material + 4.0,
                material + 5.0,
                material + 6.0,
                material + 7.0
            ]
        );
        assert_eq!(v[21].to_bits(), vertices[i].group);
        v[12..].fill(0.0);
    }
    Plane { width: vertices.len(), height: 1, channels: PLACED, data }
}

fn place_twin(
    (push, lens): (&exact_place::Push, &TestLens),
    knots: &[Knot],
    vertices: &[exact_place::Vertex],
) -> Plane<f32> {
    let row = |v: &exact_place::Vertex| {
        let p = exact_place(push, knots, v, &|clip| lens.sensor(clip));
        let parts = [p.clip_xyw, p.position_m, p.normal, p.eye_m].map(|v| v.to_array());
        let mut row = parts.concat();
        row.resize(PLACED, 0.0);
        row
    };
    Plane {
        width: vertices.len(),
        height: 1,
        channels: PLACED,
        data: vertices.iter().flat_map(row).collect(),
    }
}

#[test]
fn exact_place_is_its_twin() {
    let Some(mut bench) = Bench::new("exact_place_is_its_twin") else { return };
    let mut scatter = Scatter(31);
    let mut seen = 0;
    for lens in &TestLens::all([CAMERA.width, CAMERA.height]) {
        for (groups, count) in [(1, 1), (1, 3), (2, 5), (3, 9), (5, 129)] {
            for along in [Vec2::Y, Vec2::NEG_Y, Vec2::X, Vec2::NEG_X] {
                let knots = knots(groups, count, &mut scatter);
                let vertices = vertices(groups, &mut scatter);
                let last = count as f32 - 1.0;
                let push = exact_place::Push {
                    knot_count: count,
                    place_low: -0.2 * last,
                    place_high: 1.2 * last,
                    place_from_ndc: 0.45 * last * along,
                    place_offset: 0.5 * last,
                    near_m: NEAR_M as f32,
                };
                let got = run_place(&mut bench, (&push, lens), &knots, &vertices);
                let want = place_twin((&push, lens), &knots, &vertices);
                let (_, outliers) = differing(&got, &want, 2e-4);
                let label = format!("lens {}, {groups} groups, {count} knots, {along}", lens.push.index());
                // Where the secant's slope is a quotient of two tiny numbers, rounding decides.
                assert!(outliers <= vertices.len() / 100, "{label}: {outliers} of {}", vertices.len());
                if count > 1 {
                    let late = exact_place::Push { place_offset: push.place_offset + 0.01 * last, ..push };
                    let wrong = place_twin((&late, lens), &knots, &vertices);
                    seen += usize::from(differing(&got, &wrong, 2e-4).1 > vertices.len() / 10);
                }
            }
        }
    }
    assert!(seen >= 30, "control: lines a hundredth of the readout later are seen in {seen} of 32 cases");
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PathsPush {
    size: [u32; 2],
    line_count: u32,
    columns: u32,
    lens: LensPush,
    near_m: f32,
}
assert_push_layout!("exact_paths.comp", PathsPush { size, line_count, columns, lens, near_m });

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

fn run_paths(bench: &mut Bench, case: &PathsCase, lens: &TestLens) -> [Plane<f32>; 2] {
    let size = [case.color.width / case.grid, case.color.height / case.grid];
    let color = bench.upload(std::slice::from_ref(&case.color), Format::Rgba32f, false);
    let depth = bench.upload(std::slice::from_ref(&case.depth), Format::R32f, false);
    let row = |line: usize, texel: usize| {
        let relative = &case.relatives[line * case.groups + texel / 6];
        [relative.begin, relative.end][texel % 6 / 3][texel % 3].to_array()
    };
    let matrices = Plane::from_fn(6 * case.groups, case.line_count, |x, y| row(y, x));
    let matrices = bench.upload(std::slice::from_ref(&matrices), Format::Rgba32f, false);
    let texels = bench.empty([case.color.width, case.color.height], Format::Rgba16f, 1, false);
    let paths = bench.empty(size, Format::Rgba16f, 1, false);
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let resources = [
        ("color_samples", Bound::Sampled(&color, &sampler)),
        ("depth_samples", Bound::Sampled(&depth, &sampler)),
        ("texels", Bound::Storage(&texels)),
        ("paths", Bound::Storage(&paths)),
        ("relatives", Bound::Sampled(&matrices, &sampler)),
    ];
    let push = PathsPush {
        size: size.map(|s| s as u32),
        line_count: case.line_count as u32,
        columns: case.columns.into(),
        lens: lens.push,
        near_m: NEAR_M as f32,
    };
    let constants = [case.grid as u32, 1, u32::from(lens.extended.is_some())];
    let along = if case.columns { [push.size[1], push.size[0]] } else { push.size };
    bench.run(const { kernel("exact_paths.comp") }, &constants, &resources, &push, along);
    [bench.read(&texels).remove(0), bench.read(&paths).remove(0)]
}

fn paths_twin(case: &PathsCase, lens: &TestLens) -> (Plane<f32>, Plane<f32>) {
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
                    "{size:?}, grid {grid}, {groups} groups, columns {columns}, lens {}",
                    lens.push.index()
                );
                let [texels, paths] = run_paths(&mut bench, &case, lens);
                let (want_texels, want_paths) = paths_twin(&case, lens);
                assert_eq!(differing(&texels, &want_texels, HALF).1, 0, "{label}: texels");
                assert_eq!(differing(&paths, &want_paths, HALF).1, 0, "{label}: paths");
                if size == [1, 1] {
                    continue;
                }
                let mut wrong = paths_case(size, grid, groups, columns, &mut scatter);
                wrong.color.clone_from(&case.color);
                wrong.depth.clone_from(&case.depth);
                wrong.relatives =
                    case.relatives.iter().map(|r| Relative { begin: r.end, end: r.end }).collect();
                (wrong.line_count, wrong.groups) = (case.line_count, case.groups);
                let seen = differing(&paths, &paths_twin(&wrong, lens).1, HALF).1;
                assert!(2 * seen > size[0] * size[1], "control: {label}: begin for end is seen in {seen} px");
                wrong.relatives = case.relatives.iter().rev().copied().collect();
                let seen = differing(&paths, &paths_twin(&wrong, lens).1, HALF).1;
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
