//! Sharp planes through the C ABI: colour, motion and depth of a frame's own instant, beside the disturbed picture.
//! They are those of the engine itself, bit for bit, by each method; halves are the floats rounded.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::capi_support::*;
use exr::prelude::f16;
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::capi::*;
use shutterbug::capture::Capture;
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::{MotionBlur, RollingShutter};
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, ExactOptions, FastOptions, Frame, FrameRequest, Method,
    PaperOptions,
};
use shutterbug::plane::{PixelFormat, Plane};

const W: usize = 96;
const H: usize = 72;
/// In the demo capture, while the camera moves.
const TIME_S: f64 = 10.1;

/// The methods of the header and the engine's.
fn methods() -> [(u32, Method); 4] {
    [
        (1, Method::Accumulation(AccumulationOptions::default())),
        (2, Method::Paper(PaperOptions { motion_images: 2, max_samples: 240, ..PaperOptions::default() })),
        (3, Method::Exact(ExactOptions::default())),
        (4, Method::Fast(FastOptions { max_samples: 240, ..FastOptions::default() })),
    ]
}

/// The engine's own frame of the demo capture, seen through the camera of the tests.
fn own(test: &str, method: Method, time_s: f64) -> Option<Frame> {
    let watched = crate::gpu_support::device(test)?;
    let capture = Capture::read(Path::new("demo/capture"), None).unwrap();
    let half = W as f64 / 2.0;
    let k =
        Intrinsics { width: W as u32, height: H as u32, fx: half, fy: half, cx: half, cy: H as f64 / 2.0 };
    let mut settings = Settings::default();
    settings.set(&RollingShutter, "readout_time_s", Value::Number(0.02)).unwrap();
    settings.set(&MotionBlur, "exposure_time_s", Value::Number(0.008)).unwrap();
    let request = FrameRequest {
        index: 7,
        shutter: ShutterTiming {
            start_s: time_s,
            exposure_time_s: 0.008,
            readout_time_s: 0.02,
            scan_order: ScanOrder::TopToBottom,
            line_count: H as u32,
        },
        frame_interval_s: 0.04,
        seed: 0,
        settings,
        static_camera: false,
        planes: true,
        statistics: false,
    };
    let options = EngineOptions {
        method,
        samples: 1,
        frames_in_flight: 1,
        planes: true,
        time_limit: Duration::from_secs(60),
    };
    let (scene, path) = (Arc::new(capture.scene), Arc::new(capture.trajectory));
    // Nothing is announced: a host asks for one frame after another.
    let mut engine = Engine::new(&watched.0, scene, path, k, options, &[]).unwrap();
    Some(engine.render(&request).unwrap())
}

fn read_floats(frame: Handle, plane: u32, format: PixelFormat) -> Vec<f32> {
    // Words, so that rows of floats are aligned; two floats of room behind each row, which stay as they are.
    let stride = W * format.bytes() + 8;
    let mut words = vec![0x5555_5555u32; stride * H / 4];
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    let mut to = image(format, W, H, bytes);
    to.stride_bytes = stride as u64;
    must(unsafe { shutterbug_frame_read(frame, plane, &to) }, frame);
    let bytes: &[u8] = bytemuck::cast_slice(&words);
    let mut values = Vec::new();
    for row in bytes.chunks_exact(stride) {
        let (row, beyond) = row.split_at(W * format.bytes());
        assert!(beyond.iter().all(|b| *b == 0x55), "bytes between rows are left alone");
        values.extend(row.chunks_exact(format.alignment()).map(|v| match format.alignment() {
            2 => f16::from_le_bytes([v[0], v[1]]).to_f32(),
            _ => f32::from_le_bytes(v.try_into().unwrap()),
        }));
    }
    values
}

/// Equal bits: depth is infinite where nothing is.
fn same(got: &[f32], want: &Plane<f32>) -> bool {
    got.len() == want.data.len() && got.iter().zip(&want.data).all(|(a, b)| a.to_bits() == b.to_bits())
}

