//! Conventions of hosts: rows, depths and poses as they have them, pictures as they want them, and wrong ones found
//! out.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ffi::{c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;

use crate::capi_support::{
    OK, SmallPath, camera, engine, error_of, finish, image, must, options, process, sized, status,
};
use crate::outside_support::host::{Pictures, SIZE, set_camera};
use crate::outside_support::{K, World, shot};
use glam::{DQuat, DVec3};
use shutterbug::camera::Pose;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

const BOTTOM_UP: u32 = 0x1_0000;

/// Rows in the other order.
fn flipped<T: Copy>(values: &[T], row: usize) -> Vec<T> {
    values.chunks_exact(row).rev().flatten().copied().collect()
}

fn still() -> [shutterbug_stamped_pose; 2] {
    let pose = |time_s: f64, x: f64| shutterbug_stamped_pose {
        time_s,
        world_from_camera: shutterbug_pose {
            translation_m: [x, 0.0, 0.0],
            rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
        },
    };
    [pose(0.0, 0.0), pose(1.0, 1.0)]
}

#[test]
fn rows_and_depths_of_any_convention_give_one_picture() {
    let Some(engine) = engine("rows_and_depths_of_any_convention_give_one_picture", options(0, 1)) else {
        return;
    };
    set_camera(engine, 0.0, "");
    let motion = |_: f64| vec![Pose::IDENTITY; 2];
    let taken = shot(&World::new(false), &motion, 0.0, [12, 3]);
    let [w, h] = taken.size;
    let poses = still();
    let (near, far) = (0.1, 40.0);
    let convention = |kind: u32| {
        let mut c: shutterbug_depth_convention = sized();
        (c.kind, c.near_m, c.far_m) = (kind, near, far);
        c
    };
    let value = |kind: u32, z: f64| match kind {
        0 => z,
        1 => near / z,
        2 => far * (z - near) / (z * (far - near)),
        3 => 1.0 - far * (z - near) / (z * (far - near)),
        _ => 2.0 * far * (z - near) / (z * (far - near)) - 1.0,
    };
    let make = |kind: u32, up: bool| {
        let mut depth: Vec<f32> = taken.depth_m.iter().map(|z| value(kind, f64::from(*z)) as f32).collect();
        let mut rgb = taken.rgb.clone();
        if up {
            (depth, rgb) = (flipped(&depth, w), flipped(&rgb, 3 * w));
        }
        let mut color = image(PixelFormat::Rgb8, w, h, &mut rgb);
        let mut depth = image(PixelFormat::R32f, w, h, bytemuck::cast_slice_mut(&mut depth));
        color.format |= if up { BOTTOM_UP } else { 0 };
        depth.format |= if up { BOTTOM_UP } else { 0 };
        let convention = convention(kind);
        let mut o = crate::capi_support::outside();
        (o.color_time_s, o.color, o.depth, o.depth_convention) = (0.012, &color, &depth, &convention);
        (o.poses, o.pose_count, o.flags) = (poses.as_ptr(), 2, 1);
        [o.margin_x_px, o.margin_y_px] = [12, 3];
        process(engine, &o, SIZE).unwrap()
    };
    let want = make(0, false);
    assert!(make(0, true) == want, "bottom up");
    for kind in 1..5 {
        for up in [false, true] {
            let far = make(kind, up).iter().zip(&want).filter(|(a, b)| a.abs_diff(**b) > 2).count();
            assert!(far < want.len() / 500, "kind {kind}, bottom up {up}: {far} bytes");
        }
    }
    // Control: the camera passes what it sees, so depth matters, and so do rows.
    let mut convention = convention(1);
    convention.near_m *= 2.0;
    let mut o = crate::capi_support::outside();
    let mut pictures = Pictures::new([taken.clone()], [12, 3]);
    (o.poses, o.pose_count, o.flags) = (poses.as_ptr(), 2, 1);
    let own = pictures.outside(&[0.012]);
    (o.color, o.depth, o.depth_convention) = (own.color, own.depth, &convention);
    (o.color_time_s, o.margin_x_px, o.margin_y_px) = (0.012, 12, 3);
    assert!(process(engine, &o, SIZE).unwrap() != want, "control: metres read as a reversed depth");
    finish(engine);
}

