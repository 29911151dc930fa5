//! The marks of a folder: means over its frames, and how well they are known from frame to frame.

use std::borrow::Borrow;

use rayon::prelude::*;

use super::marks::{
    BINS, Block, EDGES, LATERAL, LINEAR, LINES, MARKS, MOSAIC, Mark, NEIGHBOURS, PATTERN, STUCK, bin_dn,
    blocks, flat, marks, pattern_marks,
};
use crate::diagnose::judge::hot::steady_spots;
use shutterbug::plane::{Plane, srgb_decode};

/// What the sharpest edges of two rooms differ by, as a part of their width: five rooms of one renderer, nothing
/// hidden, had 5 to 24 % between them.
const EDGE_ERROR: f64 = 0.15;
/// What two rooms differ by in the magnification of colours: things have colours of their own on either side. The same
/// rooms: 2.5e-4.
const LATERAL_ERROR: f64 = 5e-4;
/// How well a variance of noise is known at best, as a part of it, in either folder: content that looks like noise,
/// bins of some width. Together 5 %.
const VARIANCE_ERROR: f64 = 0.035;
/// What fine texture makes of the noise of neighbours: the same room with and without motion blur differed by as much.
const NEIGHBOUR_ERROR: f64 = 0.03;
/// What content may differ by between even and odd pixels: a grid of a texture that lies on theirs in some frames.
const MOSAIC_ERROR: f64 = 0.02;
/// What a mark counts that is not there any more: ten standard errors.
const LOST: f64 = 100.0;
/// What rounding leaves unknown of a linear variance, squares of 1/255: values on a whole DN are not rounded at random.
const ROUNDING: f64 = 0.02;

/// A folder's marks.
#[derive(Clone, Debug)]
pub(super) struct Fingerprint(pub Vec<Option<Known>>);

/// A mark with its standard error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub value: f64,
    pub error: f64,
}

impl Fingerprint {
    /// Of some pictures (DN, shape `[height, width, 3]`). `packed_dn2`: variance that a compression may leave or take,
    /// DN^2.
    pub(super) fn of(frames: &[impl Borrow<Plane<f32>> + Sync], packed_dn2: f64) -> Self {
        let all: Vec<Vec<Block>> = frames.par_iter().map(|f| blocks(f.borrow())).collect();
        let flat: Vec<Vec<&Block>> = all
            .iter()
            .zip(flat(&all))
            .map(|(all, flat)| all.iter().zip(flat).filter(|(_, flat)| *flat).map(|(b, _)| b).collect())
            .collect();
        let planes: Vec<&Plane<f32>> = frames.iter().map(Borrow::borrow).collect();
        let mut all: Vec<Vec<Mark>> =
            planes.par_iter().zip(&flat).map(|(dn, flat)| marks(dn, flat)).collect();
        for (frame, shared) in all.iter_mut().zip(pattern_marks(&planes, &flat)) {
            PATTERN.into_iter().zip(shared).for_each(|(k, mark)| frame[k] = mark);
        }
        let stuck = steady_spots(&planes) as f64;
        all.iter_mut().for_each(|frame| frame[STUCK] = Some([stuck, 1.0]));
        let one = |k: usize| pooled(&all.iter().filter_map(|f| f[k]).collect::<Vec<_>>(), k, packed_dn2);
        Self((0..MARKS).map(one).collect())
    }
}

/// Mean by what each frame saw, and its standard error from the frames' own scatter.
fn pooled(seen: &[[f64; 2]], mark: usize, packed_dn2: f64) -> Option<Known> {
    // From two frames nobody knows how much frames differ.
    if seen.len() < 3 {
        return None;
    }
    let weight: f64 = seen.iter().map(|s| s[1]).sum();
    let value = seen.iter().map(|s| s[0] * s[1]).sum::<f64>() / weight;
    let scatter: f64 = seen.iter().map(|s| (s[1] * (s[0] - value) / weight).powi(2)).sum();
    let n = seen.len() as f64;
    let mut error2 = scatter * n / (n - 1.0);
    if EDGES.contains(&mark) {
        error2 += (EDGE_ERROR * value).powi(2);
    }
    if LINES.contains(&mark) || PATTERN.contains(&mark) {
        error2 += (ROUNDING + packed_dn2).powi(2) + (VARIANCE_ERROR * value).powi(2);
    }
    if mark == STUCK {
        // Which pixels of a sensor are is chance. One bright point may be a lamp that stays in sight.
        error2 += value + 1.0;
    }
    if MOSAIC.contains(&mark) {
        error2 += MOSAIC_ERROR * MOSAIC_ERROR;
    }
    if NEIGHBOURS.contains(&mark) {
        // A compression makes neighbours alike by itself.
        let error = if packed_dn2 > 0.0 { 1.0 } else { NEIGHBOUR_ERROR };
        error2 += error * error;
    }
    if LATERAL.contains(&mark) {
        error2 += LATERAL_ERROR * LATERAL_ERROR;
    }
    if mark < BINS {
        let packed = LINEAR * packed_dn2 * slope_at(bin_dn(mark)).powi(2);
        error2 += (VARIANCE_ERROR * value).powi(2) + ROUNDING * ROUNDING + packed * packed;
    }
    Some(Known { value, error: error2.sqrt() })
}

/// Linear value by DN in the middle of a bin.
fn slope_at([from, to]: [f64; 2]) -> f64 {
    let linear = |dn: f64| f64::from(srgb_decode((dn / 255.0) as f32));
    (linear(to) - linear(from)) / (to - from)
}

/// By mark: how far the second folder lies from the first, in standard errors of the difference.
pub(super) fn apart(real: &Fingerprint, sim: &Fingerprint) -> Vec<Option<f64>> {
    real.0
        .iter()
        .zip(&sim.0)
        .map(|(r, s)| {
            let (r, s) = ((*r)?, (*s)?);
            let error = r.error.hypot(s.error);
            (error > 0.0).then(|| (r.value - s.value) / error)
        })
        .collect()
}

/// Sum of squares of what the marks in `counted` differ by. One that an effect has wiped out counts as far off.
pub(super) fn squares(apart: &[Option<f64>], counted: &[bool]) -> f64 {
    let one = |(z, counts): (&Option<f64>, &bool)| if *counts { z.map_or(LOST, |z| z * z) } else { 0.0 };
    apart.iter().zip(counted).map(one).sum()
}

/// Which marks two folders have in common.
pub(super) fn common(a: &Fingerprint, b: &Fingerprint) -> Vec<bool> {
    a.0.iter().zip(&b.0).map(|(a, b)| a.is_some() && b.is_some()).collect()
}

/// What marks differ by, standard errors, root mean square.
pub(super) fn distance(apart: &[Option<f64>]) -> f64 {
    let n = apart.iter().flatten().count().max(1) as f64;
    (apart.iter().flatten().map(|z| z * z).sum::<f64>() / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_known_as_well_as_frames_agree() {
        let agree = pooled(&[[4.0, 10.0], [4.0, 10.0], [4.0, 10.0]], 0, 0.0).expect("three frames");
        assert!((agree.value - 4.0).abs() < 1e-12 && (agree.error - 0.14).abs() < 0.01, "{agree:?}");
        let differ = pooled(&[[2.0, 10.0], [4.0, 10.0], [6.0, 10.0]], 0, 0.0).expect("three frames");
        assert!(differ.error > 1.0, "control: {differ:?}");
        assert!(pooled(&[[2.0, 10.0]; 2], 0, 0.0).is_none());
    }
}
