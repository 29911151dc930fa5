//! One small picture of each effect that acts while a frame is rendered, `tests/golden/<stem>.png`: by rays on the CPU
//! and by the device's methods. Written, as those of `effects`, with `SHUTTERBUG_BLESS=1`.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use crate::gpu_support::device;
use crate::gpu_support::frames::{accumulation, picture};
use crate::gpu_support::scenes::{drawable, path};
use glam::{DQuat, DVec3};
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{Intrinsics, Lens, Pose, Trajectory};
use shutterbug::chain::{Settings, Stage, Value};
use shutterbug::effects::{self, ChromaticAberration, LIST, LensDistortion, MotionBlur, RollingShutter};
use shutterbug::engine::{ExactOptions, FrameRequest, Method};
use shutterbug::plane::{Plane, read_rgb8, srgb8, write_png_atomic};
use shutterbug::reference::accumulate::render_frame_through;
use shutterbug::reference::lens::LensGrid;
use shutterbug::scene::{Scene, SceneBuilder};

const K: Intrinsics = Intrinsics { width: 48, height: 36, fx: 40.0, fy: 40.0, cx: 23.4, cy: 18.6 };
/// Two a line.
const RENDERS: u32 = 72;
/// Mean difference that rounding makes, levels.
const ROUNDING: f64 = 0.02;

