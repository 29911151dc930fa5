//! `--method accumulation` on the device against the CPU's frames and against formulas: lean, stretch, ramp, energy.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::frames::{accumulation, engine, levels, linear, options, picture, request};
use crate::gpu_support::scenes::{drawable, edge_length_px, path, rich, walk};
use crate::gpu_support::{Watched, device};
use crate::oracle_forms::{K, moments, pan, quads, rectangle, slide};
use glam::{DQuat, DVec3};
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, Trajectory};
use shutterbug::engine::FrameRequest;
use shutterbug::plane::{Plane, srgb8};
use shutterbug::reference::accumulate::render_frame;
use shutterbug::scene::{Object, Scene};

const RENDERS: u32 = 24;

/// The reference's frame, encoded.
fn reference(scene: &Scene, path: &Trajectory, k: &Intrinsics, request: &FrameRequest) -> Plane<u8> {
    let plan = AccumulationPlan::new(&request.shutter, RENDERS);
    let linear = render_frame(scene, path, k, &request.shutter, &plan, &sample_positions(16));
    Plane::from_fn(linear.width, linear.height, |x, y| {
        let p = linear.pixel(x, y);
        [srgb8(p[0]), srgb8(p[1]), srgb8(p[2])]
    })
}

/// Textures are shaded once a texel on the device and once a sample by the reference: left out here, see
/// `raster_parity`.
fn untextured() -> Scene {
    let mut scene = rich(0);
    scene.materials.iter_mut().for_each(|m| m.texture = None);
    drawable(scene)
}

#[test]
fn frames_are_those_of_the_reference() {
    let Some(watched) = device("frames_are_those_of_the_reference") else { return };
    let k = Intrinsics { width: 81, height: 61, fx: 70.0, fy: 72.0, cx: 39.2, cy: 31.3 };
    let (scene, path) = (untextured(), walk());
    let length_px = edge_length_px(&scene, &k, &path.pose_at(0.01), 0.01);
    for (exposure_s, readout_s) in [(0.0, 0.04), (0.02, 0.0), (0.015, 0.03)] {
        for order in ScanOrder::ALL {
            let request = request(&k, exposure_s, readout_s, order);
            let got = picture(&watched, &scene, &path, k, accumulation(RENDERS), &request);
            let want = reference(&scene, &path, &k, &request);
            let far = |want: &Plane<u8>| {
                let pixels = got.data.chunks(3).zip(want.data.chunks(3));
                pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 1)).count()
            };
            let (mean, largest, _) = levels(&got, &want);
            // As many samples change sides as in one picture (see raster_parity).
            let grid_px = 0.5_f64.powi(watched.0.info().sub_pixel_bits as i32);
            let allowed = 0.5 * grid_px * length_px * 16.0 + 4.0;
            eprintln!(
                "exposure {exposure_s} s, readout {readout_s} s, {order}: mean {mean:.4}, largest {largest} levels, \
                 {} px over 1 level of {allowed:.0} allowed",
                far(&want)
            );
            assert!(far(&want) as f64 <= allowed && mean < 0.02 + 2.0 * grid_px, "{order}: {mean}");
            // What a neighbouring mistake does: lines in the opposite order, or the exposure centred.
            let mut wrong = request.clone();
            if readout_s > 0.0 {
                wrong.shutter.scan_order = opposite(order);
            } else {
                wrong.shutter.start_s -= 0.5 * exposure_s;
            }
            let seen = far(&reference(&scene, &path, &k, &wrong));
            assert!(seen as f64 > 1.5 * allowed, "control: {order}: {seen} px");
        }
    }
}

fn opposite(order: ScanOrder) -> ScanOrder {
    match order {
        ScanOrder::TopToBottom => ScanOrder::BottomToTop,
        ScanOrder::BottomToTop => ScanOrder::TopToBottom,
        ScanOrder::LeftToRight => ScanOrder::RightToLeft,
        ScanOrder::RightToLeft => ScanOrder::LeftToRight,
    }
}

/// A vertical bar 0.08 m wide at 1 m, taller than the picture.
fn bar() -> Scene {
    drawable(quads(&[rectangle([-0.04, 0.04], [-9.0, 9.0], 1.0)]))
}

/// Where a vertical edge of the bar stands at time t under a pan of `rad_per_s`, px.
fn bar_edge_px(x: f64, rad_per_s: f64, t: f64) -> f64 {
    140.0 * (x.atan() - rad_per_s * t).tan() + 77.3
}

fn bar_frame(watched: &Watched, order: ScanOrder, readout_s: f64, renders: u32) -> Plane<f32> {
    let request = request(&K, 0.0, readout_s, order);
    linear(&picture(watched, &bar(), &pan(2.0), K, accumulation(renders), &request))
}

