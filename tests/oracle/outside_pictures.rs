//! Frames from outside of several pictures: error against price, against a renderer that is not ours, rows rendered one
//! by one.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use crate::capi_support::{engine, finish, options, process};
use crate::outside_support::host::{POSES, Pictures, SIZE, flights, flying, poses, set_camera};
use crate::outside_support::{EXPOSURE_S, World, camera_motion, psnr, shot, shutter, truth};
use shutterbug::camera::Pose;
use shutterbug::capi::*;

/// Instants of `count` pictures over `[0, end_s]`: the middle, or from one end to the other.
fn instants(end_s: f64, count: usize) -> Vec<f64> {
    match count {
        1 => vec![0.5 * end_s],
        _ => (0..count).map(|i| end_s * i as f64 / (count - 1) as f64).collect(),
    }
}

/// A frame of `count` pictures; `flies`: with the flying box, which has poses of its own.
fn deliver(engine: Handle, name: &str, end_s: f64, flies: bool, count: usize) -> Vec<u8> {
    let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY, flying(t)];
    let (world, margin, times_s) = (World::new(flies), [26, 14], instants(end_s, count));
    let shots = times_s.iter().map(|&t| shot(&world, &motion, t, margin));
    let mut pictures = Pictures::new(shots, margin);
    let (given, of_body) = (poses(name, end_s, POSES), flights(end_s));
    let bodies = [shutterbug_body { id: 401, pose_count: POSES, poses: of_body.as_ptr() }];
    let mut o = pictures.outside(&times_s);
    (o.poses, o.pose_count) = (given.as_ptr(), POSES);
    (o.bodies, o.body_count) = (bodies.as_ptr(), u32::from(flies));
    process(engine, &o, SIZE).unwrap()
}

#[test]
#[ignore = "long: a minute"]
fn several_pictures_come_nearer_than_one() {
    let Some(engine) = engine("several_pictures_come_nearer_than_one", options(4, 1)) else { return };
    eprintln!("| motion | effects | 1 picture | 2 | 3 | 5 |");
    for (name, flies) in
        [("pan 4", false), ("walk 5 Hz", false), ("vibration 18 Hz", false), ("pan 1.2", true)]
    {
        for exposure_s in [0.0, EXPOSURE_S] {
            set_camera(engine, exposure_s, "");
            let shutter = shutter(exposure_s);
            let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY, flying(t)];
            let want = truth(&World::new(flies), &motion, &shutter, None);
            let found =
                [1, 2, 3, 5].map(|count| psnr(&deliver(engine, name, shutter.end_s(), flies, count), &want));
            let effects = if exposure_s > 0.0 { "both" } else { "shutter" };
            eprintln!(
                "| {name} | {effects} | {:.1} | {:.1} | {:.1} | {:.1} |",
                found[0], found[1], found[2], found[3]
            );
            // Each more than one picture gives, and a shaking camera the goal.
            assert!(found[2] > found[0] + 0.2 && found[3] > found[0] + 0.5, "{name}, {effects}: {found:?}");
            assert!(found[2] > 38.0 || name != "vibration 18 Hz", "{effects}: {found:?}");
        }
    }
    finish(engine);
}

#[test]
fn pictures_may_come_in_any_order_and_their_times_matter() {
    let test = "pictures_may_come_in_any_order_and_their_times_matter";
    let Some(engine) = engine(test, options(4, 1)) else { return };
    set_camera(engine, 0.0, "");
    let end_s = shutter(0.0).end_s();
    let motion = |t: f64| vec![camera_motion("walk 5 Hz", t), Pose::IDENTITY];
    let (margin, given) = ([26, 14], poses("walk 5 Hz", end_s, POSES));
    let make = |times_s: [f64; 3], said_s: [f64; 3]| {
        let shots = times_s.iter().map(|&t| shot(&World::new(false), &motion, t, margin));
        let mut pictures = Pictures::new(shots, margin);
        let mut o = pictures.outside(&said_s);
        (o.poses, o.pose_count) = (given.as_ptr(), POSES);
        process(engine, &o, SIZE).unwrap()
    };
    let [a, b, c] = [0.0, 0.5 * end_s, end_s];
    let want = truth(&World::new(false), &motion, &shutter(0.0), None);
    let in_order = make([a, b, c], [a, b, c]);
    for other in [[b, a, c], [c, b, a], [c, a, b]] {
        assert!(make(other, other) == in_order, "{other:?}");
    }
    let wrong = psnr(&make([a, b, c], [c, b, a]), &want);
    assert!(wrong < psnr(&in_order, &want) - 5.0, "control: wrong times pass, {wrong:.1} dB");
    finish(engine);
}