/// A value of an effect, and the nearest mistake: the other sign, the other order, a tenth less.
type Kind = (&'static str, &'static [(&'static str, Value)], (&'static str, Value));

const KINDS: &[Kind] = &[
    (
        "lens_distortion",
        &[("k1", Value::Number(-0.25)), ("k2", Value::Number(0.05)), ("p1", Value::Number(0.01))],
        ("p1", Value::Number(-0.01)),
    ),
    (
        "chromatic_aberration",
        &[("scale_r", Value::Number(1.02)), ("scale_b", Value::Number(0.97))],
        ("scale_r", Value::Number(0.98)),
    ),
    (
        "rolling_shutter",
        &[("readout_time_s", Value::Number(0.06)), ("scan_order", Value::Choice("top_to_bottom"))],
        ("scan_order", Value::Choice("bottom_to_top")),
    ),
    ("motion_blur", &[("exposure_time_s", Value::Number(0.05))], ("exposure_time_s", Value::Number(0.045))),
];

/// Tiles of many colours on a wall, with bars before it.
fn scene() -> Scene {
    let mut scene = SceneBuilder::new();
    for i in 0..140_u32 {
        let (column, row) = ((i % 14) as f32, (i / 14) as f32);
        let (x, y) = (0.4 * (column - 7.0), 0.4 * (row - 5.0));
        let color =
            [0.15 + 0.7 * (i % 3) as f32 / 2.0, 0.1 + 0.8 * (i % 5) as f32 / 4.0, 0.9 - 0.1 * (i % 7) as f32];
        scene = scene.material(color).cuboid([x, y, 2.0], [x + 0.4, y + 0.4, 2.1]);
    }
    for i in 0..5_u16 {
        let x = 0.42 * (f32::from(i) - 2.2);
        scene = scene.material([0.02, 0.02, 0.05]).cuboid([x, -0.6, 1.4], [x + 0.06, 0.45, 1.45]);
    }
    drawable(scene.build())
}

/// A pan of two radians a second with some roll.
fn pan() -> Trajectory {
    path(|t| Pose {
        rotation: DQuat::from_rotation_y(2.0 * t - 0.06) * DQuat::from_rotation_z(0.5 * t),
        translation_m: DVec3::new(0.2 * t, 0.0, 0.0),
    })
}

fn settings(stem: &str, values: &[(&str, Value)]) -> Settings {
    let mut settings = Settings::default();
    let effect = effects::by_id(stem).unwrap();
    values.iter().for_each(|(name, value)| settings.set(effect, name, *value).unwrap());
    settings
}

fn request(settings: &Settings) -> FrameRequest {
    let (exposure_s, readout_s) =
        (MotionBlur::exposure_time_s(settings), RollingShutter::readout_time_s(settings));
    let order = RollingShutter::scan_order(settings);
    FrameRequest {
        settings: settings.clone(),
        ..crate::gpu_support::frames::request(&K, exposure_s, readout_s, order)
    }
}

/// By rays: no vertex is moved, every colour goes through the lens of its own size.
fn by_rays(settings: &Settings) -> Plane<u8> {
    let request = request(settings);
    let lens = Lens::new(K, LensDistortion::distortion(settings)).unwrap();
    let plan = AccumulationPlan::new(&request.shutter, RENDERS);
    let (scene, pan) = (scene(), pan());
    let render = |scale: f64| {
        let grid = LensGrid::new(&lens, &sample_positions(16), scale);
        render_frame_through(&scene, &pan, &K, &request.shutter, &plan, &grid)
    };
    let green = render(1.0);
    let of = |scale: f64| if scale == 1.0 { green.clone() } else { render(scale) };
    let colors = ChromaticAberration::scales(settings).map(of);
    Plane::from_fn(K.width as usize, K.height as usize, |x, y| {
        [0, 1, 2].map(|c| srgb8(colors[c].pixel(x, y)[c]))
    })
}

fn golden(stem: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{stem}.png"))
}

/// Mean difference, levels. Edges lie apart by the grid of a device's vertex positions, and by a chord of the lens.
fn off(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    shutterbug::plane::metrics::mean_absolute_difference(a, b)
}

#[test]
fn rays_give_the_golden_pictures() {
    let wanted = LIST.iter().filter(|e| matches!(e.stage(), Stage::Geometry | Stage::Time)).map(|e| e.id());
    assert!(
        wanted.eq(KINDS.iter().map(|k| k.0)),
        "an effect of the render without a picture, or the reverse"
    );
    for (stem, values, mistake) in KINDS {
        let got = by_rays(&settings(stem, values));
        let same_size = |p: &Plane<u8>| (p.width, p.height) == (got.width, got.height);
        let stands =
            || read_rgb8(&golden(stem)).is_ok_and(|old| same_size(&old) && off(&got, &old) < ROUNDING);
        if std::env::var_os("SHUTTERBUG_BLESS").is_some_and(|v| v == "1") && !stands() {
            write_png_atomic(&golden(stem), &got).unwrap();
        }
        let want = read_rgb8(&golden(stem)).unwrap();
        let wrong = by_rays(&settings(stem, &[values, &[*mistake][..]].concat()));
        eprintln!("{stem}: off by {:.4}, with {mistake:?} by {:.4}", off(&got, &want), off(&wrong, &want));
        assert!(off(&got, &want) < ROUNDING, "{stem}: off by {} levels", off(&got, &want));
        assert!(off(&wrong, &want) > 1.0, "control: {stem} with {mistake:?}");
        assert!(off(&by_rays(&Settings::default()), &want) > 3.0, "control: nothing is seen of {stem}");
    }
}

#[test]
fn the_device_gives_the_golden_pictures() {
    let Some(watched) = device("the_device_gives_the_golden_pictures") else { return };
    let exact = || Method::Exact(ExactOptions::default());
    for (stem, values, mistake) in KINDS {
        let want = read_rgb8(&golden(stem)).unwrap();
        for method in [accumulation(RENDERS), exact()] {
            let render = |settings: &Settings| {
                off(&picture(&watched, &scene(), &pan(), K, method.clone(), &request(settings)), &want)
            };
            let right = render(&settings(stem, values));
            let wrong = render(&settings(stem, &[values, &[*mistake][..]].concat()));
            eprintln!("{stem}, {method:?}: off by {right:.4} levels, with {mistake:?} by {wrong:.4}");
            // `exact` shears what a line shows instead of moving it as one: 0.89 levels, edges by a fifteenth of a px.
            assert!(right < 1.2, "{stem}, {method:?}: off by {right} levels");
            assert!(wrong > 2.0 * right.max(1.2), "control: {stem}, {method:?}: {wrong}");
        }
    }
}
