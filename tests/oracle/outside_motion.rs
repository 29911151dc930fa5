//! Frames from outside with motion images, against a renderer that is not ours: what several of them bring, and bodies
//! by motion and by ids.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use crate::capi_support::{engine, finish, image, must, options, process, sized};
use crate::long_support::some_of;
use crate::outside_support::host::{POSES, Pictures, SIZE, flights, flying, poses, set_camera};
use crate::outside_support::{EXPOSURE_S, K, Motion, World, camera_motion, psnr, shot, shutter, truth};
use glam::DVec2;
use shutterbug::camera::Pose;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

const PERIOD_S: f64 = 0.04;
const MARGIN: [u32; 2] = [26, 14];

/// Motion of what is seen at an instant, px a frame period, from a step before it to it.
fn motion_image(world: &World, motion: Motion<'_>, time_s: f64, step_s: f64) -> Vec<f32> {
    let taken = shot(world, motion, time_s, MARGIN);
    let k = K.with_margin(MARGIN);
    let (now, before) = (motion(time_s), motion(time_s - step_s));
    let of = |i: usize| {
        let at = DVec2::new((i % taken.size[0]) as f64 + 0.5, (i / taken.size[0]) as f64 + 0.5);
        let point = now[0].transform(k.ray(at) * f64::from(taken.depth_m[i]));
        let body = 1 + taken.body[i] as usize;
        let then = before[body].transform(now[body].inverse().transform(point));
        let came = k.project(before[0].inverse().transform(then)).unwrap_or(at);
        ((at - came) * (PERIOD_S / step_s)).to_array().map(|v| v as f32)
    };
    (0..taken.depth_m.len()).flat_map(of).collect()
}

/// A frame with `count` motion images over it, and its decibels.
fn by_motion(
    engine: Handle,
    world: &World,
    motion: Motion<'_>,
    (exposure_s, count): (f64, usize),
) -> Vec<u8> {
    let shutter = shutter(exposure_s);
    let (end_s, color_s) = (shutter.end_s(), 0.5 * shutter.end_s());
    // One over all of the frame, else as the motion is at each instant.
    let (step_s, at) = match count {
        1 => (1e-4, vec![color_s]),
        _ => (1e-4, (0..count).map(|i| end_s * i as f64 / (count - 1) as f64).collect()),
    };
    let mut pictures = Pictures::new([shot(world, motion, color_s, MARGIN)], MARGIN);
    let mut images: Vec<Vec<f32>> = at.iter().map(|&t| motion_image(world, motion, t, step_s)).collect();
    let [w, h] = [K.width, K.height].map(|s| s as usize);
    let (w, h) = (w + 2 * MARGIN[0] as usize, h + 2 * MARGIN[1] as usize);
    let images: Vec<_> =
        images.iter_mut().map(|i| image(PixelFormat::Rg32f, w, h, bytemuck::cast_slice_mut(i))).collect();
    let mut convention: shutterbug_motion_convention = sized();
    must(unsafe { shutterbug_motion_preset(0, &mut convention, std::ptr::null_mut(), 0) }, engine);
    let mut o = pictures.outside(&[color_s]);
    (o.depth, o.depth_convention) = (std::ptr::null(), std::ptr::null());
    (o.motions, o.motion_count, o.motion_convention) = (images.as_ptr(), count as u32, &convention);
    (o.first_motion_time_s, o.motion_step_s) = (at[0], if count > 1 { at[1] - at[0] } else { 0.0 });
    process(engine, &o, SIZE).unwrap()
}

#[test]
#[ignore = "long: half a minute"]
fn several_motion_images_are_integrated_and_never_worse_than_one() {
    let test = "several_motion_images_are_integrated_and_never_worse_than_one";
    let Some(engine) = engine(test, options(2, 1)) else { return };
    let world = World::new(false);
    eprintln!("| motion | effects | 1 motion image | 2 | 3 | 6 |");
    for name in ["pan 4", "walk 5 Hz", "vibration 18 Hz"] {
        let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY];
        for exposure_s in [0.0, EXPOSURE_S] {
            set_camera(engine, exposure_s, "");
            let want = truth(&world, &motion, &shutter(exposure_s), None);
            let found =
                [1, 2, 3, 6].map(|n| psnr(&by_motion(engine, &world, &motion, (exposure_s, n)), &want));
            let effects = if exposure_s > 0.0 { "both" } else { "shutter" };
            eprintln!(
                "| {name} | {effects} | {:.1} | {:.1} | {:.1} | {:.1} |",
                found[0], found[1], found[2], found[3]
            );
            assert!(found[3] > found[0] - 0.5, "{name}, {effects}: {found:?}");
            assert!(found[3] > found[0] + 8.0 || name != "vibration 18 Hz", "{effects}: {found:?}");
        }
    }
    finish(engine);
}

#[test]
fn a_body_is_as_good_by_ids_as_by_motion() {
    let test = "a_body_is_as_good_by_ids_as_by_motion";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let world = World::new(true);
    let motion = |t: f64| vec![camera_motion("still", t), Pose::IDENTITY, flying(t)];
    for exposure_s in some_of(test, 2, [EXPOSURE_S, 0.0]) {
        set_camera(engine, exposure_s, "");
        let shutter = shutter(exposure_s);
        let end_s = shutter.end_s();
        let want = truth(&world, &motion, &shutter, None);
        let [one, six] = [1, 6].map(|n| psnr(&by_motion(engine, &world, &motion, (exposure_s, n)), &want));
        let by_ids = |count: u32| {
            let mut pictures = Pictures::new([shot(&world, &motion, 0.5 * end_s, MARGIN)], MARGIN);
            let (given, of_body) = (poses("still", end_s, POSES), flights(end_s));
            let bodies = [shutterbug_body { id: 401, pose_count: POSES, poses: of_body.as_ptr() }];
            let mut o = pictures.outside(&[0.5 * end_s]);
            (o.poses, o.pose_count) = (given.as_ptr(), POSES);
            (o.bodies, o.body_count) = (bodies.as_ptr(), count);
            psnr(&process(engine, &o, SIZE).unwrap(), &want)
        };
        let [ids, resting] = [by_ids(1), by_ids(0)];
        eprintln!(
            "a box, exposure {exposure_s} s: {ids:.1} dB by ids, {one:.1} and {six:.1} by 1 and 6 motion images, \
             {resting:.1} at rest"
        );
        assert!(ids > one.max(six) - 0.2, "{ids:.1} dB by ids, {one:.1}, {six:.1} by motion");
        assert!(resting < ids - 4.0, "control: a box at rest passes, {resting:.1} dB");
    }
    finish(engine);
}
