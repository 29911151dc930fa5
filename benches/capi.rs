//! What the C ABI costs over the engine's own time, and what frames in flight gain: outside frames of 640x480, RGBA8
//! colour and RG32F motion. One JSON line a row. `cargo bench --bench capi [-- ROUNDS [overhead | flight]]` (300). On a
//! software device the driver's threads are most of the noise: `LP_NUM_THREADS=1` leaves one of them, and then "wall
//! less waiting" is what the wall time of a frame would be on a machine with nothing else to do: its threads work one
//! after the other, so whatever one of them waits for a processor is waited for by the frame.
//!
//! Each round runs the engine alone, the same through C, a second engine alone, and through C with a twentieth of the
//! engine's processor time burnt beside it, in an order that changes from round to round (every place, and there and
//! back). Reported is the median of the rounds' differences from the first with its 95 % confidence interval (order
//! statistics: nothing is assumed of the noise), by wall time, by the process's processor time and by that of the
//! calling thread. The second engine tells what two equal things differ by, the burnt time how small a cost would be
//! seen. "copy out" is the one thing of size that the C ABI adds: the delivered picture, from the library's memory to
//! the caller's.
//!
//! "in flight" comes twice: as above, and with `jpeg`, whose work is the host's, so that there is something to overlap.
//! `bound` is what overlapping all of the host's work with all of the device's would bring.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../tests/support/capi/mod.rs"]
mod capi_support;

use std::collections::VecDeque;
use std::ptr::null_mut;
use std::time::{Duration, Instant};

use capi_support::{create, image, must, options, outside, sized, text};
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::capi::*;
use shutterbug::engine::{
    FrameRequest, OutsideEngine, OutsideFrame, OutsideMotion, OutsidePixels, PixelSource,
};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice};
use shutterbug::plane::PixelFormat;

const W: usize = 640;
const H: usize = 480;
const CAMERA: &str = "width = 640\nheight = 480\nfx = 320\nfy = 320\ncx = 320\ncy = 240\nframe_period_s = 0.04\n\
                      [rolling_shutter]\nreadout_time_s = 0.02\n[motion_blur]\nexposure_time_s = 0.008\n";
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

/// A task's processor time, and the time for which it could have run and had no processor (`schedstat`), ms.
fn scheduled_ms(path: &str) -> [f64; 2] {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut numbers = text.split_whitespace().map(|ns| ns.parse::<f64>().unwrap_or(0.0) * 1e-6);
    [(); 2].map(|()| numbers.next().unwrap_or(0.0))
}

fn busy_ms(path: &str) -> f64 {
    scheduled_ms(path)[0]
}

/// Wall time, wall time less what all threads waited for a processor, processor time of all threads and of this one,
/// ms.
#[derive(Clone, Copy)]
struct Clocks([f64; 4]);

const CLOCKS: [&str; 4] = ["wall", "wall less waiting", "process", "thread"];

impl Clocks {
    fn now(start: Instant) -> Self {
        let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
        let tasks = tasks.map(|t| scheduled_ms(&format!("{}/schedstat", t.path().display())));
        let [all, waited] = tasks.fold([0.0; 2], |sum, task| [sum[0] + task[0], sum[1] + task[1]]);
        let wall = ms(start);
        Self([wall, wall - waited, all, busy_ms("/proc/thread-self/schedstat")])
    }

    fn since(self, before: Self) -> [f64; 4] {
        [0, 1, 2, 3].map(|i| self.0[i] - before.0[i])
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
        Self(OutsideEngine::new(&context, k, 1, Duration::from_secs(60)).unwrap())
    }

