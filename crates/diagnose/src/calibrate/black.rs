//! A black level that nobody took off. Light's noise is none where light is: a line through variance over intensity
//! that meets none above black does so because black lies there. Read noise brings the line back up, so that the line
//! gives the least that the black level is; the darkest values give the most.

use super::frames::{Encoding, Frame};
use super::noise::Measured;
use super::own::beyond;
use super::ptc::{self, Bin, Estimate, PtcFit};
use super::rounding;
use shutterbug::error::{Error, Result};

/// How often a black level may be seen where there is none, in all channels together.
const ALPHA: f64 = 0.01;

/// The black level of linear values, between the least and the most that it can be; `None` where nothing tells of one.
/// `step`: the distance of two encoded values.
pub(super) fn told(real: &Measured, step: f32, encoding: Encoding) -> Option<Estimate> {
    let clear = beyond(ALPHA / 3.0);
    let mut least: Option<f64> = None;
    for c in 0..3 {
        let Some(fit) = real.fits[c].as_ref().filter(|f| f.linear && f.slope.ci95[0] > 0.0) else { continue };
        let rounded = |b: &Bin| most_rounded(b, step, encoding);
        // The line may bend by less than is seen: what a bent one has at black is known less well.
        let effective = real.neighbours[c].effective_pixels;
        let Some([value, sigma]) = ptc::at_black(&real.curves[c], effective, rounded) else { continue };
        if value + clear * sigma < 0.0 && fit.intercept.ci95[1] < 0.0 {
            let meets = -fit.intercept.ci95[1] / fit.slope.ci95[1];
            least = Some(least.map_or(meets, |l| l.min(meets)));
        }
    }
    let (low, high) = (least?, most(real));
    (low < high).then_some(Estimate { value: 0.5 * (low + high), ci95: [low, high] })
}

/// What rounding may take from the variance of a bin, linear.
fn most_rounded(bin: &Bin, step: f32, encoding: Encoding) -> f64 {
    let step = f64::from(step);
    let taken = rounding::most_of_variance(bin.variance_dn2 / (255.0 * 255.0), step);
    taken / encoding.slope(bin.mean_linear).powi(2)
}

