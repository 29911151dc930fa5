//! A host with a Vulkan instance, device and queue of its own, and images on it.
#![allow(dead_code, unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ffi::{CStr, c_char, c_void};

use ash::vk::{self, Handle as _};
use shutterbug::capi::shutterbug_host_device;

use super::capi_support::sized;

/// The host's Vulkan.
pub struct Host {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    pub queue: vk::Queue,
    pool: vk::CommandPool,
    /// Names of the enabled extensions.
    pub extensions: Vec<&'static CStr>,
}

impl Host {
    /// With those of the extensions that the device has. `None`: no device.
    pub fn new(wanted: &[&'static CStr]) -> Option<Self> {
        unsafe {
            let entry = ash::Entry::load().ok()?;
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&app);
            let instance = entry.create_instance(&info, None).ok()?;
            let Some(&physical) = instance.enumerate_physical_devices().ok()?.first() else {
                instance.destroy_instance(None);
                return None;
            };
            let families = instance.get_physical_device_queue_family_properties(physical);
            let graphics = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let family = families.iter().position(|f| f.queue_flags.contains(graphics))? as u32;
            let present = instance.enumerate_device_extension_properties(physical).unwrap();
            let has = |n: &CStr| present.iter().any(|e| e.extension_name_as_c_str() == Ok(n));
            let extensions: Vec<_> = wanted.iter().copied().filter(|n| has(n)).collect();
            let names: Vec<_> = extensions.iter().map(|n| n.as_ptr()).collect();
            let priorities = [1.0];
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&priorities)];
            let features = vk::PhysicalDeviceFeatures::default().shader_storage_image_extended_formats(true);
            let mut timeline =
                vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_features(&features)
                .enabled_extension_names(&names)
                .push_next(&mut timeline);
            let device = instance.create_device(physical, &info, None).ok()?;
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&info, None).unwrap();
            Some(Self { entry, instance, physical, device, family, queue, pool, extensions })
        }
    }

    /// What the library is told; `names` keeps what it points to.
    pub fn describe(&self, names: &mut Vec<*const c_char>) -> shutterbug_host_device {
        *names = self.extensions.iter().map(|n| n.as_ptr()).collect();
        let mut h: shutterbug_host_device = sized();
        h.queue_family = self.family;
        h.get_instance_proc_addr = self.entry.static_fn().get_instance_proc_addr as *const c_void;
        h.instance = self.instance.handle().as_raw() as *mut c_void;
        h.physical_device = self.physical.as_raw() as *mut c_void;
        h.device = self.device.handle().as_raw() as *mut c_void;
        h.queue = self.queue.as_raw() as *mut c_void;
        if !names.is_empty() {
            (h.extensions, h.extension_count) = (names.as_ptr(), names.len() as u32);
        }
        h
    }

    /// Runs commands and waits.
    pub fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        self.submit(record, &vk::SubmitInfo::default());
        unsafe { self.device.queue_wait_idle(self.queue) }.unwrap();
    }

    /// Hands commands to the queue, between the semaphores of `around`.
    pub fn submit(&self, record: impl FnOnce(vk::CommandBuffer), around: &vk::SubmitInfo<'_>) {
        unsafe {
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).unwrap();
            record(commands[0]);
            self.device.end_command_buffer(commands[0]).unwrap();
            let mut submit = *around;
            (submit.command_buffer_count, submit.p_command_buffers) = (1, commands.as_ptr());
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).unwrap();
        }
    }

    /// Memory of a kind for that; the first type that both allow.
    fn allocate(
        &self,
        bits: u32,
        bytes: u64,
        visible: bool,
        next: &mut impl vk::ExtendsMemoryAllocateInfo,
    ) -> vk::DeviceMemory {
        unsafe {
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let wanted = match visible {
                true => vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT,
                false => vk::MemoryPropertyFlags::empty(),
            };
            let fits = |i: &u32| {
                bits >> i & 1 == 1 && types.memory_types[*i as usize].property_flags.contains(wanted)
            };
            let of = (0..types.memory_type_count).find(fits).unwrap();
            let info = vk::MemoryAllocateInfo::default()
                .allocation_size(bytes)
                .memory_type_index(of)
                .push_next(next);
            self.device.allocate_memory(&info, None).unwrap()
        }
    }

    /// Bytes that both sides reach, filled.
    pub fn staging(&self, bytes: &[u8]) -> Staging<'_> {
        unsafe {
            let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
            let info = vk::BufferCreateInfo::default().size(bytes.len() as u64).usage(usage);
            let buffer = self.device.create_buffer(&info, None).unwrap();
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let memory = self.allocate(
                needs.memory_type_bits,
                needs.size,
                true,
                &mut vk::MemoryDedicatedAllocateInfo::default(),
            );
            self.device.bind_buffer_memory(buffer, memory, 0).unwrap();
            let mapped =
                self.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()).unwrap();
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped.cast(), bytes.len());
            Staging { host: self, buffer, memory, mapped: mapped.cast(), bytes: bytes.len() }
        }
    }

    /// An image in that layout, filled with `bytes`. `share`: its memory can be exported; then it is released to
    /// whoever imports it, in that layout.
    pub fn image(&self, spec: ImageSpec, bytes: &[u8], share: bool) -> HostImage<'_> {
        unsafe {
            let kind = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
            let mut external = vk::ExternalMemoryImageCreateInfo::default().handle_types(kind);
            let mut info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(spec.format)
                .extent(vk::Extent3D { width: spec.size[0], height: spec.size[1], depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(spec.usage);
            if share {
                info = info.push_next(&mut external);
            }
            let image = self.device.create_image(&info, None).unwrap();
            let needs = self.device.get_image_memory_requirements(image);
            let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().image(image);
            let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(kind);
            dedicated.p_next = if share { (&raw mut export).cast() } else { std::ptr::null() };
            let memory = self.allocate(needs.memory_type_bits, needs.size, false, &mut dedicated);
            self.device.bind_image_memory(image, memory, 0).unwrap();
            let image = HostImage { host: self, image, memory, bytes: needs.size, spec, shared: share };
            let staging = self.staging(bytes);
            let to = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            self.run(|c| {
                image.change(c, vk::ImageLayout::UNDEFINED, to);
                self.device.cmd_copy_buffer_to_image(c, staging.buffer, image.image, to, &[image.all()]);
                image.hand_over(c, to, spec.layout, (self.family, vk::QUEUE_FAMILY_EXTERNAL));
            });
            image
        }
    }

    /// Destroys everything; nothing made of it may be left.
    pub fn finish(self) {
        unsafe {
            self.device.device_wait_idle().expect("the host's device is alive");
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// A buffer of the host.
pub struct Staging<'h> {
    host: &'h Host,
    pub buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *mut u8,
    bytes: usize,
}

impl Staging<'_> {
    pub fn read(&self) -> Vec<u8> {
        unsafe { std::slice::from_raw_parts(self.mapped, self.bytes) }.to_vec()
    }
}

impl Drop for Staging<'_> {
    fn drop(&mut self) {
        unsafe {
            self.host.device.destroy_buffer(self.buffer, None);
            self.host.device.free_memory(self.memory, None);
        }
    }
}