    fn frame(&mut self, p: &Pictures, index: u32) {
        let pixels = |format: PixelFormat, bytes| OutsidePixels {
            format,
            bottom_up: false,
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
    fn new(p: &mut Pictures, in_flight: u32, effects: &str) -> Self {
        let mut o = options(2, 0);
        o.frames_in_flight = in_flight;
        let engine = create(o).unwrap();
        let camera = text(&format!("{CAMERA}{effects}"));
        must(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine);
        let images = Box::new([
            image(PixelFormat::Rgba8, W, H, &mut p.color),
            image(PixelFormat::Rg32f, W, H, bytemuck::cast_slice_mut(&mut p.motion)),
        ]);
        let mut convention = Box::new(sized::<shutterbug_motion_convention>());
        must(unsafe { shutterbug_motion_preset(0, &mut *convention, null_mut(), 0) }, null_mut());
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

    /// Returns how long the copy took, ms.
    fn collect(&mut self, frame: Handle) -> f64 {
        must(shutterbug_frame_wait(frame, -1.0), frame);
        let to = image(PixelFormat::Rgb8, W, H, &mut self.out);
        let start = Instant::now();
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        let copied = ms(start);
        must(shutterbug_frame_destroy(frame), null_mut());
        copied
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

/// What a round runs.
const ARMS: [&str; 4] = ["engine", "through C", "engine again", "through C and more"];

/// The arms, round by round: what each took by each clock; the copies out; the time that the last arm burns, ms.
fn rounds(p: &mut Pictures, count: usize) -> ([Vec<[f64; 4]>; 4], Vec<f64>, f64) {
    let (mut own, mut again, mut c) = (Own::new(), Own::new(), ThroughC::new(p, 1, ""));
    let start = Instant::now();
    let mut taken: [Vec<[f64; 4]>; 4] = Default::default();
    let (mut copies, mut twentieth_ms) = (Vec::new(), 0.0);
    for i in 0..WARM + count {
        for k in 0..ARMS.len() {
            let place = (i + k) % ARMS.len();
            let arm = if (i / ARMS.len()).is_multiple_of(2) { place } else { ARMS.len() - 1 - place };
            let before = Clocks::now(start);
            match arm {
                0 => own.frame(p, i as u32),
                2 => again.frame(p, i as u32),
                _ => {
                    let frame = c.submit(i as u32);
                    copies.push(c.collect(frame));
                }
            }
            if arm == 3 {
                burn(twentieth_ms);
            }
            let spent = Clocks::now(start).since(before);
            if i >= WARM {
                taken[arm].push(spent);
            } else if arm == 0 {
                twentieth_ms = 0.05 * spent[2];
            }
        }
    }
    (taken, copies, twentieth_ms)
}

/// What the C ABI costs.
fn overhead(p: &mut Pictures, count: usize) {
    let device = device_of(ThroughC::new(p, 1, "").engine);
    let (taken, copies, twentieth_ms) = rounds(p, count);
    for (clock, name) in CLOCKS.into_iter().enumerate() {
        let of = |arm: usize| taken[arm].iter().map(|t| t[clock]).collect::<Vec<_>>();
        let more = |arm: usize| of(arm).iter().zip(of(0)).map(|(a, b)| a - b).collect::<Vec<_>>();
        // Of the engine's time by that clock; the calling thread's own is next to nothing, so it counts against wall
        // time.
        let base = median(taken[0].iter().map(|t| t[if clock == 3 { 0 } else { clock }]).collect())[0];
        let share = |arm: usize| median(more(arm)).map(|m| (1e4 * m / base).round() / 1e4);
        let row = serde_json::json!({
            "what": "overhead", "clock": name, "device": device, "size": [W, H], "rounds": count,
            "engine_ms": median(of(0)), "c_ms": median(of(1)), "overhead": share(1), "engine_again": share(2),
            "control_overhead": share(3), "control_added": (1e4 * twentieth_ms / base).round() / 1e4,
        });
        println!("{row}");
    }
    let row = serde_json::json!({ "what": "copy out", "bytes": W * H * 3, "ms": median(copies) });
    println!("{row}");
}

/// What bursts of frames took.
#[derive(Default)]
struct Bursts {
    latency_ms: Vec<f64>,
    per_s: Vec<f64>,
    /// Processor time of the calling thread a frame.
    host_ms: Vec<f64>,
}

/// So many frames with `in_flight` of them on their way.
fn burst(c: &mut ThroughC, in_flight: usize, taken: &mut Bursts) {
    let mut waiting = VecDeque::new();
    let latency_ms = &mut taken.latency_ms;
    let mut take = |c: &mut ThroughC, (at, frame): (Instant, Handle)| {
        c.collect(frame);
        latency_ms.push(ms(at));
    };
    let (start, busy) = (Instant::now(), busy_ms("/proc/thread-self/schedstat"));
    for i in 0..BURST {
        if waiting.len() == in_flight {
            take(c, waiting.pop_front().unwrap());
        }
        waiting.push_back((Instant::now(), c.submit(i as u32)));
    }
    waiting.into_iter().for_each(|w| take(c, w));
    taken.host_ms.push((busy_ms("/proc/thread-self/schedstat") - busy) / BURST as f64);
    taken.per_s.push(BURST as f64 / start.elapsed().as_secs_f64());
}

/// In turn, so that a busy machine slows all alike.
fn in_flight(p: &mut Pictures, rounds: usize, effects: &str) {
    let mut engines: Vec<_> = (1..=3).map(|n| ThroughC::new(p, n, effects)).collect();
    let mut taken: [Bursts; 3] = Default::default();
    for round in 0..=rounds {
        for (n, c) in engines.iter_mut().enumerate() {
            burst(c, n + 1, &mut taken[n]);
            if round == 0 {
                taken[n] = Bursts::default();
            }
        }
    }
    let device = device_of(engines[0].engine);
    let one = taken[0].per_s.clone();
    let (frame_ms, host_ms) = (1e3 / median(one.clone())[0], median(taken[0].host_ms.clone())[0]);
    let bound = frame_ms / host_ms.max(frame_ms - host_ms);
    for (n, bursts) in taken.into_iter().enumerate() {
        let against = bursts.per_s.iter().zip(&one).map(|(a, b)| a / b).collect();
        let row = serde_json::json!({
            "what": "in flight", "effects": effects, "device": device, "size": [W, H], "frames_in_flight": n + 1,
            "latency_ms": median(bursts.latency_ms), "frames_per_s": median(bursts.per_s),
            "host_ms": median(bursts.host_ms), "rate_against_one": median(against),
            "bound": (1e3 * bound).round() / 1e3,
        });
        println!("{row}");
    }
}

fn main() {
    let rounds = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(ROUNDS);
    let only = std::env::args().skip(1).find(|a| ["overhead", "flight"].contains(&a.as_str()));
    let mut p = Pictures::new();
    if only.as_deref() != Some("flight") {
        overhead(&mut p, rounds);
    }
    if only.as_deref() == Some("overhead") {
        return;
    }
    for effects in ["", "[jpeg]\nquality = 90\n"] {
        in_flight(&mut p, rounds.div_ceil(BURST), effects);
    }
}
