//! `calibrate noise`: measure, fit, simulate, compare.

use std::collections::HashSet;

use super::black;
use super::frames::{Encoding, Frame};
use super::model::IspCamera;
use super::noise::{
    Calibration, Comparison, Measured, NoiseOptions, Pictures, compare, mean_variance, measure_all,
};
use super::ptc::{Estimate, PtcFit};
use super::scene::Together;
use super::search::{By, Levelled, fit_camera, is_sensor_alone, level, refit};
use super::series::{edge_variance, static_variance, temporal};
use super::statics::{AlignedPair, Registration, difference};
use super::unlike::widened;
use shutterbug::error::{Error, Result};

/// Frames, and what was measured of them.
struct Taken<'a> {
    frames: &'a [Frame],
    real: Measured,
    pairs: Vec<AlignedPair>,
    together: Together,
}

impl<'a> Taken<'a> {
    fn of(frames: &'a [Frame], encoding: Encoding) -> Result<Self> {
        let (real, pairs, together) = measure_all(frames, encoding)?;
        Ok(Self { frames, real, pairs, together })
    }

    /// What tells of a black level: a sensor's noise alone, for what mixes colours bends the line.
    fn black_level(&self, encoding: Encoding) -> Option<Estimate> {
        let step = self.frames[0].step;
        is_sensor_alone(&self.frames[0], &self.real)
            .then(|| black::told(&self.real, step, encoding))
            .flatten()
    }
}

/// Measures the noise of two or more frames of one static scene and fits a camera that makes the same.
///
/// # Errors
/// Frames that hold no measurement ([`super::frames::check`]) or no static scene ([`super::statics::align`]), too few
/// intensities; a black level that is not theirs.
pub fn calibrate_noise(frames: &[Frame], options: NoiseOptions) -> Result<Calibration> {
    let encoding = options.encoding;
    let without = |black: f64| black::taken_off(frames, black, encoding);
    if let Some(value) = options.black_level.filter(|b| *b != 0.0) {
        let lit = without(value);
        let taken = Taken::of(&lit, encoding)?;
        black::check_given(value, &lit, &taken.real, taken.black_level(encoding))?;
        let mut done = calibrate(taken, options)?;
        done.black_level = Some(Estimate { value, ci95: [value; 2] });
        return Ok(done);
    }
    let taken = Taken::of(frames, encoding)?;
    let Some(black) = taken.black_level(encoding) else { return calibrate(taken, options) };
    let lit = without(black.value);
    let mut done = calibrate(Taken::of(&lit, encoding)?, options)?;
    black::widen(&mut done.real.fits, &black);
    done.notes.insert(0, black::note(&black));
    done.black_level = Some(black);
    Ok(done)
}

fn calibrate(taken: Taken<'_>, options: NoiseOptions) -> Result<Calibration> {
    let Taken { frames, mut real, pairs, together } = taken;
    let (encoding, step) = (options.encoding, frames[0].step);
    let unlike = widened(&mut real, &pairs, frames, encoding);
    check_whole(frames, &real)?;
    let camera = fit_camera(&pairs[0], &frames[0], &real, options)?;
    let Levelled { camera, simulated, shown, without, held_out } =
        level(camera, &pairs, &real, step, options, By::Model)?;
    let comparison = compare(&real, &simulated);
    check_line(frames, &real, &comparison, &camera)?;
    // The chain delivers sRGB; a linear sensor is measured by its own model.
    let by = if encoding == Encoding::Srgb { By::Chain } else { By::Model };
    let mut chain_camera = IspCamera { level_gain: Default::default(), ..camera.clone() };
    if chain_camera.bayer {
        chain_camera = refit(&chain_camera, &pairs[0], options, by)?;
    }
    let chain = level(chain_camera, &pairs, &real, step, options, by)?;
    let comparison_chain = compare(&real, &chain.simulated);
    check_matched(frames, &comparison_chain)?;
    let usable = &pairs[0].usable;
    let resting = together.resting.as_deref();
    let mut calibration = Calibration {
        frames: frames.iter().map(|f| f.path.display().to_string()).collect(),
        encoding: encoding.name(),
        registration: pairs.iter().map(|p| p.registration.clone()).collect(),
        black_level: None,
        color_variance: real.curves.each_ref().map(|c| mean_variance(c)),
        static_variance: resting.and_then(|at_rest| static_variance(frames, at_rest, encoding)),
        edge_variance: edge_variance(&pairs[0], &real.fits, encoding),
        temporal: resting.and_then(|at_rest| temporal(frames, at_rest, real.neighbours[1].effective_pixels)),
        real,
        simulated,
        comparison,
        comparison_chain,
        comparison_chain_held_out: chain.held_out,
        chain_camera: chain.camera,
        chain: chain.simulated,
        comparison_without_level_gain: without,
        comparison_held_out: held_out,
        camera,
        size_px: [frames[0].encoded.width, frames[0].encoded.height],
        notes: Vec::new(),
        pictures: Pictures {
            real: pairs[0].frames[0].clone(),
            real_difference: pairs[0].difference(|v| v),
            simulated_difference: difference(&shown, usable, pairs[0].registration.moved, |v| v),
            simulated: shown[0].clone(),
            usable: usable.clone(),
        },
    };
    let rest = notes(&calibration, &together).into_iter().chain(unscaled(frames, &calibration.real));
    calibration.notes = unlike.into_iter().chain(rest).collect();
    Ok(open_where_shared(calibration))
}