/// The most that a black level can be: no surface is darker than it. The darkest bin may be the lower tail of what a
/// darker surface's noise makes.
fn most(real: &Measured) -> f64 {
    let of = |bins: &Vec<Bin>| {
        let all: f64 = bins.iter().map(|b| b.count).sum();
        let bound =
            |b: &Bin| b.mean_linear + beyond(b.count / all) * (0.5 * b.variance_linear.max(0.0)).sqrt();
        bins.iter().map(bound).fold(f64::INFINITY, f64::min)
    };
    real.curves.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Refuses a black level that the values contradict.
///
/// # Errors
/// One above the darkest values, or of which the noise says that it is more.
pub(super) fn check_given(
    black: f64,
    frames: &[Frame],
    real: &Measured,
    rest: Option<Estimate>,
) -> Result<()> {
    let refuse = |found: String| {
        let expected = format!("values with the black level of --camera, {black:.4} of white");
        Err(Error::input(&frames[0].path, None, found, expected))
    };
    let darkest = black + (1.0 - black) * most(real);
    match rest {
        Some(rest) => refuse(format!(
            "noise that is none at {:.4} of white: a black level of that or more",
            black + (1.0 - black) * rest.ci95[0]
        )),
        None if darkest < black => refuse(format!("values down to {darkest:.4} of white")),
        None => Ok(()),
    }
}

/// The frames without a black level (linear). Encoded values below it are no numbers of the encoding: they are cut off
/// at black, and so is their noise, which the curves leave out.
pub(super) fn taken_off(frames: &[Frame], black: f64, encoding: Encoding) -> Vec<Frame> {
    let scale = 1.0 / (1.0 - black as f32);
    let without = |v: &f32| encoding.encode((encoding.decode(*v) - black as f32) * scale);
    frames
        .iter()
        .map(|frame| {
            let mut frame = frame.clone();
            frame.encoded.data = frame.encoded.data.iter().map(without).collect();
            if encoding == Encoding::Linear {
                frame.step *= scale;
            }
            frame
        })
        .collect()
}

/// Lines through values of which `black.value` was taken off, with what the rest of its interval does to them.
pub(super) fn widen(fits: &mut [Option<PtcFit>; 3], black: &Estimate) {
    // The rest of it, of what is left between black and white.
    let [low, high] = black.ci95.map(|b| (b - black.value) / (1.0 - black.value));
    for fit in fits.iter_mut().flatten() {
        let [least, most] = fit.full_well_e.ci95;
        fit.full_well_e.ci95 = [least * (1.0 - high), most * (1.0 - low)];
        let [a, b] = fit.intercept.ci95;
        fit.intercept.ci95 = [a + fit.slope.ci95[1] * low, b + fit.slope.ci95[1] * high];
        fit.read_sigma.ci95 = fit.intercept.ci95.map(|v| v.max(0.0).sqrt());
    }
}

/// Said of one that was told.
pub(super) fn note(black: &Estimate) -> String {
    let Estimate { value, ci95: [low, high] } = black;
    format!(
        "the values have a black level: light has no noise at {low:.4} of white, and the darkest values are at \
         {high:.4}. Half way, {value:.4}, was taken off and is [black_level] in camera.toml; the intervals of full \
         well and read noise hold all between. To know it, film with the cap on: `calibrate flat --dark` writes it, \
         and --camera gives it here"
    )
}

#[cfg(test)]
mod tests {
    use super::super::model::{CameraModel, IspCamera};
    use super::super::noise::measure_all;
    use super::*;
    use shutterbug::plane::Plane;

    /// Frames of a ramp with a black level.
    fn frames(read_sigma: f64, black: f32, bits: i32, seed: u64) -> Vec<Frame> {
        let camera = IspCamera::sensor(3000.0, read_sigma, false, 0.0);
        let clean = Plane::from_fn(320, 240, |x, _| [0.016 + 0.8 * x as f32 / 320.0; 3]);
        let step = 1.0 / (2f32.powi(bits) - 1.0);
        (0..2)
            .map(|k| {
                let mut picture = camera.frame(&clean, k, seed).expect("a frame");
                let seen = |v: f32| ((black + (1.0 - black) * v) / step).round() * step;
                picture.data.iter_mut().for_each(|v| *v = seen(*v));
                Frame::from_plane(&format!("frame {k}"), picture, step)
            })
            .collect()
    }

    fn told_of(frames: &[Frame]) -> Option<Estimate> {
        let (real, _, _) = measure_all(frames, Encoding::Linear).expect("measured");
        told(&real, frames[0].step, Encoding::Linear)
    }

    #[test]
    fn a_black_level_is_told_and_none_where_there_is_none() {
        let black = told_of(&frames(0.004, 0.0625, 16, 1)).expect("told");
        assert!(black.covers(0.0625) && black.ci95[0] > 0.005 && black.ci95[1] < 0.1, "{black:?}");
        // Controls: a sensor with next to no read noise, and one whose noise 6 bits do not hold at its darkest.
        let false_ones = (0..16).filter(|seed| told_of(&frames(1e-4, 0.0, 16, *seed)).is_some()).count();
        assert!(false_ones <= 1, "{false_ones} of 16");
        let coarse = (0..4).filter(|seed| told_of(&frames(0.002, 0.0, 6, *seed)).is_some()).count();
        assert_eq!(coarse, 0);
    }

    #[test]
    fn what_was_taken_off_leaves_the_sensor_within_its_intervals() {
        let with = frames(0.004, 0.0625, 16, 3);
        let black = told_of(&with).expect("told");
        let without = taken_off(&with, black.value, Encoding::Linear);
        let (mut real, _, _) = measure_all(&without, Encoding::Linear).expect("measured");
        widen(&mut real.fits, &black);
        for fit in real.fits.iter().flatten() {
            assert!(fit.full_well_e.covers(3000.0) && fit.read_sigma.covers(0.004), "{fit:?}");
        }
        // Control: with it the full well is beyond its interval.
        let (raw, _, _) = measure_all(&with, Encoding::Linear).expect("measured");
        assert!(!raw.fits[1].as_ref().expect("a line").full_well_e.covers(3000.0));
        // One that is given is held against the values.
        let given = |black: f64| {
            let without = taken_off(&with, black, Encoding::Linear);
            let (real, _, _) = measure_all(&without, Encoding::Linear).expect("measured");
            let rest = told(&real, without[0].step, Encoding::Linear);
            check_given(black, &without, &real, rest).map_err(|e| e.to_string())
        };
        assert_eq!(given(0.0625), Ok(()));
        assert!(given(0.0).expect_err("too little").contains("a black level of that or more"));
        assert!(given(0.12).expect_err("too much").contains("values down to"));
    }
}
