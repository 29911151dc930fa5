//! Frames from the engine, in a line.

use std::sync::Arc;

use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::Settings;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, FrameRequest, Method, MotionSource, PaperOptions,
};
use shutterbug::plane::{Plane, srgb_decode};
use shutterbug::scene::Scene;

use super::Watched;

/// Time from frame to frame in these tests, s.
pub const INTERVAL_S: f64 = 0.04;

/// A frame that starts at 0.01 s.
pub fn request(k: &Intrinsics, exposure_time_s: f64, readout_time_s: f64, order: ScanOrder) -> FrameRequest {
    let line_count = order.line_count(k.width, k.height);
    let shutter =
        ShutterTiming { start_s: 0.01, exposure_time_s, readout_time_s, scan_order: order, line_count };
    FrameRequest {
        index: 3,
        shutter,
        frame_interval_s: INTERVAL_S,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: false,
    }
}

/// A frame without any duration.
pub fn still(k: &Intrinsics) -> FrameRequest {
    request(k, 0.0, 0.0, ScanOrder::TopToBottom)
}

/// Accumulation of so many renders.
pub fn accumulation(renders: u32) -> Method {
    Method::Accumulation(AccumulationOptions { renders: Some(renders), ..AccumulationOptions::default() })
}

/// The paper's method with so many motion images.
pub fn paper(motion_images: u32) -> Method {
    Method::Paper(PaperOptions { motion_images, ..PaperOptions::default() })
}

/// The paper's method with motion from depth.
pub fn paper_from_depth(motion_images: u32) -> Method {
    let motion_source = MotionSource::Depth;
    Method::Paper(PaperOptions { motion_images, motion_source, ..PaperOptions::default() })
}

/// What every engine of these tests has; planes are on.
pub fn options(method: Method, samples: u32) -> EngineOptions {
    EngineOptions { method, samples, planes: true, ..EngineOptions::default() }
}

/// An engine for these frames.
pub fn engine(
    watched: &Watched,
    scene: &Scene,
    path: &Trajectory,
    k: Intrinsics,
    options: EngineOptions,
    expected: &[FrameRequest],
) -> Engine {
    let (scene, path) = (Arc::new(scene.clone()), Arc::new(path.clone()));
    Engine::new(&watched.0, scene, path, k, options, expected).unwrap()
}

/// One picture.
pub fn picture(
    watched: &Watched,
    scene: &Scene,
    path: &Trajectory,
    k: Intrinsics,
    method: Method,
    request: &FrameRequest,
) -> Plane<u8> {
    let expected = std::slice::from_ref(request);
    let mut engine = engine(watched, scene, path, k, options(method, 16), expected);
    engine.render(request).unwrap().picture
}

/// Linear radiance of a delivered picture.
pub fn linear(picture: &Plane<u8>) -> Plane<f32> {
    let data = picture.data.iter().map(|&v| srgb_decode(f32::from(v) / 255.0)).collect();
    Plane { width: picture.width, height: picture.height, channels: picture.channels, data }
}

/// Mean absolute difference, largest difference (levels), and share of bytes that differ.
pub fn levels(a: &Plane<u8>, b: &Plane<u8>) -> (f64, u8, f64) {
    let mean = shutterbug::plane::metrics::mean_absolute_difference(a, b);
    let differences = || a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b));
    let count = differences().filter(|&d| d > 0).count();
    (mean, differences().max().unwrap_or(0), count as f64 / a.data.len() as f64)
}
