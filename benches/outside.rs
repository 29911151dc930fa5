//! What frames from outside cost, by what they bring: 640x480 with a margin of 16 px, a camera that pans and passes
//! what it sees (evenly, so that all modes blur along ways of one length). Processor time of the process a frame (ms,
//! least of the rounds), its ratio to the gather from depth and two poses with the same effects, and the device's
//! passes (least of the rounds each; `LP_NUM_THREADS=1` makes them processor time on lavapipe). `cargo bench --bench
//! outside [-- ROUNDS]` (6). Modes take turns.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../tests/support/capi/mod.rs"]
mod capi_support;
#[path = "outside/unpack.rs"]
mod unpack;

use std::ffi::CStr;
use std::ptr::null_mut;

use capi_support::{create, image, must, options, outside, sized, text};
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

const W: usize = 640;
const H: usize = 480;
const MARGIN: usize = 16;
const FULL: [usize; 2] = [W + 2 * MARGIN, H + 2 * MARGIN];
const READOUT_S: f64 = 0.024;
const LENS: &str = "[lens_distortion]\nmodel = \"brown_conrady\"\nk1 = -0.02\n";

/// A way to make a frame.
#[derive(Clone, Copy)]
struct Mode {
    name: &'static str,
    poses: u32,
    pictures: usize,
    lens: bool,
    format: PixelFormat,
    /// Of the frame, besides its border's.
    flags: u32,
}

const PLAIN: Mode =
    Mode { name: "13 poses", poses: 13, pictures: 1, lens: false, format: PixelFormat::Rgb8, flags: 0 };
const MODES: [Mode; 10] = [
    Mode { name: "two poses (gather)", poses: 0, ..PLAIN },
    PLAIN,
    Mode { name: "13 poses, lens", lens: true, ..PLAIN },
    Mode { name: "2 pictures", pictures: 2, ..PLAIN },
    Mode { name: "3 pictures", pictures: 3, ..PLAIN },
    Mode { name: "5 pictures", pictures: 5, ..PLAIN },
    Mode { name: "13 poses, RGBA8", format: PixelFormat::Rgba8, ..PLAIN },
    Mode { name: "13 poses, RGBA16F", format: PixelFormat::Rgba16f, ..PLAIN },
    Mode { name: "13 poses, RGBA32F", format: PixelFormat::Rgba32f, ..PLAIN },
    Mode { name: "13 poses, fine, raw", flags: 4 | 8, ..PLAIN },
];

/// Pictures of a wall with checks and of a post before it.
struct Pictures {
    color: Vec<u8>,
    depth: Vec<f32>,
}

fn pictures(format: PixelFormat) -> Pictures {
    let pixels = || (0..FULL[1]).flat_map(|y| (0..FULL[0]).map(move |x| (x, y)));
    let post = |x: usize| (200..240).contains(&x);
    let light = |(x, y): (usize, usize)| match (post(x), (x / 11 + y / 13) % 2) {
        (true, _) => 0.8_f32,
        (false, 0) => 0.5,
        (false, _) => 0.1,
    };
    let bytes = |p| {
        let v = light(p);
        match format {
            PixelFormat::Rgba32f => [v, v, v, 1.0].iter().flat_map(|c| c.to_le_bytes()).collect(),
            PixelFormat::Rgba16f => {
                [0x3800_u16, 0x3400, 0x3800, 0x3c00].iter().flat_map(|c| c.to_le_bytes()).collect()
            }
            _ => vec![(255.0 * v) as u8; format.bytes()],
        }
    };
    let depth = |(x, _): (usize, usize)| if post(x) { 2.0 } else { 5.0 };
    Pictures { color: pixels().flat_map(bytes).collect(), depth: pixels().map(depth).collect() }
}

/// The camera.
fn pose(time_s: f64) -> shutterbug_stamped_pose {
    let half = 0.5 * 1.5 * (time_s - 0.016);
    let world_from_camera = shutterbug_pose {
        translation_m: [0.3 * time_s, 0.0, 0.0],
        rotation_xyzw: [0.0, half.sin(), 0.0, half.cos()],
    };
    shutterbug_stamped_pose { time_s, world_from_camera }
}

fn set_camera(engine: Handle, exposure_s: f64, mode: &Mode) {
    let more = match (mode.lens, mode.flags) {
        (true, _) => LENS,
        (false, 0) => "",
        (false, _) => "[bayer_mosaic]\npattern = \"RGGB\"\n",
    };
    let camera = text(&format!(
        "width = {W}\nheight = {H}\nfx = 560\nfy = 560\ncx = 320\ncy = 240\nframe_period_s = 0.04\n\
         [rolling_shutter]\nreadout_time_s = {READOUT_S:?}\n[motion_blur]\nexposure_time_s = {exposure_s:?}\n{more}"
    ));
    must(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine);
}

