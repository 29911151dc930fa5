//! Automatic exposure through the C ABI: the frames of `simulate`, bit for bit, and the rules of the header for when it
//! waits, keeps its state, and begins anew.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::collections::VecDeque;
use std::path::Path;
use std::process::Command;
use std::ptr::null_mut;

use crate::capi_support::*;
use shutterbug::capi::*;
use shutterbug::engine::FastOptions;
use shutterbug::plane::{PixelFormat, read_rgb8};

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../demo/capture");
const TABLE: &str = "\n[auto_exposure]\ntarget = 0.5\ndelay_frames = 2\nspeed = 0.7\n";
const W: usize = 320;
const H: usize = 240;

/// The demo capture's camera, with more at its end.
fn camera_text(more: &str) -> String {
    std::fs::read_to_string(format!("{DEMO}/camera.toml")).unwrap() + more
}

fn set_camera(engine: Handle, text: &str) {
    must(unsafe { shutterbug_engine_set_camera_text(engine, self::text(text).as_ptr()) }, engine);
}

/// An engine on the demo capture, and the times of its frames.
fn demo(test: &str) -> Option<(Handle, Vec<f64>)> {
    let mut o = options(4, 0);
    (o.frames_in_flight, o.max_blur_samples) = (4, FastOptions::default().max_samples);
    let engine = engine(test, o)?;
    must(unsafe { shutterbug_engine_load_capture(engine, text(DEMO).as_ptr()) }, engine);
    let mut times = vec![0.0; info(engine).capture_frames as usize];
    must(unsafe { shutterbug_engine_get_frame_times(engine, times.as_mut_ptr(), times.len()) }, engine);
    Some((engine, times))
}

fn submit(engine: Handle, index: usize, time_s: f64) -> Result<Handle, Status> {
    let mut r: shutterbug_request = sized();
    (r.frame_index, r.time_s) = (index as u32, time_s);
    let mut frame = null_mut();
    match unsafe { shutterbug_engine_submit(engine, &r, &mut frame) } {
        OK => Ok(frame),
        code => Err(code),
    }
}

/// Waits; picture and gain.
fn collect(frame: Handle) -> (Vec<u8>, f64) {
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut info: shutterbug_frame_info = sized();
    must(unsafe { shutterbug_frame_get_info(frame, &mut info) }, frame);
    let mut rgb = vec![0; info.width as usize * info.height as usize * 3];
    let to = image(PixelFormat::Rgb8, info.width as usize, info.height as usize, &mut rgb);
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    must(shutterbug_frame_destroy(frame), null_mut());
    (rgb, info.exposure_gain)
}

/// What `simulate` makes of the demo capture with that camera.
fn simulated(folder: &Path, camera: &str) -> Vec<Vec<u8>> {
    let file = folder.join("camera.toml");
    std::fs::write(&file, camera).unwrap();
    let out = folder.join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    command.args(["simulate", DEMO, "--samples", "1", "--method", "fast", "--camera"]);
    let done = command.arg(&file).arg("--out").arg(&out).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let mut names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect();
    names.retain(|p| p.extension().is_some_and(|e| e == "png"));
    names.sort();
    names.iter().map(|p| read_rgb8(p).unwrap().data).collect()
}

#[test]
fn frames_are_those_of_simulate() {
    let Some((engine, times)) = demo("frames_are_those_of_simulate") else { return };
    let folder = tempfile::tempdir().unwrap();
    let want = simulated(folder.path(), &camera_text(TABLE));
    assert_eq!(want.len(), times.len());
    for in_flight in [1, 2] {
        set_camera(engine, &camera_text(TABLE));
        must(shutterbug_engine_reset_exposure(engine), engine);
        let (mut waiting, mut got) = (VecDeque::new(), Vec::new());
        for (i, time_s) in times.iter().enumerate() {
            if waiting.len() == in_flight {
                got.push(collect(waiting.pop_front().unwrap()));
            }
            waiting.push_back(submit(engine, i, *time_s).unwrap());
        }
        got.extend(waiting.into_iter().map(collect));
        let gains: Vec<f64> = got.iter().map(|g| g.1).collect();
        eprintln!("gains {gains:.3?}");
        assert!(
            got.iter().map(|g| &g.0).eq(want.iter()),
            "{in_flight} in flight: other frames than simulate's"
        );
        assert!(gains[0] == 1.0 && gains[1] == 1.0 && (gains[2] - 1.0).abs() > 0.1, "{gains:?}");
    }
    // Control: without it the frames that would answer are others.
    set_camera(engine, &camera_text(""));
    let plain = collect(submit(engine, 2, times[2]).unwrap());
    assert!(plain.0 != want[2] && plain.1 == 1.0, "control");
    finish(engine);
}

