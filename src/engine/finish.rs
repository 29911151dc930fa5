//! From radiance to the delivered picture in host memory: the pixel chain, which ends every method. It is a flat list
//! of dispatches between a few float images; passes that no effect needs are left out. Twin: `reference/chain.rs`.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::chain::rng::seed_words;
use crate::chain::{PARAMETER_BYTES, Packed, Plan, Settings, Step, View, Wanted, check_order};
use crate::effects::{self, BayerMosaic};
use crate::engine::frame::FrameRequest;
use crate::error::{Error, Result};
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Recorder, Slot,
    Usage,
};
use crate::kernels::TABLE;
use crate::plane::Plane;

/// Push constants of every kernel of the chain.
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
pub(crate) struct Finish {
    /// By what the settings ask for; steady after the first frame of a kind.
    chains: BTreeMap<Plan, Vec<Dispatch>>,
    /// What the frame that is being recorded asks for, and its slot.
    current: (Plan, usize),
    /// Whether an effect of what is being recorded reads neighbours.
    reads_neighbours: bool,
    /// One a slot.
    inputs: Vec<ChainInputs>,
    /// Pictures between dispatches, made when a plan first needs them.
    work: Vec<Image>,
    pixels: Buffer,
    radiance: Image,
    context: Arc<Context>,
}

/// Mapped buffers of a slot.
struct ChainInputs {
    parameters: Buffer,
    tables: Buffer,
    /// Values and digital numbers of all colours on their way down, made when a frame first wants them.
    kept: [Option<Buffer>; 2],
    /// What the slot's frame wants.
    wanted: Wanted,
}

struct Dispatch {
    /// Name of the pass in timings.
    name: &'static str,
    slot: u32,
    /// Columns and rows that one invocation makes.
    run: [u32; 2],
    groups: Vec<BindGroup>,
    pipeline: ComputePipeline,
}

impl Finish {
    /// The chain for pictures of `size`, with buffers for each slot; `slot` must have nothing in flight.
    pub(crate) fn new(
        context: &Arc<Context>,
        size: [u32; 2],
        slot_count: usize,
        slot: &mut Slot,
    ) -> Result<Self> {
        check_order(effects::LIST)?;
        let radiance = Image::new(context, "radiance", ImageSpec::storage(size, Format::Rgba32f))?;
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 4;
        let pixels = Buffer::new(context, "pixels", bytes, Usage::Storage, Location::Device)?;
        // What a device cannot hold is refused where a frame needs it (`fit`).
        let table_bytes = (4 * Packed::table_capacity(size) as u64).min(16 * context.info().max_texels);
        let input = |_: usize| {
            Ok(ChainInputs {
                parameters: Buffer::new(
                    context,
                    "parameters",
                    PARAMETER_BYTES,
                    Usage::Uniform,
                    Location::Upload,
                )?,
                tables: Buffer::new(context, "tables", table_bytes, Usage::Texels, Location::Upload)?,
                kept: [None, None],
                wanted: Wanted::PIXELS,
            })
        };
        let inputs = (0..slot_count).map(input).collect::<Result<Vec<_>>>()?;
        prepare(slot, [&radiance])?;
        let current = (Plan::default(), 0);
        let (chains, work, reads_neighbours) = (BTreeMap::new(), Vec::new(), false);
        Ok(Self {
            chains,
            current,
            reads_neighbours,
            inputs,
            work,
            pixels,
            radiance,
            context: context.clone(),
        })
    }

    /// Where the methods write.
    pub(crate) fn radiance(&self) -> &Image {
        &self.radiance
    }