#[test]
fn pictures_are_read_in_any_row_order_as_nv12_and_as_radiance() {
    let test = "pictures_are_read_in_any_row_order_as_nv12_and_as_radiance";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let small = SmallPath::new(32, 24);
    let o = shutterbug_outside { flags: 1 | 2, ..small.outside };
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut rgb = vec![0; 32 * 24 * 3];
    must(unsafe { shutterbug_frame_read(frame, 1, &image(PixelFormat::Rgb8, 32, 24, &mut rgb)) }, frame);
    let mut up = rgb.clone();
    let mut to = image(PixelFormat::Rgb8, 32, 24, &mut up);
    to.format |= BOTTOM_UP;
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    assert!(flipped(&up, 96) == rgb && up != rgb);
    // NV12, with padding that is left alone.
    let mut nv12 = vec![7u8; 40 * 36];
    let mut to = image(PixelFormat::R8u, 32, 24, &mut nv12);
    (to.format, to.stride_bytes) = (12, 40);
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    let luma = |i: usize| {
        0.299 * f32::from(rgb[3 * i]) + 0.587 * f32::from(rgb[3 * i + 1]) + 0.114 * f32::from(rgb[3 * i + 2])
    };
    let off = |x: usize, y: usize| (f32::from(nv12[y * 40 + x]) - luma(y * 32 + x)).abs();
    assert!((0..24).all(|y| (0..32).all(|x| off(x, y) < 0.51)));
    assert!((0..36).all(|y| nv12[y * 40 + 32..(y + 1) * 40] == [7; 8]), "padding");
    to.capacity_bytes = 40 * 35 + 31;
    assert_eq!(unsafe { shutterbug_frame_read(frame, 1, &to) }, status("TOO_SMALL"));
    // Radiance: the picture is its sRGB here.
    let mut floats = vec![0f32; 32 * 24 * 4];
    let to = image(PixelFormat::Rgba32f, 32, 24, bytemuck::cast_slice_mut(&mut floats));
    must(unsafe { shutterbug_frame_read(frame, 5, &to) }, frame);
    let encoded = |i: usize, c: usize| shutterbug::plane::srgb8(floats[4 * i + c]);
    assert!((0..32 * 24).all(|i| (0..3).all(|c| encoded(i, c).abs_diff(rgb[3 * i + c]) <= 1)));
    assert!(floats.chunks(4).all(|p| p[3] == 1.0));
    must(shutterbug_frame_destroy(frame), null_mut());
    // Not without having asked for it.
    let o = shutterbug_outside { flags: 1, ..o };
    must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    assert_eq!(unsafe { shutterbug_frame_read(frame, 5, &to) }, status("STATE"));
    assert_eq!(unsafe { shutterbug_frame_read(frame, 1, null()) }, status("ARGUMENT"));
    assert!(error_of(frame).contains("image is null"), "{}", error_of(frame));
    must(shutterbug_frame_destroy(frame), null_mut());
    finish(engine);
}

static TOLD: Mutex<Vec<(u32, String)>> = Mutex::new(Vec::new());

unsafe extern "C" fn tell(_: *mut c_void, level: u32, text: *const c_char) {
    let text = unsafe { std::ffi::CStr::from_ptr(text) }.to_string_lossy().into_owned();
    TOLD.lock().unwrap().push((level, text));
}

#[test]
fn depth_that_cannot_be_meant_is_spoken_of_once() {
    let test = "depth_that_cannot_be_meant_is_spoken_of_once";
    for (value, says) in [(f32::NAN, "no number"), (-2.0, "below 0"), (1.5, "")] {
        let mut o = options(0, 0);
        o.log = Some(tell);
        let Some(engine) = engine(test, o) else { return };
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
        let small = SmallPath::new(32, 24);
        let mut depth = vec![value; 32 * 24];
        let depth = image(PixelFormat::R32f, 32, 24, bytemuck::cast_slice_mut(&mut depth));
        TOLD.lock().unwrap().clear();
        let o = shutterbug_outside { depth: &depth, flags: 1, ..small.outside };
        for _ in 0..2 {
            process(engine, &o, [32, 24]).unwrap();
        }
        let told: Vec<_> =
            TOLD.lock().unwrap().iter().filter(|(l, t)| *l == 2 && t.contains("depth:")).cloned().collect();
        assert_eq!(told.len(), usize::from(!says.is_empty()), "{value}: {told:?}");
        assert!(told.iter().all(|(_, t)| t.contains(says) && t.contains("100 %")), "{told:?}");
        finish(engine);
    }
}

/// A frame's colour and depth as a host could have it wrong.
struct Given {
    rgb: Vec<u8>,
    depth: Vec<f32>,
    pose: shutterbug_pose,
}

