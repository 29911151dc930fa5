//! The device's rasterizer against the CPU reference, through the engine's sharp planes: colour, depth and motion, with
//! 1, 4 and 16 samples a pixel.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::frames::{INTERVAL_S, accumulation, engine, options, still};
use crate::gpu_support::scenes::{edge_length_px, flat_ids, rich, step_around, uniform_around, walk};
use crate::gpu_support::{Watched, device};
use crate::long_support::some_of;
use glam::{DVec2, DVec3};
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::engine::Planes;
use shutterbug::gpu::DeviceKind;
use shutterbug::plane::Plane;
use shutterbug::reference::raster::{MotionSpan, Rendered, View, render};
use shutterbug::scene::{Scene, Shading};

const START_S: f64 = 0.01;
/// The grid that vertex positions and edges are rounded to, px.
fn grid_px(watched: &Watched) -> f64 {
    0.5_f64.powi(watched.0.info().sub_pixel_bits as i32)
}

/// Relative error of the depth: float arithmetic, and a shift by half the grid of a surface whose depth changes by up
/// to 2 % a px (a picture of one px has no neighbours that would tell).
fn depth_tolerance(grid_px: f64) -> f32 {
    (1e-5 + 0.01 * grid_px) as f32
}

fn camera(width: u32, height: u32) -> Intrinsics {
    let (w, h) = (f64::from(width), f64::from(height));
    // A picture of one px sees one surface.
    let f = w.max(40.0);
    Intrinsics { width, height, fx: 0.83 * f, fy: 0.85 * f, cx: 0.483 * w, cy: 0.517 * h }
}

fn planes(watched: &Watched, scene: &Scene, path: &Trajectory, k: Intrinsics, samples: u32) -> Planes {
    let request = shutterbug::engine::FrameRequest { planes: true, ..still(&k) };
    let mut engine = engine(watched, scene, path, k, options(accumulation(1), samples), &[]);
    engine.render(&request).unwrap().planes.unwrap()
}

/// The reference with samples at these places of a pixel.
fn reference(scene: &Scene, path: &Trajectory, k: Intrinsics, places: &[[f32; 2]]) -> Rendered {
    let view = View { intrinsics: k, world_from_camera: path.pose_at(START_S), time_s: START_S };
    let (from_s, to_s) = (START_S, START_S + INTERVAL_S);
    let span = MotionSpan { trajectory: path, from_s, to_s, scale: 1.0 };
    render(scene, &view, places, Some(&span))
}

/// Where a device shades: once a texel, at its centre; 16 samples are 2x2 texels of 4.
fn shaded_places(samples: u32) -> Vec<[f32; 2]> {
    match samples {
        16 => vec![[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]],
        _ => vec![[0.5, 0.5]],
    }
}

/// Reference pictures of one scene.
struct Wanted {
    /// Shaded where the device shades: colour and motion of pixels that show one surface alone.
    shaded: Rendered,
    /// Depth by sample.
    sampled: Rendered,
    /// The quads by number.
    ids: Rendered,
}

impl Wanted {
    fn new(scene: &Scene, path: &Trajectory, k: Intrinsics, samples: u32) -> Self {
        let places = sample_positions(samples);
        Self {
            shaded: reference(scene, path, k, &shaded_places(samples)),
            sampled: reference(scene, path, k, &places),
            ids: reference(&flat_ids(scene), path, k, &places),
        }
    }
}

