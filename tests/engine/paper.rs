//! `--method paper` on the device: right where its assumptions hold, wrong by a growing amount where they do not.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::frames::{
    accumulation, engine, levels, linear, options, paper, paper_from_depth, picture, request,
};
use crate::gpu_support::scenes::{closed, drawable, moving, path, rich, walk};
use crate::gpu_support::{Watched, device};
use crate::long_support::some_of;
use crate::oracle_forms::{K, moments, quads, rectangle};
use glam::{DQuat, DVec3};
use shutterbug::camera::{Pose, ScanOrder, Trajectory};
use shutterbug::engine::{FrameRequest, FrameStatistics, Method, PaperOptions, Shift};
use shutterbug::plane::Plane;
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

/// Mean and largest difference to accumulation of each of the methods, levels.
fn against_accumulation(
    watched: &Watched,
    path: &Trajectory,
    methods: &[Method],
    order: ScanOrder,
) -> Vec<(f64, u8)> {
    let (scene, request) = (far_wall(), request(&K, 0.01, 0.03, order));
    let truth = picture(watched, &scene, path, K, accumulation(60), &request);
    let difference = |method: &Method| {
        let (mean, largest, _) = levels(&picture(watched, &scene, path, K, method.clone(), &request), &truth);
        (mean, largest)
    };
    methods.iter().map(difference).collect()
}

#[test]
fn it_is_right_for_small_constant_motion_and_worse_the_faster_it_changes() {
    let test = "it_is_right_for_small_constant_motion";
    let Some(watched) = device(test) else { return };
    for order in some_of(test, 2, ScanOrder::ALL) {
        let methods = [paper(1), paper(2), paper_from_depth(2)];
        for (mean, largest) in against_accumulation(&watched, &pan_px(60.0, 0.0), &methods, order) {
            eprintln!("{order}, 60 px/s: mean {mean:.3}, largest {largest} levels");
            // Resampling between pixels softens the picture's own curvature by less than a level.
            assert!(mean < 0.5 && largest <= 4, "{order}: {mean}, {largest}");
        }
        let still = against_accumulation(&watched, &pan_px(0.0, 0.0), &methods[..1], order)[0];
        assert!(still.0 < 0.002, "{order}: nothing moves: {still:?}");
    }
    // Control and finding: under acceleration one image misses the change of speed, six only a lag.
    let counts = [1, 2, 6];
    let methods = counts.map(paper);
    let errors = [0.0, 5e3, 2e4, 8e4].map(|px_per_s2| {
        against_accumulation(&watched, &pan_px(60.0, px_per_s2), &methods, ScanOrder::TopToBottom)
    });
    for (i, images) in counts.into_iter().enumerate() {
        let errors = errors.each_ref().map(|e| e[i].0);
        eprintln!("{images} images, 0, 5, 20, 80 thousand px/s^2: mean {errors:.3?} levels");
        assert!(errors.windows(2).all(|e| e[1] > e[0]), "the error grows with acceleration: {errors:?}");
        assert!(errors[3] > 8.0 * errors[0], "control: wrong motion is seen: {errors:?}");
    }
    let [one, two, six] = [0, 1, 2].map(|i| errors[2][i].0);
    assert!(six < two && six < one, "more images are nearer to the truth: {one}, {two}, {six}");
}

#[test]
fn the_error_grows_with_speed_at_silhouettes() {
    let Some(watched) = device("the_error_grows_with_speed_at_silhouettes") else { return };
    let scene = closed(rich(0));
    let error = |rate: f64| {
        let walk = walk();
        let slowed = path(move |t| walk.pose_at(0.01 + rate * (t - 0.01).clamp(-0.2, 0.2)));
        let mut scene = scene.clone();
        let object = moving();
        let object = path(move |t| object.pose_at(0.01 + rate * (t - 0.01).clamp(-0.2, 0.2)));
        scene.objects[1].trajectory = Some(object.into());
        let request = request(&K, 0.01, 0.03, ScanOrder::TopToBottom);
        let truth = picture(&watched, &scene, &slowed, K, accumulation(60), &request);
        levels(&picture(&watched, &scene, &slowed, K, paper(2), &request), &truth).0
    };
    let errors = [0.0, 0.125, 0.25, 0.5, 1.0].map(error);
    eprintln!("paper against accumulation at 0 to full speed: mean {errors:.3?} levels");
    assert!(errors[0] < 0.02, "nothing moves: {errors:?}");
    assert!(errors.windows(2).all(|e| e[1] > e[0]), "{errors:?}");
    assert!(errors[4] > 2.0 * errors[1] && errors[4] > 0.5, "{errors:?}");
}

#[test]
fn motion_from_depth_is_that_of_the_rasterizer_where_nothing_moves_by_itself() {
    let Some(watched) = device("motion_from_depth_is_that_of_the_rasterizer") else { return };
    let moving_scene = closed(rich(0));
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
    let margins = [0.0, 100.0, 1000.0, 1500.0].map(|px_per_s| {
        let (s, margin) = statistics(&watched, px_per_s, 0.03);
        eprintln!("{px_per_s} px/s: margin {margin:?} px, {s:?}");
        assert_eq!(s.invalid_share, 0.0, "{px_per_s} px/s");
        assert!(px_per_s < 1000.0 || (s.taps_mean / (0.01 * px_per_s) - 1.0).abs() < 0.5, "one a px: {s:?}");
        margin
    });
    assert!(margins.windows(2).all(|m| m[1][0] > m[0][0]), "{margins:?}");
    // What the right border (82.7 px from the axis) sees half a frame earlier or later, with 15 % and 4 px more.
    let half_turn = 1000.0 / 140.0 * 0.5 * (0.01 + 0.03 * 119.0 / 120.0);
    let beyond = 140.0 * ((82.7_f64 / 140.0).atan() + half_turn).tan() - 82.7;
    assert_eq!(margins[2][0], (1.15 * beyond + 4.0).ceil() as u32, "{beyond} px beyond the border");
    // Control: a margin never exceeds the picture, so a frame that moves by twelve pictures reads beyond it.
    let (s, margin) = statistics(&watched, 11_000.0, 0.06);
    eprintln!("11000 px/s: margin {margin:?} px, {s:?}");
    assert!(s.invalid_share > 0.02, "control: {s:?} with {margin:?}");
}

#[test]
fn a_bar_leans_in_all_scan_orders() {
    let Some(watched) = device("a_bar_leans_in_all_scan_orders") else { return };
    let mut scene =
        quads(&[rectangle([-90.0, 90.0], [-90.0, 90.0], 20.01), rectangle([-0.8, 0.8], [-90.0, 90.0], 20.0)]);
    // A black wall behind the bar: where nothing is drawn, the paper has no motion, and nothing could lean out there.
    scene.materials.push(Material { kd: [0.0; 3], ..scene.materials[0].clone() });
    scene.vertices[..4].iter_mut().for_each(|v| v.material = 1);
    let scene = drawable(scene);
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
            // Motion changes by 1 % over the bar's path of up to 7 px, and edges are softened by bilinear reading.
            assert!(slant(1.0) < 0.2, "{order}, {images} images: {} px", slant(1.0));
            assert!(slant(-1.0) > 5.0, "control: {}", slant(-1.0));
        }
    }
}
