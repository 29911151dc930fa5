//! Recording commands. The only file with barriers: one global memory barrier between dependent commands.

use std::sync::Arc;

use ash::vk;
use bytemuck::{NoUninit, bytes_of};

use super::bind::BindGroup;
use super::context::Context;
use super::graphics::{Attachments, GraphicsPipeline};
use super::kernel::ComputePipeline;
use super::memory::{Buffer, Image};
use super::shared_image::SharedImage;
use super::slot::{MAX_QUERIES, Slot};
use crate::error::Result;

/// A rectangle of the attachments, px: only it is cleared and drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderArea {
    /// Left edge.
    pub x: u32,
    /// Top edge.
    pub y: u32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

/// Records one submission of a slot.
pub struct Recorder<'a> {
    context: Arc<Context>,
    slot: &'a mut Slot,
}

impl Slot {
    /// Starts recording, for callers outside this crate. All work for the device is recorded here; the rest of this
    /// module only creates and drops objects.
    ///
    /// # Safety
    /// Everything that is recorded, and what its groups bind, lives until [`Self::wait`] says that the work is over.
    /// The invocations of a kernel stay inside what its group binds, as its own source says. A draw's area lies inside
    /// the attachments, its indices inside the index buffer, what they name inside the vertex buffer, and its groups
    /// and push constants are those of its pipeline. A copy to or from a buffer fits into it, all layers counted.
    ///
    /// # Errors
    /// Out of memory.
    ///
    /// # Panics
    /// If work is in flight: a bug of the caller.
    pub unsafe fn begin_unchecked(&mut self) -> Result<Recorder<'_>> {
        self.begin()
    }

    /// [`Self::begin_unchecked`] for this crate, where engine and raster keep its rules: they own what their slots use,
    /// and wait before they drop it.
    pub(crate) fn begin(&mut self) -> Result<Recorder<'_>> {
        let context = self.begin_commands()?;
        Ok(Recorder { context, slot: self })
    }
}

