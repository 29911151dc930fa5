//! `--method paper` on the device: right where its assumptions hold, wrong by a growing amount where they do not; and
//! neutral parameters are the identity for every method.
#![allow(clippy::unwrap_used)]

mod gpu_support;
mod oracle_forms;

use glam::{DQuat, DVec3};
use gpu_support::frames::{
    accumulation, engine, levels, linear, options, paper, paper_from_depth, picture, request, still,
};
use gpu_support::scenes::{drawable, moving, path, rich, walk};
use gpu_support::{Watched, device};
use oracle_forms::{K, moments, quads, rectangle};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, Trajectory};
use shutterbug::engine::{EngineOptions, FrameRequest, FrameStatistics, Method, PaperOptions, Shift};
use shutterbug::plane::{Plane, srgb8};
use shutterbug::scene::{Material, Scene, Texture};

/// A far wall with a picture on it that has detail but no edge sharper than a few px.
fn far_wall() -> Scene {
    let mut scene = quads(&[rectangle([-40.0, 40.0], [-30.0, 30.0], 20.0)]);
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    scene.vertices.iter_mut().zip(uvs).for_each(|(v, uv)| v.uv = uv);
    let value =
        |x: u32, y: u32, f: f64| (128.0 + 90.0 * ((x as f64 * f).sin() * (y as f64 * 1.3 * f).cos())) as u8;
    let texels = (0..128 * 128).map(|i| (i % 128, i / 128));
    let rgba =
        texels.flat_map(|(x, y)| [value(x, y, 0.31), value(y, x, 0.4), value(x + y, y, 0.23), 255]).collect();
    scene.textures = vec![Texture { path: "wall".into(), width: 128, height: 128, rgba }];
    scene.materials =
        vec![Material { name: "m".into(), kd: [1.0; 3], ks: [0.0; 3], ns: 1.0, texture: Some(0) }];
    drawable(scene)
}

/// A pan whose image motion is `px_per_s` at the start, and changes by `px_per_s2`.
fn pan_px(px_per_s: f64, px_per_s2: f64) -> Trajectory {
    path(|t| {
        let angle = (px_per_s * t + 0.5 * px_per_s2 * t * t) / 140.0;
        Pose { rotation: DQuat::from_rotation_y(angle), translation_m: DVec3::ZERO }
    })
}

/// Mean and largest difference to accumulation, levels.
fn against_accumulation(watched: &Watched, path: &Trajectory, method: Method, order: ScanOrder) -> (f64, u8) {
    let request = request(&K, 0.01, 0.03, order);
    let scene = far_wall();
    let truth = picture(watched, &scene, path, K, accumulation(120), &request);
    let (mean, largest, _) = levels(&picture(watched, &scene, path, K, method, &request), &truth);
    (mean, largest)
}

#[test]
fn it_is_right_for_small_constant_motion_and_worse_the_faster_it_changes() {
    let Some(watched) = device("it_is_right_for_small_constant_motion") else { return };
    for order in ScanOrder::ALL {
        for (name, method) in [("1 image", paper(1)), ("2 images", paper(2)), ("depth", paper_from_depth(2))]
        {
            let (mean, largest) = against_accumulation(&watched, &pan_px(60.0, 0.0), method, order);
            eprintln!("{order}, {name}, 60 px/s: mean {mean:.3}, largest {largest} levels");
            // Resampling between pixels softens the picture's own curvature by less than a level.
            assert!(mean < 0.5 && largest <= 4, "{order}, {name}: {mean}, {largest}");
        }
        let still = against_accumulation(&watched, &pan_px(0.0, 0.0), paper(1), order);
        assert!(still.0 < 0.01, "{order}: nothing moves: {still:?}");
    }
    // Control and finding: under acceleration one image misses half the change of speed, six only a lag.
    let error = |images: u32, px_per_s2: f64| {
        against_accumulation(&watched, &pan_px(60.0, px_per_s2), paper(images), ScanOrder::TopToBottom).0
    };
    for images in [1, 2, 6] {
        let errors = [0.0, 5e3, 2e4, 8e4].map(|a| error(images, a));
        eprintln!("{images} images, 0, 5, 20, 80 thousand px/s^2: mean {errors:.3?} levels");
        assert!(errors.windows(2).all(|e| e[1] > e[0]), "the error grows with acceleration: {errors:?}");
        assert!(errors[3] > 8.0 * errors[0], "control: wrong motion is seen: {errors:?}");
    }
    let (one, two, six) = (error(1, 2e4), error(2, 2e4), error(6, 2e4));
    assert!(six < two && six < one, "more images are nearer to the truth: {one}, {two}, {six}");
}

