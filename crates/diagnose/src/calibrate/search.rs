//! Fits a camera to a measured pair, and simulates the pair with it.

use super::cells::cells;
use super::curve::{self, Point};
use super::fit;
use super::frames::{Encoding, Frame};
use super::model::{CameraModel, IspCamera, LUMA, at_knots};
use super::noise::{Comparison, Measured, NoiseOptions, compare, expected_sigma, mean_variance, measure};
use super::ptc::{self, Bin, Curve, Estimate, PtcFit};
use super::spatial::{column_noise, correlations, row_noise};
use super::statics::{AlignedPair, difference};
use super::tables::{ChainCamera, chain_settings};
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Rounds in which the simulation corrects the closed form.
const ROUNDS: usize = 4;

pub(super) fn fit_camera(
    pair: &AlignedPair,
    frame: &Frame,
    real: &Measured,
    options: NoiseOptions,
) -> Result<IspCamera> {
    let srgb = options.encoding == Encoding::Srgb;
    let electrons = |f: &PtcFit| f.full_well_e.value.clamp(10.0, 1e6);
    let line = real.fits[1].as_ref().or(real.fits[0].as_ref()).or(real.fits[2].as_ref());
    // Without a line, shot noise that gives the variance at its intensity.
    let total: f64 = real.curves[1].iter().filter(|b| !b.cut_off).map(|b| b.count * b.mean_linear).sum();
    let count: f64 = real.curves[1].iter().filter(|b| !b.cut_off).map(|b| b.count).sum();
    let plain = (total / count.max(1.0) / mean_variance(&real.curves[1]).max(1e-9)).clamp(10.0, 1e6);
    let row = Some(&real.row_sigma[1]).filter(|row| row.ci95[0] > 0.0).map_or(0.0, |row| row.value);
    // The line's constant part is that of pixels and of rows.
    let read = line.map_or(1e-3, |f| (f.read_sigma.value.powi(2) - row * row).max(0.0).sqrt());
    let mut camera = IspCamera::sensor(line.map_or(plain, electrons), read, srgb, f64::from(frame.step));
    camera.row_sigma = row;
    let measured = cells(&pair.mean(), &pair.difference(|v| v), &pair.usable);
    let targets = fit::targets(&measured);
    if is_sensor_alone(frame, real) || targets.len() < 3 {
        return Ok(camera);
    }
    camera = IspCamera {
        bayer: true,
        full_well_e: 2000.0,
        read_sigma: 0.005,
        white_balance: [1.5, 1.0, 1.5],
        color_matrix: [[1.5, -0.25, -0.25], [-0.25, 1.5, -0.25], [-0.25, -0.25, 1.5]],
        luma_sigma_px: 1.0,
        chroma_sigma_px: 2.0,
        saturation: if srgb { saturation(&pair.frames[0]) } else { 1.0 },
        chroma_step: frame.jpeg.map_or([1, 1], |j| j.chroma_step),
        jpeg_quality: frame.jpeg.map(|j| j.quality),
        ..camera
    };
    refit(&camera, pair, options, By::Model)
}

/// Whether neighbours have nothing in common but noise of rows and of columns, as behind a sensor without an ISP.
pub(super) fn is_sensor_alone(frame: &Frame, real: &Measured) -> bool {
    let is_white = |c: usize| {
        let of_lines = [&real.row_sigma, &real.column_sigma].map(|s| correlation_by(s[c], &real.curves[c]));
        let seen = [real.neighbours[c].horizontal, real.neighbours[c].vertical];
        seen.iter().zip(of_lines).all(|(seen, of_lines)| (seen - of_lines).abs() < 0.1)
    };
    (0..3).all(is_white) && frame.jpeg.is_none()
}

/// Correlation of a line's pixels by what they share: its mean share of the variance.
fn correlation_by(sigma: Estimate, bins: &[Bin]) -> f64 {
    let share = |b: &Bin| (sigma.value.powi(2) / b.variance_linear).clamp(0.0, 1.0);
    let seen = bins.iter().filter(|b| !b.cut_off && b.variance_linear > 0.0);
    let (all, sum) = seen.fold((0.0, 0.0), |(n, s), b| (n + b.count, s + b.count * share(b)));
    if all > 0.0 { sum / all } else { 0.0 }
}

