//! What one picture of a body that moves cannot show: where the error of a frame from outside lies.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use crate::capi_support::{engine, finish, options, process};
use crate::long_support::some_of;
use crate::outside_support::host::{POSES, Pictures, SIZE, flights, flying, poses, set_camera};
use crate::outside_support::{EXPOSURE_S, K, Motion, World, camera_motion, psnr, shot, shutter, truth};
use glam::DVec2;
use rayon::prelude::*;
use shutterbug::camera::{Pose, ShutterTiming};
use shutterbug::capi::*;

const MARGIN: [u32; 2] = [26, 14];

/// What a pixel's line sees, of a picture of one instant.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// One surface, that the picture shows.
    Shown,
    /// Surfaces that the picture shows, and an edge between them.
    Edge,
    /// Something that hides in the picture, at least for a part of the exposure.
    Hidden,
}

/// Of each pixel, by rays at `instants` of its exposure and at nine places of it.
fn kinds(world: &World, motion: Motion<'_>, shutter: &ShutterTiming, picture_s: f64) -> Vec<Kind> {
    let instants = if shutter.exposure_time_s > 0.0 { 9 } else { 1 };
    let then = motion(picture_s);
    let [w, h] = SIZE;
    let kind = |i: usize| {
        let (x, y) = (i % w, i / w);
        let start_s = shutter.start_s + shutter.readout_time_s * y as f64 / h as f64;
        let (mut first, mut edge, mut hidden) = (None, false, false);
        for n in 0..9 * instants {
            let share = if instants == 1 { 0.5 } else { (f64::from(n / 9) + 0.5) / f64::from(instants) };
            let now = motion(start_s + share * shutter.exposure_time_s);
            let place = DVec2::new(f64::from(n % 3), f64::from(n / 3 % 3)) * 0.75 - 0.25;
            let way = now[0].rotation * K.ray(DVec2::new(x as f64, y as f64) + place);
            let (_, at, body) = world.cast(now[0].translation_m, way, &now[1..]);
            let point = now[1 + body].inverse().transform(now[0].translation_m + at * way);
            // From the picture's camera to the same point of the same body.
            let to = then[1 + body].transform(point) - then[0].translation_m;
            let (_, seen, other) = world.cast(then[0].translation_m, to, &then[1..]);
            hidden |= other != body || seen < 1.0 - 1e-4;
            edge |= *first.get_or_insert(body) != body;
        }
        match (hidden, edge) {
            (true, _) => Kind::Hidden,
            (false, true) => Kind::Edge,
            _ => Kind::Shown,
        }
    };
    (0..w * h).into_par_iter().map(kind).collect()
}

/// The frame from pictures of these instants.
fn delivered(engine: Handle, world: &World, motion: Motion<'_>, end_s: f64, times_s: &[f64]) -> Vec<u8> {
    let mut pictures = Pictures::new(times_s.iter().map(|&t| shot(world, motion, t, MARGIN)), MARGIN);
    let (given, of_body) = (poses("still", end_s, POSES), flights(end_s));
    let bodies = [shutterbug_body { id: 401, pose_count: POSES, poses: of_body.as_ptr() }];
    let mut o = pictures.outside(times_s);
    (o.poses, o.pose_count) = (given.as_ptr(), POSES);
    (o.bodies, o.body_count) = (bodies.as_ptr(), 1);
    process(engine, &o, SIZE).unwrap()
}

#[test]
fn what_a_body_hides_in_one_picture_is_most_of_the_error() {
    let test = "what_a_body_hides_in_one_picture_is_most_of_the_error";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let world = World::new(true);
    let motion = |t: f64| vec![camera_motion("still", t), Pose::IDENTITY, flying(t)];
    for (exposure_s, gain) in some_of(test, 2, [(0.0, 1.0), (EXPOSURE_S, 2.0)]) {
        set_camera(engine, exposure_s, "");
        let shutter = shutter(exposure_s);
        let end_s = shutter.end_s();
        let want = truth(&world, &motion, &shutter, None);
        let kinds = kinds(&world, &motion, &shutter, 0.5 * end_s);
        let got = delivered(engine, &world, &motion, end_s, &[0.5 * end_s]);
        let three = delivered(engine, &world, &motion, end_s, &[0.0, 0.5 * end_s, end_s]);
        let [all, three] = [&got, &three].map(|p| psnr(p, &want));
        // What the host's picture and the truth differ by where nothing moves at all.
        let rests = |_: f64| vec![camera_motion("still", 0.0), Pose::IDENTITY, flying(0.5 * end_s)];
        let floor = psnr(&shot(&world, &rests, 0.0, [0, 0]).rgb, &truth(&world, &rests, &shutter, None));
        // With the truth in the pixels of a kind; `apart` px to the right of them.
        let mended = |kind: Kind, apart: usize| {
            let of = |i: usize| kinds[(i / 3 + kinds.len() - apart) % kinds.len()] == kind;
            let all: Vec<u8> = (0..got.len()).map(|i| if of(i) { want[i] } else { got[i] }).collect();
            psnr(&all, &want)
        };
        let share =
            |kind: Kind| 100.0 * kinds.iter().filter(|k| **k == kind).count() as f64 / kinds.len() as f64;
        eprintln!(
            "a box, exposure {exposure_s} s: {all:.1} dB, {three:.1} from three pictures, {floor:.1} if all rests;"
        );
        for kind in [Kind::Shown, Kind::Edge, Kind::Hidden] {
            eprintln!(
                "  the truth in {kind:?}, {:.2} % of the pixels: {:.1} dB",
                share(kind),
                mended(kind, 0)
            );
        }
        let seen = mended(Kind::Hidden, 0);
        assert!(all > 36.5, "{all:.1} dB");
        assert!(seen > all + gain && seen > floor - 1.2, "{seen:.1} dB of {all:.1} and {floor:.1}");
        assert!(mended(Kind::Hidden, 60) < all + 0.3, "control: as many pixels elsewhere");
        assert!(three > all + 0.5, "{three:.1} dB from three pictures");
    }
    finish(engine);
}
