use glam::DVec2;
use proptest::prelude::*;

use super::*;
use crate::camera::Intrinsics;
use crate::error::Error;

/// Of cycles-dev/d03: an outward (pincushion) lens.
const D03: Distortion = Distortion::BrownConrady { k: [0.19449, -0.01467, 0.0], p: [0.0; 2] };
const D03_PINHOLE: Intrinsics =
    Intrinsics { width: 320, height: 240, fx: 298.44, fy: 298.44, cx: 156.93, cy: 117.47 };

/// Brown-Conrady as OpenCV's documentation of calib3d writes it, term by term.
fn opencv_slowly(x: f64, y: f64, k1: f64, k2: f64, p1: f64, p2: f64, k3: f64) -> (f64, f64) {
    let r = x.hypot(y);
    let radial = 1.0 + k1 * r.powi(2) + k2 * r.powi(4) + k3 * r.powi(6);
    let x2 = x * radial + 2.0 * p1 * x * y + p2 * (r.powi(2) + 2.0 * x.powi(2));
    let y2 = y * radial + p1 * (r.powi(2) + 2.0 * y.powi(2)) + 2.0 * p2 * x * y;
    (x2, y2)
}

/// The fisheye as OpenCV's documentation writes it: angles, then polar coordinates.
fn fisheye_slowly(x: f64, y: f64, k: [f64; 4]) -> (f64, f64) {
    let theta = x.hypot(y).atan();
    let bent =
        theta + k[0] * theta.powi(3) + k[1] * theta.powi(5) + k[2] * theta.powi(7) + k[3] * theta.powi(9);
    let azimuth = y.atan2(x);
    (bent * azimuth.cos(), bent * azimuth.sin())
}

#[test]
fn both_models_are_opencvs() {
    let (k, p) = ([-0.2834, 0.0740, -0.0123], [0.00193, -0.00176]);
    let fish = [-0.0137, 0.0207, -0.0128, 0.0025];
    for (x, y) in [(0.0, 0.0), (1e-7, 2e-7), (0.3, -0.2), (-0.8, 0.45), (0.0, 0.61), (0.05, 0.0)] {
        let got = Distortion::BrownConrady { k, p }.distort(DVec2::new(x, y));
        let want = opencv_slowly(x, y, k[0], k[1], p[0], p[1], k[2]);
        assert!((got - DVec2::from(want)).length() < 1e-15, "{x} {y}: {got} {want:?}");
        let got = Distortion::Equidistant { k: fish }.distort(DVec2::new(x, y));
        let want = fisheye_slowly(x, y, fish);
        assert!((got - DVec2::from(want)).length() < 1e-15, "{x} {y}: {got} {want:?}");
        // Control: the tangential pair the other way round is another lens.
        let swapped = Distortion::BrownConrady { k, p: [p[1], p[0]] }.distort(DVec2::new(x, y));
        let right = Distortion::BrownConrady { k, p }.distort(DVec2::new(x, y));
        assert!((swapped - right).length() > 1e-5 || x.hypot(y) < 0.1);
    }
}

/// The rational model as OpenCV's documentation writes it, term by term.
fn rational_slowly(x: f64, y: f64, k: [f64; 6], p: [f64; 2]) -> (f64, f64) {
    let r = x.hypot(y);
    let radial = (1.0 + k[0] * r.powi(2) + k[1] * r.powi(4) + k[2] * r.powi(6))
        / (1.0 + k[3] * r.powi(2) + k[4] * r.powi(4) + k[5] * r.powi(6));
    let x2 = x * radial + 2.0 * p[0] * x * y + p[1] * (r.powi(2) + 2.0 * x.powi(2));
    let y2 = y * radial + p[0] * (r.powi(2) + 2.0 * y.powi(2)) + 2.0 * p[1] * x * y;
    (x2, y2)
}

