//! A report with pictures, made without any engine: a moving stripe pattern, sheared as a rolling shutter does.

pub mod page;

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::json;
use shutterbug::plane::{Plane, write_png_atomic};
use shutterbug_diagnose::diagnose::{
    Bin, Bootstrap, Candidate, CandidateState, DescriptionShown, EffectFound, FrameEntry, FramePictures, Gap,
    Input, LeftOut, Maps, Measure, NextStep, Parameter, PerceptGap, Percepts, PoseOff, Report, Verdict,
    WaterfallStep, Where,
};

/// Size of the pictures, px.
pub const SIZE: (usize, usize) = (320, 240);

/// Pixel noise, so that pictures compress as badly as real ones do.
fn noise(x: usize, y: usize, seed: usize) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64) << 20 ^ (seed as u64) << 40;
    h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (h >> 40) as f64 / f64::from(1 << 24) - 0.5
}

fn picture(shift: impl Fn(usize) -> f64, seed: usize) -> Plane<u8> {
    Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
        let u = x as f64 + shift(y);
        let stripes = (u / 23.0).sin().signum() * 50.0 * f64::from(((y / 40) % 2) as u8);
        let base = 110.0 + 40.0 * (u / 61.0).sin() + stripes;
        [0, 1, 2].map(|c| (base + 12.0 * c as f64 + 5.0 * noise(x, y, 3 * seed + c)) as u8)
    })
}

fn difference(a: &Plane<u8>, b: &Plane<u8>) -> Plane<u8> {
    Plane::from_fn(a.width, a.height, |x, y| {
        let d: u32 = a.pixel(x, y).iter().zip(b.pixel(x, y)).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        [(d * 255 / (3 * 40)).min(255) as u8]
    })
}

fn write(folder: &Path, name: &str, plane: &Plane<u8>) -> String {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("in a folder")).expect("made");
    write_png_atomic(&path, plane).expect("written");
    name.to_owned()
}

fn frame(folder: &Path, index: usize, filename: &str) -> FrameEntry {
    let speed = 0.05 + 0.01 * index as f64;
    let at = 9.0 * index as f64;
    let real = picture(|y| at + speed * y as f64, 2 * index);
    let simulated = picture(|_| at, 2 * index + 1);
    let diagnosed = picture(|y| at + 0.98 * speed * y as f64, 2 * index + 1);
    let pictures = FramePictures {
        difference_before: write(folder, &format!("maps/b{index}.png"), &difference(&real, &simulated)),
        difference_after: write(folder, &format!("maps/a{index}.png"), &difference(&real, &diagnosed)),
        real: write(folder, &format!("frames/r{index}.png"), &real),
        simulated: write(folder, &format!("frames/s{index}.png"), &simulated),
        diagnosed: write(folder, &format!("frames/d{index}.png"), &diagnosed),
    };
    let (before, after) = (6.0 + 0.2 * index as f64, 1.3);
    let (filename, time_s) = (filename.to_owned(), 0.04 * index as f64);
    FrameEntry { index, filename, time_s, held_out: index % 2 == 1, before, after, pictures }
}

fn bins(count: usize, step: f64, label: impl Fn(usize) -> String, before: impl Fn(f64) -> f64) -> Vec<Bin> {
    let bin = |i: usize| {
        let part = (i as f64 + 0.5) / count as f64;
        Bin {
            from: step * i as f64,
            to: step * (i + 1) as f64,
            label: label(i),
            before: before(part),
            after: 1.2 + 0.1 * (9.0 * part).sin(),
            bias_before: 0.3 * part,
            bias_after: 0.0,
            weight: 1.0 / count as f64,
        }
    };
    (0..count).map(bin).collect()
}

fn parameter(value: serde_json::Value, ci95: Option<serde_json::Value>, unit: &str) -> Parameter {
    Parameter { value, ci95, unit: unit.to_owned() }
}

