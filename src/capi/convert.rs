//! Conventions of motion vectors and depth, and the converter that needs no engine.

use std::ffi::c_char;

use super::handle::{code, guarded};
use super::image::View;
use super::status::{Fault, Outcome, Status};
use super::types::*;
use crate::error::Quoted;
use crate::plane::{PixelFormat, Plane};
use crate::reference::unpack::{MotionPush, unpack_motion};

const fn convention(direction: u32, unit: u32, y_axis: u32) -> shutterbug_motion_convention {
    shutterbug_motion_convention {
        struct_size: size_of::<shutterbug_motion_convention>() as u32,
        direction,
        unit,
        y_axis,
        scale_x: 1.0,
        scale_y: 1.0,
        interval_s: 0.0,
    }
}

/// By number: this library's own, FSR 2 in pixels, FSR 2 in UV, Unity (NDC), Streamline (NDC, y up), optical flow of
/// OpenCV (current frame to next, pixels).
const PRESETS: [shutterbug_motion_convention; 6] = [
    convention(0, 0, 0),
    convention(1, 0, 0),
    convention(1, 2, 0),
    convention(0, 1, 1),
    convention(1, 1, 1),
    convention(0, 0, 0),
];

/// What multiplies the values given, so that they become px per frame interval from the previous to the current place;
/// `size`: of the motion image, margin included.
pub(super) fn motion_scale(
    c: &shutterbug_motion_convention,
    size: [u32; 2],
    frame_interval_s: f64,
) -> Outcome<[f32; 2]> {
    if c.direction > 1 || c.unit > 2 || c.y_axis > 1 {
        return Err(Fault::argument("motion convention: unknown direction, unit or y_axis"));
    }
    for (name, value) in [("scale_x", c.scale_x), ("scale_y", c.scale_y)] {
        if !value.is_finite() || value == 0.0 {
            return Err(Fault::argument(format!("motion convention: {name} is {value}")));
        }
    }
    if !(c.interval_s >= 0.0 && c.interval_s <= 1e9) {
        return Err(Fault::argument(format!("motion convention: interval_s is {}", Quoted(c.interval_s))));
    }
    let sign = if c.direction == 1 { -1.0 } else { 1.0 };
    let up = if c.y_axis == 1 { -1.0 } else { 1.0 };
    let unit = |side: u32| match c.unit {
        0 => 1.0,
        1 => 0.5 * f64::from(side),
        _ => f64::from(side),
    };
    let frames = if c.interval_s == 0.0 { 1.0 } else { frame_interval_s / c.interval_s };
    let x = sign * unit(size[0]) * c.scale_x * frames;
    let y = sign * up * unit(size[1]) * c.scale_y * frames;
    Ok([x as f32, y as f32])
}

/// How depth values become metres: `None` if they are, else `[n, c, s]` of n / (c + s value).
pub(super) fn depth_decode(d: &shutterbug_depth_convention) -> Outcome<Option<[f32; 3]>> {
    let near = d.near_m > 0.0 && d.near_m.is_finite();
    let far = d.far_m > d.near_m && d.far_m.is_finite();
    match d.kind {
        0 => Ok(None),
        // Reversed and infinite: value = near / depth.
        1 if near => Ok(Some([d.near_m as f32, 0.0, 1.0])),
        // 0 at near, 1 at far: value = far (depth - near) / (depth (far - near)).
        2 if near && far => {
            Ok(Some([(d.near_m * d.far_m) as f32, d.far_m as f32, (d.near_m - d.far_m) as f32]))
        }
        // Reversed with a far plane: 1 at near, 0 at far.
        3 if near && far => {
            Ok(Some([(d.near_m * d.far_m) as f32, d.near_m as f32, (d.far_m - d.near_m) as f32]))
        }
        // OpenGL's normalised device coordinates: -1 at near, 1 at far.
        4 if near && far => {
            let (middle, slope) = (0.5 * (d.near_m + d.far_m), 0.5 * (d.near_m - d.far_m));
            Ok(Some([(d.near_m * d.far_m) as f32, middle as f32, slope as f32]))
        }
        1..=4 => {
            let [near, far] = [d.near_m, d.far_m].map(Quoted);
            Err(Fault::argument(format!("depth convention: near {near} m, far {far} m")))
        }
        kind => Err(Fault::argument(format!("depth convention: there is no kind {kind}"))),
    }
}

/// Runs a call that has no handle to keep its sentence: it goes where the caller says.
///
/// # Safety
/// As for [`give_text`].
pub(super) unsafe fn explained(error: (*mut c_char, u64), f: impl FnOnce() -> Outcome<()>) -> Status {
    let done = guarded(f);
    if let Err(fault) = &done {
        // SAFETY: the caller's promise.
        unsafe { give_text(error, &fault.text) };
    }
    code(done)
}

/// `shutterbug_motion_preset`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_motion_preset(
    preset: u32,
    convention: *mut shutterbug_motion_convention,
    error_text: *mut c_char,
    error_capacity: u64,
) -> Status {
    let fill = || {
        // SAFETY: the caller's promise.
        unsafe { check(convention) }?;
        let Some(found) = PRESETS.get(preset as usize) else {
            let text = format!("there is no preset {preset}; they are 0 to {}", PRESETS.len() - 1);
            return Err(Fault::argument(text));
        };
        // SAFETY: checked above; writable by the caller's promise.
        unsafe { convention.write(*found) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { explained((error_text, error_capacity), fill) }
}

/// `shutterbug_motion_convert`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_motion_convert(
    from: *const shutterbug_image,
    convention: *const shutterbug_motion_convention,
    frame_interval_s: f64,
    to: *const shutterbug_image,
    error_text: *mut c_char,
    error_capacity: u64,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    let convert = || unsafe {
        let (from, to) = (View::new(&named(from, "from")?, "from")?, View::new(&named(to, "to")?, "to")?);
        if !(frame_interval_s > 0.0 && frame_interval_s.is_finite()) {
            return Err(Fault::argument(format!(
                "frame_interval_s is {}, not above 0",
                Quoted(frame_interval_s)
            )));
        }
        if !from.format.is_motion() || from.memory != 0 {
            return Err(Fault::new(super::status::FORMAT, "from is RG16F or RG32F in host memory"));
        }
        let scale = motion_scale(&read(convention)?, from.size, frame_interval_s)?;
        let stride_bytes = u32::try_from(from.stride).map_err(|_| {
            Fault::new(super::status::LIMIT, format!("from: stride_bytes is {}, not below 2^32", from.stride))
        })?;
        let format = from.format as u32;
        let push = MotionPush { size: from.size, scale, first_byte: 0, stride_bytes, format, layer: 0 };
        let mut converted: Plane<f32> = unpack_motion(&push, from.read());
        if from.bottom_up {
            converted = Plane::from_fn(converted.width, converted.height, |x, y| {
                let [u, v] = [0, 1].map(|c| converted.pixel(x, converted.height - 1 - y)[c]);
                [u, v]
            });
        }
        to.put_floats(&converted, [PixelFormat::Rg32f, PixelFormat::Rg16f], "motion")
    };
    // SAFETY: the caller's promise.
    unsafe { explained((error_text, error_capacity), convert) }
}
