//! Means and spreads against the chain's own references: without noise value by value, with it by drawing frames.

use super::*;
use crate::camera::{Intrinsics, ScanOrder, ShutterTiming};
use crate::chain::{self, BANDS, Mixing, Packed, Settings, Value, View, Work};
use crate::effects::hot_pixels::HotPixels;
use crate::effects::jpeg::dct::{AREA, Dct, SIDE, TO_YCC};
use crate::effects::jpeg::grain::Grain;
use crate::effects::jpeg::packing::{band, lines, normal_noise, square};
use crate::effects::{LIST, by_id};
use crate::plane::Plane;
use crate::reference::chain as by_hand;

type Given<'a> = &'a [(&'static str, &'static str, Value)];

mod colours;

fn number(stem: &'static str, name: &'static str, value: f64) -> (&'static str, &'static str, Value) {
    (stem, name, Value::Number(value))
}

fn word(stem: &'static str, name: &'static str, value: &'static str) -> (&'static str, &'static str, Value) {
    (stem, name, Value::Choice(value))
}

fn settings(given: Given<'_>) -> Settings {
    let mut settings = Settings::default();
    for (stem, name, value) in given {
        settings.set(by_id(stem).expect("an effect"), name, *value).expect("in range");
    }
    settings
}

fn view(width: u32, height: u32, frame: u32) -> View {
    let (cx, cy) = (0.5 * f64::from(width) - 0.3, 0.5 * f64::from(height) + 0.4);
    View {
        intrinsics: Intrinsics { width, height, fx: 40.0, fy: 41.0, cx, cy },
        shutter: ShutterTiming {
            start_s: 12.345,
            exposure_time_s: 0.01,
            readout_time_s: 0.02,
            scan_order: ScanOrder::BottomToTop,
            line_count: height,
        },
        frame,
        seed: 5,
    }
}

/// Patches with hard edges, dark to beyond white.
fn radiance() -> Plane<f32> {
    Plane::from_fn(42, 31, |x, y| {
        let v = |c: usize| ((x / 5 * 7 + y / 4 * 13 + c * 5) % 23) as f32 / 20.0;
        [v(0), v(1) * 0.6, v(2) * 0.3, 1.0]
    })
}

fn three(plane: &Plane<f32>) -> Plane<f32> {
    let data = plane.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    Plane { channels: 3, data, ..*plane }
}

/// The mean frame, DN.
fn mean(settings: &Settings) -> Plane<f32> {
    expected(&three(&radiance()), settings, &view(42, 31, 3), &Tone::new(settings))
}

/// The chain's own, DN.
fn drawn(settings: &Settings) -> Vec<f32> {
    if settings.has("jpeg") {
        let picture = by_hand::picture(LIST, settings, &view(42, 31, 3), &radiance());
        return picture.data.iter().map(|v| f32::from(*v)).collect();
    }
    let values = by_hand::values(LIST, settings, &view(42, 31, 3), &radiance());
    three(&values).data.iter().map(|v| 255.0 * v.clamp(0.0, 1.0)).collect()
}

