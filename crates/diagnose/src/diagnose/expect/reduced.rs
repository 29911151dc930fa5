//! Frames of fewer pixels: where a camera acts alike on pictures of any size, a fit of large ones learns as much from
//! means over squares of their pixels, in a fraction of the time.

use std::sync::Arc;

use rayon::prelude::*;

use super::forward::{Forward, Reduced};
use super::model::{P, Theta};
use super::settings::settings_of;
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::evidence::{Evidence, RealFrame};
use shutterbug::capture::Capture;
use shutterbug::error::Result;
use shutterbug::gpu::Context;
use shutterbug::plane::Plane;
use shutterbug::reference::moments::is_pointwise;

/// Fewest pixels of a smaller frame.
///
/// Measured: three quarters of the frames of `withhold`, whose parameters come out within 0.3 %.
const FEWEST_PX: usize = 320 * 180;

impl Reduced {
    /// Of frames whose sides can be divided.
    pub(crate) fn new(
        context: &Arc<Context>,
        capture: &Capture,
        evidence: &Evidence,
        budget: Budget,
    ) -> Result<Option<Box<Self>>> {
        let k = &capture.camera.intrinsics;
        let Some(side) = side_for([k.width, k.height].map(|v| v as usize)) else { return Ok(None) };
        let mut small = capture.clone();
        small.camera.intrinsics = k.divided(side as u32);
        let frame = |f: &RealFrame| RealFrame { dn: Arc::new(averaged(&f.dn, side)), ..f.clone() };
        let evidence = Evidence { frames: evidence.frames.iter().map(frame).collect(), ..evidence.clone() };
        let mut forward = Forward::new(Some(context), &small, &evidence, None, budget)?;
        forward.pooled = side;
        Ok(Some(Box::new(Self { forward, evidence, masks: Vec::new() })))
    }

    /// Compares where all pixels of a square are compared.
    pub(crate) fn compare_in(&mut self, masks: &[Plane<f32>]) {
        let side = self.forward.pooled;
        self.masks = masks.par_iter().map(|mask| whole_squares(mask, side)).collect();
    }
}

/// 1 where all pixels of a square are.
fn whole_squares(mask: &Plane<f32>, side: usize) -> Plane<f32> {
    let is_whole = |x: usize, y: usize| {
        let line = |y: usize| &mask.data[y * mask.width + x * side..][..side];
        let all = (y * side..(y + 1) * side).all(|y| line(y).iter().all(|m| *m > 0.5));
        [f32::from(u8::from(all))]
    };
    Plane::from_fn(mask.width / side, mask.height / side, is_whole)
}

/// Whether a camera does the same to pictures of any size: what it does to a pixel depends on that pixel alone, and on
/// no step that an average would hide. Flicker is told line by line.
pub(crate) fn acts_alike(theta: &Theta) -> bool {
    let described = !theta.room.radiance && theta.room.poses.is_empty();
    let steps = [P::Bits, P::FlickerC, P::FlickerS].iter().any(|&p| theta.is_on(p));
    described && !steps && is_pointwise(&settings_of(theta))
}

/// Side of the squares, px: the largest that divides both sides and leaves pixels enough.
fn side_for([width, height]: [usize; 2]) -> Option<usize> {
    let divides = |s: &usize| width.is_multiple_of(*s) && height.is_multiple_of(*s);
    let leaves = |s: &usize| (width / s) * (height / s) >= FEWEST_PX;
    (2..=64).rev().find(|s| divides(s) && leaves(s))
}

/// Means over squares.
fn averaged(dn: &Plane<f32>, side: usize) -> Plane<f32> {
    let data = pooled(&dn.data, dn.width, dn.height, side);
    Plane { width: dn.width / side, height: dn.height / side, channels: dn.channels, data }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::CANDIDATES;

    #[test]
    fn sides_are_divided_evenly_and_small_frames_stay_as_they_are() {
        let sizes = [[1920, 1080], [1280, 960], [640, 480], [1366, 768], [320, 240], [1001, 997]];
        assert_eq!(sizes.map(side_for), [Some(6), Some(4), Some(2), Some(2), None, None]);
    }

    #[test]
    fn what_neighbours_steps_and_lines_tell_of_needs_all_pixels() {
        let alike = |name: &str| {
            let candidate = CANDIDATES.iter().find(|c| c.name == name).expect("there");
            let on = |at: Theta, &p: &P| at.with(p, at.get(p) + p.spec().step);
            acts_alike(&candidate.parameters.iter().fold(Theta::neutral(), on))
        };
        for name in
            ["rolling_shutter", "motion_blur", "lens_distortion", "pose_offset", "vignetting", "gamma"]
        {
            assert!(alike(name), "{name}");
        }
        for name in
            ["defocus", "sharpening", "noise_reduction", "bayer_mosaic", "jpeg", "quantization", "flicker"]
        {
            assert!(!alike(name), "{name}");
        }
    }

    #[test]
    fn a_square_is_compared_where_all_of_its_pixels_are() {
        let mask = Plane::from_fn(6, 4, |x, y| [if (x, y) == (3, 1) { 0.0 } else { 1.0 }]);
        assert_eq!(whole_squares(&mask, 2).data, [1.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    }
}
