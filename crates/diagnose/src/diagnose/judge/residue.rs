//! What the best set leaves on the frames to report by beyond what correct renderers leave: spread that is of another
//! kind than the model's, values that are far off, edges that do not match.

use super::noise::{BIN_ERROR, NoiseData, chance2, flat_map};
use super::smear::Smear;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::description::by_value::ByValue;
use crate::diagnose::expect::discrepancy::{COLOUR_DN, REACH};
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::Tone;
use shutterbug::plane::{Plane, srgb_slope};

/// Figures of what is left.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Residue {
    /// See [`NoiseData::misfit`].
    pub noise: [f64; 3],
    /// Share of the flat places where single values are far off: stuck pixels, bits that were lost, dirt.
    pub outliers: f64,
    /// Correlation of real and simulated pictures, averaged over blocks: what has none shows another scene.
    pub likeness: f64,
    /// Slopes that are missing along the motion.
    pub smear: Smear,
    /// Share of the gap that lies where it is closed altogether, see [`solved`].
    pub solved: f64,
    /// Share of what is out of place that is put in its place, see [`super::placed`].
    pub placed: f64,
    /// Whether the factors of surfaces, if there are any, may be a change of values.
    pub by_value: ByValue,
}

/// Correlation of real and simulated pictures below which they show another scene.
const LEAST_LIKENESS: f64 = 0.3;

impl Residue {
    /// Of frames that there was no time for: nothing is said of them, not even that they show another scene.
    pub(crate) fn unseen() -> Self {
        Self { likeness: 1.0, ..Self::default() }
    }

    /// Whether the frames are of another scene.
    pub(crate) fn shows_another_scene(&self) -> bool {
        self.likeness < LEAST_LIKENESS
    }
}

/// How far off a value is that cannot be chance, DN and standard deviations of its noise.
const FAR: [f32; 2] = [25.0, 8.0];
/// Fewest of them that mean anything.
const FEWEST_FAR: f64 = 6.0;

/// Measures it. `means` are the simulated values of `frames` (places).
pub(crate) fn residue(
    evidence: &Evidence,
    frames: &[usize],
    means: &[Plane<f32>],
    masks: &[Plane<f32>],
    noise: &NoiseData,
    theta: &Theta,
) -> Residue {
    // Compression leaves differences of its own, which say nothing about noise.
    let noise = if theta.is_on(P::Quality) { [0.0; 3] } else { noise.misfit(theta) };
    let mut likeness: Vec<f64> = frames
        .iter()
        .zip(means)
        .map(|(&at, m)| correlation(&evidence.frames[at].dn, m, &masks[at]))
        .collect();
    likeness.sort_by(f64::total_cmp);
    let likeness = likeness[likeness.len() / 2];
    Residue { noise, likeness, ..Residue::default() }
}

/// See [`Residue::outliers`]; behind compression nothing is told. `masks`: where the judge compares, stuck pixels among
/// it. `alone`: only values whose neighbours are not far off count, since what pictures do not show comes in patches.
pub(crate) fn outliers(
    evidence: &Evidence,
    frames: &[usize],
    means: &[Plane<f32>],
    masks: Option<&[Plane<f32>]>,
    theta: &Theta,
    alone: bool,
) -> f64 {
    let tone = Tone::new(theta);
    let (mut far, mut all) = (0.0, 0.0);
    for (&at, mean) in frames.iter().zip(means).filter(|_| !theta.is_on(P::Quality)) {
        let flat = flat_map(mean);
        let open = |i: usize| masks.is_none_or(|m| m[at].data[i] > 0.5);
        let is_far = |i: usize| {
            let v = tone.spread_of(&mean.data[i - i % 3..i - i % 3 + 3], i % 3);
            let beyond = FAR[0].max(FAR[1] * (v.free + v.fixed + v.row).sqrt());
            (evidence.frames[at].dn.data[i] - mean.data[i]).abs() > beyond
        };
        // Flat places are not at the picture's border.
        let row = 3 * mean.width;
        let is_single = |i: usize| [i - 3, i + 3, i - row, i + row].iter().all(|&n| !is_far(n));
        for i in (0..flat.len()).filter(|&i| flat[i] && open(i)).flat_map(|i| 3 * i..3 * i + 3) {
            far += f64::from(u8::from(is_far(i) && (!alone || is_single(i))));
            all += 1.0;
        }
    }
    if far >= FEWEST_FAR { far / all } else { 0.0 }
}

