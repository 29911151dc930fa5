//! The lens on the device against closed forms: straight lines bend as the polynomial says, at the time of the sensor's
//! line; neutral changes no bit; a fold is refused and says where.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::frames::{
    accumulation, engine, levels, linear, options, paper, paper_from_depth, picture, request, still,
};
use crate::gpu_support::scenes::{closed, drawable, rich, walk};
use crate::gpu_support::{Watched, device};
use crate::long_support::some_of;
use crate::oracle_forms::{K, moments, pan, quads, rectangle};
use shutterbug::Error;
use shutterbug::camera::{Distortion, Intrinsics, Pose, ScanOrder, Trajectory};
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::{ChromaticAberration, LensDistortion};
use shutterbug::engine::{Engine, ExactOptions, FastOptions, FrameRequest, Method};
use shutterbug::plane::Plane;
use shutterbug::scene::Scene;

const RAD_PER_S: f64 = 2.0;
const READOUT_S: f64 = 0.06;

fn settings(k1: f64, k2: f64) -> Settings {
    let mut settings = Settings::default();
    for (name, value) in [("k1", k1), ("k2", k2)] {
        settings.set(&LensDistortion, name, Value::Number(value)).unwrap();
    }
    settings
}

fn exact() -> Method {
    Method::Exact(ExactOptions::default())
}

/// A vertical bar from x = 0.2 to 0.28 m at 1 m, taller than the picture and reaching far beyond it.
fn bar() -> Scene {
    drawable(quads(&[rectangle([0.2, 0.28], [-9.0, 9.0], 1.0)]))
}

/// Column at which the bar's edge X crosses the sensor's row v (px), at the time that `time_of` gives for the rows of
/// the sensor and of the ideal picture: solved by bisection along the edge, from the formulas and nothing of the
/// library's.
fn edge_px(x_m: f64, v: f64, [k1, k2]: [f64; 2], time_of: impl Fn(f64, f64) -> f64) -> f64 {
    let place = |y_m: f64| {
        // Newton on time is not needed: the row is known, only the ideal row varies along the edge.
        let at = |t: f64| {
            let (sin, cos) = (RAD_PER_S * t).sin_cos();
            let (x, z) = (x_m * cos - sin, x_m * sin + cos);
            let (x, y) = (x / z, y_m / z);
            let s = x * x + y * y;
            let d = 1.0 + s * (k1 + s * k2);
            (140.0 * x * d + 77.3, 150.0 * y * d + 62.1, 150.0 * y + 62.1)
        };
        // The ideal row depends on the time a little: a few rounds settle it.
        (0..20).fold((0.0, v, v), |(_, _, ideal), _| at(time_of(v, ideal)))
    };
    let (mut low, mut high) = (-0.7, 0.7);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if place(middle).1 < v { low = middle } else { high = middle }
    }
    place(0.5 * (low + high)).0
}

/// Largest distance of the bar's middle from the closed form over all rows, px.
fn worst(got: &Plane<f32>, lens: [f64; 2], time_of: impl Fn(f64, f64) -> f64 + Copy) -> f64 {
    let off = |y: usize| {
        let row = Plane { width: 160, height: 1, channels: 3, data: got.row(y).to_vec() };
        let v = y as f64 + 0.5;
        let want = 0.5 * (edge_px(0.2, v, lens, time_of) + edge_px(0.28, v, lens, time_of));
        (moments(&row, 1).1.x - want).abs()
    };
    (0..120).map(off).fold(0.0, f64::max)
}

fn bar_frame(watched: &Watched, path: &Trajectory, method: Method, request: &FrameRequest) -> Plane<f32> {
    linear(&picture(watched, &bar(), path, K, method, request))
}

