//! Options of a new engine.

use std::time::Duration;

use super::status::{self, Fault, Outcome};
use super::types::shutterbug_engine_options;
use crate::engine::{AccumulationOptions, ExactOptions, FastOptions, Method, PaperOptions};
use crate::error::Quoted;

/// Flag of the options: load the validation layer.
pub const ENGINE_VALIDATION: u32 = 1;
/// Flag of the options: frames may ask for sharp planes.
pub const ENGINE_PLANES: u32 = 2;

/// What an engine was made with, checked.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How frames of scenes are made.
    pub method: Method,
    /// Its number in the header; 0: the library's choice.
    code: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Frames in flight.
    pub frames_in_flight: u32,
    /// Whether frames may ask for sharp planes.
    pub planes: bool,
    /// Most samples of the blur.
    pub max_samples: u32,
    /// Largest side of a picture, px.
    pub max_side_px: u32,
    /// Longest time that one submission may take.
    pub time_limit: Duration,
    /// Seed of all noise.
    pub seed: u64,
}

impl Settings {
    /// Whether the method that was asked for makes frames from outside of that kind; the library's choice makes all.
    pub fn takes_outside(&self, with_path: bool) -> Outcome<()> {
        let why = match (self.code, with_path) {
            (0, _) | (2, false) | (4, true) => return Ok(()),
            (2, true) => {
                "PAPER takes frames from outside with motion images, or with depth and two poses (pose_count 0)"
            }
            (4, false) => "FAST takes frames from outside with depth and pose_count poses",
            _ => "EXACT and ACCUMULATION need a scene, which frames from outside have not",
        };
        let text = format!("options.method: {why}; DEFAULT takes all frames from outside");
        Err(Fault::new(status::UNSUPPORTED, text))
    }
}

/// Method numbers of the header.
fn method_of(code: u32, motion_images: u32, max_samples: u32) -> Outcome<Method> {
    match code {
        0 | 3 => Ok(Method::Exact(ExactOptions::default())),
        1 => Ok(Method::Accumulation(AccumulationOptions::default())),
        2 => {
            let motion_images = if motion_images == 0 { 2 } else { motion_images };
            Ok(Method::Paper(PaperOptions { motion_images, max_samples, ..PaperOptions::default() }))
        }
        4 => {
            let motion_images =
                if motion_images == 0 { FastOptions::default().motion_images } else { motion_images };
            // Two go into one image of paths: the engine would take the next even number in silence.
            if ![2, 4, 6].contains(&motion_images) {
                let text = format!("motion_images is {motion_images}, not 2, 4 or 6 (method FAST)");
                return Err(Fault::argument(text));
            }
            Ok(Method::Fast(FastOptions { motion_images, max_samples, ..FastOptions::default() }))
        }
        other => Err(Fault::new(status::UNSUPPORTED, format!("this library has no method {other}"))),
    }
}

/// The checked options.
pub fn settings(o: &shutterbug_engine_options) -> Outcome<Settings> {
    let or = |value: u32, default: u32| if value == 0 { default } else { value };
    let within = |name: &str, value: u32, max: u32| match value <= max {
        true => Ok(value),
        false => Err(Fault::argument(format!("{name} is {value}, at most {max}"))),
    };
    if o.flags & !(ENGINE_VALIDATION | ENGINE_PLANES) != 0 {
        return Err(Fault::argument(format!("flags {:#x}: unknown ones among them", o.flags)));
    }
    let samples = or(o.samples, 16);
    if ![1, 4, 16].contains(&samples) {
        return Err(Fault::argument(format!("samples is {samples}, not 1, 4 or 16")));
    }
    if !(o.time_limit_s >= 0.0 && o.time_limit_s <= 1e9) {
        return Err(Fault::argument(format!("time_limit_s is {}, not 0 to 1e9", Quoted(o.time_limit_s))));
    }
    let max_samples = within("max_blur_samples", or(o.max_blur_samples, 240), 4096)?;
    let motion_images = within("motion_images", o.motion_images, 6)?;
    Ok(Settings {
        method: method_of(o.method, motion_images, max_samples)?,
        code: o.method,
        samples,
        frames_in_flight: within("frames_in_flight", or(o.frames_in_flight, 2), 8)?,
        planes: o.flags & ENGINE_PLANES != 0,
        max_samples,
        max_side_px: or(o.max_side_px, crate::plane::MAX_SIDE_PX).min(crate::plane::MAX_SIDE_PX),
        time_limit: Duration::from_secs_f64(if o.time_limit_s == 0.0 { 600.0 } else { o.time_limit_s }),
        seed: o.seed,
    })
}
