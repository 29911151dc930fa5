//! Buffers, images and samplers, with memory from gpu-allocator.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::context::{Context, allocation_failed};
use super::failed;
use crate::error::{Error, Result};

/// Where a buffer lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// The device's own memory.
    Device,
    /// Mapped for good, written by the host, read by the device.
    Upload,
    /// Mapped for good in cached memory, written by the device, read by the host.
    Readback,
}

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usage {
    /// Storage buffer (and copy source or target, and size of an indirect dispatch).
    Storage,
    /// Uniform buffer.
    Uniform,
    /// Texels of four words, fetched by kernels.
    Texels,
    /// [`Self::Storage`] whose words are texels too, if the device has as many (see [`Buffer::has_texels`]): a software
    /// device fetches a texel for all lanes at once, and a word of a storage buffer lane by lane.
    StorageTexels,
    /// Vertex buffer.
    Vertex,
    /// Vertex buffer whose words are texels too, as those of [`Self::StorageTexels`].
    VertexTexels,
    /// Vertex buffer that kernels read or write.
    StorageVertex,
    /// Index buffer.
    Index,
    /// Copy source or target only.
    Transfer,
}

/// Bytes of a texel of [`Usage::Texels`], [`Usage::StorageTexels`] and [`Usage::VertexTexels`].
const TEXEL_BYTES: u64 = 16;

/// A buffer and its memory.
pub struct Buffer {
    pub(super) handle: vk::Buffer,
    /// Of the usages with texels: all of it as texels; else null.
    pub(super) view: vk::BufferView,
    pub(super) bytes: u64,
    allocation: Option<Allocation>,
    /// Memory that is shared with the host (`shared.rs`) instead of the allocator's.
    pub(super) shared: vk::DeviceMemory,
    pub(super) context: Arc<Context>,
}

impl Usage {
    /// As Vulkan says it. Everything can be copied.
    fn flags(self) -> vk::BufferUsageFlags {
        let copies = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        match self {
            Self::Storage => {
                vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER | copies
            }
            Self::Uniform => vk::BufferUsageFlags::UNIFORM_BUFFER | copies,
            Self::Texels => vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER | copies,
            Self::StorageTexels => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                    | copies
            }
            Self::Vertex => vk::BufferUsageFlags::VERTEX_BUFFER | copies,
            Self::VertexTexels => {
                vk::BufferUsageFlags::VERTEX_BUFFER
                    | vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                    | copies
            }
            Self::StorageVertex => {
                vk::BufferUsageFlags::VERTEX_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER | copies
            }
            Self::Index => vk::BufferUsageFlags::INDEX_BUFFER | copies,
            Self::Transfer => copies,
        }
    }
}

