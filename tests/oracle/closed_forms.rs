//! Single instants of the oracle against formulas that can be checked on paper. Each formula is written out here from
//! fx, cx and so on, not taken from the library.

use crate::oracle_forms::{K, moments, pan, quads, rectangle, slide};
use glam::{DQuat, DVec2, DVec3};
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{Intrinsics, NEAR_M, Pose, Trajectory};
use shutterbug::reference::raster::{MotionSpan, View, Window, render, render_window};
use shutterbug::scene::Object;

fn at_origin() -> View {
    View { intrinsics: K, world_from_camera: Pose::IDENTITY, time_s: 0.0 }
}

/// Area and centroid of a polygon.
fn polygon(corners: &[DVec2]) -> (f64, DVec2) {
    let (mut area, mut first) = (0.0, DVec2::ZERO);
    for (i, &p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % corners.len()];
        let twice = p.perp_dot(q);
        area += 0.5 * twice;
        first += (p + q) * twice / 6.0;
    }
    (area.abs(), first / area)
}

#[test]
fn a_quad_covers_the_polygon_of_its_projected_corners() {
    let corners = [[-0.5, -0.4, 1.3], [0.6, -0.5, 1.9], [0.5, 0.6, 2.2], [-0.4, 0.3, 1.5]].map(DVec3::from);
    // The fourth corner is put into the plane of the others.
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let mut quad = corners;
    quad[3].z -= normal.dot(quad[3] - quad[0]) / normal.z;
    let projected = quad.map(|p| DVec2::new(140.0 * p.x / p.z + 77.3, 150.0 * p.y / p.z + 62.1));
    let (area, centre) = polygon(&projected);
    let scene = quads(&[quad]);
    let off = |k: Intrinsics| {
        let color = render(&scene, &View { intrinsics: k, ..at_origin() }, &sample_positions(16), None).color;
        let (sum, mean) = moments(&color, 3);
        assert_eq!(moments(&color, 0), (sum, mean), "white where covered, black elsewhere");
        ((sum - area).abs(), (mean - centre).abs().max_element())
    };
    // About 250 px of edge, each pixel's coverage rounded to 1/16: an rms of 0.02 a pixel, 0.3 in all.
    let (area_off, centre_off) = off(K);
    assert!(area_off < 1.0 && centre_off < 0.01, "area off by {area_off} px^2, centre by {centre_off} px");
    let (_, control) = off(Intrinsics { cx: K.cx + 0.1, ..K });
    assert!(control > 0.09, "a tenth of a pixel shows: {control}");
}

#[test]
fn depth_is_that_of_the_plane_even_through_the_camera() {
    // A floor 0.4 m below a camera that looks down a little: it passes under and behind the camera.
    let tilt = DQuat::from_rotation_x(-0.25);
    let floor = [[-9.0, 0.4, -9.0], [9.0, 0.4, -9.0], [9.0, 0.4, 9.0], [-9.0, 0.4, 9.0]].map(DVec3::from);
    let view = View { world_from_camera: Pose { rotation: tilt, translation_m: DVec3::ZERO }, ..at_origin() };
    let depth = render(&quads(&[floor]), &view, &[[0.5, 0.5]], None).depth_m;
    let normal = tilt.inverse() * DVec3::Y;
    let want = |x: f64, y: f64| 0.4 / normal.dot(DVec3::new((x - 77.3) / 140.0, (y - 62.1) / 150.0, 1.0));
    let (mut seen, mut control) = (0, 0.0_f64);
    for y in 0..120 {
        for x in 0..160 {
            let got = f64::from(depth.pixel(x, y)[0]);
            if got.is_finite() {
                let (x, y) = (x as f64, y as f64);
                seen += 1;
                assert!((got / want(x + 0.5, y + 0.5) - 1.0).abs() < 1e-6, "({x}, {y}): {got} m");
                control = control.max((got / want(x, y) - 1.0).abs());
            }
        }
    }
    assert!(seen > 160 * 60, "most of the picture is floor: {seen} px");
    assert!(control > 1e-3, "half a pixel shows: {control}");
}

