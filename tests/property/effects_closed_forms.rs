//! Effects against what a formula on paper says, in double precision.
#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use crate::effects_support::{channel, flat, linear_list, moments, settings, view};
use shutterbug::camera::ScanOrder;
use shutterbug::chain::{Settings, Value, View};
use shutterbug::effects::{Flicker, LIST};
use shutterbug::plane::Plane;
use shutterbug::reference::chain::{picture, values};

/// Rounding of a few operations on values near 1.
const ROUNDING: f64 = 1e-6;

/// Compares every pixel of a ramp with a formula of the radiance and the position, and a wrong one as the control.
fn holds(
    of: &Settings,
    right: impl Fn([f64; 3], f64, f64) -> [f64; 3],
    wrong: impl Fn([f64; 3]) -> [f64; 3],
) {
    let sized = view(41, 29);
    let ramp = Plane::from_fn(41, 29, |x, y| [x as f32 / 50.0, y as f32 / 40.0, 0.25, 1.0]);
    let seen = values(&linear_list(), of, &sized, &ramp);
    let mut control = 0.0_f64;
    for (x, y) in (0..29).flat_map(|y| (0..41).map(move |x| (x, y))) {
        let l = [0, 1, 2].map(|c| f64::from(ramp.pixel(x, y)[c]));
        let want = right(l, x as f64 + 0.5, y as f64 + 0.5);
        for c in 0..3 {
            let got = f64::from(seen.pixel(x, y)[c]);
            assert!((got - want[c]).abs() < ROUNDING, "({x}, {y}) channel {c}: {got} for {}", want[c]);
            control = control.max((wrong(want)[c] - got).abs());
        }
    }
    assert!(control > 1e3 * ROUNDING, "a wrong formula would pass");
}

#[test]
fn lens_and_gains_are_their_formulas() {
    let k = view(41, 29).intrinsics;
    let q =
        |x: f64, y: f64| ((x - k.cx).powi(2) + (y - k.cy).powi(2)) / (20.5_f64.powi(2) + 14.5_f64.powi(2));
    let off = |l: [f64; 3]| l.map(|v| 1.01 * v);
    let of = settings(&[("vignetting", "a1", -0.4), ("vignetting", "a2", -0.1)]);
    holds(&of, |l, x, y| l.map(|v| v * (1.0 - 0.4 * q(x, y) - 0.1 * q(x, y).powi(2))), off);
    let of = settings(&[("glare", "veil", 0.2), ("glare", "level", 0.5)]);
    holds(&of, |l, _, _| l.map(|v| 0.8 * v + 0.1), off);
    holds(&settings(&[("exposure_gain", "gain", 1.7)]), |l, _, _| l.map(|v| 1.7 * v), off);
    holds(&settings(&[("black_level", "offset", 0.1)]), |l, _, _| l.map(|v| 0.1 + 0.9 * v), off);
    let of = settings(&[("white_balance", "r", 1.5), ("white_balance", "b", 0.5)]);
    holds(&of, |l, _, _| [1.5 * l[0], l[1], 0.5 * l[2]], off);
    let of = settings(&[("color_matrix", "rg", 0.25), ("color_matrix", "bb", 2.0)]);
    holds(&of, |l, _, _| [l[0] + 0.25 * l[1], l[1], 2.0 * l[2]], off);
    let of = settings(&[("quantization", "bits", 3.0)]);
    holds(&of, |l, _, _| l.map(|v| (7.0 * v).round() / 7.0), off);
    // 10 a second for 4 ms.
    holds(&settings(&[("dark_current", "rate_per_s", 10.0)]), |l, _, _| l.map(|v| v + 0.04), off);
}

#[test]
fn vignetting_never_gives_negative_light() {
    let of = settings(&[("vignetting", "a1", -2.0), ("vignetting", "a2", -2.0)]);
    let seen = flat(&of, &view(64, 64), [1.0; 3]);
    let values = channel(&seen, 0);
    assert!(values.iter().all(|v| (0.0..=1.0).contains(v)));
    assert!(values.contains(&0.0) && values.iter().any(|v| *v > 0.9), "control");
}

#[test]
fn gamma_is_a_power_of_the_encoded_value() {
    let sized = view(41, 29);
    let ramp = Plane::from_fn(41, 29, |x, y| [x as f32 / 40.0, y as f32 / 28.0, (x + y) as f32 / 68.0, 1.0]);
    let of = settings(&[("gamma", "exponent", 1.25)]);
    let (seen, plain) =
        (picture(LIST, &of, &sized, &ramp), picture(LIST, &Settings::default(), &sized, &ramp));
    let srgb = |l: f64| if l <= 0.0031308 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let mut changed = 0;
    for (i, got) in seen.data.iter().enumerate() {
        let l = f64::from(ramp.data[i / 3 * 4 + i % 3]);
        let want = 255.0 * srgb(l).powf(1.25);
        assert!((f64::from(*got) - want).abs() < 0.501, "{got} for {want}");
        changed += usize::from(*got != plain.data[i]);
    }
    assert!(changed > 3000, "control: without it {changed} values differ");
    assert_eq!(seen.pixel(0, 0), [0; 3], "black stays black");
    assert_eq!(seen.pixel(40, 28), [255; 3], "white stays white");
}

