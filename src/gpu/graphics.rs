//! Drawing: attachments with their render pass, and graphics pipelines.

use std::sync::Arc;

use ash::vk;

use super::bind::{BindGroup, Bound};
use super::context::{Context, MAIN};
use super::failed;
use super::kernel::{ShaderModule, specialization_entries};
use super::memory::{Format, Image, ImageSpec};
use super::pipeline::Pipeline;
use crate::error::Result;
use crate::kernels::Kernel;

/// Images that are drawn into together, cleared to zero at the start of each rendering (depth is reversed: zero is
/// infinitely far).
pub struct Attachments {
    pub(super) framebuffer: vk::Framebuffer,
    pub(super) render_pass: vk::RenderPass,
    colors: Vec<Image>,
    formats: Vec<Format>,
    depth: Image,
    context: Arc<Context>,
}

impl Attachments {
    /// Colour images of the given formats and one depth image.
    ///
    /// # Errors
    /// Out of memory; larger than the device allows.
    pub fn new(
        context: &Arc<Context>,
        name: &str,
        size: [u32; 2],
        samples: u32,
        formats: &[Format],
    ) -> Result<Self> {
        let image = |format: Format| {
            Image::new(context, &format!("{name} {format:?}"), ImageSpec::attachment(size, format, samples))
        };
        let colors = formats.iter().map(|&f| image(f)).collect::<Result<Vec<_>>>()?;
        let depth = image(Format::Depth32f)?;
        let mut attachments = Self {
            framebuffer: vk::Framebuffer::null(),
            render_pass: make_render_pass(context, formats, samples)?,
            colors,
            formats: formats.to_vec(),
            depth,
            context: context.clone(),
        };
        let views: Vec<_> = attachments.images().map(|i| i.view).collect();
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(attachments.render_pass)
            .attachments(&views)
            .width(size[0])
            .height(size[1])
            .layers(1);
        // SAFETY: pass and views are alive and agree in format, count and samples.
        let framebuffer = unsafe { context.device.create_framebuffer(&info, None) };
        attachments.framebuffer = framebuffer.map_err(failed("vkCreateFramebuffer"))?;
        Ok(attachments)
    }

    /// The colour images, in order.
    pub fn colors(&self) -> &[Image] {
        &self.colors
    }

    /// The depth image: near over distance, zero where nothing was drawn.
    pub fn depth(&self) -> &Image {
        &self.depth
    }

    /// All images, colours first.
    pub fn images(&self) -> impl Iterator<Item = &Image> {
        self.colors.iter().chain(std::iter::once(&self.depth))
    }
}

impl Drop for Attachments {
    fn drop(&mut self) {
        if !self.context.alive() {
            return;
        }
        // SAFETY: slots wait for their work before the resources they use are dropped; null handles are allowed.
        unsafe {
            self.context.device.destroy_framebuffer(self.framebuffer, None);
            self.context.device.destroy_render_pass(self.render_pass, None);
        }
    }
}

fn make_render_pass(context: &Context, formats: &[Format], samples: u32) -> Result<vk::RenderPass> {
    let all = formats.iter().copied().chain(std::iter::once(Format::Depth32f));
    let descriptions: Vec<_> = all
        .map(|format| {
            vk::AttachmentDescription::default()
                .format(format.vk())
                .samples(vk::SampleCountFlags::from_raw(samples))
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
                .initial_layout(vk::ImageLayout::GENERAL)
                .final_layout(vk::ImageLayout::GENERAL)
        })
        .collect();
    let reference =
        |i: usize| vk::AttachmentReference::default().attachment(i as u32).layout(vk::ImageLayout::GENERAL);
    let colors: Vec<_> = (0..formats.len()).map(reference).collect();
    let depth = reference(formats.len());
    let subpass = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&colors)
        .depth_stencil_attachment(&depth)];
    let info = vk::RenderPassCreateInfo::default().attachments(&descriptions).subpasses(&subpass);
    // SAFETY: the device is alive and `info` is complete. Dependencies are the recorder's global barriers.
    unsafe { context.device.create_render_pass(&info, None) }.map_err(failed("vkCreateRenderPass"))
}

/// What the vertex buffer holds: offset and number of floats (or one unsigned integer) by location.
#[derive(Clone, Copy, Debug)]
pub struct VertexFormat {
    /// Bytes from one vertex to the next.
    pub stride: u32,
    /// `(offset, components)` by location; components 0 means one u32.
    pub attributes: &'static [(u32, u32)],
}

