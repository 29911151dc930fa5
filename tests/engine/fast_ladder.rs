//! Paper and fast against accumulation on scenes that each move in one way.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use crate::checkers::{EXPOSURE_S, READOUT_S, Row, intrinsics, request, rows};
use crate::gpu_support::device;
use crate::long_support::some_of;
use shutterbug::camera::ScanOrder;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, FastOptions, Frame, FrameRequest, Method, PaperOptions,
};
use shutterbug::gpu::Context;
use shutterbug::plane::metrics::psnr_db;

fn render(context: &Arc<Context>, row: &Row, method: Method, request: &FrameRequest) -> Frame {
    let options = EngineOptions { method, ..EngineOptions::default() };
    let mut engine = Engine::new(
        context,
        row.scene.clone(),
        row.path.clone(),
        intrinsics(),
        options,
        std::slice::from_ref(request),
    )
    .unwrap();
    engine.render(request).unwrap()
}

#[test]
fn at_rest_the_frame_is_the_still_picture_bit_for_bit() {
    let Some(context) = device("at_rest_the_frame_is_the_still_picture_bit_for_bit") else { return };
    let row = &rows()[0];
    let still =
        |method: Method| render(&context.0, row, method, &request(0.0, 0.0, ScanOrder::TopToBottom)).picture;
    let one = Method::Accumulation(AccumulationOptions { renders: Some(1), ..Default::default() });
    let truth = still(one);
    assert!(truth == still(Method::Fast(FastOptions::default())), "not the still picture");
    let moving = request(1e-3, 0.0, ScanOrder::TopToBottom);
    let moved = render(&context.0, row, Method::Fast(FastOptions::default()), &moving).picture;
    assert!(truth != moved, "control: a readout of a millisecond passes");
}

#[test]
fn frames_repeat_bit_for_bit_and_have_all_their_sources() {
    let test = "frames_repeat_bit_for_bit_and_have_all_their_sources";
    let Some(context) = device(test) else { return };
    let all = rows();
    let row = all.iter().find(|r| r.name == "walk").unwrap();
    let mut pictures: Vec<_> = Vec::new();
    for order in some_of(test, 2, ScanOrder::ALL) {
        let request = request(READOUT_S, EXPOSURE_S, order);
        let frame = || render(&context.0, row, Method::Fast(FastOptions::default()), &request);
        let (first, second) = (frame(), frame());
        assert!(first.picture == second.picture, "{order}: two runs differ");
        assert_eq!(first.statistics.unwrap().invalid_share, 0.0, "{order}");
        pictures.push(first.picture);
    }
    assert!(pictures[1..].iter().all(|p| pictures[0] != *p), "control: scan orders give the same picture");
}

/// What the method is for: at least 6 dB over the paper's wherever motion accelerates or surfaces pass each other.
#[test]
fn beats_the_paper_by_six_decibels() {
    let test = "beats_the_paper_by_six_decibels";
    let Some(context) = device(test) else { return };
    let rows = rows();
    let hard = rows.iter().filter(|r| ["object", "acceleration"].contains(&r.name));
    for row in some_of(test, 2, hard) {
        let request = request(READOUT_S, EXPOSURE_S, ScanOrder::TopToBottom);
        let truth = Method::Accumulation(AccumulationOptions { renders: Some(512), ..Default::default() });
        let truth = render(&context.0, row, truth, &request).picture;
        let [paper, fast] = [Method::Paper(PaperOptions::default()), Method::Fast(FastOptions::default())]
            .map(|method| psnr_db(&truth, &render(&context.0, row, method, &request).picture));
        eprintln!("{}: paper {paper:.2} dB, fast {fast:.2} dB", row.name);
        assert!(fast >= paper + 6.0, "{}: paper {paper} dB, fast {fast} dB", row.name);
    }
}
