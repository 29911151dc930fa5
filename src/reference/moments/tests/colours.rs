//! Noise of colours that are made of each other, against that of many frames.

use super::*;

#[test]
fn a_saturated_colour_has_the_noise_of_the_colours_that_it_is_made_of() {
    let settings = settings(&[number("saturation", "factor", 1.4), number("read_noise", "sigma", 4e-3)]);
    let colour = [0.55, 0.12, 0.2];
    let (seen, told) = of_colour(&settings, colour);
    let tone = Tone::new(&settings);
    for c in 0..3 {
        let (seen, [dn, told]) = (seen[c][1], told[c]);
        assert!((told / seen - 1.0).abs() < 0.06, "channel {c}: {told} for {seen} DN^2");
        let grey = f64::from(tone.spread(dn as f32, c).free) + 1.0 / 12.0;
        assert!(c > 0 || (grey / seen - 1.0).abs() > 0.2, "control: {grey} for {seen} DN^2");
    }
}

/// Saturation takes colours beyond black and white, and their noise does not show there.
#[test]
fn colours_beyond_black_and_white_have_the_mean_and_the_noise_that_clipping_leaves() {
    let mut worst: f64 = 0.0;
    for (factor, sigma) in [(1.5, 8e-3), (1.8, 4e-3), (1.4, 1.2e-2)] {
        let settings =
            settings(&[number("saturation", "factor", factor), number("read_noise", "sigma", sigma)]);
        for colour in [[0.5, 0.1, 0.05], [0.3, 0.04, 0.2], [0.95, 0.3, 0.6], [0.3, 0.12, 0.06]] {
            let (seen, told) = of_colour(&settings, colour);
            for c in 0..3 {
                let ([mean, square], [dn, variance]) = (seen[c], told[c]);
                let off = (dn - mean).abs();
                assert!(off < 0.05 + 0.12 * square.sqrt(), "{factor} {colour:?} {c}: {dn} for {mean} DN");
                let off = (variance - square).abs();
                assert!(off < 0.15 + 0.2 * square, "{factor} {colour:?} {c}: {variance} for {square} DN^2");
                let open = f64::from(Tone::new(&settings).open_spread_of(&told.map(|t| t[0] as f32), c).free);
                worst = worst.max(open / square.max(0.1));
            }
        }
    }
    assert!(worst > 3.0, "control: without clipping at most {worst} times the variance");
}

/// Behind a demosaicking that corrects green by red, behind a colour matrix, and behind both.
#[test]
fn colours_that_are_made_of_each_other_ahead_of_the_encoding_have_each_other_s_noise() {
    let noise = [number("shot_noise", "full_well_e", 544.0), number("read_noise", "sigma", 2.6e-3)];
    let malvar =
        [word("bayer_mosaic", "pattern", "GRBG"), word("bayer_mosaic", "demosaic", "malvar_he_cutler")];
    let sharpening = [number("sharpening", "amount", 0.3), number("sharpening", "radius_px", 1.37)];
    let matrix = [number("white_balance", "r", 1.5), number("color_matrix", "gb", 0.3)];
    let saturation = [number("saturation", "factor", 1.4)];
    let mut control = 0.0f64;
    for behind in [
        &malvar[..],
        &malvar[..1],
        &[malvar, sharpening].concat(),
        &matrix,
        &[malvar, matrix].concat(),
        &[&malvar[..], &saturation].concat(),
    ] {
        let settings = settings(&[&noise[..], behind].concat());
        for colour in [[0.2; 3], [0.35, 0.03, 0.4], [0.6, 0.15, 0.6], [0.1, 0.06, 0.02]] {
            let (seen, told) = of_colour(&settings, colour);
            // A normal distribution is cut off at black twice, ahead of the saturation and behind it.
            let most = if settings.has("saturation") { 0.25 } else { 0.13 };
            for c in 0..3 {
                let ([mean, variance], [dn, told]) = (seen[c], told[c]);
                let off = (dn - mean).abs();
                assert!(off < 0.25 + 0.06 * variance.sqrt(), "{behind:?} {colour:?} {c}: {dn} for {mean} DN");
                let off = told / variance - 1.0;
                assert!(off.abs() < most, "{behind:?} {colour:?} {c}: {told} for {variance} DN^2");
                let grey = f64::from(Tone::new(&settings).spread(dn as f32, c).free) + 1.0 / 12.0;
                control = control.max(variance / grey);
            }
        }
    }
    assert!(control > 2.0, "control: at most {control} times a grey's");
}
