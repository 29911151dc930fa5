//! The warp of `--method fast` on synthetic pictures: closed forms on the CPU twin, and the kernels against the twin.
//! Every comparison has a control that must fail.
#![allow(clippy::unwrap_used)]

use crate::fast_device::{Field, on_device};
use crate::gpu_support::bench::{Bench, Scatter};
use crate::gpu_support::device;
use crate::long_support::some_of;
use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec4};
use shutterbug::assert_push_layout;
use shutterbug::camera::ScanOrder;
use shutterbug::gpu::{Bound, Format, Sampler};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::reference::fast_depth::fast_depth;
use shutterbug::reference::fast_gather::fast_gather;
use shutterbug::reference::fast_push::Push;
use shutterbug::reference::timing::scan_order_code;

const W: usize = 96;
const H: usize = 64;
const MARGIN: usize = 40;
/// Readout of all closed forms, s; the reference instant lies in its middle.
const READOUT_S: f32 = 0.03;

/// Lines of `order` read over [`READOUT_S`], and knots over readout and exposure.
fn push(order: ScanOrder, exposure_time_s: f32, knots: u32) -> Push {
    let span_s = READOUT_S + exposure_time_s;
    Push {
        size: [W as u32, H as u32],
        margin_px: [MARGIN as i32; 2],
        start_s: -0.5 * span_s,
        readout_time_s: READOUT_S,
        exposure_time_s,
        knot_step_s: span_s / knots as f32,
        reference_knot: knots / 2,
        last_knot: knots,
        scan_order: scan_order_code(order),
        max_samples: 240,
        slots: if exposure_time_s > 0.0 { 3 } else { 1 },
        picture_s: 0.0,
        from_s: 0.0,
        to_s: 0.0,
        first: [0; 2],
    }
}

/// Time of a pixel's exposure's middle after the reference instant, s.
fn time_s(p: &Push, order: ScanOrder, x: usize, y: usize) -> f32 {
    let line = order.line_of(x as u32, y as u32, W as u32, H as u32) as f32;
    let count = order.line_count(W as u32, H as u32) as f32;
    p.start_s + p.readout_time_s * line / count + 0.5 * p.exposure_time_s
}

/// A plane of values: red rises by 1/200 a px along x, green along y. Read exactly at any place.
fn slope(x: f32, y: f32) -> [f32; 3] {
    [0.3 + x / 200.0, 0.3 + y / 200.0, 0.25]
}

/// Velocity, px/s, and acceleration, px/s^2, of a picture that moves as a whole.
const V: [f32; 2] = [500.0, -300.0];
const A: [f32; 2] = [30_000.0, 20_000.0];

fn moved(t: f32) -> [f32; 2] {
    [0, 1].map(|i| V[i] * t + 0.5 * A[i] * t * t)
}

/// Largest place error, px, of a picture that moves by `path` and integrates over `exposure`.
fn worst_px(radiance: &Plane<f32>, p: &Push, order: ScanOrder, path: impl Fn(f32) -> [f32; 2]) -> f32 {
    let mut worst = 0.0_f32;
    for (x, y) in (0..H).flat_map(|y| (0..W).map(move |x| (x, y))) {
        let t = time_s(p, order, x, y);
        // The mean over the exposure of a linear picture is that of the displacement.
        let parts = [-0.387_298_33, 0.0, 0.387_298_33].map(|g| path(t + g * p.exposure_time_s));
        let mean = [0, 1].map(|i| (5.0 * parts[0][i] + 8.0 * parts[1][i] + 5.0 * parts[2][i]) / 18.0);
        let want = slope(x as f32 + 0.5 - mean[0], y as f32 + 0.5 - mean[1]);
        let got = radiance.pixel(x, y);
        worst = worst.max(200.0 * (got[0] - want[0]).abs()).max(200.0 * (got[1] - want[1]).abs());
    }
    worst
}

