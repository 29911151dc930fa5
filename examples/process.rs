//! A frame of your own renderer through the camera, from Rust: no C ABI needed.
//! `cargo run --release --example process -- out.png`
use std::time::Duration;

use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::engine::{FrameRequest, OutsideEngine, OutsideFrame};
use shutterbug::engine::{OutsideMotion, OutsidePixels, PixelSource};
use shutterbug::gpu::{Context, ContextOptions};
use shutterbug::plane::{PixelFormat, write_png_atomic};

fn main() -> shutterbug::Result<()> {
    let (width, height) = (320, 240);
    let camera = Intrinsics { width, height, fx: 250.0, fy: 250.0, cx: 160.0, cy: 120.0 };
    // Vertical bars that move 40 px a frame to the right.
    let bars = |x: u32| if x / 20 % 2 == 1 { [230u8; 3] } else { [30; 3] };
    let color: Vec<u8> = (0..height).flat_map(|_| (0..width).flat_map(bars)).collect();
    let motion: Vec<f32> = (0..width * height).flat_map(|_| [40.0, 0.0]).collect();
    let context = Context::new(&ContextOptions::default())?;
    let mut engine = OutsideEngine::new(&context, camera, 2, Duration::from_secs(60))?;
    let pixels = |format: PixelFormat, bytes| OutsidePixels {
        format,
        stride_bytes: width as usize * format.bytes(),
        bottom_up: false,
        source: PixelSource::Host(bytes),
    };
    let shutter = ShutterTiming {
        start_s: 0.0,
        exposure_time_s: 0.01,
        readout_time_s: 0.03,
        scan_order: ScanOrder::TopToBottom,
        line_count: height,
    };
    let ticket = engine.submit(&OutsideFrame {
        request: FrameRequest {
            index: 0,
            shutter,
            frame_interval_s: 0.04,
            seed: 1,
            settings: Default::default(),
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
    let out = std::env::args_os().nth(1).unwrap_or_else(|| "out.png".into());
    write_png_atomic(out.as_ref(), &engine.collect(ticket)?.picture)
}