    /// Makes what the effects need, if it is not there, and writes their parameters into the buffers of slot `index`,
    /// of which nothing may be in flight. Where pixels are not wanted, the last values are left in [`Self::output`].
    pub(crate) fn fit(
        &mut self,
        (settings, view): (&Settings, &View),
        wanted: Wanted,
        (slot, index): (&mut Slot, usize),
    ) -> Result<()> {
        let packed = Packed::new(effects::LIST, settings, view);
        let inputs = &mut self.inputs[index];
        let room = inputs.tables.bytes() / 4;
        if packed.tables.len() as u64 > room {
            return Err(Error::Limit {
                what: "words of the effects' tables",
                value: packed.tables.len() as u64,
                limit: room,
                why: "chain::Packed::table_capacity, maxTexelBufferElements".to_owned(),
            });
        }
        inputs.parameters.write(0, &packed.rows);
        inputs.tables.write(0, &packed.tables);
        self.fit_kept(wanted, index)?;
        let plan = Plan::new(effects::LIST, settings, wanted);
        if !self.chains.contains_key(&plan) {
            let pictures = pictures_of(&plan);
            self.make_work(&pictures, slot)?;
            let dispatches = self.make(&plan, &pictures)?;
            self.chains.insert(plan.clone(), dispatches);
        }
        self.current = (plan, index);
        let reads = |e: &&dyn crate::chain::Effect| e.variant(settings) != 0 && e.reads_neighbours(settings);
        self.reads_neighbours = effects::LIST.iter().any(reads);
        Ok(())
    }

    fn fit_kept(&mut self, wanted: Wanted, index: usize) -> Result<()> {
        let [width, height] = self.radiance.spec().size.map(u64::from);
        let inputs = &mut self.inputs[index];
        inputs.wanted = wanted;
        let all = [(wanted.values && wanted.pixels, "values"), (wanted.raw, "raw")];
        for (kept, (_, name)) in
            inputs.kept.iter_mut().zip(all).filter(|(k, (asked, _))| *asked && k.is_none())
        {
            let bytes = 16 * width * height;
            *kept = Some(Buffer::new(&self.context, name, bytes, Usage::Transfer, Location::Readback)?);
        }
        Ok(())
    }

    /// What the finished frame of a slot wanted besides its pixels: encoded values, shape `[height, width, 4]`, and
    /// what is behind each filter of the mosaic, shape `[height, width, 1]`.
    pub(crate) fn take_kept(&self, index: usize, settings: &Settings) -> [Option<Plane<f32>>; 2] {
        let [width, height] = self.radiance.spec().size.map(|s| s as usize);
        let ChainInputs { kept: [values, raw], wanted, .. } = &self.inputs[index];
        let read = |buffer: &Option<Buffer>| {
            let floats: &[f32] = bytemuck::cast_slice(buffer.as_ref()?.mapped());
            Some(Plane { width, height, channels: 4, data: floats[..4 * width * height].to_vec() })
        };
        let values = read(values).filter(|_| wanted.values);
        let raw = if wanted.raw { read(raw) } else { None };
        [values, raw.and_then(|all| BayerMosaic::raw(settings, &all))]
    }

    /// The variants of the fused kernel, if that is all of the chain and looks at no neighbour: then a kernel that
    /// makes the radiance can run it too.
    pub(crate) fn sole_pointwise(&self) -> Option<&[u32]> {
        let plan = &self.current.0;
        match plan.steps.as_slice() {
            [Step::Pointwise { variants, last: true }]
                if !self.reads_neighbours && plan.values_behind.or(plan.raw_behind).is_none() =>
            {
                Some(variants)
            }
            _ => None,
        }
    }

    /// What such a kernel binds for a slot.
    pub(crate) fn chain_buffers(&self, index: usize) -> [(&'static str, Bound<'_>); 3] {
        let inputs = &self.inputs[index];
        [
            ("Parameters", Bound::Buffer(&inputs.parameters)),
            ("tables", Bound::Buffer(&inputs.tables)),
            ("Pixels", Bound::Buffer(&self.pixels)),
        ]
    }

    /// Frames in flight.
    pub(crate) fn slot_count(&self) -> usize {
        self.inputs.len()
    }

    /// Where the last values are, after a chain that was fitted without pixels.
    pub(crate) fn output(&self) -> &Image {
        self.made_by(self.current.0.steps.len())
    }

    /// The result of the first steps of the current plan.
    fn made_by(&self, steps: usize) -> &Image {
        let last = pictures_of(&self.current.0)[..steps].last().and_then(|p| p.target);
        last.map_or(&self.radiance, |i| &self.work[i])
    }

    fn make_work(&mut self, pictures: &[Pictures], slot: &mut Slot) -> Result<()> {
        let needed = pictures.iter().filter_map(|p| p.target).max().map_or(0, |most| most + 1);
        while self.work.len() < needed {
            let spec = ImageSpec::storage(self.radiance.spec().size, Format::Rgba32f);
            let image = Image::new(&self.context, "chain picture", spec)?;
            prepare(slot, [&image])?;
            self.work.push(image);
        }
        Ok(())
    }

