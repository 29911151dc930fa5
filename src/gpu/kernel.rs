//! Compute pipelines.

use std::path::Path;
use std::sync::Arc;

use ash::vk;

use super::bind::{BindGroup, Bound};
use super::context::{Context, MAIN};
use super::failed;
use super::pipeline::Pipeline;
use crate::error::{Error, Result};
use crate::kernels::Kernel;

/// A kernel, ready to be dispatched.
pub struct ComputePipeline {
    pub(super) pipeline: Pipeline,
    pub(super) kernel: &'static Kernel,
}

impl ComputePipeline {
    /// Builds the pipeline of a kernel.
    ///
    /// # Errors
    /// Out of memory, or a driver that refuses the shader.
    pub fn new(context: &Arc<Context>, kernel: &'static Kernel) -> Result<Self> {
        Self::specialized(context, kernel, &[])
    }

    /// The same with specialization constants 0, 1, ...
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn specialized(context: &Arc<Context>, kernel: &'static Kernel, constants: &[u32]) -> Result<Self> {
        let kernels: (&[_], _) = (&[kernel], vk::ShaderStageFlags::COMPUTE);
        let make = |layout| make_pipeline(context, kernel, constants, layout);
        let pipeline = Pipeline::of(context, kernels, constants.to_vec(), make)?;
        Ok(Self { pipeline, kernel })
    }

    /// File name of the kernel in `glsl/`.
    pub fn file(&self) -> &'static str {
        self.kernel.file
    }

    /// Binds the kernel's resources by name.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, resources: &[(&str, Bound<'_>)]) -> Result<BindGroup> {
        BindGroup::new(&self.pipeline.context, &self.pipeline.interface, 0, resources)
    }
}

fn make_pipeline(
    context: &Arc<Context>,
    kernel: &Kernel,
    constants: &[u32],
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let module = ShaderModule::new(context, kernel)?;
    let entries = specialization_entries(constants.len());
    let constants =
        vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module.handle)
        .name(MAIN)
        .specialization_info(&constants);
    let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
    // SAFETY: module and layout are alive and match: both come from the same reflected table.
    let made = unsafe { context.device.create_compute_pipelines(context.pipeline_cache, &[info], None) };
    let handle = made.map_err(|(_, e)| failed("vkCreateComputePipelines")(e))?[0];
    context.name(handle, kernel.file);
    Ok(handle)
}

/// First word of SPIR-V.
const MAGIC: u32 = 0x0723_0203;
/// Words before the first instruction.
const HEADER: usize = 5;
/// The highest version that Vulkan 1.2 takes: 1.5.
const NEWEST: u32 = 0x0001_0500;

/// What words are where they are no SPIR-V: its head, and instructions whose lengths end where the words do. What the
/// instructions say is the driver's to check, which believes it.
fn not_spirv(words: &[u32]) -> Option<String> {
    let [magic, version, _, bound, ..] = *words else { return Some(format!("{} words", words.len())) };
    if magic != MAGIC {
        let other = if magic.swap_bytes() == MAGIC { ", in the other byte order" } else { "" };
        return Some(format!("{magic:#010x} as the first word{other}"));
    }
    if !(0x0001_0000..=NEWEST).contains(&version) {
        return Some(format!("{version:#010x} as the version"));
    }
    if bound == 0 || words.len() <= HEADER {
        return Some("no instruction".to_owned());
    }
    let mut at = HEADER;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        if length == 0 || at + length > words.len() {
            return Some(format!("an instruction of {length} words at word {at} of {}", words.len()));
        }
        at += length;
    }
    None
}

/// Constants 0, 1, ... as consecutive words.
pub(super) fn specialization_entries(count: usize) -> Vec<vk::SpecializationMapEntry> {
    let entry = |id: u32| vk::SpecializationMapEntry::default().constant_id(id).offset(4 * id).size(4);
    (0..count as u32).map(entry).collect()
}

/// A shader module, needed only while a pipeline is made.
pub(super) struct ShaderModule {
    pub(super) handle: vk::ShaderModule,
    context: Arc<Context>,
}

impl ShaderModule {
    pub(super) fn new(context: &Arc<Context>, kernel: &Kernel) -> Result<Self> {
        if let Some(found) = not_spirv(kernel.words) {
            let expected = "SPIR-V in words of this machine, of version 1.0 to 1.5";
            return Err(Error::input(Path::new(kernel.file), None, found, expected));
        }
        let info = vk::ShaderModuleCreateInfo::default().code(kernel.words);
        // SAFETY: the code is valid SPIR-V for Vulkan 1.2: the build compiled it, or whoever made the kernel promises
        // it. What is no SPIR-V at all was refused above.
        let handle = unsafe { context.device.create_shader_module(&info, None) };
        Ok(Self { handle: handle.map_err(failed("vkCreateShaderModule"))?, context: context.clone() })
    }
}

impl Drop for ShaderModule {
    fn drop(&mut self) {
        // SAFETY: pipelines keep what they need of a module.
        unsafe { self.context.device.destroy_shader_module(self.handle, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_spirv_is_refused_before_the_driver_sees_it() {
        for kernel in crate::kernels::TABLE {
            assert_eq!(not_spirv(kernel.words), None, "control: {}", kernel.file);
        }
        let whole = crate::kernels::TABLE[0].words;
        let changed = |at: usize, word: u32| {
            let mut words = whole.to_vec();
            words[at] = word;
            not_spirv(&words).unwrap_or_default()
        };
        assert_eq!(not_spirv(&[]).as_deref(), Some("0 words"));
        assert_eq!(not_spirv(&whole[..3]).as_deref(), Some("3 words"));
        assert_eq!(not_spirv(&whole[..HEADER]).as_deref(), Some("no instruction"));
        assert!(changed(0, MAGIC.swap_bytes()).contains("the other byte order"));
        assert!(changed(0, 0).contains("first word") && changed(1, 0x0002_0000).contains("version"));
        assert!(changed(3, 0).contains("no instruction"));
        assert!(changed(HEADER, 0).contains("an instruction of 0 words at word 5"));
        // The first instruction, OpCapability, has two words.
        let cut = &whole[..=HEADER];
        assert!(
            not_spirv(cut).is_some_and(|said| said.contains("an instruction of")),
            "{:?}",
            not_spirv(cut)
        );
        let random: Vec<u32> = (1..64u32).map(|i| i.wrapping_mul(0x9e37_79b9)).collect();
        assert!(not_spirv(&random).is_some());
    }
}