/// Side of the blocks of [`solved`], px.
const BLOCK_PX: usize = 8;
/// What may be left of the gap of a block that is solved.
const SOLVED: f64 = 0.15;

/// Share of the gap before that lies in blocks in which nearly nothing of it is left. An effect that is there explains
/// the places where nothing else acts altogether; one that only resembles what is there explains a part everywhere.
pub(crate) fn solved(
    evidence: &Evidence,
    frames: &[usize],
    pictures: [&[Plane<f32>]; 2],
    masks: &[Plane<f32>],
    theta: &Theta,
) -> f64 {
    let tone = Tone::new(theta);
    let (mut all, mut gone) = (0.0, 0.0);
    for (f, &at) in frames.iter().enumerate() {
        let real = &evidence.frames[at].dn;
        let across = real.width.div_ceil(BLOCK_PX);
        let mut blocks = vec![[0.0f64; 2]; across * real.height.div_ceil(BLOCK_PX)];
        for i in (0..real.width * real.height).filter(|&i| masks[at].data[i] > 0.5) {
            let block = &mut blocks[i / real.width / BLOCK_PX * across + i % real.width / BLOCK_PX];
            for c in 3 * i..3 * i + 3 {
                let v = tone.spread_of(&pictures[1][f].data[3 * i..3 * i + 3], c % 3);
                // Rounding and the mean size of the noise are no gap.
                let chance = 0.5 + 0.8 * (v.free + v.row + v.fixed).sqrt();
                for (sum, picture) in block.iter_mut().zip(pictures) {
                    *sum += f64::from((real.data[c] - picture[f].data[c]).abs() - chance);
                }
            }
        }
        for [before, after] in blocks {
            all += before.max(0.0);
            gone += if after < SOLVED * before { before.max(0.0) } else { 0.0 };
        }
    }
    gone / f64::max(all, 1e-9)
}

/// Side of the blocks of [`correlation`], px.
const LIKENESS_PX: usize = 4;

/// Correlation of two pictures averaged over blocks that are compared, each channel about its mean.
fn correlation(a: &Plane<f32>, b: &Plane<f32>, mask: &Plane<f32>) -> f64 {
    let pooled =
        |p: &Plane<f32>| crate::diagnose::evidence::blocks::pooled(&p.data, p.width, p.height, LIKENESS_PX);
    let across = a.width / LIKENESS_PX;
    let open = |block: usize| {
        let (x, y) = (LIKENESS_PX * (block % across), LIKENESS_PX * (block / across));
        (0..LIKENESS_PX * LIKENESS_PX).all(|i| mask.pixel(x + i % LIKENESS_PX, y + i / LIKENESS_PX)[0] > 0.5)
    };
    let [a, b] = [a, b].map(pooled);
    let mut sums = [0.0f64; 3];
    for c in 0..3 {
        let of = |v: &[f32]| -> Vec<f64> {
            let blocks = v.chunks_exact(3).enumerate().filter(|(block, _)| open(*block));
            blocks.map(|(_, v)| f64::from(v[c])).collect()
        };
        let (x, y) = (of(&a), of(&b));
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
        let (mx, my) = (mean(&x), mean(&y));
        for (x, y) in x.iter().zip(&y) {
            let (x, y) = (x - mx, y - my);
            sums = [sums[0] + x * y, sums[1] + x * x, sums[2] + y * y];
        }
    }
    sums[0] / (sums[1] * sums[2]).sqrt().max(1e-9)
}

/// Variance that says nothing, DN^2: quartiles of whole DN are off by up to half a DN to each side.
const ROUNDING_DN2: f64 = 0.5;

/// Slope of the sRGB curve, DN per unit.
fn slope_dn(linear: f64) -> f64 {
    255.0 * srgb_slope(linear)
}