#[test]
fn a_straight_line_bends_by_the_polynomial() {
    let Some(watched) = device("a_straight_line_bends_by_the_polynomial") else { return };
    let path = Trajectory::fixed(Pose::IDENTITY);
    for lens in [[0.2, -0.02], [-0.25, 0.05]] {
        let request = FrameRequest { settings: settings(lens[0], lens[1]), ..still(&K) };
        for method in [exact(), accumulation(1), Method::Fast(FastOptions::default()), paper(2)] {
            let got = bar_frame(&watched, &path, method.clone(), &request);
            let (off, straight) = (worst(&got, lens, |_, _| 0.0), worst(&got, [0.0; 2], |_, _| 0.0));
            eprintln!("{lens:?}, {method:?}: off by at most {off:.4} px; {straight:.2} px from straight");
            // 16 samples a pixel place each edge to 1/16 px (see oracle_shutter), the chord to 0.1 px.
            assert!(off < 0.12, "{off} px");
            assert!(straight > 1.0, "control: {straight} px");
        }
    }
}

#[test]
fn a_camera_that_is_aimed_anew_has_its_lens_about_its_own_centre_and_focal_length() {
    let name = "a_camera_that_is_aimed_anew_has_its_lens_about_its_own_centre_and_focal_length";
    let Some(watched) = device(name) else { return };
    let path = Trajectory::fixed(Pose::IDENTITY);
    let request = FrameRequest { settings: settings(-0.25, 0.05), ..still(&K) };
    let other = Intrinsics { fx: 1.08 * K.fx, fy: 1.08 * K.fy, cx: K.cx - 9.0, ..K };
    let frame = |engine: &mut Engine| engine.render(&request).unwrap().picture;
    for method in [exact(), Method::Fast(FastOptions::default())] {
        let mut aimed = engine(&watched, &bar(), &path, K, options(method.clone(), 16), &[]);
        let before = frame(&mut aimed);
        aimed.aim(other, path.clone().into());
        let got = frame(&mut aimed);
        let want = frame(&mut engine(&watched, &bar(), &path, other, options(method.clone(), 16), &[]));
        assert!(got.data == want.data, "{method:?}: not what an engine of that camera delivers");
        assert!(got.data != before.data, "control: the cameras see the same");
    }
}

#[test]
fn a_line_is_seen_at_the_time_of_the_sensors_line() {
    let Some(watched) = device("a_line_is_seen_at_the_time_of_the_sensors_line") else { return };
    let lens = [-0.25, 0.05];
    let mut request = request(&K, 0.0, READOUT_S, ScanOrder::TopToBottom);
    request.settings = settings(lens[0], lens[1]);
    let sensor = |v: f64, _: f64| 0.01 + READOUT_S * (v - 0.5) / 120.0;
    let ideal = |_: f64, v: f64| 0.01 + READOUT_S * (v - 0.5) / 120.0;
    for (method, allowed) in [(exact(), 0.14), (accumulation(240), 0.14)] {
        let got = bar_frame(&watched, &pan(RAD_PER_S), method.clone(), &request);
        let (off, control) = (worst(&got, lens, sensor), worst(&got, lens, ideal));
        eprintln!("{method:?}: off by at most {off:.4} px; by the ideal picture's lines {control:.3} px");
        assert!(off < allowed, "{off} px");
        assert!(control > 2.0 * allowed, "control: {control} px");
    }
    // Without a lens displacements follow from depth and nothing moves against what is beside it. Through a lens they
    // are drawn, and what the bar seems to uncover is filled from beside it, which moves the bar's middle (0.57 px
    // measured).
    let fast = |lens: [f64; 2]| {
        let request = FrameRequest { settings: settings(lens[0], lens[1]), ..request.clone() };
        let got = bar_frame(&watched, &pan(RAD_PER_S), Method::Fast(FastOptions::default()), &request);
        (worst(&got, lens, sensor), worst(&got, lens, |_, _| 0.01 + 0.5 * READOUT_S))
    };
    let ((off, control), (plain, _)) = (fast(lens), fast([0.0; 2]));
    eprintln!("fast: off by at most {off:.3} px, without lens {plain:.3}; without readout {control:.2} px");
    assert!(off < 0.7 && plain < 0.12, "{off} px through the lens, {plain} px without");
    assert!(control > 5.0 * off, "control: {control} px");
}

