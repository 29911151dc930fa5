//! Instance, device, queue and allocator.

use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::ext::debug_utils;
use ash::{Entry, Instance, vk};
use gpu_allocator::AllocationSizes;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::failed;
use super::instance::{self, Opened};
use super::open::{HostDevice, Loader, OpenDevice};
use super::pipelines::Pipelines;
use super::select::{self, DeviceChoice, DeviceInfo};
use super::validation::{Messenger, Validation};
use crate::error::{Error, Result};

/// How to make a [`Context`].
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// Which device.
    pub device: DeviceChoice,
    /// Whether the validation layer watches.
    pub validation: Validation,
}

/// The one holder of instance, device, queue and allocator.
pub struct Context {
    pub(super) device: ash::Device,
    pub(super) pipeline_cache: vk::PipelineCache,
    queue: Mutex<vk::Queue>,
    allocator: Mutex<Option<Allocator>>,
    pub(super) pipelines: Pipelines,
    names: Option<debug_utils::Device>,
    info: DeviceInfo,
    abandoned: AtomicBool,
    allocations: AtomicU64,
    pub(super) open: ManuallyDrop<OpenDevice>,
    pub(super) root: ManuallyDrop<Root>,
}

/// What lives longest, in one place because it is destroyed together (or leaked together after `abandon`).
pub(super) struct Root {
    pub(super) instance: Instance,
    /// Whether the instance is destroyed with this; else it is the process's or the host's.
    owned: bool,
    messenger: Option<Messenger>,
    _entry: Entry,
}

impl Context {
    /// Opens a device.
    ///
    /// # Errors
    /// No loader, no (matching) device, a device that lacks something, no validation layer where it is required.
    pub fn new(options: &ContextOptions) -> Result<Arc<Self>> {
        Self::on_instance(instance::shared(options.validation)?, options)
    }

    /// Opens a device with the caller's Vulkan loader (statically linked, or a layer).
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_loader(loader: Loader, options: &ContextOptions) -> Result<Arc<Self>> {
        Self::on_instance(instance::own(loader.entry(), options.validation)?, options)
    }

    fn on_instance(opened: Opened, options: &ContextOptions) -> Result<Arc<Self>> {
        let root = Root::new(opened, options.validation)?;
        let all = select::enumerate(&root.instance)?;
        instance::note(&all);
        let info = options.device.pick(&all)?;
        let device = OpenDevice::create(&root.instance, &info)?;
        Self::assemble(root, device, info)
    }

    /// Works on a device that the caller has made and keeps: nothing of it is destroyed here.
    ///
    /// # Errors
    /// A device that lacks something; out of memory.
    pub fn on_host_device(host: &HostDevice) -> Result<Arc<Self>> {
        let (entry, instance) = host.instance();
        let info = host.info(&instance)?;
        let root = Root { instance, messenger: None, owned: false, _entry: entry };
        let device = host.open(&root.instance);
        Self::assemble(root, device, info)
    }

