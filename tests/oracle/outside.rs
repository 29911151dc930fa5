//! Frames from outside against a renderer that is not ours: rows rendered one by one, 96 times each where they
//! integrate.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use crate::capi_support::{engine, error_of, finish, must, options, process, sized, status};
use crate::long_support::some_of;
use crate::outside_support::host::{
    POSES, Pictures, SIZE, deliver, flights, flying, margin_of, poses, set_camera, taken,
};
use crate::outside_support::{
    EXPOSURE_S, K, Looks, World, camera_motion, psnr, shot, shutter, through, truth,
};
use shutterbug::camera::{Distortion, Intrinsics, Lens, Pose};
use shutterbug::capi::*;
use shutterbug::capture::CameraFile;
use shutterbug::effects::LensDistortion;

#[test]
#[ignore = "long: half a minute"]
fn thirteen_poses_follow_a_camera_that_shakes() {
    let test = "thirteen_poses_follow_a_camera_that_shakes";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let world = World::new(false);
    eprintln!("| motion | effects | plain | two poses | {POSES} poses | least |");
    for (name, least) in [
        ("pan 4", [33.0, 33.0]),
        ("walk 5 Hz", [33.0, 33.0]),
        ("vibration 18 Hz", [33.0, 31.0]),
        ("vibration 25 Hz", [33.0, 31.0]),
    ] {
        for (exposure_s, least) in [(0.0, least[0]), (EXPOSURE_S, least[1])] {
            set_camera(engine, exposure_s, "");
            let shutter = shutter(exposure_s);
            let end_s = shutter.end_s();
            let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY];
            let want = truth(&world, &motion, &shutter, None);
            let given = poses(name, end_s, POSES);
            let margin = margin_of(engine, name, end_s, &given);
            let got = deliver(engine, name, (end_s, margin), &given, true).unwrap();
            let (two, plain) = (poses(name, end_s, 2), taken(name, end_s, [0, 0]).rgb);
            let old = deliver(engine, name, (end_s, margin), &two, false).unwrap();
            let found = [&plain, &old, &got].map(|p| psnr(p, &want));
            let effects = if exposure_s > 0.0 { "both" } else { "shutter" };
            eprintln!(
                "| {name} | {effects} | {:.1} | {:.1} | {:.1} | {least} | margin {margin:?}",
                found[0], found[1], found[2]
            );
            assert!(found[2] >= least, "{name}, {effects}: {:.1} dB", found[2]);
            assert!(found[2] > found[0] + 4.0, "control: {name}, {effects}: the plain picture passes");
            if name.starts_with("vibration") {
                assert!(found[1] < least - 5.0, "control: {name}, {effects}: two poses pass");
            } else if name.starts_with("pan") {
                assert!(found[2] > found[1] - 0.3, "{name}, {effects}: worse than the gather, {found:?}");
            }
        }
    }
    finish(engine);
}

/// The picture of a frame with a flying box; whether it is told to move.
fn with_body(engine: Handle, end_s: f64, body_count: u32) -> Vec<u8> {
    let motion = |t: f64| vec![camera_motion("pan 1.2", t), Pose::IDENTITY, flying(t)];
    let margin = [12, 4];
    let mut one = Pictures::new([shot(&World::new(true), &motion, 0.5 * end_s, margin)], margin);
    let given = poses("pan 1.2", end_s, POSES);
    let of_body = flights(end_s);
    let bodies = [shutterbug_body { id: 401, pose_count: POSES, poses: of_body.as_ptr() }];
    let mut o = one.outside(&[0.5 * end_s]);
    (o.poses, o.pose_count) = (given.as_ptr(), POSES);
    (o.bodies, o.body_count) = (bodies.as_ptr(), body_count);
    process(engine, &o, SIZE).unwrap()
}