    fn make(&self, plan: &Plan, pictures: &[Pictures]) -> Result<Vec<Dispatch>> {
        let steps = plan.steps.iter().zip(pictures);
        steps
            .map(|(step, pictures)| {
                let (name, slot, file, run) = match step {
                    Step::Pointwise { .. } => ("pointwise", 0, "pointwise.comp", [1, 1]),
                    Step::Neighbourhood { id, slot, file, run, .. } => (*id, *slot, *file, *run),
                };
                let found = TABLE.iter().find(|k| k.file == file).expect("a kernel of the table");
                let pipeline = ComputePipeline::specialized(&self.context, found, &step.constants())?;
                let groups = self.inputs.iter().map(|inputs| self.bind(&pipeline, *pictures, inputs));
                let groups = groups.collect::<Result<Vec<_>>>()?;
                Ok(Dispatch { name, slot, run, groups, pipeline })
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
            ("tables", Bound::Buffer(&inputs.tables)),
            ("Pixels", Bound::Buffer(&self.pixels)),
        ])
    }

    /// Records the chain that [`Self::fit`] chose, and the readback.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        request: &FrameRequest,
        (picture, radiance): (&Buffer, &Buffer),
    ) {
        self.record_chain(recorder, request.index, request.seed);
        self.record_readback(recorder, request, (picture, radiance));
    }

    /// Records the readback of pixels that are there.
    pub(crate) fn record_readback(
        &self,
        recorder: &mut Recorder<'_>,
        request: &FrameRequest,
        (picture, radiance): (&Buffer, &Buffer),
    ) {
        recorder.mark("readback");
        recorder.copy_buffer(&self.pixels, picture, self.pixels.bytes());
        if request.statistics {
            recorder.copy_image_to_buffer(&self.radiance, [0, 0], self.radiance.spec().size, radiance);
        }
        recorder.barrier();
    }

    /// Records the dispatches only, and the readback of what else is wanted of what they make.
    pub(crate) fn record_chain(&self, recorder: &mut Recorder<'_>, frame: u32, seed: u64) {
        let size = self.radiance.spec().size;
        let (plan, index) = &self.current;
        self.record_kept(recorder, 0);
        for (done, dispatch) in self.chains[plan].iter().enumerate() {
            let push = ChainPush { size, seed: seed_words(seed), frame, flags: 0, slot: dispatch.slot };
            recorder.mark(dispatch.name);
            let invocations = [0, 1].map(|i| size[i].div_ceil(dispatch.run[i]));
            recorder.dispatch(&dispatch.pipeline, &dispatch.groups[*index], &push, invocations);
            self.record_kept(recorder, done + 1);
        }
    }

    /// Before the result of the first steps is overwritten.
    fn record_kept(&self, recorder: &mut Recorder<'_>, steps: usize) {
        let (plan, index) = &self.current;
        let behind = [plan.values_behind, plan.raw_behind];
        for (buffer, _) in self.inputs[*index].kept.iter().zip(behind).filter(|(_, at)| *at == Some(steps)) {
            // Values without pixels are their caller's to read.
            let Some(buffer) = buffer else { continue };
            let image = self.made_by(steps);
            recorder.mark("readback");
            recorder.copy_image_to_buffer(image, [0, 0], image.spec().size, buffer);
        }
    }

    /// Where the delivered picture is, 4 bytes a pixel.
    pub(crate) fn pixels(&self) -> &Buffer {
        &self.pixels
    }
}

/// Which pictures a dispatch reads and writes: `None` is the radiance, else one of the work pictures (no target:
/// pixels).
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
        let free = (0..).find(|i| current != Some(*i) && original != Some(*i));
        let pictures =
            Pictures { source: current, original, target: if step.delivers() { None } else { free } };
        current = pictures.target;
        pictures
    };
    plan.steps.iter().map(choose).collect()
}

/// Brings new images into their layout, at once.
pub(crate) fn prepare<'i>(slot: &mut Slot, images: impl IntoIterator<Item = &'i Image>) -> Result<()> {
    let mut recorder = slot.begin()?;
    recorder.prepare(images);
    recorder.finish();
    slot.submit()?;
    let done = slot.wait(std::time::Duration::from_secs(60));
    if done.is_err() {
        // The caller drops the images now.
        slot.let_go();
    }
    done
}