#[test]
fn sharp_planes_are_the_engines_own_by_each_method() {
    let test = "sharp_planes_are_the_engines_own_by_each_method";
    let _turn = crate::gpu_support::Turn::take();
    for (code, method) in methods() {
        let Some(want) = own(test, method.clone(), TIME_S) else { return };
        let planes = want.planes.as_ref().unwrap();
        // Controls: there is something to see, it moves, and another instant looks otherwise.
        let moved = planes.motion_px.data.iter().fold(0f32, |a, b| a.max(b.abs()));
        assert!(moved > 1.0 && planes.depth_m.data.iter().any(|z| z.is_finite()), "control: {moved} px");
        let other = own(test, method, TIME_S + 0.02).unwrap().planes.unwrap();
        let mut o = options(code, 3);
        o.max_blur_samples = 240;
        let engine = engine(test, o).unwrap();
        must(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine);
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(W as u32, H as u32)) }, engine);
        let mut r: shutterbug_request = sized();
        (r.frame_index, r.time_s, r.flags) = (7, TIME_S, 1);
        let mut frame = std::ptr::null_mut();
        must(unsafe { shutterbug_engine_submit(engine, &r, &mut frame) }, engine);
        must(shutterbug_frame_wait(frame, -1.0), frame);
        let mut rgb = vec![0; W * H * 3];
        let to = image(PixelFormat::Rgb8, W, H, &mut rgb);
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        assert!(rgb == want.picture.data, "method {code}: another disturbed picture");
        for (plane, float, half, want, other) in [
            (2, PixelFormat::Rgba32f, Some(PixelFormat::Rgba16f), &planes.color, &other.color),
            (3, PixelFormat::Rg32f, Some(PixelFormat::Rg16f), &planes.motion_px, &other.motion_px),
            (4, PixelFormat::R32f, None, &planes.depth_m, &other.depth_m),
        ] {
            let got = read_floats(frame, plane, float);
            assert!(same(&got, want), "method {code}, plane {plane}: not the engine's own");
            assert!(!same(&got, other), "control: method {code}, plane {plane} at another instant");
            let Some(half) = half else { continue };
            let rounded = want.data.iter().map(|v| f16::from_f32(*v).to_f32());
            assert!(read_floats(frame, plane, half).into_iter().eq(rounded), "method {code}, plane {plane}");
        }
        must(shutterbug_frame_destroy(frame), frame);
        finish(engine);
    }
}

#[test]
fn the_motion_plane_is_what_frames_from_outside_call_their_own() {
    // Colour and motion planes of one frame, handed back in at their instant: the picture is disturbed as the engine's
    // own, up to what is rendered beyond the borders (the planes have no margin) and motion that changes within the
    // frame.
    let test = "the_motion_plane_is_what_frames_from_outside_call_their_own";
    let _turn = crate::gpu_support::Turn::take();
    let Some(engine) = engine(test, options(2, 3)) else { return };
    must(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine);
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(W as u32, H as u32)) }, engine);
    let mut r: shutterbug_request = sized();
    (r.time_s, r.flags) = (TIME_S, 1);
    let mut frame = std::ptr::null_mut();
    must(unsafe { shutterbug_engine_submit(engine, &r, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let (mut color, mut motion) =
        (read_floats(frame, 2, PixelFormat::Rgba32f), read_floats(frame, 3, PixelFormat::Rg32f));
    let mut want = vec![0; W * H * 3];
    let to = image(PixelFormat::Rgb8, W, H, &mut want);
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    must(shutterbug_frame_destroy(frame), frame);
    let mean = |engine: Handle, sign: f32, color: &mut [f32], motion: &mut [f32]| {
        motion.iter_mut().for_each(|v| *v *= sign);
        let color = image(PixelFormat::Rgba32f, W, H, bytemuck::cast_slice_mut(color));
        let motions = image(PixelFormat::Rg32f, W, H, bytemuck::cast_slice_mut(motion));
        let mut convention: shutterbug_motion_convention = sized();
        must(
            unsafe { shutterbug_motion_preset(0, &mut convention, std::ptr::null_mut(), 0) },
            std::ptr::null_mut(),
        );
        let mut o = outside();
        (o.time_s, o.color_time_s, o.motion_count) = (TIME_S, TIME_S, 1);
        (o.color, o.motions, o.motion_convention) = (&color, &motions, &convention);
        let got = process(engine, &o, [W, H]).unwrap();
        got.iter().zip(&want).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / want.len() as f64
    };
    let right = mean(engine, 1.0, &mut color, &mut motion);
    let backwards = mean(engine, -1.0, &mut color, &mut motion);
    let still = mean(engine, 0.0, &mut color, &mut motion);
    eprintln!("mean difference, levels: {right:.3}; backwards {backwards:.3}, still {still:.3}");
    // 8.8 of 22.0 and 20.7 levels: the demo moves by many pixels, so much comes from beyond the borders.
    assert!(right < 0.5 * still && right < 0.5 * backwards, "{right}, control {backwards}, {still}");
    finish(engine);
}
