//! `--method accumulation`: the reference. N renders over the frame's interval, each weighed into the lines whose
//! exposure covers its instant. Twin: `reference/accumulate.rs`.

use crate::camera::accumulation::{AccumulationPlan, WeightedInstant};
use crate::camera::{ShutterTiming, Trajectory};
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::accumulate::{Accumulate, WeightedLines};
use crate::engine::scene::clusters::Sought;
use crate::engine::scene::lens::Channel;
use crate::engine::scene::{Choices, Renderer, Shot, Stage};
use crate::engine::slots::FrameSlot;
use crate::error::Result;
use crate::gpu::{BindGroup, Recorder, RenderArea};
use crate::raster::{Instant, RasterInput, RasterKind, RasterTarget};

/// Instants of one submission: long frames are cut so that no submission runs into a driver's watchdog.
const CHUNK: usize = 32;

/// How the reference renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccumulationOptions {
    /// Number of renders N; `None`: as many as keep the motion from one to the next under `step_px`.
    pub renders: Option<u32>,
    /// Largest motion between two renders, px, where N is chosen.
    pub step_px: f64,
    /// Most renders where N is chosen.
    pub most: u32,
}

impl Default for AccumulationOptions {
    fn default() -> Self {
        Self { renders: None, step_px: 0.5, most: 1024 }
    }
}

/// The method.
struct Accumulation {
    inputs: Vec<(RasterInput, BindGroup)>,
    accumulate: Accumulate,
    target: RasterTarget,
    options: AccumulationOptions,
}

impl Choices for AccumulationOptions {
    fn make(&self, stage: &Stage, room: &mut Room<'_>, _: &[FrameRequest]) -> Result<Box<dyn Renderer>> {
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let target = RasterTarget::new(&stage.context, &stage.buffers, RasterKind::Color, size, stage.plan)?;
        room.prepare(target.attachments.images())?;
        let accumulate = Accumulate::new(stage)?;
        let bind = |slot: &FrameSlot| {
            let input = target.bind(&stage.buffers, &slot.inputs.instants, &slot.inputs.cameras)?;
            Ok((input, accumulate.bind(&target, room.radiance, slot)?))
        };
        let inputs = room.slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        Ok(Box::new(Accumulation { inputs, accumulate, target, options: *self }))
    }
}

impl Renderer for Accumulation {
    /// Renders the frame in chunks; all but the last are waited for.
    fn submit(&mut self, mut shot: Shot<'_>) -> Result<()> {
        let (stage, request, path, finish) = (shot.stage, shot.request, shot.path, shot.finish);
        let plan = AccumulationPlan::new(&request.shutter, self.renders(stage, path, &request.shutter));
        let channels = stage.channels();
        let parts: Vec<_> = channels
            .iter()
            .flat_map(|&channel| plan.instants.chunks(CHUNK).enumerate().map(move |(i, c)| (channel, i, c)))
            .collect();
        let per_channel = parts.len() / channels.len();
        for (i, &(channel, of_channel, chunk)) in parts.iter().enumerate() {
            if i > 0 {
                shot.slot.gpu.wait(shot.limit)?;
                shot.slot.keep_times()?;
                shot.slot.inputs.clear();
            }
            let rows = write_inputs(&mut shot, chunk);
            let ending = (i + 1 == parts.len()).then(|| shot.ending());
            let index = shot.slot.index;
            let (mut recorder, to) = shot.slot.begin()?;
            if of_channel == 0 {
                recorder.mark("clear");
                recorder.clear(finish.radiance());
            }
            self.record(stage, &mut recorder, index, (&request.shutter, channel), &rows);
            if of_channel + 1 == per_channel {
                stage.merge(&mut recorder, channel);
            }
            if let Some(ending) = &ending {
                ending.record(stage, &mut recorder, index, (finish, request, false), to);
            }
            recorder.finish();
            shot.slot.gpu.submit()?;
        }
        Ok(())
    }
}

impl Accumulation {
    fn renders(&self, stage: &Stage, path: &Trajectory, shutter: &ShutterTiming) -> u32 {
        if let Some(renders) = self.options.renders {
            return renders.max(1);
        }
        let (start_s, end_s) = (shutter.start_s, shutter.end_s());
        if end_s <= start_s {
            return 1;
        }
        // Displacement over quarters of the frame, so that motion there and back is not taken for rest.
        let quarter_s = 0.25 * (end_s - start_s);
        let speed = (0..4).map(|i| {
            let from_s = start_s + quarter_s * f64::from(i);
            let to_s = (from_s + quarter_s).min(end_s);
            stage.reach(path, (from_s, &[to_s]), Sought::All).largest_px / quarter_s
        });
        let speed_px_per_s = speed.fold(0.0, f64::max);
        AccumulationPlan::auto_renders(shutter, speed_px_per_s, self.options.step_px, self.options.most)
    }

    fn record(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (shutter, channel): (&ShutterTiming, Channel),
        rows: &[((u32, u32), WeightedLines)],
    ) {
        let (input, group) = &self.inputs[slot];
        let drawn = stage.drawn(channel);
        for (row, lines) in rows {
            let push = lines.push(shutter.scan_order, self.target.size, stage.plan.grid);
            let area = RenderArea {
                x: push.origin[0],
                y: push.origin[1],
                width: push.size[0],
                height: push.size[1],
            };
            recorder.mark("raster");
            self.target.draw(recorder, &drawn, input, *row, 0.0, area);
            recorder.mark("accumulate");
            self.accumulate.record(recorder, group, &push);
        }
    }
}

/// Writes matrices and weights; returns, for each instant, its row and the kernel's push constants.
fn write_inputs(shot: &mut Shot<'_>, chunk: &[WeightedInstant]) -> Vec<((u32, u32), WeightedLines)> {
    let one = |weighted: &WeightedInstant| {
        let row = shot.add(&shot.stage.intrinsics, &Instant::still(weighted.time_s));
        let first_weight = shot.slot.inputs.add_weights(&weighted.weights);
        let line_count = weighted.weights.len() as u32;
        (row, WeightedLines { first_line: weighted.first_line, line_count, first_weight })
    };
    chunk.iter().map(one).collect()
}
