//! The part of the noise that all frames share, pixel by pixel: a sensor's fixed pattern, where what the camera sees
//! moves.

use rayon::prelude::*;

use super::blocks::{APART, BLOCK_PX, Block, STRIDE_PX};
use super::{HIGH_PASS, LINEAR, Mark};
use shutterbug::plane::Plane;
use shutterbug::plane::stats::luma;

/// Linear brightness between dark and bright places: a pattern of gains shows in the latter alone.
const MIDDLE: f32 = 0.2;
/// Fewest pixels that a frame and others saw flat.
const FEWEST_PX: f64 = 500.0;

/// A pixel in a flat place: what it differs by from those beside it, linear, and how bright the place is.
type Residue = Option<[f32; 2]>;

/// By frame: the marks of dark and of bright places. A frame's residues times the mean of those of all others at the
/// same pixels: what is new in each frame has no part in it.
pub(in super::super) fn pattern_marks(frames: &[&Plane<f32>], flat: &[Vec<&Block>]) -> Vec<[Mark; 2]> {
    let residues: Vec<Vec<Residue>> =
        frames.par_iter().zip(flat).map(|(dn, flat)| residues(dn, flat)).collect();
    let pixels = residues.first().map_or(0, Vec::len);
    if residues.iter().any(|r| r.len() != pixels) {
        return vec![[None; 2]; frames.len()];
    }
    // Sum over all frames, and how many saw the pixel.
    let mut all = vec![[0.0f32; 2]; pixels];
    for frame in &residues {
        for (sum, residue) in all.iter_mut().zip(frame) {
            if let Some([v, _]) = residue {
                *sum = [sum[0] + v, sum[1] + 1.0];
            }
        }
    }
    residues.par_iter().map(|frame| shared(frame, &all)).collect()
}

fn residues(dn: &Plane<f32>, flat: &[&Block]) -> Vec<Residue> {
    let mut out = vec![None; dn.width * dn.height];
    for b in flat {
        let steep = 1.0 / b.slopes2.sqrt() as f32;
        let [x0, y0] = b.at.map(|k| k * STRIDE_PX);
        for y in y0..y0 + BLOCK_PX {
            for x in x0 + APART..x0 + BLOCK_PX - APART {
                let at = |x: usize| luma(dn.pixel(x, y));
                // Along the row, which has noise of its own in common.
                let own = at(x) - 0.5 * (at(x - APART) + at(x + APART));
                out[y * dn.width + x] = Some([steep * own, b.level as f32]);
            }
        }
    }
    out
}

fn shared(frame: &[Residue], all: &[[f32; 2]]) -> [Mark; 2] {
    let mut sums = [[0.0f64; 2]; 2];
    for (residue, [sum, count]) in frame.iter().zip(all) {
        let Some([v, level]) = residue else { continue };
        if *count < 2.0 {
            continue;
        }
        let of = &mut sums[usize::from(*level > MIDDLE)];
        of[0] += f64::from(v * (sum - v) / (count - 1.0));
        of[1] += 1.0;
    }
    sums.map(|[product, n]| (n >= FEWEST_PX).then(|| [LINEAR * product / n / HIGH_PASS, n]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::unpaired::marks::{blocks, flat};
    use shutterbug::chain::rng::random_normal;

    fn seen(fixed_dn: f32, noise_dn: f32) -> f64 {
        let frame = |f: u32| {
            Plane::from_fn(160, 120, |x, y| {
                let [r, g, b, _] = random_normal([x as u32, y as u32], f, 5, [1, 2]);
                let [pr, pg, pb, _] = random_normal([x as u32, y as u32], 99, 6, [1, 2]);
                [r * noise_dn + pr * fixed_dn, g * noise_dn + pg * fixed_dn, b * noise_dn + pb * fixed_dn]
                    .map(|n| (128.0 + n).round())
            })
        };
        let frames: Vec<Plane<f32>> = (0..6).map(frame).collect();
        let all: Vec<Vec<Block>> = frames.iter().map(blocks).collect();
        let which = flat(&all);
        let own: Vec<Vec<&Block>> = all
            .iter()
            .zip(&which)
            .map(|(b, f)| b.iter().zip(f).filter(|(_, f)| **f).map(|(b, _)| b).collect())
            .collect();
        let marks = pattern_marks(&frames.iter().collect::<Vec<_>>(), &own);
        marks.iter().map(|m| m[1].expect("bright places")[0]).sum::<f64>() / 6.0
    }

    #[test]
    fn what_frames_share_is_told_from_what_is_new_in_each() {
        let (none, some) = (seen(0.0, 2.0), seen(1.0, 2.0));
        // A DN at 128 is 0.88 of a 255th of full scale there.
        assert!(none.abs() < 0.08, "{none}");
        assert!((some / 0.78 - 1.0).abs() < 0.2, "{some}");
    }
}