/// Mean of every row of a flat picture under flicker.
fn rows(of: &Settings, view: &View) -> Vec<f64> {
    let (width, seen) = (view.intrinsics.width as usize, channel(&flat(of, view, [0.5; 3]), 1));
    seen.chunks_exact(width).map(|row| row.iter().sum::<f64>() / width as f64 / 0.5).collect()
}

/// Amplitude of the rows at a number of periods a picture.
fn amplitude(rows: &[f64], periods: f64) -> f64 {
    let part = |f: fn(f64) -> f64| -> f64 {
        rows.iter()
            .enumerate()
            .map(|(i, v)| (v - 1.0) * f(TAU * periods * i as f64 / rows.len() as f64))
            .sum()
    };
    2.0 * part(f64::sin).hypot(part(f64::cos)) / rows.len() as f64
}

#[test]
fn flicker_makes_bands_by_the_time_of_the_line() {
    // 100 Hz over 20 ms of readout: two bands.
    let of = settings(&[
        ("flicker", "frequency_hz", 100.0),
        ("flicker", "depth", 0.2),
        ("flicker", "phase_rad", 0.7),
    ]);
    let mut sized = view(8, 400);
    let seen = rows(&of, &sized);
    assert!((amplitude(&seen, 2.0) - 0.2).abs() < 1e-4, "two bands");
    assert!(
        amplitude(&seen, 1.0) < 1e-4 && amplitude(&seen, 4.0) < 1e-4,
        "control: no other number of bands"
    );
    for (line, got) in seen.iter().enumerate() {
        let time_s = 0.013 + 0.02 * line as f64 / 400.0;
        let want = 1.0 + 0.2 * (TAU * 100.0 * time_s + 0.7).sin();
        assert!((got - want).abs() < ROUNDING, "line {line}: {got} for {want}");
    }
    sized.shutter.scan_order = ScanOrder::BottomToTop;
    let upwards: Vec<f64> = rows(&of, &sized).into_iter().rev().collect();
    assert_eq!(upwards, seen, "the line's time follows the scan order");
    sized.shutter.scan_order = ScanOrder::TopToBottom;
    sized.shutter.readout_time_s = 0.0;
    let (_, spread, _) = moments(&rows(&of, &sized));
    assert!(spread < 1e-12, "a global shutter has no bands");
}

#[test]
fn flicker_over_the_exposure_is_its_mean() {
    let mut of = settings(&[("flicker", "frequency_hz", 100.0), ("flicker", "depth", 0.2)]);
    of.set(&Flicker, "average", Value::Choice("exposure")).unwrap();
    for exposure_time_s in [0.0, 0.004, 0.01] {
        let mut sized = view(4, 200);
        sized.shutter.exposure_time_s = exposure_time_s;
        let seen = rows(&of, &sized);
        for (line, got) in seen.iter().enumerate() {
            let start_s = sized.shutter.line_start_s(line as u32);
            let light = |t: f64| 1.0 + 0.2 * (TAU * 100.0 * t).sin();
            let n = 4000;
            let mean: f64 =
                (0..n).map(|i| light(start_s + exposure_time_s * (f64::from(i) + 0.5) / f64::from(n))).sum();
            assert!((got - mean / f64::from(n)).abs() < 2e-6, "{exposure_time_s} line {line}");
        }
    }
    // A whole period sees nothing; half of one sees 2/pi.
    let mut sized = view(4, 200);
    sized.shutter.exposure_time_s = 0.01;
    assert!(amplitude(&rows(&of, &sized), 2.0) < 1e-6);
    sized.shutter.exposure_time_s = 0.005;
    assert!((amplitude(&rows(&of, &sized), 2.0) - 0.2 * 2.0 / PI).abs() < 1e-4, "control");
}

/// An edge under a Gaussian is an error function: its slope in the middle is 1/(sigma sqrt(2 pi)).
#[test]
fn defocus_widens_an_edge_by_its_sigma() {
    let sized = view(81, 5);
    let edge = Plane::from_fn(81, 5, |x, _| if x < 40 { [0.0, 0.0, 0.0, 1.0] } else { [1.0; 4] });
    for sigma in [1.0, 2.5, 5.0] {
        let seen =
            channel(&values(&linear_list(), &settings(&[("defocus", "sigma_px", sigma)]), &sized, &edge), 0);
        // The second moment of the differences along a row is sigma squared.
        let row = &seen[81 * 2..81 * 3];
        let weight: Vec<f64> = row.windows(2).map(|p| p[1] - p[0]).collect();
        let square: f64 = weight.iter().enumerate().map(|(i, w)| w * (i as f64 + 1.0 - 40.0).powi(2)).sum();
        assert!((square.sqrt() / sigma - 1.0).abs() < 0.01, "{sigma}: {}", square.sqrt());
        assert!((weight.iter().sum::<f64>() - 1.0).abs() < 1e-4, "no light is lost");
    }
    // Disc: half the edge's rise is a half chord; sum over columns is flat, so the second moment is r^2 / 4.
    let seen =
        channel(&values(&linear_list(), &settings(&[("defocus", "disc_radius_px", 6.0)]), &sized, &edge), 0);
    let square: f64 = seen[81 * 2..81 * 3]
        .windows(2)
        .enumerate()
        .map(|(i, p)| (p[1] - p[0]) * (i as f64 - 39.0).powi(2))
        .sum();
    assert!((square - 9.0).abs() < 0.3, "{square} for r^2 / 4 = 9");
}