/// Saturation of the ISP by its trace: behind the clipping at black a factor below 1 leaves no channel under 1 - factor
/// of the luma, so vivid colours pile up there. 1 where they do not.
fn saturation(encoded: &Plane<f32>) -> f64 {
    /// Least channel over luma, in hundredths.
    const PLACES: usize = 100;
    let mut counts = [0.0; PLACES];
    for p in encoded.data.chunks_exact(3) {
        let luma: f64 = (0..3).map(|c| LUMA[c] * f64::from(p[c])).sum();
        let (least, most) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
        // Clear of black's own noise, and of clipping at white.
        if luma > 0.15 && most < 0.98 {
            let place = (f64::from(least) / luma * PLACES as f64) as usize;
            counts[place.min(PLACES - 1)] += 1.0;
        }
    }
    let all: f64 = counts.iter().sum();
    let mut below = 0.0;
    // Where the lowest hundredth ends; noise and JPEG put a few lower.
    let floor = counts.iter().position(|n| {
        below += n;
        below > 0.01 * all
    });
    let Some(floor) = floor.filter(|f| (5..PLACES - 15).contains(f)) else { return 1.0 };
    let share = |from: usize| counts[from..from + 5].iter().sum::<f64>();
    let piled = share(floor) > 1.5 * share(floor + 7) && share(floor) > 0.02 * all;
    if piled { 1.0 - (floor as f64 + 0.5) / PLACES as f64 } else { 1.0 }
}

/// What makes the frames of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    /// The calibration's own simulation.
    Model,
    /// The engine's chain.
    Chain,
}

impl By {
    fn make(self, camera: &IspCamera) -> Result<Box<dyn CameraModel>> {
        Ok(match self {
            Self::Model => Box::new(camera.clone()),
            Self::Chain => Box::new(ChainCamera { settings: chain_settings(camera)? }),
        })
    }
}

/// Fits by the closed form, then corrects by what the simulation makes of it.
pub(super) fn refit(
    start: &IspCamera,
    pair: &AlignedPair,
    options: NoiseOptions,
    by: By,
) -> Result<IspCamera> {
    let measured = fit::targets(&cells(&pair.mean(), &pair.difference(|v| v), &pair.usable));
    let (mut camera, mut goal) = (start.clone(), measured.clone());
    for round in 0..ROUNDS {
        camera = fit::fit(&camera, &goal, round > 0);
        if round + 1 < ROUNDS {
            let frames = simulated_frames(&*by.make(&camera)?, pair, options, 0)?;
            let d = difference(&frames, &pair.usable, pair.registration.moved, |v| v);
            goal = fit::correct(&camera, &measured, &cells(&pair.mean(), &d, &pair.usable));
        }
    }
    Ok(camera)
}

/// A camera with its level curve, and what it is worth.
pub(super) struct Levelled {
    pub camera: IspCamera,
    pub simulated: Measured,
    pub shown: [Plane<f32>; 2],
    pub without: Comparison,
    pub held_out: Option<Comparison>,
}

/// Fits the curve of the noise reduction over intensity where the camera without it is off by more than chance.
pub(super) fn level(
    camera: IspCamera,
    pairs: &[AlignedPair],
    real: &Measured,
    step: f32,
    options: NoiseOptions,
    by: By,
) -> Result<Levelled> {
    let pair = &pairs[0];
    let (simulated, shown) = simulate(&*by.make(&camera)?, pair, step, options)?;
    let without = compare(real, &simulated);
    let good = without.within_10_percent_or_chance.iter().all(|share| !(*share <= 0.95));
    if good || !camera.bayer {
        return Ok(Levelled { camera, simulated, shown, without, held_out: None });
    }
    let half = |keep: usize| {
        let mut part = pair.clone();
        let width = pair.frames[0].width;
        let own = |i: usize| (i % width / HELD_OUT_PX + i / width / HELD_OUT_PX) % 2 == keep;
        part.usable.iter_mut().enumerate().for_each(|(i, u)| *u &= own(i));
        part
    };
    let (seen, unseen) = (half(0), half(1));
    let of_seen = with_level_gain(
        &camera,
        &seen,
        &measure(std::slice::from_ref(&seen), step, options.encoding),
        step,
        options,
        by,
    )?;
    let (there, _) = simulate(&*by.make(&of_seen)?, &unseen, step, options)?;
    let held_out = compare(&measure(std::slice::from_ref(&unseen), step, options.encoding), &there);
    let camera = with_level_gain(&camera, pair, real, step, options, by)?;
    let (simulated, shown) = simulate(&*by.make(&camera)?, pair, step, options)?;
    Ok(Levelled { camera, simulated, shown, without, held_out: Some(held_out) })
}