fn places(object: &str) -> Where {
    let named = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|s| (*s).to_owned()).collect();
        bins(names.len(), 1.0, |i| names[i].clone(), |p| 5.0 + 3.0 * p)
    };
    Where {
        summary: vec![
            "81 % of the difference lies on edges that move faster than 200 px/s".to_owned(),
            format!("it grows from the top line to the bottom, most of all on {object}"),
        ],
        by_row: bins(240, 1.0, |i| format!("row {i}"), |p| 1.0 + 11.0 * p),
        by_column: bins(320, 1.0, |i| format!("column {i}"), |p| 7.0 + p),
        by_radius: bins(10, 20.0, |i| format!("{} to {} px", 20 * i, 20 * i + 20), |p| 6.0 + 2.0 * p),
        by_speed: bins(8, 60.0, |i| format!("{} to {} px/s", 60 * i, 60 * i + 60), |p| 1.0 + 14.0 * p),
        by_direction: bins(8, 45.0, |i| format!("{} degrees", 45 * i), |p| 6.0 + (6.0 * p).sin()),
        by_intensity: bins(8, 32.0, |i| format!("{} DN", 32 * i), |p| 7.0 - 2.0 * (p - 0.5).powi(2)),
        by_channel: named(&["red", "green", "blue"]),
        by_frequency: named(&["finest", "fine", "middle", "coarse", "coarsest"]),
        by_object: named(&["wall", "a very long name of an object that does not fit", object]),
        by_frame: bins(20, 1.0, |i| format!("frame {i}"), |p| 6.0 + 4.0 * p),
    }
}

fn effects() -> Vec<EffectFound> {
    let shutter = [
        ("readout_time_s", parameter(json!(0.020_134_567), Some(json!([0.019_9, 0.020_3])), "s")),
        ("scan_order", parameter(json!("top_to_bottom"), None, "")),
    ];
    let pose = [(
        "rotvec_rad",
        parameter(
            json!([0.001, -0.02, 0.0]),
            Some(json!([[0.0, 0.002], [-0.03, -0.01], [-0.001, 0.001]])),
            "rad",
        ),
    )];
    let found = |name: &str, share, parameters: BTreeMap<String, Parameter>| EffectFound {
        name: name.to_owned(),
        share,
        parameters,
        camera: true,
        gap_without: 6.1,
        gap_with: 1.3,
        gap_alone: 2.0,
        gain_ci95: [4.1, 5.3],
        alternatives: Vec::new(),
        same_together: BTreeMap::new(),
        footage: String::new(),
    };
    let map = |p: &[(&str, Parameter)]| p.iter().map(|(n, p)| ((*n).to_owned(), p.clone())).collect();
    vec![found("rolling_shutter", 0.83, map(&shutter)), found("pose_offset", 0.17, map(&pose))]
}

fn candidates() -> Vec<Candidate> {
    let candidate = |name: &str, state, why: &str, gap_with, footage: &str| Candidate {
        name: name.to_owned(),
        state,
        why: why.to_owned(),
        gap_with,
        parameters: [("sigma_px".to_owned(), parameter(json!(0.12), None, "px"))].into(),
        footage: footage.to_owned(),
    };
    vec![
        candidate(
            "motion_blur",
            CandidateState::Rejected,
            "worth 0.3 % of the gap; 1 % is asked for",
            Some(7.0),
            "",
        ),
        candidate(
            "defocus",
            CandidateState::Rejected,
            "its gain on held-out frames is not above 0",
            Some(7.1),
            "",
        ),
        candidate(
            "shot_noise",
            CandidateState::Undetermined,
            "one exposure",
            None,
            "the same scene at two exposures",
        ),
    ]
}

/// Percepts of the first frame, as they lie beside a report.
fn percepts(folder: &Path) -> Percepts {
    let kinds = |matched: Option<bool>| {
        let kind = |at: serde_json::Value| match matched {
            Some(m) => json!({ "at": [at], "matched": [m] }),
            None => json!({ "at": [at] }),
        };
        json!({
            "corners": kind(json!([20.5, 30.5])), "lines": kind(json!([5.0, 6.0, 70.0, 80.0])),
            "blobs": kind(json!([100.0, 50.0, 7.0])),
        })
    };
    let frame = json!({
        "index": 0, "real": kinds(None), "simulated": kinds(Some(false)), "diagnosed": kinds(Some(true)),
    });
    let text = json!({ "frames": [frame] }).to_string();
    std::fs::write(folder.join("percepts.json"), text).expect("written");
    let kind = |name: &str| PerceptGap {
        name: name.to_owned(),
        real: 31.0,
        before: 29.5,
        after: 30.25,
        matched_before: 0.125,
        matched_after: 0.875,
        matched_floor: 1.0,
        offset_before_px: None,
        offset_after_px: Some(0.31),
    };
    Percepts {
        file: "percepts.json".to_owned(),
        tolerance_px: 3.2,
        kinds: ["corners", "lines", "blobs"].map(kind).to_vec(),
    }
}