/// The ideal point of a distorted one by halving: along the ray from the axis, for a mapping that only stretches.
fn inverse_slowly(distorted: f64, limit: f64, mapping: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, limit);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if mapping(middle) < distorted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[test]
fn the_rational_model_is_opencvs() {
    // Of a wide depth camera's colour sensor, as its maker's software prints such lenses.
    let (k, p) = ([0.4523, -2.6174, 1.5112, 0.3349, -2.4455, 1.4386], [0.00071, -0.00013]);
    for (x, y) in [(0.0, 0.0), (1e-7, 2e-7), (0.3, -0.2), (-0.5, 0.45), (0.0, 0.61), (0.05, 0.0)] {
        let got = Distortion::Rational { k, p }.distort(DVec2::new(x, y));
        let want = rational_slowly(x, y, k, p);
        assert!((got - DVec2::from(want)).length() < 1e-15, "{x} {y}: {got} {want:?}");
    }
    // Control: the numerator alone is another lens.
    let cut = Distortion::BrownConrady { k: [k[0], k[1], k[2]], p }.distort(DVec2::new(0.5, 0.3));
    assert!((cut - DVec2::from(rational_slowly(0.5, 0.3, k, p))).length() > 0.05);
}

/// The inverse of every model that only stretches against bisection of formulas that are not the library's.
#[test]
fn the_inverse_is_bisections_to_a_trillionth() {
    let (fish, quotient) = ([-0.0137, 0.0207, -0.0128, 0.0025], [0.52, -0.03, 0.002, 0.9, 0.1, 0.01]);
    type Slowly = Box<dyn Fn(f64) -> f64>;
    let models: [(Distortion, Distortion, Slowly); 4] = [
        (
            Distortion::Equidistant { k: fish },
            Distortion::Equidistant { k: [-0.0136, 0.0207, -0.0128, 0.0025] },
            Box::new(move |r| fisheye_slowly(r, 0.0, fish).0),
        ),
        (
            Distortion::Rational { k: quotient, p: [0.0; 2] },
            Distortion::Rational { k: [0.52, -0.03, 0.002, 0.9, 0.1001, 0.01], p: [0.0; 2] },
            Box::new(move |r| rational_slowly(r, 0.0, quotient, [0.0; 2]).0),
        ),
        (
            Distortion::Division { k1: -0.3 },
            Distortion::Division { k1: -0.2999 },
            // The quadratic's root by its schoolbook formula.
            Box::new(|r| if r == 0.0 { 0.0 } else { (1.0 - (1.0 + 1.2 * r * r).sqrt()) / (-0.6 * r) }),
        ),
        (
            Distortion::Division { k1: 0.2 },
            Distortion::Division { k1: 0.2001 },
            Box::new(|r| if r == 0.0 { 0.0 } else { (1.0 - (1.0 - 0.8 * r * r).sqrt()) / (0.4 * r) }),
        ),
    ];
    for (lens, wrong, slowly) in models {
        let limit = invertible_radius(&lens, 3.0);
        let (mut worst, mut control) = (0.0f64, 0.0f64);
        for step in 1..100 {
            let distorted = slowly(0.97 * limit * f64::from(step) / 100.0);
            let want = inverse_slowly(distorted, limit, &slowly);
            let n = DVec2::from_angle(f64::from(step));
            let off = |lens: &Distortion| {
                let got = lens.undistort_within(n * distorted, invertible_radius(lens, 3.0));
                (got.expect("inside") - n * want).length() / (1.0 + want)
            };
            (worst, control) = (worst.max(off(&lens)), control.max(off(&wrong)));
        }
        println!(
            "{lens:?}: off by at most {worst:.1e} focal lengths, with a wrong coefficient {control:.1e}"
        );
        assert!(worst < 1e-12, "{lens:?}: {worst:e}");
        assert!(control > 1e-6, "control: {wrong:?}: {control:e}");
    }
}

#[test]
fn the_small_angle_series_joins_the_formula() {
    let lens = Distortion::Equidistant { k: [-0.1, 0.2, 0.0, 0.0] };
    for r in [0.99e-4, 0.999_999e-4, 1.000_001e-4, 1.01e-4] {
        let want = fisheye_slowly(r, 0.0, [-0.1, 0.2, 0.0, 0.0]).0;
        assert!((lens.distort(DVec2::new(r, 0.0)).x - want).abs() < 1e-19, "{r}");
    }
}