#[test]
fn neutral_changes_no_bit_and_the_lens_can_change_from_frame_to_frame() {
    let Some(watched) = device("neutral_changes_no_bit_and_the_lens_can_change_from_frame_to_frame") else {
        return;
    };
    let scene = closed(rich(0));
    let plain = request(&K, 0.01, 0.02, ScanOrder::TopToBottom);
    let mut neutral = plain.clone();
    neutral.settings.enable(&LensDistortion);
    neutral.settings.enable(&ChromaticAberration);
    let bent = FrameRequest { settings: settings(-0.2, 0.0), ..plain.clone() };
    let methods = [exact(), accumulation(8), Method::Fast(FastOptions::default()), paper(2)];
    for method in some_of("neutral_changes_no_bit", 2, methods) {
        let fresh = |request: &FrameRequest| picture(&watched, &scene, &walk(), K, method.clone(), request);
        let (want_plain, want_bent) = (fresh(&plain), fresh(&bent));
        assert_eq!(fresh(&neutral), want_plain, "{method:?}");
        assert_ne!(want_bent, want_plain, "control");
        // Announced as the fresh engines' frames are: `exact` cuts other triangles for a frame that was not.
        let announced = std::slice::from_ref(&plain);
        let mut engine = engine(&watched, &scene, &walk(), K, options(method.clone(), 16), announced);
        for (request, want) in [(&plain, &want_plain), (&bent, &want_bent), (&neutral, &want_plain)] {
            // The margin has grown with the frames before: samples are placed with another rounding.
            let got = levels(&engine.render(request).unwrap().picture, want).0;
            let control = levels(&want_bent, &want_plain).0;
            assert!(got < 0.02 && control > 1.0, "{method:?}: {got}, control {control}");
        }
    }
}

#[test]
fn a_fold_is_refused_and_says_where() {
    let Some(watched) = device("a_fold_is_refused_and_says_where") else { return };
    let folded = FrameRequest { settings: settings(-0.9, 0.0), ..still(&K) };
    let mut engine = engine(&watched, &bar(), &walk(), K, options(exact(), 4), &[]);
    match engine.render(&folded) {
        Err(Error::LensFolds(fold)) => {
            assert!(fold.coefficients.contains("k1 = -0.9"), "{fold}");
            // r (1 - 0.9 r^2) is largest at r = 1 / sqrt(2.7).
            assert!((fold.ideal_radius - 2.7_f64.powf(-0.5)).abs() < 1e-6, "{fold}");
            let text = fold.to_string();
            assert!(text.contains("pixel (") && text.contains("turns back"), "{text}");
        }
        other => panic!("{other:?}"),
    }
    // The engine goes on.
    engine.render(&FrameRequest { settings: settings(-0.2, 0.0), ..still(&K) }).unwrap();
    // A method that knows only the pinhole says so.
    let request =
        FrameRequest { settings: settings(-0.2, 0.0), ..request(&K, 0.0, 0.02, ScanOrder::TopToBottom) };
    let mut engine = crate::gpu_support::frames::engine(
        &watched,
        &bar(),
        &walk(),
        K,
        options(paper_from_depth(2), 4),
        &[],
    );
    let refused = engine.render(&request).unwrap_err().to_string();
    assert!(refused.contains("lens_distortion") && refused.contains("motion from depth"), "{refused}");
}

#[test]
fn a_fisheye_is_no_pinhole_even_without_coefficients() {
    let Some(watched) = device("a_fisheye_is_no_pinhole_even_without_coefficients") else { return };
    let mut request = still(&K);
    request.settings.set(&LensDistortion, "model", Value::Choice("equidistant")).unwrap();
    assert_eq!(LensDistortion::distortion(&request.settings), Distortion::Equidistant { k: [0.0; 4] });
    // At the height of the axis the edge X stands at fx atan(X).
    let got = bar_frame(&watched, &Trajectory::fixed(Pose::IDENTITY), exact(), &request);
    let row = Plane { width: 160, height: 1, channels: 3, data: got.row(61).to_vec() };
    let at = moments(&row, 1).1.x;
    let want = 140.0 * 0.5 * (0.2_f64.atan() + 0.28_f64.atan()) + 77.3;
    let pinhole = 140.0 * 0.24 + 77.3;
    eprintln!("{at:.3} px, {want:.3} by the formula, {pinhole:.3} of a pinhole");
    assert!((at - want).abs() < 0.1 && (at - pinhole).abs() > 0.4, "{at} {want}");
}