impl Buffer {
    /// A buffer of `bytes` (at least 16 are allocated, as Vulkan has no empty buffers).
    ///
    /// # Errors
    /// Out of memory; more bytes than a storage buffer may have.
    pub fn new(
        context: &Arc<Context>,
        name: &str,
        bytes: u64,
        usage: Usage,
        location: Location,
    ) -> Result<Self> {
        let bytes = bytes.max(16);
        let limit = context.info().max_storage_buffer_bytes;
        let texels_too = matches!(usage, Usage::StorageTexels | Usage::VertexTexels);
        let stored = texels_too || matches!(usage, Usage::Storage | Usage::StorageVertex);
        if stored && bytes > limit {
            let why = format!("maxStorageBufferRange of {}", context.info().name);
            return Err(Error::Limit { what: "size of a storage buffer, bytes", value: bytes, limit, why });
        }
        let (texels, limit) = (bytes / TEXEL_BYTES, context.info().max_texels);
        if usage == Usage::Texels && texels > limit {
            let why = format!("maxTexelBufferElements of {}", context.info().name);
            return Err(Error::Limit { what: "texels of a buffer", value: texels, limit, why });
        }
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage.flags());
        // SAFETY: the device is alive and `info` is complete.
        let handle =
            unsafe { context.device.create_buffer(&info, None) }.map_err(failed("vkCreateBuffer"))?;
        context.name(handle, name);
        let mut buffer = Self::without_memory(context, handle, bytes);
        // SAFETY: the buffer was just made by this device.
        let requirements = unsafe { context.device.get_buffer_memory_requirements(handle) };
        let location = match location {
            Location::Device => MemoryLocation::GpuOnly,
            Location::Upload => MemoryLocation::CpuToGpu,
            Location::Readback => MemoryLocation::GpuToCpu,
        };
        let allocation = allocate(context, name, requirements, location, true)?;
        // SAFETY: the memory is fresh and fits the buffer's requirements.
        let bound =
            unsafe { context.device.bind_buffer_memory(handle, allocation.memory(), allocation.offset()) };
        buffer.allocation = Some(allocation);
        bound.map_err(failed("vkBindBufferMemory"))?;
        if usage == Usage::Texels || (texels_too && texels <= limit) {
            buffer.view = buffer.make_view()?;
        }
        Ok(buffer)
    }

    /// Whether kernels can fetch its texels.
    pub fn has_texels(&self) -> bool {
        self.view != vk::BufferView::null()
    }

    fn make_view(&self) -> Result<vk::BufferView> {
        let info = vk::BufferViewCreateInfo::default()
            .buffer(self.handle)
            .format(vk::Format::R32G32B32A32_UINT)
            .range(self.bytes / TEXEL_BYTES * TEXEL_BYTES);
        // SAFETY: the buffer is bound to memory and was made for texels, whose format every device can fetch.
        unsafe { self.context.device.create_buffer_view(&info, None) }.map_err(failed("vkCreateBufferView"))
    }

    pub(super) fn without_memory(context: &Arc<Context>, handle: vk::Buffer, bytes: u64) -> Self {
        let (view, shared) = (vk::BufferView::null(), vk::DeviceMemory::null());
        Self { handle, view, bytes, allocation: None, shared, context: context.clone() }
    }

    /// Size, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes values at a byte offset of mapped memory. The device must not be using that range.
    ///
    /// # Panics
    /// If the range lies outside or the buffer is not mapped.
    pub fn write<T: Pod>(&mut self, offset: usize, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let mapped =
            self.allocation.as_mut().and_then(|a| a.mapped_slice_mut()).expect("an upload buffer is mapped");
        mapped[offset..offset + bytes.len()].copy_from_slice(bytes);
    }

    /// The mapped bytes. The device must have finished writing them.
    ///
    /// # Panics
    /// If the buffer is not mapped.
    pub fn mapped(&self) -> &[u8] {
        let mapped =
            self.allocation.as_ref().and_then(|a| a.mapped_slice()).expect("a readback buffer is mapped");
        &mapped[..self.bytes as usize]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if !self.context.alive() {
            return;
        }
        // SAFETY: slots wait for their work before the resources they use are dropped.
        unsafe {
            self.context.device.destroy_buffer_view(self.view, None);
            self.context.device.destroy_buffer(self.handle, None);
            self.context.device.free_memory(self.shared, None);
        }
        free(&self.context, self.allocation.take());
    }
}

fn allocate(
    context: &Context,
    name: &str,
    requirements: vk::MemoryRequirements,
    location: MemoryLocation,
    linear: bool,
) -> Result<Allocation> {
    let desc = AllocationCreateDesc {
        name,
        requirements,
        location,
        linear,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    };
    context.count_allocation();
    context.with_allocator(|a| a.allocate(&desc)).map_err(|e| allocation_failed(&e))
}

fn free(context: &Context, allocation: Option<Allocation>) {
    let Some(allocation) = allocation else { return };
    if let Err(error) = context.with_allocator(|a| a.free(allocation)) {
        tracing::error!("memory could not be freed: {error}");
    }
}

/// Format of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Linear colour, half floats.
    Rgba16f,
    /// Linear colour, floats.
    Rgba32f,
    /// Motion, px.
    Rg32f,
    /// Two words.
    Rg32ui,
    /// One float.
    R32f,
    /// Depth attachment.
    Depth32f,
    /// sRGB texture, decoded when it is read.
    Rgba8Srgb,
    /// Linear colour from 0 to 1, 8 bits a channel.
    Rgba8,
}

