//! Whether frames have been through JPEG, told from the frames alone: what has, has coefficients at multiples of the
//! steps of its quality, whatever the picture shows and however noisy it was before (Fan and de Queiroz 2003). Noise
//! hides what compression does to a simulated picture, and compression removes noise that the simulation expects; this
//! tells of neither.

use rayon::prelude::*;

use crate::diagnose::dct::{AREA, Dct, SIDE, luma_block, steps};
use crate::diagnose::evidence::{Evidence, spread_out};
use shutterbug::plane::stats::FRAC_1_SQRT_TAU;

/// Frames that are looked at.
const FRAMES: usize = 4;
/// Standard deviation of a coefficient about its multiple where all pixels of a block are rounded independently:
/// brightness and the three colours are rounded to whole DN.
const ROUNDING: f32 = 0.4;
/// Least step that shows beside that rounding.
const LEAST_STEP: f32 = 3.0;
/// Multiples of a step that are told apart, to either side of 0: a coefficient is 1024 at most.
const MULTIPLES: usize = 2 * 1024 / LEAST_STEP as usize + 3;
/// Share of the coefficients that lie anywhere (clipped colours that the decoder has bent).
const ANYWHERE: f32 = 0.1;
/// Least evidence for a quality, nats: of all coefficients that differ, and of each.
const LEAST_NATS: [f32; 2] = [50.0, 0.25];

/// Qualities of compression that are asked of: the steps of finer ones do not show.
const QUALITIES: std::ops::RangeInclusive<u8> = 5..=97;

/// What coefficients tell of compression.
#[derive(Clone, Debug, Default)]
pub(crate) struct Told {
    /// The quality of the compression that frames have behind them; none if they have none of these.
    pub quality: Option<u8>,
    /// Qualities that they have not behind them: coefficients lie between the multiples of their steps.
    pub refuted: Vec<u8>,
}

/// What frames (places) tell of compression.
pub(crate) fn told(evidence: &Evidence, frames: &[usize]) -> Told {
    let some = spread_out(frames, FRAMES);
    let blocks: Vec<Block> = some.iter().flat_map(|&at| of_frame(&evidence.frames[at].dn)).collect();
    let of = |quality: u8| (quality, evidence_for(&blocks, &steps(quality, false)));
    let sums: Vec<(u8, Sums)> = QUALITIES.into_par_iter().map(of).collect();
    let clear = |s: &Sums, sign: f32| {
        let apart = sign * s.apart;
        apart > LEAST_NATS[0] && apart > LEAST_NATS[1] * s.places && sign * s.all > 0.0
    };
    let best = sums.iter().filter(|(_, s)| clear(s, 1.0));
    let best = best.reduce(|best, other| if other.1.all > best.1.all { other } else { best });
    let refuted: Vec<u8> = sums.iter().filter(|(_, s)| clear(s, -1.0)).map(|(quality, _)| *quality).collect();
    let said = best.map(|(quality, sums)| (sums.all, *quality));
    tracing::debug!(
        "compression: {said:?} (nats, quality) from {} blocks, {} qualities refuted",
        blocks.len(),
        refuted.len()
    );
    Told { quality: said.map(|s| s.1), refuted }
}

/// A block of a frame.
struct Block {
    /// Coefficients of its brightness.
    coefficients: [f32; AREA],
    /// How many times `ROUNDING` they are off.
    spread: f32,
}

impl Block {
    /// Equal pixels are rounded alike: a flat block has one rounding instead of 64, and all of it is in the mean, which
    /// is off by eight times as much. A shade along x has eight roundings.
    ///
    /// Measured: a compression of 31 of walls without noise was refuted, for a mean was off by 2.7 and the next
    /// coefficient by 1.
    fn of(luma: [f32; AREA], dct: &Dct) -> Self {
        let at = |x: usize, y: usize| luma[y * SIDE + x];
        let across = |i: usize, j: usize| at(j, i) != at(j - 1, i);
        let down = |i: usize, j: usize| at(i, j) != at(i, j - 1);
        let roundings = runs(across) * runs(down);
        Self { coefficients: dct.forward(&luma), spread: (AREA as f32 / roundings).sqrt() }
    }
}

/// Runs of equal pixels in a line of a block, on average.
fn runs(differs: impl Fn(usize, usize) -> bool) -> f32 {
    let pairs = (0..SIDE).flat_map(|i| (1..SIDE).map(move |j| (i, j)));
    1.0 + pairs.filter(|&(i, j)| differs(i, j)).count() as f32 / SIDE as f32
}

/// All whole blocks that nothing has clipped.
fn of_frame(dn: &shutterbug::plane::Plane<f32>) -> Vec<Block> {
    let dct = Dct::new();
    let mut out = Vec::new();
    for y0 in (0..dn.height / SIDE * SIDE).step_by(SIDE) {
        for x0 in (0..dn.width / SIDE * SIDE).step_by(SIDE) {
            let pixel = |i: usize| dn.pixel(x0 + i % SIDE, y0 + i / SIDE);
            if (0..AREA).all(|i| pixel(i).iter().all(|v| (1.0..255.0).contains(v))) {
                out.push(Block::of(luma_block(dn, [x0, y0]), &dct));
            }
        }
    }
    out
}

/// Evidence, nats.
struct Sums {
    /// Of all coefficients.
    all: f32,
    /// Of coefficients that differ: those of one frequency about the same multiple count once, by their mean.
    apart: f32,
    /// Number of these.
    places: f32,
}

