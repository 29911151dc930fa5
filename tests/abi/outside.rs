//! Frames from outside through the C ABI. What the engine itself has rendered, handed back in, gives the engine's own
//! picture: bit for bit with motion, and with depth bit for bit where the engine took its motion from depth too.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::sync::Arc;

use crate::capi_support::{
    Floats, camera, create, engine, finish, image, must, options, outside, process, sized,
};
use crate::gpu_support::frames::{paper, paper_from_depth, request};
use crate::gpu_support::scenes::{closed, moving, rich, walk};
use shutterbug::camera::{Intrinsics, ScanOrder, Trajectory};
use shutterbug::capi::*;
use shutterbug::engine::{GatherInputs, Method};
use shutterbug::plane::PixelFormat;
use shutterbug::scene::Scene;

const K: Intrinsics = Intrinsics { width: 96, height: 64, fx: 70.0, fy: 72.0, cx: 47.0, cy: 33.0 };
const EXPOSURE_S: f64 = 0.012;
const READOUT_S: f64 = 0.025;

/// The engine's own picture and what its gather has read.
fn own(test: &str, method: Method, order: ScanOrder) -> Option<(Vec<u8>, GatherInputs)> {
    own_of(test, &rich(0), method, order)
}

/// The same of any scene.
fn own_of(test: &str, scene: &Scene, method: Method, order: ScanOrder) -> Option<(Vec<u8>, GatherInputs)> {
    let watched = crate::gpu_support::device(test)?;
    let asked = request(&K, EXPOSURE_S, READOUT_S, order);
    let options = crate::gpu_support::frames::options(method, 4);
    let expected = std::slice::from_ref(&asked);
    let mut engine = crate::gpu_support::frames::engine(&watched, scene, &walk(), K, options, expected);
    let picture = engine.render(&asked).unwrap().picture.data;
    Some((picture, engine.gather_inputs(&asked).unwrap().expect("the paper's method gathers")))
}

fn k_camera(order: ScanOrder) -> shutterbug_camera {
    let mut c = camera(K.width, K.height);
    (c.fx_px, c.fy_px, c.cx_px, c.cy_px) = (K.fx, K.fy, K.cx, K.cy);
    (c.exposure_time_s, c.readout_time_s, c.scan_order) = (EXPOSURE_S, READOUT_S, order as u32);
    (c.frame_period_s) = crate::gpu_support::frames::INTERVAL_S;
    c
}

fn c_engine(test: &str, order: ScanOrder) -> Option<Handle> {
    let engine = engine(test, options(2, 1))?;
    must(unsafe { shutterbug_engine_set_camera(engine, &k_camera(order)) }, engine);
    Some(engine)
}

/// The times and margin of the engine's inputs.
fn of(inputs: &GatherInputs) -> shutterbug_outside {
    let mut o = outside();
    (o.frame_index, o.time_s) = (3, 0.01);
    (o.color_time_s, o.first_motion_time_s) = (inputs.color_time_s, inputs.first_motion_time_s);
    o.motion_step_s = inputs.motion_step_s;
    [o.margin_x_px, o.margin_y_px] = inputs.margin_px;
    o
}

fn preset(number: u32) -> shutterbug_motion_convention {
    let mut c = sized();
    must(unsafe { shutterbug_motion_preset(number, &mut c, std::ptr::null_mut(), 0) }, std::ptr::null_mut());
    c
}

const SIZE: [usize; 2] = [K.width as usize, K.height as usize];

