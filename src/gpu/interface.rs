//! What a pipeline binds: layouts made from the reflected table.

use ash::vk;

use super::failed;
use crate::error::Result;
use crate::kernels::{Binding, BindingKind, Kernel};

/// Descriptor set layouts and the pipeline layout of one or two shader stages; a part of a pipeline, which destroys it.
#[derive(Default)]
pub(super) struct Interface {
    pub(super) layout: vk::PipelineLayout,
    pub(super) stages: vk::ShaderStageFlags,
    pub(super) sets: Vec<vk::DescriptorSetLayout>,
    pub(super) bindings: Vec<Binding>,
}

impl Interface {
    pub(super) fn new(
        device: &ash::Device,
        kernels: &[&Kernel],
        stages: vk::ShaderStageFlags,
    ) -> Result<Self> {
        let mut bindings: Vec<Binding> = Vec::new();
        for binding in kernels.iter().flat_map(|k| k.bindings) {
            if !bindings.contains(binding) {
                bindings.push(*binding);
            }
        }
        let mut interface = Self { layout: vk::PipelineLayout::null(), stages, sets: Vec::new(), bindings };
        let push_bytes = kernels.iter().map(|k| k.push_bytes()).max().unwrap_or(0) as u32;
        let made = interface.make(device, push_bytes);
        if made.is_err() {
            // SAFETY: nothing knows of it yet.
            unsafe { interface.destroy(device) };
        }
        made.map(|()| interface)
    }

    fn make(&mut self, device: &ash::Device, push_bytes: u32) -> Result<()> {
        let set_count = self.bindings.iter().map(|b| b.set + 1).max().unwrap_or(0);
        for set in 0..set_count {
            let layout = self.set_layout(device, set)?;
            self.sets.push(layout);
        }
        let push = [vk::PushConstantRange::default().stage_flags(self.stages).size(push_bytes)];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&self.sets)
            .push_constant_ranges(if push_bytes > 0 { &push } else { &[] });
        // SAFETY: the device and the set layouts are alive.
        let layout = unsafe { device.create_pipeline_layout(&info, None) };
        self.layout = layout.map_err(failed("vkCreatePipelineLayout"))?;
        Ok(())
    }

    fn set_layout(&self, device: &ash::Device, set: u32) -> Result<vk::DescriptorSetLayout> {
        let of_set = self.bindings.iter().filter(|b| b.set == set);
        let rows: Vec<_> = of_set
            .map(|b| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.binding)
                    .descriptor_type(descriptor_type(b.kind))
                    .descriptor_count(1)
                    .stage_flags(self.stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&rows);
        // SAFETY: the device is alive.
        let layout = unsafe { device.create_descriptor_set_layout(&info, None) };
        layout.map_err(failed("vkCreateDescriptorSetLayout"))
    }

    /// # Safety
    /// No work that uses it is on the device, and nothing uses it from here on.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: the caller's promise; null handles are allowed.
        unsafe {
            device.destroy_pipeline_layout(self.layout, None);
            for &set in &self.sets {
                device.destroy_descriptor_set_layout(set, None);
            }
        }
    }
}

pub(super) fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        BindingKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::TexelBuffer => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        BindingKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
    }
}
