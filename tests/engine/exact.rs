//! `--method exact` against accumulation on the device, and what must hold to the bit.
#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use crate::gpu_support::{Watched, device};
use crate::long_support::some_of;
use crate::room::{CAMERA, takes};
use crate::takes::Take;
use glam::{DQuat, DVec3};
use shutterbug::camera::{Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::Settings;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, ExactOptions, FrameRequest, FrameStatistics, Method,
};
use shutterbug::plane::Plane;
use shutterbug::plane::metrics::psnr_db;

fn request(start_s: f64, readout_time_s: f64, exposure_time_s: f64, scan_order: ScanOrder) -> FrameRequest {
    let k = CAMERA;
    let line_count = scan_order.line_count(k.width, k.height);
    FrameRequest {
        index: 0,
        shutter: ShutterTiming { start_s, exposure_time_s, readout_time_s, scan_order, line_count },
        frame_interval_s: 1.0 / 30.0,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: true,
    }
}

fn exact() -> Method {
    Method::Exact(ExactOptions::default())
}

fn accumulation(renders: u32) -> Method {
    Method::Accumulation(AccumulationOptions { renders: Some(renders), ..AccumulationOptions::default() })
}

fn engine(context: &Watched, take: &Take, method: Method, samples: u32, expected: &[FrameRequest]) -> Engine {
    let options = EngineOptions { method, samples, ..EngineOptions::default() };
    let (scene, path) = (take.scene.clone(), take.path.clone());
    Engine::new(&context.0, scene, path, CAMERA, options, expected).unwrap()
}

fn render(
    context: &Watched,
    take: &Take,
    method: Method,
    samples: u32,
    request: &FrameRequest,
) -> (Plane<u8>, FrameStatistics) {
    let mut engine = engine(context, take, method, samples, std::slice::from_ref(request));
    let frame = engine.render(request).unwrap();
    (frame.picture, frame.statistics.unwrap())
}

fn named(name: &str) -> Take {
    takes().into_iter().find(|t| t.name == name).unwrap()
}

/// Decibels of `exact` over accumulation with 96 renders, and of the still picture at the frame's middle.
fn decibels(context: &Watched, take: &Take, request: &FrameRequest) -> (f64, f64) {
    let (want, _) = render(context, take, accumulation(96), 16, request);
    let (got, statistics) = render(context, take, exact(), 16, request);
    assert_eq!(statistics.invalid_share, 0.0, "{}: the margin suffices", take.name);
    let still = FrameRequest {
        shutter: ShutterTiming {
            start_s: request.shutter.middle_s(),
            readout_time_s: 0.0,
            exposure_time_s: 0.0,
            ..request.shutter
        },
        ..request.clone()
    };
    let (still, _) = render(context, take, accumulation(1), 16, &still);
    (psnr_db(&got, &want), psnr_db(&still, &want))
}

#[test]
fn every_scan_order_agrees_with_accumulation() {
    let Some(context) = device("every_scan_order_agrees_with_accumulation") else { return };
    for order in ScanOrder::ALL {
        // The order changes which line is seen when, and nothing else: what moves by itself is asked of one.
        let moving = (order == ScanOrder::TopToBottom).then_some(("object", 0.01, 44.0));
        let cases = moving.into_iter().chain([("roll", 0.01, 44.0), ("roll", 0.0, 48.0)]);
        for (name, exposure_s, least_db) in some_of("every_scan_order", 2, cases) {
            let (got, still) = decibels(&context, &named(name), &request(0.01, 0.02, exposure_s, order));
            eprintln!("{name} {order} exposure {exposure_s}: {got:.1} dB, still picture {still:.1} dB");
            assert!(got >= least_db && got > still + 6.0);
        }
    }
}

#[test]
fn without_readout_and_exposure_it_is_the_still_picture_to_the_bit() {
    let Some(context) = device("without_readout_and_exposure_it_is_the_still_picture_to_the_bit") else {
        return;
    };
    for samples in [1, 4, 16] {
        let neutral = request(0.013, 0.0, 0.0, ScanOrder::TopToBottom);
        let take = named("object");
        let (still, _) = render(&context, &take, accumulation(1), samples, &neutral);
        assert_eq!(render(&context, &take, exact(), samples, &neutral).0, still, "{samples} samples");
        // The same from an engine that has blurred frames with a margin too.
        let blurred = request(0.013, 0.02, 0.01, ScanOrder::TopToBottom);
        let mut mixed = engine(&context, &take, exact(), samples, std::slice::from_ref(&blurred));
        let other = mixed.render(&blurred).unwrap().picture;
        assert_eq!(mixed.render(&neutral).unwrap().picture, still);
        assert_ne!(other, still, "control");
    }
}