    fn assemble(root: Root, open: OpenDevice, info: DeviceInfo) -> Result<Arc<Self>> {
        // From here on `open` and `root` destroy what they own if anything fails.
        let device = open.device.clone();
        let cache_info = vk::PipelineCacheCreateInfo::default();
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: root.instance.clone(),
            device: device.clone(),
            physical_device: info.physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            // Small first blocks: an embedded sensor must not take 256 MiB of a host's GPU for a 320x240 picture.
            allocation_sizes: AllocationSizes::new(32 << 20, 16 << 20)
                .with_max_device_memblock_size(256 << 20)
                .with_max_host_memblock_size(64 << 20),
        });
        let allocator = allocator.map_err(|e| allocation_failed(&e))?;
        // SAFETY: the device is alive.
        let pipeline_cache = unsafe { device.create_pipeline_cache(&cache_info, None) };
        let names = root.messenger.as_ref().map(|_| debug_utils::Device::new(&root.instance, &device));
        let context = Self {
            pipeline_cache: pipeline_cache.map_err(failed("vkCreatePipelineCache"))?,
            queue: Mutex::new(open.queue),
            allocator: Mutex::new(Some(allocator)),
            names,
            pipelines: Pipelines::default(),
            info,
            abandoned: AtomicBool::new(false),
            allocations: AtomicU64::new(0),
            open: ManuallyDrop::new(open),
            root: ManuallyDrop::new(root),
            device,
        };
        Ok(Arc::new(context))
    }

    /// What the device is and can do.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Whether the device is the caller's: then the caller's own Vulkan objects can be used as they are.
    pub fn is_host_device(&self) -> bool {
        !self.open.owned
    }

    /// What the validation layer has reported since this context was made, of all contexts of the process that it
    /// watches; always empty when it is off.
    pub fn validation_messages(&self) -> Vec<String> {
        self.root.messenger.as_ref().map_or_else(Vec::new, |m| m.messages.all())
    }

    /// How many pieces of memory, pipelines and descriptor sets have been made so far. Between two frames of a steady
    /// state it does not change.
    pub fn allocation_count(&self) -> u64 {
        self.allocations.load(Ordering::Relaxed)
    }

    pub(super) fn count_allocation(&self) {
        self.allocations.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn with_allocator<T>(&self, f: impl FnOnce(&mut Allocator) -> T) -> T {
        let mut guard = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        f(guard.as_mut().expect("the allocator lives as long as the context"))
    }

    /// Work is stuck on the device: from now on nothing is destroyed, as destroying what is in use is undefined and
    /// waiting for it might block for ever. The process leaks what this context held.
    pub(super) fn abandon(&self) {
        self.abandoned.store(true, Ordering::Release);
        tracing::error!("the device {} does not finish its work; its resources are leaked", self.info.name);
    }

    /// Whether handles may still be destroyed.
    pub(super) fn alive(&self) -> bool {
        !self.abandoned.load(Ordering::Acquire)
    }

    /// Gives a handle its name in captures and validation messages.
    pub(super) fn name<H: vk::Handle>(&self, handle: H, name: &str) {
        let Some(names) = &self.names else { return };
        let Ok(name) = std::ffi::CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle was made by this device and is alive. A name that could not be set changes nothing else.
        let _ = unsafe { names.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        if !self.alive() {
            return;
        }
        drop(self.allocator.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        // SAFETY: every wrapper holds an `Arc` of this context, so all other handles are gone; slots have waited for
        // their work. The order is the reverse of creation.
        unsafe {
            self.pipelines.destroy(&self.device);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            ManuallyDrop::drop(&mut self.open);
            ManuallyDrop::drop(&mut self.root);
        }
    }
}

impl Root {
    fn new(opened: Opened, validation: Validation) -> Result<Self> {
        let Opened { entry, instance, owned } = opened;
        // From here on a messenger that cannot be made does not leave an instance of its own behind.
        let mut root = Self { instance, messenger: None, owned, _entry: entry };
        if validation == Validation::Required {
            root.messenger = Some(Messenger::new(&root._entry, &root.instance)?);
        }
        Ok(root)
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        if let Some(messenger) = &self.messenger {
            messenger.destroy();
        }
        if self.owned {
            // SAFETY: the device and the messenger, the only children, are gone.
            unsafe { self.instance.destroy_instance(None) };
        }
    }
}

pub(super) fn allocation_failed(error: &gpu_allocator::AllocationError) -> Error {
    match error {
        gpu_allocator::AllocationError::OutOfMemory => {
            Error::OutOfMemory { pool: "device", call: "vkAllocateMemory" }
        }
        // The allocator keeps no code. Vulkan has only lack of memory and of addresses as causes.
        gpu_allocator::AllocationError::FailedToMap(_) => {
            Error::OutOfMemory { pool: "host", call: "vkMapMemory" }
        }
        other => Error::Vulkan { call: "vkAllocateMemory", result: other.to_string() },
    }
}

/// A C string from a constant; kept here so that other files need no `std::ffi`.
pub(super) const MAIN: &CStr = c"main";