/// Logarithm of how much likelier coefficients are with these steps than without. Only those beyond the first half step
/// count: smooth pictures have small coefficients without any compression. A wall of one colour is one witness, however
/// many blocks it fills: three solid colours whose means lay near multiples of a coarse step were 9000 nats for a
/// quality of 5.
fn evidence_for(blocks: &[Block], steps: &[f32; AREA]) -> Sums {
    let mut by_place = vec![(0.0f64, 0.0f64); AREA * MULTIPLES];
    for block in blocks {
        for (i, (c, step)) in block.coefficients.iter().zip(steps).enumerate() {
            if *step >= LEAST_STEP * block.spread && c.abs() > 0.5 * step {
                let multiple = (c / step).round();
                let sigma = ROUNDING * block.spread;
                let off = (c - step * multiple) / sigma;
                let at = (-0.5 * off * off).exp() * FRAC_1_SQRT_TAU as f32 / sigma * step;
                let multiple = (multiple as i32 + MULTIPLES as i32 / 2).clamp(0, MULTIPLES as i32 - 1);
                let (sum, count) = &mut by_place[i * MULTIPLES + multiple as usize];
                *sum += f64::from(((1.0 - ANYWHERE) * at + ANYWHERE).ln());
                *count += 1.0;
            }
        }
    }
    let seen = || by_place.iter().filter(|p| p.1 > 0.0);
    let all: f64 = seen().map(|p| p.0).sum();
    let apart: f64 = seen().map(|p| p.0 / p.1).sum();
    Sums { all: all as f32, apart: apart as f32, places: seen().count() as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_uniform;
    use shutterbug::plane::Plane;

    /// Edges and noise, rounded.
    fn picture(sigma: f32) -> Plane<f32> {
        Plane::from_fn(96, 64, |x, y| {
            [0u32, 1, 2].map(|c| {
                let uniform = random_uniform([x as u32, y as u32], c, 9, [3, 4]);
                let noise: f32 = uniform.iter().map(|u| u - 0.5).sum();
                let v = 60.0 + 25.0 * ((x / 9 + y / 7) % 5) as f32 + 0.3 * x as f32;
                (v + 1.73 * sigma * noise).round()
            })
        })
    }

    fn told(dn: &Plane<f32>) -> Option<u8> {
        super::told(&Evidence::of_one(dn.clone()), &[0]).quality
    }

    fn refuted(dn: &Plane<f32>) -> Vec<u8> {
        super::told(&Evidence::of_one(dn.clone()), &[0]).refuted
    }

    #[test]
    fn what_was_not_compressed_refutes_compression_and_what_was_does_not() {
        for sigma in [0.0, 3.0, 10.0] {
            let plain = picture(sigma);
            let against = refuted(&plain);
            let wanted = [30, 62, 82, 92];
            assert!(wanted.iter().all(|q| against.contains(q)), "noise of {sigma} DN: {against:?}");
            for quality in wanted {
                let packed = shutterbug::effects::jpeg::compressed(&plain, quality);
                assert!(!refuted(&packed).contains(&quality), "control: noise of {sigma} DN, {quality}");
            }
        }
        assert!(refuted(&Plane::from_fn(96, 64, |_, _| [90.0; 3])).is_empty(), "a wall tells nothing");
    }

    #[test]
    fn walls_without_noise_tell_of_the_compression_that_they_have_been_through() {
        let wall = |x: usize, y: usize, c: u32| {
            30.0 + 180.0 * random_uniform([(x / 20) as u32, (y / 24) as u32], c, 9, [7, 8])[0]
                + 0.05 * x as f32
        };
        let walls = Plane::from_fn(320, 240, |x, y| [0u32, 1, 2].map(|c| wall(x, y, c).round()));
        for quality in [31, 60, 85] {
            let packed = shutterbug::effects::jpeg::compressed(&walls, quality);
            // The steps of 85 are too fine for flat blocks: they neither tell of it nor refute it.
            assert_eq!(told(&packed), Some(quality).filter(|q| *q < 85));
            assert!(!refuted(&packed).contains(&quality), "{quality}");
        }
        assert_eq!(told(&walls), None, "control");
    }

    #[test]
    fn a_quality_is_told_with_noise_and_without_and_none_where_there_is_none() {
        for sigma in [0.0, 3.0, 10.0] {
            let plain = picture(sigma);
            assert_eq!(told(&plain), None, "control: noise of {sigma} DN");
            for quality in [30, 62, 82] {
                let packed = shutterbug::effects::jpeg::compressed(&plain, quality);
                assert_eq!(told(&packed), Some(quality), "noise of {sigma} DN");
            }
        }
    }

    #[test]
    fn a_few_solid_colours_near_multiples_of_a_step_are_no_compression() {
        // Sixteen times 160, 320 and -160, the multiples of the step of the mean at a quality of 5.
        let dn = Plane::from_fn(160, 120, |x, y| [[148.0, 168.0, 108.0][(x / 64 + y / 48) % 3]; 3]);
        let evidence = Evidence::of_one(dn.clone());
        let all = of_frame(&evidence.frames[0].dn);
        assert!(evidence_for(&all, &steps(5, false)).all > 500.0, "control: every block speaks for it");
        assert_eq!(told(&dn), None);
    }
}