#[test]
fn frames_do_not_depend_on_their_order_or_on_the_run() {
    let Some(context) = device("frames_do_not_depend_on_their_order_or_on_the_run") else { return };
    let take = named("roll");
    let frames: Vec<_> =
        [0.0, 0.01, 0.02].map(|start| request(start, 0.02, 0.01, ScanOrder::TopToBottom)).to_vec();
    let run = |order: [usize; 3]| {
        let mut engine = engine(&context, &take, exact(), 4, &frames);
        let mut pictures = vec![None; 3];
        for i in order {
            pictures[i] = Some(engine.render(&frames[i]).unwrap().picture);
        }
        pictures
    };
    let first = run([0, 1, 2]);
    assert_eq!(first, run([2, 0, 1]));
    assert_eq!(first, run([0, 1, 2]));
    assert_ne!(first[0], first[1], "control");
}

/// Frames that nobody announced, some in calm and some in a jolt, first of all and after others.
#[test]
fn frames_do_not_depend_on_those_before_them() {
    let Some(context) = device("frames_do_not_depend_on_those_before_them") else { return };
    let base = named("pan");
    let start = base.path.pose_at(0.01);
    let times: Vec<f64> = (-100..=2900).map(|i| f64::from(i) * 1e-3).collect();
    let turned = |t: f64| {
        let jolt = (-((t - 0.52) / 0.01).powi(2)).exp();
        start.rotation * DQuat::from_rotation_z(0.3 * jolt) * DQuat::from_rotation_y(0.2 * t)
    };
    let poses = times.iter().map(|&t| Pose { rotation: turned(t), ..start }).collect();
    let path = Arc::new(Trajectory::new(Path::new("jolt"), times.clone(), poses).unwrap());
    let take = Take { path, ..base.clone() };
    for exposure_s in some_of("frames_do_not_depend_on_those_before", 2, [0.01, 0.0]) {
        let frames = [0.1, 0.51, 1.5].map(|start| request(start, 0.02, exposure_s, ScanOrder::TopToBottom));
        let fresh = || engine(&context, &take, exact(), 4, &[]);
        let alone = frames.each_ref().map(|f| fresh().render(f).unwrap().picture);
        assert_ne!(alone[0], alone[2], "control");
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            let mut engine = fresh();
            for i in order {
                let after = engine.render(&frames[i]).unwrap().picture;
                let apart = after.data.iter().zip(&alone[i].data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                eprintln!("exposure {exposure_s}, {i} of {order:?}: {apart} levels apart");
                // With blur the margin stays as wide as any frame needed, and a wider picture is rounded otherwise.
                assert!(apart <= u8::from(exposure_s > 0.0), "{i} of {order:?}");
            }
        }
    }
}

/// A camera that turns fast, close to a wall, with most of the room beside and behind it.
#[test]
fn what_is_behind_the_camera_does_not_smear_over_the_picture() {
    let Some(context) = device("what_is_behind_the_camera_does_not_smear_over_the_picture") else { return };
    let base = named("pan");
    for (distance_m, pass_m_s, turn) in [(0.05, 0.0, 4.0), (0.3, 1.0, 3.0), (0.12, -1.5, 5.0)] {
        let times: Vec<f64> = (-100..=200).map(|i| f64::from(i) * 1e-3).collect();
        let optical = DQuat::from_mat3(&glam::DMat3::from_cols(-DVec3::Y, -DVec3::Z, DVec3::X));
        let poses = times.iter().map(|&t| Pose {
            rotation: DQuat::from_rotation_z(0.5 * PI - 0.9 + turn * t) * optical,
            translation_m: DVec3::new(0.4 + pass_m_s * t, 2.5 - distance_m, 1.1),
        });
        let path = Arc::new(Trajectory::new(Path::new("near"), times.clone(), poses.collect()).unwrap());
        let take = Take { path, ..base.clone() };
        for exposure_s in [0.0, 0.01] {
            let (got, still) =
                decibels_lax(&context, &take, &request(0.01, 0.02, exposure_s, ScanOrder::TopToBottom));
            eprintln!(
                "{distance_m} m from the wall, exposure {exposure_s}: {got:.1} dB, still {still:.1} dB"
            );
            assert!(got > 34.0 && got > still + 3.0);
        }
    }
}

/// As [`decibels`], where the margin may be cut off at its limit.
fn decibels_lax(context: &Watched, take: &Take, request: &FrameRequest) -> (f64, f64) {
    let (want, _) = render(context, take, accumulation(96), 4, request);
    let (got, _) = render(context, take, exact(), 4, request);
    let shutter = ShutterTiming {
        start_s: request.shutter.middle_s(),
        readout_time_s: 0.0,
        exposure_time_s: 0.0,
        ..request.shutter
    };
    let (still, _) = render(context, take, accumulation(1), 4, &FrameRequest { shutter, ..request.clone() });
    (psnr_db(&got, &want), psnr_db(&still, &want))
}
