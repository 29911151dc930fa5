//! Checks whether two frames of a host agree with its poses and depth, and if not, which other convention would make
//! them agree. A wrong convention gives a plausible picture and no error.

use std::ffi::c_char;

use glam::{DQuat, DVec2, DVec3};

use super::convert::{depth_decode, explained};
use super::encoding;
use super::image::View;
use super::status::{self, Fault, Outcome, Status};
use super::types::*;
use crate::camera::{Intrinsics, Pose};
use crate::error::Quoted;
use crate::plane::{PixelFormat, Plane};
use crate::reference::unpack::{ColorPush, decode_table, unpack_color};

/// Places of the second picture that are looked up in the first, a side at most.
const MAX_PLACES: usize = 96;
/// Differences above this are all as bad: silhouettes, highlights, what only one frame sees.
const MAX_DIFFERENCE: f64 = 0.25;
/// What does not fall into the first picture counts as that.
const OUTSIDE_DIFFERENCE: f64 = 0.12;
/// Another convention must be so much better, as a share of what was given, and the pictures must tell it at all.
const MAX_RATIO: f64 = 0.6;
const MIN_DIFFERENCE: f64 = 0.004;

/// Bits of `shutterbug_agreement.change`.
const Y_UP: u32 = 1;
const INVERSE: u32 = 2;
const W_FIRST: u32 = 4;
const MILLIMETRES: u32 = 8;
const ALONG_RAY: u32 = 16;
const BOTTOM_UP: u32 = 32;
/// Not one of those that are tried pose by pose: [`encoding`] tells.
const ENCODING: u32 = 64;

/// One of the two frames, checked.
struct Seen {
    /// Radiance as it was said to be.
    radiance: Plane<f32>,
    /// Whether it was decoded from sRGB codes.
    decoded: bool,
    /// What is seen of it.
    color: Plane<f32>,
    depth_m: Vec<f64>,
    pose: shutterbug_pose,
}

impl Seen {
    /// # Safety
    /// The header's promise for all that `frame` points to.
    unsafe fn new(frame: &shutterbug_view, what: &str, k: &Intrinsics) -> Outcome<Self> {
        let convention = |image: *const shutterbug_image, name: &str| -> Outcome<View> {
            // SAFETY: the caller's promise.
            let view =
                View::new(&unsafe { named(image, &format!("{what}.{name}")) }?, &format!("{what}.{name}"))?;
            if view.size != [k.width, k.height] || view.memory != 0 {
                let text = format!("{what}.{name} is not of the camera's size, or not in host memory");
                return Err(Fault::argument(text));
            }
            Ok(view)
        };
        let (color, depth) = (convention(frame.color, "color")?, convention(frame.depth, "depth")?);
        if !color.format.is_color() || depth.format != PixelFormat::R32f {
            return Err(Fault::new(status::FORMAT, format!("{what}: color is no colour, or depth not R32F")));
        }
        if frame.encoding > 1 || frame.reserved != 0 || frame.reserved_more != 0 {
            return Err(Fault::argument(format!("{what}: unknown encoding, or reserved is not 0")));
        }
        // SAFETY: the caller's promise.
        let decode = depth_decode(&unsafe { read(frame.depth_convention) }?)?;
        // SAFETY: as above.
        let (colors, depths) = unsafe { (color.read(), depth.read()) };
        let push = ColorPush {
            size: color.size,
            first_byte: 0,
            stride_bytes: color.stride as u32,
            format: color.format as u32,
            codes_from: 256 * frame.encoding,
        };
        let row = |y: usize, up: bool| if up { k.height as usize - 1 - y } else { y };
        let metres = |i: usize| {
            let y = row(i / k.width as usize, depth.bottom_up);
            let at = y * depth.stride + (i % k.width as usize) * 4;
            let bytes = [depths[at], depths[at + 1], depths[at + 2], depths[at + 3]];
            let value = f64::from(f32::from_le_bytes(bytes));
            decode.map_or(value, |[n, c, s]| f64::from(n) / (f64::from(c) + f64::from(s) * value))
        };
        let depth_m = (0..k.width as usize * k.height as usize).map(metres).collect();
        let decoded = color.format.alignment() == 1 && frame.encoding == 0;
        let stored = unpack_color(&push, colors, &decode_table());
        let mut radiance = stored.clone();
        for y in (0..stored.height).filter(|_| color.bottom_up) {
            let width = 4 * stored.width;
            radiance.data[y * width..(y + 1) * width].copy_from_slice(stored.row(row(y, true)));
        }
        let mut color = radiance.clone();
        // Compared by what is seen of it: differences in the dark count.
        color.data.iter_mut().for_each(|v| *v = v.clamp(0.0, 4.0).sqrt());
        Ok(Self { radiance, decoded, color, depth_m, pose: frame.world_from_camera })
    }