#[test]
fn the_error_grows_with_speed_at_silhouettes() {
    let Some(watched) = device("the_error_grows_with_speed_at_silhouettes") else { return };
    let scene = rich(0);
    let error = |rate: f64| {
        let walk = walk();
        let slowed = path(move |t| walk.pose_at(0.01 + rate * (t - 0.01).clamp(-0.2, 0.2)));
        let mut scene = scene.clone();
        let object = moving();
        let object = path(move |t| object.pose_at(0.01 + rate * (t - 0.01).clamp(-0.2, 0.2)));
        scene.objects[1].trajectory = Some(object.into());
        let request = request(&K, 0.01, 0.03, ScanOrder::TopToBottom);
        let truth = picture(&watched, &scene, &slowed, K, accumulation(100), &request);
        levels(&picture(&watched, &scene, &slowed, K, paper(2), &request), &truth).0
    };
    let errors = [0.0, 0.125, 0.25, 0.5, 1.0].map(error);
    eprintln!("paper against accumulation at 0 to full speed: mean {errors:.3?} levels");
    assert!(errors[0] < 0.02, "nothing moves: {errors:?}");
    assert!(errors.windows(2).all(|e| e[1] > e[0]), "{errors:?}");
    assert!(errors[4] > 4.0 * errors[1], "{errors:?}");
}

#[test]
fn motion_from_depth_is_that_of_the_rasterizer_where_nothing_moves_by_itself() {
    let Some(watched) = device("motion_from_depth_is_that_of_the_rasterizer") else { return };
    let moving_scene = rich(0);
    let mut resting = moving_scene.clone();
    resting.objects[1].trajectory = Some(Trajectory::fixed(moving().pose_at(0.01)).into());
    let request = request(&K, 0.01, 0.03, ScanOrder::LeftToRight);
    let difference = |scene: &Scene, images: u32| {
        let a = picture(&watched, scene, &walk(), K, paper(images), &request);
        levels(&a, &picture(&watched, scene, &walk(), K, paper_from_depth(images), &request))
    };
    for images in 1..=6 {
        let (mean, largest, share) = difference(&resting, images);
        eprintln!("{images} images: mean {mean:.4}, largest {largest} levels, {share:.4} of bytes differ");
        // The picture's own motion comes from the nearest of 16 samples, that from depth from the pixel's centre: they
        // differ at silhouettes.
        assert!(mean < 0.3 && share < 0.05, "{images} images: {mean}, {share}");
    }
    let (mean, ..) = difference(&moving_scene, 2);
    let (rest, ..) = difference(&resting, 2);
    assert!(mean > 5.0 * rest, "control: depth does not know the object's own motion: {mean} against {rest}");
}

#[test]
fn all_numbers_of_images_and_both_shifts_agree_under_constant_motion() {
    let Some(watched) = device("all_numbers_of_images_agree_under_constant_motion") else { return };
    let (scene, path) = (far_wall(), pan_px(150.0, 0.0));
    let request = request(&K, 0.01, 0.03, ScanOrder::TopToBottom);
    let frame = |motion_images: u32, shift: Shift| {
        let method = Method::Paper(PaperOptions { motion_images, shift, ..PaperOptions::default() });
        picture(&watched, &scene, &path, K, method, &request)
    };
    let first = frame(1, Shift::Middle);
    for images in 1..=6 {
        for shift in [Shift::Start, Shift::Middle] {
            let (mean, largest, _) = levels(&frame(images, shift), &first);
            eprintln!("{images} images, {shift:?}: mean {mean:.3}, largest {largest} levels from 1 image");
            // A pan is not quite a constant motion: it changes by 1 part in 100 over its 6 px.
            assert!(mean < 0.6 && largest <= 6, "{images} images, {shift:?}: {mean}, {largest}");
        }
    }
    let slower = picture(&watched, &scene, &pan_px(135.0, 0.0), K, paper(1), &request);
    assert!(levels(&slower, &first).0 > 0.6, "control: 10 % slower: {:?}", levels(&slower, &first));
}