/// Somewhere between black and white nothing of the noise is cut off.
fn check_whole(frames: &[Frame], real: &Measured) -> Result<()> {
    if real.curves.iter().flatten().any(|bin| !bin.cut_off) {
        return Ok(());
    }
    let expected = "surfaces between black and white that rest";
    Err(Error::input(&frames[0].path, None, "no intensity at which the noise is whole", expected))
}

/// A camera without any noise misses its variance by the whole of it: one that misses by more is no finding.
fn check_matched(frames: &[Frame], chain: &Comparison) -> Result<()> {
    let off = chain.mean_deviation;
    // What could not be compared misses nothing.
    if (0..3).all(|c| off[c] < 1.0 || chain.variance_ratio[c].is_empty()) {
        return Ok(());
    }
    let [r, g, b] = off.map(|d| 100.0 * d);
    let found = format!(
        "differences that no camera's noise explains: the nearest one misses their variance by {r:.0} {g:.0} {b:.0} % \
         in the mean (R, G, B)"
    );
    let expected = format!("the static scene of {}, lit alike", frames[0].path.display());
    Err(Error::input(&frames[1].path, None, found, expected))
}

/// The noise of light grows with it. Where it grows in no channel, and a sensor alone misses most of the pixels by more
/// than a tenth and chance, the values are no light, as they are said to be. What a camera's processing does to noise
/// misses that line as well, but lets it grow.
fn check_line(frames: &[Frame], real: &Measured, sensor: &Comparison, camera: &IspCamera) -> Result<()> {
    let unscaled = unscaled(frames, real);
    let mut fits = real.fits.iter().flatten().peekable();
    let is_told = fits.peek().is_some() || unscaled.is_some();
    if !is_told || fits.any(|f| f.full_well_e.value.is_finite()) {
        return Ok(());
    }
    // What could not be compared is off nothing.
    let compared = || (0..3).filter(|c| !sensor.variance_ratio[*c].is_empty());
    // Colours and smoothing bend the line: their curve over intensity is fitted, and told.
    if camera.bayer
        || compared().count() == 0
        || compared().any(|c| sensor.within_10_percent_or_chance[c] >= 0.5)
    {
        return Ok(());
    }
    let [r, g, b] = sensor.mean_deviation.map(|d| 100.0 * d);
    let [x, y, z] = sensor.within_10_percent_or_chance.map(|s| 100.0 * (1.0 - s));
    let found = format!(
        "noise that is no line over intensity: shot and read noise miss its variance by {r:.0} {g:.0} {b:.0} % in the \
         mean, and by more than a tenth and chance in {x:.0} {y:.0} {z:.0} % of the pixels (R, G, B)"
    );
    let (name, other) = if camera.srgb { ("srgb", "linear") } else { ("linear", "srgb") };
    let expected = match unscaled {
        Some(note) => format!("{name} values up to white: {note}"),
        None => format!("{name} values, as --encoding says: are they {other}?"),
    };
    Err(Error::input(&frames[0].path, None, found, expected))
}

