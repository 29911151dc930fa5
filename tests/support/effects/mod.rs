//! What the tests of effects share: settings of every effect, scenes that give a known radiance, frames through the
//! engine.
#![allow(dead_code, clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::capture::Capture;
use shutterbug::chain::{Effect, ParamKind, Settings, Value, View, rng};
use shutterbug::plane::Plane;

/// Settings by a list of (effect, parameter, value).
pub fn settings(of: &[(&str, &str, f64)]) -> Settings {
    let mut settings = Settings::default();
    for (effect, name, value) in of {
        settings.set(by_id(effect), name, Value::Number(*value)).unwrap();
    }
    settings
}

pub fn by_id(id: &str) -> &'static dyn Effect {
    shutterbug::effects::by_id(id).unwrap()
}

/// A view of a global shutter without exposure.
pub fn view(width: u32, height: u32) -> View {
    let k = Intrinsics {
        width,
        height,
        fx: 200.0,
        fy: 200.0,
        cx: 0.47 * f64::from(width),
        cy: 0.55 * f64::from(height),
    };
    let shutter = ShutterTiming {
        start_s: 0.013,
        exposure_time_s: 0.004,
        readout_time_s: 0.02,
        scan_order: ScanOrder::TopToBottom,
        line_count: height,
    };
    View { intrinsics: k, shutter, frame: 3, seed: 0x1234_5678_9abc_def0 }
}

/// Random radiance of -0.05 to 1.15 with some far values, black, white and over-range pixels.
pub fn random_radiance(width: usize, height: usize) -> Plane<f32> {
    Plane::from_fn(width, height, |x, y| {
        let bits = rng::random_bits([x as u32, y as u32], 0, 0x7e57, [1, 2]);
        let unit = |b: u32| b as f32 / 4_294_967_296.0;
        match bits[3] % 16 {
            0 => [0.0; 4],
            1 => [1.0, 1.0, 1.0, 1.0],
            2 => [unit(bits[0]) * 0.01, unit(bits[1]) * 0.01, unit(bits[2]) * 0.01, 1.0],
            3 => [4.0 * unit(bits[0]), 0.5, 0.0, 1.0],
            _ => [1.2 * unit(bits[0]) - 0.05, 1.2 * unit(bits[1]) - 0.05, unit(bits[2]), 1.0],
        }
    })
}

/// Typical values that make an effect visible, by its specs: every parameter is away from neutral.
pub fn visible(effect: &dyn Effect) -> Settings {
    let mut settings = Settings::default();
    if effect.id() == "sensor_color" {
        // It undoes these; with noise between, that can be seen. Not 400 e-: the golden picture's bars then lie where
        // shot noise goes from one formula to the other, which a rounding error decides.
        settings = self::settings(&[
            ("white_balance", "r", 1.4),
            ("color_matrix", "rg", -0.15),
            ("response_curve", "r3", 1.5),
            ("shot_noise", "full_well_e", 370.0),
        ]);
    }
    for spec in effect.specs() {
        let value = visible_value(effect.id(), spec.name, &spec.kind);
        settings.set(effect, spec.name, value).unwrap();
    }
    settings
}

/// A value of a parameter that is not neutral and not extreme.
fn visible_value(effect: &str, name: &str, kind: &ParamKind) -> Value {
    let known = match (effect, name) {
        ("vignetting", "a1") => -0.3,
        ("vignetting", "a2") => -0.15,
        ("glare", "veil") => 0.1,
        ("glare", "level") => 0.4,
        ("exposure_gain", "gain") => 0.7,
        ("flicker", "frequency_hz") => 100.0,
        ("flicker", "depth") => 0.3,
        ("flicker", "phase_rad") => 0.5,
        ("dark_current", _) => 10.0,
        ("paper_noise", _) => 0.001,
        ("shot_noise", _) => 400.0,
        ("fixed_pattern_noise", "sensor_seed") | ("hot_pixels", "sensor_seed") => 77.0,
        ("fixed_pattern_noise", _) | ("row_noise", _) | ("read_noise", "sigma") => 0.05,
        ("read_noise", _) => 0.5,
        ("hot_pixels", "count") => 12.0,
        ("hot_pixels", "fraction") => 0.02,
        ("black_level", _) => 0.06,
        ("quantization", _) => 4.0,
        ("white_balance", "r") => 1.4,
        ("white_balance", "b") => 0.8,
        ("gamma", _) => 1.3,
        ("tone_curve", _) => 0.5,
        ("saturation", _) => 0.6,
        ("defocus", "aperture_m") => 0.01,
        ("defocus", "focus_m") => 0.2,
        ("defocus", "max_radius_px") => 3.0,
        ("defocus", "sigma_px") => 1.3,
        ("defocus", "disc_radius_px") => 2.2,
        ("noise_reduction", "edge") => 0.2,
        ("noise_reduction", "luma_sigma_px") => 0.9,
        ("noise_reduction", _) => 1.7,
        ("response_curve", name) => 1.0 + 0.03 * (name.len() + name.as_bytes()[1] as usize % 7) as f64,
        ("sharpening", "amount") => 0.8,
        ("sharpening", _) => 1.2,
        ("jpeg", _) => 60.0,
        ("color_matrix", "rr" | "gg" | "bb") => 1.3,
        ("color_matrix", _) => -0.15,
        _ => f64::NAN,
    };
    match *kind {
        _ if !known.is_nan() => Value::Number(known),
        // An effect that is not known here still takes part.
        ParamKind::Number { min, max, neutral } => {
            Value::Number(0.9 * neutral + 0.1 * if max > neutral { max } else { min })
        }
        ParamKind::Integer { max, neutral, .. } => Value::Number((0.5 * (neutral + max)).round()),
        ParamKind::Choice { options, .. } => Value::Choice(options[1]),
        ParamKind::Vector3 { max } => Value::Vector3([0.01 * max, 0.02 * max, -0.01 * max]),
    }
}

