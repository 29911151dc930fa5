//! `paper_noise` through the whole engine: its variance by channel, white over frames, a fixed pattern that stays, no
//! drift, and the same bits for the same seed. Bounds are 5 sigma of the statistic.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::frames::{accumulation, engine, linear, options, still};
use crate::gpu_support::scenes::drawable;
use crate::gpu_support::{Watched, device};
use crate::oracle_forms::{pan, quads, rectangle};
use shutterbug::camera::Intrinsics;
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::PaperNoise;
use shutterbug::engine::{Engine, EngineOptions, FrameRequest};
use shutterbug::plane::{Plane, srgb_encode};

const K: Intrinsics = Intrinsics { width: 32, height: 24, fx: 30.0, fy: 30.0, cx: 16.0, cy: 12.0 };
const PIXELS: usize = 32 * 24;
/// Radiance of the grey wall by channel, and the variances asked for.
const WALL: [f32; 3] = [0.2, 0.3, 0.25];
const VARIANCE: [f64; 3] = [1e-4, 4e-4, 2.25e-4];
/// Frames of a statistic.
const FRAMES: u32 = 60;

fn grey(watched: &Watched) -> Engine {
    let mut scene = quads(&[rectangle([-9.0, 9.0], [-9.0, 9.0], 2.0)]);
    scene.materials[0].kd = WALL;
    let options = EngineOptions { planes: false, ..options(accumulation(1), 1) };
    engine(watched, &drawable(scene), &pan(0.0), K, options, &[])
}

fn settings(part: &str) -> Settings {
    let mut settings = Settings::default();
    for (channel, variance) in ["r", "g", "b"].into_iter().zip(VARIANCE) {
        let name = format!("{part}_variance_{channel}");
        settings.set(&PaperNoise, &name, Value::Number(variance)).unwrap();
    }
    settings
}

fn frame(engine: &mut Engine, index: u32, seed: u64, settings: &Settings) -> Plane<u8> {
    let request = FrameRequest { index, seed, settings: settings.clone(), ..still(&K) };
    engine.render(&request).unwrap().picture
}

/// Noise of a channel over frames, as linear radiance less the wall's: `frames[f][pixel]`.
fn noise(engine: &mut Engine, first: u32, settings: &Settings, channel: usize) -> Vec<Vec<f64>> {
    let wall = f64::from(WALL[channel]);
    let of_frame = |index: u32| {
        let seen = linear(&frame(engine, first + index, 11, settings));
        seen.data.chunks_exact(3).map(|p| f64::from(p[channel]) - wall).collect()
    };
    (0..FRAMES).map(of_frame).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    sum / count
}

/// Variance of the rounding to 8 bits, as linear radiance.
fn rounding_variance(channel: usize) -> f64 {
    let slope = f64::from((srgb_encode(WALL[channel] + 1e-3) - srgb_encode(WALL[channel] - 1e-3)) / 2e-3);
    (1.0 / (255.0 * slope)).powi(2) / 12.0
}

#[test]
fn variance_is_that_of_the_settings_and_does_not_drift() {
    let Some(watched) = device("variance_is_that_of_the_settings_and_does_not_drift") else { return };
    let mut engine = grey(&watched);
    let count = f64::from(FRAMES) * PIXELS as f64;
    for part in ["color", "static"] {
        for first in [0, 1_000_000, u32::MAX - FRAMES] {
            for channel in 0..3 {
                let frames = noise(&mut engine, first, &settings(part), channel);
                let (sigma, n) =
                    (VARIANCE[channel].sqrt(), if part == "color" { count } else { PIXELS as f64 });
                let average = mean(frames.iter().flatten().copied());
                let variance = mean(frames.iter().flatten().map(|v| v * v)) - rounding_variance(channel);
                // Rounding is not quite independent of the value: 2 % of its own sigma.
                let off_mean = average.abs() / (sigma / n.sqrt() + 2e-5);
                let off = |want: f64| (variance / want - 1.0).abs() / ((2.0 / n).sqrt() + 0.003);
                eprintln!(
                    "{part} from frame {first}, channel {channel}: mean {average:.2e}, variance {variance:.3e}"
                );
                assert!(off_mean < 5.0, "{part}, frame {first}, channel {channel}: mean {average}");
                assert!(off(VARIANCE[channel]) < 5.0, "{part}, frame {first}, channel {channel}: {variance}");
                let other = VARIANCE[(channel + 1) % 3];
                assert!(off(other) > 5.0, "control: {variance} passes for {other}");
            }
        }
    }
}