#[test]
fn a_bar_leans_by_its_rows_times() {
    let Some(watched) = device("a_bar_leans_by_its_rows_times") else { return };
    for order in [ScanOrder::TopToBottom, ScanOrder::BottomToTop] {
        let got = bar_frame(&watched, order, 0.06, 120);
        let worst = |order: ScanOrder| {
            let off = |y: usize| {
                let row = Plane { width: 160, height: 1, channels: 3, data: got.row(y).to_vec() };
                let line = if order == ScanOrder::TopToBottom { y } else { 119 - y };
                let t = 0.01 + 0.06 * line as f64 / 120.0;
                let want = 0.5 * (bar_edge_px(-0.04, 2.0, t) + bar_edge_px(0.04, 2.0, t));
                (moments(&row, 1).1.x - want).abs()
            };
            (0..120).map(off).fold(0.0, f64::max)
        };
        eprintln!("{order}: the bar is off by at most {:.4} px", worst(order));
        // Two edges on 8 columns of samples, 1/16 px at most, and 8 bits: 0.0045 of one px at each edge; and the grid
        // of vertex positions.
        let grid_px = 0.5_f64.powi(watched.0.info().sub_pixel_bits as i32);
        assert!(worst(order) < 0.067 + 0.5 * grid_px, "{order}: {} px", worst(order));
        assert!(worst(opposite(order)) > 10.0, "control");
    }
}

#[test]
fn a_bar_is_stretched_or_squeezed_by_its_columns_times() {
    let Some(watched) = device("a_bar_is_stretched_or_squeezed_by_its_columns_times") else { return };
    for order in [ScanOrder::LeftToRight, ScanOrder::RightToLeft] {
        // The edge is seen where it stands when that column is read: u = edge(time(u)), solved by iteration.
        let solve = |x: f64, order: ScanOrder| {
            (0..60).fold(80.0_f64, |u, _| {
                let line = if order == ScanOrder::LeftToRight { u - 0.5 } else { 159.5 - u };
                bar_edge_px(x, 2.0, 0.01 + 0.06 * line / 160.0)
            })
        };
        let (sum, mean) = moments(&bar_frame(&watched, order, 0.06, 160), 1);
        let off = |order: ScanOrder| {
            let (left, right) = (solve(-0.04, order), solve(0.04, order));
            (sum / 120.0 - (right - left)).abs().max((mean.x - 0.5 * (left + right)).abs())
        };
        eprintln!("{order}: width and place off by at most {:.4} px", off(order));
        // A column is read in one go: half a column's delay (280 px/s * 0.19 ms) and 1/16 px of sampling.
        assert!(off(order) < 0.12, "{order}: {} px", off(order));
        assert!(off(opposite(order)) > 0.5, "control: {}", off(opposite(order)));
    }
}