#[derive(Clone, Copy)]
pub struct ImageSpec {
    pub size: [u32; 2],
    pub format: vk::Format,
    pub usage: vk::ImageUsageFlags,
    pub layout: vk::ImageLayout,
}

/// An image of the host.
pub struct HostImage<'h> {
    host: &'h Host,
    pub image: vk::Image,
    memory: vk::DeviceMemory,
    /// Of its memory.
    pub bytes: u64,
    pub spec: ImageSpec,
    shared: bool,
}

impl HostImage<'_> {
    fn aspect(&self) -> vk::ImageAspectFlags {
        match self.spec.format {
            vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }

    fn all(&self) -> vk::BufferImageCopy {
        let [width, height] = self.spec.size;
        vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default().aspect_mask(self.aspect()).layer_count(1),
            )
            .image_extent(vk::Extent3D { width, height, depth: 1 })
    }

    fn change(&self, commands: vk::CommandBuffer, from: vk::ImageLayout, to: vk::ImageLayout) {
        self.barrier(commands, from, to, (vk::QUEUE_FAMILY_IGNORED, vk::QUEUE_FAMILY_IGNORED));
    }

    /// A change of layout, and of owner if the image is shared.
    fn hand_over(
        &self,
        commands: vk::CommandBuffer,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
        owners: (u32, u32),
    ) {
        let none = (vk::QUEUE_FAMILY_IGNORED, vk::QUEUE_FAMILY_IGNORED);
        self.barrier(commands, from, to, if self.shared { owners } else { none });
    }

    fn barrier(
        &self,
        commands: vk::CommandBuffer,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
        owners: (u32, u32),
    ) {
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(self.aspect()).level_count(1).layer_count(1);
        let barrier = vk::ImageMemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(owners.0)
            .dst_queue_family_index(owners.1)
            .image(self.image)
            .subresource_range(range);
        let stages = vk::PipelineStageFlags::ALL_COMMANDS;
        let flags = vk::DependencyFlags::empty();
        unsafe {
            self.host.device.cmd_pipeline_barrier(commands, stages, stages, flags, &[], &[], &[barrier])
        };
    }

    /// What is in it, found in `layout` and left there.
    pub fn read(&self, layout: vk::ImageLayout, bytes: usize) -> Vec<u8> {
        let staging = self.host.staging(&vec![0; bytes]);
        let from = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        self.host.run(|c| unsafe {
            self.hand_over(c, layout, from, (vk::QUEUE_FAMILY_EXTERNAL, self.host.family));
            self.host.device.cmd_copy_image_to_buffer(c, self.image, from, staging.buffer, &[self.all()]);
            self.hand_over(c, from, layout, (self.host.family, vk::QUEUE_FAMILY_EXTERNAL));
        });
        staging.read()
    }

    /// A descriptor of its memory.
    pub fn export(&self) -> i32 {
        let loader = ash::khr::external_memory_fd::Device::new(&self.host.instance, &self.host.device);
        let info = vk::MemoryGetFdInfoKHR::default()
            .memory(self.memory)
            .handle_type(vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD);
        unsafe { loader.get_memory_fd(&info) }.unwrap()
    }
}

impl Drop for HostImage<'_> {
    fn drop(&mut self) {
        unsafe {
            self.host.device.destroy_image(self.image, None);
            self.host.device.free_memory(self.memory, None);
        }
    }
}