/// Correlation of two lists of noise in its own sigmas.
fn correlation(pairs: impl Iterator<Item = (f64, f64)> + Clone, variance: f64) -> f64 {
    let count = pairs.clone().count() as f64;
    pairs.map(|(a, b)| a * b).sum::<f64>() / (variance * count.sqrt())
}

#[test]
fn colour_noise_is_white_over_frames_pixels_and_channels() {
    let Some(watched) = device("colour_noise_is_white_over_frames_pixels_and_channels") else { return };
    let mut engine = grey(&watched);
    for (part, white) in [("color", true), ("static", false)] {
        let red = noise(&mut engine, 500, &settings(part), 0);
        let green = noise(&mut engine, 500, &settings(part), 1);
        let variance = VARIANCE[0] + rounding_variance(0);
        for lag in [1, 2, 7] {
            let frames = red.iter().zip(&red[lag..]);
            let pairs = frames.flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied()));
            let sigmas = correlation(pairs, variance);
            eprintln!("{part}: frames {lag} apart correlate by {sigmas:.1} sigma");
            assert_eq!(
                sigmas.abs() < 5.0,
                white,
                "{part}, lag {lag}: {sigmas} sigma (the fixed pattern is the control)"
            );
        }
        let next = red.iter().flat_map(|f| f.windows(2).map(|w| (w[0], w[1])));
        let channels = red.iter().flatten().copied().zip(green.iter().flatten().copied());
        // A fixed pattern is the same sample of pixels in every frame, so its sigma is larger by the root of 60.
        let bound = if white { 5.0 } else { 5.0 * f64::from(FRAMES).sqrt() };
        assert!(correlation(next, variance).abs() < bound, "{part}: neighbours");
        let both = (variance * (VARIANCE[1] + rounding_variance(1))).sqrt();
        assert!(correlation(channels, both).abs() < bound, "{part}: channels");
    }
}

#[test]
fn the_fixed_pattern_stays_for_a_thousand_frames() {
    let Some(watched) = device("the_fixed_pattern_stays_for_a_thousand_frames") else { return };
    let mut engine = grey(&watched);
    let fixed = settings("static");
    let first = frame(&mut engine, 0, 11, &fixed);
    for index in (1..1000).chain([1_000_000, u32::MAX]) {
        assert!(frame(&mut engine, index, 11, &fixed) == first, "frame {index}");
    }
    let color = settings("color");
    let (a, b) = (frame(&mut engine, 0, 11, &color), frame(&mut engine, 1, 11, &color));
    assert_ne!(a, b, "control: colour noise is new in every frame");
    assert_ne!(first, frame(&mut engine, 0, 11, &Settings::default()), "control: there is a pattern");
}

#[test]
fn bits_follow_from_seed_and_frame_alone() {
    let Some(watched) = device("bits_follow_from_seed_and_frame_alone") else { return };
    let (mut one, mut other) = (grey(&watched), grey(&watched));
    for part in ["static", "color"] {
        let settings = settings(part);
        let first = frame(&mut one, 9, 77, &settings);
        // Other frames before it, in another engine.
        frame(&mut other, 3, 5, &settings);
        assert_eq!(first, frame(&mut other, 9, 77, &settings), "{part}");
        for seed in [78, 77 + (1 << 32), 0] {
            let share = crate::gpu_support::frames::levels(&first, &frame(&mut one, 9, seed, &settings)).2;
            assert!(share > 0.5, "{part}, seed {seed}: only {share} of the bytes change");
        }
    }
}

#[test]
fn edge_noise_is_where_the_edges_are() {
    let Some(watched) = device("edge_noise_is_where_the_edges_are") else { return };
    let mut scene = quads(&[rectangle([-9.0, 0.01], [-9.0, 9.0], 2.0)]);
    scene.materials[0].kd = [0.3; 3];
    let options = EngineOptions { planes: false, ..options(accumulation(1), 16) };
    let mut engine = engine(&watched, &drawable(scene), &pan(0.0), K, options, &[]);
    let clean = frame(&mut engine, 0, 1, &Settings::default());
    let mut changed = vec![0u32; 32];
    for index in 0..FRAMES {
        let noisy = frame(&mut engine, index, 1, &settings("edge"));
        for (x, count) in changed.iter_mut().enumerate() {
            *count += (0..24).filter(|&y| noisy.pixel(x, y) != clean.pixel(x, y)).count() as u32;
        }
    }
    eprintln!("pixels changed by column: {changed:?}");
    // The edge stands at x = 16.15: its gradient reaches columns 15 to 17.
    let total = 24 * FRAMES;
    for (x, &count) in changed.iter().enumerate() {
        assert!(
            if (15..=16).contains(&x) { count > total / 2 } else { x == 17 || x == 14 || count == 0 },
            "{x}: {count}"
        );
    }
}
