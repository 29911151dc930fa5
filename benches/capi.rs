//! What the C ABI costs over the engine's own time, and what frames in flight gain: outside frames of 640x480, RGBA8 colour
//! and RG32F motion. One JSON line a row. `cargo bench --bench capi [-- ROUNDS]` (300).
//!
//! Each round runs the engine alone, the same through C, and, as a control, through C with a twentieth of the engine's
//! processor time burnt beside it, in an order that changes from round to round. Reported is the median of the rounds'
//! differences with its 95 % confidence interval (order statistics: nothing is assumed of the noise), by wall time, by the
//! process's processor time and by that of the calling thread. The control tells how small a cost would be seen.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../tests/capi_support/mod.rs"]
mod capi_support;

use std::collections::VecDeque;
use std::ptr::null_mut;
use std::time::{Duration, Instant};

use capi_support::{camera, create, image, must, options, outside, sized};
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::capi::*;
use shutterbug::engine::{
    FrameRequest, OutsideEngine, OutsideFrame, OutsideMotion, OutsidePixels, PixelSource,
};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice};
use shutterbug::plane::PixelFormat;

const W: usize = 640;
const H: usize = 480;
const WARM: usize = 5;
const ROUNDS: usize = 300;
/// Frames a round of each number in flight.
const BURST: usize = 12;

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// Median, and the 95 % confidence interval of it.
fn median(values: Vec<f64>) -> [f64; 3] {
    let values = sorted(values);
    let n = values.len() as f64;
    let at = |rank: f64| values[(rank.max(0.0) as usize).min(values.len() - 1)];
    [at(0.5 * n), at((0.5 * n - 0.98 * n.sqrt()).floor()), at((0.5 * n + 0.98 * n.sqrt()).ceil())]
}

/// Processor time of a task's `schedstat`, ms.
fn busy_ms(path: &str) -> f64 {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
}

/// Wall time, processor time of all threads, processor time of this thread, ms.
#[derive(Clone, Copy)]
struct Clocks([f64; 3]);

impl Clocks {
    fn now(start: Instant) -> Self {
        let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
        let all = tasks.map(|t| busy_ms(&format!("{}/schedstat", t.path().display()))).sum();
        Self([ms(start), all, busy_ms("/proc/thread-self/schedstat")])
    }

    fn since(self, before: Self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[i] - before.0[i])
    }
}

fn ms(from: Instant) -> f64 {
    from.elapsed().as_secs_f64() * 1e3
}

/// Burns so much processor time.
fn burn(ms: f64) {
    let end = busy_ms("/proc/thread-self/schedstat") + ms;
    while busy_ms("/proc/thread-self/schedstat") < end {
        std::hint::black_box((0..20_000u64).fold(0, |a, b| a ^ b.wrapping_mul(a | 1)));
    }
}

struct Pictures {
    color: Vec<u8>,
    motion: Vec<f32>,
}

impl Pictures {
    fn new() -> Self {
        let color = (0..W * H * 4).map(|i| ((i * 7919) >> 5) as u8).collect();
        Self { color, motion: (0..W * H).flat_map(|_| [24.0, -6.0]).collect() }
    }
}

/// The engine alone: submit and collect.
struct Own(OutsideEngine);

impl Own {
    fn new() -> Self {
        let device = DeviceChoice::from_option_or_environment(None);
        let context = Context::new(&ContextOptions { device, ..Default::default() }).unwrap();
        let half = W as f64 / 2.0;
        let k = Intrinsics {
            width: W as u32,
            height: H as u32,
            fx: half,
            fy: half,
            cx: half,
            cy: H as f64 / 2.0,
        };
        Self(OutsideEngine::new(&context, k, 3, Duration::from_secs(60)).unwrap())
    }

    fn frame(&mut self, p: &Pictures, index: u32) {
        let pixels = |format: PixelFormat, bytes| OutsidePixels {
            format,
            stride_bytes: W * format.bytes(),
            source: PixelSource::Host(bytes),
        };
        let shutter = ShutterTiming {
            start_s: 0.0,
            exposure_time_s: 0.008,
            readout_time_s: 0.02,
            scan_order: ScanOrder::TopToBottom,
            line_count: H as u32,
        };
        let request = FrameRequest {
            index,
            shutter,
            frame_interval_s: 0.04,
            seed: 0,
            settings: Default::default(),
            static_camera: false,
            planes: false,
            statistics: false,
        };
        let motion = OutsideMotion::Images {
            images: vec![pixels(PixelFormat::Rg32f, bytemuck::cast_slice(&p.motion))],
            scale: [1.0; 2],
            first_time_s: 0.0,
            step_s: 0.0,
        };
        let ticket = self.0.submit(&OutsideFrame {
            request,
            color: pixels(PixelFormat::Rgba8, &p.color),
            encoding: Default::default(),
            color_time_s: 0.014,
            margin_px: [0, 0],
            motion,
            max_samples: 240,
            delivery: Default::default(),
        });
        let frame = self.0.collect(ticket.unwrap()).unwrap();
        assert_eq!(frame.picture.width, W);
    }
}

/// The same through the C ABI.
struct ThroughC {
    engine: Handle,
    images: Box<[shutterbug_image; 2]>,
    convention: Box<shutterbug_motion_convention>,
    out: Vec<u8>,
}

