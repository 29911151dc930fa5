//! Statistics of the sensor's noise, by the definitions of EMVA 1288. Bounds are five standard deviations of the
//! statistic; seeds are fixed, so a pass stays a pass. Every bound is shown to refuse a wrong parameter.
#![allow(clippy::unwrap_used)]

use crate::effects_support::{channel, correlation, flat, moments, neighbour_correlation, settings, view};
use shutterbug::chain::{Settings, Value, View};
use shutterbug::effects::{BayerMosaic, LIST};
use shutterbug::plane::Plane;
use shutterbug::reference::chain::values;

const SIGMAS: f64 = 5.0;
const SIDE: u32 = 160;
const COUNT: f64 = (SIDE * SIDE * 3) as f64;

/// All three channels of a flat grey picture.
fn grey(of: &Settings, view: &View, level: f32) -> Vec<f64> {
    let seen = flat(of, view, [level; 3]);
    (0..3).flat_map(|c| channel(&seen, c)).collect()
}

/// Variance over the level, as (slope, intercept, their standard deviations), by least squares with weights from the
/// expected variances.
fn photon_transfer(of: &Settings, full_well_e: f64, read_sigma: f64) -> [(f64, f64); 2] {
    let (mut s, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for step in 0..12 {
        let level = 0.02 + 0.08 * f64::from(step);
        let (mean, variance, _) = moments(&grey(of, &View { frame: step, ..view(SIDE, SIDE) }, level as f32));
        let expected = level / full_well_e + read_sigma * read_sigma;
        assert!((mean - level).abs() < SIGMAS * (expected / COUNT).sqrt(), "mean {mean} for {level}");
        let weight = COUNT / (2.0 * expected * expected);
        s += weight;
        sx += weight * level;
        sxx += weight * level * level;
        sy += weight * variance;
        sxy += weight * level * variance;
    }
    let determinant = s * sxx - sx * sx;
    let slope = (s * sxy - sx * sy) / determinant;
    let intercept = (sxx * sy - sx * sxy) / determinant;
    [(slope, (s / determinant).sqrt()), (intercept, (sxx / determinant).sqrt())]
}

#[test]
fn photon_transfer_gives_full_well_and_read_noise_back() {
    let (full_well_e, sigma) = (2000.0, 0.012);
    let of = settings(&[("shot_noise", "full_well_e", full_well_e), ("read_noise", "sigma", sigma)]);
    let [(slope, slope_sd), (intercept, intercept_sd)] = photon_transfer(&of, full_well_e, sigma);
    eprintln!(
        "slope 1/{:.1} +- {:.2} %, read noise {:.5}",
        1.0 / slope,
        100.0 * slope_sd / slope,
        intercept.sqrt()
    );
    assert!((slope - 1.0 / full_well_e).abs() < SIGMAS * slope_sd, "{slope}");
    assert!((intercept - sigma * sigma).abs() < SIGMAS * intercept_sd, "{intercept}");
    // Controls: 5 % in the gain, 5 % in the read noise.
    assert!((slope - 1.05 / full_well_e).abs() > SIGMAS * slope_sd);
    assert!((intercept - (1.05 * sigma).powi(2)).abs() > SIGMAS * intercept_sd);
}

#[test]
fn few_photons_are_poisson_not_gaussian() {
    let full_well_e = 100.0;
    for mean in [0.5_f64, 2.0, 6.0, 11.0, 13.0, 40.0] {
        let of = settings(&[("shot_noise", "full_well_e", full_well_e)]);
        let counts: Vec<f64> = grey(&of, &view(SIDE, SIDE), (mean / full_well_e) as f32)
            .iter()
            .map(|v| v * full_well_e)
            .collect();
        assert!(counts.iter().all(|n| (n - n.round()).abs() < 1e-3 && *n > -1e-3), "counts are whole");
        let (got, variance, skewness) = moments(&counts);
        assert!((got - mean).abs() < SIGMAS * (mean / COUNT).sqrt(), "{mean}: mean {got}");
        let variance_sd = ((2.0 * mean * mean + mean) / COUNT).sqrt();
        assert!((variance - mean).abs() < SIGMAS * variance_sd, "{mean}: variance {variance}");
        // Skewness 1/sqrt(mean); its standard deviation for a near-normal is sqrt(6/n), more for few counts.
        let skewness_sd = (6.0 / COUNT).sqrt() * (1.0 + 3.0 / mean);
        assert!((skewness - mean.powf(-0.5)).abs() < SIGMAS * skewness_sd, "{mean}: skewness {skewness}");
        // Control: a Gaussian has none.
        assert!(skewness > SIGMAS * skewness_sd, "{mean}: a Gaussian would pass");
        // Every count as often as it should be.
        let (mut p, mut chi_square, mut bins) = ((-mean).exp(), 0.0, 0.0_f64);
        for n in 0..200 {
            if p * COUNT > 20.0 {
                let seen = counts.iter().filter(|c| c.round() as i32 == n).count() as f64;
                chi_square += (seen - p * COUNT).powi(2) / (p * COUNT);
                bins += 1.0;
            }
            p *= mean / f64::from(n + 1);
        }
        assert!(chi_square < bins + SIGMAS * (2.0 * bins).sqrt(), "{mean}: chi^2 {chi_square} of {bins}");
    }
    let dark = grey(&settings(&[("shot_noise", "full_well_e", 100.0)]), &view(8, 8), 0.0);
    assert!(dark.iter().all(|v| *v == 0.0), "no light, no noise");
}

#[test]
fn the_fixed_pattern_belongs_to_the_sensor() {
    let of = |seed: f64| {
        settings(&[
            ("fixed_pattern_noise", "dsnu", 0.02),
            ("fixed_pattern_noise", "prnu", 0.05),
            ("fixed_pattern_noise", "sensor_seed", seed),
        ])
    };
    let small = view(16, 12);
    let first = flat(&of(1.0), &small, [0.5; 3]);
    for frame in 0..1000 {
        // Another frame of another run.
        let later = View { frame, seed: 99 + u64::from(frame), ..small };
        assert_eq!(flat(&of(1.0), &later, [0.5; 3]), first, "frame {frame}");
    }
    assert_ne!(flat(&of(2.0), &small, [0.5; 3]), first, "two sensors are alike");
    let read = settings(&[("read_noise", "sigma", 0.02)]);
    let noisy = |frame| flat(&read, &View { frame, ..small }, [0.5; 3]);
    assert_ne!(noisy(0), noisy(1), "control: read noise is new in every frame");
    // EMVA 1288: DSNU is the spread in the dark, PRNU what light adds over the light.
    let spread = |level: f32| moments(&grey(&of(1.0), &view(SIDE, SIDE), level)).1;
    let (dark, bright) = (spread(0.0), spread(0.8));
    let sd = (2.0 / COUNT).sqrt();
    assert!((dark.sqrt() / 0.02 - 1.0).abs() < SIGMAS * 0.5 * sd, "DSNU {}", dark.sqrt());
    let prnu = (bright - dark).sqrt() / 0.8;
    let prnu_sd = 0.5 * sd * (bright * bright + dark * dark).sqrt() / (bright - dark);
    assert!((prnu / 0.05 - 1.0).abs() < SIGMAS * prnu_sd, "PRNU {prnu}");
    assert!((prnu / 0.053 - 1.0).abs() > SIGMAS * prnu_sd, "control: 6 % more PRNU would pass");
}

#[test]
fn rows_and_columns_share_their_noise() {
    let tall = view(24, 4000);
    let of = settings(&[("row_noise", "sigma", 0.03)]);
    let seen = flat(&of, &tall, [0.5; 3]);
    let rows: Vec<f64> = (0..4000).map(|y| f64::from(seen.pixel(0, y)[0]) - 0.5).collect();
    for (y, row) in rows.iter().enumerate() {
        let same = |p: &[f32]| p[..3].iter().all(|v| (f64::from(*v) - 0.5 - row).abs() < 1e-6);
        assert!(seen.row(y).chunks_exact(4).all(same), "row {y}");
    }
    let (_, variance, _) = moments(&rows);
    let sd = (2.0_f64 / 4000.0).sqrt();
    assert!((variance / 9e-4 - 1.0).abs() < SIGMAS * sd, "{variance}");
    assert!((variance / 12e-4 - 1.0).abs() > SIGMAS * sd, "control");
    let next = flat(&of, &View { frame: 4, ..tall }, [0.5; 3]);
    let others: Vec<f64> = (0..4000).map(|y| f64::from(next.pixel(0, y)[0]) - 0.5).collect();
    assert!(correlation(&rows, &others).abs() < SIGMAS / 4000_f64.sqrt(), "rows repeat from frame to frame");
    let column = flat(&settings(&[("row_noise", "column_sigma", 0.03)]), &view(64, 8), [0.5; 3]);
    assert_eq!(column.row(0), column.row(7));
    assert_ne!(column.pixel(0, 0), column.pixel(1, 0), "control: columns differ");
}

#[test]
fn hot_pixels_stay_where_they_are() {
    let of = settings(&[("hot_pixels", "count", 40.0)]);
    let hot = |view: &View| -> Vec<usize> {
        let seen = channel(&flat(&of, view, [0.2; 3]), 1);
        (0..seen.len()).filter(|i| seen[*i] == 1.0).collect()
    };
    let view = view(100, 80);
    let first = hot(&view);
    assert_eq!(first.len(), 40);
    for frame in 0..50 {
        assert_eq!(hot(&View { frame, seed: u64::from(frame), ..view }), first);
    }
    // Spread over the picture: each quarter has some.
    for quarter in 0..4 {
        let inside =
            |i: &&usize| (*i % 100 >= 50) == (quarter % 2 == 1) && (*i / 100 >= 40) == (quarter / 2 == 1);
        assert!(first.iter().filter(inside).count() >= 3, "quarter {quarter}");
    }
}

#[test]
fn read_noise_may_linger() {
    for wanted in [0.0, 0.5, 0.8] {
        let of = settings(&[("read_noise", "sigma", 0.02), ("read_noise", "frame_correlation", wanted)]);
        let frame = |frame: u32| grey(&of, &View { frame, ..view(SIDE, SIDE) }, 0.5);
        let frames = [frame(100), frame(101), frame(102)];
        let sd = 1.0 / COUNT.sqrt();
        let (_, variance, _) = moments(&frames[2]);
        assert!((variance / 4e-4 - 1.0).abs() < SIGMAS * 2_f64.sqrt() * sd, "{wanted}: {variance}");
        let (one, two) = (correlation(&frames[1], &frames[2]), correlation(&frames[0], &frames[2]));
        eprintln!("correlation {wanted}: {one:.4} to the frame before, {two:.4} to the one before that");
        assert!((one - wanted).abs() < SIGMAS * sd + 1e-3, "{wanted}: {one}");
        assert!((two - wanted * wanted).abs() < SIGMAS * sd + 2e-3, "{wanted}: {two}");
    }
}

/// Neighbour correlation of about 0.7, as measured in real frames of a humanoid robot's camera, from white noise on the
/// sensor: the mosaic's interpolation spreads it, the ISP's softening more.
#[test]
fn demosaic_and_softening_correlate_neighbours() {
    let sized = view(SIDE, SIDE);
    let radiance = Plane::from_fn(SIDE as usize, SIDE as usize, |_, _| [0.3, 0.3, 0.3, 1.0]);
    let mean_correlation = |mosaic: bool, softening: f64| {
        let mut of = settings(&[
            ("read_noise", "sigma", 0.01),
            ("sharpening", "amount", softening),
            ("sharpening", "radius_px", 0.8),
        ]);
        if mosaic {
            of.set(&BayerMosaic, "pattern", Value::Choice("RGGB")).unwrap();
        }
        let seen = values(LIST, &of, &sized, &radiance);
        let pairs = (0..3).map(|c| neighbour_correlation(&channel(&seen, c), SIDE as usize));
        pairs.map(|(h, v)| (h + v) / 6.0).sum::<f64>()
    };
    let [white, mosaic, both, sharpened] =
        [(false, 0.0), (true, 0.0), (true, -0.5), (true, 0.8)].map(|(m, s)| mean_correlation(m, s));
    eprintln!(
        "neighbour correlation: white {white:.3}, mosaic {mosaic:.3}, softened {both:.3}, sharpened {sharpened:.3}"
    );
    assert!(white.abs() < SIGMAS / COUNT.sqrt(), "control: white noise has none ({white})");
    assert!((0.3..0.6).contains(&mosaic), "{mosaic}");
    assert!((both - 0.7).abs() < 0.05, "{both}");
    assert!(sharpened < mosaic, "control: sharpening takes it away");
}
