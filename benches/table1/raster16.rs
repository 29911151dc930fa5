//! 16 samples a pixel in one pass (ours) against four passes of four samples, each moved by a share of a pixel and
//! added up: with our shaders, and with those that a user would otherwise write, lights in a storage buffer. Rasterized
//! and added up, nothing else; the pictures are compared.

use std::sync::Arc;
use std::time::{Duration, Instant as Clock};

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use shutterbug::camera::{Intrinsics, Trajectory};
use shutterbug::error::Result;
use shutterbug::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Recorder,
    RenderArea, Sampler, Slot, Usage,
};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::plane::metrics::psnr_db;
use shutterbug::raster::{
    CameraRow, Drawn, Instant, ObjectRow, RasterInput, RasterKind, RasterTarget, SamplePlan, SceneBuffers,
    instant_rows,
};
use shutterbug::scene::Scene;

use super::cells::cpu_ms;
use super::peer::{Peer, Shading16};

const LIMIT: Duration = Duration::from_secs(60);
/// Where the four passes see the scene, px: with the pattern of four samples, sixteen places spread over the pixel.
const JITTER_PX: [[f64; 2]; 4] =
    [[-0.09375, -0.03125], [0.03125, -0.09375], [-0.03125, 0.09375], [0.09375, 0.03125]];
/// Rounds in which each way has its turn; the first compiles.
const ROUNDS: usize = 13;
/// Four passes that differ more than this from those with our shaders do not compute the same picture, dB. (One pass
/// has its samples at other places: it differs by more.)
pub const SAME_PICTURE_DB: f64 = 50.0;

/// Ways to 16 samples.
pub const WAYS: [&str; 4] = [
    "one pass of 2x2 texels of 4",
    "four passes of 4, our shaders",
    "four passes of 4, our shading but for lights in a storage buffer",
    "four passes of 4, plain shading with lights in a storage buffer",
];
/// Which of them the others' pictures are compared with.
pub const COMPARED_WITH: usize = 1;

/// One way at one size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Way {
    pub name: String,
    pub size: [u32; 2],
    pub ms_least: f64,
    pub ms_median: f64,
    /// CPU time of the process, all threads.
    pub cpu_ms_median: f64,
    /// Against four passes with our shaders, 8 bits of the clamped radiance.
    pub psnr_db: f64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AccumulatePush {
    origin: [u32; 2],
    size: [u32; 2],
    picture: [u32; 2],
    grid: [i32; 2],
    scan_order: u32,
    first_line: u32,
    first_weight: u32,
}

/// What is drawn, by whom and from where.
pub struct World<'a> {
    pub context: &'a Arc<Context>,
    pub scene: &'a Scene,
    pub path: &'a Trajectory,
    pub intrinsics: Intrinsics,
}

struct Lab {
    slot: Slot,
    buffers: SceneBuffers,
    targets: [(RasterTarget, RasterInput, BindGroup); 2],
    peers: [(Peer, BindGroup); 2],
    accumulate: ComputePipeline,
    sum: Image,
    instants: Buffer,
    cameras: Buffer,
    readback: Buffer,
    size: [u32; 2],
    object_count: u32,
    /// Kept for the groups.
    _bound: (Buffer, Sampler),
}