impl Recorder<'_> {
    /// From here on, time counts for the pass of this name.
    pub fn mark(&mut self, name: &'static str) {
        if self.slot.queries == vk::QueryPool::null() || self.slot.marks.len() as u32 >= MAX_QUERIES / 2 - 1 {
            return;
        }
        self.timestamp();
        self.slot.marks.push(name);
    }

    /// Ends the last pass. Must be the last thing recorded.
    pub fn finish(self) {
        if self.slot.queries != vk::QueryPool::null() && !self.slot.marks.is_empty() {
            self.timestamp();
        }
    }

    fn timestamp(&self) {
        let at = 2 * self.slot.marks.len() as u32;
        for query in [at, at + 1] {
            // SAFETY: recording; each query is written once after its reset.
            unsafe {
                self.context.device.cmd_write_timestamp(
                    self.slot.commands,
                    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                    self.slot.queries,
                    query,
                );
            }
        }
    }

    /// Everything before is finished and visible to everything after, the host included.
    pub fn barrier(&mut self) {
        let barrier = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE);
        let stages = vk::PipelineStageFlags::ALL_COMMANDS;
        // SAFETY: recording, outside a render pass.
        unsafe {
            self.context.device.cmd_pipeline_barrier(
                self.slot.commands,
                stages,
                stages | vk::PipelineStageFlags::HOST,
                vk::DependencyFlags::empty(),
                &[barrier],
                &[],
                &[],
            );
        }
    }

    /// Brings new images into the layout in which they stay. Their content is undefined afterwards.
    pub fn prepare<'i>(&mut self, images: impl IntoIterator<Item = &'i Image>) {
        let barriers: Vec<_> = images
            .into_iter()
            .map(|image| {
                vk::ImageMemoryBarrier::default()
                    .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)
                    .old_layout(vk::ImageLayout::UNDEFINED)
                    .new_layout(vk::ImageLayout::GENERAL)
                    .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .image(image.handle)
                    .subresource_range(image.range())
            })
            .collect();
        // SAFETY: recording, outside a render pass; the images are new.
        unsafe {
            self.context.device.cmd_pipeline_barrier(
                self.slot.commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &barriers,
            );
        }
    }

    /// Runs a kernel over `size` invocations (rounded up to whole workgroups), after a barrier.
    ///
    /// # Panics
    /// If the push constants have another size than the shader's block.
    pub fn dispatch<P: NoUninit>(
        &mut self,
        kernel: &ComputePipeline,
        group: &BindGroup,
        push: &P,
        size: [u32; 2],
    ) {
        self.bind_compute(kernel, group, push);
        let [x, y, _] = kernel.kernel.local_size;
        // SAFETY: recording; pipeline, set and push constants were just bound.
        unsafe {
            let groups = [size[0].div_ceil(x), size[1].div_ceil(y)];
            self.context.device.cmd_dispatch(self.slot.commands, groups[0], groups[1], 1);
        }
    }

    /// Runs a kernel over as many workgroups as the first three words of a buffer say, after a barrier.
    ///
    /// # Panics
    /// If the push constants have another size than the shader's block.
    pub fn dispatch_indirect<P: NoUninit>(
        &mut self,
        kernel: &ComputePipeline,
        group: &BindGroup,
        push: &P,
        groups: &Buffer,
    ) {
        self.bind_compute(kernel, group, push);
        // SAFETY: recording; pipeline, set and push constants were just bound; storage buffers are made to be read here
        // and hold at least 16 bytes.
        unsafe { self.context.device.cmd_dispatch_indirect(self.slot.commands, groups.handle, 0) };
    }

    fn bind_compute<P: NoUninit>(&mut self, kernel: &ComputePipeline, group: &BindGroup, push: &P) {
        self.barrier();
        let bytes = &bytes_of(push)[..kernel.kernel.push_bytes()];
        let (device, commands) = (&self.context.device, self.slot.commands);
        // SAFETY: recording; pipeline, layout and set are alive and were made from the same reflected table.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline.handle);
            device.cmd_bind_descriptor_sets(
                commands,
                vk::PipelineBindPoint::COMPUTE,
                kernel.pipeline.interface.layout,
                0,
                &[group.set],
                &[],
            );
            if !bytes.is_empty() {
                let stages = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(commands, kernel.pipeline.interface.layout, stages, 0, bytes);
            }
        }
    }

    /// Draws indexed triangles into an area, after a barrier. `draws` holds, in order, what to draw with which set 1.
    pub fn draw<P: NoUninit>(
        &mut self,
        attachments: &Attachments,
        area: RenderArea,
        batch: &DrawBatch<'_, P>,
    ) {
        self.barrier();
        let clears = vec![vk::ClearValue::default(); attachments.images().count()];
        let rect = vk::Rect2D {
            offset: vk::Offset2D { x: area.x as i32, y: area.y as i32 },
            extent: vk::Extent2D { width: area.width, height: area.height },
        };
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(attachments.render_pass)
            .framebuffer(attachments.framebuffer)
            .render_area(rect)
            .clear_values(&clears);
        let size = attachments.depth().spec().size;
        let viewport = vk::Viewport {
            width: size[0] as f32,
            height: size[1] as f32,
            max_depth: 1.0,
            ..Default::default()
        };
        let (device, commands) = (&self.context.device, self.slot.commands);
        // SAFETY: recording; all handles are alive; the area lies inside the framebuffer (the caller's plan).
        unsafe {
            device.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
            device.cmd_set_viewport(commands, 0, &[viewport]);
            device.cmd_set_scissor(commands, 0, &[rect]);
            device.cmd_bind_vertex_buffers(commands, 0, &[batch.vertices.handle], &[0]);
            device.cmd_bind_index_buffer(commands, batch.indices.handle, 0, vk::IndexType::UINT32);
        }
        for draw in batch.draws {
            self.draw_one(batch, draw);
        }
        // SAFETY: the render pass was begun above.
        unsafe { self.context.device.cmd_end_render_pass(self.slot.commands) };
    }

    fn draw_one<P: NoUninit>(&self, batch: &DrawBatch<'_, P>, draw: &DrawCall<'_>) {
        let (device, commands) = (&self.context.device, self.slot.commands);
        let interface = &draw.pipeline.pipeline.interface;
        let sets: Vec<_> = draw.groups.iter().map(|g| g.set).collect();
        // SAFETY: recording inside a render pass; sets and push constants match the pipeline's layout.
        unsafe {
            device.cmd_bind_pipeline(
                commands,
                vk::PipelineBindPoint::GRAPHICS,
                draw.pipeline.pipeline.handle,
            );
            let point = vk::PipelineBindPoint::GRAPHICS;
            if !sets.is_empty() {
                device.cmd_bind_descriptor_sets(commands, point, interface.layout, 0, &sets, &[]);
            }
            device.cmd_push_constants(commands, interface.layout, interface.stages, 0, bytes_of(batch.push));
            device.cmd_draw_indexed(commands, draw.index_count, 1, draw.first_index, 0, 0);
        }
    }

    /// Copies the first `bytes` of a buffer, after a barrier.
    ///
    /// # Panics
    /// If one of the buffers is smaller.
    pub fn copy_buffer(&mut self, from: &Buffer, to: &Buffer, bytes: u64) {
        assert!(
            bytes <= from.bytes().min(to.bytes()),
            "{bytes} bytes from {} to {}",
            from.bytes(),
            to.bytes()
        );
        self.barrier();
        let region = [vk::BufferCopy::default().size(bytes)];
        // SAFETY: recording; both buffers are alive, at least as large as `bytes` (just checked) and allow copies.
        unsafe { self.context.device.cmd_copy_buffer(self.slot.commands, from.handle, to.handle, &region) };
    }

    /// Copies a part of an image, from `offset` on, into a tightly packed buffer, layer by layer, after a barrier.
    ///
    /// # Panics
    /// If the part does not lie inside the image.
    pub fn copy_image_to_buffer(&mut self, from: &Image, offset: [u32; 2], size: [u32; 2], to: &Buffer) {
        let whole = from.spec().size;
        let inside = (0..2).all(|i| offset[i].checked_add(size[i]).is_some_and(|end| end <= whole[i]));
        assert!(inside, "{size:?} px from {offset:?} on of {whole:?}");
        self.barrier();
        let region = vk::BufferImageCopy::default()
            .image_subresource(all_layers(from))
            .image_offset(vk::Offset3D { x: offset[0] as i32, y: offset[1] as i32, z: 0 })
            .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 });
        self.image_to_buffer((from.handle, vk::ImageLayout::GENERAL), to, region);
    }

    /// Fills an image from a tightly packed buffer, layer by layer, after a barrier.
    pub fn copy_buffer_to_image(&mut self, from: &Buffer, to: &Image) {
        self.barrier();
        let size = to.spec().size;
        let region = vk::BufferImageCopy::default()
            .image_subresource(all_layers(to))
            .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 });
        self.buffer_to_image(from, (to.handle, vk::ImageLayout::GENERAL), region);
    }

    /// Copies an image of the host into a tightly packed buffer, after a barrier. It is found and left in its layouts.
    pub fn copy_shared_to_buffer(&mut self, from: &SharedImage, to: &Buffer) {
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        self.take_shared(from, layout);
        self.image_to_buffer((from.handle, layout), to, whole(from));
        self.leave_shared(from, layout);
    }

    /// Fills an image of the host from a tightly packed buffer, after a barrier.
    pub fn copy_buffer_to_shared(&mut self, from: &Buffer, to: &SharedImage) {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        self.take_shared(to, layout);
        self.buffer_to_image(from, (to.handle, layout), whole(to));
        self.leave_shared(to, layout);
    }

    fn image_to_buffer(
        &self,
        (from, layout): (vk::Image, vk::ImageLayout),
        to: &Buffer,
        region: vk::BufferImageCopy,
    ) {
        let (device, commands) = (&self.context.device, self.slot.commands);
        // SAFETY: recording; image and buffer are alive and the region lies inside both (the callers' sizes).
        unsafe { device.cmd_copy_image_to_buffer(commands, from, layout, to.handle, &[region]) };
    }

    fn buffer_to_image(
        &self,
        from: &Buffer,
        (to, layout): (vk::Image, vk::ImageLayout),
        region: vk::BufferImageCopy,
    ) {
        let (device, commands) = (&self.context.device, self.slot.commands);
        // SAFETY: as above.
        unsafe { device.cmd_copy_buffer_to_image(commands, from.handle, to, layout, &[region]) };
    }

    fn take_shared(&mut self, image: &SharedImage, layout: vk::ImageLayout) {
        let found = vk::ImageLayout::from_raw(image.spec().layout);
        self.hand_over(image, (found, layout), (vk::QUEUE_FAMILY_EXTERNAL, self.context.info().queue_family));
    }

    fn leave_shared(&mut self, image: &SharedImage, layout: vk::ImageLayout) {
        let left = vk::ImageLayout::from_raw(image.spec().layout_after);
        self.hand_over(image, (layout, left), (self.context.info().queue_family, vk::QUEUE_FAMILY_EXTERNAL));
    }

    /// An image from one layout to the next, and, if it has passed a file descriptor, from one owner to the next.
    fn hand_over(
        &mut self,
        image: &SharedImage,
        (from, to): (vk::ImageLayout, vk::ImageLayout),
        (owner, next): (u32, u32),
    ) {
        let (owner, next) = match image.external_queue() {
            true => (owner, next),
            false => (vk::QUEUE_FAMILY_IGNORED, vk::QUEUE_FAMILY_IGNORED),
        };
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(image.aspect()).level_count(1).layer_count(1);
        let barrier = vk::ImageMemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(owner)
            .dst_queue_family_index(next)
            .image(image.handle)
            .subresource_range(range);
        self.barrier();
        let stages = vk::PipelineStageFlags::ALL_COMMANDS;
        // SAFETY: recording, outside a render pass; the image is alive and in that layout (the host's promise).
        unsafe {
            self.context.device.cmd_pipeline_barrier(
                self.slot.commands,
                stages,
                stages,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &[barrier],
            );
        }
    }

    /// Fills a buffer with zeros, after a barrier.
    pub fn clear_buffer(&mut self, buffer: &Buffer) {
        self.barrier();
        // SAFETY: recording; the buffer is alive and allows copies; the whole size needs no alignment.
        unsafe {
            self.context.device.cmd_fill_buffer(self.slot.commands, buffer.handle, 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Fills an image with zeros, after a barrier.
    pub fn clear(&mut self, image: &Image) {
        self.barrier();
        let (layout, zero) = (vk::ImageLayout::GENERAL, vk::ClearColorValue::default());
        // SAFETY: recording; the image is a colour image that allows copies.
        unsafe {
            self.context.device.cmd_clear_color_image(
                self.slot.commands,
                image.handle,
                layout,
                &zero,
                &[image.range()],
            );
        }
    }
}

fn all_layers(image: &Image) -> vk::ImageSubresourceLayers {
    let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR);
    layers.layer_count(image.spec().layers)
}

/// All of a host's image; of depth and stencil, the depth.
fn whole(image: &SharedImage) -> vk::BufferImageCopy {
    let [width, height] = image.spec().size;
    let aspect = match image.aspect() {
        a if a.contains(vk::ImageAspectFlags::DEPTH) => vk::ImageAspectFlags::DEPTH,
        a => a,
    };
    vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers::default().aspect_mask(aspect).layer_count(1))
        .image_extent(vk::Extent3D { width, height, depth: 1 })
}

/// One indexed draw.
pub struct DrawCall<'a> {
    /// Pipeline.
    pub pipeline: &'a GraphicsPipeline,
    /// Sets 0, 1, ... in order.
    pub groups: Vec<&'a BindGroup>,
    /// First index.
    pub first_index: u32,
    /// Number of indices.
    pub index_count: u32,
}

/// Draws that share vertices, indices and push constants.
pub struct DrawBatch<'a, P> {
    /// Vertex buffer.
    pub vertices: &'a Buffer,
    /// Index buffer of u32.
    pub indices: &'a Buffer,
    /// Push constants of both stages.
    pub push: &'a P,
    /// The draws.
    pub draws: &'a [DrawCall<'a>],
}
