//! What the best set leaves on held-out frames beyond what correct renderers leave: values that are off where the picture is
//! flat, spread that is of another kind than the model's, edges that do not match.

use super::evidence::Evidence;
use super::model::{P, Theta};
use super::noise::{NoiseData, flat_map};
use super::smear::Smear;
use super::tone::Tone;
use crate::plane::Plane;

/// Values of a bin below which its mean says nothing.
const FEWEST: f64 = 300.0;
/// Bins of brightness, of radius, of rows and of columns.
const BINS: usize = 12;

/// Figures of what is left.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Residue {
    /// Mean size of the mean difference of flat places, by brightness and channel, radius, rows and columns, frames: the
    /// largest of these, DN.
    pub bias_dn: f64,
    /// Mean size of the logarithm of observed over modelled variance, by brightness.
    pub spread: f64,
    /// Standard deviations of rows and of the fixed pattern that the model does not have, over that of single values.
    pub structure: [f64; 2],
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
}

/// Correlation of real and simulated pictures below which they show another scene.
const LEAST_LIKENESS: f64 = 0.3;

impl Residue {
    /// Whether the frames are of another scene.
    pub(super) fn shows_another_scene(&self) -> bool {
        self.likeness < LEAST_LIKENESS
    }
}

/// How far off a value is that cannot be chance, DN and standard deviations of its noise.
const FAR: [f32; 2] = [25.0, 8.0];
/// Fewest of them that mean anything.
const FEWEST_FAR: f64 = 6.0;

#[derive(Clone, Copy, Default)]
struct Bin {
    sum: f64,
    count: f64,
    /// Sums of the variances of noise that is new in every value, and of the pattern's, DN^2.
    noise2: [f64; 2],
}

/// Measures it. `means` are the simulated values of `frames` (places).
pub(super) fn residue(
    evidence: &Evidence,
    frames: &[usize],
    means: &[Plane<f32>],
    masks: &[Plane<f32>],
    noise: &NoiseData,
    theta: &Theta,
) -> Residue {
    let tone = Tone::new(theta);
    let mut tables = vec![vec![Bin::default(); BINS * 3]; 5];
    for (f, (&at, mean)) in frames.iter().zip(means).enumerate() {
        let (w, h) = (mean.width, mean.height);
        let flat = flat_map(mean);
        let diagonal = 0.5 * (w as f64).hypot(h as f64);
        for i in (0..w * h).filter(|&i| flat[i] && masks[at].data[i] > 0.5) {
            let (x, y) = (i % w, i / w);
            let radius = (x as f64 - 0.5 * w as f64).hypot(y as f64 - 0.5 * h as f64) / diagonal;
            for c in 0..3 {
                let (r, m) = (evidence.frames[at].dn.data[3 * i + c], mean.data[3 * i + c]);
                let places = [
                    (m / 256.0 * BINS as f32) as usize,
                    (radius * BINS as f64) as usize,
                    y * BINS / h,
                    x * BINS / w,
                    f,
                ];
                let v = tone.spread(m, c);
                for (table, place) in tables.iter_mut().zip(places) {
                    let bin = &mut table[3 * place.min(BINS - 1) + c];
                    bin.sum += f64::from(r - m);
                    bin.count += 1.0;
                    bin.noise2[0] += f64::from(v.free);
                    bin.noise2[1] += f64::from(v.fixed);
                }
            }
        }
    }
    let bias = |table: &Vec<Bin>| {
        let seen: Vec<&Bin> = table.iter().filter(|b| b.count >= FEWEST).collect();
        let total: f64 = seen.iter().map(|b| b.count).sum();
        // A pattern stays the same over the frames, and so does what it leaves in a mean.
        let chance = |b: &Bin| (b.noise2[0] + b.noise2[1] * frames.len() as f64).sqrt();
        seen.iter().map(|b| (b.sum.abs() - chance(b)).max(0.0)).sum::<f64>() / total.max(1.0)
    };
    let rows: f64 = means[0].data.iter().map(|m| f64::from(tone.spread(*m, 1).row.sqrt())).sum();
    let row_dn = rows / means[0].data.len() as f64;
    // Compression leaves differences of its own, which say nothing about noise.
    let (spread, structure) = if theta.is_on(P::Quality) { (0.0, [0.0; 2]) } else { noise.misfit(theta) };
    let mut likeness: Vec<f64> = frames
        .iter()
        .zip(means)
        .map(|(&at, m)| correlation(&evidence.frames[at].dn, m, &masks[at]))
        .collect();
    likeness.sort_by(f64::total_cmp);
    let likeness = likeness[likeness.len() / 2];
    // A row's noise moves all of the row: so much of it is left in the mean of some tens of rows.
    let bias_dn = (tables.iter().map(bias).fold(0.0, f64::max) - 0.3 * row_dn).max(0.0);
    Residue {
        bias_dn,
        spread,
        structure,
        outliers: 0.0,
        likeness,
        smear: Smear::default(),
        solved: 0.0,
        placed: 0.0,
    }
}