/// What is done wrong, as bits of the answer.
fn given(pose: &Pose, wrong: u32) -> Given {
    let motion = |_: f64| vec![*pose, Pose::IDENTITY];
    let taken = shot(&World::new(false), &motion, 0.0, [0, 0]);
    let w = K.width as usize;
    let metres = |(i, z): (usize, &f32)| {
        let px = glam::DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        let ray = if wrong & 16 != 0 { K.ray(px).length() as f32 } else { 1.0 };
        z * ray * if wrong & 8 != 0 { 1000.0 } else { 1.0 }
    };
    let mut depth: Vec<f32> = taken.depth_m.iter().enumerate().map(metres).collect();
    let mut rgb = taken.rgb;
    if wrong & 32 != 0 {
        (rgb, depth) = (flipped(&rgb, 3 * w), flipped(&depth, w));
    }
    let turn = if wrong & 1 != 0 { DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0) } else { DQuat::IDENTITY };
    let said = Pose { rotation: pose.rotation * turn, ..*pose };
    let said = if wrong & 2 != 0 { said.inverse() } else { said };
    let [x, y, z, q] = said.rotation.to_array();
    let rotation_xyzw = if wrong & 4 != 0 { [q, x, y, z] } else { [x, y, z, q] };
    Given {
        rgb,
        depth,
        pose: shutterbug_pose { translation_m: said.translation_m.to_array(), rotation_xyzw },
    }
}

fn agreement(frames: [Given; 2]) -> (shutterbug_agreement, String) {
    agreement_as(frames, 0)
}

/// With 8-bit colours that are said to be of that encoding.
fn agreement_as(mut frames: [Given; 2], encoding: u32) -> (shutterbug_agreement, String) {
    let mut c = camera(K.width, K.height);
    (c.fx_px, c.fy_px, c.cx_px, c.cy_px) = (K.fx, K.fy, K.cx, K.cy);
    let convention: shutterbug_depth_convention = sized();
    let images = frames.each_mut().map(|f| {
        let color = image(PixelFormat::Rgb8, SIZE[0], SIZE[1], &mut f.rgb);
        (color, image(PixelFormat::R32f, SIZE[0], SIZE[1], bytemuck::cast_slice_mut(&mut f.depth)))
    });
    let view = |i: usize| {
        let mut v: shutterbug_view = sized();
        (v.color, v.depth, v.depth_convention) = (&images[i].0, &images[i].1, &convention);
        (v.world_from_camera, v.encoding) = (frames[i].pose, encoding);
        v
    };
    let mut found: shutterbug_agreement = sized();
    let mut said = vec![0 as c_char; 400];
    let (a, b) = (view(0), view(1));
    let code = unsafe { shutterbug_check_conventions(&c, &a, &b, &mut found, said.as_mut_ptr(), 400) };
    let said = unsafe { std::ffi::CStr::from_ptr(said.as_ptr()) }.to_string_lossy().into_owned();
    assert_eq!(code, 0, "{said}");
    (found, said)
}

#[test]
fn wrong_conventions_are_found_out_and_named() {
    let pose = |rotation: [f64; 3], at: [f64; 3]| Pose {
        rotation: DQuat::from_euler(glam::EulerRot::YXZ, rotation[0], rotation[1], rotation[2]),
        translation_m: DVec3::from(at),
    };
    let (a, b) = (pose([0.25, 0.1, 0.06], [0.3, -0.2, 0.1]), pose([0.33, 0.04, 0.12], [0.42, -0.12, 0.25]));
    let (right, said) = agreement([given(&a, 0), given(&b, 0)]);
    assert!(right.verdict == 0 && right.change == 0, "{said}");
    assert!(said.contains("agree"), "{said}");
    for wrong in [1, 2, 4, 8, 16, 32, 1 | 2, 1 | 4, 2 | 4, 1 | 2 | 4] {
        let (found, said) = agreement([given(&a, wrong), given(&b, wrong)]);
        eprintln!("{wrong}: {said}");
        assert!(found.verdict == 1 && found.change == wrong, "{wrong}: verdict {}, {said}", found.verdict);
        assert!(found.best < right.as_given + 0.003 && found.as_given > found.best, "{wrong}: {said}");
    }
    // A camera that rests tells nothing; frames of two places agree in no convention.
    let (still, said) = agreement([given(&a, 0), given(&a, 0)]);
    assert!(still.verdict == 2 || still.verdict == 0, "{said}");
    let elsewhere = Given { pose: given(&pose([1.9, 0.0, 0.0], [2.0, 0.0, 0.0]), 0).pose, ..given(&b, 0) };
    let (never, said) = agreement([given(&a, 0), elsewhere]);
    assert!(never.verdict == 3, "{said}");
}