/// A whole report whose pictures lie in `folder`. `hostile` stands wherever a stranger's text can.
pub fn sample(folder: &Path, frame_count: usize, hostile: &str) -> Report {
    let frames: Vec<_> =
        (0..frame_count).map(|i| frame(folder, i, &format!("{hostile}{i:06}.png"))).collect();
    let step = |name: &str, from, to| WaterfallStep { name: name.to_owned(), from, to };
    let mean = Plane::from_fn(SIZE.0, SIZE.1, |x, y| [((x + 2 * y) / 4) as u8]);
    Report {
        verdict: Verdict::Explained,
        sentence:
            "The gap is a rolling shutter of 20.1 ms, read top to bottom, and a camera turned by 1.1 degrees."
                .to_owned(),
        gap: Gap {
            unit: "DN".to_owned(),
            before: 7.1,
            after: 1.3,
            floor: 1.2,
            closed_fraction: 0.983,
            closed_fraction_ci95: [0.971, 0.99],
            held_out_frames: frame_count / 2,
            before_ci95: [6.6, 7.7],
            after_ci95: [1.2, 1.4],
            renderer_difference: 0.4,
        },
        effects: effects(),
        candidates: candidates(),
        places: places(hostile),
        waterfall: vec![
            step("before", 7.1, 7.1),
            step("rolling_shutter", 7.1, 2.3),
            step("pose_offset", 2.3, 1.3),
            step("unexplained", 1.3, 1.2),
            step("floor", 1.2, 1.2),
        ],
        measures: vec![
            Measure { name: "psnr".to_owned(), unit: "dB".to_owned(), before: 21.2, after: 34.9 },
            Measure { name: "ssim".to_owned(), unit: String::new(), before: 0.71, after: f64::NAN },
        ],
        percepts: percepts(folder),
        frames,
        maps: Maps {
            scale_dn: 40.0,
            mean_scale_dn: 12.0,
            before: write(folder, "maps/before.png", &mean),
            after: write(folder, "maps/after.png", &Plane::from_fn(SIZE.0, SIZE.1, |x, _| [(x / 16) as u8])),
            bias_before: write(folder, "maps/bias_before.png", &mean),
            bias_after: write(folder, "maps/bias_after.png", &Plane::from_fn(SIZE.0, SIZE.1, |_, _| [128])),
        },
        description: DescriptionShown {
            factors: vec![write(folder, "scene_radiance/factor.png", &mean)],
            white_factor: 1.5,
            objects: vec![write(folder, "undescribed_object/object.png", &mean)],
            poses: (0..frame_count)
                .map(|i| PoseOff {
                    time_s: 0.04 * i as f64,
                    rotation_rad: 1e-3,
                    position_m: 2e-3,
                    late_s: Some(-4e-3),
                })
                .collect(),
        },
        input: Input {
            kind: "capture".to_owned(),
            capture: format!("captures/{hostile}"),
            width: SIZE.0 as u32,
            height: SIZE.1 as u32,
            frames_listed: frame_count + 1,
            fit_frames: (0..frame_count).step_by(2).collect(),
            held_out_frames: (1..frame_count).step_by(2).collect(),
            left_out: vec![LeftOut {
                index: frame_count,
                filename: hostile.to_owned(),
                why: "black".to_owned(),
            }],
            compared_share: 0.97,
            seed: 7,
            device: "llvmpipe".to_owned(),
            method: "exact".to_owned(),
            seconds: 41.3,
            renders: 812,
            render_seconds: 25.5,
            version: "0.1.0".to_owned(),
            alignment: None,
        },
        bootstrap: Bootstrap { resamples: 1000, block: 2, closed_fraction: vec![0.97, 0.98] },
        warnings: vec![format!("{hostile} is black and was left out")],
        next: vec![NextStep {
            purpose: "Render the capture with the effects found:".to_owned(),
            command: format!("shutterbug simulate 'captures/{hostile}' --camera out/camera.toml --out sim"),
        }],
    }
}
