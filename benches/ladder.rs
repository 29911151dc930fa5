//! The ladder of methods: what each costs and what each gets wrong, against many renders with the same samples a pixel.
//!
//! `cargo bench --bench ladder` writes `target/bench/ladder.json`, `ladder.md`, `ladder.png` (reference, method,
//! difference times 8; one row a scene) and `failures.png` (the same of one typical failure a method, enlarged).
//! `LADDER_SCENES`, `LADDER_METHODS` and `LADDER_EFFECTS` (comma-separated) choose, `LADDER_N` is the number of renders
//! of the reference, `LADDER_SCALE` multiplies the picture's 320x240, `LADDER_KEEP` keeps references in
//! `target/bench/references` from run to run, `LADDER_REPEATS` is the number of timed frames.
#![allow(clippy::unwrap_used)]

#[path = "../tests/support/checkers/mod.rs"]
mod checkers;
#[path = "measured/mod.rs"]
mod measured;
#[path = "ladder/picture.rs"]
mod picture;
#[path = "ladder/report.rs"]
mod report;
#[path = "ladder/room.rs"]
mod room;
#[path = "ladder/takes.rs"]
mod takes;

use std::path::PathBuf;
use std::sync::Arc;

use report::Row;
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::chain::Settings;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, ExactOptions, FastOptions, FrameRequest, Method, PaperOptions,
};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::Plane;
use takes::Take;

/// Timed frames a method unless `LADDER_REPEATS` says otherwise; the first is not counted.
const REPEATS: u32 = 13;
/// Half the distance in time over which the reference's derivative is taken, s.
const DERIVATIVE_STEP_S: f64 = 1e-3;

/// Renders of the pictures that this derivative is taken from.
const DERIVATIVE_RENDERS: u32 = 48;

/// Name, and whether there is a shutter and a blur.
const EFFECTS: [(&str, f64, f64); 3] = [("shutter", 1.0, 0.0), ("blur", 0.0, 1.0), ("both", 1.0, 1.0)];

fn list(variable: &str) -> Option<Vec<String>> {
    std::env::var(variable).ok().map(|v| v.split(',').map(str::to_owned).collect())
}

fn number(variable: &str, otherwise: u32) -> u32 {
    std::env::var(variable).ok().and_then(|v| v.parse().ok()).unwrap_or(otherwise)
}

fn accumulation(renders: u32) -> Method {
    Method::Accumulation(AccumulationOptions { renders: Some(renders), ..AccumulationOptions::default() })
}

fn methods() -> Vec<(&'static str, Method)> {
    vec![
        ("paper", Method::Paper(PaperOptions::default())),
        ("fast", Method::Fast(FastOptions::default())),
        ("exact", Method::Exact(ExactOptions::default())),
        ("accumulation_6", accumulation(6)),
        ("accumulation_24", accumulation(24)),
    ]
}

fn output() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/bench")
}

struct Bench {
    context: Arc<Context>,
    scale: u32,
    renders: u32,
}

impl Bench {
    fn intrinsics(&self, take: &Take) -> Intrinsics {
        takes::scaled(take.intrinsics, self.scale)
    }

    fn request(&self, take: &Take, shift_s: f64, effect: (&str, f64, f64)) -> FrameRequest {
        let scan_order = ScanOrder::TopToBottom;
        let intrinsics = self.intrinsics(take);
        let line_count = scan_order.line_count(intrinsics.width, intrinsics.height);
        let start_s = take.start_s + shift_s;
        let (readout_time_s, exposure_time_s) = (effect.1 * take.readout_s, effect.2 * take.exposure_s);
        FrameRequest {
            index: 0,
            shutter: ShutterTiming { start_s, exposure_time_s, readout_time_s, scan_order, line_count },
            frame_interval_s: 1.0 / 30.0,
            seed: 0,
            settings: Settings::default(),
            static_camera: false,
            planes: false,
            statistics: false,
        }
    }

    fn engine(&self, take: &Take, method: &Method, request: &FrameRequest) -> Engine {
        let options = EngineOptions { method: method.clone(), ..EngineOptions::default() };
        let (scene, path) = (take.scene.clone(), take.path.clone());
        Engine::new(&self.context, scene, path, self.intrinsics(take), options, std::slice::from_ref(request))
            .unwrap()
    }

