//! How far content lies from where it should: displacement of small blocks, whatever the light on them.
//!
//! A lens, a shutter or a wrong pose moves things. Real light differs from a scene's from place to place (lamps,
//! shadows), and may leave most of a gap although everything has come to lie where it should.

use std::borrow::Borrow;

use rayon::prelude::*;

use crate::diagnose::evidence::Evidence;
use shutterbug::plane::Plane;

/// Side of a block, px.
const BLOCK_PX: usize = 16;
/// How much the light may differ from block to block.
const LIGHT: [f64; 2] = [0.25, 4.0];
/// Displacements that are told from blocks of this size go no further, px.
const MOST_PX: f64 = 4.0;
/// Share of a block's structure that is added to each direction: along an edge nothing is known.
const RIDGE: f64 = 0.05;
/// Mean squared slope below which a block has no structure, (DN per px)^2.
const LEAST_SLOPE2: f64 = 4.0;

/// Share of the displacement before that is gone after, of all structure in `frames` (places).
pub(crate) fn placed(
    evidence: &Evidence,
    frames: &[usize],
    pictures: [&[Plane<f32>]; 2],
    masks: &[Plane<f32>],
) -> f64 {
    let [before, after] =
        pictures.map(|pictures| displacements(evidence, frames, pictures, masks).iter().sum::<f64>());
    if before <= 0.0 { 0.0 } else { 1.0 - after / before }
}

/// Displacement of every block, as in [`placed`]: frame after frame, the same blocks whatever the pictures.
pub(crate) fn displacements<P: Borrow<Plane<f32>> + Sync>(
    evidence: &Evidence,
    frames: &[usize],
    pictures: &[P],
    masks: &[Plane<f32>],
) -> Vec<f64> {
    let each = frames.par_iter().zip(pictures).map(|(&at, picture)| {
        let [real, picture] = [&evidence.frames[at].dn, picture.borrow()].map(grey);
        displacement(&real, &picture, &masks[at])
    });
    each.collect::<Vec<_>>().concat()
}

fn grey(picture: &Plane<f32>) -> Plane<f32> {
    Plane::from_fn(picture.width, picture.height, |x, y| [picture.pixel(x, y).iter().sum::<f32>() / 3.0])
}

/// Sizes of the displacement of the blocks, weighed by how much structure the real picture has there.
fn displacement(real: &Plane<f32>, picture: &Plane<f32>, mask: &Plane<f32>) -> Vec<f64> {
    let (w, h) = (real.width, real.height);
    let mut all = Vec::new();
    for top in (1..h.saturating_sub(BLOCK_PX)).step_by(BLOCK_PX) {
        for left in (1..w.saturating_sub(BLOCK_PX)).step_by(BLOCK_PX) {
            let inside: Vec<(usize, usize)> = (0..BLOCK_PX * BLOCK_PX)
                .map(|i| (left + i % BLOCK_PX, top + i / BLOCK_PX))
                .filter(|&(x, y)| mask.pixel(x, y)[0] > 0.5)
                .collect();
            let open = inside.len() >= BLOCK_PX * BLOCK_PX / 4;
            all.push(if open { of_block(real, picture, &inside) } else { 0.0 });
        }
    }
    all
}

/// Displacement times structure of one block, from the first-order equation of Lucas and Kanade (1981) after the light
/// of the block has been fitted.
fn of_block(real: &Plane<f32>, picture: &Plane<f32>, inside: &[(usize, usize)]) -> f64 {
    let n = inside.len() as f64;
    let at = |p: &Plane<f32>, x: usize, y: usize| f64::from(p.pixel(x, y)[0]);
    let slope = |p: &Plane<f32>, x: usize, y: usize| {
        [0.5 * (at(p, x + 1, y) - at(p, x - 1, y)), 0.5 * (at(p, x, y + 1) - at(p, x, y - 1))]
    };
    let mean = |p: &Plane<f32>| inside.iter().map(|&(x, y)| at(p, x, y)).sum::<f64>() / n;
    let (mean_r, mean_p) = (mean(real), mean(picture));
    let (mut pp, mut pr) = (0.0, 0.0);
    for &(x, y) in inside {
        let (p, r) = (at(picture, x, y) - mean_p, at(real, x, y) - mean_r);
        (pp, pr) = (pp + p * p, pr + p * r);
    }
    let light = (pr / pp.max(1e-9)).clamp(LIGHT[0], LIGHT[1]);
    // Structure tensor and right side; the slopes of both pictures, so that neither is preferred.
    let (mut a, mut b, mut own2) = ([0.0f64; 3], [0.0f64; 2], 0.0);
    for &(x, y) in inside {
        let (r, p) = (slope(real, x, y), slope(picture, x, y));
        let g = [0.5 * (r[0] + light * p[0]), 0.5 * (r[1] + light * p[1])];
        let e = (at(real, x, y) - mean_r) - light * (at(picture, x, y) - mean_p);
        a = [a[0] + g[0] * g[0], a[1] + g[0] * g[1], a[2] + g[1] * g[1]];
        b = [b[0] + g[0] * e, b[1] + g[1] * e];
        own2 += r[0] * r[0] + r[1] * r[1];
    }
    if own2 / n < LEAST_SLOPE2 {
        return 0.0;
    }
    let ridge = RIDGE * own2;
    let (xx, xy, yy) = (a[0] + ridge, a[1], a[2] + ridge);
    let det = xx * yy - xy * xy;
    let d = [(yy * b[0] - xy * b[1]) / det, (xx * b[1] - xy * b[0]) / det];
    d[0].hypot(d[1]).min(MOST_PX) * own2.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth texture, displaced by `dx` px and lit by `light` with a gradient.
    fn texture(dx: f32, light: f32, gradient: f32) -> Plane<f32> {
        Plane::from_fn(96, 64, |x, y| {
            let (u, v) = (x as f32 - dx, y as f32);
            let t = 0.5 + 0.25 * ((0.35 * u + 0.1 * v).sin() + (0.27 * v - 0.08 * u).cos());
            [200.0 * t * light * (1.0 + gradient * x as f32 / 96.0); 3]
        })
    }

    fn open() -> Plane<f32> {
        Plane::from_fn(96, 64, |_, _| [1.0])
    }

    #[test]
    fn light_is_no_displacement_and_displacement_is() {
        let of = |real: &Plane<f32>, picture: &Plane<f32>| {
            displacement(&grey(real), &grey(picture), &open()).iter().sum::<f64>()
        };
        let real = texture(0.0, 1.0, 0.0);
        let moved = of(&real, &texture(1.0, 1.0, 0.0));
        let lit = of(&real, &texture(0.0, 0.6, 0.3));
        assert!(moved > 0.0 && lit < 0.1 * moved, "moved {moved}, lit {lit}");
        let half = of(&real, &texture(0.5, 0.6, 0.3));
        assert!((0.4..0.6).contains(&(half / moved)), "{half} of {moved}");
    }
}
