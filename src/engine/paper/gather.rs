//! Which kernel makes the paper's gather: by quality, and among kernels of one quality by a short measurement on the
//! device, because the fastest on one version of a driver may be five times slower on the next. The choice is kept in
//! `$XDG_CACHE_HOME/shutterbug/kernels.json` (or `~/.cache/...`).

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::engine::finish::prepare;
use crate::engine::paper::fast::{FastPush, constants};
use crate::engine::paper::kernels::{GATHER_KERNELS, Gather, GatherKernel};
use crate::error::{Error, Result};
use crate::files::{Limit, read, write_atomic};
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Sampler, Slot,
    Usage,
};

/// How a kernel was chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum ChosenBy {
    /// By name.
    Name,
    /// By an earlier measurement.
    Cache,
    /// By a measurement just now.
    Measurement,
}

/// A choice, and what it rests on.
#[derive(Clone, Debug)]
pub struct GatherChoice {
    /// The kernel.
    pub kernel: GatherKernel,
    /// How it was chosen.
    pub by: ChosenBy,
    /// Least time of each candidate, ms, as measured now or before; empty if it was named.
    pub candidates: Vec<(String, f64)>,
}

/// What the cache holds for one device, driver and quality.
#[derive(Clone, Debug)]
struct Entry {
    kernel: String,
    candidates: Vec<(String, f64)>,
}

/// The kernel of that name; or else the fastest of that quality on this device, from the cache if it holds one.
///
/// # Errors
/// An unknown name, one of another quality; out of memory.
///
/// # Panics
/// For [`Gather::Exact`], which has one kernel: a bug of the caller.
pub fn choose_gather(context: &Arc<Context>, gather: Gather, name: Option<&str>) -> Result<GatherChoice> {
    assert_ne!(gather, Gather::Exact, "the exact gather has one kernel");
    let candidates: Vec<&GatherKernel> = GATHER_KERNELS.iter().filter(|k| k.gather == gather).collect();
    if let Some(name) = name {
        let names: Vec<_> = candidates.iter().map(|k| k.name).collect();
        let expected = format!("one of {}", names.join(", "));
        let found =
            || Error::input(Path::new("--gather-kernel"), None, format!("`{name}`"), expected.clone());
        let kernel = candidates.iter().find(|k| k.name == name).ok_or_else(found)?;
        return Ok(GatherChoice { kernel: **kernel, by: ChosenBy::Name, candidates: Vec::new() });
    }
    let (path, key) = (cache_path(), key(context, gather));
    if let Some(entry) = path.as_deref().and_then(|p| read_cache(p).remove(&key))
        && let Some(kernel) = candidates.iter().find(|k| k.name == entry.kernel)
    {
        return Ok(GatherChoice { kernel: **kernel, by: ChosenBy::Cache, candidates: entry.candidates });
    }
    let times = Trial::new(context)?.run(&candidates)?;
    let fastest = times.iter().zip(&candidates).min_by(|a, b| a.0.1.total_cmp(&b.0.1));
    let kernel = **fastest.expect("every quality has kernels").1;
    if let Some(path) = path {
        write_cache(&path, key, Entry { kernel: kernel.name.to_owned(), candidates: times.clone() });
    }
    Ok(GatherChoice { kernel, by: ChosenBy::Measurement, candidates: times })
}

/// With another version of the driver, the kernel is chosen again.
fn key(context: &Context, gather: Gather) -> String {
    let info = context.info();
    format!("{gather:?} / {} / {} / {} / {}", info.name, info.driver, info.uuid, env!("CARGO_PKG_VERSION"))
}

/// Where choices are kept; `None` where there is no place for them.
pub fn cache_path() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder = set("XDG_CACHE_HOME").or_else(|| Some(set("HOME")?.join(".cache")))?;
    Some(folder.join("shutterbug").join("kernels.json"))
}

type Entries = std::collections::BTreeMap<String, Entry>;

/// `None` if there is no entry, or one that cannot be read: then it is measured again.
fn read_cache(path: &Path) -> Entries {
    read(path, Limit::OWN).ok().and_then(|bytes| entries_of(&bytes)).unwrap_or_default()
}

fn entries_of(json: &[u8]) -> Option<Entries> {
    let value: Value = serde_json::from_slice(json).ok()?;
    let candidate = |pair: &Value| Some((pair.get(0)?.as_str()?.to_owned(), pair.get(1)?.as_f64()?));
    let entry = |value: &Value| {
        let candidates = value.get("candidates")?.as_array()?.iter().map(candidate).collect::<Option<_>>()?;
        Some(Entry { kernel: value.get("kernel")?.as_str()?.to_owned(), candidates })
    };
    value.as_object()?.iter().map(|(key, value)| Some((key.clone(), entry(value)?))).collect()
}

fn json_of(entries: &Entries) -> String {
    let entry = |(key, e): (&String, &Entry)| {
        (key.clone(), json!({ "kernel": e.kernel, "candidates": e.candidates }))
    };
    format!("{:#}", Value::Object(entries.iter().map(entry).collect()))
}