#[test]
fn the_lens_of_d03_maps_both_ways() {
    let lens = Lens::new(D03_PINHOLE, D03).expect("invertible");
    let corner = lens.undistort_px(DVec2::ZERO).expect("inside");
    // 0.65 focal lengths out, it moves the corner by more than 10 px towards the centre.
    assert!(corner.x > 10.0 && corner.y > 7.0, "{corner}");
    assert!(lens.distort_px(corner).length() < 1e-9);
    let (low, high) = lens.ideal_bounds_px();
    assert!(low.x > 0.0 && high.x < 320.0, "an outward lens shows less: {low} {high}");
    // Control: applied the wrong way round it does not come back.
    assert!(lens.distort_px(lens.distort_px(DVec2::ZERO)).length() > 20.0);
}

#[test]
fn the_table_holds_what_the_single_calls_give() {
    let lens = Lens::new(D03_PINHOLE, D03).expect("invertible");
    let table = lens.undistortion_table_px();
    assert_eq!(table.len(), 320 * 240);
    for (x, y) in [(0, 0), (319, 0), (17, 201), (319, 239)] {
        let want = lens.undistort_px(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).expect("inside");
        let got = table[(y * 320 + x) as usize];
        assert_eq!(got, [want.x as f32, want.y as f32]);
    }
}

#[test]
fn a_lens_that_folds_inside_the_picture_is_refused_with_the_place() {
    // The fold of k1 = -0.4 is at r = 0.9129, which is distorted to 2/3 of it: 0.6086.
    let pinhole = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
    let with = |k1: f64| Lens::new(pinhole, Distortion::BrownConrady { k: [k1, 0.0, 0.0], p: [0.0; 2] });
    let Err(Error::LensFolds(fold)) = with(-0.4) else { panic!("accepted") };
    let want_px = 500.0 * 2.0 / 3.0 * (1.0f64 / 1.2).sqrt();
    assert!((fold.radius_px - want_px).abs() < 0.01, "{fold:?}, {want_px}");
    assert!((fold.ideal_radius - (1.0f64 / 1.2).sqrt()).abs() < 1e-9);
    let [x, y] = fold.pixel.map(|c| c as f64 + 0.5);
    assert!(((x - 320.0).hypot(y - 240.0) - want_px).abs() < 1.0, "{fold:?}");
    let text = Error::LensFolds(fold).to_string();
    assert!(text.contains("k1 = -0.4") && text.contains("304.3 px from (cx, cy)"), "{text}");
    // Control: the corner, at 0.8, is inside the fold of a weaker lens: (2/3)/sqrt(3 |k1|) = 0.8 at k1 = -0.2315.
    assert!(with(-0.2314).is_ok());
    assert!(with(-0.2316).is_err());
}

#[test]
fn a_fold_by_tangential_coefficients_is_found() {
    let pinhole = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
    let with = |p: f64| Lens::new(pinhole, Distortion::BrownConrady { k: [0.0; 3], p: [0.0, p] });
    // d(distorted x)/dx = 1 + 6 p2 x on the axis y = 0 vanishes inside the picture from |p2| = 1 / (6 0.64) on at the
    // latest.
    assert!(with(0.01).is_ok());
    assert!(with(0.4).is_err());
}

#[test]
fn a_fisheye_that_shows_ninety_degrees_is_refused() {
    let fish = |f: f64| {
        let pinhole = Intrinsics { width: 640, height: 480, fx: f, fy: f, cx: 320.0, cy: 240.0 };
        Lens::new(pinhole, Distortion::Equidistant { k: [0.0; 4] })
    };
    // The corner is 400 px out: 90 degrees if f = 400 / (pi / 2) = 254.6.
    assert!(fish(260.0).is_ok());
    let error = fish(250.0).expect_err("beyond 90 degrees").to_string();
    assert!(error.contains("90 degrees"), "{error}");
}

