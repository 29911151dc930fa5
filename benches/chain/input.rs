//! What every implementation is given: a rendered picture with margin, and pairs of motion images.

use std::path::Path;
use std::sync::Arc;

use shutterbug::camera::Intrinsics;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::engine::{AccumulationOptions, Engine, EngineOptions, FrameRequest, Method};
use shutterbug::gpu::Context;
use shutterbug::plane::Plane;
use shutterbug::reference::paper_gather::Push;

/// Standard deviation of the noise, fraction of full scale.
pub const SIGMA: f32 = 0.02;
/// Time between frames, s: readout and exposure are as long.
const INTERVAL_S: f32 = 1.0 / 30.0;
/// What moves, and how.
pub const MOTIONS: [&str; 3] = ["moving", "tenth", "rest"];

pub struct Input {
    pub size: [usize; 2],
    pub margin: usize,
    /// Linear RGBA, 8 bits a channel, row by row, margin included.
    pub color: Vec<u8>,
    /// By the names in [`MOTIONS`]: images at the frame's start and end, px a frame interval, two channels.
    pub motions: Vec<[Vec<f32>; 2]>,
}

impl Input {
    /// The scene of Table 1, and motion of about 40 px: everywhere, in a tenth of the picture, nowhere.
    pub fn new(context: &Arc<Context>, scene: &Path, size: [usize; 2]) -> Self {
        // What 40 px of motion need: half of them by the shutter, all by the blur.
        let speed = 40.0f32;
        let margin = (1.8 * speed) as usize + 8;
        let columns = size[0] + 2 * margin;
        let rows = size[1] + 2 * margin;
        let color = render(context, scene, [columns as u32, rows as u32], size[0] as f64);
        let levels = color.data.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
        let field = |kind: &str, scale: f32| -> Vec<f32> {
            let at = |x: usize, y: usize| -> [f32; 2] {
                let (dx, dy) = (x as f32 - 0.5 * columns as f32, y as f32 - 0.5 * rows as f32);
                let inside = dx.abs() < 0.158 * size[0] as f32 && dy.abs() < 0.158 * size[1] as f32;
                let v = match kind {
                    "moving" => [speed + 0.0125 * dx, 0.15 * speed + 0.0125 * dy],
                    "tenth" if inside => [speed, 0.15 * speed],
                    _ => [0.0, 0.0],
                };
                v.map(|c| scale * c)
            };
            (0..rows).flat_map(|y| (0..columns).flat_map(move |x| at(x, y))).collect()
        };
        let motions = MOTIONS.iter().map(|kind| [field(kind, 0.8), field(kind, 1.0)]).collect();
        Self { size, margin, color: levels, motions }
    }

    /// Linear RGBA, floats.
    pub fn color_plane(&self) -> Plane<f32> {
        let [width, height] = self.outer();
        Plane { width, height, channels: 4, data: self.color.iter().map(|v| f32::from(*v) / 255.0).collect() }
    }

    /// Both motion images of a kind.
    pub fn motion_planes(&self, kind: usize) -> Vec<Plane<f32>> {
        let [width, height] = self.outer();
        self.motions[kind].iter().map(|v| Plane { width, height, channels: 2, data: v.clone() }).collect()
    }

    /// Size with margin.
    pub fn outer(&self) -> [usize; 2] {
        self.size.map(|s| s + 2 * self.margin)
    }

    /// Shutter and blur of a whole frame, the picture taken at its middle.
    pub fn push(&self, max_samples: u32) -> Push {
        Push {
            size: self.size.map(|s| s as u32),
            margin_px: [self.margin as i32; 2],
            start_s: -0.5 * INTERVAL_S,
            readout_time_s: INTERVAL_S,
            exposure_time_s: INTERVAL_S,
            frame_interval_s: INTERVAL_S,
            first_motion_s: -0.5 * INTERVAL_S,
            motion_step_s: INTERVAL_S,
            motion_count: 2,
            scan_order: 0,
            max_samples,
            pixel_time: 0,
        }
    }

    /// The files that the peers read.
    pub fn write(&self, folder: &Path, threads: usize, repeats: usize) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join("color.raw"), &self.color).unwrap();
        for (kind, images) in MOTIONS.iter().zip(&self.motions) {
            for (i, image) in images.iter().enumerate() {
                let bytes: Vec<u8> = image.iter().flat_map(|v| v.to_le_bytes()).collect();
                std::fs::write(folder.join(format!("{kind}_{i}.raw")), bytes).unwrap();
            }
        }
        let json = serde_json::json!({
            "size": self.size, "margin_px": self.margin, "sigma": SIGMA, "threads": threads, "repeats": repeats,
        });
        std::fs::write(folder.join("parameters.json"), json.to_string()).unwrap();
    }
}

fn render(context: &Arc<Context>, scene: &Path, [width, height]: [u32; 2], focal_px: f64) -> Plane<f32> {
    let capture = Capture::read(scene, None).unwrap();
    let f = 0.8 * focal_px;
    let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
    let k = Intrinsics { width, height, fx: f, fy: f, cx, cy };
    let mut shutter = capture.shutter(12);
    (shutter.readout_time_s, shutter.exposure_time_s, shutter.line_count) = (0.0, 0.0, height);
    let request = FrameRequest {
        index: 0,
        shutter,
        frame_interval_s: capture.camera.frame_period_s,
        seed: 0,
        settings: Settings::default(),
        static_camera: true,
        planes: false,
        statistics: true,
    };
    let method =
        Method::Accumulation(AccumulationOptions { renders: Some(1), ..AccumulationOptions::default() });
    let options = EngineOptions { method, samples: 16, frames_in_flight: 1, ..EngineOptions::default() };
    let (scene, path) = (Arc::new(capture.scene), Arc::new(capture.trajectory));
    let mut engine = Engine::new(context, scene, path, k, options, &[]).unwrap();
    engine.render(&request).unwrap().radiance.expect("statistics were asked for")
}
