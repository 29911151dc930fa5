//! Time of each pixel effect on its own and in the full chain (what the chain costs less without it), of the full
//! chain, and the full chain against shutter + blur + the paper's noise, at three sizes: `cargo bench --bench passes
//! [-- --json FILE] [--size WxH] [--only EFFECT]`; a whole run writes docs/measurements/passes.md. On a software
//! device times are the processor's, all threads together and with reading the picture back (the plain one's share);
//! else the device's timestamps.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "measured/mod.rs"]
mod measured;

use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::{Effect, ParamKind, Settings, Stage, Value, View};
use shutterbug::effects::{self, LIST};
use shutterbug::engine::{Engine, EngineOptions, FrameRequest, Method, PaperOptions, PixelChain};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, DeviceKind, PassTime, Validation};
use shutterbug::plane::Plane;
use shutterbug::scene::SceneBuilder;

const SIZES: [[u32; 2]; 3] = [[320, 240], [640, 480], [1280, 720]];
const ROUNDS: usize = 20;
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
    ("saturation", "factor", 0.75),
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

/// Processor time of this process, all threads, ms; `None` where the system does not say.
fn processor_ms() -> Option<f64> {
    let of_thread = |entry: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-6)
    };
    Some(std::fs::read_dir("/proc/self/task").ok()?.filter_map(of_thread).sum())
}

/// What frames of a kind cost: on a software device processor time, which other programs hardly change; else the
/// device's timestamps. Of some frames the least.
#[derive(Default)]
struct Cost {
    frames: usize,
    /// Least time of each pass by timestamps, by its place.
    passes: Vec<PassTime>,
    /// The least processor time of a frame.
    processor_ms: Option<f64>,
    /// The least time of a frame by the host's clock.
    host_ms: Option<f64>,
}

impl Cost {
    /// Runs one frame. The first ones make pipelines and are not counted.
    fn add(&mut self, frame: impl FnOnce() -> Vec<PassTime>) {
        let (before, start) = (processor_ms(), std::time::Instant::now());
        let times = frame();
        let host_ms = start.elapsed().as_secs_f64() * 1e3;
        let spent = before.zip(processor_ms()).map(|(before, after)| after - before);
        self.frames += 1;
        if self.frames <= 2 {
            return;
        }
        if self.passes.is_empty() {
            self.passes.clone_from(&times);
        }
        assert_eq!(self.passes.len(), times.len(), "frames of a kind have the same passes");
        self.passes.iter_mut().zip(&times).for_each(|(least, t)| least.ms = least.ms.min(t.ms));
        self.host_ms = Some(self.host_ms.map_or(host_ms, |least| least.min(host_ms)));
        self.processor_ms = self.processor_ms.into_iter().chain(spent).reduce(f64::min);
    }

    fn device_ms(&self, counts: impl Fn(&str) -> bool) -> f64 {
        self.passes.iter().filter(|t| counts(t.name)).map(|t| t.ms).sum()
    }

    /// The cost of a whole frame.
    fn frame_ms(&self, software: bool) -> f64 {
        self.processor_ms.filter(|_| software).unwrap_or_else(|| self.device_ms(|_| true))
    }
}

/// Cost of the chain with each of some settings; they take turns.
fn chain_costs(chain: &mut PixelChain, of: &[Settings], view: View) -> Vec<Cost> {
    let mut costs: Vec<Cost> = of.iter().map(|_| Cost::default()).collect();
    for frame in 0..ROUNDS as u32 + 2 {
        for (settings, cost) in of.iter().zip(&mut costs) {
            cost.add(|| {
                chain.picture(settings, &View { frame, ..view }).unwrap();
                chain.times().unwrap()
            });
        }
    }
    costs
}

/// An engine of the paper's method, and the request that it is given.
fn method(context: &Arc<Context>, settings: &Settings, view: &View) -> (Engine, FrameRequest) {
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
    let request = FrameRequest {
        index: 0,
        shutter: ShutterTiming { start_s: 0.1, ..view.shutter },
        frame_interval_s: 0.033,
        seed: 1,
        settings: settings.clone(),
        static_camera: false,
        planes: false,
        statistics: false,
    };
    let scene = Arc::new(scene.build());
    let engine =
        Engine::new(context, scene, path, view.intrinsics, options, std::slice::from_ref(&request)).unwrap();
    (engine, request)
}

