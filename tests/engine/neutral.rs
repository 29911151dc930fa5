//! Neutral parameters are the identity, for every method and scan order.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::device;
use crate::gpu_support::frames::{accumulation, engine, levels, options, paper, paper_from_depth, request};
use crate::gpu_support::scenes::{drawable, rich, walk};
use exr::prelude::f16;
use shutterbug::camera::{Intrinsics, ScanOrder};
use shutterbug::engine::{EngineOptions, ExactOptions, FastOptions, FrameRequest, Method};
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
        let mut engine = engine(&watched, &scene, &path, k, options(method, 16), &[]);
        for order in ScanOrder::ALL {
            let request = FrameRequest { planes: true, ..request(&k, 0.0, 0.0, order) };
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

/// Three quarters of the way from a half float to the next, and these two.
fn between_halves(about: f32) -> [f32; 3] {
    let lower = f16::from_f32(about);
    let [lower, upper] = [lower, f16::from_bits(lower.to_bits() + 1)].map(f16::to_f32);
    [lower + 0.75 * (upper - lower), upper, lower]
}

#[test]
fn surfaces_have_the_half_float_nearest_to_their_colour_on_devices_that_round_towards_zero_too() {
    let test = "surfaces_have_the_half_float_nearest_to_their_colour_on_devices_that_round_towards_zero_too";
    let Some(watched) = device(test) else { return };
    let k = Intrinsics { width: 96, height: 72, fx: 90.0, fy: 90.0, cx: 48.0, cy: 36.0 };
    let mut scene = rich(0);
    let kd = |i: usize| [0.3, 0.12, 0.76].map(|kd: f32| between_halves(kd / (1.0 + 0.37 * i as f32)));
    for (i, material) in scene.materials.iter_mut().enumerate() {
        (material.texture, material.kd) = (None, kd(i).map(|k| k[0]));
    }
    let scene = drawable(scene);
    let colours =
        |side: usize| (0..scene.materials.len()).map(|i| kd(i).map(|k| k[side])).collect::<Vec<_>>();
    let (nearest, lower) = (colours(1), colours(2));
    let methods =
        [accumulation(1), Method::Exact(ExactOptions::default()), Method::Fast(FastOptions::default())];
    for method in methods {
        let name = format!("{method:?}");
        let mut engine = engine(&watched, &scene, &walk(), k, options(method, 4), &[]);
        let request = FrameRequest { planes: true, ..request(&k, 0.0, 0.0, ScanOrder::TopToBottom) };
        let color = engine.render(&request).unwrap().planes.unwrap().color;
        let count = |colours: &[[f32; 3]]| {
            color.data.chunks_exact(4).filter(|p| colours.iter().any(|c| c[..] == p[..3])).count()
        };
        let (right, wrong) = (count(&nearest), count(&lower));
        assert!(right > 96 * 72 / 2 && wrong == 0, "{name}: {right} nearest, {wrong} towards zero");
    }
}
