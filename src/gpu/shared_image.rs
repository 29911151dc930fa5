//! Images of the host: its own on its own device, or shared by opaque file descriptor. They are only ever copied from
//! and to, on the device; kernels work on pictures of the engine's.

use std::sync::Arc;

use ash::vk::{self, Handle as _};

use super::context::Context;
use super::failed;
use super::memory::Buffer;
use super::shared::{import_fd, refuse_small};
use crate::error::{Error, Result};

const FD: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;

/// What a [`SharedImage`] is: 2D, one layer, one mip level, one sample. Numbers are Vulkan's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedImageSpec {
    /// Width and height, px.
    pub size: [u32; 2],
    /// `VkFormat`, one of [`SharedFormat`]'s.
    pub format: i32,
    /// `VkImageLayout` in which a frame's work finds it.
    pub layout: i32,
    /// `VkImageLayout` in which a frame's work leaves it.
    pub layout_after: i32,
    /// `VkImageTiling`; of shared images only, as the host's own exist already.
    pub tiling: i32,
    /// `VkImageUsageFlags`; of shared images only.
    pub usage: u32,
}

/// How texels lie in a buffer once they are copied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SharedFormat {
    /// Four bytes: red, green, blue, alpha.
    Rgba8,
    /// Four bytes: blue, green, red, alpha.
    Bgra8,
    /// Four half floats.
    Rgba16f,
    /// Four floats.
    Rgba32f,
    /// One float; a depth image's depth too.
    R32f,
    /// Two half floats.
    Rg16f,
    /// Two floats.
    Rg32f,
}

impl SharedFormat {
    /// That of a `VkFormat`.
    pub fn of(format: i32) -> Option<Self> {
        Some(match vk::Format::from_raw(format) {
            vk::Format::R8G8B8A8_UNORM | vk::Format::R8G8B8A8_SRGB => Self::Rgba8,
            vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB => Self::Bgra8,
            vk::Format::R16G16B16A16_SFLOAT => Self::Rgba16f,
            vk::Format::R32G32B32A32_SFLOAT => Self::Rgba32f,
            vk::Format::R32_SFLOAT | vk::Format::D32_SFLOAT | vk::Format::D32_SFLOAT_S8_UINT => Self::R32f,
            vk::Format::R16G16_SFLOAT => Self::Rg16f,
            vk::Format::R32G32_SFLOAT => Self::Rg32f,
            _ => return None,
        })
    }
}

/// An image of the host.
pub struct SharedImage {
    pub(super) handle: vk::Image,
    spec: SharedImageSpec,
    format: SharedFormat,
    /// Null: the image is the host's own and stays.
    memory: vk::DeviceMemory,
    owned: bool,
    context: Arc<Context>,
}

impl Context {
    /// Whether images of this kind can be imported and exported by file descriptor.
    ///
    /// # Errors
    /// Out of memory.
    fn shares_image(&self, spec: &SharedImageSpec) -> Result<bool> {
        let mut external = vk::PhysicalDeviceExternalImageFormatInfo::default().handle_type(FD);
        let info = vk::PhysicalDeviceImageFormatInfo2::default()
            .format(vk::Format::from_raw(spec.format))
            .ty(vk::ImageType::TYPE_2D)
            .tiling(vk::ImageTiling::from_raw(spec.tiling))
            .usage(vk::ImageUsageFlags::from_raw(spec.usage))
            .push_next(&mut external);
        let mut found = vk::ExternalImageFormatProperties::default();
        let mut properties = vk::ImageFormatProperties2::default().push_next(&mut found);
        // SAFETY: core in Vulkan 1.1; the physical device belongs to the live instance.
        let asked = unsafe {
            self.root.instance.get_physical_device_image_format_properties2(
                self.info().physical,
                &info,
                &mut properties,
            )
        };
        let largest = properties.image_format_properties.max_extent;
        let features = found.external_memory_properties.external_memory_features;
        let both = vk::ExternalMemoryFeatureFlags::EXPORTABLE | vk::ExternalMemoryFeatureFlags::IMPORTABLE;
        match asked {
            Ok(()) => {}
            Err(vk::Result::ERROR_FORMAT_NOT_SUPPORTED) => return Ok(false),
            Err(error) => return Err(failed("vkGetPhysicalDeviceImageFormatProperties2")(error)),
        }
        Ok(features.contains(both) && spec.size[0] <= largest.width && spec.size[1] <= largest.height)
    }
}

impl SharedImage {
    /// The host's own image, of the very device that this context works on.
    ///
    /// # Safety
    /// `image` is a `VkImage` of the context's device and what `spec` says, was made with the usage that the copies
    /// need (`TRANSFER_SRC` for inputs, `TRANSFER_DST` for outputs), and outlives this and all work that uses it.
    ///
    /// # Errors
    /// A format that cannot be used.
    pub unsafe fn of_host(context: &Arc<Context>, image: u64, spec: SharedImageSpec) -> Result<Self> {
        Self::new(context, spec, vk::Image::from_raw(image), false)
    }

    /// An image in memory that another user of the same device exported, who made image and memory alike: same spec,
    /// dedicated allocation. The descriptor belongs to the driver from a successful call on.
    ///
    /// # Safety
    /// `fd` is an opaque descriptor of memory of `bytes` bytes that this very device and driver exported.
    ///
    /// # Errors
    /// A device that cannot; memory that is too small; a descriptor that the driver refuses; out of memory.
    pub unsafe fn import_fd(
        context: &Arc<Context>,
        spec: SharedImageSpec,
        fd: i32,
        bytes: u64,
    ) -> Result<Self> {
        let import = |fd: i32, taken: &mut dyn FnMut()| {
            let image = Self::external(context, spec)?;
            let needed = image.requirements().size;
            if bytes < needed {
                let what = "size of imported memory, bytes";
                let why = format!("an image of {}x{} px takes {needed} bytes", spec.size[0], spec.size[1]);
                return Err(Error::Limit { what, value: bytes, limit: needed, why });
            }
            refuse_small(fd, bytes)?;
            image.bind(bytes, &mut vk::ImportMemoryFdInfoKHR::default().handle_type(FD).fd(fd), taken)
        };
        // SAFETY: the caller's promise.
        unsafe { import_fd(fd, import) }
    }

