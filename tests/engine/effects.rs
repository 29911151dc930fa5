//! Effects that need more than one table and a frame's pixels: automatic exposure over frames, defocus by distance, the
//! sensor's colours with the ISP behind them.
#![allow(clippy::unwrap_used)]

use crate::effects_support::{by_id, settings, view};
use crate::gpu_support::device;
use crate::gpu_support::frames::{accumulation, engine, linear, options, paper, still};
use crate::long_support::some_of;
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::{Defocus, ExposureControl, LIST, ResponseCurve};
use shutterbug::engine::{ExactOptions, FastOptions, FrameRequest, Method, PixelChain};
use shutterbug::plane::Plane;
use shutterbug::reference::chain::{picture, values};
use shutterbug::scene::{Scene, SceneBuilder};

const CONTROL: &[(&str, &str, f64)] = &[
    ("auto_exposure", "target", 0.18),
    ("auto_exposure", "delay_frames", 2.0),
    ("auto_exposure", "speed", 0.6),
];

/// Gains of 20 frames of a scene that becomes four times brighter at frame 8.
fn gains(of: &Settings, mut develop: impl FnMut(&Plane<f32>, &Settings, u32) -> Plane<u8>) -> Vec<f64> {
    let mut control = ExposureControl::new(of).unwrap();
    (0..20u32)
        .map(|frame| {
            let light = if frame < 8 { 0.1 } else { 0.4 };
            let radiance = Plane::from_fn(32, 24, |x, y| {
                let v = light * (0.3 + 1.4 * x as f32 / 32.0);
                [v, v * (0.5 + y as f32 / 24.0), v, 1.0]
            });
            let own = control.settings(frame as usize, of).unwrap();
            control.meter(frame as usize, &develop(&radiance, &own, frame));
            control.gain(frame as usize)
        })
        .collect()
}

#[test]
fn automatic_exposure_is_the_same_on_the_cpu_and_on_the_device() {
    let mut of = settings(CONTROL);
    of.set(by_id("shot_noise"), "full_well_e", Value::Number(3000.0)).unwrap();
    let at = |frame: u32| shutterbug::chain::View { frame, ..view(32, 24) };
    let by_reference = gains(&of, |radiance, own, frame| picture(LIST, own, &at(frame), radiance));
    eprintln!("gains {by_reference:.3?}");
    // Before and after the step the mean is where it is wanted, and the step is answered two frames later.
    assert!((by_reference[7] / by_reference[19] / 4.0 - 1.0).abs() < 0.03, "{by_reference:?}");
    assert!((by_reference[9] / by_reference[8] - 1.0).abs() < 0.05, "not before the delay: {by_reference:?}");
    assert!(by_reference[10] < 0.7 * by_reference[9], "then: {by_reference:?}");
    let Some(context) = device("automatic_exposure_is_the_same_on_the_cpu_and_on_the_device") else { return };
    let mut chain = PixelChain::new(&context.0, [32, 24]).unwrap();
    let by_device = gains(&of, |radiance, own, frame| {
        chain.load(radiance).unwrap();
        chain.picture(own, &at(frame)).unwrap()
    });
    let far = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    assert!(far(&by_reference, &by_device) < 1e-3, "{by_reference:?}\n{by_device:?}");
    of.set(by_id("auto_exposure"), "delay_frames", Value::Number(3.0)).unwrap();
    let later = gains(&of, |radiance, own, frame| picture(LIST, own, &at(frame), radiance));
    assert!(far(&by_reference, &later) > 0.1, "control: another delay");
}

const K: Intrinsics = Intrinsics { width: 160, height: 48, fx: 140.0, fy: 140.0, cx: 80.0, cy: 24.0 };

/// Black and white side by side, at 1 m on the left half and at 4 m on the right one.
fn two_distances() -> Scene {
    let wall = |scene: SceneBuilder, x: [f32; 2], z: f32, kd: f32| {
        let corners = [[x[0], -3.0, z], [x[0], 3.0, z], [x[1], 3.0, z], [x[1], -3.0, z]];
        scene.material([kd; 3]).quad(corners)
    };
    let mut scene = SceneBuilder::new();
    for (x, z, kd) in
        [([-0.8, -0.3], 1.0, 0.1), ([-0.3, 0.0], 1.0, 0.8), ([0.0, 1.2], 4.0, 0.8), ([1.2, 4.0], 4.0, 0.1)]
    {
        scene = wall(scene, x, z, kd);
    }
    scene.build()
}

/// Standard deviation of the edge's derivative around a column, px.
fn spread_px(picture: &Plane<u8>, column: usize) -> f64 {
    let linear = linear(picture);
    let value = |x: usize| f64::from(linear.pixel(x, 24)[1]);
    let steps: Vec<(f64, f64)> =
        (column - 8..column + 8).map(|x| (x as f64, (value(x + 1) - value(x)).abs())).collect();
    let sum: f64 = steps.iter().map(|s| s.1).sum();
    let mean = steps.iter().map(|s| s.0 * s.1).sum::<f64>() / sum;
    (steps.iter().map(|s| (s.0 - mean).powi(2) * s.1).sum::<f64>() / sum).sqrt()
}

