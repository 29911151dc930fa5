//! Paper and fast against accumulation on scenes that each move in one way.
#![allow(clippy::unwrap_used)]

mod fast_scenes;
mod gpu_support;

use std::sync::Arc;

use fast_scenes::{EXPOSURE_S, READOUT_S, Row, intrinsics, request, rows};
use gpu_support::device;
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
    let mut best = engine.render(request).unwrap();
    for _ in 0..std::env::var("REPEAT").map_or(0, |n| n.parse().unwrap()) {
        let frame = engine.render(request).unwrap();
        for (b, t) in best.times.iter_mut().zip(&frame.times) {
            b.ms = b.ms.min(t.ms);
        }
    }
    best
}

fn times(frame: &Frame) -> String {
    frame
        .times
        .iter()
        .filter(|t| t.name != "readback")
        .map(|t| format!("{} {:.1}", t.name, t.ms))
        .collect::<Vec<_>>()
        .join(", ")
}

#[test]
fn ladder() {
    let Some(context) = device("ladder") else { return };
    let only = std::env::var("ROWS").unwrap_or_default();
    let n: u32 = std::env::var("N").map_or(512, |n| n.parse().unwrap());
    for row in rows().iter().filter(|r| only.is_empty() || only.split(',').any(|o| o == r.name)) {
        for (what, readout, exposure) in
            [("shutter", READOUT_S, 0.0), ("blur", 0.0, EXPOSURE_S), ("both", READOUT_S, EXPOSURE_S)]
        {
            let request = request(readout, exposure, ScanOrder::TopToBottom);
            let truth = Method::Accumulation(AccumulationOptions { renders: Some(n), ..Default::default() });
            let cache = std::env::var("CACHE").ok().map(|c| format!("{c}/{}-{what}-{n}.png", row.name));
            let truth = match cache.as_ref().and_then(|c| shutterbug::plane::read_rgb8(c.as_ref()).ok()) {
                Some(picture) => picture,
                None => {
                    let picture = render(&context.0, row, truth, &request).picture;
                    if let Some(cache) = &cache {
                        shutterbug::plane::write_png_atomic(cache.as_ref(), &picture).unwrap();
                    }
                    picture
                }
            };
            let mut line = format!("{:12} {what:8}", row.name);
            let mut cost = String::new();
            for (name, method) in [
                ("paper", Method::Paper(PaperOptions::default())),
                ("fast", Method::Fast(FastOptions::default())),
            ] {
                let frame = render(&context.0, row, method, &request);
                let invalid = frame.statistics.unwrap().invalid_share;
                line += &format!(" {name} {:6.2} dB", psnr_db(&truth, &frame.picture));
                if invalid > 0.0 {
                    line += &format!(" (invalid {invalid:.5})");
                }
                cost += &format!(" | {}", times(&frame));
                if let Some(out) = std::env::var_os("OUT") {
                    let file = std::path::Path::new(&out).join(format!("{}-{what}-{name}.png", row.name));
                    shutterbug::plane::write_png_atomic(&file, &frame.picture).unwrap();
                }
            }
            eprintln!("{line}{cost}");
        }
    }
}
