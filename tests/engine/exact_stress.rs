//! `--method exact` on motion that nobody chose: the ladder's scenes, filmed by cameras that turn, pass, accelerate and
//! shake at random, with random shutters in all scan orders, against accumulation with the same samples a pixel.
//! `EXACT_STRESS` is the number of cases, `EXACT_STRESS_SEED` the first.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use crate::gpu_support::bench::Scatter;
use crate::gpu_support::{Watched, device};
use crate::takes::Take;
use glam::{DQuat, DVec3};
use shutterbug::camera::{Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::Settings;
use shutterbug::engine::{AccumulationOptions, Engine, EngineOptions, ExactOptions, FrameRequest, Method};
use shutterbug::plane::Plane;
use shutterbug::plane::metrics::psnr_db;

/// Renders of the reference: at motions of up to 60 px a frame's steps are half a px, which leaves it at 50 dB or
/// better.
const RENDERS: u32 = 160;
/// Worse than any of 60 cases that were looked at.
const LEAST_DB: f64 = 38.0;

struct Case {
    take: Take,
    request: FrameRequest,
    words: String,
}

fn case(seed: u64, takes: &[Take]) -> Case {
    let mut scatter = Scatter(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 77);
    (0..4).for_each(|_| _ = scatter.number());
    let mut signed = |most: f32| f64::from(scatter.between(-most, most));
    let vector = |s: &mut dyn FnMut(f32) -> f64, most: f32| DVec3::new(s(most), s(most), s(most));
    let (turn, spin) = (vector(&mut signed, 1.6), vector(&mut signed, 25.0));
    let (pass, push) = (vector(&mut signed, 0.9), vector(&mut signed, 8.0));
    let (shake, hertz) = (vector(&mut signed, 0.006), 25.0 + signed(20.0));
    let (readout_time_s, exposure_time_s) = (0.018 + signed(0.015), (0.009 + signed(0.013)).max(0.0));
    let take = &takes[(scatter.number() * takes.len() as f32) as usize % takes.len()];
    let order = ScanOrder::ALL[(scatter.number() * 4.0) as usize % 4];
    let base = take.path.pose_at(take.start_s);
    let times: Vec<f64> = (-60..=160).map(|i| take.start_s + f64::from(i) * 5e-4).collect();
    let pose = |time_s: &f64| {
        let t = time_s - take.start_s - 0.015;
        let angles = turn * t + 0.5 * spin * t * t + shake * (std::f64::consts::TAU * hertz * t).sin();
        Pose {
            rotation: base.rotation * DQuat::from_scaled_axis(angles),
            translation_m: base.translation_m + base.rotation * (pass * t + 0.5 * push * t * t),
        }
    };
    let poses = times.iter().map(pose).collect();
    let path = Arc::new(Trajectory::new(Path::new("stress"), times.clone(), poses).unwrap());
    let k = take.intrinsics;
    let shutter = ShutterTiming {
        start_s: take.start_s,
        exposure_time_s,
        readout_time_s,
        scan_order: order,
        line_count: order.line_count(k.width, k.height),
    };
    let words = format!(
        "seed {seed}: {} {order}, readout {:.1} ms, exposure {:.1} ms, turn {:.1} rad/s, {:.0} rad/s^2, pass {:.1} m/s",
        take.name,
        1e3 * readout_time_s,
        1e3 * exposure_time_s,
        turn.length(),
        spin.length(),
        pass.length()
    );
    let request = FrameRequest {
        index: 0,
        shutter,
        frame_interval_s: 1.0 / 30.0,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: true,
    };
    Case { take: Take { path, ..take.clone() }, request, words }
}

fn render(watched: &Watched, case: &Case, method: Method, request: &FrameRequest) -> (Plane<u8>, f64) {
    let options = EngineOptions { method, ..EngineOptions::default() };
    let (scene, path) = (case.take.scene.clone(), case.take.path.clone());
    let expected = std::slice::from_ref(request);
    let mut engine = Engine::new(&watched.0, scene, path, case.take.intrinsics, options, expected).unwrap();
    let frame = engine.render(request).unwrap();
    (frame.picture, frame.statistics.unwrap().invalid_share)
}

fn accumulation(renders: u32) -> Method {
    Method::Accumulation(AccumulationOptions { renders: Some(renders), ..AccumulationOptions::default() })
}

#[test]
#[ignore = "long: half a minute"]
fn random_motion_is_met() {
    let Some(watched) = device("random_motion_is_met") else { return };
    let number = |name: &str, otherwise: u64| {
        std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(otherwise)
    };
    let (first, count) = (number("EXACT_STRESS_SEED", 1), number("EXACT_STRESS", 6));
    let all = crate::takes::all();
    let mut worst = (f64::INFINITY, String::new());
    for seed in first..first + count {
        let case = case(seed, &all);
        let (want, _) = render(&watched, &case, accumulation(RENDERS), &case.request);
        let (got, invalid) = render(&watched, &case, Method::Exact(ExactOptions::default()), &case.request);
        let shutter = ShutterTiming {
            start_s: case.request.shutter.middle_s(),
            exposure_time_s: 0.0,
            readout_time_s: 0.0,
            ..case.request.shutter
        };
        let still = FrameRequest { shutter, ..case.request.clone() };
        let (still, _) = render(&watched, &case, accumulation(1), &still);
        let (db, still_db) = (psnr_db(&got, &want), psnr_db(&still, &want));
        eprintln!("{db:.1} dB (still picture {still_db:.1}), {}", case.words);
        if let (Some(folder), true) = (std::env::var_os("EXACT_STRESS_OUT"), db < 46.0) {
            let path = Path::new(&folder);
            shutterbug::plane::write_png_atomic(&path.join(format!("{seed}_want.png")), &want).unwrap();
            shutterbug::plane::write_png_atomic(&path.join(format!("{seed}_got.png")), &got).unwrap();
        }
        assert_eq!(invalid, 0.0, "{}: the margin suffices", case.words);
        assert!(db > still_db + 3.0, "control: {}: the still picture is no worse", case.words);
        if db < worst.0 {
            worst = (db, case.words);
        }
    }
    eprintln!("worst of {count}: {:.1} dB, {}", worst.0, worst.1);
    assert!(worst.0 >= LEAST_DB, "{worst:?}");
}