/// What may be why there are too few intensities: values of fewer bits than their files hold, not scaled to white.
fn unscaled(frames: &[Frame], real: &Measured) -> Option<String> {
    let deep = frames.iter().all(|f| f.step > 0.0 && f.step < 1.0 / 255.0);
    if !deep || real.fits.iter().any(Option::is_some) {
        return None;
    }
    let top = frames.iter().flat_map(|f| &f.encoded.data).copied().fold(0.0f32, f32::max);
    let unused = (1..12).take_while(|bits| top * 2f32.powi(*bits) < 1.0).last()?;
    (unused > 1).then(|| {
        format!(
            "all values lie in the lowest 1/{} of what 16 bits hold: are they of {} bits, not scaled to white? \
             Multiplied by {} they spread over more intensities",
            1 << unused,
            16 - unused,
            1 << unused
        )
    })
}

const NAMES: [&str; 3] = ["red", "green", "blue"];

/// Of a camera or a scene that moved or changed.
fn notes_on_place(r: &Registration, notes: &mut Vec<String>) {
    if r.moved {
        notes.push(format!(
            "the camera moved by ({}, {}) px and {:.2} px more in half of the textured picture: {:.0} % of it is \
             left out (edges and what saturates or changed); edge noise cannot be told from displacement",
            r.shift_px[0], r.shift_px[1], r.residual_median_px, 100.0 * r.masked_fraction
        ));
    } else if r.masked_fraction > 0.0 {
        notes.push(format!(
            "{:.1} % of the picture left out: something moved there",
            100.0 * r.masked_fraction
        ));
    }
    if r.textured_blocks == 0 {
        notes.push("no texture to tell displacement by; without texture it does no harm".to_owned());
    }
    if r.gain.iter().any(|g| (g - 1.0).abs() >= 1e-3) {
        let [r, g, b] = r.gain.map(|g| 100.0 * (g - 1.0));
        notes.push(format!("brightness changed by {r:+.2} {g:+.2} {b:+.2} % (R, G, B) and was taken back"));
    }
}

/// Opens the intervals that hold for frames without noise in common alone, where these have some, and says so.
fn open_where_shared(mut c: Calibration) -> Calibration {
    if let Some(shared) = c.temporal.as_ref().filter(|t| t.is_shared()) {
        c.notes.insert(0, shared_note(&shared.near_over_far));
        c.real.fits.iter_mut().flatten().for_each(PtcFit::at_least);
    }
    c
}

/// Said of frames that share noise.
fn shared_note(ratio: &Estimate) -> String {
    format!(
        "WARNING: frames that follow each other share noise: they differ by {:.0} % of the variance by which frames \
         further apart do, as in a video with temporal noise reduction. Noise is that of single frames only where \
         frames have none in common: the full wells are upper bounds, read noise and variances lower ones. Take \
         photographs, turn the noise reduction off, or give frames of the video that lie a second or more apart",
        100.0 * ratio.value
    )
}