/// Largest difference of a channel of one pixel.
fn apart(a: &Plane<f32>, b: &Plane<f32>, [x, y]: [usize; 2]) -> f32 {
    a.pixel(x, y).iter().zip(b.pixel(x, y)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn inverse(depth_m: &Plane<f32>) -> Plane<f32> {
    Plane { data: depth_m.data.iter().map(|d| 1.0 / d).collect(), ..depth_m.clone() }
}

/// What a shift by the grid of vertex positions changes.
fn shift(plane: &Plane<f32>, [x, y]: [usize; 2], grid_px: f64) -> f32 {
    2.0 * grid_px as f32 * step_around(plane, x, y)
}

/// Pixels inside surfaces (the same surface all around), how many of them differ by more than arithmetic explains, and
/// the largest differences: colour, depth (relative), motion (px).
#[derive(Debug, Default)]
struct Interior {
    pixels: usize,
    wrong: usize,
    worst: [f32; 3],
    /// The first that are wrong.
    told: String,
}

fn interior(got: &Planes, want: &Wanted, watched: &Watched) -> Interior {
    let grid_px = grid_px(watched);
    let mut interior = Interior::default();
    let (got_inverse, want_inverse) = (inverse(&got.depth_m), inverse(&want.sampled.depth_m));
    let (color, motion) = (&want.shaded.color, &want.shaded.motion_px);
    // Samplers of GPUs weigh texels in steps of 1/256 in each direction, of texels that may be as bright as anything.
    let brightest = match watched.0.info().kind {
        DeviceKind::Cpu => 1.0,
        _ => color.data.iter().fold(1.0, |m: f32, v| m.max(*v)),
    };
    for (x, y) in (0..color.height).flat_map(|y| (0..color.width).map(move |x| (x, y))) {
        if !uniform_around(&want.ids.color, x, y) {
            continue;
        }
        let at = [x, y];
        let off = [
            apart(&got.color, color, at),
            apart(&got_inverse, &want_inverse, at),
            apart(&got.motion_px, motion, at),
        ];
        let scale = want_inverse.pixel(x, y)[0];
        // Samples are half floats (11 bits).
        let own = color.pixel(x, y).iter().fold(1.0, |m: f32, v| m.max(*v));
        let allowed = [
            1e-3 * own + 2.0 / 256.0 * brightest.max(own) + shift(color, at, grid_px),
            depth_tolerance(grid_px) * scale + shift(&want_inverse, at, grid_px),
            2e-3 + shift(motion, at, grid_px),
        ];
        interior.pixels += 1;
        let wrong = off.iter().zip(allowed).any(|(off, allowed)| !(*off <= allowed));
        if wrong && interior.wrong < 10 {
            let (got, want) = (got.color.pixel(x, y), color.pixel(x, y));
            let now = format!("({x}, {y}) is off by {off:?}, allowed {allowed:?}: {got:?}, not {want:?}\n");
            interior.told += &now;
        }
        interior.wrong += usize::from(wrong);
        let relative = [off[0], if scale > 0.0 { off[1] / scale } else { off[1] }, off[2]];
        for (worst, off) in interior.worst.iter_mut().zip(relative) {
            *worst = worst.max(off);
        }
    }
    interior
}

/// Pixels in which a sample shows another surface than it should, or the nearest sample's depth is another one: inside
/// surfaces and at their edges.
fn coverage(got: &Planes, want: &Rendered, grid_px: f64) -> [usize; 2] {
    let (got_inverse, want_inverse) = (inverse(&got.depth_m), inverse(&want.depth_m));
    let mut wrong = [0, 0];
    for (x, y) in (0..want.color.height).flat_map(|y| (0..want.color.width).map(move |x| (x, y))) {
        let at = [x, y];
        let depth = apart(&got_inverse, &want_inverse, at)
            > depth_tolerance(grid_px) * want_inverse.pixel(x, y)[0] + shift(&want_inverse, at, grid_px);
        // One sample of 16 changes the number by 1/16 at least.
        if depth || apart(&got.color, &want.color, at) > 0.03 {
            wrong[usize::from(!uniform_around(&want.color, x, y))] += 1;
        }
    }
    wrong
}

#[test]
fn surfaces_are_those_of_the_reference() {
    let test = "surfaces_are_those_of_the_reference";
    let Some(watched) = device(test) else { return };
    let path = walk();
    let cases: Vec<(u32, usize)> = [1, 4, 16].into_iter().flat_map(|s| [(s, 0), (s, 5), (s, 11)]).collect();
    for (width, height) in [(1, 1), (37, 23), (161, 119), (320, 240)] {
        let k = camera(width, height);
        // A quarter of nine has each count of samples and each of lights.
        for (samples, lights) in some_of(test, if width < 161 { 1 } else { 4 }, cases.clone()) {
            let scene = rich(lights);
            let want = Wanted::new(&scene, &path, k, samples);
            let got = planes(&watched, &scene, &path, k, samples);
            let d = interior(&got, &want, &watched);
            eprintln!("{width}x{height}, {samples} samples, {lights} lights: {d:?}");
            assert_eq!(d.wrong, 0, "{width}x{height}, {samples} samples, {lights} lights: {d:#?}");
            if width == 161 {
                controls(&got, &scene, want, (k, samples), &watched);
            }
        }
    }
}

/// Wrong answers are seen: a shifted camera, one light less, motion backwards.
fn controls(
    got: &Planes,
    scene: &Scene,
    mut want: Wanted,
    (k, samples): (Intrinsics, u32),
    watched: &Watched,
) {
    let (path, places) = (walk(), shaded_places(samples));
    let seen = |shaded: Rendered, want: &Wanted| {
        let want = Wanted { shaded, sampled: want.sampled.clone(), ids: want.ids.clone() };
        interior(got, &want, watched).wrong
    };
    // A tenth of a px, or what a coarse grid leaves visible.
    let cx = k.cx + 0.1_f64.max(6.0 * grid_px(watched));
    let shifted = reference(scene, &path, Intrinsics { cx, ..k }, &places);
    assert!(seen(shifted, &want) > 1000, "control: a shifted camera");
    if let Shading::Lit(lights) = &scene.shading {
        // The first is a constant of the shader, the last of eleven is read from a buffer.
        for some in [&lights[1..], &lights[..lights.len() - 1]] {
            let fewer = Scene { shading: Shading::Lit(some.to_vec()), ..scene.clone() };
            assert!(seen(reference(&fewer, &path, k, &places), &want) > 1000, "control: a light is missing");
        }
    }
    want.shaded.motion_px.data.iter_mut().for_each(|v| *v = -*v);
    assert!(seen(want.shaded.clone(), &want) > 1000, "control: motion backwards");
}

#[test]
fn edges_are_those_of_the_reference() {
    let Some(watched) = device("edges_are_those_of_the_reference") else { return };
    let (path, scene, grid_px) = (walk(), flat_ids(&rich(0)), grid_px(&watched));
    for (width, height) in [(1, 1), (37, 23), (161, 119), (641, 479)] {
        let k = camera(width, height);
        let length_px = edge_length_px(&scene, &k, &path.pose_at(START_S), START_S);
        for samples in [1, 4, 16] {
            let places = sample_positions(samples);
            let got = planes(&watched, &scene, &path, k, samples);
            let wrong = coverage(&got, &reference(&scene, &path, k, &places), grid_px);
            // A vertex moves by half the grid at most (1/512 px on lavapipe), and so does an edge: a sample changes
            // sides if it lies within that band, on the side that the edge moves to.
            let allowed = 0.5 * grid_px * length_px * f64::from(samples) + 4.0;
            let label = format!("{width}x{height}, {samples} samples, {length_px:.0} px of edges");
            eprintln!("{label}: {wrong:?} px off inside and at edges, {allowed:.0} allowed");
            assert_eq!(wrong[0], 0, "{label}: inside");
            assert!(wrong[1] as f64 <= allowed, "{label}: {wrong:?}");
            let shifted = reference(&scene, &path, Intrinsics { cx: k.cx + 0.1, ..k }, &places);
            let seen = coverage(&got, &shifted, grid_px)[1] as f64;
            // A grid of 1/16 px is as coarse as the control.
            let tells = width > 100 && grid_px < 0.01;
            assert!(!tells || seen > 1.5 * allowed, "control: {label}: {seen} px");
        }
    }
}

/// Where the surface point of a pixel falls at a later time, from fx, cx and the poses, not from the library's
/// formulas.
fn seen_at(k: &Intrinsics, pixel: DVec2, depth_m: f64, before: &[Pose; 2], after: &[Pose; 2]) -> DVec2 {
    let ray = DVec3::new((pixel.x - k.cx) / k.fx, (pixel.y - k.cy) / k.fy, 1.0);
    let [camera, object] = before;
    let world = camera.rotation * (ray * depth_m) + camera.translation_m;
    let in_object = object.rotation.conjugate() * (world - object.translation_m);
    let [camera, object] = after;
    let world = object.rotation * in_object + object.translation_m;
    let p = camera.rotation.conjugate() * (world - camera.translation_m);
    DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy)
}

#[test]
fn motion_is_the_finite_difference_of_projections() {
    let Some(watched) = device("motion_is_the_finite_difference_of_projections") else { return };
    let (scene, path, k) = (rich(0), walk(), camera(161, 119));
    let got = planes(&watched, &scene, &path, k, 1);
    let ids = reference(&flat_ids(&scene), &path, k, &[[0.5, 0.5]]).color;
    let poses = |object: usize, t: f64| [path.pose_at(t), scene.objects[object].world_from_object(t)];
    let (mut checked, mut worst, mut as_if_resting) = ([0, 0], 0.0_f64, 0.0_f64);
    for (x, y) in (0..119).flat_map(|y| (0..161).map(move |x| (x, y))) {
        let depth_m = f64::from(got.depth_m.pixel(x, y)[0]);
        if !uniform_around(&ids, x, y) || !depth_m.is_finite() {
            continue;
        }
        let quad = ids.pixel(x, y)[0] as usize - 1;
        let object = scene.vertices[4 * quad].object as usize;
        let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let later = |object: usize| {
            let (before, after) = (poses(object, START_S), poses(object, START_S + INTERVAL_S));
            seen_at(&k, pixel, depth_m, &before, &after) - pixel
        };
        let motion = got.motion_px.pixel(x, y);
        let off = |want: DVec2| (DVec2::new(motion[0].into(), motion[1].into()) - want).length();
        let want = later(object);
        // The depth itself carries 1e-5, the motion of near points is large: relative to its length.
        worst = worst.max(off(want) / want.length().max(1.0));
        checked[object] += 1;
        if object == 1 {
            as_if_resting = as_if_resting.max(off(later(0)));
        }
    }
    eprintln!("motion: worst {worst:.2e} of its length, {checked:?} px of world and object");
    assert!(checked[0] > 5000 && checked[1] > 300, "{checked:?}");
    assert!(worst < 1e-3, "{worst}");
    assert!(as_if_resting > 5.0, "control: the object's own motion counts: {as_if_resting} px");
}

#[test]
fn quads_drawn_second_or_behind_do_not_show() {
    // The order of drawing must not matter: depth decides.
    let Some(watched) = device("quads_drawn_second_or_behind_do_not_show") else { return };
    let (scene, path, k) = (rich(0), walk(), camera(61, 47));
    let mut reversed = scene.clone();
    reversed.indices = scene.indices.chunks_exact(3).rev().flatten().copied().collect();
    let reversed = crate::gpu_support::scenes::drawable(reversed);
    assert_ne!(scene.indices, reversed.indices);
    let (a, b) = (planes(&watched, &scene, &path, k, 16), planes(&watched, &reversed, &path, k, 16));
    assert_eq!(a, b);
    let mut fewer = scene;
    fewer.draws.pop();
    assert_ne!(a.color, planes(&watched, &fewer, &path, k, 16).color, "control");
}
