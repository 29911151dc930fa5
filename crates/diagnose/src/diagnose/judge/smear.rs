//! Whether what is left is smeared along the motion: the sign of an exposure that is missing or of a wrong length.
//! Beside a large gap it is too little to count as a share of it.
//!
//! Slopes of the real picture are compared with those of the simulated one, once along the motion and once across it,
//! by the factor that takes the latter to the former. Noise does not move such a factor, and another pixel filter moves
//! both alike.

use crate::diagnose::evidence::Evidence;
use shutterbug::plane::Plane;

/// Share of the fastest speed (of the fastest tenth) from which on a place counts.
const FAST: f64 = 0.5;
/// Side of the blocks that are taken for independent draws, px.
const BLOCK_PX: usize = 32;
/// Fewest blocks that tell anything.
const FEWEST: usize = 12;

/// Share of the slopes that may lack along the motion.
///
/// Measured: 0.0001 to 0.0042 on nine captures of another renderer, five of them explained; a blur of half a px
/// makes 0.025.
const MOST_SMEAR: f64 = 0.015;
/// Standard errors beyond which that is no chance.
const SMEAR_ERRORS: f64 = 4.0;

/// By how much less of the slopes there is along the motion than across it, as a factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Smear {
    lack: f64,
    standard_error: f64,
}

impl Smear {
    /// Slopes differ along the motion, one way or the other.
    pub(crate) fn is_clear(self) -> bool {
        self.lack.abs() > MOST_SMEAR && self.lack.abs() > SMEAR_ERRORS * self.standard_error
    }
}

/// Sums of one block: real times simulated slope and square of the simulated slope, along the motion and across it.
type Sums = [f64; 4];

/// See [`Smear`]; the error is the jackknife's over blocks. `velocity`: of the content, by frame, px/s; nothing where
/// too little can be seen.
pub(crate) fn smear(
    evidence: &Evidence,
    frames: &[usize],
    means: &[Plane<f32>],
    masks: &[Plane<f32>],
    velocity: &[Plane<f32>],
) -> Option<Smear> {
    let mut speeds: Vec<f32> =
        velocity.iter().flat_map(|v| v.data.chunks_exact(2).step_by(5)).map(|v| v[0].hypot(v[1])).collect();
    let at = speeds.len() * 9 / 10;
    let least = FAST * f64::from(*speeds.select_nth_unstable_by(at, f32::total_cmp).1);
    let mut blocks: Vec<Sums> = Vec::new();
    for (f, &at) in frames.iter().enumerate() {
        blocks.extend(of_frame(&evidence.frames[at].dn, &means[f], &masks[at], &velocity[f], least));
    }
    blocks.retain(|b| b[1] > 0.0 && b[3] > 0.0);
    if blocks.len() < FEWEST || least <= 0.0 {
        return None;
    }
    let all: Sums = blocks.iter().fold([0.0; 4], |s, b| std::array::from_fn(|i| s[i] + b[i]));
    let lack = |s: &Sums| s[2] / s[3].max(1e-9) - s[0] / s[1].max(1e-9);
    let n = blocks.len() as f64;
    let without: Vec<f64> = blocks.iter().map(|b| lack(&std::array::from_fn(|i| all[i] - b[i]))).collect();
    let mean = without.iter().sum::<f64>() / n;
    let variance = without.iter().map(|v| (v - mean).powi(2)).sum::<f64>() * (n - 1.0) / n;
    Some(Smear { lack: lack(&all), standard_error: variance.sqrt() })
}

/// Sums of the blocks of one frame.
fn of_frame(
    real: &Plane<f32>,
    mean: &Plane<f32>,
    mask: &Plane<f32>,
    velocity: &Plane<f32>,
    least_px_per_s: f64,
) -> Vec<Sums> {
    let (w, h) = (real.width, real.height);
    let across = w.div_ceil(BLOCK_PX);
    let mut blocks = vec![[0.0f64; 4]; across * h.div_ceil(BLOCK_PX)];
    for (x, y) in (1..h - 1).flat_map(|y| (1..w - 1).map(move |x| (x, y))) {
        let i = y * w + x;
        let v = velocity.pixel(x, y);
        let speed = v[0].hypot(v[1]);
        if f64::from(speed) < least_px_per_s || mask.data[i] <= 0.5 {
            continue;
        }
        let (ux, uy) = (v[0] / speed, v[1] / speed);
        let block = &mut blocks[y / BLOCK_PX * across + x / BLOCK_PX];
        for c in 0..3 {
            let k = 3 * i + c;
            let slopes = |p: &Plane<f32>| {
                let (gx, gy) = (p.data[k + 3] - p.data[k - 3], p.data[k + 3 * w] - p.data[k - 3 * w]);
                [f64::from(gx * ux + gy * uy), f64::from(gy * ux - gx * uy)]
            };
            let (r, m) = (slopes(real), slopes(mean));
            for side in 0..2 {
                block[2 * side] += r[side] * m[side];
                block[2 * side + 1] += m[side] * m[side];
            }
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spots, averaged over `blur` px along the rows, with noise.
    fn picture(blur: [usize; 2], seed: u32) -> Plane<f32> {
        let spot =
            |x: usize, y: usize| f32::from(u8::from((x / 5 * 7 + y / 4 * 5 + x * y / 97).is_multiple_of(3)));
        Plane::from_fn(160, 128, |x, y| {
            let count = (blur[0] * blur[1]) as f32;
            let sum: f32 = (0..blur[0])
                .flat_map(|i| (0..blur[1]).map(move |j| (i, j)))
                .map(|(i, j)| spot(x + i, y + j))
                .sum();
            [0u32, 1, 2].map(|c| {
                let uniform = shutterbug::chain::rng::random_uniform([x as u32, y as u32], c, seed, [3, 4]);
                let noise: f32 = uniform.iter().map(|u| u - 0.5).sum();
                (60.0 + 120.0 * sum / count + 8.0 * noise).round()
            })
        })
    }

    fn seen(real: Plane<f32>, velocity: [f32; 2]) -> Smear {
        let evidence = Evidence::of_one(real);
        let plain = picture([1, 1], 1);
        let mean = Plane::from_fn(160, 128, |x, y| {
            [0, 1, 2].map(|c| if plain.pixel(x, y)[c] > 120.0 { 180.0 } else { 60.0 })
        });
        let mask = Plane::from_fn(160, 128, |_, _| [1.0]);
        let velocity = Plane::from_fn(160, 128, |_, _| velocity);
        smear(&evidence, &[0], &[mean], &[mask], &[velocity]).expect("enough is seen")
    }

    #[test]
    fn a_blur_along_the_motion_is_told_and_one_in_all_directions_is_not() {
        let along = seen(picture([3, 1], 7), [300.0, 0.0]);
        assert!(along.is_clear() && along.lack > 0.1, "{along:?}");
        let across = seen(picture([3, 1], 7), [0.0, 300.0]);
        assert!(across.is_clear() && across.lack < 0.0, "the other way: {across:?}");
        for blur in [1, 2] {
            let none = seen(picture([blur, blur], 7), [300.0, 0.0]);
            assert!(!none.is_clear() && none.lack.abs() < 0.05, "control {blur}: {none:?}");
        }
    }
}