#[test]
fn constant_acceleration_is_exact_in_all_scan_orders() {
    for order in ScanOrder::ALL {
        for (exposure, tolerance_px) in [(0.0, 2e-3), (0.01, 2e-2)] {
            for (knots, color_scale) in [(2, 1), (4, 2), (6, 2)] {
                let p = push(order, exposure, knots);
                let field = Field::new(&p, color_scale, 1, slope, |_, _, t| (moved(t), 1.0));
                let radiance = fast_gather(&p, &field.inputs());
                let worst = worst_px(&radiance, &p, order, moved);
                assert!(worst < tolerance_px, "{order}, exposure {exposure}, {knots} knots: {worst} px");
                assert!(radiance.data.chunks(4).all(|v| v[3] > 0.0), "{order}: a source left the picture");
                let chord = |t: f32| [0, 1].map(|i| V[i] * t);
                let control = worst_px(&radiance, &p, order, chord);
                assert!(control > 1.0, "control: constant velocity passes, {control} px");
                let late = worst_px(&radiance, &p, order, |t| moved(t + 0.5 * exposure + 1e-4));
                assert!(late > 0.04, "control: a wrong instant passes, {late} px");
            }
        }
    }
}

#[test]
fn motion_that_depends_on_the_place_is_inverted() {
    // A zoom about (20, 10): p stands at p + z (p - c) at t; the pixel at x shows c + (x - c) / (1 + z).
    let zoom = |t: f32| 6.0 * t;
    let path = |x: f32, y: f32, t: f32| ([zoom(t) * (x - 20.0), zoom(t) * (y - 10.0)], 1.0);
    let order = ScanOrder::TopToBottom;
    let p = push(order, 0.0, 4);
    let field = Field::new(&p, 2, 1, slope, path);
    let radiance = fast_gather(&p, &field.inputs());
    let (mut worst, mut explicit) = (0.0_f32, 0.0_f32);
    for (x, y) in (0..H).flat_map(|y| (0..W).map(move |x| (x, y))) {
        let (px, py, z) = (x as f32 + 0.5, y as f32 + 0.5, zoom(time_s(&p, order, x, y)));
        let got = radiance.pixel(x, y)[0];
        worst = worst.max(200.0 * (got - slope(20.0 + (px - 20.0) / (1.0 + z), py)[0]).abs());
        explicit = explicit.max(200.0 * (got - slope(px - z * (px - 20.0), py)[0]).abs());
    }
    // Where claims are uneven, three steps of slope 0.09 are taken instead of a solution.
    assert!(worst < 0.05, "off by {worst} px");
    assert!(explicit > 0.2, "control: motion read at the destination passes, {explicit} px");
}