/// Statistics of one frame of the far wall, and the margin.
fn statistics(watched: &Watched, px_per_s: f64, readout_s: f64) -> (FrameStatistics, [u32; 2]) {
    let request = FrameRequest { statistics: true, ..request(&K, 0.01, readout_s, ScanOrder::TopToBottom) };
    let path = pan_px(px_per_s, 0.0);
    let expected = std::slice::from_ref(&request);
    let mut engine = engine(watched, &far_wall(), &path, K, options(paper(2), 4), expected);
    (engine.render(&request).unwrap().statistics.unwrap(), engine.margin_px())
}

#[test]
fn the_margin_follows_from_the_motion() {
    let Some(watched) = device("the_margin_follows_from_the_motion") else { return };
    let margins = [0.0, 100.0, 1000.0, 3000.0].map(|px_per_s| {
        let (s, margin) = statistics(&watched, px_per_s, 0.03);
        eprintln!("{px_per_s} px/s: margin {margin:?} px, {s:?}");
        assert_eq!(s.invalid_share, 0.0, "{px_per_s} px/s");
        assert!(px_per_s == 0.0 || (s.taps_mean / (0.01 * px_per_s).ceil() - 1.0).abs() < 0.6, "{s:?}");
        margin
    });
    assert!(margins.windows(2).all(|m| m[1][0] > m[0][0]), "{margins:?}");
    // Half of the motion of the frame of 0.04 s on each side, and the guard.
    assert!((margins[2][0] as f64 - 20.0 * 1.15 - 4.0).abs() < 5.0, "{margins:?}");
    // Control: a margin never exceeds the picture, so a frame that moves by twelve pictures reads beyond it.
    let (s, margin) = statistics(&watched, 11_000.0, 0.06);
    eprintln!("11000 px/s: margin {margin:?} px, {s:?}");
    assert!(s.invalid_share > 0.02, "control: {s:?} with {margin:?}");
}

#[test]
fn a_bar_leans_in_all_scan_orders() {
    let Some(watched) = device("a_bar_leans_in_all_scan_orders") else { return };
    let scene = drawable(quads(&[rectangle([-0.8, 0.8], [-90.0, 90.0], 20.0)]));
    // 280 px/s to the left; the paper's motion is that of the nearest sample.
    let frame = |order: ScanOrder, images: u32| {
        let request = request(&K, 0.0, 0.04, order);
        linear(&picture(&watched, &scene, &pan_px(280.0, 0.0), K, paper(images), &request))
    };
    for order in [ScanOrder::TopToBottom, ScanOrder::BottomToTop] {
        for images in [1, 2, 6] {
            let got = frame(order, images);
            let slant = |sign: f64| {
                let off = |y: usize| {
                    let row = Plane { width: 160, height: 1, channels: 3, data: got.row(y).to_vec() };
                    let line = if order == ScanOrder::TopToBottom { y } else { 119 - y };
                    let angle = -sign * 280.0 / 140.0 * (0.01 + 0.04 * line as f64 / 120.0);
                    let edge = |x: f64| 140.0 * ((x / 20.0).atan() + angle).tan() + 77.3;
                    (moments(&row, 1).1.x - 0.5 * (edge(-0.8) + edge(0.8))).abs()
                };
                (0..120).map(off).fold(0.0, f64::max)
            };
            eprintln!("{order}, {images} images: the bar is off by at most {:.3} px", slant(1.0));
            // The bar's edges are remapped by the wall's motion or nobody's: the paper's own error, up to a px of one
            // edge, half of it in the middle.
            assert!(slant(1.0) < 0.6, "{order}, {images} images: {} px", slant(1.0));
            assert!(slant(-1.0) > 5.0, "control: {}", slant(-1.0));
        }
    }
}

#[test]
fn neutral_parameters_are_the_identity_for_every_method() {
    let Some(watched) = device("neutral_parameters_are_the_identity_for_every_method") else { return };
    let k = Intrinsics { width: 161, height: 119, ..K };
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
    let _ = still(&k);
}