/// Side of the blocks that are held out in turn, px: far more than the noise is correlated over.
const HELD_OUT_PX: usize = 64;
/// Bins whose variance is known worse than this (95 %) give no knot.
const MAX_KNOT_CHANCE: f64 = 0.4;
/// Deviations of surfaces of the same brightness from each other, relative (measured on blocks held out).
const SURFACES: f64 = 0.03;

/// Rounds of [`with_level_gain`]: JPEG is not linear, and in the chain the factors move the light at which noise is
/// made.
const LEVEL_ROUNDS: usize = 9;
/// A round must bring the deviation down to this share of the least before.
const WORTH: f64 = 0.97;

/// The camera with the factors that bring its simulated curve to the real one.
pub(super) fn with_level_gain(
    camera: &IspCamera,
    pair: &AlignedPair,
    real: &Measured,
    step: f32,
    options: NoiseOptions,
    by: By,
) -> Result<IspCamera> {
    let mut levelled = camera.clone();
    let mut best: Option<(f64, IspCamera)> = None;
    let mut idle = 0;
    let mean = pair.mean();
    let places = places(camera, &mean, by);
    let there = |place: &Plane<f32>, frames: &Differences| {
        let curves = curves_over(place, frames, pair, step, options.encoding);
        // Neighbours do not change with the level: the real ones stand for them.
        Measured { curves, ..real.clone() }
    };
    // On the curve black is a place like others.
    let on_curve = |frames: &Differences| {
        let mut measured = there(&places, frames);
        measured.curves.iter_mut().flatten().for_each(|bin| bin.cut_off = false);
        measured
    };
    let wanted = on_curve(&[pair.difference(|v| v), pair.difference(|v| options.encoding.decode(v))]);
    for round in 0..=LEVEL_ROUNDS {
        let frames = simulated_differences(&*by.make(&levelled)?, pair, options)?;
        let compared = compare(real, &there(&mean, &frames));
        let off: f64 = compared.mean_deviation.iter().filter(|d| d.is_finite()).sum();
        // Little was gained three times: the rest is chance, and what a curve cannot do.
        idle = if best.as_ref().is_some_and(|(least, _)| off > WORTH * least) { idle + 1 } else { 0 };
        if best.as_ref().is_none_or(|(least, _)| off < *least) {
            best = Some((off, levelled.clone()));
        }
        if idle == 3 {
            break;
        }
        if round < LEVEL_ROUNDS {
            improve(&mut levelled, &compare(&wanted, &on_curve(&frames)).variance_ratio, by);
        }
    }
    Ok(best.map_or(levelled, |(_, camera)| camera))
}

/// Where on the curve of [`IspCamera::level_gain`] each value stands: the model's acts on delivered values, the chain's
/// on those ahead of the saturation, where vivid colours that pile up in the delivered ones are black.
fn places(camera: &IspCamera, mean: &Plane<f32>, by: By) -> Plane<f32> {
    let mut places = mean.clone();
    if by == By::Chain && camera.srgb && camera.saturation != 1.0 {
        for p in places.data.chunks_exact_mut(3) {
            let luma: f32 = (0..3).map(|c| LUMA[c] as f32 * p[c]).sum();
            p.iter_mut().for_each(|v| *v = (luma + (*v - luma) / camera.saturation as f32).clamp(0.0, 1.0));
        }
    }
    places
}

/// One step of the curve towards the measured variances.
fn improve(camera: &mut IspCamera, ratios: &[Vec<[f64; 3]>; 3], by: By) {
    let mut levels = Vec::new();
    let (low, high) = if by == By::Chain { CHAIN_RANGE } else { (0.3, 3.0) };
    for (knots, ratios) in camera.level_gain.iter_mut().zip(ratios) {
        let known = ratios.iter().filter(|r| r[2] < MAX_KNOT_CHANCE);
        // The factor is on the deviation, not on the variance; in steps, as the variance follows it only nearly.
        let points: Vec<Point> = known
            .map(|&[mean_dn, ratio, chance]| Point {
                at: mean_dn / 255.0,
                value: (-0.5 * ratio.max(1e-3).ln()).clamp(-0.3, 0.3),
                sigma: 0.25 * chance + SURFACES,
            })
            .collect();
        let level = if by == By::Chain { median(points.iter().map(|p| p.value)) } else { 0.0 };
        levels.push(level);
        let points: Vec<Point> = points.iter().map(|p| Point { value: p.value - level, ..*p }).collect();
        let Some(change) = curve::through(&points) else { continue };
        let new = change.iter().enumerate().map(|(i, change)| {
            let at = i as f64 / (curve::KNOTS - 1) as f64;
            let before = if knots.is_empty() { 1.0 } else { at_knots(knots, at) };
            [at, (before * change.exp()).clamp(low, high)]
        });
        *knots = new.collect();
    }
    if by == By::Chain {
        rescale(camera, &levels);
    }
}