/// A red square of 24 px that moves by `v` px/s before a green ground at rest.
fn square(p: &Push, color_scale: usize, v: [f32; 2]) -> Field {
    let inside = |x: f32, y: f32| (36.0..60.0).contains(&x) && (20.0..44.0).contains(&y);
    let color = move |x: f32, y: f32| if inside(x, y) { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let path =
        move |x: f32, y: f32, t: f32| if inside(x, y) { (v.map(|v| v * t), 0.5) } else { ([0.0; 2], 0.1) };
    Field::new(p, color_scale, 1, color, path)
}

#[test]
fn a_silhouette_moves_as_one_and_uncovers_the_ground() {
    for (order, v) in [
        (ScanOrder::TopToBottom, [900.0, 0.0]),
        (ScanOrder::BottomToTop, [-900.0, 100.0]),
        (ScanOrder::LeftToRight, [200.0, 800.0]),
    ] {
        let p = push(order, 0.0, 4);
        let radiance = fast_gather(&p, &square(&p, 2, v).inputs());
        let wrong = |v: [f32; 2]| {
            let mut count = 0;
            for (x, y) in (0..H).flat_map(|y| (0..W).map(move |x| (x, y))) {
                let t = time_s(&p, order, x, y);
                let (sx, sy) = (x as f32 + 0.5 - v[0] * t, y as f32 + 0.5 - v[1] * t);
                // How far inside the square. Within a px of its edge a pixel may be either, within two it may hold
                // both.
                let depth = (sx - 36.0).min(60.0 - sx).min(sy - 20.0).min(44.0 - sy);
                let red = radiance.pixel(x, y)[0];
                let both = (depth > 2.0 && red < 0.95) || (depth < -2.0 && red > 0.05);
                count += usize::from(both || (depth > 1.0 && red < 0.5) || (depth < -1.0 && red > 0.5));
            }
            count
        };
        assert_eq!(wrong(v), 0, "{order}");
        assert!(wrong([0.0, 0.0]) > 15, "control: {order}, a square at rest passes");
    }
}

#[test]
fn a_blurred_foreground_spreads_over_what_is_at_rest() {
    // Global shutter: the square passes 12 px during the exposure; coverage is a trapezoid along x.
    let p = Push {
        readout_time_s: 0.0,
        start_s: -0.01,
        knot_step_s: 0.005,
        ..push(ScanOrder::TopToBottom, 0.02, 4)
    };
    let radiance = fast_gather(&p, &square(&p, 2, [600.0, 0.0]).inputs());
    let (mut worst, mut sharp) = (0.0_f32, 0.0_f32);
    for x in 0..W {
        let px = x as f32 + 0.5;
        let share = |edge: f32| ((px - edge) / 12.0 + 0.5).clamp(0.0, 1.0);
        let got = radiance.pixel(x, 32);
        worst = worst.max((got[0] - (share(36.0) - share(60.0))).abs());
        sharp = sharp.max((got[0] - f32::from(u8::from((36.0..60.0).contains(&px)))).abs());
        assert!((got[0] + got[1] - 1.0).abs() < 1e-3, "column {x}: red and green are all there is");
    }
    // A sample is 1/13 of the exposure.
    assert!(worst < 0.1, "off by {worst}");
    assert!(sharp > 0.4, "control: no blur passes, {sharp}");
}

#[test]
fn neutral_parameters_return_the_picture_bit_for_bit() {
    let color = |x: f32, y: f32| {
        [(x * 12.9898 + y * 78.233).sin().abs(), (x * y * 0.37).cos().abs() * 1e4, 1e-9 * x.abs()]
    };
    for (color_scale, path_scale) in [(1, 1), (2, 1), (2, 2)] {
        for order in ScanOrder::ALL {
            let p = Push { start_s: 0.0, readout_time_s: 0.0, ..push(order, 0.0, 4) };
            let field = Field::new(&p, color_scale, path_scale, color, |x, _, t| {
                ([900.0 * t, 40.0 * x * t], 0.2 + 0.001 * x)
            });
            let same = |p: &Push| {
                let radiance = fast_gather(p, &field.inputs());
                (0..H)
                    .all(|y| (0..W).all(|x| field.still(x + MARGIN, y + MARGIN) == radiance.pixel(x, y)[..3]))
            };
            assert!(same(&p), "{order}, colour scale {color_scale}, path scale {path_scale}");
            assert!(!same(&Push { start_s: 1e-4, ..p }), "control: {order}, another instant passes");
        }
    }
}

/// Something of everything: texture, a turning ground, a square before it, both orders of silhouettes.
fn mixed(p: &Push, color_scale: usize, path_scale: usize) -> Field {
    let inside = |x: f32, y: f32| (30.0..52.0).contains(&x) && (18.0..40.0).contains(&y);
    let color = move |x: f32, y: f32| {
        let texture = 0.5 + 0.5 * (0.9 * x).sin() * (0.7 * y).cos();
        if inside(x, y) { [texture, 0.2, 0.1] } else { [0.1, texture, 1.0 - texture] }
    };
    let path = move |x: f32, y: f32, t: f32| {
        let turn = 4.0 * t;
        if inside(x, y) {
            ([700.0 * t + 9e3 * t * t, -250.0 * t], 0.4)
        } else {
            ([-turn * (y - 30.0) - 60.0 * t, turn * (x - 48.0)], 0.1 + 0.0005 * y.abs())
        }
    };
    Field::new(p, color_scale, path_scale, color, path)
}

#[test]
fn mirrored_input_in_mirrored_order_gives_the_mirrored_picture() {
    for (order, mirrored, horizontal) in [
        (ScanOrder::TopToBottom, ScanOrder::BottomToTop, false),
        (ScanOrder::LeftToRight, ScanOrder::RightToLeft, true),
    ] {
        let flip = |x: usize, y: usize| if horizontal { (W - 1 - x, y) } else { (x, H - 1 - y) };
        for exposure in [0.0, 0.012] {
            let p = push(order, exposure, 4);
            let field = mixed(&p, 2, 1);
            let straight = fast_gather(&p, &field.inputs());
            let q = push(mirrored, exposure, 4);
            let back = fast_gather(&q, &field.mirrored(horizontal).inputs());
            let mut off = [0usize; 2];
            for (x, y) in (0..H).flat_map(|y| (0..W).map(move |x| (x, y))) {
                let (mx, my) = flip(x, y);
                let far = |a: &[f32], b: &[f32]| (0..3).any(|c| (a[c] - b[c]).abs() > 0.02);
                off[0] += usize::from(far(straight.pixel(x, y), back.pixel(mx, my)));
                off[1] += usize::from(far(straight.pixel(x, y), back.pixel(x, y)));
            }
            // Quarters are asked in an order of their own, and claims of equal rank in that of their offsets.
            assert!(off[0] < W * H / 20, "{order}, exposure {exposure}: {} pixels differ", off[0]);
            assert!(off[1] > W * H / 2, "control: {order}: not mirrored passes");
        }
    }
}

/// How many pixels differ.
fn differing(a: &Plane<f32>, b: &Plane<f32>) -> usize {
    let pixel = |(a, b): (&[f32], &[f32])| (0..4).any(|c| (a[c] - b[c]).abs() > 1e-3);
    a.data.chunks(4).zip(b.data.chunks(4)).filter(|&p| pixel(p)).count()
}

/// Matrices of a camera that turns, and passes what it sees if `passes`: rows x, y and w for every knot.
fn moved_camera(p: &Push, passes: bool) -> Vec<[Vec4; 3]> {
    let times = (0..=p.last_knot).map(|k| (k as f32 - p.reference_knot as f32) * p.knot_step_s);
    let rows = |t: f32| {
        let way = if passes { 9.0 * t } else { 0.0 };
        [
            Vec4::new(1.0 + 0.2 * t, -2.0 * t, way, -4.0 * t - 90.0 * t * t),
            Vec4::new(2.0 * t, 1.0 + 0.2 * t, -0.4 * way, t),
            Vec4::new(0.3 * t, 0.1 * t, 0.1 * way, 1.0),
        ]
    };
    times.map(rows).collect()
}

#[test]
fn paths_from_depth_agree_with_their_images_and_with_their_twins() {
    let Some(context) = device("paths_from_depth_agree_with_their_images_and_with_their_twins") else {
        return;
    };
    let cases = [
        (ScanOrder::TopToBottom, 4, 2, false),
        (ScanOrder::RightToLeft, 6, 1, false),
        (ScanOrder::BottomToTop, 4, 1, true),
    ];
    for (order, knots, path_scale, one_surface) in cases {
        for exposure in [0.0, 0.012] {
            let few = push(order, exposure, knots);
            // Matrices at sixteen times as many knots: between two of them they are linear.
            let p = Push {
                knot_step_s: few.knot_step_s / 16.0,
                reference_knot: 16 * few.reference_knot,
                last_knot: 16 * few.last_knot,
                ..few
            };
            let moved = moved_camera(&p, !one_surface);
            let last_knot = p.last_knot;
            let field =
                Field { one_surface, moved, last_knot, paths: Vec::new(), ..mixed(&few, 2, path_scale) };
            let inputs = field.inputs();
            let got = on_device(&context.0, &p, &field);
            let label = format!("{order}, exposure {exposure}, {knots} knots, one surface: {one_surface}");
            let count = differing(&got, &fast_gather(&p, &inputs));
            assert!(count <= W * H / 500, "{label}: {count} pixels differ");
            // The same displacements as images, which blend positions where the others blend matrices.
            let image = |k: usize| {
                Plane::from_fn(field.inverse_depth.width, field.inverse_depth.height, |x, y| {
                    let at = |k: u32| 16.0 * if k < few.reference_knot { k as f32 } else { k as f32 + 1.0 };
                    let texel = IVec2::new(x as i32, y as i32);
                    let [a, b] = [2 * k, 2 * k + 1]
                        .map(|k| inputs.paths.depth_displacement(texel, at(k as u32)).unwrap());
                    [a.x, a.y, b.x, b.y]
                })
            };
            let paths = (0..knots as usize / 2).map(image).collect();
            let drawn = Field { moved: Vec::new(), paths, ..field.clone() };
            let drawn = fast_gather(&few, &drawn.inputs());
            let far = |(a, b): (&[f32], &[f32])| (0..3).any(|c| (a[c] - b[c]).abs() > 0.03);
            let off = got.data.chunks(4).zip(drawn.data.chunks(4)).filter(|&p| far(p)).count();
            assert!(off <= W * H / 50, "{label}: {off} pixels differ from those of images");
            let other = Push { start_s: p.start_s + 2e-3, ..p };
            let seen = differing(&got, &fast_gather(&other, &inputs));
            assert!(seen > W * H / 4, "control: {label}: 2 ms later is seen in {seen} pixels");
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct DepthPush {
    size: [u32; 2],
    depth_texels: u32,
}
assert_push_layout!("fast_depth.comp", DepthPush { size, depth_texels });

#[test]
fn fast_depth_is_its_twin() {
    let Some(mut bench) = Bench::new("fast_depth_is_its_twin") else { return };
    let (mut scatter, sampler) = (Scatter(5), Sampler::new(&bench.watched.0, false).unwrap());
    for (size, texels) in [([1, 1], 1), ([37, 23], 2), ([129, 71], 1), ([65, 7], 4)] {
        let depth = Plane::from_fn(size[0] * texels, size[1] * texels, |_, _| [scatter.number()]);
        let image = bench.upload(std::slice::from_ref(&depth), Format::R32f, false);
        let to = bench.empty(size, Format::R32f, 1, false);
        let resources =
            [("depth_samples", Bound::Sampled(&image, &sampler)), ("inverse_depth", Bound::Storage(&to))];
        let push = DepthPush { size: size.map(|s| s as u32), depth_texels: texels as u32 };
        bench.run(const { kernel("fast_depth.comp") }, &[], &resources, &push, push.size);
        let got = bench.read(&to).remove(0);
        let want = fast_depth(&depth, texels);
        assert!(got.data[..] == want.data[..], "{size:?}, {texels} texels");
        let mut mirrored = want.data.clone();
        mirrored.reverse();
        assert!(size == [1, 1] || got.data[..] != mirrored[..], "control: {size:?}: reversed passes");
    }
}

#[test]
fn kernels_agree_with_their_twins() {
    let test = "kernels_agree_with_their_twins";
    let Some(context) = device(test) else { return };
    let fields = [(2, 1, 1), (4, 2, 1), (6, 2, 2)];
    let cases = (0..4).flat_map(|i| [0.0, 0.012].into_iter().flat_map(move |e| fields.map(|f| (i, e, f))));
    // A fifth of 24 cases has each scan order, each field and both exposures.
    for (i, exposure, (knots, color_scale, path_scale)) in some_of(test, 5, cases) {
        let order = ScanOrder::ALL[i];
        let p = push(order, exposure, knots);
        let field = mixed(&p, color_scale, path_scale);
        let want = fast_gather(&p, &field.inputs());
        let got = on_device(&context.0, &p, &field);
        assert_eq!(got, on_device(&context.0, &p, &field), "{order}: two runs differ");
        // Divisions may round otherwise on a device, and at a silhouette the last bit decides who is seen.
        let count = differing(&got, &want);
        assert!(count <= W * H / 500, "{order}, exposure {exposure}, {knots} knots: {count} pixels differ");
        let other = fast_gather(&push(ScanOrder::ALL[(i + 1) % 4], exposure, knots), &field.inputs());
        assert!(differing(&got, &other) > W * H / 4, "control: another scan order passes");
    }
}