/// A cache that cannot be written costs the next start a measurement, nothing else.
fn write_cache(path: &Path, key: String, entry: Entry) {
    let mut entries = read_cache(path);
    entries.insert(key, entry);
    let json = json_of(&entries);
    let folder = path.parent().expect("a file in a folder");
    let done = std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create the folder", e));
    if let Err(error) = done.and_then(|()| write_atomic(path, json.as_bytes())) {
        tracing::debug!("the choice of kernels is not kept: {error}");
    }
}

/// A picture on which kernels are tried: 24 px of motion everywhere.
struct Trial {
    slot: Slot,
    linear: Sampler,
    nearest: Sampler,
    images: [Image; 3],
    buffers: [Buffer; 3],
    context: Arc<Context>,
}

/// Delivered px, and margin.
const TRIAL_SIZE: [u32; 2] = [256, 160];
const TRIAL_MARGIN: u32 = 32;
const TRIAL_RUNS: usize = 7;
const TRIAL_LIMIT: Duration = Duration::from_secs(60);

impl Trial {
    fn new(context: &Arc<Context>) -> Result<Self> {
        let outer = TRIAL_SIZE.map(|s| s + 2 * TRIAL_MARGIN);
        let color = Image::new(context, "trial color", ImageSpec::storage(outer, Format::Rgba16f))?;
        let array = ImageSpec { layers: 2, ..ImageSpec::storage(outer, Format::Rg32f) };
        let motion = Image::new(context, "trial motion", array)?;
        let radiance =
            Image::new(context, "trial radiance", ImageSpec::storage(TRIAL_SIZE, Format::Rgba32f))?;
        let texels = (outer[0] * outer[1]) as usize;
        let field: Vec<[f32; 2]> = vec![[24.0, 3.0]; 2 * texels];
        let bytes = size_of_val(field.as_slice()) as u64;
        let mut staging = Buffer::new(context, "trial staging", bytes, Usage::Transfer, Location::Upload)?;
        staging.write(0, &field);
        let mut slot = Slot::new(context, "trial")?;
        prepare(&mut slot, [&color, &motion, &radiance])?;
        let mut recorder = slot.begin()?;
        recorder.clear(&color);
        recorder.copy_buffer_to_image(&staging, &motion);
        recorder.barrier();
        recorder.finish();
        slot.submit()?;
        slot.wait(TRIAL_LIMIT)?;
        let buffer = |name, bytes, usage| Buffer::new(context, name, bytes, usage, Location::Device);
        let pixels = u64::from(TRIAL_SIZE[0] * TRIAL_SIZE[1]) * 4;
        let buffers = [
            buffer("trial parameters", crate::chain::PARAMETER_BYTES, Usage::Uniform)?,
            buffer("trial tables", 64, Usage::Texels)?,
            buffer("trial pixels", pixels, Usage::Storage)?,
        ];
        Ok(Self {
            slot,
            linear: Sampler::in_texels(context)?,
            nearest: Sampler::new(context, false)?,
            images: [color, motion, radiance],
            buffers,
            context: context.clone(),
        })
    }

    /// Least time of each, ms, taking turns so that what else the machine does hits all alike.
    fn run(&mut self, kernels: &[&GatherKernel]) -> Result<Vec<(String, f64)>> {
        let make = |k: &&GatherKernel| -> Result<(ComputePipeline, BindGroup)> {
            let pipeline = ComputePipeline::specialized(&self.context, k.shader, &constants(k, 2, None))?;
            let [color, motion, radiance] = &self.images;
            let [parameters, tables, pixels] = &self.buffers;
            let sampler = if k.linear { &self.linear } else { &self.nearest };
            let group = pipeline.bind(&[
                ("color", Bound::Sampled(color, sampler)),
                ("motion", Bound::Storage(motion)),
                ("radiance", Bound::Storage(radiance)),
                ("source", Bound::Storage(radiance)),
                ("original", Bound::Storage(radiance)),
                ("target", Bound::Storage(radiance)),
                ("Parameters", Bound::Buffer(parameters)),
                ("tables", Bound::Buffer(tables)),
                ("Pixels", Bound::Buffer(pixels)),
            ])?;
            Ok((pipeline, group))
        };
        let made = kernels.iter().map(make).collect::<Result<Vec<_>>>()?;
        let push = FastPush::trial(TRIAL_SIZE, TRIAL_MARGIN);
        let mut least = vec![f64::INFINITY; made.len()];
        // The first run of each compiles its code.
        for run in 0..=TRIAL_RUNS {
            for (i, (pipeline, group)) in made.iter().enumerate() {
                let mut recorder = self.slot.begin()?;
                recorder.dispatch(pipeline, group, &push, TRIAL_SIZE);
                recorder.finish();
                let start = Instant::now();
                self.slot.submit()?;
                self.slot.wait(TRIAL_LIMIT)?;
                if run > 0 {
                    least[i] = least[i].min(start.elapsed().as_secs_f64() * 1e3);
                }
            }
        }
        Ok(kernels.iter().map(|k| k.name.to_owned()).zip(least).collect())
    }
}