    /// World from camera, taken in another way.
    fn pose(&self, change: u32) -> Pose {
        let [a, b, c, d] = self.pose.rotation_xyzw;
        let given = if change & W_FIRST != 0 { [b, c, d, a] } else { [a, b, c, d] };
        let rotation = DQuat::from_array(given).normalize();
        let pose = Pose { rotation, translation_m: DVec3::from(self.pose.translation_m) };
        let pose = if change & INVERSE != 0 { pose.inverse() } else { pose };
        let turn = if change & Y_UP != 0 { DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0) } else { DQuat::IDENTITY };
        Pose { rotation: pose.rotation * turn, ..pose }
    }

    /// Place in memory of a pixel.
    fn at(&self, [x, y]: [usize; 2], change: u32) -> [usize; 2] {
        [x, if change & BOTTOM_UP != 0 { self.color.height - 1 - y } else { y }]
    }

    fn color_at(&self, px: DVec2, change: u32) -> DVec3 {
        let last = DVec2::new(self.color.width as f64 - 1.0, self.color.height as f64 - 1.0);
        let inside = (px - 0.5).clamp(DVec2::ZERO, last);
        let (low, f) = (inside.floor(), inside.fract());
        let texel = |i: f64, j: f64| {
            let at = (low + DVec2::new(i, j)).min(last);
            let [x, y] = self.at([at.x as usize, at.y as usize], change);
            DVec3::from_slice(&self.color.pixel(x, y)[..3].iter().map(|v| f64::from(*v)).collect::<Vec<_>>())
        };
        let along = |j: f64| texel(0.0, j).lerp(texel(1.0, j), f.x);
        along(0.0).lerp(along(1.0), f.y)
    }
}

/// Mean difference of what the second picture shows from the first one at the places where it was then, 0..1, over the
/// three quarters of them that differ least: what only one frame sees, and detail finer than a pixel, is no sign of
/// anything.
fn difference(k: &Intrinsics, first: &Seen, second: &Seen, change: u32) -> f64 {
    let moved = first.pose(change).inverse().then_from(&second.pose(change));
    let (w, h) = (k.width as usize, k.height as usize);
    let mut all = Vec::with_capacity(MAX_PLACES * MAX_PLACES);
    for y in (0..h).step_by(h.div_ceil(MAX_PLACES)) {
        for x in (0..w).step_by(w.div_ceil(MAX_PLACES)) {
            let px = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let [mx, my] = second.at([x, y], change);
            let given = second.depth_m[my * w + mx];
            if !(given > 0.0 && given.is_finite()) {
                continue;
            }
            let ray = k.ray(px);
            let ray = if change & ALONG_RAY != 0 { ray.normalize() } else { ray / ray.z };
            let depth_m = if change & MILLIMETRES != 0 { 1e-3 * given } else { given };
            all.push(match k.project(moved.transform(ray * depth_m)) {
                Some(p) if p.cmpge(DVec2::ZERO).all() && p.x < w as f64 && p.y < h as f64 => {
                    let off = (first.color_at(p, change) - second.color_at(px, change)).abs();
                    off.max_element().min(MAX_DIFFERENCE)
                }
                _ => OUTSIDE_DIFFERENCE,
            });
        }
    }
    all.sort_by(f64::total_cmp);
    let kept = &all[..all.len() * 3 / 4];
    if kept.is_empty() { MAX_DIFFERENCE } else { kept.iter().sum::<f64>() / kept.len() as f64 }
}

/// Changes in order of how many things they change.
fn changes() -> Vec<u32> {
    let mut all: Vec<u32> =
        (0..64).filter(|c| c & (MILLIMETRES | ALONG_RAY) != MILLIMETRES | ALONG_RAY).collect();
    all.sort_by_key(|c| c.count_ones());
    all
}

