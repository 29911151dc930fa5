//! Radiance to the delivered picture in host memory: the pixel chain, the last part of every method. A flat list of
//! dispatches between a few pictures of floats; what no effect needs is not there. Twin: `reference/chain.rs`.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};

use super::Stage;
use super::frame::FrameRequest;
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::chain::rng::seed_words;
use crate::chain::{Packed, Plan, Step, View, check_order};
use crate::effects;
use crate::error::{Error, Result};
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Format, Image, ImageSpec, Location, Recorder, Slot, Usage,
};
use crate::kernels::TABLE;

/// What every kernel of the chain is told.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ChainPush {
    size: [u32; 2],
    seed: [u32; 2],
    frame: u32,
    flags: u32,
    slot: u32,
}
assert_push_layout!("pointwise.comp", ChainPush { size, seed, frame, flags, slot });

/// The radiance, and the chain that develops it.
pub(super) struct Finish {
    /// By what the settings ask for; steady after the first frame of a kind.
    chains: BTreeMap<Plan, Vec<Dispatch>>,
    /// What the frame that is being recorded asks for, and its slot.
    current: (Plan, usize),
    /// One a slot.
    inputs: Vec<ChainInputs>,
    /// Pictures between dispatches, made when a plan first needs them.
    work: Vec<Image>,
    pixels: Buffer,
    radiance: Image,
}

/// Mapped buffers of a slot.
struct ChainInputs {
    parameters: Buffer,
    tables: Buffer,
}

struct Dispatch {
    /// Name of the pass in timings.
    name: &'static str,
    slot: u32,
    groups: Vec<BindGroup>,
    pipeline: ComputePipeline,
}

impl Finish {
    pub(super) fn new(stage: &Stage, slots: &mut [FrameSlot]) -> Result<Self> {
        check_order(effects::LIST)?;
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let context = &stage.context;
        let radiance = Image::new(context, "radiance", ImageSpec::storage(size, Format::Rgba32f))?;
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 4;
        let pixels = Buffer::new(context, "pixels", bytes, Usage::Storage, Location::Device)?;
        let table_bytes = 4 * Packed::table_capacity(size) as u64;
        let input = |_: &FrameSlot| {
            Ok(ChainInputs {
                parameters: Buffer::new(context, "parameters", 4096, Usage::Uniform, Location::Upload)?,
                tables: Buffer::new(context, "tables", table_bytes, Usage::Storage, Location::Upload)?,
            })
        };
        let inputs = slots.iter().map(input).collect::<Result<Vec<_>>>()?;
        let first = slots.first_mut().expect("at least one slot");
        prepare(&mut first.gpu, [&radiance])?;
        let current = (Plan { steps: Vec::new() }, 0);
        Ok(Self { chains: BTreeMap::new(), current, inputs, work: Vec::new(), pixels, radiance })
    }

    /// Where the methods write.
    pub(super) fn radiance(&self) -> &Image {
        &self.radiance
    }

    /// Makes what the frame's effects need, if it is not there, and writes their parameters into the slot's buffers.
    pub(super) fn fit(&mut self, stage: &Stage, request: &FrameRequest, slot: &mut FrameSlot) -> Result<()> {
        let view = View {
            intrinsics: stage.intrinsics,
            shutter: request.shutter,
            frame: request.index,
            seed: request.seed,
        };
        let packed = Packed::new(effects::LIST, &request.settings, &view);
        let inputs = &mut self.inputs[slot.index];
        let room = inputs.tables.bytes() / 4;
        if packed.tables.len() as u64 > room {
            return Err(Error::Limit {
                what: "words of the effects' tables",
                value: packed.tables.len() as u64,
                limit: room,
                why: "chain::Packed::table_capacity".to_owned(),
            });
        }
        inputs.parameters.write(0, &packed.rows);
        inputs.tables.write(0, &packed.tables);
        let plan = Plan::new(effects::LIST, &request.settings);
        if !self.chains.contains_key(&plan) {
            let pictures = pictures_of(&plan);
            self.make_work(stage, &pictures, &mut slot.gpu)?;
            let dispatches = self.make(stage, &plan, &pictures)?;
            self.chains.insert(plan.clone(), dispatches);
        }
        self.current = (plan, slot.index);
        Ok(())
    }