impl ThroughC {
    fn new(p: &mut Pictures, in_flight: u32) -> Self {
        let mut o = options(2, 0);
        o.frames_in_flight = in_flight;
        let engine = create(o).unwrap();
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(W as u32, H as u32)) }, engine);
        let images = Box::new([
            image(PixelFormat::Rgba8, W, H, &mut p.color),
            image(PixelFormat::Rg32f, W, H, bytemuck::cast_slice_mut(&mut p.motion)),
        ]);
        let mut convention = Box::new(sized::<shutterbug_motion_convention>());
        must(unsafe { shutterbug_motion_preset(0, &mut *convention) }, null_mut());
        Self { engine, images, convention, out: vec![0; W * H * 3] }
    }

    fn submit(&self, index: u32) -> Handle {
        let mut o = outside();
        (o.frame_index, o.color_time_s, o.motion_count) = (index, 0.014, 1);
        (o.color, o.motions, o.motion_convention) = (&self.images[0], &self.images[1], &*self.convention);
        let mut frame = null_mut();
        must(unsafe { shutterbug_engine_submit_outside(self.engine, &o, &mut frame) }, self.engine);
        frame
    }

    fn collect(&mut self, frame: Handle) {
        must(shutterbug_frame_wait(frame, -1.0), frame);
        let to = image(PixelFormat::Rgb8, W, H, &mut self.out);
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        must(shutterbug_frame_destroy(frame), null_mut());
    }
}

impl Drop for ThroughC {
    fn drop(&mut self) {
        shutterbug_engine_destroy(self.engine);
    }
}

fn device_of(engine: Handle) -> String {
    let name = capi_support::info(engine).device_name;
    name.iter().take_while(|b| **b != 0).map(|b| *b as u8 as char).collect()
}

/// The three arms, round by round.
fn overhead(p: &mut Pictures, rounds: usize) {
    let (mut own, mut c) = (Own::new(), ThroughC::new(p, 1));
    let start = Instant::now();
    let mut taken: [Vec<[f64; 3]>; 3] = Default::default();
    let mut twentieth_ms = 0.0;
    for i in 0..WARM + rounds {
        for k in 0..3 {
            let arm = (i + k) % 3;
            let before = Clocks::now(start);
            if arm == 0 {
                own.frame(p, i as u32);
            } else {
                let frame = c.submit(i as u32);
                c.collect(frame);
            }
            if arm == 2 {
                burn(twentieth_ms);
            }
            let spent = Clocks::now(start).since(before);
            if i >= WARM {
                taken[arm].push(spent);
            } else if arm == 0 {
                twentieth_ms = 0.05 * spent[1];
            }
        }
    }
    let device = device_of(c.engine);
    for (clock, name) in ["wall", "process", "thread"].into_iter().enumerate() {
        let of = |arm: usize| taken[arm].iter().map(|t| t[clock]).collect::<Vec<_>>();
        let more = |arm: usize| of(arm).iter().zip(of(0)).map(|(a, b)| a - b).collect::<Vec<_>>();
        // Of the engine's time by that clock; the calling thread's own is next to nothing, so it counts against wall time.
        let base = median(taken[0].iter().map(|t| t[if clock == 2 { 0 } else { clock }]).collect())[0];
        let share = |arm: usize| median(more(arm)).map(|m| (1e4 * m / base).round() / 1e4);
        let row = serde_json::json!({
            "what": "overhead", "clock": name, "device": device, "size": [W, H], "rounds": rounds,
            "engine_ms": median(of(0)), "c_ms": median(of(1)), "overhead": share(1),
            "control_overhead": share(2), "control_added": (1e4 * twentieth_ms / base).round() / 1e4,
        });
        println!("{row}");
    }
}

/// So many frames with `in_flight` of them on their way; latency of each, and frames a second.
fn burst(c: &mut ThroughC, in_flight: usize, latency: &mut Vec<f64>) -> f64 {
    let mut waiting = VecDeque::new();
    let mut take = |c: &mut ThroughC, (at, frame): (Instant, Handle)| {
        c.collect(frame);
        latency.push(ms(at));
    };
    let start = Instant::now();
    for i in 0..BURST {
        if waiting.len() == in_flight {
            take(c, waiting.pop_front().unwrap());
        }
        waiting.push_back((Instant::now(), c.submit(i as u32)));
    }
    waiting.into_iter().for_each(|w| take(c, w));
    BURST as f64 / start.elapsed().as_secs_f64()
}

/// In turn, so that a busy machine slows all alike.
fn in_flight(p: &mut Pictures, rounds: usize) {
    let mut engines: Vec<_> = (1..=3).map(|n| ThroughC::new(p, n)).collect();
    let mut taken: [(Vec<f64>, Vec<f64>); 3] = Default::default();
    for round in 0..=rounds {
        for (n, c) in engines.iter_mut().enumerate() {
            let (latency, per_s) = &mut taken[n];
            let rate = burst(c, n + 1, latency);
            if round == 0 {
                latency.clear();
            } else {
                per_s.push(rate);
            }
        }
    }
    let device = device_of(engines[0].engine);
    let one = taken[0].1.clone();
    for (n, (latency, per_s)) in taken.into_iter().enumerate() {
        let against = per_s.iter().zip(&one).map(|(a, b)| a / b).collect();
        let row = serde_json::json!({
            "what": "in flight", "device": device, "size": [W, H], "frames_in_flight": n + 1,
            "latency_ms": median(latency), "frames_per_s": median(per_s), "rate_against_one": median(against),
        });
        println!("{row}");
    }
}

fn main() {
    let rounds = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(ROUNDS);
    let mut p = Pictures::new();
    overhead(&mut p, rounds);
    in_flight(&mut p, rounds.div_ceil(BURST));
}