/// A camera at the origin that never moves, looking along +z.
pub fn resting() -> Arc<Trajectory> {
    let pose = Pose { rotation: DQuat::IDENTITY, translation_m: DVec3::ZERO };
    Arc::new(Trajectory::new(Path::new("resting"), vec![-10.0, 10.0], vec![pose, pose]).unwrap())
}

/// The effects before the tone curve: their chain ends in linear values, unclipped.
pub fn linear_list() -> Vec<&'static dyn Effect> {
    use shutterbug::chain::{Domain, Stage};
    let encoded = |e: &&dyn Effect| matches!(e.stage(), Stage::Pixel(_, Domain::EncodedRgb));
    shutterbug::effects::LIST.iter().copied().filter(|e| !encoded(e)).collect()
}

/// Linear values behind the sensor, of a flat picture.
pub fn flat(of: &Settings, view: &View, level: [f32; 3]) -> Plane<f32> {
    let size = [view.intrinsics.width as usize, view.intrinsics.height as usize];
    let radiance = Plane::from_fn(size[0], size[1], |_, _| [level[0], level[1], level[2], 1.0]);
    shutterbug::reference::chain::values(&linear_list(), of, view, &radiance)
}

/// One channel.
pub fn channel(plane: &Plane<f32>, c: usize) -> Vec<f64> {
    plane.data.chunks_exact(4).map(|p| f64::from(p[c])).collect()
}

/// Mean, variance and skewness.
pub fn moments(values: &[f64]) -> (f64, f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let central = |k: i32| values.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
    let variance = central(2);
    (mean, variance, central(3) / variance.powf(1.5))
}

/// Correlation of two lists.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let ((ma, va, _), (mb, vb, _)) = (moments(a), moments(b));
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum();
    sum / a.len() as f64 / (va * vb).sqrt()
}

/// Correlation of horizontal and of vertical neighbours.
pub fn neighbour_correlation(values: &[f64], width: usize) -> (f64, f64) {
    let (mut here, mut right) = (Vec::new(), Vec::new());
    for row in values.chunks_exact(width) {
        here.extend_from_slice(&row[..width - 1]);
        right.extend_from_slice(&row[1..]);
    }
    (correlation(&here, &right), correlation(&values[..values.len() - width], &values[width..]))
}

/// The capture with the answer's effects switched on, or `None`, said loudly.
pub fn answered(name: &str, test: &str) -> Option<(Capture, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/cycles-dev").join(name);
    if !root.is_dir() {
        eprintln!("SKIPPED {test}: ../shared/data/cycles-dev/{name} is absent");
        return None;
    }
    let mut capture = Capture::read(&root, None).unwrap();
    let answer = std::fs::read_to_string(root.join("answer.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    for effect in answer["effects"].as_array().unwrap() {
        let id = effect["name"].as_str().unwrap();
        for (key, value) in effect
            .as_object()
            .unwrap()
            .iter()
            .filter(|(k, _)| !["name", "unit", "model", "sign"].contains(&k.as_str()))
        {
            // The answers call some parameters differently.
            let key = match key.as_str() {
                "readout_s" => "readout_time_s",
                "exposure_s" => "exposure_time_s",
                "direction" => "scan_order",
                "full_well" => "full_well_e",
                other => other,
            };
            let value = match value.as_f64() {
                Some(number) => Value::Number(number),
                None => Value::Choice(option(id, key, value.as_str().unwrap())),
            };
            let spec = by_id(id).specs().iter().find(|s| s.name == key);
            assert!(spec.is_some(), "{name}: {id}.{key} is not modelled");
            capture.camera.settings.set(by_id(id), key, value).unwrap();
        }
    }
    Some((capture, root))
}

fn option(id: &str, key: &str, value: &str) -> &'static str {
    let spec = by_id(id).specs().iter().find(|s| s.name == key).unwrap();
    let shutterbug::chain::ParamKind::Choice { options, .. } = spec.kind else { panic!("{id}.{key}") };
    options.iter().find(|o| **o == value).unwrap()
}