/// The scene in a mirror: x (axis 0) or y (axis 1) of everything is negated.
fn mirrored(
    scene: &Scene,
    trajectory: &Trajectory,
    k: &Intrinsics,
    axis: usize,
) -> (Scene, Trajectory, Intrinsics) {
    let turn = |p: &Pose| {
        // A rotation about a is, in the mirror, one about the mirrored a by the negated angle.
        let mut q = [-p.rotation.x, -p.rotation.y, -p.rotation.z];
        q[axis] = -q[axis];
        let mut translation_m = p.translation_m;
        translation_m[axis] = -translation_m[axis];
        Pose { rotation: DQuat::from_xyzw(q[0], q[1], q[2], p.rotation.w), translation_m }
    };
    let turned = |t: &Trajectory| {
        let t = t.clone();
        path(move |time_s| turn(&t.pose_at(time_s)))
    };
    let mut scene = scene.clone();
    scene.vertices.iter_mut().for_each(|v| v.position_m[axis] = -v.position_m[axis]);
    for object in &mut scene.objects {
        object.trajectory = object.trajectory.as_ref().map(|t| turned(t).into());
    }
    let k = match axis {
        0 => Intrinsics { cx: f64::from(k.width) - k.cx, ..*k },
        _ => Intrinsics { cy: f64::from(k.height) - k.cy, ..*k },
    };
    (scene, turned(trajectory), k)
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_frame() {
    let Some(watched) = device("a_mirrored_scene_gives_the_mirrored_frame") else { return };
    let k = Intrinsics { width: 81, height: 61, fx: 70.0, fy: 72.0, cx: 39.2, cy: 31.3 };
    let (scene, path) = (untextured(), walk());
    // One sample, in the centre: a pattern of several is not its own mirror image.
    let render = |scene: &Scene, path: &Trajectory, k: Intrinsics, order: ScanOrder| {
        let request = request(&k, 0.0, 0.04, order);
        let mut engine = engine(&watched, scene, path, k, options(accumulation(200), 1), &[]);
        engine.render(&request).unwrap().picture
    };
    for axis in [0, 1] {
        let (mirror_scene, mirror_path, mirror_k) = mirrored(&scene, &path, &k, axis);
        for order in ScanOrder::ALL {
            let turns = order.lines_are_rows() == (axis == 1);
            let plain = render(&scene, &path, k, order);
            let flipped = Plane::from_fn(plain.width, plain.height, |x, y| {
                let at = if axis == 0 { (plain.width - 1 - x, y) } else { (x, plain.height - 1 - y) };
                let p = plain.pixel(at.0, at.1);
                [p[0], p[1], p[2]]
            });
            let share =
                |order: ScanOrder| levels(&render(&mirror_scene, &mirror_path, mirror_k, order), &flipped).2;
            let (same, other) = (
                share(if turns { opposite(order) } else { order }),
                share(if turns { order } else { opposite(order) }),
            );
            eprintln!("{order}, axis {axis}: {same:.5} of bytes differ, {other:.3} in the other order");
            // Samples on the very edge may fall to either side.
            assert!(same < 0.002, "{order}, axis {axis}: {same}");
            assert!(other > 0.02, "control: {order}, axis {axis}: {other}");
        }
    }
}

#[test]
fn an_edge_is_blurred_to_a_ramp_of_known_length_and_place() {
    let Some(watched) = device("an_edge_is_blurred_to_a_ramp_of_known_length_and_place") else { return };
    // A half-plane x > 0.1 m at 1 m; the camera moves right at 3 m/s, so the edge moves left at 420 px/s.
    let scene = drawable(quads(&[rectangle([0.1, 50.0], [-9.0, 9.0], 1.0)]));
    let request = request(&K, 0.02, 0.0, ScanOrder::TopToBottom);
    let got = linear(&picture(&watched, &scene, &slide(3.0), K, accumulation(121), &request));
    let worst = |exposure_s: f64, late_s: f64| {
        let edge_px = |t: f64| 140.0 * (0.1 - 3.0 * t) + 77.3;
        let (left, right) = (edge_px(0.01 + late_s + exposure_s), edge_px(0.01 + late_s));
        // Share of the exposure during which a point is covered, 0 at `left` to 1 at `right`; its integral.
        let integral = |u: f64| match u < right {
            true => (u - left).max(0.0).powi(2) / (2.0 * (right - left)),
            false => u - 0.5 * (left + right),
        };
        let off = |x: usize| {
            (f64::from(got.pixel(x, 60)[0]) - (integral(x as f64 + 1.0) - integral(x as f64))).abs()
        };
        (0..160).map(off).fold(0.0, f64::max)
    };
    eprintln!("the ramp is off by at most {:.4}", worst(0.02, 0.0));
    // 8.4 px in 120 steps of 0.07 px, 0.004, and 8 bits, 0.0045 near white.
    assert!(worst(0.02, 0.0) < 0.009, "{}", worst(0.02, 0.0));
    assert!(worst(0.018, 0.0) > 0.04, "control: exposure 10 % short: {}", worst(0.018, 0.0));
    assert!(worst(0.02, -0.001) > 0.04, "control: 1 ms early: {}", worst(0.02, -0.001));
}

#[test]
fn blur_and_read_out_keep_the_energy() {
    let Some(watched) = device("blur_and_read_out_keep_the_energy") else { return };
    // Moved sideways, a quad parallel to the picture keeps its area in every row.
    let scene = drawable(quads(&[rectangle([-0.1, 0.2], [-0.25, 0.2], 1.0)]));
    let area = 140.0 * 0.3 * 150.0 * 0.45;
    let energy = |exposure_s: f64, readout_s: f64, renders: u32| {
        let request = request(&K, exposure_s, readout_s, ScanOrder::BottomToTop);
        let frame = picture(&watched, &scene, &slide(2.0), K, accumulation(renders), &request);
        moments(&linear(&frame), 1).0
    };
    for (exposure_s, readout_s) in [(0.0, 0.0), (0.03, 0.0), (0.0, 0.03), (0.01, 0.03)] {
        let sum = energy(exposure_s, readout_s, 64);
        eprintln!("exposure {exposure_s} s, readout {readout_s} s: energy {:.5}", sum / area);
        // The quad's edges lie on a grid of 1/8 px of samples, 0.003 (see oracle_shutter); 8 bits round without bias.
        assert!((sum / area - 1.0).abs() < 0.004, "{exposure_s} s, {readout_s} s: {sum} against {area}");
    }
    // Control: energy that is lost is seen. A quad that moves towards the camera grows.
    let mut growing = scene.clone();
    let toward = |t: f64| Pose { rotation: DQuat::IDENTITY, translation_m: DVec3::new(0.0, 0.0, -t) };
    growing.objects = vec![Object { name: "o".into(), trajectory: Some(path(toward).into()) }];
    let request = request(&K, 0.03, 0.0, ScanOrder::BottomToTop);
    let frame = picture(&watched, &growing, &slide(2.0), K, accumulation(64), &request);
    assert!((moments(&linear(&frame), 1).0 / area - 1.0).abs() > 0.02, "control");
}