impl Format {
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
            Self::Rg32f => vk::Format::R32G32_SFLOAT,
            Self::Rg32ui => vk::Format::R32G32_UINT,
            Self::R32f => vk::Format::R32_SFLOAT,
            Self::Depth32f => vk::Format::D32_SFLOAT,
            Self::Rgba8Srgb => vk::Format::R8G8B8A8_SRGB,
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
        }
    }

    /// Bytes a texel.
    pub fn texel_bytes(self) -> u64 {
        match self {
            Self::Rgba16f | Self::Rg32f | Self::Rg32ui => 8,
            Self::Rgba32f => 16,
            Self::R32f | Self::Depth32f | Self::Rgba8Srgb | Self::Rgba8 => 4,
        }
    }
}

/// What an image is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSpec {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Layers; more than one makes it a 2D array.
    pub layers: u32,
    /// Always viewed as a 2D array, even with one layer.
    pub array: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// Format.
    pub format: Format,
    /// Drawn into.
    pub attachment: bool,
    /// Read and written by texel in kernels.
    pub storage: bool,
}

impl ImageSpec {
    /// A storage image of one layer and sample.
    pub fn storage(size: [u32; 2], format: Format) -> Self {
        Self { size, layers: 1, array: false, samples: 1, format, attachment: false, storage: true }
    }

    /// An attachment with this number of samples, which kernels read.
    pub fn attachment(size: [u32; 2], format: Format, samples: u32) -> Self {
        Self { size, layers: 1, array: false, samples, format, attachment: true, storage: false }
    }
}

/// An image, its memory, and one view of all of it. Stays in layout `GENERAL` (textures too: one rule for all).
pub struct Image {
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    spec: ImageSpec,
    allocation: Option<Allocation>,
    context: Arc<Context>,
}

impl Image {
    /// An image with undefined content; it must be named in [`super::Recorder::prepare`] once before it is used.
    ///
    /// # Errors
    /// Out of memory; larger than the device allows.
    pub fn new(context: &Arc<Context>, name: &str, spec: ImageSpec) -> Result<Self> {
        let info = context.info();
        let (limit, limit_name) = match spec.attachment {
            true => (info.max_attachment_side_px, "maxFramebufferWidth, maxFramebufferHeight"),
            false => (info.max_image_side_px, "maxImageDimension2D"),
        };
        if let Some(&side) = spec.size.iter().find(|&&s| s > limit || s == 0) {
            let why = format!("{limit_name} of {}; margin and supersampling included", info.name);
            return Err(Error::Limit {
                what: "side of an image, px",
                value: side.into(),
                limit: limit.into(),
                why,
            });
        }
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(spec.format.vk())
            .extent(vk::Extent3D { width: spec.size[0], height: spec.size[1], depth: 1 })
            .mip_levels(1)
            .array_layers(spec.layers)
            .samples(vk::SampleCountFlags::from_raw(spec.samples))
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage_flags(&spec));
        // SAFETY: the device is alive, sizes were checked, formats and sample counts by `select`.
        let handle = unsafe { context.device.create_image(&info, None) }.map_err(failed("vkCreateImage"))?;
        context.name(handle, name);
        let mut image =
            Self { handle, view: vk::ImageView::null(), spec, allocation: None, context: context.clone() };
        // SAFETY: the image was just made by this device.
        let requirements = unsafe { context.device.get_image_memory_requirements(handle) };
        let allocation = allocate(context, name, requirements, MemoryLocation::GpuOnly, false)?;
        // SAFETY: the memory is fresh and fits the image's requirements.
        let bound =
            unsafe { context.device.bind_image_memory(handle, allocation.memory(), allocation.offset()) };
        image.allocation = Some(allocation);
        bound.map_err(failed("vkBindImageMemory"))?;
        image.view = image.make_view()?;
        Ok(image)
    }

    /// What it was made as.
    pub fn spec(&self) -> &ImageSpec {
        &self.spec
    }

    pub(super) fn range(&self) -> vk::ImageSubresourceRange {
        let aspect = match self.spec.format {
            Format::Depth32f => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        };
        vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(self.spec.layers)
    }

    fn make_view(&self) -> Result<vk::ImageView> {
        let array = self.spec.array || self.spec.layers > 1;
        let info = vk::ImageViewCreateInfo::default()
            .image(self.handle)
            .view_type(if array { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D })
            .format(self.spec.format.vk())
            .subresource_range(self.range());
        // SAFETY: the image is bound to memory and alive.
        unsafe { self.context.device.create_image_view(&info, None) }.map_err(failed("vkCreateImageView"))
    }
}