/// What a graphics pipeline is made of.
pub struct GraphicsSpec {
    /// Vertex shader.
    pub vertex: &'static Kernel,
    /// Fragment shader.
    pub fragment: &'static Kernel,
    /// Specialization constants 0, 1, ... of both stages.
    pub constants: Vec<u32>,
    /// Layout of the vertex buffer.
    pub format: VertexFormat,
    /// Samples a pixel.
    pub samples: u32,
}

/// A pipeline that draws triangles, both sides, nearest wins.
pub struct GraphicsPipeline {
    pub(super) pipeline: Pipeline,
}

impl GraphicsPipeline {
    /// Builds the pipeline for attachments of this kind.
    ///
    /// # Errors
    /// Out of memory, or a driver that refuses the shaders.
    pub fn new(context: &Arc<Context>, attachments: &Attachments, spec: &GraphicsSpec) -> Result<Self> {
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let kernels: (&[_], _) = (&[spec.vertex, spec.fragment], stages);
        let make = |layout| make_pipeline(context, attachments, spec, layout);
        let pipeline = Pipeline::of(context, kernels, state(attachments, spec), make)?;
        Ok(Self { pipeline })
    }

    /// Binds the resources of one descriptor set by name.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, set: u32, resources: &[(&str, Bound<'_>)]) -> Result<BindGroup> {
        BindGroup::new(&self.pipeline.context, &self.pipeline.interface, set, resources)
    }
}

/// All that a pipeline depends on besides its kernels.
fn state(attachments: &Attachments, spec: &GraphicsSpec) -> Vec<u32> {
    let attributes = spec.format.attributes;
    let counts =
        [spec.samples, spec.format.stride, attributes.len() as u32, attachments.formats.len() as u32];
    let pairs = attributes.iter().flat_map(|(offset, components)| [*offset, *components]);
    let formats = attachments.formats.iter().map(|f| f.vk().as_raw() as u32);
    counts.into_iter().chain(pairs).chain(formats).chain(spec.constants.iter().copied()).collect()
}

fn make_pipeline(
    context: &Arc<Context>,
    attachments: &Attachments,
    spec: &GraphicsSpec,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let (vertex, fragment) =
        (ShaderModule::new(context, spec.vertex)?, ShaderModule::new(context, spec.fragment)?);
    let entries = specialization_entries(spec.constants.len());
    let constants =
        vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&spec.constants));
    let stage = |flag, module: &ShaderModule| {
        vk::PipelineShaderStageCreateInfo::default().stage(flag).module(module.handle).name(MAIN)
    };
    let stages = [
        stage(vk::ShaderStageFlags::VERTEX, &vertex).specialization_info(&constants),
        stage(vk::ShaderStageFlags::FRAGMENT, &fragment).specialization_info(&constants),
    ];
    let buffers = [vk::VertexInputBindingDescription::default().stride(spec.format.stride)];
    let attributes = vertex_attributes(&spec.format);
    let input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_binding_descriptions(&buffers)
        .vertex_attribute_descriptions(&attributes);
    let assembly =
        vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
    let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .cull_mode(vk::CullModeFlags::NONE)
        .line_width(1.0);
    let samples = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::from_raw(spec.samples));
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(true)
        .depth_write_enable(true)
        .depth_compare_op(vk::CompareOp::GREATER);
    let write =
        vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
    let blends = vec![write; attachments.colors.len()];
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
    let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
    let info = vk::GraphicsPipelineCreateInfo::default()
        .stages(&stages)
        .vertex_input_state(&input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout)
        .render_pass(attachments.render_pass);
    // SAFETY: all handles are alive; the layout comes from the reflected table of both stages.
    let made = unsafe { context.device.create_graphics_pipelines(context.pipeline_cache, &[info], None) };
    let handle = made.map_err(|(_, e)| failed("vkCreateGraphicsPipelines")(e))?[0];
    context.name(handle, spec.vertex.file);
    Ok(handle)
}

fn vertex_attributes(format: &VertexFormat) -> Vec<vk::VertexInputAttributeDescription> {
    let with_location = (0..).zip(format.attributes);
    with_location
        .map(|(location, &(offset, components))| {
            let format = match components {
                0 => vk::Format::R32_UINT,
                2 => vk::Format::R32G32_SFLOAT,
                3 => vk::Format::R32G32B32_SFLOAT,
                4 => vk::Format::R32G32B32A32_SFLOAT,
                n => panic!("no vertex attribute has {n} components"),
            };
            vk::VertexInputAttributeDescription::default().location(location).offset(offset).format(format)
        })
        .collect()
}