/// Level of brightness at which what renderers make of a row is counted.
const MIDDLE: f64 = 0.2;

impl NoiseData {
    /// How far what is seen of single values, of rows and of the fixed pattern lies from the model, in standard errors
    /// that hold what measuring, rounding and the discrepancy make of it: means over bins of brightness.
    pub(crate) fn misfit(&self, theta: &Theta) -> [f64; 3] {
        let (dsnu2, prnu2) = (theta.get(P::Dsnu).powi(2), theta.get(P::Prnu).powi(2));
        // Quartiles of whole DN are off by up to half a DN; before a camera that hardly moves a value is rounded the
        // same way in every frame.
        let rounding2 = |l: f64| ROUNDING_DN2 / slope_dn(l).powi(2);
        // `besides`: variance that the figure has of other noise.
        let standard = |seen: f64, model: f64, n: f64, l: f64, besides: f64| {
            let level2 = seen.max(model).powi(2) * ((REACH * BIN_ERROR).powi(2) + chance2(n));
            (seen - model) / (level2 + rounding2(l).powi(2) + besides).sqrt()
        };
        let mean = |z: Vec<f64>| z.iter().map(|z| z.abs()).sum::<f64>() / z.len().max(1) as f64;
        let singles = self.unclipped().into_iter().map(|[l, v, n]| {
            let model = theta.get(P::Read).powi(2) + l * theta.get(P::Shot) + dsnu2 + prnu2 * l * l;
            standard(v, model, n, l, 0.0)
        });
        // What single frames have not is no pattern: renderers differ so where places stay in sight.
        let spread = |l: f64| {
            let near = self.total.iter().min_by(|a, b| (a[0] - l).abs().total_cmp(&(b[0] - l).abs()));
            near.map_or(f64::INFINITY, |bin| bin[1])
        };
        let pattern = self
            .fixed
            .iter()
            .map(|&[l, v, n, free2]| standard(v.min(spread(l)), dsnu2 + prnu2 * l * l, n, l, free2));
        let row2 = theta.get(P::Row).powi(2);
        let colours2 = (REACH * COLOUR_DN / slope_dn(MIDDLE)).powi(2);
        // The model's own noise of rows was measured on as many rows.
        let error2 = 2.0 * self.row_error2 + (REACH * BIN_ERROR * row2).powi(2) + colours2.powi(2);
        [
            mean(singles.collect()),
            (self.row2 - row2).abs() / error2.max(1e-24).sqrt(),
            mean(pattern.collect()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stuck_pixels_are_outliers_and_noise_is_none() {
        let mean = Plane::from_fn(96, 64, |x, _| [60.0 + 0.2 * x as f32; 3]);
        let noisy = |x: usize, y: usize, c: u32| {
            let uniform = shutterbug::chain::rng::random_uniform([x as u32, y as u32], c, 9, [3, 4]);
            8.0 * uniform.iter().map(|u| u - 0.5).sum::<f32>()
        };
        let real = |stuck: bool| {
            Plane::from_fn(96, 64, |x, y| {
                let there = stuck && x % 24 == 7 && y % 16 == 5;
                [0, 1, 2].map(|c| if there { 255.0 } else { mean.pixel(x, y)[0] + noisy(x, y, c) })
            })
        };
        let sigma = 8.0 * (4.0f64 / 12.0).sqrt() / slope_dn(0.05);
        let theta = Theta::neutral().with(P::Read, sigma);
        let seen = |stuck: bool, theta: &Theta| {
            let evidence = Evidence::of_one(real(stuck));
            outliers(&evidence, &[0], std::slice::from_ref(&mean), None, theta, false)
        };
        let share = seen(true, &theta);
        assert!((share * 92.0 * 60.0 - 16.0).abs() < 0.5, "16 of the pixels 2 px off the border: {share}");
        assert_eq!(seen(false, &theta), 0.0, "control: noise alone");
        assert_eq!(seen(true, &theta.with(P::Quality, 60.0)), 0.0, "nothing is told behind compression");
    }
}