#[test]
fn the_engines_own_colour_and_motion_give_its_own_picture_bit_for_bit() {
    let test = "the_engines_own_colour_and_motion_give_its_own_picture_bit_for_bit";
    // Of several motion images frames from outside make another path than the paper does
    // (tests/oracle/outside_motion.rs).
    for (count, order) in
        [(1, ScanOrder::TopToBottom), (1, ScanOrder::RightToLeft), (6, ScanOrder::BottomToTop)]
    {
        let Some((want, inputs)) = own(test, paper(count), order) else { return };
        let engine = c_engine(test, order).unwrap();
        let mut color = Floats::of(&inputs.color);
        let mut motions: Vec<Floats> = inputs.motion_px.iter().map(Floats::of).collect();
        let (color, convention) = (color.image(), preset(0));
        let images: Vec<_> = motions.iter_mut().map(Floats::image).collect();
        let mut o = of(&inputs);
        (o.color, o.motions, o.motion_count) = (&color, images.as_ptr(), images.len() as u32);
        o.motion_convention = &convention;
        let got = process(engine, &o, SIZE).unwrap();
        assert_eq!(got == want, count == 1, "{count} motion images, {order}");
        // Controls: another time, another motion, another scan order.
        let other = |change: &dyn Fn(&mut shutterbug_outside)| {
            let mut other = o;
            change(&mut other);
            process(engine, &other, SIZE).unwrap() != want
        };
        assert!(other(&|o| o.color_time_s += 1e-3), "control: time");
        let backwards = preset(1);
        assert!(other(&|o| o.motion_convention = &backwards), "control: direction");
        must(unsafe { shutterbug_engine_set_camera(engine, &k_camera(ScanOrder::LeftToRight)) }, engine);
        assert!(other(&|_| ()), "control: scan order");
        finish(engine);
    }
}

/// Poses of the engine's span of motion: eq. 3 differences to one step earlier.
fn poses(path: &Trajectory, from_s: f64, to_s: f64) -> [shutterbug_stamped_pose; 2] {
    [from_s, to_s].map(|time_s| {
        let pose = path.pose_at(time_s);
        let (translation_m, rotation_xyzw) = (pose.translation_m.to_array(), pose.rotation.to_array());
        shutterbug_stamped_pose {
            time_s,
            world_from_camera: shutterbug_pose { translation_m, rotation_xyzw },
        }
    })
}

/// Share of bytes that differ by more than 8 levels.
fn far_off(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 8).count() as f64 / a.len() as f64
}

/// A scene in which nothing moves on its own: depth knows nothing of what does.
fn resting() -> Scene {
    let mut scene = rich(0);
    scene.objects[1].trajectory = Some(Arc::new(Trajectory::fixed(moving().pose_at(0.03))));
    scene
}

/// The picture of colour, depth and two poses.
fn through_depth(
    engine: Handle,
    inputs: &GatherInputs,
    poses: &[shutterbug_stamped_pose; 2],
) -> (Vec<u8>, shutterbug_frame_info) {
    let (mut color, mut depth) = (Floats::of(&inputs.color), Floats::of(&inputs.depth_m));
    let (color, depth) = (color.image(), depth.image());
    let convention: shutterbug_depth_convention = sized();
    let mut o = of(inputs);
    (o.color, o.depth, o.depth_convention, o.poses) = (&color, &depth, &convention, poses.as_ptr());
    let picture = process(engine, &o, SIZE).unwrap();
    let mut frame = std::ptr::null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut info: shutterbug_frame_info = sized();
    must(unsafe { shutterbug_frame_get_info(frame, &mut info) }, frame);
    must(shutterbug_frame_destroy(frame), frame);
    (picture, info)
}

/// The poses that eq. 3 of the engine's own path differs between.
fn poses_of(inputs: &GatherInputs) -> [shutterbug_stamped_pose; 2] {
    poses(&walk(), inputs.color_time_s - inputs.motion_step_s, inputs.color_time_s)
}

/// Largest difference, levels, and the share of bytes that differ at all.
fn difference(a: &[u8], b: &[u8]) -> (u8, f64) {
    let worst = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    (worst, a.iter().zip(b).filter(|(a, b)| a != b).count() as f64 / a.len() as f64)
}