    /// An image whose memory [`Self::export_fd`] hands out.
    ///
    /// # Errors
    /// A device that cannot; out of memory.
    pub fn exportable(context: &Arc<Context>, spec: SharedImageSpec) -> Result<Self> {
        let image = Self::external(context, spec)?;
        let bytes = image.requirements().size;
        image.bind(bytes, &mut vk::ExportMemoryAllocateInfo::default().handle_types(FD), &mut || ())
    }

    /// An opaque descriptor of an [`Self::exportable`] image's memory, which the caller closes, and its size in bytes.
    ///
    /// # Errors
    /// Out of memory, too many open files.
    pub fn export_fd(&self) -> Result<(i32, u64)> {
        let context = &self.context;
        let loader = ash::khr::external_memory_fd::Device::new(&context.root.instance, &context.device);
        let info = vk::MemoryGetFdInfoKHR::default().memory(self.memory).handle_type(FD);
        // SAFETY: the extension is enabled and the memory was allocated for export.
        let fd = unsafe { loader.get_memory_fd(&info) }.map_err(failed("vkGetMemoryFdKHR"))?;
        Ok((fd, self.requirements().size))
    }

    /// What it is.
    pub fn spec(&self) -> &SharedImageSpec {
        &self.spec
    }

    /// How its texels lie in a buffer.
    pub fn format(&self) -> SharedFormat {
        self.format
    }

    /// Whether it has passed a file descriptor: then it changes hands at each use.
    pub(super) fn external_queue(&self) -> bool {
        self.owned
    }

    pub(super) fn aspect(&self) -> vk::ImageAspectFlags {
        match vk::Format::from_raw(self.spec.format) {
            vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            vk::Format::D32_SFLOAT_S8_UINT => vk::ImageAspectFlags::DEPTH | vk::ImageAspectFlags::STENCIL,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }

    fn new(context: &Arc<Context>, spec: SharedImageSpec, handle: vk::Image, owned: bool) -> Result<Self> {
        let Some(format) = SharedFormat::of(spec.format) else {
            return Err(context.lacks(&format!("a use for images of VkFormat {}", spec.format)));
        };
        let memory = vk::DeviceMemory::null();
        Ok(Self { handle, spec, format, memory, owned, context: context.clone() })
    }

    fn external(context: &Arc<Context>, spec: SharedImageSpec) -> Result<Self> {
        if !context.sharing().memory_fd {
            return Err(context.lacks("VK_KHR_external_memory_fd (memory by file descriptor)"));
        }
        if SharedFormat::of(spec.format).is_none() || !context.shares_image(&spec)? {
            return Err(context.lacks(&format!(
                "images of VkFormat {}, {}x{} px, with that tiling and usage by file descriptor",
                spec.format, spec.size[0], spec.size[1]
            )));
        }
        let mut external = vk::ExternalMemoryImageCreateInfo::default().handle_types(FD);
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::from_raw(spec.format))
            .extent(vk::Extent3D { width: spec.size[0], height: spec.size[1], depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::from_raw(spec.tiling))
            .usage(vk::ImageUsageFlags::from_raw(spec.usage))
            .push_next(&mut external);
        // SAFETY: the device is alive; the driver has just said that it knows such images.
        let handle = unsafe { context.device.create_image(&info, None) }.map_err(failed("vkCreateImage"))?;
        context.name(handle, "shared");
        Self::new(context, spec, handle, true)
    }

    fn requirements(&self) -> vk::MemoryRequirements {
        // SAFETY: the image is this context's and alive.
        unsafe { self.context.device.get_image_memory_requirements(self.handle) }
    }

    /// Allocates as `how` says, for this image alone, and binds. `taken`: called when the driver has what `how` hands
    /// over.
    fn bind(
        mut self,
        bytes: u64,
        how: &mut impl vk::ExtendsMemoryAllocateInfo,
        taken: &mut dyn FnMut(),
    ) -> Result<Self> {
        let context = self.context.clone();
        let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().image(self.handle);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(bytes)
            .memory_type_index(self.requirements().memory_type_bits.trailing_zeros())
            .push_next(&mut dedicated)
            .push_next(how);
        context.count_allocation();
        // SAFETY: the device is alive; `info` and what it points to live through the call.
        let memory = unsafe { context.device.allocate_memory(&info, None) };
        self.memory = memory.map_err(failed("vkAllocateMemory"))?;
        taken();
        // SAFETY: the memory is fresh and was allocated for this image.
        let bound = unsafe { context.device.bind_image_memory(self.handle, self.memory, 0) };
        bound.map_err(failed("vkBindImageMemory"))?;
        Ok(self)
    }
}

impl Drop for SharedImage {
    fn drop(&mut self) {
        if self.owned && self.context.alive() {
            // SAFETY: slots wait for their work before what it uses is dropped; null memory is allowed.
            unsafe {
                self.context.device.destroy_image(self.handle, None);
                self.context.device.free_memory(self.memory, None);
            }
        }
    }
}

/// What a frame's picture or input is shared as.
#[derive(Clone)]
pub enum Shared {
    /// Bytes.
    Buffer(Arc<Buffer>),
    /// Texels.
    Image(Arc<SharedImage>),
}