/// Gather and chain behind the render, and the whole frame, ms, of some settings, of which the first has no effects on
/// pixels; they take turns. The render is the same for all: what it costs is the first one's share by timestamps.
fn method_ms<const N: usize>(
    context: &Arc<Context>,
    of: [&Settings; N],
    view: &View,
    software: bool,
) -> [(f64, f64); N] {
    let mut engines = of.map(|settings| (method(context, settings, view), Cost::default()));
    for index in 0..ROUNDS as u32 + 2 {
        for ((engine, request), cost) in &mut engines {
            request.index = index;
            cost.add(|| engine.render(request).unwrap().times);
        }
    }
    let render = ["raster", "resolve", "motion", "readback"];
    let plain = &engines[0].1;
    let share = plain.device_ms(|n| render.contains(&n)) / plain.device_ms(|_| true);
    let render_ms = share * plain.frame_ms(software);
    engines.map(|(_, cost)| (cost.frame_ms(software) - render_ms, cost.frame_ms(software)))
}

/// Whether the full chain costs at most 1.5 times shutter, blur and the paper's noise, at the middle size, and if not,
/// what it costs there without each of the dearest effects.
fn in_the_way(rows: &[(String, Vec<f64>)], sizes: &[[u32; 2]]) -> String {
    let column = sizes.len() / 2;
    let of = |name: &str| rows.iter().find(|r| r.0 == name).map_or(0.0, |r| r.1[column]);
    let ratio = of(RATIO);
    let said =
        format!("At {} the full chain costs {ratio:.2} times shutter + blur + noise", named(&sizes[column]));
    if ratio <= GOAL {
        return format!("{said}: within {GOAL}.");
    }
    let mut dear: Vec<(f64, &str)> = in_full().map(|e| (of(&within(e.id())), e.id())).collect();
    dear.sort_by(|a, b| b.0.total_cmp(&a.0));
    let named: Vec<String> = dear.iter().take(8).map(|(ms, id)| format!("{id} {ms:.1}")).collect();
    let lines: Vec<String> = named.chunks(4).map(|four| four.join(", ")).collect();
    format!("{said}; {GOAL} is missed.\nIn the way, ms in the full chain: {}.", lines.join(",\n"))
}

const GOAL: f64 = 1.5;
const RATIO: &str = "ratio of the two";

/// The row of an effect's share of the full chain.
fn within(id: &str) -> String {
    format!("  {id} in the full chain")
}

/// The effects of the full chain.
fn in_full() -> impl Iterator<Item = &'static &'static dyn Effect> {
    LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..)) && !NOT_IN_FULL.contains(&e.id()))
}

/// The full chain, or what is left of it without one effect.
fn full(without: Option<&str>) -> Settings {
    let mut settings = Settings::default();
    in_full().filter(|e| Some(e.id()) != without).for_each(|e| usual(&mut settings, *e));
    settings
}

/// Everything that is measured at one size, by row.
fn measure(context: &Arc<Context>, size: [u32; 2], only: Option<&str>, software: bool) -> Vec<(String, f64)> {
    let view = view(size);
    let mut chain = PixelChain::new(context, size).unwrap();
    let radiance = Plane::from_fn(size[0] as usize, size[1] as usize, |x, y| {
        [x as f32 / size[0] as f32, y as f32 / size[1] as f32, ((x / 16 + y / 16) % 2) as f32, 1.0]
    });
    chain.load(&radiance).unwrap();
    let wanted = |e: &&&dyn Effect| only.is_none_or(|id| id == e.id());
    let single: Vec<_> =
        LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..))).filter(wanted).collect();
    let parts: Vec<_> = in_full().filter(wanted).collect();
    let alone = single.iter().map(|effect| {
        let mut settings = Settings::default();
        usual(&mut settings, **effect);
        settings
    });
    let ends = [Settings::default(), full(None)].into_iter();
    let all: Vec<_> = ends.chain(alone).chain(parts.iter().map(|e| full(Some(e.id())))).collect();
    let costs = chain_costs(&mut chain, &all, view);
    let (ends, rest) = costs.split_at(2);
    let (alone, without) = rest.split_at(single.len());
    let full_ms = ends[1].frame_ms(software);
    let mut rows = vec![("plain (sRGB, 8 bits)".to_owned(), ends[0].frame_ms(software))];
    for (effect, cost) in single.iter().zip(alone) {
        rows.push(match effect.id() {
            "jpeg" => ("jpeg (host, all of the frame)".to_owned(), cost.host_ms.unwrap()),
            id => (id.to_owned(), cost.frame_ms(software)),
        });
    }
    rows.push(("full chain".to_owned(), full_ms));
    let shares = parts.iter().zip(without);
    rows.extend(shares.map(|(effect, cost)| (within(effect.id()), full_ms - cost.frame_ms(software))));
    let mut noise = Settings::default();
    usual(&mut noise, effects::by_id("paper_noise").unwrap());
    let [(plain, _), (some, some_frame), (every, every_frame)] =
        method_ms(context, [&Settings::default(), &noise, &full(None)], &view, software);
    let methods = [
        ("shutter + blur", plain),
        ("shutter + blur + paper_noise", some),
        ("shutter + blur + full chain", every),
        (RATIO, every / some),
        ("ratio of whole frames (method paper)", every_frame / some_frame),
    ];
    rows.extend(methods.map(|(name, value)| (name.to_owned(), value)));
    rows
}