#[test]
fn what_is_out_of_focus_is_blurred_by_the_thin_lens_formula() {
    let Some(watched) = device("what_is_out_of_focus_is_blurred_by_the_thin_lens_formula") else { return };
    let (scene, path) = (two_distances(), Trajectory::fixed(Pose::IDENTITY));
    let (aperture_m, near, far) = (0.06, 80 - 42, 80 + 42);
    let methods = [
        Method::Exact(ExactOptions::default()),
        Method::Fast(FastOptions::default()),
        accumulation(1),
        paper(2),
    ];
    for (i, shape) in ["disc", "gaussian"].into_iter().enumerate() {
        // Both shapes, and each method with one of them.
        for method in some_of("what_is_out_of_focus", 2, methods[..].iter().cycle().skip(i).take(4).cloned())
        {
            let spread = |focus_m: f64| {
                let mut s =
                    settings(&[("defocus", "aperture_m", aperture_m), ("defocus", "focus_m", focus_m)]);
                s.set(&Defocus, "shape", Value::Choice(shape)).unwrap();
                let request = FrameRequest { settings: s, ..still(&K) };
                let mut options = options(method.clone(), 16);
                options.planes = false;
                let mut engine = engine(&watched, &scene, &path, K, options, &[]);
                let picture = engine.render(&request).unwrap().picture;
                [spread_px(&picture, near), spread_px(&picture, far)]
            };
            let want = |focus_m: f64, d: f64| 0.25 * aperture_m * 140.0 * (1.0 / focus_m - 1.0f64 / d).abs();
            for focus_m in [1.0, 4.0] {
                let got = spread(focus_m);
                let want = [want(focus_m, 1.0), want(focus_m, 4.0)];
                eprintln!("{shape}, focus {focus_m} m: spread {got:.3?} px, thin lens {want:.3?} px");
                for (got, want) in got.iter().zip(want) {
                    // Pixels are squares: 1/12 px^2 of their own, and a disc is made of whole ones.
                    let slack = if want == 0.0 { 0.35 } else { 0.12 * want + 0.1 };
                    assert!((got - (want * want + 1.0 / 12.0).sqrt()).abs() < slack, "{got} for {want}");
                }
            }
        }
    }
}

/// An ISP with gains, matrix and a response of its own.
fn isp() -> Settings {
    let mut s = settings(&[
        ("white_balance", "r", 1.7),
        ("white_balance", "b", 2.1),
        ("color_matrix", "rr", 1.5),
        ("color_matrix", "rg", -0.3),
        ("color_matrix", "rb", -0.2),
        ("color_matrix", "bg", -0.4),
        ("color_matrix", "bb", 1.4),
    ]);
    for (i, name) in ResponseCurve::NAMES.iter().flatten().enumerate() {
        s.set(&ResponseCurve, name, Value::Number(0.5 + 0.04 * (i % 17) as f64)).unwrap();
    }
    s
}

#[test]
fn matched_to_the_isp_the_sensor_changes_the_noise_and_not_the_colours() {
    let developed = |of: &Settings, frame: u32| {
        let at = shutterbug::chain::View { frame, ..view(64, 64) };
        let radiance = Plane::from_fn(64, 64, |x, y| {
            let v = 0.05 + 0.9 * y as f32 / 64.0;
            [v, v * (0.8 + 0.003 * x as f32), v * 0.9, 1.0]
        });
        values(LIST, of, &at, &radiance)
    };
    let far = |a: &Plane<f32>, b: &Plane<f32>| {
        a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let plain = developed(&Settings::default(), 0);
    let mut matched = isp();
    assert!(far(&developed(&matched, 0), &plain) > 0.1, "control: the ISP alone changes the picture");
    matched.set(by_id("sensor_color"), "match", Value::Choice("delivered")).unwrap();
    let off = far(&developed(&matched, 0), &plain);
    assert!(off < 5e-6, "{off}");
    let noise = |of: &Settings| {
        let mut noisy = of.clone();
        noisy.set(by_id("shot_noise"), "full_well_e", Value::Number(2000.0)).unwrap();
        let (a, b) = (developed(&noisy, 1), developed(&noisy, 2));
        let d = |i: usize| f64::from(a.data[i] - b.data[i]);
        let pixels = || (0..64 * 64).map(|i| 4 * i);
        let variance = |c: usize| pixels().map(|i| d(i + c).powi(2)).sum::<f64>();
        let cross: f64 = pixels().map(|i| d(i) * d(i + 1)).sum();
        (variance(0), cross / (variance(0) * variance(1)).sqrt())
    };
    let ((white, none), (colored, cross)) = (noise(&Settings::default()), noise(&matched));
    eprintln!(
        "variance of red {white:.3e} and {colored:.3e}, correlation with green {none:.3} and {cross:.3}"
    );
    assert!(none.abs() < 0.05 && cross < -0.1, "red gets some of green's noise: {none} {cross}");
    assert!((colored / white - 1.0).abs() > 0.2, "{colored} {white}");
}