fn usage_flags(spec: &ImageSpec) -> vk::ImageUsageFlags {
    let mut usage = vk::ImageUsageFlags::SAMPLED;
    if spec.samples == 1 {
        usage |= vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
    }
    if spec.storage {
        usage |= vk::ImageUsageFlags::STORAGE;
    }
    if spec.attachment {
        usage |= match spec.format {
            Format::Depth32f => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            _ => vk::ImageUsageFlags::COLOR_ATTACHMENT,
        };
    }
    usage
}

impl Drop for Image {
    fn drop(&mut self) {
        if !self.context.alive() {
            return;
        }
        // SAFETY: slots wait for their work before the resources they use are dropped; null views are allowed.
        unsafe {
            self.context.device.destroy_image_view(self.view, None);
            self.context.device.destroy_image(self.handle, None);
        }
        free(&self.context, self.allocation.take());
    }
}

/// How images are read: bilinear and repeating, bilinear with positions in texels, or by texel.
pub struct Sampler {
    pub(super) handle: vk::Sampler,
    context: Arc<Context>,
}

/// Largest level of detail of samplers. All images have one level, so it changes nothing but this: lavapipe 22.3
/// compiles code that looks up the level of every lane, a third of a bilinear reading, unless the sampler allows a
/// level above 0. (`texelFetch` of an image always has that code, and a sampler in texels may not allow such a level.)
const ONE_LEVEL: f32 = 1.0;

/// A sampler that does the same along all axes.
fn sampling(filter: vk::Filter, mode: vk::SamplerAddressMode) -> vk::SamplerCreateInfo<'static> {
    vk::SamplerCreateInfo::default()
        .mag_filter(filter)
        .min_filter(filter)
        .address_mode_u(mode)
        .address_mode_v(mode)
        .address_mode_w(mode)
}

impl Sampler {
    /// `linear`: bilinear and repeating in both directions; else nearest and clamped, for `texelFetch`.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, linear: bool) -> Result<Self> {
        let info = match linear {
            true => sampling(vk::Filter::LINEAR, vk::SamplerAddressMode::REPEAT),
            false => sampling(vk::Filter::NEAREST, vk::SamplerAddressMode::CLAMP_TO_EDGE),
        };
        Self::from_info(context, &info.max_lod(ONE_LEVEL))
    }

    /// Bilinear between texels, with positions as shares of the image's sides, held at the outermost texels.
    ///
    /// # Errors
    /// Out of memory.
    pub fn in_shares(context: &Arc<Context>) -> Result<Self> {
        let info = sampling(vk::Filter::LINEAR, vk::SamplerAddressMode::CLAMP_TO_EDGE);
        Self::from_info(context, &info.max_lod(ONE_LEVEL))
    }

    /// Bilinear between texels, with positions in texels (the first one's centre at 0.5), held at the outermost ones.
    ///
    /// # Errors
    /// Out of memory.
    pub fn in_texels(context: &Arc<Context>) -> Result<Self> {
        let info = sampling(vk::Filter::LINEAR, vk::SamplerAddressMode::CLAMP_TO_EDGE);
        Self::from_info(context, &info.unnormalized_coordinates(true))
    }

    fn from_info(context: &Arc<Context>, info: &vk::SamplerCreateInfo<'_>) -> Result<Self> {
        // SAFETY: the device is alive and `info` is complete.
        let handle =
            unsafe { context.device.create_sampler(info, None) }.map_err(failed("vkCreateSampler"))?;
        Ok(Self { handle, context: context.clone() })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        if self.context.alive() {
            // SAFETY: slots wait for their work before the resources they use are dropped.
            unsafe { self.context.device.destroy_sampler(self.handle, None) };
        }
    }
}
