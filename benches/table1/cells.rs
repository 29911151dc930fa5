//! One cell of the table: a method with so many samples of time, at one size, over many frames.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use shutterbug::camera::Intrinsics;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, Frame, FrameRequest, Gather, Method, PaperOptions,
};
use shutterbug::error::Result;
use shutterbug::gpu::{Context, PassTime};
use shutterbug::plane::metrics::psnr_db;

use super::raster16::{self, Way, World};

/// Rows of the paper's table.
pub const METHODS: [&str; 3] = ["accumulation", "velocity", "generic"];
/// Its columns.
pub const SAMPLES: [u32; 4] = [1, 6, 24, 240];
/// Sizes of the picture, px.
pub const SIZES: [[u32; 2]; 3] = [[320, 240], [640, 480], [1280, 720]];
/// Samples for smooth edges, as in the paper.
const AA_SAMPLES: u32 = 16;
/// Focal length over width: the same field of view at every size.
const FOCAL_OVER_WIDTH: f64 = 0.8;
/// Frames measured at most, at least.
const FRAMES: (usize, usize) = (48, 2);
/// A frame that takes longer, s, is measured once.
const LONG_S: f64 = 4.0;
/// Renders of the picture that others are compared with.
const TRUTH: u32 = 64;
/// A frame may take this long.
const LIMIT: Duration = Duration::from_secs(600);
/// By how much device and host may disagree: a share, and what a submission takes on its own, ms.
const CLOCKS: (f64, f64) = (0.2, 1.0);

/// What was measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Cell {
    pub method: String,
    pub samples: u32,
    pub aa_samples: u32,
    pub width: u32,
    pub height: u32,
    /// All passes by timestamp queries.
    pub ms_median: f64,
    pub ms_p95: f64,
    /// From asking for the frame to having it in memory, by the host's clock.
    pub host_ms_median: f64,
    pub host_ms_p95: f64,
    /// From the return of the submission to the end of the wait: what the device's time is checked against.
    pub wait_ms_median: f64,
    /// CPU time of all threads of this process a frame; less at the mercy of other programs than the others.
    pub cpu_ms_mean: f64,
    /// Renders a pixel (accumulation), or reads of the blur a pixel.
    pub taps_mean: f64,
    /// Against accumulation with 64 renders: only where there is one.
    pub psnr_db: Option<f64>,
    pub frames: usize,
    pub margin_px: [u32; 2],
    pub passes: Vec<Pass>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pass {
    pub name: String,
    pub ms_median: f64,
}

impl Cell {
    /// Whether device and host tell the same.
    pub fn clocks_agree(&self) -> bool {
        (self.ms_median - self.wait_ms_median).abs() <= CLOCKS.0 * self.wait_ms_median + CLOCKS.1
    }
}

/// Scene, path and device.
pub struct Bench {
    context: Arc<Context>,
    capture: Capture,
    /// About how long one cell is measured, s.
    budget_s: f64,
}

impl Bench {
    pub fn new(context: &Arc<Context>, capture: Capture, budget_s: f64) -> Self {
        Self { context: context.clone(), capture, budget_s }
    }

