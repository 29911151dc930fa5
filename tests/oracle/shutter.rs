//! Whole frames of the oracle against formulas for what a shutter does to simple scenes: lean, stretch, ramp, energy.
//! Each formula is written out here from fx, cx and so on, not taken from the library.

use crate::oracle_forms::{K, moments, pan, quads, rectangle, slide};
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{ScanOrder, ShutterTiming, Trajectory};
use shutterbug::plane::Plane;
use shutterbug::reference::accumulate::{largest_speed_px_per_s, render_frame};
use shutterbug::scene::{Object, Scene};

fn shutter(exposure_time_s: f64, readout_time_s: f64, scan_order: ScanOrder) -> ShutterTiming {
    let line_count = scan_order.line_count(K.width, K.height);
    ShutterTiming { start_s: 0.01, exposure_time_s, readout_time_s, scan_order, line_count }
}

fn frame(scene: &Scene, trajectory: &Trajectory, timing: &ShutterTiming, renders: u32) -> Plane<f32> {
    let plan = AccumulationPlan::new(timing, renders);
    render_frame(scene, trajectory, &K, timing, &plan, &sample_positions(16))
}

/// A vertical bar 0.08 m wide at 1 m, taller than the picture.
fn bar() -> Scene {
    quads(&[rectangle([-0.04, 0.04], [-9.0, 9.0], 1.0)])
}

/// Where a vertical edge of the bar stands at time t under a pan of `rad_per_s`, px.
fn bar_edge_px(x: f64, rad_per_s: f64, t: f64) -> f64 {
    140.0 * (x.atan() - rad_per_s * t).tan() + 77.3
}

#[test]
fn a_bar_leans_by_its_rows_times() {
    let rad_per_s = 2.0;
    for order in [ScanOrder::TopToBottom, ScanOrder::BottomToTop] {
        // 1 row a render, and a render every 0.9 px of motion: both without bias.
        for renders in [120, 20] {
            let got = frame(&bar(), &pan(rad_per_s), &shutter(0.0, 0.06, order), renders);
            let worst = |order: ScanOrder| {
                let off = |y: usize| {
                    let row = Plane { width: 160, height: 1, channels: 4, data: got.row(y).to_vec() };
                    let line = if order == ScanOrder::TopToBottom { y } else { 119 - y };
                    let t = 0.01 + 0.06 * line as f64 / 120.0;
                    let want = 0.5 * (bar_edge_px(-0.04, rad_per_s, t) + bar_edge_px(0.04, rad_per_s, t));
                    (moments(&row, 3).1.x - want).abs()
                };
                (0..120).map(off).fold(0.0, f64::max)
            };
            // Two edges, each placed by 16 samples a pixel in one row: 8 columns of samples, 1/16 px at most.
            let other =
                if order == ScanOrder::TopToBottom { ScanOrder::BottomToTop } else { ScanOrder::TopToBottom };
            assert!(worst(order) < 0.0625, "{order}, {renders} renders: {} px", worst(order));
            assert!(worst(other) > 10.0, "control: {} px", worst(other));
        }
    }
}

#[test]
fn a_bar_is_stretched_or_squeezed_by_its_columns_times() {
    // The bar moves left: read from the left, columns come to meet it and it is squeezed, from the right stretched.
    let rad_per_s = 2.0;
    let mut widths = Vec::new();
    for order in [ScanOrder::LeftToRight, ScanOrder::RightToLeft] {
        let timing = shutter(0.0, 0.06, order);
        // The edge is seen where it stands when that column is read: u = edge(time(u)), solved by iteration.
        let solve = |x: f64| {
            let mut u = 80.0_f64;
            for _ in 0..60 {
                let column = u - 0.5;
                let line = if order == ScanOrder::LeftToRight { column } else { 159.0 - column };
                u = bar_edge_px(x, rad_per_s, 0.01 + 0.06 * line / 160.0);
            }
            u
        };
        let (left, right) = (solve(-0.04), solve(0.04));
        for renders in [160, 40] {
            let (sum, mean) = moments(&frame(&bar(), &pan(rad_per_s), &timing, renders), 3);
            let (width, centre) = (sum / 120.0, mean.x);
            // A column is read in one go: an edge inside it is off by up to half a column's delay, 280 px/s * 0.19 ms,
            // and by 1/16 px of sampling. All rows agree, so nothing averages out.
            assert!((width - (right - left)).abs() < 0.11, "{order}: {width} px, want {}", right - left);
            assert!((centre - 0.5 * (left + right)).abs() < 0.08, "{order}: {centre} px");
        }
        widths.push(right - left);
    }
    let still = bar_edge_px(0.04, rad_per_s, 0.01) - bar_edge_px(-0.04, rad_per_s, 0.01);
    assert!(widths[0] < still - 0.5 && widths[1] > still + 0.5, "control: {widths:?} against {still}");
}

