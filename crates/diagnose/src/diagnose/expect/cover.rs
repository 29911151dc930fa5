//! Where frames are compared if the background is to be ignored: where geometry covers the pixel in the simulation as
//! given and in those that are tried. A lens may move a board's border by many px; outside of it a simulated picture
//! has nothing to be compared with, and a candidate that is right must not be blamed for that.

use glam::DVec2;
use rayon::prelude::*;

use super::forward::Forward;
use super::model::Theta;
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;

/// How far inside of the border pictures are compared, px: what a candidate may still move it by.
const ROOM_PX: usize = 6;
/// The same for parameters that have been fitted: filters reach so far.
const FITTED_ROOM_PX: usize = 3;
/// Share of the compared pixels that must lie outside of what fitted parameters cover to be worth another search.
const LEAST_OUTSIDE: f64 = 0.02;
/// Share of the compared pixels that must remain: parameters that leave less are no use to compare with.
const LEAST_LEFT: f64 = 0.4;

/// Where to compare, by place; each of shape `[height, width, 1]`.
pub(crate) struct Cover {
    pub masks: Vec<Plane<f32>>,
    /// Where the content of the sharp planes covers a pixel and its surroundings, for fitted parameters.
    inner: Vec<Plane<f32>>,
}

impl Cover {
    /// Where the given camera `base` sees geometry. `from` is what errors name: the camera of a scene, the folder of
    /// frames that another simulator made.
    ///
    /// # Errors
    /// Less than a hundredth of the pixels.
    pub(crate) fn new(forward: &Forward, base: &Theta, from: &std::path::Path) -> Result<Self> {
        let eroded =
            |room: usize| -> Vec<_> { forward.sharp.par_iter().map(|s| eroded(&s.coverage, room)).collect() };
        let outer = eroded(ROOM_PX);
        let masks: Vec<_> = (0..outer.len()).map(|at| seen(forward, at, base, &outer[at])).collect();
        if share(&masks) < 0.01 {
            return Err(too_little(forward.outside.is_some(), from));
        }
        Ok(Self { masks, inner: eroded(FITTED_ROOM_PX) })
    }

    /// Leaves out what parameters that were fitted do not cover; whether that is so much that the search should be made
    /// anew.
    pub(crate) fn narrow<'a>(&mut self, forward: &Forward, fitted: impl Iterator<Item = &'a Theta>) -> bool {
        let was = share(&self.masks);
        let begin = was;
        for theta in fitted {
            let narrower: Vec<_> = (0..self.masks.len())
                .map(|at| both(&self.masks[at], &seen(forward, at, theta, &self.inner[at])))
                .collect();
            let now = share(&narrower);
            let worth = now < (1.0 - LEAST_OUTSIDE) * share(&self.masks) && now > LEAST_LEFT * begin;
            if worth {
                self.masks = narrower;
            }
        }
        let now = share(&self.masks);
        tracing::info!("compared: {:.1} % of the pixels, before {:.1} %", 100.0 * now, 100.0 * was);
        now < was
    }
}

/// That hardly anything is left to compare, and what left it out.
fn too_little(of_frames: bool, from: &std::path::Path) -> Error {
    let (found, expected) = if of_frames {
        (
            "less than 1 % of the pixels to compare: simulated values at white, what is black in mask/ and what other \
             lines show (depth, motion) are left out",
            "simulated frames that are not clipped, and a mask/ that is white where frames are compared",
        )
    } else {
        (
            "background = \"ignore\" leaves less than 1 % of the pixels to compare",
            "a scene that fills more of the frames",
        )
    };
    Error::input(from, None, found, expected)
}

/// Share of the pixels that are open.
fn share(masks: &[Plane<f32>]) -> f64 {
    let open = masks.iter().map(|m| f64::from(m.data.iter().sum::<f32>()) / m.data.len() as f64);
    open.sum::<f64>() / masks.len().max(1) as f64
}

/// Where both are open.
fn both(a: &Plane<f32>, b: &Plane<f32>) -> Plane<f32> {
    Plane { data: a.data.iter().zip(&b.data).map(|(a, b)| a.min(*b)).collect(), ..*a }
}

/// Where the surroundings of a pixel, up to `room` px to each side, are covered.
fn eroded(coverage: &Plane<f32>, room: usize) -> Plane<f32> {
    let (w, h) = (coverage.width, coverage.height);
    let flag = |open: bool| [f32::from(u8::from(open))];
    let across = Plane::from_fn(w, h, |x, y| {
        let mut near = x.saturating_sub(room)..(x + room + 1).min(w);
        flag(near.all(|u| coverage.pixel(u, y)[0] > 0.999))
    });
    Plane::from_fn(w, h, |x, y| {
        let mut near = y.saturating_sub(room)..(y + room + 1).min(h);
        flag(near.all(|v| across.pixel(x, v)[0] > 0.5))
    })
}

/// Which pixels show what is `open` in the sharp planes, from the first to the last instant of their exposure.
fn seen(forward: &Forward, at: usize, theta: &Theta, open: &Plane<f32>) -> Plane<f32> {
    if let Some(outside) = &forward.outside {
        return forward.shown_by_sim(outside, at, theta, open);
    }
    let k = &forward.intrinsics;
    let (w, h) = (open.width, open.height);
    let shutter = forward.shutter(at, theta);
    let sharp_s = forward.sharp_time_s(at);
    let velocity = &forward.sharp[at].velocity;
    let is_open = |p: DVec2| {
        let (x, y) = (p.x.floor(), p.y.floor());
        // Beyond the picture nothing is known of the sharp planes: the border's own answer.
        let (x, y) = (x.clamp(0.0, w as f64 - 1.0) as usize, y.clamp(0.0, h as f64 - 1.0) as usize);
        open.pixel(x, y)[0] > 0.5
    };
    let data = (0..w * h).into_par_iter().map(|i| {
        let (x, y) = (i % w, i / w);
        let line = theta.scan_order.line_of(x as u32, y as u32, k.width, k.height);
        let start_s = shutter.line_start_s(line) - sharp_s;
        let source = forward.source(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), theta, 1);
        let v = velocity.pixel(x, y);
        let v = DVec2::new(f64::from(v[0]), f64::from(v[1]));
        let at = |late_s: f64| is_open(source - v * late_s);
        f32::from(u8::from(at(start_s) && at(start_s + shutter.exposure_time_s)))
    });
    Plane { width: w, height: h, channels: 1, data: data.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_a_hole_is_left_out() {
        let coverage = Plane::from_fn(9, 9, |x, y| [if (x, y) == (4, 4) { 0.5 } else { 1.0 }]);
        let open = eroded(&coverage, 2);
        for (x, y) in [(4, 4), (2, 2), (6, 4), (4, 6)] {
            assert_eq!(open.pixel(x, y), [0.0], "{x} {y}");
        }
        for (x, y) in [(1, 4), (7, 7), (0, 0), (4, 1)] {
            assert_eq!(open.pixel(x, y), [1.0], "{x} {y}");
        }
    }
}