#[test]
fn it_waits_keeps_its_state_and_begins_anew_as_the_header_says() {
    let Some((engine, times)) = demo("it_waits_keeps_its_state_and_begins_anew_as_the_header_says") else {
        return;
    };
    let one = |index: usize| collect(submit(engine, index, times[0]).unwrap()).1;
    set_camera(engine, &camera_text(TABLE));
    // Two answer to nobody, the third to the first, which is on its way.
    let (a, b) = (submit(engine, 0, times[0]).unwrap(), submit(engine, 1, times[0]).unwrap());
    assert_eq!(submit(engine, 2, times[0]), Err(status("STATE")));
    assert!(error_of(engine).contains("submitted 2 before it"), "{}", error_of(engine));
    collect(a);
    let c = submit(engine, 2, times[0]).unwrap();
    assert_eq!(submit(engine, 3, times[0]), Err(status("STATE")), "nor is the second one there");
    // One that is destroyed is waited for, and counts.
    must(shutterbug_frame_destroy(b), null_mut());
    let d = submit(engine, 3, times[0]).unwrap();
    let (c, d) = (collect(c).1, collect(d).1);
    assert!(c != 1.0 && d != 1.0);
    // The index is noise's alone; a camera of equal values keeps the state, one of others does not.
    let fifth = one(900);
    set_camera(engine, &camera_text(&format!("{TABLE}[jpeg]\nquality = 90\n")));
    let sixth = one(0);
    assert!(fifth != 1.0 && sixth != 1.0, "{fifth} {sixth}");
    set_camera(engine, &camera_text(&TABLE.replace("0.5", "0.4")));
    assert_eq!((one(0), one(1)), (1.0, 1.0), "other values");
    let before = one(2);
    must(shutterbug_engine_reset_exposure(engine), engine);
    assert_eq!((one(0), one(1)), (1.0, 1.0), "a reset");
    assert_eq!(one(2), before, "and the same way again");
    // A frame of before the reset means nothing to it.
    let old = submit(engine, 3, times[0]).unwrap();
    must(shutterbug_engine_reset_exposure(engine), engine);
    collect(old);
    let (a, b) = (submit(engine, 0, times[0]).unwrap(), submit(engine, 1, times[0]).unwrap());
    assert_eq!(submit(engine, 2, times[0]), Err(status("STATE")), "only frames of after it count");
    collect(a);
    collect(b);
    must(unsafe { shutterbug_engine_load_capture(engine, text(DEMO).as_ptr()) }, engine);
    set_camera(engine, &camera_text(&TABLE.replace("0.5", "0.4")));
    assert_eq!(one(0), 1.0, "a capture is loaded");
    finish(engine);
}

#[test]
fn frames_from_outside_are_exposed_too() {
    let test = "frames_from_outside_are_exposed_too";
    let Some(engine) = engine(test, options(2, 0)) else { return };
    let table = TABLE.replace("delay_frames = 2", "delay_frames = 1").replace("speed = 0.7", "speed = 1");
    set_camera(engine, &camera_text(&table));
    // Grey of 0.125 everywhere: a gain of 4 makes it 0.5.
    let mut color: Vec<f32> = (0..W * H).flat_map(|_| [0.125, 0.125, 0.125, 1.0]).collect();
    let mut motion = vec![0f32; W * H * 2];
    let color = image(PixelFormat::Rgba32f, W, H, bytemuck::cast_slice_mut(&mut color));
    let motion = image(PixelFormat::Rg32f, W, H, bytemuck::cast_slice_mut(&mut motion));
    let mut convention: shutterbug_motion_convention = sized();
    must(unsafe { shutterbug_motion_preset(0, &mut convention, null_mut(), 0) }, null_mut());
    let mut o = outside();
    (o.color, o.motions, o.motion_convention, o.motion_count) = (&color, &motion, &convention, 1);
    let mut gains = Vec::new();
    for i in 0..4 {
        o.frame_index = i;
        let mut frame = null_mut();
        must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
        let (rgb, gain) = collect(frame);
        gains.push(gain);
        let linear = 0.125 * gain as f32;
        let want = shutterbug::plane::srgb8(linear);
        assert!(rgb.iter().all(|v| v.abs_diff(want) <= 1), "frame {i}: {} where {want} is due", rgb[0]);
    }
    // Metered in 8 bits: within half a code of 0.125.
    assert!(gains[0] == 1.0 && gains[1..].iter().all(|g| (g - 4.0).abs() < 0.05), "{gains:?}");
    finish(engine);
}