#[test]
fn nothing_is_seen_nearer_than_the_near_distance_or_behind() {
    let cover = |z: f64| {
        let scene = quads(&[rectangle([-1.0, 1.0], [-1.0, 1.0], z)]);
        moments(&render(&scene, &at_origin(), &sample_positions(4), None).color, 3).0
    };
    assert_eq!(cover(1.001 * NEAR_M), 160.0 * 120.0);
    assert_eq!(cover(0.999 * NEAR_M), 0.0);
    assert_eq!(cover(-1.0), 0.0);
}

#[test]
fn motion_of_a_pan_does_not_depend_on_depth_and_that_of_a_slide_does() {
    let wall =
        quads(&[[[-5.0, -5.0, 2.0], [5.0, -5.0, 4.0], [5.0, 5.0, 4.0], [-5.0, 5.0, 2.0]].map(DVec3::from)]);
    let (from_s, to_s, scale) = (-0.01, 0.02, 4.0 / 3.0);
    let worst = |trajectory: &Trajectory, sign: f64, want: &dyn Fn(DVec2, f64) -> DVec2| {
        let span = MotionSpan { trajectory, from_s, to_s, scale };
        let seen = render(&wall, &at_origin(), &[[0.5, 0.5]], Some(&span));
        let mut worst = 0.0_f64;
        for y in 0..120 {
            for x in 0..160 {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let got = seen.motion_px.pixel(x, y);
                let got = DVec2::new(f64::from(got[0]), f64::from(got[1]));
                worst = worst.max((sign * got - want(at, f64::from(seen.depth_m.pixel(x, y)[0]))).length());
            }
        }
        worst
    };
    // Pan: the direction at angle a off the axis is seen at angle a - w t; its height over its horizontal distance
    // stays. No depth, no library projection.
    let pan_want = |p: DVec2, _: f64| {
        let (x, y) = ((p.x - 77.3) / 140.0, (p.y - 62.1) / 150.0);
        let (angle, elevation) = (x.atan(), y / (1.0 + x * x).sqrt());
        let seen_at = |t: f64| {
            let a = angle - 1.5 * t;
            DVec2::new(140.0 * a.tan(), 150.0 * elevation / a.cos())
        };
        (seen_at(to_s) - seen_at(from_s)) * scale
    };
    assert!(worst(&pan(1.5), 1.0, &pan_want) < 1e-4, "pan: {} px", worst(&pan(1.5), 1.0, &pan_want));
    assert!(worst(&pan(1.5), -1.0, &pan_want) > 10.0, "control: the other sign");
    // Slide: -fx v (to - from) / z.
    let slide_want = |_: DVec2, z: f64| DVec2::new(-140.0 * 0.8 * 0.03 * scale / z, 0.0);
    assert!(
        worst(&slide(0.8), 1.0, &slide_want) < 1e-4,
        "slide: {} px",
        worst(&slide(0.8), 1.0, &slide_want)
    );
    let flat = |_: DVec2, _: f64| DVec2::new(-140.0 * 0.8 * 0.03 * scale / 3.0, 0.0);
    assert!(worst(&slide(0.8), 1.0, &flat) > 0.1, "control: depth matters");
}