#[test]
fn bodies_move_by_their_own_poses() {
    let test = "bodies_move_by_their_own_poses";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    for exposure_s in some_of(test, 2, [EXPOSURE_S, 0.0]) {
        set_camera(engine, exposure_s, "");
        let shutter = shutter(exposure_s);
        let motion = |t: f64| vec![camera_motion("pan 1.2", t), Pose::IDENTITY, flying(t)];
        let want = truth(&World::new(true), &motion, &shutter, None);
        let [got, resting] = [1, 0].map(|count| psnr(&with_body(engine, shutter.end_s(), count), &want));
        eprintln!("a flying box, exposure {exposure_s} s: {got:.1} dB; taken for resting {resting:.1} dB");
        assert!(got > 32.0, "{got:.1} dB");
        assert!(resting < got - 5.0, "control: a box that is not told to move passes, {resting:.1} dB");
    }
    finish(engine);
}

/// The text of a camera's effects on where pixels look, and the same as rays.
const LENS: &str =
    "[lens_distortion]\nmodel = \"brown_conrady\"\nk1 = -0.22\nk2 = 0.05\np1 = 0.001\np2 = -0.0008\n";
const SCALES: [f64; 3] = [1.004, 1.0, 0.996];

#[test]
#[ignore = "long: more than a minute"]
fn a_lens_shutter_and_blur_read_the_colour_once() {
    let test = "a_lens_shutter_and_blur_read_the_colour_once";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let world = World::new(false);
    let brown = Distortion::BrownConrady { k: [-0.22, 0.05, 0.0], p: [0.001, -0.0008] };
    let askew = glam::DQuat::from_scaled_axis(glam::DVec3::new(0.01, -0.02, 0.03));
    let longer = Intrinsics { fx: 1.02 * K.fx, fy: 1.02 * K.fy, ..K };
    let (plain, long) = (Lens::new(K, brown).unwrap(), Lens::new(longer, brown).unwrap());
    let centre = glam::DVec2::new(K.cx, K.cy);
    let lens = |px: glam::DVec2, _: usize| through(&plain, px);
    let all = |px: glam::DVec2, c: usize| askew * through(&long, centre + (px - centre) / SCALES[c]);
    let everything = format!(
        "{LENS}[chromatic_aberration]\nscale_r = {:?}\nscale_b = {:?}\n[focal_length_error]\nratio = 1.02\n\
         [pose_offset]\nrotvec_rad = [0.01, -0.02, 0.03]\n",
        SCALES[0], SCALES[2]
    );
    let mut alone = [0.0; 2];
    for (at, (camera, looks)) in
        [(LENS, &lens as Looks<'_>), (everything.as_str(), &all)].into_iter().enumerate()
    {
        for (name, exposure_s) in [("still", 0.0), ("vibration 18 Hz", 0.0), ("vibration 18 Hz", EXPOSURE_S)]
        {
            set_camera(engine, exposure_s, camera);
            let shutter = shutter(exposure_s);
            let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY];
            let want = truth(&world, &motion, &shutter, Some(looks));
            let given = poses(name, shutter.end_s(), POSES);
            let margin = margin_of(engine, name, shutter.end_s(), &given);
            let got = deliver(engine, name, (shutter.end_s(), margin), &given, true).unwrap();
            let found = psnr(&got, &want);
            set_camera(engine, exposure_s, "");
            let without = deliver(engine, name, (shutter.end_s(), margin), &given, true).unwrap();
            let control = psnr(&without, &want);
            eprintln!(
                "{name}, exposure {exposure_s} s: {found:.1} dB, margin {margin:?}; without lens {control:.1} dB"
            );
            assert!(control < 24.0, "control: no lens passes, {control:.1} dB");
            if name == "still" {
                alone[at] = found;
                assert!(found > 33.0, "{found:.1} dB");
            }
            assert!(found > alone[at] - 1.0, "{name}, {exposure_s}: {found:.1} dB, alone {:.1}", alone[at]);
        }
    }
    finish(engine);
}

#[test]
fn every_model_of_a_lens_is_read_backwards() {
    let test = "every_model_of_a_lens_is_read_backwards";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let world = World::new(false);
    let lenses = [
        Distortion::Equidistant { k: [0.03, -0.01, 0.004, -0.001] },
        Distortion::Rational { k: [0.52, -0.03, 0.002, 0.9, 0.1, 0.01], p: [0.001, -0.0008] },
        Distortion::Division { k1: -0.25 },
    ];
    for lens in some_of(test, 3, lenses) {
        let mut camera = CameraFile::pinhole("camera".into(), K, 0.04);
        LensDistortion::set(&mut camera.settings, &lens).unwrap();
        let text = camera.to_toml();
        let tables = &text[text.find("[lens_distortion]").expect("written")..];
        set_camera(engine, 0.0, tables);
        let truly = Lens::new(K, lens).unwrap();
        let looks = |px: glam::DVec2, _: usize| through(&truly, px);
        let shutter = shutter(0.0);
        let motion = |t: f64| vec![camera_motion("still", t), Pose::IDENTITY];
        let want = truth(&world, &motion, &shutter, Some(&looks as Looks<'_>));
        let given = poses("still", shutter.end_s(), POSES);
        let margin = margin_of(engine, "still", shutter.end_s(), &given);
        let found = psnr(&deliver(engine, "still", (shutter.end_s(), margin), &given, true).unwrap(), &want);
        set_camera(engine, 0.0, "");
        let plain = deliver(engine, "still", (shutter.end_s(), margin), &given, true).unwrap();
        let control = psnr(&plain, &want);
        eprintln!("{lens:?}: {found:.1} dB, margin {margin:?}; without lens {control:.1} dB");
        assert!(found > 33.0, "{lens:?}: {found:.1} dB");
        assert!(control < 26.0, "control: no lens passes, {control:.1} dB");
    }
    finish(engine);
}

#[test]
fn spans_and_margins_are_checked_and_told() {
    let test = "spans_and_margins_are_checked_and_told";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    set_camera(engine, EXPOSURE_S, "");
    let end_s = shutter(EXPOSURE_S).end_s();
    let name = "pan 4";
    let given = poses(name, end_s, POSES);
    let margin = margin_of(engine, name, end_s, &given);
    assert!(margin[0] > 10, "control: a pan of 4 rad/s needs one: {margin:?}");
    // One column less is refused, the margin that is told is taken, and the borders of the two differ where it is let
    // pass.
    let less = [margin[0] - 1, margin[1]];
    assert_eq!(deliver(engine, name, (end_s, less), &given, true).unwrap_err().0, status("TOO_SMALL"));
    deliver(engine, name, (end_s, margin), &given, true).unwrap();
    // Poses that do not reach over the frame's end, or its start.
    for short in [&given[1..], &given[..given.len() - 1]] {
        let (code, said) = deliver(engine, name, (end_s, margin), short, true).unwrap_err();
        assert_eq!(code, status("TIME"), "{said}");
        assert!(said.contains("never"), "{said}");
    }
    // The bound of a motion is enough for that motion.
    let mut bound: shutterbug_motion_bound = sized();
    (bound.turn_rate_rad_s, bound.color_delay_s) = (4.0, 0.5 * end_s);
    let mut enough = [0u32; 2];
    let [x, y] = &mut enough;
    must(unsafe { shutterbug_engine_margin(engine, &bound, x, y) }, engine);
    assert!(enough[0] >= margin[0] && enough[0] <= margin[0] + 12, "{enough:?} for {margin:?}");
    bound.turn_rate_rad_s = 1.0;
    let [x, y] = &mut enough;
    must(unsafe { shutterbug_engine_margin(engine, &bound, x, y) }, engine);
    assert!(enough[0] < margin[0], "control: a quarter of the rate needs less, {enough:?}");
    // A lens asks for more, and without poses it is refused with what would do.
    set_camera(engine, EXPOSURE_S, LENS);
    let with_lens = margin_of(engine, name, end_s, &given);
    assert!(with_lens[0] > margin[0] && with_lens[1] > margin[1], "{with_lens:?}");
    let (code, said) = deliver(engine, name, (end_s, margin), &poses(name, end_s, 2), false).unwrap_err();
    assert!(code == status("UNSUPPORTED") && said.contains("pose_count"), "{said}");
    assert!(error_of(engine).contains("pose_count"));
    finish(engine);
}
