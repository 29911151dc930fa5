//! The placing of vertices of `--method exact` against its CPU twin: in view, beside it and behind the camera, all
//! directions of lines, few and many knots, with and without a lens; with a control.
#![allow(clippy::unwrap_used)]

use crate::exact_support::{CAMERA, TestLens};
use crate::gpu_support::bench::{Bench, Scatter, differing};
use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DQuat, DVec3, Mat4, Vec2, Vec3};
use shutterbug::assert_push_layout;
use shutterbug::camera::NEAR_M;
use shutterbug::gpu::{Bound, Usage};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::raster::LensPush;
use shutterbug::reference::exact_place::{self, Knot, exact_place};

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

/// As the kernel reads them.
fn knot_words(knots: &[Knot]) -> Vec<f32> {
    knots
        .iter()
        .flat_map(|k| {
            let matrices = [k.clip_from_object, k.centred_from_object].map(|m: Mat4| m.to_cols_array());
            [matrices.concat(), k.eye_m.extend(0.0).to_array().to_vec()].concat()
        })
        .collect()
}

/// As the kernel reads them; materials take turns.
fn vertex_words(vertices: &[exact_place::Vertex]) -> Vec<u32> {
    vertices
        .iter()
        .flat_map(|v| {
            let mut words: Vec<u32> = v.position_m.to_array().map(f32::to_bits).to_vec();
            words.push(v.group);
            words.extend(v.normal.to_array().map(f32::to_bits));
            words.push(v.group % 2);
            words.extend([0.25_f32, 0.75, 0.0, 0.0].map(f32::to_bits));
            words
        })
        .collect()
}

fn run_place(
    bench: &mut Bench,
    (push, lens): (&exact_place::Push, &TestLens),
    knots: &[Knot],
    vertices: &[exact_place::Vertex],
) -> Plane<f32> {
    let (rows, raw) = (knot_words(knots), vertex_words(vertices));
    let materials: Vec<f32> = (0..16).map(|i| i as f32).collect();
    let [knots, raw, materials] = [
        bench.filled(Usage::StorageTexels, &rows),
        bench.filled(Usage::StorageTexels, &raw),
        bench.filled(Usage::StorageTexels, &materials),
    ];
    let placed = bench.buffer(vertices.len() * PLACED * 4);
    let resources = [
        ("vertices", Bound::Buffer(&raw)),
        ("knots", Bound::Buffer(&knots)),
        ("materials", Bound::Buffer(&materials)),
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
    let bytes = vertices.len() * PLACED * 4;
    bench.run(const { kernel("exact_place_words.comp") }, &constants, &resources, &full, size);
    let words = bench.read_buffer(&placed, bytes);
    bench.run(const { kernel("exact_place.comp") }, &constants, &resources, &full, size);
    let bytes = bench.read_buffer(&placed, bytes);
    assert!(bytes == words, "what is read as texels is placed elsewhere than what is read as words");
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
