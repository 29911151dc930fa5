//! A frame of your own renderer through the camera, from Rust: no C ABI needed.
//! `cargo run --release --example process -- out/frame.png`
use std::time::Duration;

use shutterbug::capture::CameraFile;
use shutterbug::chain::Value;
use shutterbug::effects::Vignetting;
use shutterbug::engine::{FrameRequest, OutsideEngine, OutsideFrame};
use shutterbug::engine::{OutsideMotion, OutsidePixels, PixelSource};
use shutterbug::gpu::{Context, ContextOptions};
use shutterbug::plane::{PixelFormat, write_png_atomic};

/// What a camera.toml holds: `CameraFile::read` reads one.
const CAMERA: &str = "width = 320\nheight = 240\nfx = 250\nfy = 250\ncx = 160\ncy = 120\nframe_period_s = 0.04\n\
    [rolling_shutter]\nreadout_time_s = 0.03\n[motion_blur]\nexposure_time_s = 0.01\n\
    [read_noise]\nsigma = 0.02\n";

fn main() -> shutterbug::Result<()> {
    let mut camera = CameraFile::parse("the camera".as_ref(), CAMERA)?;
    // One effect more. Names, units and ranges: `shutterbug effects`.
    camera.settings.set(&Vignetting, "a1", Value::Number(-0.4))?;
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    // Vertical bars that move 40 px a frame to the right.
    let bars = |x: u32| if x / 20 % 2 == 1 { [230u8; 3] } else { [30; 3] };
    let color: Vec<u8> = (0..height).flat_map(|_| (0..width).flat_map(bars)).collect();
    let motion: Vec<f32> = (0..width * height).flat_map(|_| [40.0, 0.0]).collect();
    let context = Context::new(&ContextOptions::default())?;
    let mut engine = OutsideEngine::new(&context, camera.intrinsics, 2, Duration::from_secs(60))?;
    let pixels = |format: PixelFormat, bytes| OutsidePixels {
        format,
        stride_bytes: width as usize * format.bytes(),
        bottom_up: false,
        source: PixelSource::Host(bytes),
    };
    let shutter = camera.shutter_at(0.0);
    let ticket = engine.submit(&OutsideFrame {
        request: FrameRequest {
            index: 0,
            shutter,
            frame_interval_s: camera.frame_period_s,
            seed: 1,
            settings: camera.settings,
            static_camera: false,
            planes: false,
            statistics: false,
        },
        color: pixels(PixelFormat::Rgb8, &color),
        encoding: Default::default(),
        color_time_s: shutter.middle_s(),
        margin_px: [0, 0],
        motion: OutsideMotion::Images {
            images: vec![pixels(PixelFormat::Rg32f, bytemuck::cast_slice(&motion))],
            scale: [1.0, 1.0],
            first_time_s: 0.0,
            step_s: 0.0,
        },
        max_samples: 240,
        delivery: Default::default(),
    })?;
    let out = std::env::args_os().nth(1).expect("the file to write");
    write_png_atomic(out.as_ref(), &engine.collect(ticket)?.picture)
}