/// All ways at one size, in turns.
pub fn measure(world: &World<'_>) -> Result<Vec<Way>> {
    let mut lab = Lab::new(world)?;
    let size = lab.size;
    let mut pictures = Vec::new();
    lab.look(world, 0.5);
    for way in 0..WAYS.len() {
        pictures.push(lab.picture(way)?);
    }
    let mut times = vec![Vec::new(); WAYS.len()];
    for round in 0..ROUNDS {
        lab.look(world, (round as f64 + 0.5) / ROUNDS as f64);
        for (way, times) in times.iter_mut().enumerate() {
            let once = lab.time(way)?;
            if round > 0 {
                times.push(once);
            }
        }
    }
    let row = |(way, times): (usize, Vec<(f64, f64)>)| {
        let sorted = |of: fn(&(f64, f64)) -> f64| {
            let mut all: Vec<f64> = times.iter().map(of).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let (host, cpu) = (sorted(|t| t.0), sorted(|t| t.1));
        Way {
            name: WAYS[way].to_owned(),
            size,
            ms_least: host[0],
            ms_median: host[host.len() / 2],
            cpu_ms_median: cpu[cpu.len() / 2],
            psnr_db: psnr_db(&pictures[way], &pictures[COMPARED_WITH]).min(99.0),
        }
    };
    Ok(times.into_iter().enumerate().map(row).collect())
}

impl Lab {
    fn new(world: &World<'_>) -> Result<Self> {
        let context = world.context;
        let size = [world.intrinsics.width, world.intrinsics.height];
        let (rows, objects) = (1 + JITTER_PX.len() as u64, world.scene.objects.len() as u64);
        let upload = |name, bytes, usage| Buffer::new(context, name, bytes, usage, Location::Upload);
        let bytes = rows * objects * size_of::<ObjectRow>() as u64;
        let instants = upload("instants", bytes, Usage::StorageTexels)?;
        let cameras = upload("cameras", rows * size_of::<CameraRow>() as u64, Usage::Texels)?;
        let mut weights = upload("weights", 8 * u64::from(size[1]), Usage::Storage)?;
        // A whole picture, and a quarter of one.
        weights.write(0, &vec![1.0f32; size[1] as usize]);
        weights.write(4 * size[1] as usize, &vec![0.25f32; size[1] as usize]);
        let buffers = SceneBuffers::new(context, world.scene)?;
        let accumulate = ComputePipeline::new(context, kernel("accumulate_ms.comp"))?;
        let sampler = Sampler::new(context, false)?;
        let sum = Image::new(context, "sum", ImageSpec::storage(size, Format::Rgba32f))?;
        let add = |samples: &Image| {
            accumulate.bind(&[
                ("color_samples", Bound::Sampled(samples, &sampler)),
                ("radiance", Bound::Storage(&sum)),
                ("Weights", Bound::Buffer(&weights)),
            ])
        };
        let target = |grid| -> Result<_> {
            let plan = SamplePlan { grid, msaa: 4 };
            let target = RasterTarget::new(context, &buffers, RasterKind::Color, size, plan)?;
            let input = target.bind(&buffers, &instants, &cameras)?;
            let group = add(&target.attachments.colors()[0])?;
            Ok((target, input, group))
        };
        let targets = [target(2)?, target(1)?];
        let peer = |shading| -> Result<_> {
            let peer = Peer::new(context, world.scene, size, shading, [&instants, &cameras])?;
            let group = add(&peer.attachments.colors()[0])?;
            Ok((peer, group))
        };
        let peers = [peer(Shading16::Ours)?, peer(Shading16::Plain)?];
        let mut slot = Slot::new(context, "raster 16")?;
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { slot.begin_unchecked() }?;
        let images = targets.iter().flat_map(|t| t.0.attachments.images());
        let of_peers = peers.iter().flat_map(|p| p.0.attachments.images());
        recorder.prepare(images.chain(of_peers).chain([&sum]));
        recorder.finish();
        slot.submit()?;
        slot.wait(LIMIT)?;
        let bytes = 16 * u64::from(size[0] * size[1]);
        let readback = Buffer::new(context, "sum", bytes, Usage::Transfer, Location::Readback)?;
        let object_count = objects as u32;
        Ok(Self {
            slot,
            buffers,
            targets,
            peers,
            accumulate,
            sum,
            instants,
            cameras,
            readback,
            size,
            object_count,
            _bound: (weights, sampler),
        })
    }

    /// Matrices for a place of the path, 0 to 1: the pixel's own, then those of the four passes.
    fn look(&mut self, world: &World<'_>, at: f64) {
        let (from_s, to_s) = world.path.span_s();
        let time = Instant::still(from_s + 0.9 * at * (to_s - from_s));
        let k = world.intrinsics;
        let jittered = JITTER_PX.iter().map(|[x, y]| Intrinsics { cx: k.cx + x, cy: k.cy + y, ..k });
        let (mut place, mut camera) = (0, 0);
        for k in std::iter::once(k).chain(jittered) {
            let (rows, eye) = instant_rows(&time, &k, world.path, &world.scene.objects);
            self.instants.write(place, &rows);
            self.cameras.write(camera, &[eye]);
            place += size_of_val(rows.as_slice());
            camera += size_of_val(&eye);
        }
    }

    fn record(&mut self, way: usize, back: bool) -> Result<()> {
        let size = self.size;
        let area = RenderArea { x: 0, y: 0, width: size[0], height: size[1] };
        let drawn = Drawn { scene: &self.buffers, geometry: None, lens: None };
        let objects = self.object_count;
        let add = |r: &mut Recorder<'_>, group: &BindGroup, grid: i32| {
            let first_weight = if grid == 2 { 0 } else { size[1] };
            let push = AccumulatePush {
                origin: [0; 2],
                size,
                picture: size,
                grid: [grid; 2],
                scan_order: 0,
                first_line: 0,
                first_weight,
            };
            r.dispatch(&self.accumulate, group, &push, size);
        };
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut r = unsafe { self.slot.begin_unchecked() }?;
        r.clear(&self.sum);
        match way {
            0 => {
                let (target, input, group) = &self.targets[0];
                target.draw(&mut r, &drawn, input, (0, objects), 0.0, area);
                add(&mut r, group, 2);
            }
            1 => {
                for pass in 1..=JITTER_PX.len() as u32 {
                    let (target, input, group) = &self.targets[1];
                    target.draw(&mut r, &drawn, input, (pass, objects), 0.0, area);
                    add(&mut r, group, 1);
                }
            }
            _ => {
                for pass in 1..=JITTER_PX.len() as u32 {
                    let (peer, group) = &self.peers[way - 2];
                    peer.draw(&mut r, (pass, objects), area);
                    add(&mut r, group, 1);
                }
            }
        }
        if back {
            r.copy_image_to_buffer(&self.sum, [0, 0], size, &self.readback);
            r.barrier();
        }
        r.finish();
        Ok(())
    }

    /// Host and CPU time, ms.
    fn time(&mut self, way: usize) -> Result<(f64, f64)> {
        self.record(way, false)?;
        let (cpu, start) = (cpu_ms(), Clock::now());
        self.slot.submit()?;
        self.slot.wait(LIMIT)?;
        Ok((start.elapsed().as_secs_f64() * 1e3, cpu_ms() - cpu))
    }

    fn picture(&mut self, way: usize) -> Result<Plane<u8>> {
        self.record(way, true)?;
        self.slot.submit()?;
        self.slot.wait(LIMIT)?;
        let [width, height] = self.size.map(|s| s as usize);
        let values: &[f32] = bytemuck::cast_slice(&self.readback.mapped()[..16 * width * height]);
        let levels = values.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
        let data = levels.map(|v| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8).collect();
        Ok(Plane { width, height, channels: 3, data })
    }
}
