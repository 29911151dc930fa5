//! Points that neighbouring frames share.

use glam::DVec2;

use super::input::Footage;
use crate::diagnose::expect::pair::{GoOn, lies};
use shutterbug::error::Result;

/// Places across a frame and down it at which displacements are taken.
pub(super) const PLACES: [usize; 2] = [14, 10];

/// Points that one frame and the next show.
pub(super) struct Step {
    /// Their numbers.
    pub frames: [usize; 2],
    /// Where they are in both, px.
    pub points: Vec<[DVec2; 2]>,
    /// The same without the lens, over the focal length from the middle.
    rays: Vec<[DVec2; 2]>,
}

impl Step {
    /// # Errors
    /// Frames that cannot be read; no time is left.
    pub(super) fn of(footage: &Footage, frames: [usize; 2], go_on: GoOn<'_>) -> Result<Self> {
        let [a, b] = [footage.picture(frames[0])?, footage.picture(frames[1])?];
        let lies = lies(&a, &b, go_on)?;
        let (w, h) = (a.width, a.height);
        let k = footage.intrinsics();
        let (focal, centre) = (DVec2::new(k.fx, k.fy), DVec2::new(k.cx, k.cy));
        let (mut points, mut rays) = (Vec::new(), Vec::new());
        for (i, j) in (0..PLACES[0]).flat_map(|i| (0..PLACES[1]).map(move |j| (i, j))) {
            let (x, y) = ((2 * i + 1) * w / (2 * PLACES[0]), (2 * j + 1) * h / (2 * PLACES[1]));
            let at = y * w + x;
            if lies.alike.data[at] == 0.0 {
                continue;
            }
            let here = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let there =
                here + DVec2::new(f64::from(lies.shift.data[2 * at]), f64::from(lies.shift.data[2 * at + 1]));
            let inside =
                there.x > 1.0 && there.y > 1.0 && there.x < w as f64 - 1.0 && there.y < h as f64 - 1.0;
            if !inside {
                continue;
            }
            if let [Some(a), Some(b)] = [here, there].map(|p| footage.lens.undistort_px(p)) {
                points.push([here, there]);
                rays.push([a, b].map(|p| (p - centre) / focal));
            }
        }
        Ok(Self { frames, points, rays })
    }

    /// Where points are in both frames, without the lens, over the focal length from the middle.
    pub(super) fn rays(&self) -> &[[DVec2; 2]] {
        &self.rays
    }

    #[cfg(test)]
    pub(super) fn of_rays(rays: Vec<[DVec2; 2]>) -> Self {
        Self { frames: [0, 1], points: Vec::new(), rays }
    }
}