#[test]
fn the_engines_own_depth_and_two_poses_give_its_picture() {
    let test = "the_engines_own_depth_and_two_poses_give_its_picture";
    let order = ScanOrder::TopToBottom;
    // Of an engine that takes its own motion from depth: bit for bit, whatever the scene.
    let Some((want, inputs)) = own_of(test, &resting(), paper_from_depth(1), order) else { return };
    let engine = c_engine(test, order).unwrap();
    let poses = poses_of(&inputs);
    let (got, info) = through_depth(engine, &inputs, &poses);
    assert!(got == want, "another picture than the engine's own from depth: {:?}", difference(&got, &want));
    // Poses are told where the two that were given enclose the instant, and only there.
    assert_eq!((info.first_line_start.has_pose, info.last_line_end.has_pose), (1, 0));

    // Of an engine that rasterizes its motion, where every pixel shows a surface: the bound that docs/conventions.md
    // states.
    let (want, inputs) = own_of(test, &closed(resting()), paper(1), order).unwrap();
    let (got, _) = through_depth(engine, &inputs, &poses);
    let (worst, share) = difference(&got, &want);
    eprintln!("depth against rasterized motion: {worst} levels at most, {share} of the bytes differ");
    assert!(worst <= 1 && share < 0.01, "{worst} levels, {share}");
    // Controls: the poses the wrong way round; no movement at all.
    let mut swapped = poses;
    (swapped[0].world_from_camera, swapped[1].world_from_camera) =
        (poses[1].world_from_camera, poses[0].world_from_camera);
    let mut still = poses;
    still[0].world_from_camera = poses[1].world_from_camera;
    for wrong in [swapped, still] {
        let control = difference(&through_depth(engine, &inputs, &wrong).0, &want);
        assert!(control.0 > 40 && control.1 > 0.2, "control: {control:?}");
    }

    // Where a pixel shows no surface, rasterized motion is 0 and depth (infinite) turns with the camera: edges against
    // nothing are blurred along other paths. Nothing else may differ.
    let (want, inputs) = own_of(test, &resting(), paper(1), order).unwrap();
    let (got, _) = through_depth(engine, &inputs, &poses);
    let off = far_off(&got, &want);
    let empty = inputs.depth_m.data.iter().filter(|z| !z.is_finite()).count();
    assert!(empty * 10 > inputs.depth_m.data.len(), "control: much of this scene is empty");
    assert!(off > 0.01 && off < 0.03, "{off} of all bytes are more than 8 levels off");
    finish(engine);
}

/// A picture's values as a format holds them.
fn rounded_to(format: PixelFormat, color: &shutterbug::plane::Plane<f32>) -> Floats {
    let mut rounded = Floats::of(color);
    for (i, v) in rounded.0.iter_mut().enumerate() {
        *v = match format {
            PixelFormat::Rgba16f => exr::prelude::f16::from_f32(*v).to_f32(),
            _ if i % 4 == 3 => 1.0,
            _ => shutterbug::plane::srgb_decode(f32::from(shutterbug::plane::srgb8(*v)) / 255.0),
        };
    }
    rounded
}