fn sentence(change: u32, decoded: bool, agreement: &shutterbug_agreement) -> String {
    let colors =
        if decoded { "colours that are linear, not sRGB" } else { "colours that are sRGB, not linear" };
    let names = [
        (Y_UP, "a camera with y up and z backward (OpenGL)"),
        (INVERSE, "poses that are camera from world"),
        (W_FIRST, "quaternions with w first"),
        (MILLIMETRES, "depth in millimetres (of metres in the poses)"),
        (ALONG_RAY, "depth along the ray, not along the optical axis"),
        (BOTTOM_UP, "rows from bottom to top"),
        (ENCODING, colors),
    ];
    let found: Vec<&str> = names.iter().filter(|(bit, _)| change & bit != 0).map(|(_, n)| *n).collect();
    let numbers = format!("mean difference {:.4} as given", agreement.as_given);
    match agreement.verdict {
        0 => format!("the frames agree: {numbers}"),
        1 => format!(
            "the frames agree better with {}: {numbers}, {:.4} then",
            found.join(" and "),
            agreement.best
        ),
        2 => format!("the camera hardly moves between the frames: no convention can be told ({numbers})"),
        _ => format!(
            "the frames agree in no convention that is known: {numbers}, {:.4} at best",
            agreement.best
        ),
    }
}

fn judge(k: &Intrinsics, first: &Seen, second: &Seen) -> shutterbug_agreement {
    let found: Vec<(u32, f64)> =
        changes().into_iter().map(|c| (c, difference(k, first, second, c))).collect();
    let as_given = found[0].1;
    let least = found.iter().map(|f| f.1).fold(f64::INFINITY, f64::min);
    // Of those that are as good as the best, the one that changes least.
    let near = |d: f64| d <= least + MIN_DIFFERENCE.max(0.1 * least);
    let (change, best) = *found.iter().find(|f| near(f.1)).expect("the least itself");
    let worst = found.iter().map(|f| f.1).fold(0.0, f64::max);
    let verdict = if worst - least < MIN_DIFFERENCE {
        2
    } else if change == 0 || as_given - best < MIN_DIFFERENCE {
        if as_given > 0.5 * OUTSIDE_DIFFERENCE { 3 } else { 0 }
    } else if best < MAX_RATIO * as_given {
        1
    } else {
        3
    };
    // Frames that differ in it are compared wrongly from the start.
    let other = verdict < 2 && first.decoded == second.decoded && {
        let pictures = [&first.radiance, &second.radiance];
        encoding::told(pictures, first.decoded) == encoding::Told::Other
    };
    shutterbug_agreement {
        struct_size: size_of::<shutterbug_agreement>() as u32,
        verdict: if other { 1 } else { verdict },
        change: if verdict == 1 { change } else { 0 } | if other { ENCODING } else { 0 },
        reserved: 0,
        as_given,
        best,
    }
}

/// `shutterbug_check_conventions`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_check_conventions(
    camera: *const shutterbug_camera,
    first: *const shutterbug_view,
    second: *const shutterbug_view,
    agreement: *mut shutterbug_agreement,
    text: *mut c_char,
    text_capacity: u64,
) -> Status {
    let check = || {
        // SAFETY: the caller's promise, in all of this.
        let (camera, a, b) = unsafe { (read(camera)?, read(first)?, read(second)?) };
        // SAFETY: as above.
        unsafe { check(agreement) }?;
        let k = super::camera::from_struct(&camera)?.intrinsics;
        for (what, view) in [("first", &a), ("second", &b)] {
            let pose = &view.world_from_camera;
            let length = DQuat::from_array(pose.rotation_xyzw).length();
            if !((length - 1.0).abs() <= 1e-3) || pose.translation_m.iter().any(|v| !v.is_finite()) {
                let length = Quoted(length);
                let text =
                    format!("{what}: the pose is no number, or its quaternion's length {length} not 1");
                return Err(Fault::argument(text));
            }
        }
        // SAFETY: as above.
        let (a, b) = unsafe { (Seen::new(&a, "first", &k)?, Seen::new(&b, "second", &k)?) };
        let found = judge(&k, &a, &b);
        // SAFETY: checked above; writable by the caller's promise.
        unsafe {
            give_text((text, text_capacity), &sentence(found.change, a.decoded, &found));
            agreement.write(found);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { explained((text, text_capacity), check) }
}