/// Steepness in the chain: a steeper curve works with less light, whose noise black clips.
const CHAIN_RANGE: (f64, f64) = (0.3, 3.0);

/// In the chain the curve's factors are relative to each other: what all of a channel's have in common goes to the
/// light that makes a white pixel, where shot noise is (its deviation grows as the root of the gain behind it).
fn rescale(camera: &mut IspCamera, levels: &[f64]) {
    for knots in camera.level_gain.iter_mut().filter(|k| !k.is_empty()) {
        let mean = knots.iter().map(|k| 1.0 / k[1]).sum::<f64>() / knots.len() as f64;
        knots.iter_mut().for_each(|k| k[1] *= mean);
    }
    let factor = |c: usize| (2.0 * levels[c]).exp();
    camera.full_well_e = (camera.full_well_e / factor(1)).clamp(10.0, 1e6);
    for c in [0, 2] {
        camera.white_balance[c] = (camera.white_balance[c] * factor(c) / factor(1)).clamp(0.1, 10.0);
    }
}

/// Two frames of the pair's mean.
pub(super) fn simulated_frames(
    camera: &dyn CameraModel,
    pair: &AlignedPair,
    options: NoiseOptions,
    first: u32,
) -> Result<[Plane<f32>; 2]> {
    let mut clean = pair.mean();
    clean.data.iter_mut().for_each(|v| *v = options.encoding.decode(*v));
    Ok([camera.frame(&clean, first, options.seed)?, camera.frame(&clean, first + 1, options.seed)?])
}

/// Pairs that are simulated for the comparison: their own chance is then small beside the real pair's.
const SIMULATED_PAIRS: u32 = 2;

/// Differences of a pair, of encoded and of linear values.
type Differences = [Plane<f32>; 2];

/// Those of one simulated pair.
fn simulated_differences(
    camera: &dyn CameraModel,
    pair: &AlignedPair,
    options: NoiseOptions,
) -> Result<Differences> {
    let frames = simulated_frames(camera, pair, options, 1000)?;
    let of = |decode: &dyn Fn(f32) -> f32| difference(&frames, &pair.usable, pair.registration.moved, decode);
    Ok([of(&|v| v), of(&|v| options.encoding.decode(v))])
}

/// Photon transfer curves of R, G, B, in bins of `place`.
fn curves_over(
    place: &Plane<f32>,
    [encoded, linear]: &Differences,
    pair: &AlignedPair,
    step: f32,
    encoding: Encoding,
) -> [Vec<ptc::Bin>; 3] {
    [0, 1, 2].map(|c| {
        let mut curve = Curve::default();
        curve.add(place, [encoded, linear], &pair.usable, c, encoding);
        curve.bins(step, encoding)
    })
}

/// Measures simulated pairs as the real one, at the same pixels and in the same bins.
pub(super) fn simulate(
    camera: &dyn CameraModel,
    pair: &AlignedPair,
    step: f32,
    options: NoiseOptions,
) -> Result<(Measured, [Plane<f32>; 2])> {
    let mean = pair.mean();
    let mut curves = [Curve::default(), Curve::default(), Curve::default()];
    let mut first = None;
    let moved = pair.registration.moved;
    for k in 0..SIMULATED_PAIRS {
        let frames = simulated_frames(camera, pair, options, 1000 + 2 * k)?;
        let encoded = difference(&frames, &pair.usable, moved, |v| v);
        let linear = difference(&frames, &pair.usable, moved, |v| options.encoding.decode(v));
        for (c, curve) in curves.iter_mut().enumerate() {
            curve.add(&mean, [&encoded, &linear], &pair.usable, c, options.encoding);
        }
        first = first.or(Some((frames, encoded, linear)));
    }
    let (frames, encoded, linear) = first.expect("at least one pair is simulated");
    let curves = curves.map(|c| c.bins(step, options.encoding));
    let (sigma, whole) = expected_sigma(&mean, &curves, &pair.usable);
    let (neighbours, channels) = correlations(&encoded, &sigma, &whole);
    let fits = [0, 1, 2].map(|c| ptc::fit(&curves[c], neighbours[c].effective_pixels));
    let measured = Measured {
        fits,
        row_sigma: row_noise(&linear, &pair.usable),
        column_sigma: column_noise(&linear, &pair.usable),
        curves,
        neighbours,
        channels,
    };
    Ok((measured, frames))
}