/// As linear codes of 8 bits.
fn linear(given: Given) -> Given {
    let code = |v: &u8| (255.0 * shutterbug::plane::srgb_decode(f32::from(*v) / 255.0) + 0.5) as u8;
    Given { rgb: given.rgb.iter().map(code).collect(), ..given }
}

#[test]
fn the_other_encoding_is_found_out_in_both_directions() {
    let pose = |rotation: [f64; 3], at: [f64; 3]| Pose {
        rotation: DQuat::from_euler(glam::EulerRot::YXZ, rotation[0], rotation[1], rotation[2]),
        translation_m: DVec3::from(at),
    };
    let (a, b) = (pose([0.25, 0.1, 0.06], [0.3, -0.2, 0.1]), pose([0.33, 0.04, 0.12], [0.42, -0.12, 0.25]));
    let srgb = |wrong: u32| [given(&a, wrong), given(&b, wrong)];
    let light = |wrong: u32| srgb(wrong).map(linear);
    for (frames, said_linear, want, says) in [
        (srgb(0), 0, 0, "agree:"),
        (light(0), 1, 0, "agree:"),
        (srgb(0), 1, 64, "sRGB, not linear"),
        (light(0), 0, 64, "linear, not sRGB"),
        (srgb(1), 1, 1 | 64, "sRGB, not linear"),
        (light(4 | 32), 0, 4 | 32 | 64, "linear, not sRGB"),
        (srgb(2), 0, 2, "camera from world"),
    ] {
        let (found, said) = agreement_as(frames, said_linear);
        eprintln!("{said}");
        assert_eq!((found.verdict, found.change), (u32::from(want != 0), want), "{said}");
        assert!(said.contains(says), "{said}");
    }
    // Edges that are stairs tell nothing: each pixel one of two colours.
    let stairs =
        srgb(0).map(|g| Given { rgb: g.rgb.iter().map(|v| if *v > 110 { 180 } else { 60 }).collect(), ..g });
    let (found, said) = agreement_as(stairs, 1);
    assert_eq!(found.change & 64, 0, "{said}");
}

#[test]
fn views_of_the_header_of_before_and_rows_from_the_bottom_are_taken_as_they_are_said() {
    let pose = |yaw: f64, x: f64| Pose {
        rotation: DQuat::from_euler(glam::EulerRot::YXZ, yaw, 0.3 * yaw, 0.1),
        translation_m: DVec3::new(x, -0.2, 0.1),
    };
    let mut frames = [given(&pose(0.25, 0.3), 32), given(&pose(0.33, 0.42), 32)];
    let mut c = camera(K.width, K.height);
    (c.fx_px, c.fy_px, c.cx_px, c.cy_px) = (K.fx, K.fy, K.cx, K.cy);
    let convention: shutterbug_depth_convention = sized();
    let mut check = |up: u32, change: &dyn Fn(&mut shutterbug_view)| {
        let images = frames.each_mut().map(|f| {
            let mut color = image(PixelFormat::Rgb8, SIZE[0], SIZE[1], &mut f.rgb);
            let mut depth =
                image(PixelFormat::R32f, SIZE[0], SIZE[1], bytemuck::cast_slice_mut(&mut f.depth));
            (color.format, depth.format) = (color.format | up, depth.format | up);
            (color, depth)
        });
        let view = |i: usize| {
            let mut v: shutterbug_view = sized();
            (v.color, v.depth, v.depth_convention) = (&images[i].0, &images[i].1, &convention);
            v.world_from_camera = frames[i].pose;
            change(&mut v);
            v
        };
        let mut found: shutterbug_agreement = sized();
        let (a, b) = (view(0), view(1));
        let code = unsafe { shutterbug_check_conventions(&c, &a, &b, &mut found, null_mut(), 0) };
        (code, found.verdict, found.change)
    };
    assert_eq!(check(BOTTOM_UP, &|_| ()), (OK, 0, 0));
    assert_eq!(check(0, &|_| ()), (OK, 1, 32), "control: not said to be from the bottom");
    let old = std::mem::offset_of!(shutterbug_view, encoding) as u32;
    // What lies behind the struct of before is not the library's to read.
    assert_eq!(check(BOTTOM_UP, &|v| (v.struct_size, v.encoding) = (old, 9)), (OK, 0, 0));
    assert_eq!(check(0, &|v| v.encoding = 2).0, status("ARGUMENT"));
    assert_eq!(check(0, &|v| v.reserved_more = 1).0, status("ARGUMENT"));
    assert_eq!(check(0, &|v| v.struct_size = old - 4).0, status("STRUCT_SIZE"));
}
