//! Time of each pixel effect on its own, of the full chain, and the full chain against shutter + blur + the paper's noise,
//! at three sizes: `cargo bench --bench passes [-- --json FILE]`. Times are the device's timestamps, medians.
#![allow(missing_docs, clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::{Effect, ParamKind, Settings, Stage, Value, View};
use shutterbug::effects::{self, LIST};
use shutterbug::engine::{Engine, EngineOptions, FrameRequest, Method, PaperOptions, PixelChain};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, PassTime, Validation};
use shutterbug::plane::Plane;
use shutterbug::scene::SceneBuilder;

const SIZES: [[u32; 2]; 3] = [[320, 240], [640, 480], [1280, 720]];
const ROUNDS: usize = 15;
/// Slow or not on the device, or no part of a camera's usual chain: measured alone only.
const NOT_IN_FULL: [&str; 2] = ["bayer_mosaic", "jpeg"];

/// Usual values of what a real camera has.
const USUAL: &[(&str, &str, f64)] = &[
    ("defocus", "sigma_px", 0.7),
    ("vignetting", "a1", -0.3),
    ("vignetting", "a2", 0.05),
    ("glare", "veil", 0.02),
    ("glare", "level", 0.5),
    ("exposure_gain", "gain", 1.1),
    ("flicker", "frequency_hz", 100.0),
    ("flicker", "depth", 0.05),
    ("dark_current", "rate_per_s", 0.1),
    ("shot_noise", "full_well_e", 8000.0),
    ("fixed_pattern_noise", "dsnu", 0.002),
    ("fixed_pattern_noise", "prnu", 0.01),
    ("row_noise", "sigma", 0.001),
    ("row_noise", "column_sigma", 0.001),
    ("read_noise", "sigma", 0.003),
    ("hot_pixels", "count", 30.0),
    ("black_level", "offset", 0.02),
    ("quantization", "bits", 10.0),
    ("white_balance", "r", 1.2),
    ("white_balance", "b", 0.9),
    ("color_matrix", "rr", 1.2),
    ("color_matrix", "rg", -0.2),
    ("gamma", "exponent", 1.1),
    ("tone_curve", "contrast", 0.2),
    ("sharpening", "amount", 0.5),
    ("sharpening", "radius_px", 0.7),
    ("noise_reduction", "luma_sigma_px", 0.5),
    ("noise_reduction", "chroma_sigma_px", 1.0),
    ("response_curve", "r0", 1.1),
    ("jpeg", "quality", 85.0),
    ("paper_noise", "static_variance_g", 1e-5),
    ("paper_noise", "color_variance_g", 1e-4),
    ("paper_noise", "edge_variance_g", 1e-2),
];

/// An effect with usual values.
fn usual(settings: &mut Settings, effect: &dyn Effect) {
    for spec in effect.specs() {
        let known = USUAL.iter().find(|(e, n, _)| *e == effect.id() && *n == spec.name);
        match (known, spec.kind) {
            (Some((.., value)), _) => settings.set(effect, spec.name, Value::Number(*value)).unwrap(),
            (None, ParamKind::Choice { options, .. }) if spec.name != "average" => {
                settings.set(effect, spec.name, Value::Choice(options[1])).unwrap();
            }
            _ => settings.enable(effect),
        }
    }
}