#[test]
fn every_format_and_convention_says_the_same() {
    let test = "every_format_and_convention_says_the_same";
    let order = ScanOrder::TopToBottom;
    let Some((want, inputs)) = own(test, paper(1), order) else { return };
    let engine = c_engine(test, order).unwrap();
    let size = [inputs.color.width, inputs.color.height];
    let (mut color, mut motion) = (Floats::of(&inputs.color), Floats::of(&inputs.motion_px[0]));
    let color = color.image();
    let mut o = of(&inputs);
    (o.color, o.motion_count) = (&color, 1);
    // A vector of the engine's own, said in each convention.
    let said = |p: u32, v: [f32; 2]| -> [f32; 2] {
        let (w, h) = (size[0] as f32, size[1] as f32);
        match p {
            0 | 5 => v,
            1 => [-v[0], -v[1]],
            2 => [-v[0] / w, -v[1] / h],
            3 => [v[0] / (0.5 * w), -v[1] / (0.5 * h)],
            _ => [-v[0] / (0.5 * w), v[1] / (0.5 * h)],
        }
    };
    for p in 0..6 {
        let mut data: Vec<f32> = motion.0.chunks_exact(2).flat_map(|v| said(p, [v[0], v[1]])).collect();
        let given = image(PixelFormat::Rg32f, size[0], size[1], bytemuck::cast_slice_mut(&mut data));
        let convention = preset(p);
        (o.motions, o.motion_convention) = (&given, &convention);
        let got = process(engine, &o, SIZE).unwrap();
        // Dividing and multiplying again rounds the last bit of a vector.
        assert!(far_off(&got, &want) < 1e-3, "preset {p}: {}", far_off(&got, &want));
        if p > 0 && p < 5 {
            let own = preset(0);
            o.motion_convention = &own;
            let control = process(engine, &o, SIZE).unwrap();
            assert!(far_off(&control, &want) > 0.02, "control {p}: {}", far_off(&control, &want));
        }
        // The converter on the CPU says the same numbers.
        let mut back = vec![0f32; data.len()];
        let to = image(PixelFormat::Rg32f, size[0], size[1], bytemuck::cast_slice_mut(&mut back));
        must(
            unsafe { shutterbug_motion_convert(&given, &convention, 0.04, &to, std::ptr::null_mut(), 0) },
            std::ptr::null_mut(),
        );
        let worst =
            back.iter().zip(&motion.0).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max);
        assert!(worst < 1e-5, "preset {p}: {worst}");
    }
    let own = preset(0);
    let given = motion.image();
    (o.motions, o.motion_convention) = (&given, &own);
    // Colour in every format, with rows that have room behind them and start at an odd byte where that is allowed.
    for format in [PixelFormat::Rgb8, PixelFormat::Rgba8, PixelFormat::Bgra8, PixelFormat::Rgba16f] {
        let stride = (size[0] * format.bytes()).next_multiple_of(4) + 12;
        let mut bytes = vec![0xaa; stride * size[1] + 8];
        let start = if format.alignment() == 1 { 3 } else { (bytes.as_ptr() as usize) % 2 };
        for y in 0..size[1] {
            for x in 0..size[0] {
                let v = inputs.color.pixel(x, y);
                let code = |v: f32| shutterbug::plane::srgb8(v);
                let half = |v: f32| exr::prelude::f16::from_f32(v).to_le_bytes();
                let pixel: Vec<u8> = match format {
                    PixelFormat::Rgb8 => vec![code(v[0]), code(v[1]), code(v[2])],
                    PixelFormat::Rgba8 => vec![code(v[0]), code(v[1]), code(v[2]), 255],
                    PixelFormat::Bgra8 => vec![code(v[2]), code(v[1]), code(v[0]), 255],
                    _ => v.iter().flat_map(|v| half(*v)).collect(),
                };
                bytes[start + y * stride + x * format.bytes()..][..pixel.len()].copy_from_slice(&pixel);
            }
        }
        let mut given = image(format, size[0], size[1], &mut bytes[start..]);
        given.stride_bytes = stride as u64;
        o.color = &given;
        let got = process(engine, &o, SIZE).unwrap();
        let worst = got.iter().zip(&want).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        // The engine renders into floats; halves and 8 bits round that before the blur averages it.
        assert!(worst <= 1, "{format:?}: {worst} levels off");
        // Nothing but that rounding: the rounded values given as floats make the very same picture.
        let mut rounded = rounded_to(format, &inputs.color);
        let floats = rounded.image();
        o.color = &floats;
        assert!(process(engine, &o, SIZE).unwrap() == got, "{format:?}: more than its own rounding");
        o.color = &given;
        if format == PixelFormat::Rgba8 {
            o.encoding = 1;
            let control = process(engine, &o, SIZE).unwrap();
            assert!(far_off(&control, &want) > 0.2, "control: the encoding");
            o.encoding = 0;
        }
    }
    finish(engine);
}