/// Coefficients as calibrations give them.
fn plausible() -> impl Strategy<Value = Distortion> {
    prop_oneof![
        ([-0.5..0.5, -0.3..0.3, -0.2..0.2f64], [-0.01..0.01, -0.01..0.01f64])
            .prop_map(|(k, p)| Distortion::BrownConrady { k, p }),
        [-0.1..0.1, -0.05..0.05, -0.02..0.02, -0.01..0.01f64].prop_map(|k| Distortion::Equidistant { k }),
        ([-0.5..0.9, -0.3..0.3, -0.1..0.1, 0.0..0.9, -0.1..0.3, 0.0..0.1f64], [-0.01..0.01, -0.01..0.01f64])
            .prop_map(|(k, p)| Distortion::Rational { k, p }),
        (-0.4..0.2f64).prop_map(|k1| Distortion::Division { k1 }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn inside_the_fold_the_round_trip_is_exact(lens in plausible(), angle in 0.0..6.3f64, share in 0.0..0.9f64) {
        let radius = invertible_radius(&lens, 2.0);
        let ideal = DVec2::from_angle(angle) * radius * share;
        let back = lens.undistort_within(lens.distort(ideal), radius);
        prop_assert!(back.is_some(), "{lens:?} {ideal}");
        let error = (back.expect("checked") - ideal).length();
        prop_assert!(error < 1e-10, "{lens:?} {ideal}: {error:e}");
    }

    #[test]
    fn the_jacobian_is_the_slope(lens in plausible(), x in -0.9..0.9f64, y in -0.9..0.9f64) {
        let at = DVec2::new(x, y);
        // At the fold a quotient may have a pole.
        prop_assume!(at.length() < 0.9 * invertible_radius(&lens, 2.0));
        let (_, jacobian) = lens.distort_with_jacobian(at);
        let h = 1e-6;
        for (axis, column) in [(DVec2::X, jacobian.x_axis), (DVec2::Y, jacobian.y_axis)] {
            let slope = (lens.distort(at + axis * h) - lens.distort(at - axis * h)) / (2.0 * h);
            prop_assert!((slope - column).length() < 1e-7, "{lens:?} at {at}: {slope} {column}");
        }
    }

}

proptest! {
    // A refusal searches for the fold, which takes milliseconds.
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Whatever the coefficients, `new` either proves the picture or refuses it.
    #[test]
    fn an_accepted_lens_inverts_every_pixel(lens in plausible(), x in 0.0..640.0f64, y in 0.0..480.0f64) {
        let pinhole = Intrinsics { width: 640, height: 480, fx: 400.0, fy: 410.0, cx: 300.0, cy: 260.0 };
        if let Ok(lens) = Lens::new(pinhole, lens) {
            let px = DVec2::new(x, y);
            let ideal = lens.undistort_px(px);
            prop_assert!(ideal.is_some(), "{px}");
            prop_assert!((lens.distort_px(ideal.expect("checked")) - px).length() < 1e-8);
        }
    }

    #[test]
    fn wild_numbers_do_not_panic(k in [any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()], model in 0..4) {
        let lens = match model {
            0 => Distortion::Equidistant { k },
            1 => Distortion::BrownConrady { k: [k[0], k[1], k[2]], p: [k[3], 0.0] },
            2 => Distortion::Rational { k: [k[0], k[1], 0.0, k[2], k[3], 0.0], p: [0.0; 2] },
            _ => Distortion::Division { k1: k[0] },
        };
        let pinhole = Intrinsics { width: 8, height: 6, fx: 4.0, fy: 4.0, cx: 4.0, cy: 3.0 };
        let _ = Lens::new(pinhole, lens);
    }
}

/// Prints what tables cost; run with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement, not a check"]
fn cost_of_a_lens_and_its_table() {
    let pinhole = Intrinsics { width: 1280, height: 720, fx: 900.0, fy: 900.0, cx: 640.0, cy: 360.0 };
    for model in [
        Distortion::BrownConrady { k: [-0.28, 0.07, 0.0], p: [0.0002, 0.00002] },
        Distortion::Equidistant { k: [-0.013, 0.02, -0.012, 0.002] },
    ] {
        let start = std::time::Instant::now();
        let lens = Lens::new(pinhole, model).expect("invertible");
        let made = start.elapsed();
        let table = lens.undistortion_table_px();
        println!("{model:?}: lens {made:?}, table of {} px {:?}", table.len(), start.elapsed() - made);
    }
}
