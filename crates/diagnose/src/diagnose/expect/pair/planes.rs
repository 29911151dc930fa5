//! The planes that a simulator may deliver beside its frames.

use std::path::Path;

use super::frames::SimFrame;
use super::linear_of;
use super::matched::{Matched, stem};
use shutterbug::camera::Trajectory;
use shutterbug::capture::read_text;
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, is_there};
use shutterbug::plane::{Plane, read_exr_plane, read_rgb8};
use std::sync::Arc;

/// Columns and rows of a picture, px.
///
/// # Errors
/// A file that is no picture.
pub(super) fn size_of(path: &Path) -> Result<[u32; 2]> {
    let picture = read_rgb8(path)?;
    Ok([picture.width as u32, picture.height as u32])
}

/// Reads a frame and what lies beside it.
///
/// # Errors
/// Files that cannot be read, lack a channel or have another size.
pub(super) fn read(sim: &Path, frame: &Matched, size: [u32; 2], linear: bool) -> Result<SimFrame> {
    let picture = sim.join(&frame.sim);
    let radiance = linear_of(&picture, linear)?;
    let size = size.map(|v| v as usize);
    same_size(&picture, &radiance, size)?;
    let stem = stem(&frame.sim);
    let plane = |folder: &str, channels: &[&str]| -> Result<Option<Plane<f32>>> {
        let path = sim.join(folder).join(format!("{stem}.exr"));
        if !is_there(&path) {
            return Ok(None);
        }
        let plane = read_exr_plane(&path, channels)?;
        same_size(&path, &plane, size)?;
        Ok(Some(plane))
    };
    let mut depth = plane("depth", &["Z"])?;
    if let Some(depth) = &mut depth {
        let negative = depth.data.iter().filter(|z| **z < 0.0).count();
        if 2 * negative > depth.data.len() {
            let found = format!(
                "{:.0} % of the distances below 0",
                100.0 * negative as f64 / depth.data.len() as f64
            );
            let expected = "distances along the optical axis (z forward), m";
            return Err(Error::input(&sim.join("depth").join(format!("{stem}.exr")), None, found, expected));
        }
        // Nothing is seen where simulators write 0, a negative number or none.
        depth.data.iter_mut().filter(|z| !(**z > 0.0)).for_each(|z| *z = f32::INFINITY);
    }
    let mut motion = plane("motion", &["forward.u", "forward.v"])?;
    if let Some(motion) = &mut motion {
        motion.data.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
    }
    let open = open(sim, stem, size, &radiance)?;
    Ok(SimFrame { radiance: Arc::new(radiance), depth, motion: [motion, None], own: None, open, jumps: None })
}

/// Where the frame may be compared: where its mask is not 0, and where it is not clipped, so that its radiance is
/// known.
fn open(sim: &Path, stem: &str, [w, h]: [usize; 2], radiance: &Plane<f32>) -> Result<Plane<f32>> {
    let path = sim.join("mask").join(format!("{stem}.png"));
    let mask = if is_there(&path) { Some(read_rgb8(&path)?) } else { None };
    if let Some(mask) = &mask {
        same_size(&path, mask, [w, h])?;
    }
    let known = |i: usize| radiance.data[3 * i..3 * i + 3].iter().all(|v| *v < 1.0);
    let masked = |i: usize| mask.as_ref().is_some_and(|m| m.data[3 * i..3 * i + 3] == [0; 3]);
    let data = (0..w * h).map(|i| f32::from(u8::from(known(i) && !masked(i)))).collect();
    Ok(Plane { width: w, height: h, channels: 1, data })
}

fn same_size<T>(path: &Path, plane: &Plane<T>, [w, h]: [usize; 2]) -> Result<()> {
    if [plane.width, plane.height] == [w, h] {
        return Ok(());
    }
    let found = format!("a picture of {}x{} px", plane.width, plane.height);
    Err(Error::input(path, None, found, format!("{w}x{h} px, as the frames have")))
}

/// The camera's path.
///
/// # Errors
/// A file that cannot be read, with the line.
pub(super) fn trajectory(path: &Path) -> Result<Trajectory> {
    let text = read_text(path, "the camera's poses: `t tx ty tz qx qy qz qw`", Limit::TABLE)?;
    Trajectory::parse(path, &text, 0)
}