/// See [`Residue::outliers`]; behind compression nothing is told. `masks`: where the judge compares, stuck pixels among it.
pub(super) fn outliers(
    evidence: &Evidence,
    frames: &[usize],
    means: &[Plane<f32>],
    masks: Option<&[Plane<f32>]>,
    theta: &Theta,
) -> f64 {
    let tone = Tone::new(theta);
    let (mut far, mut all) = (0.0, 0.0);
    for (&at, mean) in frames.iter().zip(means).filter(|_| !theta.is_on(P::Quality)) {
        let flat = flat_map(mean);
        let open = |i: usize| masks.is_none_or(|m| m[at].data[i] > 0.5);
        for i in (0..flat.len()).filter(|&i| flat[i] && open(i)).flat_map(|i| 3 * i..3 * i + 3) {
            let v = tone.spread(mean.data[i], i % 3);
            let beyond = FAR[0].max(FAR[1] * (v.free + v.fixed + v.row).sqrt());
            far += f64::from(u8::from((evidence.frames[at].dn.data[i] - mean.data[i]).abs() > beyond));
            all += 1.0;
        }
    }
    if far >= FEWEST_FAR { far / all } else { 0.0 }
}

/// Side of the blocks of [`solved`], px.
const BLOCK_PX: usize = 8;
/// What may be left of the gap of a block that is solved.
const SOLVED: f64 = 0.15;

/// Share of the gap before that lies in blocks in which nearly nothing of it is left. An effect that is there explains the
/// places where nothing else acts altogether; one that only resembles what is there explains a part everywhere.
pub(super) fn solved(
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
                let v = tone.spread(pictures[1][f].data[c], c % 3);
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
    let pooled = |p: &Plane<f32>| super::fit::pooled(&p.data, p.width, p.height, LIKENESS_PX);
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
    if linear <= 0.003_130_8 { 255.0 * 12.92 } else { 255.0 * 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0) }
}

/// Mean logarithm of observed over modelled variance that two models of the same kind may have.
pub(super) const MOST_SPREAD: f64 = 0.35;
/// Standard deviation of rows and of a fixed pattern that the model does not have, over that of single values.
pub(super) const MOST_STRUCTURE: [f64; 2] = [0.35, 0.5];

impl NoiseData {
    /// See [`Residue::spread`] and [`Residue::structure`].
    pub(super) fn misfit(&self, theta: &Theta) -> (f64, [f64; 2]) {
        let (dsnu2, prnu2) = (theta.get(P::Dsnu).powi(2), theta.get(P::Prnu).powi(2));
        let (mut sum, mut count, mut level) = (0.0, 0.0, 0.0);
        for [l, v, _] in self.unclipped() {
            let model = theta.get(P::Read).powi(2) + l * theta.get(P::Shot) + dsnu2 + prnu2 * l * l;
            let least = ROUNDING_DN2 / slope_dn(l).powi(2);
            sum += ((v + least) / (model + least)).ln().abs();
            level += v;
            count += 1.0;
        }
        if count < 1.0 {
            return (0.0, [0.0; 2]);
        }
        let level: f64 = (level / count).max(8e-6);
        // What the model has of these it has to a third or so.
        let beyond = |seen: f64, model: f64| ((seen - model).abs() - 0.3 * model).max(0.0);
        let row2 = beyond(self.row2, theta.get(P::Row).powi(2));
        // Before a camera that hardly moves a value is rounded the same way in every frame.
        let rounding2 = |l: f64| ROUNDING_DN2 / slope_dn(l).powi(2);
        let fixed =
            self.fixed.iter().map(|&[l, v, _]| (beyond(v, dsnu2 + prnu2 * l * l) - rounding2(l)).max(0.0));
        let fixed2 = fixed.sum::<f64>() / self.fixed.len().max(1) as f64;
        (sum / count, [(row2 / level).sqrt(), (fixed2 / level).sqrt()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stuck_pixels_are_outliers_and_noise_is_none() {
        let mean = Plane::from_fn(96, 64, |x, _| [60.0 + 0.2 * x as f32; 3]);
        let noisy = |x: usize, y: usize, c: u32| {
            let bits = crate::chain::rng::random_bits([x as u32, y as u32], c, 9, [3, 4]);
            8.0 * bits.iter().map(|b| *b as f32 / u32::MAX as f32 - 0.5).sum::<f32>()
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
            outliers(&evidence, &[0], std::slice::from_ref(&mean), None, theta)
        };
        let share = seen(true, &theta);
        assert!((share * 92.0 * 60.0 - 16.0).abs() < 0.5, "16 of the pixels 2 px off the border: {share}");
        assert_eq!(seen(false, &theta), 0.0, "control: noise alone");
        assert_eq!(seen(true, &theta.with(P::Quality, 60.0)), 0.0, "nothing is told behind compression");
    }
}
