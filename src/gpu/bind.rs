//! What a pipeline binds: layouts made from the reflected table, and groups of resources checked against it by name.

use std::sync::Arc;

use ash::vk;

use super::context::Context;
use super::failed;
use super::memory::{Buffer, Image, Sampler};
use crate::error::Result;
use crate::kernels::{Binding, BindingKind, Kernel};

/// Descriptor set layouts and the pipeline layout of one or two shader stages.
pub(super) struct Interface {
    pub(super) layout: vk::PipelineLayout,
    pub(super) stages: vk::ShaderStageFlags,
    sets: Vec<vk::DescriptorSetLayout>,
    bindings: Vec<Binding>,
    context: Arc<Context>,
}

impl Interface {
    pub(super) fn new(
        context: &Arc<Context>,
        kernels: &[&Kernel],
        stages: vk::ShaderStageFlags,
    ) -> Result<Self> {
        // Each pipeline has one interface, so this counts pipelines.
        context.count_allocation();
        let mut bindings: Vec<Binding> = Vec::new();
        for binding in kernels.iter().flat_map(|k| k.bindings) {
            if !bindings.contains(binding) {
                bindings.push(*binding);
            }
        }
        let mut interface = Self {
            layout: vk::PipelineLayout::null(),
            stages,
            sets: Vec::new(),
            bindings,
            context: context.clone(),
        };
        let set_count = interface.bindings.iter().map(|b| b.set + 1).max().unwrap_or(0);
        for set in 0..set_count {
            let layout = interface.set_layout(set)?;
            interface.sets.push(layout);
        }
        let push_bytes = kernels.iter().map(|k| k.push_bytes()).max().unwrap_or(0) as u32;
        let push = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&interface.sets)
            .push_constant_ranges(if push_bytes > 0 { &push } else { &[] });
        // SAFETY: the device and the set layouts are alive.
        let layout = unsafe { context.device.create_pipeline_layout(&info, None) };
        interface.layout = layout.map_err(failed("vkCreatePipelineLayout"))?;
        Ok(interface)
    }

    fn set_layout(&self, set: u32) -> Result<vk::DescriptorSetLayout> {
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
        let layout = unsafe { self.context.device.create_descriptor_set_layout(&info, None) };
        layout.map_err(failed("vkCreateDescriptorSetLayout"))
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        if !self.context.alive() {
            return;
        }
        // SAFETY: slots wait for their work before pipelines are dropped; null handles are allowed.
        unsafe {
            self.context.device.destroy_pipeline_layout(self.layout, None);
            for &set in &self.sets {
                self.context.device.destroy_descriptor_set_layout(set, None);
            }
        }
    }
}

fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        BindingKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::TexelBuffer => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
        BindingKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
    }
}

/// A resource to be bound.
#[derive(Clone, Copy)]
pub enum Bound<'a> {
    /// A buffer, whole.
    Buffer(&'a Buffer),
    /// An image by texel.
    Storage(&'a Image),
    /// An image through a sampler.
    Sampled(&'a Image, &'a Sampler),
}

/// Resources for one descriptor set. The resources must outlive the last submission that uses the group; the engine
/// sees to it by keeping both and waiting for its slots first.
pub struct BindGroup {
    pub(super) set: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    context: Arc<Context>,
}

impl BindGroup {
    /// Binds by the names that the shader gives.
    ///
    /// # Errors
    /// Out of memory.
    ///
    /// # Panics
    /// If a name of the set is not given, or given as another kind of resource: a bug of the caller.
    pub(super) fn new(interface: &Interface, set: u32, resources: &[(&str, Bound<'_>)]) -> Result<Self> {
        let context = &interface.context;
        let rows: Vec<_> = interface.bindings.iter().filter(|b| b.set == set).collect();
        context.count_allocation();
        let sizes: Vec<_> = rows
            .iter()
            .map(|b| vk::DescriptorPoolSize::default().ty(descriptor_type(b.kind)).descriptor_count(1))
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { context.device.create_descriptor_pool(&info, None) };
        let pool = pool.map_err(failed("vkCreateDescriptorPool"))?;
        let mut group = Self { set: vk::DescriptorSet::null(), pool, context: context.clone() };
        let layouts = [interface.sets[set as usize]];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: pool and layout are alive and the pool has room for exactly this set.
        let sets = unsafe { context.device.allocate_descriptor_sets(&info) };
        group.set = sets.map_err(failed("vkAllocateDescriptorSets"))?[0];
        for row in rows {
            let found = resources.iter().find(|(name, _)| *name == row.name);
            let (_, resource) = found.unwrap_or_else(|| panic!("no resource is bound to `{}`", row.name));
            group.write(row, *resource);
        }
        Ok(group)
    }

    fn write(&self, row: &Binding, resource: Bound<'_>) {
        let (buffer_info, image_info, texels);
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.set)
            .dst_binding(row.binding)
            .descriptor_type(descriptor_type(row.kind));
        let write = match (row.kind, resource) {
            (BindingKind::StorageBuffer | BindingKind::UniformBuffer, Bound::Buffer(buffer)) => {
                buffer_info =
                    [vk::DescriptorBufferInfo::default().buffer(buffer.handle).range(vk::WHOLE_SIZE)];
                write.buffer_info(&buffer_info)
            }
            (BindingKind::TexelBuffer, Bound::Buffer(buffer)) if buffer.has_texels() => {
                texels = [buffer.view];
                write.texel_buffer_view(&texels)
            }
            (BindingKind::StorageImage, Bound::Storage(image)) => {
                image_info = [vk::DescriptorImageInfo::default()
                    .image_view(image.view)
                    .image_layout(vk::ImageLayout::GENERAL)];
                write.image_info(&image_info)
            }
            (BindingKind::SampledImage, Bound::Sampled(image, sampler)) => {
                image_info = [vk::DescriptorImageInfo::default()
                    .image_view(image.view)
                    .sampler(sampler.handle)
                    .image_layout(vk::ImageLayout::GENERAL)];
                write.image_info(&image_info)
            }
            (kind, _) => panic!("`{}` is a {kind:?}, another kind of resource is bound to it", row.name),
        };
        // SAFETY: set, resource and views are alive, and the set is not in use: it was just made.
        unsafe { self.context.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for BindGroup {
    fn drop(&mut self) {
        if self.context.alive() {
            // SAFETY: slots wait for their work before groups are dropped; the pool frees its set.
            unsafe { self.context.device.destroy_descriptor_pool(self.pool, None) };
        }
    }
}