    /// The reference, from the kept ones if wanted.
    fn reference(&self, take: &Take, effect: &str, request: &FrameRequest, renders: u32) -> Plane<u8> {
        let intrinsics = self.intrinsics(take);
        let [w, h] = [intrinsics.width, intrinsics.height];
        let start_us = (request.shutter.start_s * 1e6).round();
        let name = format!("{}_{effect}_{start_us}_{w}_{renders}.raw", take.name);
        let path = output().join("references").join(name);
        let keep = std::env::var_os("LADDER_KEEP").is_some();
        if let Some(data) = keep.then(|| std::fs::read(&path).ok()).flatten() {
            return Plane { width: w as usize, height: h as usize, channels: 3, data };
        }
        let picture = self.engine(take, &accumulation(renders), request).render(request).unwrap().picture;
        if keep {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &picture.data).unwrap();
        }
        picture
    }

    fn row(&self, take: &Take, effect: (&str, f64, f64), methods: &[(&'static str, Method)]) -> Vec<Row> {
        let at = |shift_s: f64| self.request(take, shift_s, effect);
        let request = at(0.0);
        let reference = self.reference(take, effect.0, &request, self.renders);
        let [before, after] = [-DERIVATIVE_STEP_S, DERIVATIVE_STEP_S]
            .map(|s| self.reference(take, effect.0, &at(s), DERIVATIVE_RENDERS));
        let mut rows = Vec::new();
        for (name, method) in methods {
            let mut engine = self.engine(take, method, &request);
            let mut plain = self.engine(take, &accumulation(1), &request);
            let (mut ms, mut plain_ms) = (Vec::new(), Vec::new());
            let (mut cpu_ms, mut plain_cpu_ms) = (0.0, 0.0);
            let (mut passes, mut plain_passes) = (Vec::new(), Vec::new());
            let repeats = number("LADDER_REPEATS", REPEATS).max(2);
            for i in 0..repeats {
                let times = [
                    report::cpu_ms(),
                    {
                        let frame = engine.render(&request).unwrap();
                        ms.push(frame.host_ms);
                        report::keep_least(&mut passes, &frame.times);
                        report::cpu_ms()
                    },
                    {
                        let frame = plain.render(&request).unwrap();
                        plain_ms.push(frame.host_ms);
                        report::keep_least(&mut plain_passes, &frame.times);
                        report::cpu_ms()
                    },
                ];
                if i > 0 {
                    cpu_ms += (times[1] - times[0]) / f64::from(repeats - 1);
                    plain_cpu_ms += (times[2] - times[1]) / f64::from(repeats - 1);
                }
            }
            let frame = engine.render(&FrameRequest { statistics: true, ..request.clone() }).unwrap();
            let worst = report::worst_line_time_us(
                (&frame.picture, &reference),
                (&before, &after),
                DERIVATIVE_STEP_S,
            );
            let gathers = !matches!(method, Method::Accumulation(_));
            let row = Row {
                scene: format!("{}_{}", take.name, effect.0),
                family: take.family,
                method: (*name).to_owned(),
                rmse: shutterbug::plane::metrics::rmse(&frame.picture, &reference),
                psnr_db: shutterbug::plane::metrics::psnr_db(&frame.picture, &reference).min(99.0),
                worst_line_time_us: worst,
                invalid_share: frame.statistics.filter(|_| gathers).map_or(0.0, |s| s.invalid_share),
                ms_median: report::median(&mut ms[1..]),
                plain_render_ms_median: report::median(&mut plain_ms[1..]),
                cpu_ms,
                plain_cpu_ms,
                post_ms: report::post_ms(&passes),
                picture: frame.picture,
                reference: reference.clone(),
            };
            println!("{row} {}; plain: {}", report::passes(&passes), report::passes(&plain_passes));
            rows.push(row);
        }
        rows
    }
}

fn main() {
    // `cargo bench` and `cargo test --benches` pass flags of the harness that this bench does not have.
    if std::env::args().any(|a| a == "--test" || a == "--list") {
        return;
    }
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED ladder: {error}"),
    };
    let bench = Bench {
        context: context.clone(),
        scale: number("LADDER_SCALE", 1),
        renders: number("LADDER_N", 512),
    };
    let (only_scenes, only_methods) = (list("LADDER_SCENES"), list("LADDER_METHODS"));
    let only_effects = list("LADDER_EFFECTS");
    let chosen = |only: &Option<Vec<String>>, name: &str| {
        only.as_ref().is_none_or(|names| names.iter().any(|n| n == name))
    };
    let methods: Vec<_> = methods().into_iter().filter(|(name, _)| chosen(&only_methods, name)).collect();
    let mut rows = Vec::new();
    for take in takes::all().iter().filter(|t| chosen(&only_scenes, &t.name)) {
        for effect in EFFECTS.into_iter().filter(|(name, ..)| chosen(&only_effects, name)) {
            rows.extend(bench.row(take, effect, &methods));
        }
    }
    let text = report::write(&output(), &rows, &context.info().name, bench.renders);
    let is_whole = ["LADDER_SCALE", "LADDER_N", "LADDER_SCENES", "LADDER_METHODS", "LADDER_EFFECTS"]
        .iter()
        .all(|option| std::env::var_os(option).is_none());
    if is_whole {
        let shown = rows.iter().filter(|r| r.method != "accumulation");
        let ratio =
            |r: &report::Row| (format!("{}, {}", r.scene, r.method), r.ms_median / r.plain_render_ms_median);
        let bars: Vec<_> = shown.map(ratio).collect();
        let text = format!("{text}\nChart: time over that of one plain render of equal samples.");
        measured::write_page("ladder", &context.info().name, &text, (&bars, "times"));
    }
}
