//! Groups of resources for a pipeline, checked by name against the reflected table.

use std::sync::Arc;

use ash::vk;

use super::context::Context;
use super::failed;
use super::interface::{Interface, descriptor_type};
use super::memory::{Buffer, Image, Sampler};
use crate::error::Result;
use crate::kernels::{Binding, BindingKind};

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
    pub(super) fn new(
        context: &Arc<Context>,
        interface: &Interface,
        set: u32,
        resources: &[(&str, Bound<'_>)],
    ) -> Result<Self> {
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