#[test]
fn frames_in_flight_come_out_as_they_would_alone() {
    let test = "frames_in_flight_come_out_as_they_would_alone";
    let Some(engine) = engine(test, options(2, 1)) else { return };
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(64, 48)) }, engine);
    let mut small = crate::capi_support::Small::new(64, 48);
    let at = |small: &mut crate::capi_support::Small, i: u32| {
        small.outside.time_s = 0.001 * f64::from(i);
        small.outside.frame_index = i;
        small.outside
    };
    let alone: Vec<_> = (0..9).map(|i| process(engine, &at(&mut small, i), [64, 48]).unwrap()).collect();
    assert!(alone.windows(2).all(|w| w[0] != w[1]), "control: the frames differ");
    let mut frames = std::collections::VecDeque::new();
    let mut got = Vec::new();
    let collect = |frame: Handle| {
        let mut ready = 7u32;
        while ready != 1 {
            must(unsafe { shutterbug_frame_poll(frame, &mut ready) }, frame);
        }
        must(shutterbug_frame_wait(frame, 0.0), frame);
        let mut rgb = vec![0; 64 * 48 * 3];
        let to = image(PixelFormat::Rgb8, 64, 48, &mut rgb);
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        must(shutterbug_frame_destroy(frame), frame);
        rgb
    };
    for i in 0..9 {
        let o = at(&mut small, i);
        let mut frame = std::ptr::null_mut();
        let mut code = unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) };
        if code == crate::capi_support::status("FULL") {
            assert_eq!(frames.len(), 3, "as many as were asked for");
            got.push(collect(frames.pop_front().unwrap()));
            code = unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) };
        }
        must(code, engine);
        frames.push_back(frame);
    }
    got.extend(frames.into_iter().map(collect));
    assert!(got == alone);
    finish(engine);
}

#[test]
fn instants_and_poses_come_with_the_frame() {
    let test = "instants_and_poses_come_with_the_frame";
    let Some(engine) = engine(test, options(2, 1)) else { return };
    let folder = crate::capi_support::text("demo/capture");
    must(unsafe { shutterbug_engine_load_capture(engine, folder.as_ptr()) }, engine);
    let mut c = camera(64, 48);
    (c.readout_time_s, c.exposure_time_s) = (0.02, 0.01);
    must(unsafe { shutterbug_engine_set_camera(engine, &c) }, engine);
    let mut r: shutterbug_request = sized();
    r.time_s = 10.1;
    let mut frame = std::ptr::null_mut();
    must(unsafe { shutterbug_engine_submit(engine, &r, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut info: shutterbug_frame_info = sized();
    must(unsafe { shutterbug_frame_get_info(frame, &mut info) }, frame);
    let end_s = 10.1 + 0.02 * 47.0 / 48.0 + 0.01;
    assert!((info.last_line_end.time_s - end_s).abs() < 1e-12 && info.first_line_start.time_s == 10.1);
    assert!((info.middle.time_s - 0.5 * (10.1 + end_s)).abs() < 1e-12);
    let capture = shutterbug::capture::Capture::read(std::path::Path::new("demo/capture"), None).unwrap();
    for instant in [info.first_line_start, info.middle, info.last_line_end] {
        let want = capture.trajectory.pose_at(instant.time_s);
        assert_eq!(instant.has_pose, 1);
        assert_eq!(instant.world_from_camera.translation_m, want.translation_m.to_array());
        assert_eq!(instant.world_from_camera.rotation_xyzw, want.rotation.to_array());
    }
    assert_ne!(
        info.middle.world_from_camera.translation_m,
        info.last_line_end.world_from_camera.translation_m
    );
    must(shutterbug_frame_destroy(frame), frame);
    finish(engine);
    // Several engines at once, and one after another.
    let two = [create(options(2, 0)).unwrap(), create(options(1, 0)).unwrap()];
    assert_ne!(two[0], two[1]);
    two.iter().for_each(|e| assert_eq!(shutterbug_engine_destroy(*e), 0));
}