fn view([width, height]: [u32; 2]) -> View {
    let side = f64::from(width);
    let k = Intrinsics {
        width,
        height,
        fx: 0.8 * side,
        fy: 0.8 * side,
        cx: 0.5 * side,
        cy: 0.5 * f64::from(height),
    };
    let shutter = ShutterTiming {
        start_s: 0.0,
        exposure_time_s: 0.01,
        readout_time_s: 0.02,
        scan_order: ScanOrder::TopToBottom,
        line_count: height,
    };
    View { intrinsics: k, shutter, frame: 0, seed: 1 }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn sum(times: &[PassTime], counts: impl Fn(&str) -> bool) -> f64 {
    times.iter().filter(|t| counts(t.name)).map(|t| t.ms).sum()
}

/// Device time of the chain's passes, ms, and the host's for what runs there.
fn chain_ms(chain: &mut PixelChain, settings: &Settings, view: View) -> (f64, f64) {
    let (mut device, mut host) = (Vec::new(), Vec::new());
    for frame in 0..ROUNDS as u32 + 2 {
        let view = View { frame, ..view };
        let start = std::time::Instant::now();
        chain.picture(settings, &view).unwrap();
        let all_ms = start.elapsed().as_secs_f64() * 1e3;
        if frame >= 2 {
            let times = chain.times().unwrap();
            device.push(sum(&times, |n| n != "readback"));
            host.push(all_ms);
        }
    }
    (median(device), median(host))
}

/// Passes of the paper's method behind the render: gather and chain.
fn method_ms(context: &Arc<Context>, settings: &Settings, view: &View) -> (f64, f64) {
    let mut scene = SceneBuilder::new();
    for i in 0..40 {
        let (x, y) = (f64::from(i % 8) as f32 - 4.0, f64::from(i / 8) as f32 - 2.5);
        let color = [0.1 + 0.02 * i as f32, 0.5, 0.9 - 0.02 * i as f32];
        scene = scene.material(color).cuboid([x, y, 4.0], [x + 0.9, y + 0.9, 4.5]);
    }
    let pose = |angle: f64| Pose { rotation: DQuat::from_rotation_y(angle), translation_m: DVec3::ZERO };
    // One radian a second.
    let times: Vec<f64> = (-10..=60).map(|i| f64::from(i) * 0.01).collect();
    let poses = times.iter().map(|t| pose(*t)).collect();
    let path = Arc::new(Trajectory::new(Path::new("bench"), times, poses).unwrap());
    let options = EngineOptions {
        method: Method::Paper(PaperOptions::default()),
        samples: 4,
        frames_in_flight: 1,
        ..EngineOptions::default()
    };
    let request = |index: u32| FrameRequest {
        index,
        shutter: ShutterTiming { start_s: 0.1, ..view.shutter },
        frame_interval_s: 0.033,
        seed: 1,
        settings: settings.clone(),
        static_camera: false,
        planes: false,
        statistics: false,
    };
    let scene = Arc::new(scene.build());
    let mut engine = Engine::new(context, scene, path, view.intrinsics, options, &[request(0)]).unwrap();
    let (mut behind, mut all) = (Vec::new(), Vec::new());
    for index in 0..ROUNDS as u32 + 2 {
        let frame = engine.render(&request(index)).unwrap();
        let before = ["raster", "resolve", "motion", "readback"];
        if index >= 2 {
            behind.push(sum(&frame.times, |n| !before.contains(&n)));
            all.push(sum(&frame.times, |_| true));
        }
    }
    (median(behind), median(all))
}

/// What the full chain costs beyond 1.5 times shutter, blur and the paper's noise, at the middle size: the passes that cannot
/// run in the fused kernel because they read neighbours that the effects before them have changed.
fn in_the_way(rows: &[(String, Vec<f64>)]) -> String {
    let of = |name: &str| rows.iter().find(|r| r.0 == name).map_or(0.0, |r| r.1[1]);
    let ratio = of("ratio of the two");
    let plain = of("plain (sRGB, 8 bits)");
    let mut dear: Vec<(f64, &str)> = LIST
        .iter()
        .filter(|e| matches!(e.stage(), Stage::Pixel(..)) && !NOT_IN_FULL.contains(&e.id()))
        .map(|e| (of(e.id()) - plain, e.id()))
        .collect();
    dear.sort_by(|a, b| b.0.total_cmp(&a.0));
    let named: Vec<String> = dear.iter().take(6).map(|(ms, id)| format!("{id} +{ms:.1}")).collect();
    let [_, [w, h], _] = SIZES;
    if ratio <= 1.5 {
        return format!(
            "At {w}x{h} the full chain costs {ratio:.2} times shutter + blur + noise: within 1.5."
        );
    }
    format!(
        "At {w}x{h} the full chain costs {ratio:.2} times shutter + blur + noise; 1.5 is missed. In the way, ms over a plain \
         frame when alone: {}.",
        named.join(", ")
    )
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let json_file = arguments.iter().position(|a| a == "--json").and_then(|i| arguments.get(i + 1));
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED passes: {error}"),
    };
    println!("{}; medians of {ROUNDS} frames, ms", context.info().name);
    let mut rows: Vec<(String, Vec<f64>)> = Vec::new();
    let mut put = |name: String, column: usize, value: f64| {
        match rows.iter_mut().find(|r| r.0 == name) {
            Some(row) => row.1.push(value),
            None => {
                assert_eq!(column, 0);
                rows.push((name, vec![value]));
            }
        };
    };
    for (column, size) in SIZES.into_iter().enumerate() {
        let view = view(size);
        let mut chain = PixelChain::new(&context, size).unwrap();
        let radiance = Plane::from_fn(size[0] as usize, size[1] as usize, |x, y| {
            [x as f32 / size[0] as f32, y as f32 / size[1] as f32, ((x / 16 + y / 16) % 2) as f32, 1.0]
        });
        chain.load(&radiance).unwrap();
        put("plain (sRGB, 8 bits)".to_owned(), column, chain_ms(&mut chain, &Settings::default(), view).0);
        let mut full = Settings::default();
        for effect in LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..))) {
            let mut alone = Settings::default();
            usual(&mut alone, *effect);
            let (device_ms, host_ms) = chain_ms(&mut chain, &alone, view);
            let jpeg = effect.id() == "jpeg";
            let name = if jpeg { "jpeg (host, all of the frame)" } else { effect.id() };
            put(name.to_owned(), column, if jpeg { host_ms } else { device_ms });
            if !NOT_IN_FULL.contains(&effect.id()) {
                usual(&mut full, *effect);
            }
        }
        put("full chain".to_owned(), column, chain_ms(&mut chain, &full, view).0);
        let mut noise = Settings::default();
        usual(&mut noise, effects::by_id("paper_noise").unwrap());
        let (reference, reference_frame) = method_ms(&context, &noise, &view);
        let (with_all, all_frame) = method_ms(&context, &full, &view);
        put("shutter + blur + paper_noise".to_owned(), column, reference);
        put("shutter + blur + full chain".to_owned(), column, with_all);
        put("ratio of the two".to_owned(), column, with_all / reference);
        put("ratio of whole frames (method paper)".to_owned(), column, all_frame / reference_frame);
    }
    let head = SIZES.map(|[w, h]| format!("{:>11}", format!("{w}x{h}"))).join("");
    println!("{:40}{head}", "");
    for (name, values) in &rows {
        println!("{name:40}{}", values.iter().map(|v| format!("{v:11.3}")).collect::<String>());
    }
    println!("{}", in_the_way(&rows));
    if let Some(file) = json_file {
        let table: serde_json::Map<_, _> = rows.into_iter().map(|(n, v)| (n, v.into())).collect();
        let sizes: Vec<_> = SIZES.iter().map(|[w, h]| format!("{w}x{h}")).collect();
        let json = serde_json::json!({ "device": context.info().name, "unit": "ms", "sizes": sizes, "passes": table });
        std::fs::write(file, serde_json::to_string_pretty(&json).unwrap() + "\n").unwrap();
    }
}
