//! Compute pipelines.

use std::sync::Arc;

use ash::vk;

use super::bind::{BindGroup, Bound, Interface};
use super::context::{Context, MAIN};
use super::failed;
use crate::error::Result;
use crate::kernels::Kernel;

/// A kernel, ready to be dispatched.
pub struct ComputePipeline {
    pub(super) handle: vk::Pipeline,
    pub(super) interface: Interface,
    pub(super) kernel: &'static Kernel,
    context: Arc<Context>,
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
        let interface = Interface::new(context, &[kernel], vk::ShaderStageFlags::COMPUTE)?;
        let module = ShaderModule::new(context, kernel)?;
        let entries = specialization_entries(constants.len());
        let constants =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.handle)
            .name(MAIN)
            .specialization_info(&constants);
        let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(interface.layout);
        // SAFETY: module and layout are alive and match: both come from the same reflected table.
        let made = unsafe { context.device.create_compute_pipelines(context.pipeline_cache, &[info], None) };
        let handle = made.map_err(|(_, e)| failed("vkCreateComputePipelines")(e))?[0];
        context.name(handle, kernel.file);
        Ok(Self { handle, interface, kernel, context: context.clone() })
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
        BindGroup::new(&self.interface, 0, resources)
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        if self.context.alive() {
            // SAFETY: slots wait for their work before pipelines are dropped.
            unsafe { self.context.device.destroy_pipeline(self.handle, None) };
        }
    }
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
        let info = vk::ShaderModuleCreateInfo::default().code(kernel.words);
        // SAFETY: the code is valid SPIR-V for Vulkan 1.2: the build compiled it.
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