fn furthest(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// A setting of each effect on values that adds no noise.
const SILENT: &[Given<'static>] = &[
    &[("defocus", "sigma_px", Value::Number(1.3))],
    &[("vignetting", "a1", Value::Number(-0.5)), ("vignetting", "a2", Value::Number(0.1))],
    &[("glare", "veil", Value::Number(0.2)), ("glare", "level", Value::Number(0.4))],
    &[("exposure_gain", "gain", Value::Number(0.7))],
    &[("flicker", "frequency_hz", Value::Number(103.0)), ("flicker", "depth", Value::Number(0.15))],
    &[("sensor_color", "match", Value::Choice("delivered")), ("color_matrix", "rg", Value::Number(-0.2))],
    &[("dark_current", "rate_per_s", Value::Number(5.0))],
    &[("black_level", "offset", Value::Number(0.06))],
    &[("quantization", "bits", Value::Number(5.0))],
    &[("bayer_mosaic", "pattern", Value::Choice("RGGB"))],
    &[("bayer_mosaic", "pattern", Value::Choice("GRBG")), ("white_balance", "r", Value::Number(1.4))],
    &[("bayer_mosaic", "pattern", Value::Choice("GBRG")), ("gamma", "exponent", Value::Number(0.8))],
    &[
        ("bayer_mosaic", "pattern", Value::Choice("BGGR")),
        ("bayer_mosaic", "demosaic", Value::Choice("malvar_he_cutler")),
    ],
    &[("white_balance", "r", Value::Number(1.3)), ("white_balance", "b", Value::Number(0.8))],
    &[("color_matrix", "rg", Value::Number(-0.3)), ("color_matrix", "bb", Value::Number(1.2))],
    &[("gamma", "exponent", Value::Number(1.15))],
    &[("tone_curve", "contrast", Value::Number(0.4))],
    &[
        ("noise_reduction", "luma_sigma_px", Value::Number(0.8)),
        ("noise_reduction", "edge", Value::Number(0.2)),
    ],
    &[("response_curve", "g4", Value::Number(1.6))],
    &[
        ("response_curve", "r9", Value::Number(0.6)),
        ("noise_reduction", "chroma_sigma_px", Value::Number(1.2)),
    ],
    &[("saturation", "factor", Value::Number(0.7))],
    &[("split_toning", "amount", Value::Number(0.06))],
    &[("sharpening", "amount", Value::Number(0.8)), ("sharpening", "radius_px", Value::Number(1.1))],
    &[("chroma_subsampling", "scheme", Value::Choice("4:2:0"))],
    &[("chroma_subsampling", "scheme", Value::Choice("4:2:2"))],
    &[("jpeg", "quality", Value::Number(60.0))],
];

/// What lies behind the sensor spreads a stuck pixel over its neighbours.
#[test]
fn stuck_pixels_spread_through_mosaics_filters_shared_colours_and_files() {
    let behind: [Given<'_>; 4] = [
        &[word("bayer_mosaic", "pattern", "GRBG"), number("exposure_gain", "gain", 0.8)],
        &[number("sharpening", "amount", 1.1), number("sharpening", "radius_px", 1.8)],
        &[word("chroma_subsampling", "scheme", "4:2:2"), number("noise_reduction", "luma_sigma_px", 0.7)],
        &[number("jpeg", "quality", 80.0)],
    ];
    for given in behind {
        let mut settings = settings(given);
        settings.set(by_id("hot_pixels").expect("an effect"), "count", Value::Number(6.0)).expect("in range");
        let mask = HotPixels::mask(&settings, [42, 31]);
        let stuck: Vec<usize> = (0..42 * 31).filter(|i| mask[i / 32] & (1 << (i % 32)) != 0).collect();
        assert_eq!(stuck.len(), 6);
        let (linear, tone, view) = (three(&radiance()), Tone::new(&settings), view(42, 31, 3));
        let with = |stuck: &[usize]| expected_on(&linear, Lattice::WHOLE, &settings, &view, &tone, stuck);
        let want = drawn(&settings);
        let most = if settings.has("jpeg") { 0.51 } else { 0.06 };
        let off = furthest(&with(&stuck).data, &want);
        assert!(off < most, "{given:?}: off by {off} DN");
        assert!(furthest(&with(&[]).data, &want) > 20.0, "{given:?}: the control passes");
    }
}

#[test]
fn without_noise_the_mean_is_the_chain_s_own_of_every_effect_alone() {
    for given in SILENT {
        let settings = settings(given);
        let (seen, want) = (mean(&settings), drawn(&settings));
        let off = furthest(&seen.data, &want);
        // A value at the edge of two of a converter's steps goes either way.
        let steps = settings.has("quantization");
        assert!(off < 0.06 || (steps && off < 10.0), "{given:?}: off by {off} DN");
        let mut without = settings;
        without.disable(given[0].0);
        assert!(furthest(&mean(&without).data, &want) > 0.5, "{given:?}: the control passes");
    }
    let missing: Vec<&str> = LIST
        .iter()
        .filter(|e| !matches!(e.work(), Work::Elsewhere) && !e.moments().is_noise())
        .map(|e| e.id())
        .filter(|id| !SILENT.iter().any(|given| given.iter().any(|(stem, ..)| stem == id)))
        .collect();
    assert_eq!(missing, [""; 0], "effects without a case");
}

#[test]
fn effects_together_stand_in_the_chain_s_order() {
    let all = settings(&[
        number("defocus", "sigma_px", 0.8),
        number("vignetting", "a1", -0.3),
        number("glare", "veil", 0.1),
        number("glare", "level", 0.3),
        number("exposure_gain", "gain", 1.2),
        number("flicker", "frequency_hz", 100.0),
        number("flicker", "depth", 0.1),
        number("black_level", "offset", 0.03),
        word("bayer_mosaic", "pattern", "GRBG"),
        number("white_balance", "r", 1.2),
        number("white_balance", "b", 0.9),
        number("color_matrix", "gr", -0.15),
        number("gamma", "exponent", 0.9),
        number("tone_curve", "contrast", 0.2),
        number("saturation", "factor", 1.2),
        word("chroma_subsampling", "scheme", "4:2:0"),
    ]);
    let off = furthest(&mean(&all).data, &drawn(&all));
    assert!(off < 0.15, "off by {off} DN");
}

fn of_grey(settings: &Settings, linear: f32) -> ([[f64; 2]; 3], [[f64; 2]; 3]) {
    of_colour(settings, [linear; 3])
}

/// Mean and variance of every channel over frames of a colour, DN, and what is expected of it.
fn of_colour(settings: &Settings, [r, g, b]: [f32; 3]) -> ([[f64; 2]; 3], [[f64; 2]; 3]) {
    const SIDE: usize = 48;
    const FRAMES: u32 = 8;
    let flat = Plane::from_fn(SIDE, SIDE, |_, _| [r, g, b, 1.0]);
    let mut sums = [[0.0f64; 3]; 3];
    for frame in 0..FRAMES {
        let picture = by_hand::picture(LIST, settings, &view(SIDE as u32, SIDE as u32, frame), &flat);
        for (i, v) in picture.data.iter().enumerate() {
            let (sum, v) = (&mut sums[i % 3], f64::from(*v));
            *sum = [sum[0] + v, sum[1] + v * v, sum[2] + 1.0];
        }
    }
    let seen = sums.map(|[s, q, n]| [s / n, q / n - (s / n).powi(2)]);
    let tone = Tone::new(settings);
    let mean = expected(&three(&flat), settings, &view(SIDE as u32, SIDE as u32, 0), &tone);
    let p = mean.pixel(SIDE / 2, SIDE / 2);
    let told = [0, 1, 2].map(|c| {
        let v = tone.spread_of(p, c);
        let left = tone.left(p, c).pixel;
        // Rounding to whole DN.
        [f64::from(p[c]), f64::from(left * (v.free + v.fixed) + v.row) + 1.0 / 12.0]
    });
    (seen, told)
}

#[test]
fn noise_ahead_of_the_converter_follows_from_what_is_behind_it() {
    let settings = settings(&[number("quantization", "bits", 5.0), number("read_noise", "sigma", 0.012)]);
    let tone = Tone::new(&settings);
    // Over a whole step of mean values: what rounding adds depends on the place within it.
    let step = 1.0 / 31.0f64;
    let values = (0..40_000u32).map(|i| {
        let bits = crate::chain::rng::random_normal([i, 3], 1, 9, [4, 5]);
        let mean = 0.4 + step * f64::from(i % 200) / 200.0;
        ((mean + 0.012 * f64::from(bits[0])) / step).round() * step - mean
    });
    let variance = values.map(|v| v * v).sum::<f64>() / 40_000.0;
    let ahead = tone.unrounded(variance).sqrt();
    // A mean value's own rounding error counts as noise here, as it does where a scene shows all places within a step.
    assert!((ahead / 0.012 - 1.0).abs() < 0.15, "{ahead} for 0.012, behind {}", variance.sqrt());
}

#[test]
fn a_converter_of_few_steps_delivers_the_mean_and_the_spread_that_are_told() {
    let noisy =
        |bits: f64| settings(&[number("quantization", "bits", bits), number("read_noise", "sigma", 0.009)]);
    let (coarse, fine) = (noisy(5.0), noisy(12.0));
    let mut control = 0.0f64;
    for level in [0.012f32, 0.03, 0.05, 0.11, 0.33, 0.61] {
        let (seen, told) = of_colour(&coarse, [level; 3]);
        let (_, without) = of_colour(&fine, [level; 3]);
        for c in 0..3 {
            let ([dn, variance], [told_dn, told_variance]) = (seen[c], told[c]);
            let known = (variance / independent(&coarse)).sqrt();
            assert!((told_dn - dn).abs() < 0.1 + 4.0 * known, "{level}, channel {c}: {told_dn} for {dn} DN");
            let off = told_variance / variance - 1.0;
            // It is told by whole DN of the mean, and near a step the mean hardly changes while the spread does.
            assert!(off.abs() < 0.2, "{level}, channel {c}: {told_variance} for {variance} DN^2");
            control = control.max((without[c][0] - dn).abs());
        }
    }
    assert!(control > 2.0, "control: without steps means are off by {control} DN at most");
}

#[test]
fn what_comes_ahead_of_a_coarse_converter_is_delivered_as_the_whole_camera_delivers_it() {
    let bits = number("quantization", "bits", 5.0);
    let gain = number("exposure_gain", "gain", 0.83);
    let noise = number("read_noise", "sigma", 0.012);
    let ahead = mean(&settings(&[gain]));
    for camera in [settings(&[gain, bits]), settings(&[gain, bits, noise])] {
        let whole = mean(&camera);
        let delivered = through_converter(&ahead, &Tone::new(&camera));
        let off = furthest(&delivered.data, &whole.data);
        assert!(off < 0.1, "{off} DN");
        assert!(furthest(&ahead.data, &whole.data) > 1.0, "control: the converter does something");
    }
}

/// Independent values in what [`of_grey`] looks at: a row's in every frame, a pixel's in every frame or in all of them.
fn independent(settings: &Settings) -> f64 {
    if settings.has("row_noise") {
        384.0
    } else if settings.has("fixed_pattern_noise") || settings.has("paper_noise") {
        2304.0
    } else {
        18_432.0
    }
}

#[test]
fn mean_and_spread_are_those_of_many_frames_for_every_noise_behind_every_curve() {
    let noises: &[Given<'_>] = &[
        &[number("shot_noise", "full_well_e", 800.0)],
        &[number("read_noise", "sigma", 0.02)],
        &[number("row_noise", "sigma", 0.03), number("read_noise", "sigma", 0.01)],
        &[number("fixed_pattern_noise", "dsnu", 0.015), number("fixed_pattern_noise", "prnu", 0.05)],
        &[number("paper_noise", "color_variance_g", 4e-4), number("paper_noise", "static_variance_r", 4e-4)],
        &[number("dark_current", "rate_per_s", 10.0), number("shot_noise", "full_well_e", 500.0)],
    ];
    let curves: &[Given<'_>] = &[
        &[],
        &[number("gamma", "exponent", 1.3), number("black_level", "offset", 0.05)],
        &[number("tone_curve", "contrast", 0.5)],
        &[number("response_curve", "g6", 2.0), number("response_curve", "r6", 0.6)],
        &[
            number("white_balance", "r", 1.5),
            number("color_matrix", "rg", -0.4),
            number("color_matrix", "gr", 0.2),
        ],
        &[number("saturation", "factor", 1.8)],
        &[number("quantization", "bits", 8.0)],
    ];
    let mut wrong = Vec::new();
    for (noise, curve) in noises.iter().flat_map(|n| curves.iter().map(move |c| (n, c))) {
        let settings = settings(&[*noise, *curve].concat());
        for linear in [0.02f32, 0.2, 0.5] {
            let (seen, told) = of_grey(&settings, linear);
            let independent = independent(&settings);
            let of_spread = 0.05 + 4.0 * f64::sqrt(2.0 / independent);
            // What is clipped at black is mixed into the other colours: no normal distribution is left of that.
            if settings.has("saturation") && linear < 0.1 {
                continue;
            }
            for c in 0..3 {
                let [[mean, variance], [told_mean, told_variance]] = [seen[c], told[c]];
                // Rounding without noise is no noise.
                if told_variance < 0.15 {
                    continue;
                }
                let off = (mean - told_mean).abs() / (0.25 + 4.0 * (variance / independent).sqrt());
                // Few electrons are no normal distribution.
                let most = if linear < 0.1 { of_spread + 0.1 } else { of_spread };
                let ratio = (variance / told_variance - 1.0).abs() / most;
                if !(off < 1.0 && ratio < 1.0) {
                    wrong.push(format!("{noise:?} {curve:?} {linear} {c}: {:?} told {:?}", seen[c], told[c]));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    // Control: without its noise a camera has another mean in the dark, and no spread.
    let dark = settings(&[number("read_noise", "sigma", 0.03)]);
    let (seen, _) = of_grey(&dark, 0.005);
    let (_, silent) = of_grey(&Settings::default(), 0.005);
    assert!(seen[1][0] - silent[1][0] > 3.0 && seen[1][1] > 100.0 * silent[1][1], "{seen:?} {silent:?}");
}

/// What the steps of a camera that mix pixels make of white noise, over what is said of it: pixels, bands, lines.
fn ratios(settings: &Settings) -> (Mixing, [f32; 6]) {
    let (mixing, seen) = (chain::mixing(LIST, settings), mixed(&normal_noise([512, 512]), settings));
    let all: f32 = mixing.pixel.iter().sum();
    let mean = |of: &dyn Fn(usize) -> f32| (0..3).map(|c| mixing.pixel[c] * of(c)).sum::<f32>() / all;
    let pixel = square(seen.data.iter().copied());
    let bands = [0, 1, 2].map(|i| {
        let n = BANDS[i];
        band(&seen, n) / (0.75 * pixel / (n * n) as f32) / mean(&|c| mixing.left[c].bands[i])
    });
    let lines = [0, 1].map(|i| lines(&seen, i == 0) / pixel / mean(&|c| mixing.left[c].lines[i]));
    (mixing, [3.0 * pixel / all, bands[0], bands[1], bands[2], lines[0], lines[1]])
}

#[test]
fn steps_that_mix_pixels_leave_of_noise_what_they_say() {
    let cases: &[Given<'_>] = &[
        &[number("sharpening", "amount", 0.7), number("sharpening", "radius_px", 1.5)],
        &[word("bayer_mosaic", "pattern", "BGGR")],
        &[word("bayer_mosaic", "pattern", "RGGB"), word("bayer_mosaic", "demosaic", "malvar_he_cutler")],
        &[number("noise_reduction", "luma_sigma_px", 0.7), number("noise_reduction", "chroma_sigma_px", 1.5)],
    ];
    for given in cases {
        let (mixing, ratios) = ratios(&settings(given));
        for (k, ratio) in ratios.into_iter().enumerate() {
            let most = if k < 4 { 0.08 } else { 0.15 };
            assert!((ratio - 1.0).abs() < most, "{given:?}: {ratios:?}");
        }
        // Control: white noise would have the same of all.
        let left = mixing.left[1];
        assert!((mixing.pixel[1] - 1.0).abs() > 0.2 && (left.bands[2] - 1.0).abs() > 0.3, "{mixing:?}");
    }
}

/// Noise reduction and sharpening that undo each other.
const FILTERS: [(&str, &str, f64); 4] = [
    ("noise_reduction", "luma_sigma_px", 0.58),
    ("noise_reduction", "chroma_sigma_px", 1.1),
    ("sharpening", "amount", 1.0),
    ("sharpening", "radius_px", 0.9),
];

#[test]
fn filters_together_leave_of_noise_what_they_say() {
    let filters = FILTERS.map(|(effect, name, value)| number(effect, name, value));
    let (bilinear, malvar) = ("bilinear", "malvar_he_cutler");
    for demosaic in [None, Some(bilinear), Some(malvar)] {
        let mosaic =
            demosaic.map(|d| [word("bayer_mosaic", "pattern", "GRBG"), word("bayer_mosaic", "demosaic", d)]);
        let given: Vec<_> = mosaic.into_iter().flatten().chain(filters).collect();
        let (mixing, ratios) = ratios(&settings(&given));
        for (k, ratio) in ratios.into_iter().enumerate() {
            assert!((ratio - 1.0).abs() < if k < 4 { 0.03 } else { 0.15 }, "{demosaic:?}: {ratios:?}");
        }
        // Control: one behind the other, as if the noise were white between them.
        let alone = |given: Given<'_>| chain::mixing(LIST, &settings(given)).pixel[1];
        let white = alone(&filters[..2]) * alone(&filters[2..]) * mosaic.map_or(1.0, |m| alone(&m));
        assert!((white / mixing.pixel[1] - 1.0).abs() > 0.08, "{demosaic:?}: {white}, {mixing:?}");
    }
}

#[test]
fn rows_behind_a_mosaic_and_filters_keep_what_they_say() {
    let noise = normal_noise([1, 4096]);
    let rows = Plane::from_fn(16, 4096, |_, y| [noise.pixel(0, y)[0]; 3]);
    let strong = [("noise_reduction", "luma_sigma_px", 2.1), ("noise_reduction", "chroma_sigma_px", 2.6)];
    for (filters, mosaic) in [
        (&FILTERS[..], None),
        (&FILTERS[..], Some(word("bayer_mosaic", "pattern", "RGGB"))),
        (&strong[..], None),
    ] {
        let filters = filters.iter().map(|&(effect, name, value)| number(effect, name, value));
        let given: Vec<_> = mosaic.into_iter().chain(filters).collect();
        let settings = settings(&given);
        let (mixing, seen) = (chain::mixing(LIST, &settings), mixed(&rows, &settings));
        let ahead = square(noise.data.iter().step_by(3).copied());
        for c in 0..3 {
            let kept = square(seen.data.iter().skip(c).step_by(3).copied()) / ahead;
            assert!((kept / mixing.row[c] - 1.0).abs() < 0.05, "{mosaic:?} {c}: {kept}, {mixing:?}");
        }
        let mean = |y: usize| seen.data[y * 48..y * 48 + 48].iter().sum::<f32>() / 48.0;
        let beside = |apart: usize| {
            let one = |y: usize| mean(y) - 0.5 * (mean(y - apart) + mean(y + apart));
            square((apart..4096 - apart).map(one)) / 1.5 / ahead
        };
        let kept = beside(chain::DISTANCES[1]);
        assert!((kept / mixing.row_seen - 1.0).abs() < 0.05, "{mosaic:?}: {kept}, {mixing:?}");
        let near = beside(1);
        assert!((near / mixing.row_seen - 1.0).abs() > 0.1, "control: neighbours say {near}, {mixing:?}");
    }
}

#[test]
fn colour_that_pixels_share_keeps_of_filtered_noise_what_is_said() {
    let filters = FILTERS.map(|(effect, name, value)| number(effect, name, value));
    let mosaic = [word("bayer_mosaic", "pattern", "RGGB")];
    for ahead in [&[][..], &filters[..], &mosaic[..]] {
        for scheme in ["4:2:0", "4:2:2"] {
            let shares = [word("chroma_subsampling", "scheme", scheme)];
            let given: Vec<_> = ahead.iter().chain(&shares).copied().collect();
            let settings = settings(&given);
            let mixing = chain::mixing(LIST, &settings);
            let seen = mixed(&normal_noise([512, 512]), &settings);
            let shared = mixing.shared.expect("they share");
            for c in 0..3 {
                let told: f32 = (0..3).map(|from| shared[c][from] * mixing.pixel[from]).sum();
                let seen = square(seen.data.iter().skip(c).step_by(3).copied());
                assert!((seen / told - 1.0).abs() < 0.03, "{given:?} {c}: {seen}, told {told}");
            }
        }
    }
}

#[test]
fn the_coefficients_of_a_block_have_of_mixed_noise_what_is_said() {
    let filters = FILTERS.map(|(effect, name, value)| number(effect, name, value));
    let mosaic = [word("bayer_mosaic", "pattern", "RGGB")];
    let shares = [word("chroma_subsampling", "scheme", "4:2:0")];
    let (dct, noise) = (Dct::new(), normal_noise([768, 512]));
    let both = [filters[0], filters[1], shares[0]];
    for given in [&filters[..2], &filters[..], &mosaic[..], &shares[..], &both[..]] {
        let settings = settings(given);
        let (grain, mixing) = (Grain::of(&settings), chain::mixing(LIST, &settings));
        let seen = mixed(&noise, &settings);
        for (k, weights) in TO_YCC.iter().enumerate() {
            let mut sums = [0.0f32; AREA];
            for b in 0..96 * 64 {
                let block = std::array::from_fn(|i| {
                    let p = seen.pixel(b % 96 * SIDE + i % SIDE, b / 96 * SIDE + i / SIDE);
                    (0..3).map(|c| weights[c] * p[c]).sum()
                });
                sums.iter_mut().zip(dct.forward(&block)).for_each(|(s, v)| *s += v * v / (96.0 * 64.0));
            }
            let white: f32 = (0..3).map(|c| weights[c] * weights[c] * mixing.pixel[c]).sum();
            for (i, sum) in sums.iter().enumerate() {
                let (seen, told) = (sum / white, grain.own(k, i));
                assert!((seen - told).abs() < 0.1 * told + 0.01, "{given:?} {k} {i}: {seen}, told {told}");
            }
        }
        // Control: white noise would have as much in all of them.
        let (least, most) = (grain.own(1, AREA - 1), grain.own(1, 0));
        assert!(least < 0.8 * most, "{given:?}: {least} {most}");
    }
}

#[test]
fn shared_colour_takes_noise_from_the_other_colours() {
    let effect = by_id("chroma_subsampling").expect("an effect");
    let Work::Neighbourhood { reference, .. } = effect.work() else { panic!("it mixes pixels") };
    // Noise in red alone.
    let noise = normal_noise([256, 256]);
    let red = Plane::from_fn(256, 256, |x, y| [noise.pixel(x, y)[0], 0.0, 0.0]);
    for scheme in ["4:2:0", "4:2:2"] {
        let settings = settings(&[word("chroma_subsampling", "scheme", scheme)]);
        let packed = Packed::new(LIST, &settings, &view(256, 256, 0));
        let seen = reference(&red, &settings, &packed.parameters(0));
        let told = chain::mixing(LIST, &settings).shared.expect("they share");
        for (of, told) in told.iter().enumerate() {
            let seen = square(seen.data.iter().skip(of).step_by(3).copied());
            assert!((seen / told[0] - 1.0).abs() < 0.05, "{scheme} {of}: {seen}, told {}", told[0]);
        }
        assert!((told[0][0] - 1.0).abs() > 0.2, "control: red keeps less");
    }
}

#[test]
fn some_pixels_are_what_they_are_among_all_where_nothing_mixes_neighbours() {
    let given = settings(&[
        number("vignetting", "a1", -0.4),
        number("flicker", "depth", 0.3),
        number("flicker", "frequency_hz", 100.0),
        number("glare", "veil", 0.1),
        number("read_noise", "sigma", 0.02),
        number("gamma", "exponent", 1.2),
        number("saturation", "factor", 1.3),
    ]);
    assert!(is_pointwise(&given));
    let (tone, linear) = (Tone::new(&given), three(&radiance()));
    for scan_order in [ScanOrder::BottomToTop, ScanOrder::LeftToRight] {
        let mut view = view(42, 31, 3);
        view.shutter.scan_order = scan_order;
        view.shutter.line_count = scan_order.line_count(42, 31);
        let all = expected(&linear, &given, &view, &tone);
        for on in
            [Lattice { first: 1, step: 3 }, Lattice { first: 0, step: 2 }, Lattice { first: 5, step: 11 }]
        {
            let some = expected_on(&on.of(&linear), on, &given, &view, &tone, &[]);
            assert_eq!(some, on.of(&all), "{on:?} {scan_order:?}");
        }
        // Control: elsewhere in the picture they are others.
        let on = Lattice { first: 1, step: 3 };
        let elsewhere =
            expected_on(&on.of(&linear), Lattice { first: 0, step: 3 }, &given, &view, &tone, &[]);
        assert_ne!(elsewhere, on.of(&all));
    }
    for mixing in [number("defocus", "sigma_px", 1.0), number("jpeg", "quality", 80.0)] {
        assert!(!is_pointwise(&settings(&[mixing])), "{mixing:?}");
    }
}
