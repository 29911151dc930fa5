//! The simulator's frames with effects put on them, and the candidates that are tried.

use rayon::prelude::*;

use super::fingerprint::Fingerprint;
use crate::diagnose::expect::model::{P, Theta, candidate_of};
use crate::diagnose::expect::settings::settings_of;
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::chain::View;
use shutterbug::effects;
use shutterbug::plane::Plane;
use shutterbug::reference::chain;

/// Candidates whose marks stand whatever is seen, with the values from which fits begin.
pub(super) const NAMES: [(&str, &[f64]); 9] = [
    ("bayer_mosaic", &[1.0, 2.0, 3.0, 4.0]),
    ("defocus", &[0.5, 1.0, 2.0]),
    ("shot_noise", &[1e-4, 6e-4, 3e-3]),
    ("row_noise", &[2e-3, 1e-2]),
    ("fixed_pattern_noise", &[2e-3, 1e-2]),
    ("hot_pixels", &[1e-4, 1e-3]),
    ("read_noise", &[2e-3, 8e-3, 3e-2]),
    ("chromatic_aberration", &[1.001]),
    ("sharpening", &[0.5, 1.5]),
];
/// Those that widen or narrow edges both ways: what does so one way is motion.
pub(super) const EDGES_TELL: [&str; 2] = ["defocus", "sharpening"];

/// All parameters of a set.
pub(super) fn parameters(set: &[&'static str]) -> Vec<P> {
    set.iter().flat_map(|n| candidate_of(n).parameters.iter().copied()).collect()
}

/// Linear radiance of simulated frames, shape `[height, width, 4]`.
pub(super) struct Simulated(pub Vec<Plane<f32>>);

impl Simulated {
    /// The frames as a camera delivers them, DN.
    pub(super) fn delivered(&self, theta: &Theta, seed: u64) -> Vec<Plane<f32>> {
        self.delivered_from(theta, seed, 0)
    }

    /// The same of frames of which the first has this number.
    pub(super) fn delivered_from(&self, theta: &Theta, seed: u64, first: u32) -> Vec<Plane<f32>> {
        let settings = settings_of(theta);
        let one = |(i, radiance): (usize, &Plane<f32>)| {
            let (width, height) = (radiance.width as u32, radiance.height as u32);
            let (w, h) = (f64::from(width), f64::from(height));
            let intrinsics = Intrinsics { width, height, fx: w, fy: w, cx: 0.5 * w, cy: 0.5 * h };
            let shutter = ShutterTiming {
                start_s: 0.0,
                exposure_time_s: 0.0,
                readout_time_s: 0.0,
                scan_order: ScanOrder::TopToBottom,
                line_count: height,
            };
            let view = View { intrinsics, shutter, frame: first + i as u32, seed };
            let lens = magnified(radiance, theta);
            chain::picture(effects::LIST, &settings, &view, lens.as_ref().unwrap_or(radiance)).to_f32()
        };
        self.0.par_iter().enumerate().map(one).collect()
    }

    pub(super) fn fingerprint(&self, theta: &Theta) -> Fingerprint {
        Fingerprint::of(&self.delivered(theta, 1), packed_dn2(theta))
    }
}

/// Variance that the compression of `theta` may leave of a flat place, or take from its noise, DN^2: its finest step,
/// rounded.
pub(super) fn packed_dn2(theta: &Theta) -> f64 {
    if !theta.is_on(P::Quality) {
        return 0.0;
    }
    let steps = crate::diagnose::dct::steps(theta.get(P::Quality) as u8, false);
    let finest = steps.iter().copied().fold(f32::INFINITY, f32::min);
    f64::from(finest * finest) / 12.0
}

/// Red and blue at their own magnification, which the chain leaves to the engine.
fn magnified(radiance: &Plane<f32>, theta: &Theta) -> Option<Plane<f32>> {
    let scales = [theta.get(P::ScaleR), 1.0, theta.get(P::ScaleB)];
    if scales == [1.0; 3] {
        return None;
    }
    let centre = [0.5 * radiance.width as f64, 0.5 * radiance.height as f64];
    let read = |x: usize, y: usize, c: usize| {
        let place = |v: usize, k: usize| (centre[k] + (v as f64 + 0.5 - centre[k]) / scales[c]) as f32;
        crate::diagnose::expect::pair::channel_at(radiance, [place(x, 0), place(y, 1)], c)
    };
    Some(Plane::from_fn(radiance.width, radiance.height, |x, y| {
        [read(x, y, 0), radiance.pixel(x, y)[1], read(x, y, 2), radiance.pixel(x, y)[3]]
    }))
}