/// What limits the result.
fn notes(c: &Calibration, together: &Together) -> Vec<String> {
    let mut notes = Vec::new();
    notes.extend(undivided(&c.real.fits));
    c.registration.iter().for_each(|r| notes_on_place(r, &mut notes));
    for (name, fit) in NAMES.iter().zip(&c.real.fits) {
        match fit {
            None => notes.push(format!("{name}: too few intensities for a line through the photon transfer curve")),
            Some(f) if !f.linear => notes.push(format!(
                "{name}: the photon transfer curve is no line (chi2/dof {:.1}, bend t {:.1}): tone curve, denoising, \
                 JPEG or colour mixing; its full well is that of the delivered picture",
                f.chi2_per_dof, f.bend_t
            )),
            Some(_) => {}
        }
    }
    if let Some(held_out) = &c.comparison_held_out {
        let [r, g, b] = held_out.mean_deviation.map(|d| 100.0 * d);
        let [p, q, s] = c.comparison_without_level_gain.mean_deviation.map(|d| 100.0 * d);
        notes.push(format!(
            "sensor, colours and smoothing alone miss the variance by {p:.0} {q:.0} {s:.0} % in the mean (R, G, B): \
             a curve of the noise over intensity was added (level_gain in report.json); on blocks it was not fitted \
             to it misses by {r:.0} {g:.0} {b:.0} %, which is how much noise differs between surfaces of the same \
             brightness"
        ));
    }
    if c.camera.bayer {
        let [r, g, b] = c.comparison_chain.mean_deviation.map(|d| 100.0 * d);
        notes.push(format!(
            "camera.toml, put through the engine's chain, misses the variance by {r:.0} {g:.0} {b:.0} % in the mean; \
             it keeps the picture's colours (sensor_color) and blurs edges, which real noise reduction spares"
        ));
        notes.push(
            "neighbours are correlated: full_well_e and read_noise are those of a sensor before demosaic, colour \
             matrix and smoothing, and stand or fall with these; the tone curve is taken to be sRGB"
                .to_owned(),
        );
    }
    if !together.moved.is_empty() {
        notes.push(format!(
            "displaced against {}: {}; so there is no static part and no temporal spectrum",
            c.frames[0],
            together.moved.join(", ")
        ));
    } else if c.frames.len() < 3 {
        notes.push(
            "two frames: the fixed pattern is in both and stays unseen, and so does noise that frames of a video \
             share; no temporal spectrum"
                .to_owned(),
        );
    } else {
        notes.push(
            "the static part holds the scene's own texture: an upper bound unless it was a flat field"
                .to_owned(),
        );
    }
    // Each frame has its place, and they say the same of it.
    let mut said = HashSet::new();
    notes.retain(|note| said.insert(note.clone()));
    notes
}

/// Of a picture of one brightness: its noise is known, and not of what.
fn undivided(fits: &[Option<PtcFit>; 3]) -> Option<String> {
    fits.iter().all(Option::is_none).then(|| {
        "WARNING: brightness differs too little over the picture to tell the noise of light from that of reading: \
         shot_noise and read_noise are right together at the brightness that was photographed, and a guess at others. \
         Photograph something with dark and bright parts"
            .to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::plane::Plane;

    #[test]
    fn of_one_brightness_the_parts_of_the_noise_are_not_told_and_each_note_comes_once() {
        let noisy = |from: u8, to: u8| {
            let mut dice = crate::calibrate::dice::Dice(3);
            let frame = |k: usize| {
                let plane = Plane::from_fn(96, 64, |x, _| {
                    let mean = f64::from(from) + f64::from(to - from) * x as f64 / 95.0;
                    [0, 1, 2].map(|_| ((mean + 2.0 * dice.normal()).round() / 255.0) as f32)
                });
                Frame::from_plane(&format!("{k}"), plane, 1.0 / 255.0)
            };
            let frames: Vec<Frame> = (0..4).map(frame).collect();
            let options = NoiseOptions { encoding: Encoding::Srgb, seed: 0, black_level: None };
            calibrate_noise(&frames, options).expect("a calibration").notes
        };
        let flat = noisy(128, 128);
        assert!(flat[0].starts_with("WARNING: brightness differs too little"), "{flat:?}");
        for note in &flat {
            assert_eq!(flat.iter().filter(|n| *n == note).count(), 1, "{flat:?}");
        }
        let ramp = noisy(40, 220);
        assert!(!ramp.iter().any(|n| n.contains("differs too little")), "control: {ramp:?}");
    }

    #[test]
    fn a_camera_that_misses_as_much_as_none_would_is_no_finding() {
        let frames = ["a", "b"].map(|name| Frame::from_plane(name, Plane::new(1, 1, 3), 0.0));
        let with = |mean_deviation: [f64; 3]| {
            let chain = Comparison {
                variance_ratio: [vec![[128.0, 1.0, 0.1]], vec![[128.0, 1.0, 0.1]], Vec::new()],
                mean_deviation,
                within_10_percent: [0.0; 3],
                within_10_percent_or_chance: [0.0; 3],
                correlation_error: [0.0; 3],
            };
            check_matched(&frames, &chain).map_err(|e| e.to_string())
        };
        assert_eq!(with([0.1, 0.5, 0.9]), Ok(()));
        let said = with([0.1, 1.3, 0.1]).expect_err("refused");
        assert!(said.contains("b: found ") && said.contains("10 130 10 %"), "{said}");
        assert!(with([f64::NAN, 0.1, 0.1]).is_err());
        assert_eq!(with([0.1, 0.1, f64::NAN]), Ok(()), "a channel of which nothing could be compared");
    }
}
