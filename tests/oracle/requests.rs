//! The frames that tests of this program ask of the engine.

use crate::oracle_support::Answered;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::engine::FrameRequest;

/// A frame of a camera that has what the answer says of time, and no other effect.
pub fn answered(c: &Answered, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: c.timing(frame),
        frame_interval_s: c.frames[1].0 - c.frames[0].0,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: true,
    }
}

/// A frame of a capture's own camera.
pub fn captured(capture: &Capture, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: capture.shutter(frame),
        frame_interval_s: capture.camera.frame_period_s,
        seed: 11,
        settings: capture.camera.settings.clone(),
        static_camera: capture.camera.static_camera,
        planes: false,
        statistics: false,
    }
}