fn named([w, h]: &[u32; 2]) -> String {
    format!("{w}x{h}")
}

fn write_page(device: &str, clock: &str, sizes: &[[u32; 2]], rows: &[(String, Vec<f64>)]) {
    let (names, middle) = (sizes.iter().map(named).collect::<Vec<_>>(), sizes.len() / 2);
    let mut text = format!("Least of {ROUNDS} frames, ms {clock}.\n\n| | {} |\n|---|", names.join(" | "));
    text += &"---|".repeat(names.len());
    for (name, values) in rows {
        let values: Vec<String> = values.iter().map(|v| format!("{v:.3}")).collect();
        text += &format!("\n| {} | {} |", name.trim(), values.join(" | "));
    }
    let times = rows.iter().filter(|(name, _)| !name.starts_with("ratio"));
    let bars: Vec<_> = times.map(|(name, v)| (name.trim().to_owned(), v[middle])).collect();
    let text = format!("{text}\n\n{}\n\nChart: {}.", in_the_way(rows, sizes), names[middle]);
    measured::write_page("passes", device, &text, (&bars, "ms"));
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let argument = |name: &str| arguments.iter().position(|a| a == name).and_then(|i| arguments.get(i + 1));
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED passes: {error}"),
    };
    let software = context.info().kind == DeviceKind::Cpu;
    let clock = if software { "of the processor" } else { "by timestamps" };
    println!("{}; least of {ROUNDS} frames, ms {clock}", context.info().name);
    let sizes: Vec<[u32; 2]> =
        SIZES.into_iter().filter(|s| argument("--size").is_none_or(|wanted| *wanted == named(s))).collect();
    let mut rows: Vec<(String, Vec<f64>)> = Vec::new();
    for size in &sizes {
        let measured = measure(&context, *size, argument("--only").map(String::as_str), software);
        if rows.is_empty() {
            rows = measured.iter().map(|(name, _)| (name.clone(), Vec::new())).collect();
        }
        rows.iter_mut().zip(measured).for_each(|(row, (_, value))| row.1.push(value));
    }
    let head: String = sizes.iter().map(|s| format!("{:>11}", named(s))).collect();
    println!("{:40}{head}", "");
    for (name, values) in &rows {
        println!("{name:40}{}", values.iter().map(|v| format!("{v:11.3}")).collect::<String>());
    }
    println!("{}", in_the_way(&rows, &sizes));
    if argument("--size").is_none() && argument("--only").is_none() {
        write_page(&context.info().name, clock, &sizes, &rows);
    }
    if let Some(file) = argument("--json") {
        let table: serde_json::Map<_, _> = rows.into_iter().map(|(n, v)| (n, v.into())).collect();
        let sizes: Vec<_> = sizes.iter().map(named).collect();
        let json = serde_json::json!({ "device": context.info().name, "unit": format!("ms \
            {clock}"), "sizes": sizes, "passes": table });
        std::fs::write(file, serde_json::to_string_pretty(&json).unwrap() + "\n").unwrap();
    }
}