    /// The device.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn intrinsics([width, height]: [u32; 2]) -> Intrinsics {
        let f = FOCAL_OVER_WIDTH * f64::from(width);
        Intrinsics { width, height, fx: f, fy: f, cx: 0.5 * f64::from(width), cy: 0.5 * f64::from(height) }
    }

    /// The frame as the method takes it. The paper's accumulation and velocity buffer know motion blur only; the
    /// generic model adds rolling shutter and noise.
    fn request(&self, method: &str, size: [u32; 2], index: usize) -> FrameRequest {
        let mut shutter = self.capture.shutter(index % self.capture.frames.len());
        shutter.line_count = shutter.scan_order.line_count(size[0], size[1]);
        let generic = method == "generic";
        if !generic {
            shutter.readout_time_s = 0.0;
        }
        FrameRequest {
            index: index as u32,
            shutter,
            frame_interval_s: self.capture.camera.frame_period_s,
            seed: 1,
            settings: if generic { self.capture.camera.settings.clone() } else { Settings::default() },
            static_camera: false,
            planes: false,
            statistics: false,
        }
    }

    fn engine(&self, method: &str, samples: u32, size: [u32; 2]) -> Result<Engine> {
        self.engine_with((method, samples, AA_SAMPLES), size, 1)
    }

    fn engine_with(
        &self,
        (method, samples, aa_samples): (&str, u32, u32),
        size: [u32; 2],
        frames_in_flight: u32,
    ) -> Result<Engine> {
        let options = EngineOptions {
            method: match method {
                "accumulation" => Method::Accumulation(AccumulationOptions {
                    renders: Some(samples),
                    ..AccumulationOptions::default()
                }),
                _ => Method::Paper(PaperOptions {
                    max_samples: samples,
                    gather: Gather::Bilinear,
                    ..PaperOptions::default()
                }),
            },
            samples: aa_samples,
            frames_in_flight,
            planes: false,
            time_limit: LIMIT,
        };
        let expected: Vec<_> =
            (0..self.capture.frames.len()).map(|i| self.request(method, size, i)).collect();
        let (scene, path) = (Arc::new(self.capture.scene.clone()), Arc::new(self.capture.trajectory.clone()));
        Engine::new(&self.context, scene, path, Self::intrinsics(size), options, &expected)
    }

    /// Measures one cell.
    pub fn cell(&self, method: &'static str, samples: u32, size: [u32; 2]) -> Result<Cell> {
        let mut engine = self.engine(method, samples, size)?;
        // Pipelines are compiled when they are first used; hundreds of renders a frame are a mean of their own beside
        // that.
        let (mut cpu, first) = (cpu_ms(), Instant::now());
        let mut runs = vec![Run::of(&mut engine, &self.request(method, size, 0))?];
        let first_s = first.elapsed().as_secs_f64();
        if first_s < LONG_S {
            if first_s < 0.5 * LONG_S {
                engine.render(&self.request(method, size, 1))?;
            }
            let frames = ((self.budget_s / first_s.max(1e-4)) as usize).clamp(FRAMES.1, FRAMES.0);
            runs.clear();
            cpu = cpu_ms();
            for i in 0..frames {
                runs.push(Run::of(&mut engine, &self.request(method, size, i))?);
            }
        }
        let frames = runs.len();
        let cpu_ms_mean = (cpu_ms() - cpu) / frames as f64;
        let asked = FrameRequest { statistics: true, ..self.request(method, size, 3) };
        let taps = match method {
            "accumulation" => f64::from(samples),
            _ => engine.render(&asked)?.statistics.map_or(0.0, |s| s.taps_mean),
        };
        let sorted = |f: fn(&Run) -> f64| {
            let mut values: Vec<f64> = runs.iter().map(f).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (device, host, wait) = (sorted(|r| r.device_ms), sorted(|r| r.host_ms), sorted(|r| r.wait_ms));
        Ok(Cell {
            method: method.to_owned(),
            samples,
            aa_samples: AA_SAMPLES,
            width: size[0],
            height: size[1],
            ms_median: quantile(&device, 0.5),
            ms_p95: quantile(&device, 0.95),
            host_ms_median: quantile(&host, 0.5),
            host_ms_p95: quantile(&host, 0.95),
            wait_ms_median: quantile(&wait, 0.5),
            cpu_ms_mean,
            taps_mean: taps,
            psnr_db: self.quality_of(method, samples, size)?,
            frames,
            margin_px: engine.margin_px(),
            passes: passes(&runs),
        })
    }

    /// Where it is worth its time: small pictures, the largest count.
    fn quality_of(&self, method: &'static str, samples: u32, size: [u32; 2]) -> Result<Option<f64>> {
        let wanted = method != "accumulation" && samples == 240 && size == SIZES[0];
        wanted.then(|| self.quality(method, samples, size)).transpose()
    }

    /// How close the velocity buffer and the generic model come to many renders of the same shutter (no noise), dB.
    pub fn quality(&self, method: &'static str, samples: u32, size: [u32; 2]) -> Result<f64> {
        let request = FrameRequest { settings: Settings::default(), ..self.request(method, size, 11) };
        let picture = |mut engine: Engine| -> Result<Frame> { engine.render(&request) };
        let got = picture(self.engine(method, samples, size)?)?;
        let truth = picture(self.engine("accumulation", TRUTH, size)?)?;
        Ok(psnr_db(&got.picture, &truth.picture))
    }

    /// Frames a second of the generic model at 240 samples with so many in flight.
    pub fn throughput(&self, size: [u32; 2], in_flight: u32) -> Result<f64> {
        let mut engine = self.engine_with(("generic", 240, AA_SAMPLES), size, in_flight)?;
        engine.render(&self.request("generic", size, 0))?;
        let start = Instant::now();
        let mut tickets = std::collections::VecDeque::new();
        let mut done = 0;
        let mut asked = 0;
        while done < asked || start.elapsed().as_secs_f64() < self.budget_s {
            while tickets.len() < in_flight as usize && start.elapsed().as_secs_f64() < self.budget_s {
                tickets.push_back(engine.submit(&self.request("generic", size, asked))?);
                asked += 1;
            }
            let Some(ticket) = tickets.pop_front() else { break };
            engine.collect(ticket)?;
            done += 1;
        }
        Ok(done as f64 / start.elapsed().as_secs_f64())
    }

    /// 16 samples in one pass against four passes of four.
    pub fn raster_16(&self, size: [u32; 2]) -> Result<Vec<Way>> {
        let (context, intrinsics) = (&self.context, Self::intrinsics(size));
        let (scene, path) = (&self.capture.scene, &self.capture.trajectory);
        raster16::measure(&World { context, scene, path, intrinsics })
    }
}