#[test]
fn motion_of_an_object_is_never_mixed_with_that_of_what_is_behind_it() {
    // A small quad that moves right at 0.5 m/s before a wall at rest; the camera rests.
    let mut scene =
        quads(&[rectangle([-9.0, 9.0], [-9.0, 9.0], 5.0), rectangle([-0.21, 0.203], [-0.17, 0.22], 1.0)]);
    scene.objects.push(Object { name: "moving".into(), trajectory: Some(slide(0.5).into()) });
    scene.vertices[4..].iter_mut().for_each(|v| v.object = 1);
    let rest = Trajectory::fixed(Pose::IDENTITY);
    let span = MotionSpan { trajectory: &rest, from_s: -0.04, to_s: 0.0, scale: 1.0 };
    let seen = render(&scene, &at_origin(), &sample_positions(16), Some(&span));
    let (mut moving, mut resting) = (0, 0);
    for (motion, depth) in seen.motion_px.data.chunks_exact(2).zip(&seen.depth_m.data) {
        // 140 px * 0.5 m/s * 0.04 s / 1 m.
        if (*depth - 1.0).abs() < 1e-6 {
            assert!((motion[0] - 2.8).abs() < 1e-4 && motion[1].abs() < 1e-4, "{motion:?}");
            moving += 1;
        } else {
            assert!((*depth - 5.0).abs() < 1e-5 && motion == [0.0, 0.0], "{motion:?} at {depth} m");
            resting += 1;
        }
    }
    // The nearest sample decides: every pixel that the object touches moves with it, 58.8 by 59.5 px and its rim.
    assert!((3480..=61 * 61).contains(&moving) && resting > 0, "{moving} px move");
}

#[test]
fn a_tessellated_wall_has_no_cracks() {
    // 40x40 cells with crooked corners, seen askew; every sample of the middle must be covered.
    let crooked = |i: i32, j: i32| {
        let noise =
            |n: i32| f64::from((i * 7919 + j * 104_729 + n * 1_299_709).rem_euclid(1009)) / 1009.0 - 0.5;
        DVec3::new(
            0.1 * (f64::from(i) + 0.6 * noise(1)),
            0.1 * (f64::from(j) + 0.6 * noise(2)),
            1.7 + 0.05 * noise(3),
        )
    };
    let cells: Vec<[DVec3; 4]> = (-20..20)
        .flat_map(|i| (-20..20).map(move |j| (i, j)))
        .map(|(i, j)| [crooked(i, j), crooked(i + 1, j), crooked(i + 1, j + 1), crooked(i, j + 1)])
        .collect();
    let rotation = DQuat::from_euler(glam::EulerRot::XYZ, 0.1, 0.13, 0.7);
    let view = View { world_from_camera: Pose { rotation, translation_m: DVec3::ZERO }, ..at_origin() };
    let holes = |cells: &[[DVec3; 4]]| {
        let color = render(&quads(cells), &view, &sample_positions(16), None).color;
        color.data.chunks_exact(4).filter(|p| p[3] < 1.0).count()
    };
    assert_eq!(holes(&cells), 0);
    let mut missing = cells.clone();
    missing.remove(20 * 40 + 20);
    assert!(holes(&missing) > 10, "control");
}

#[test]
fn a_window_is_a_part_of_the_whole() {
    let scene = quads(&[rectangle([-0.3, 0.4], [-0.2, 0.3], 1.1)]);
    let trajectory = pan(1.0);
    let span = MotionSpan { trajectory: &trajectory, from_s: 0.0, to_s: 0.04, scale: 1.0 };
    let samples = sample_positions(16);
    let whole = render(&scene, &at_origin(), &samples, Some(&span));
    let window = Window { x: 31, y: 37, width: 57, height: 41 };
    let part = render_window(&scene, &at_origin(), &samples, Some(&span), window);
    for y in 0..41 {
        for x in 0..57 {
            assert_eq!(part.color.pixel(x, y), whole.color.pixel(x + 31, y + 37));
            assert_eq!(part.depth_m.pixel(x, y), whole.depth_m.pixel(x + 31, y + 37));
            assert_eq!(part.motion_px.pixel(x, y), whole.motion_px.pixel(x + 31, y + 37));
        }
    }
    assert_ne!(
        part.color.pixel(0, 0),
        part.color.pixel(20, 20),
        "control: the window holds more than background"
    );
}