/// Processor time of all threads of the process, ms.
fn processor_ms() -> f64 {
    let of = |path: std::path::PathBuf| {
        let text = std::fs::read_to_string(path.join("schedstat")).unwrap_or_default();
        text.split_whitespace().next().and_then(|n| n.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
    };
    std::fs::read_dir("/proc/self/task").unwrap().map(|t| of(t.unwrap().path())).sum()
}

/// One frame; the device's passes.
fn frame(engine: Handle, mode: &Mode, exposure_s: f64, from: &mut Pictures) -> Vec<(String, f64)> {
    let end_s = READOUT_S * (H - 1) as f64 / H as f64 + exposure_s;
    let color = image(mode.format, FULL[0], FULL[1], &mut from.color);
    let depth = image(PixelFormat::R32f, FULL[0], FULL[1], bytemuck::cast_slice_mut(&mut from.depth));
    let convention: shutterbug_depth_convention = sized();
    let count = mode.poses.max(2);
    let poses: Vec<_> = (0..count).map(|i| pose(end_s * f64::from(i) / f64::from(count - 1))).collect();
    let at = |k: usize| end_s * k as f64 / (mode.pictures - 1) as f64;
    let further: Vec<_> = (1..mode.pictures)
        .map(|k| shutterbug_picture { time_s: at(k), color: &color, depth: &depth, ids: std::ptr::null() })
        .collect();
    let mut o = outside();
    o.color_time_s = if mode.pictures == 1 { 0.5 * end_s } else { 0.0 };
    (o.color, o.depth, o.depth_convention) = (&color, &depth, &convention);
    (o.poses, o.pose_count) = (poses.as_ptr(), mode.poses);
    (o.pictures, o.picture_count) = (further.as_ptr(), further.len() as u32);
    o.flags = u32::from(mode.poses > 0) | mode.flags;
    [o.margin_x_px, o.margin_y_px] = [MARGIN as u32; 2];
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut times = vec![shutterbug_pass_time { name: [0; 32], ms: 0.0 }; 64];
    let mut found = 0;
    must(unsafe { shutterbug_frame_get_times(frame, times.as_mut_ptr(), 64, &mut found) }, frame);
    must(shutterbug_frame_destroy(frame), null_mut());
    let name =
        |t: &shutterbug_pass_time| unsafe { CStr::from_ptr(t.name.as_ptr()) }.to_string_lossy().into_owned();
    times[..found].iter().map(|t| (name(t), t.ms)).collect()
}

/// Keeps the least of each; passes of one name are one.
fn keep_least(least: &mut (f64, Vec<(String, f64)>), took: f64, passes: Vec<(String, f64)>) {
    least.0 = least.0.min(took);
    let mut sums: Vec<(String, f64)> = Vec::new();
    for (name, ms) in passes {
        match sums.iter_mut().find(|(n, _)| *n == name) {
            Some(sum) => sum.1 += ms,
            None => sums.push((name, ms)),
        }
    }
    for (k, sum) in sums.into_iter().enumerate() {
        match least.1.get_mut(k) {
            Some(kept) => kept.1 = kept.1.min(sum.1),
            None => least.1.push(sum),
        }
    }
}

fn main() {
    let rounds = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(6);
    let mut all: Vec<_> =
        MODES.iter().map(|mode| (mode, create(options(0, 0)).unwrap(), pictures(mode.format))).collect();
    for exposure_s in [0.0, 0.008] {
        let mut least = vec![(f64::INFINITY, Vec::new()); all.len()];
        for round in 0..rounds + 2 {
            for (k, (mode, engine, from)) in all.iter_mut().enumerate() {
                set_camera(*engine, exposure_s, mode);
                let before = processor_ms();
                let passes = frame(*engine, mode, exposure_s, from);
                let took = processor_ms() - before;
                if round > 1 {
                    keep_least(&mut least[k], took, passes);
                }
            }
        }
        println!("exposure {exposure_s} s");
        for ((mode, ..), (took, passes)) in all.iter().zip(&least) {
            let passes: Vec<String> = passes.iter().map(|(n, ms)| format!("{n} {ms:.1}")).collect();
            let ratio = took / least[0].0;
            println!("{:>20}: {took:6.1} ms, {ratio:.2} of the gather; {}", mode.name, passes.join(", "));
        }
    }
    for (_, engine, _) in all {
        assert_eq!(shutterbug_engine_destroy(engine), 0);
    }
    unpack::print(rounds);
}