struct Run {
    device_ms: f64,
    host_ms: f64,
    wait_ms: f64,
    times: Vec<PassTime>,
}

impl Run {
    fn of(engine: &mut Engine, request: &FrameRequest) -> Result<Self> {
        let asked = Instant::now();
        let ticket = engine.submit(request)?;
        let submitted = Instant::now();
        engine.wait(&ticket, LIMIT)?;
        let wait_ms = submitted.elapsed().as_secs_f64() * 1e3;
        let frame = engine.collect(ticket)?;
        let host_ms = asked.elapsed().as_secs_f64() * 1e3;
        let device_ms = frame.times.iter().map(|t| t.ms).sum();
        // Several submissions: all but the last are waited for inside `submit`.
        let wait_ms = if device_ms > 1.5 * wait_ms { host_ms } else { wait_ms };
        Ok(Self { device_ms, host_ms, wait_ms, times: frame.times })
    }
}

fn passes(runs: &[Run]) -> Vec<Pass> {
    let names: Vec<&str> = runs.first().map(|r| r.times.iter().map(|t| t.name).collect()).unwrap_or_default();
    let one = |name: &&str| {
        let mut all: Vec<f64> =
            runs.iter().flat_map(|r| r.times.iter().filter(|t| t.name == *name).map(|t| t.ms)).collect();
        all.sort_by(f64::total_cmp);
        Pass { name: (*name).to_owned(), ms_median: quantile(&all, 0.5) }
    };
    names.iter().map(one).collect()
}

/// Nearest rank, of sorted values.
pub fn quantile(sorted: &[f64], at: f64) -> f64 {
    let place = (at * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// CPU time of all threads of this process so far, ms (Linux); 0 where unknown.
pub fn cpu_ms() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let ns = |task: std::fs::DirEntry| -> Option<f64> {
        std::fs::read_to_string(task.path().join("schedstat")).ok()?.split(' ').next()?.parse().ok()
    };
    threads.filter_map(ns).sum::<f64>() * 1e-6
}
