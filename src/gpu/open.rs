//! Opening a device: one of our own, or the caller's. Whatever fails half way gives back what it had taken.

use std::ffi::{CStr, c_void};

use ash::vk::Handle as _;
use ash::{Entry, Instance, vk};

use super::failed;
use super::select::{self, DeviceInfo};
use crate::error::{Error, Result};

/// Extensions that let memory and semaphores pass between this library and its host. Enabled where they are present;
/// what needs an absent one says so.
const SHARING: [&CStr; 3] = [
    ash::khr::external_memory_fd::NAME,
    ash::ext::external_memory_host::NAME,
    ash::khr::external_semaphore_fd::NAME,
];

/// A `vkGetInstanceProcAddr` of the caller: everything else is looked up through it.
#[derive(Clone, Copy)]
pub struct Loader(vk::PFN_vkGetInstanceProcAddr);

impl Loader {
    /// # Safety
    /// `pointer` is a `vkGetInstanceProcAddr` (not null), which stays loaded as long as anything made through it lives.
    pub unsafe fn from_raw(pointer: *const c_void) -> Self {
        // SAFETY: the caller's promise; function and data pointers have the same size on all of Vulkan's platforms.
        Self(unsafe { std::mem::transmute::<*const c_void, vk::PFN_vkGetInstanceProcAddr>(pointer) })
    }

    pub(super) fn entry(self) -> Entry {
        let functions = ash::StaticFn { get_instance_proc_addr: self.0 };
        // SAFETY: the function is a `vkGetInstanceProcAddr` (see `from_raw`).
        unsafe { Entry::from_static_fn(functions) }
    }
}

/// A device with its queue, and what it can share.
pub(super) struct OpenDevice {
    pub(super) device: ash::Device,
    pub(super) queue: vk::Queue,
    /// Names of the enabled ones among [`SHARING`].
    pub(super) sharing: Vec<&'static CStr>,
    /// Whether timeline semaphores may be made.
    pub(super) timelines: bool,
    /// Whether it is destroyed with this; else it is the host's.
    pub(super) owned: bool,
}

impl OpenDevice {
    pub(super) fn create(instance: &Instance, info: &DeviceInfo) -> Result<Self> {
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(info.queue_family)
            .queue_priorities(&priorities)];
        // Every device has the first: an index that comes from the input and is wrong reads something of the same
        // buffer or zero, and writes nothing elsewhere.
        let features = vk::PhysicalDeviceFeatures::default()
            .robust_buffer_access(true)
            .shader_storage_image_extended_formats(true);
        // SAFETY: the physical device belongs to the live instance.
        let present = unsafe { instance.enumerate_device_extension_properties(info.physical) };
        let present = present.map_err(failed("vkEnumerateDeviceExtensionProperties"))?;
        let has = |name: &CStr| present.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let sharing: Vec<_> = SHARING.into_iter().filter(|name| has(name)).collect();
        let names: Vec<_> = sharing.iter().map(|name| name.as_ptr()).collect();
        // Of no use here unless they can be shared.
        let timelines = has(ash::khr::external_semaphore_fd::NAME) && has_timelines(instance, info);
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .enabled_extension_names(&names);
        if timelines {
            create = create.push_next(&mut timeline);
        }
        // SAFETY: `create` and all it points to live through the call; the features were checked by `select`.
        let device = unsafe { instance.create_device(info.physical, &create, None) };
        let device = device.map_err(failed("vkCreateDevice"))?;
        // SAFETY: the family and index are those that the device was created with.
        let queue = unsafe { device.get_device_queue(info.queue_family, 0) };
        Ok(Self { device, queue, sharing, timelines, owned: true })
    }
}

fn has_timelines(instance: &Instance, info: &DeviceInfo) -> bool {
    let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut timeline);
    // SAFETY: the physical device belongs to the live instance; core 1.1 call with a core 1.2 structure.
    unsafe { instance.get_physical_device_features2(info.physical, &mut features) };
    timeline.timeline_semaphore == vk::TRUE
}

impl Drop for OpenDevice {
    fn drop(&mut self) {
        if self.owned {
            // SAFETY: dropped by the context after everything made from the device, or before anything was.
            unsafe { self.device.destroy_device(None) };
        }
    }
}

/// A Vulkan device that belongs to the caller.
#[derive(Clone)]
pub struct HostDevice {
    loader: Loader,
    instance: vk::Instance,
    physical: vk::PhysicalDevice,
    device: vk::Device,
    queue: vk::Queue,
    queue_family: u32,
    sharing: Vec<&'static CStr>,
}

/// The handles of a [`HostDevice`], as numbers.
#[derive(Clone, Copy, Debug)]
pub struct HostHandles {
    /// `VkInstance`.
    pub instance: u64,
    /// `VkPhysicalDevice`.
    pub physical: u64,
    /// `VkDevice`.
    pub device: u64,
    /// `VkQueue`.
    pub queue: u64,
    /// Family of the queue.
    pub queue_family: u32,
}

impl HostDevice {
    /// `extensions`: names of the device extensions that the caller has enabled.
    ///
    /// # Safety
    /// All handles belong together, were made with at least Vulkan 1.2 and `shaderStorageImageExtendedFormats`, and
    /// outlive every context made of them. While a call of this library runs, nobody else uses the queue.
    pub unsafe fn new(loader: Loader, handles: HostHandles, extensions: &[String]) -> Self {
        let enabled = |name: &CStr| extensions.iter().any(|e| e.as_bytes() == name.to_bytes());
        Self {
            loader,
            instance: vk::Instance::from_raw(handles.instance),
            physical: vk::PhysicalDevice::from_raw(handles.physical),
            device: vk::Device::from_raw(handles.device),
            queue: vk::Queue::from_raw(handles.queue),
            queue_family: handles.queue_family,
            sharing: SHARING.into_iter().filter(|name| enabled(name)).collect(),
        }
    }

    pub(super) fn instance(&self) -> (Entry, Instance) {
        let entry = self.loader.entry();
        // SAFETY: the instance is alive and belongs to the loader (see `new`).
        let instance = unsafe { Instance::load(entry.static_fn(), self.instance) };
        (entry, instance)
    }

    pub(super) fn info(&self, instance: &Instance) -> Result<DeviceInfo> {
        let all = select::enumerate(instance)?;
        let Some(mut info) = all.into_iter().find(|d| d.physical == self.physical) else {
            let present = "other devices than the one given".to_owned();
            return Err(Error::NoDevice {
                wanted: "of the host's instance has that handle".to_owned(),
                present,
            });
        };
        // SAFETY: the physical device belongs to the live instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(self.physical) };
        let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = families.get(self.queue_family as usize);
        match family.filter(|f| f.queue_flags.contains(wanted)) {
            Some(family) => info.timestamp_valid_bits = family.timestamp_valid_bits,
            None => info.missing.push(format!("graphics and compute in queue family {}", self.queue_family)),
        }
        info.queue_family = self.queue_family;
        if info.missing.is_empty() {
            return Ok(info);
        }
        Err(Error::DeviceLacks { device: info.name, missing: info.missing })
    }

    pub(super) fn open(&self, instance: &Instance) -> OpenDevice {
        // SAFETY: the device is alive and was made from this instance (see `new`).
        let device = unsafe { ash::Device::load(instance.fp_v1_0(), self.device) };
        OpenDevice { device, queue: self.queue, sharing: self.sharing.clone(), timelines: true, owned: false }
    }
}