    fn make_work(&mut self, stage: &Stage, pictures: &[Pictures], slot: &mut Slot) -> Result<()> {
        let needed = pictures.iter().filter_map(|p| p.target).max().map_or(0, |most| most + 1);
        while self.work.len() < needed {
            let spec = ImageSpec::storage(self.radiance.spec().size, Format::Rgba32f);
            let image = Image::new(&stage.context, "chain picture", spec)?;
            prepare(slot, [&image])?;
            self.work.push(image);
        }
        Ok(())
    }

    fn make(&self, stage: &Stage, plan: &Plan, pictures: &[Pictures]) -> Result<Vec<Dispatch>> {
        let steps = plan.steps.iter().zip(pictures);
        steps
            .map(|(step, pictures)| {
                let (name, slot, file, constants) = match step {
                    Step::Pointwise { variants, last } => {
                        let constants = std::iter::once(u32::from(*last)).chain(variants.iter().copied());
                        ("pointwise", 0, "pointwise.comp", constants.collect::<Vec<_>>())
                    }
                    Step::Neighbourhood { id, slot, file, constants, .. } => {
                        (*id, *slot, *file, constants.to_vec())
                    }
                };
                let found = TABLE.iter().find(|k| k.file == file).expect("a kernel of the table");
                let pipeline = ComputePipeline::specialized(&stage.context, found, &constants)?;
                let groups = self.inputs.iter().map(|inputs| self.bind(&pipeline, *pictures, inputs));
                let groups = groups.collect::<Result<Vec<_>>>()?;
                Ok(Dispatch { name, slot, groups, pipeline })
            })
            .collect()
    }

    fn bind(
        &self,
        pipeline: &ComputePipeline,
        pictures: Pictures,
        inputs: &ChainInputs,
    ) -> Result<BindGroup> {
        let image = |place: Option<usize>| place.map_or(&self.radiance, |i| &self.work[i]);
        pipeline.bind(&[
            ("source", Bound::Storage(image(pictures.source))),
            ("original", Bound::Storage(image(pictures.original))),
            // The last step writes pixels: what is bound here is not touched.
            ("target", Bound::Storage(image(pictures.target))),
            ("Parameters", Bound::Buffer(&inputs.parameters)),
            ("Tables", Bound::Buffer(&inputs.tables)),
            ("Pixels", Bound::Buffer(&self.pixels)),
        ])
    }

    /// Records the chain that [`Self::fit`] chose, and the readback.
    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        request: &FrameRequest,
        readback: (&Buffer, &Buffer),
    ) {
        let size = self.radiance.spec().size;
        let (picture, radiance) = readback;
        let (plan, slot) = &self.current;
        for dispatch in &self.chains[plan] {
            let push = ChainPush {
                size,
                seed: seed_words(request.seed),
                frame: request.index,
                flags: 0,
                slot: dispatch.slot,
            };
            recorder.mark(dispatch.name);
            recorder.dispatch(&dispatch.pipeline, &dispatch.groups[*slot], &push, size);
        }
        recorder.mark("readback");
        recorder.copy_buffer(&self.pixels, picture, self.pixels.bytes());
        if request.statistics {
            recorder.copy_image_to_buffer(&self.radiance, [0, 0], size, radiance);
        }
        recorder.barrier();
    }
}

/// Which pictures a dispatch reads and writes: `None` is the radiance, else one of the work pictures (no target: pixels).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pictures {
    source: Option<usize>,
    original: Option<usize>,
    target: Option<usize>,
}

/// Chooses a target for every dispatch that it does not read; the radiance is never written.
fn pictures_of(plan: &Plan) -> Vec<Pictures> {
    let (mut current, mut original) = (None, None);
    let choose = |step: &Step| {
        let first = matches!(step, Step::Pointwise { .. } | Step::Neighbourhood { pass: 0, .. });
        if first {
            original = current;
        }
        let last = matches!(step, Step::Pointwise { last: true, .. });
        let free = (0..).find(|i| current != Some(*i) && original != Some(*i));
        let pictures = Pictures { source: current, original, target: if last { None } else { free } };
        current = pictures.target;
        pictures
    };
    plan.steps.iter().map(choose).collect()
}

/// Brings new images into their layout, at once.
pub(super) fn prepare<'i>(slot: &mut Slot, images: impl IntoIterator<Item = &'i Image>) -> Result<()> {
    let mut recorder = slot.begin()?;
    recorder.prepare(images);
    recorder.finish();
    slot.submit()?;
    slot.wait(std::time::Duration::from_secs(60))
}