#[test]
fn an_edge_is_blurred_to_a_ramp_of_known_length_and_place() {
    // A half-plane x > 0.1 m at 1 m; the camera moves right at 3 m/s, so the edge moves left at 420 px/s.
    let scene = quads(&[rectangle([0.1, 50.0], [-9.0, 9.0], 1.0)]);
    let worst = |exposure_s: f64, want_exposure_s: f64, late_s: f64| {
        let got = frame(&scene, &slide(3.0), &shutter(exposure_s, 0.0, ScanOrder::TopToBottom), 121);
        let edge_px = |t: f64| 140.0 * (0.1 - 3.0 * t) + 77.3;
        let (left, right) = (edge_px(0.01 + late_s + want_exposure_s), edge_px(0.01 + late_s));
        // Share of the exposure during which the point is covered, 0 at `left` to 1 at `right`; its integral.
        let integral = |u: f64| {
            if u < right {
                (u - left).max(0.0).powi(2) / (2.0 * (right - left))
            } else {
                u - 0.5 * (left + right)
            }
        };
        let off = |x: usize| {
            (f64::from(got.pixel(x, 60)[0]) - (integral(x as f64 + 1.0) - integral(x as f64))).abs()
        };
        (0..160).map(off).fold(0.0, f64::max)
    };
    // 8.4 px of motion in 120 steps of 0.07 px: the ends of the ramp are off by a part of a step's share.
    assert!(worst(0.02, 0.02, 0.0) < 0.004, "{}", worst(0.02, 0.02, 0.0));
    assert!(worst(0.02, 0.018, 0.0) > 0.04, "control: exposure 10 % short: {}", worst(0.02, 0.018, 0.0));
    assert!(worst(0.02, 0.02, -0.001) > 0.04, "control: 1 ms early: {}", worst(0.02, 0.02, -0.001));
}

#[test]
fn blur_and_read_out_keep_the_energy() {
    // Moved sideways, a quad parallel to the picture keeps its area in every row.
    let scene = quads(&[rectangle([-0.1, 0.2], [-0.25, 0.2], 1.0)]);
    let area = 140.0 * 0.3 * 150.0 * 0.45;
    for (exposure_s, readout_s) in [(0.0, 0.0), (0.03, 0.0), (0.0, 0.03), (0.01, 0.03)] {
        let timing = shutter(exposure_s, readout_s, ScanOrder::BottomToTop);
        let color = frame(&scene, &slide(2.0), &timing, 64);
        let (sum, _) = moments(&color, 1);
        // Rows and columns of the quad's edges on a grid of 1/8 px: 1/16 px of 45 and of 67.5 px at most.
        assert!((sum / area - 1.0).abs() < 0.003, "{exposure_s} s, {readout_s} s: {sum} against {area}");
    }
    let timing = shutter(0.03, 0.0, ScanOrder::BottomToTop);
    let mut plan = AccumulationPlan::new(&timing, 64);
    plan.instants.pop();
    let lost = render_frame(&scene, &slide(2.0), &K, &timing, &plan, &sample_positions(16));
    assert!(moments(&lost, 1).0 / area < 0.995, "control: an instant is missing");
}

#[test]
fn the_largest_speed_is_found() {
    // A wall at 2 m that a camera slides along: 140 * 3 / 2 px/s everywhere; an object that runs against it is faster.
    let mut scene =
        quads(&[rectangle([-9.0, 9.0], [-9.0, 9.0], 2.0), rectangle([-0.2, 0.3], [-0.2, 0.2], 1.9)]);
    let timing = shutter(0.005, 0.02, ScanOrder::LeftToRight);
    let speed = |scene: &Scene| largest_speed_px_per_s(scene, &slide(3.0), &K, &timing);
    assert!((speed(&scene) / (140.0 * 3.0 / 1.9) - 1.0).abs() < 1e-3, "{}", speed(&scene));
    scene.objects.push(Object { name: "moving".into(), trajectory: Some(slide(-1.0).into()) });
    scene.vertices[4..].iter_mut().for_each(|v| v.object = 1);
    assert!((speed(&scene) / (140.0 * 4.0 / 1.9) - 1.0).abs() < 1e-3, "{}", speed(&scene));
    assert_eq!(
        largest_speed_px_per_s(&scene, &slide(3.0), &K, &shutter(0.0, 0.0, ScanOrder::TopToBottom)),
        0.0
    );
}
