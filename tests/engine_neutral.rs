//! Neutral parameters are the identity, for every method and scan order.
#![allow(clippy::unwrap_used)]

mod gpu_support;

use gpu_support::device;
use gpu_support::frames::{accumulation, engine, levels, options, paper, paper_from_depth, request};
use gpu_support::scenes::{rich, walk};
use shutterbug::camera::{Intrinsics, ScanOrder};
use shutterbug::engine::{EngineOptions, FrameRequest};
use shutterbug::plane::{Plane, srgb8};

#[test]
fn neutral_parameters_are_the_identity_for_every_method() {
    let Some(watched) = device("neutral_parameters_are_the_identity_for_every_method") else { return };
    let k = Intrinsics { width: 161, height: 119, fx: 140.0, fy: 150.0, cx: 77.3, cy: 62.1 };
    let (scene, path) = (rich(3), walk());
    let auto = EngineOptions::default().method;
    let mut methods = vec![("accumulation", auto), ("accumulation of 7", accumulation(7))];
    methods.extend((1..=6).map(|n| ("paper", paper(n))));
    methods.push(("paper from depth", paper_from_depth(2)));
    for (name, method) in methods {
        for order in ScanOrder::ALL {
            let request = FrameRequest { planes: true, ..request(&k, 0.0, 0.0, order) };
            let mut engine = engine(&watched, &scene, &path, k, options(method.clone(), 16), &[]);
            let frame = engine.render(&request).unwrap();
            let color = &frame.planes.unwrap().color;
            let still = Plane::from_fn(161, 119, |x, y| {
                let p = color.pixel(x, y);
                [srgb8(p[0]), srgb8(p[1]), srgb8(p[2])]
            });
            let (_, largest, share) = levels(&frame.picture, &still);
            eprintln!(
                "{name}, {order}: {share:.6} of bytes differ from the still frame, by at most {largest}"
            );
            // The bound of `develop` against its twin: one level in one byte of 20 000.
            assert!(largest <= 1 && share < 1.0 / 20_000.0, "{name}, {order}: {share}");
            let mut late = request.clone();
            late.shutter.start_s += 0.001;
            let control = levels(&engine.render(&late).unwrap().picture, &still).2;
            assert!(control > 0.05, "control: 1 ms later: {control}");
        }
    }
}
