//! What the C ABI costs over the engine's own time, and what frames in flight gain: outside frames of 640x480, RGBA8 colour
//! and RG32F motion. One JSON line a row. `cargo bench --bench capi` (or `cargo run --release --bench capi`).
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
const FRAMES: usize = 60;

fn median(mut ms: Vec<f64>) -> (f64, f64, f64) {
    ms.sort_by(f64::total_cmp);
    (ms[ms.len() / 2], ms[ms.len() / 10], ms[ms.len() * 9 / 10])
}

/// Processor time of this thread so far, ms: what the calls themselves cost, however busy the machine is.
fn thread_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-6
}

fn ms(from: Instant) -> f64 {
    from.elapsed().as_secs_f64() * 1e3
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

    fn frame(&mut self, p: &Pictures, index: u32) -> f64 {
        let start = Instant::now();
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
        ms(start)
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

fn main() {
    let mut p = Pictures::new();
    let (mut own, mut c) = (Own::new(), ThroughC::new(&mut p, 1));
    let (mut a, mut b, mut calls) = (Vec::new(), Vec::new(), Vec::new());
    // In turn, so that a busy machine slows both alike.
    for i in 0..WARM + FRAMES {
        let before = thread_ms();
        let alone = own.frame(&p, i as u32);
        let between = thread_ms();
        let start = Instant::now();
        let frame = c.submit(i as u32);
        c.collect(frame);
        let through_c = ms(start);
        if i >= WARM {
            a.push(alone);
            b.push(through_c);
            calls.push((thread_ms() - between) - (between - before));
        }
    }
    let info = capi_support::info(c.engine);
    let name: String = info.device_name.iter().take_while(|b| **b != 0).map(|b| *b as u8 as char).collect();
    let pairs = a.iter().zip(&b).map(|(a, b)| b / a - 1.0).collect();
    let (own_ms, c_ms, more_ms) = (median(a), median(b), median(calls));
    let row = serde_json::json!({
        "what": "overhead", "device": name, "size": [W, H], "engine_ms": own_ms, "c_ms": c_ms,
        "overhead_of_pairs": median(pairs), "more_thread_ms": more_ms, "overhead_of_thread": more_ms.0 / own_ms.0,
    });
    println!("{row}");
    drop((own, c));
    for in_flight in 1..=3u32 {
        let mut c = ThroughC::new(&mut p, in_flight);
        let (mut waiting, mut latency) = (VecDeque::new(), Vec::new());
        let mut start = Instant::now();
        for i in 0..WARM + FRAMES {
            if i == WARM {
                start = Instant::now();
            }
            if waiting.len() == in_flight as usize {
                let (at, frame): (Instant, Handle) = waiting.pop_front().unwrap();
                c.collect(frame);
                latency.push(ms(at));
            }
            waiting.push_back((Instant::now(), c.submit(i as u32)));
        }
        let per_s = FRAMES as f64 / start.elapsed().as_secs_f64();
        while let Some((_, frame)) = waiting.pop_front() {
            c.collect(frame);
        }
        let row = serde_json::json!({
            "what": "in flight", "device": name, "size": [W, H], "frames_in_flight": in_flight,
            "latency_ms": median(latency), "frames_per_s": per_s,
        });
        println!("{row}");
    }
}
