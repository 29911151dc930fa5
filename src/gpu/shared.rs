//! Memory and semaphores that pass between this library and its host without a copy. Allocated directly: the allocator
//! cannot import or export.

use std::ffi::c_void;
use std::os::fd::{AsRawFd as _, BorrowedFd, FromRawFd as _, OwnedFd};
use std::sync::Arc;

use ash::vk::{self, Handle as _};

use super::context::Context;
use super::failed;
use super::memory::Buffer;
use crate::error::{Error, Result};

/// What a device can share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sharing {
    /// Memory by opaque file descriptor.
    pub memory_fd: bool,
    /// The host's own memory: addresses and sizes are multiples of this many bytes. 0: not possible.
    pub host_alignment_bytes: u64,
    /// Binary semaphores by opaque file descriptor.
    pub semaphore_fd: bool,
    /// Timeline semaphores by opaque file descriptor.
    pub timeline_fd: bool,
}

const FD: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
const HOST: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;
const SEMAPHORE_FD: vk::ExternalSemaphoreHandleTypeFlags = vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD;

impl Context {
    /// What can be shared with the host, as the device says.
    pub fn sharing(&self) -> Sharing {
        let enabled = |name| self.open.sharing.contains(&name);
        let host_alignment_bytes =
            if enabled(ash::ext::external_memory_host::NAME) { self.host_alignment() } else { 0 };
        let semaphores = enabled(ash::khr::external_semaphore_fd::NAME);
        Sharing {
            memory_fd: enabled(ash::khr::external_memory_fd::NAME) && self.buffers_can_export(),
            host_alignment_bytes,
            semaphore_fd: semaphores && self.semaphores_can_export(SemaphoreKind::Binary),
            timeline_fd: semaphores
                && self.open.timelines
                && self.semaphores_can_export(SemaphoreKind::Timeline),
        }
    }

    fn host_alignment(&self) -> u64 {
        let mut host = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut host);
        // SAFETY: the physical device belongs to the live instance; the extension is enabled.
        unsafe { self.root.instance.get_physical_device_properties2(self.info().physical, &mut properties) };
        host.min_imported_host_pointer_alignment
    }

    fn buffers_can_export(&self) -> bool {
        let info = vk::PhysicalDeviceExternalBufferInfo::default().usage(USAGE).handle_type(FD);
        let mut properties = vk::ExternalBufferProperties::default();
        // SAFETY: core in Vulkan 1.1; the physical device belongs to the live instance.
        unsafe {
            self.root.instance.get_physical_device_external_buffer_properties(
                self.info().physical,
                &info,
                &mut properties,
            );
        }
        let features = properties.external_memory_properties.external_memory_features;
        features
            .contains(vk::ExternalMemoryFeatureFlags::EXPORTABLE | vk::ExternalMemoryFeatureFlags::IMPORTABLE)
    }

    fn semaphores_can_export(&self, kind: SemaphoreKind) -> bool {
        let mut of_kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(kind.vk());
        let mut info = vk::PhysicalDeviceExternalSemaphoreInfo::default().handle_type(SEMAPHORE_FD);
        // Binary ones are asked for without: drivers that know no timelines know no such structure.
        if kind == SemaphoreKind::Timeline {
            info = info.push_next(&mut of_kind);
        }
        let mut properties = vk::ExternalSemaphoreProperties::default();
        // SAFETY: core in Vulkan 1.1; the physical device belongs to the live instance.
        unsafe {
            self.root.instance.get_physical_device_external_semaphore_properties(
                self.info().physical,
                &info,
                &mut properties,
            );
        }
        properties.external_semaphore_features.contains(
            vk::ExternalSemaphoreFeatureFlags::EXPORTABLE | vk::ExternalSemaphoreFeatureFlags::IMPORTABLE,
        )
    }

    pub(super) fn lacks(&self, what: &str) -> Error {
        Error::DeviceLacks { device: self.info().name.clone(), missing: vec![what.to_owned()] }
    }
}

const USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw(),
);

impl Buffer {
    /// A storage buffer whose memory is the host's own.
    ///
    /// # Safety
    /// `pointer` points to `bytes` bytes that stay allocated as long as the buffer lives.
    ///
    /// # Errors
    /// A device that cannot; an address or size that is no multiple of [`Sharing::host_alignment_bytes`]; out of
    /// memory.
    pub unsafe fn import_host(context: &Arc<Context>, pointer: *mut c_void, bytes: u64) -> Result<Self> {
        let alignment = context.sharing().host_alignment_bytes;
        if alignment == 0 {
            return Err(context.lacks("VK_EXT_external_memory_host (import of host memory)"));
        }
        for (what, value) in
            [("address of imported memory", pointer as u64), ("size of imported memory, bytes", bytes)]
        {
            if value % alignment != 0 || value == 0 {
                let why = format!("it must be a multiple of {alignment}, not 0");
                return Err(Error::Limit { what, value, limit: alignment, why });
            }
        }
        let buffer = Self::external(context, bytes, HOST)?;
        let loader = ash::ext::external_memory_host::Device::new(&context.root.instance, &context.device);
        let mut types = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the extension is enabled, the pointer is the host's by the caller's promise.
        let asked = unsafe {
            (loader.fp().get_memory_host_pointer_properties_ext)(loader.device(), HOST, pointer, &mut types)
        };
        asked.result().map_err(failed("vkGetMemoryHostPointerPropertiesEXT"))?;
        let mut import =
            vk::ImportMemoryHostPointerInfoEXT::default().handle_type(HOST).host_pointer(pointer);
        buffer.bind_shared(Some(types.memory_type_bits), bytes, &mut import, &mut || ())
    }

    /// A storage buffer in memory that another user of the same device exported. The descriptor belongs to the driver
    /// from a successful call on.
    ///
    /// # Safety
    /// `fd` is an opaque descriptor of memory of at least `bytes` bytes that this very device and driver exported.
    ///
    /// # Errors
    /// A device that cannot; a descriptor that the driver refuses; out of memory.
    pub unsafe fn import_fd(context: &Arc<Context>, fd: i32, bytes: u64) -> Result<Self> {
        if !context.sharing().memory_fd {
            return Err(context.lacks("VK_KHR_external_memory_fd (memory by file descriptor)"));
        }
        let import = |fd: i32, taken: &mut dyn FnMut()| {
            refuse_small(fd, bytes)?;
            let buffer = Self::external(context, bytes, FD)?;
            let mut import = vk::ImportMemoryFdInfoKHR::default().handle_type(FD).fd(fd);
            buffer.bind_shared(None, bytes, &mut import, taken)
        };
        // SAFETY: the caller's promise.
        unsafe { import_fd(fd, import) }
    }

    /// A storage buffer whose memory can be handed out by [`Self::export_fd`].
    ///
    /// # Errors
    /// A device that cannot; out of memory.
    pub fn exportable(context: &Arc<Context>, bytes: u64) -> Result<Self> {
        if !context.sharing().memory_fd {
            return Err(context.lacks("VK_KHR_external_memory_fd (memory by file descriptor)"));
        }
        let buffer = Self::external(context, bytes, FD)?;
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(FD);
        buffer.bind_shared(None, bytes, &mut export, &mut || ())
    }

    /// An opaque descriptor of the memory of an [`Self::exportable`] buffer; the caller closes it.
    ///
    /// # Errors
    /// Out of memory, too many open files.
    pub fn export_fd(&self) -> Result<i32> {
        let loader =
            ash::khr::external_memory_fd::Device::new(&self.context.root.instance, &self.context.device);
        let info = vk::MemoryGetFdInfoKHR::default().memory(self.shared).handle_type(FD);
        // SAFETY: the extension is enabled and the memory was allocated for export.
        unsafe { loader.get_memory_fd(&info) }.map_err(failed("vkGetMemoryFdKHR"))
    }

    fn external(
        context: &Arc<Context>,
        bytes: u64,
        handle_type: vk::ExternalMemoryHandleTypeFlags,
    ) -> Result<Self> {
        let limit = context.info().max_storage_buffer_bytes;
        if bytes == 0 || bytes > limit {
            let why = format!("maxStorageBufferRange of {}; at least 1", context.info().name);
            return Err(Error::Limit { what: "size of shared memory, bytes", value: bytes, limit, why });
        }
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(handle_type);
        let info = vk::BufferCreateInfo::default().size(bytes).usage(USAGE).push_next(&mut external);
        // SAFETY: the device is alive and `info` is complete.
        let handle =
            unsafe { context.device.create_buffer(&info, None) }.map_err(failed("vkCreateBuffer"))?;
        context.name(handle, "shared");
        Ok(Self::without_memory(context, handle, bytes))
    }

    /// Allocates as `how` says, and binds. `types`: what the imported memory allows, besides the buffer's own. `taken`:
    /// called when the driver has what `how` hands over.
    fn bind_shared(
        mut self,
        types: Option<u32>,
        bytes: u64,
        how: &mut impl vk::ExtendsMemoryAllocateInfo,
        taken: &mut dyn FnMut(),
    ) -> Result<Self> {
        let context = self.context.clone();
        // SAFETY: the buffer was just made by this device.
        let requirements = unsafe { context.device.get_buffer_memory_requirements(self.handle) };
        let allowed = requirements.memory_type_bits & types.unwrap_or(u32::MAX);
        if allowed == 0 {
            return Err(context.lacks("a memory type for this shared buffer"));
        }
        // Imported host memory has exactly the host's size; a driver that wants more than that refuses by the binding.
        let size = if types.is_some() { bytes } else { requirements.size };
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(size)
            .memory_type_index(allowed.trailing_zeros())
            .push_next(how);
        context.count_allocation();
        // SAFETY: the device is alive; `info` and what it points to live through the call.
        let memory = unsafe { context.device.allocate_memory(&info, None) };
        self.shared = memory.map_err(failed("vkAllocateMemory"))?;
        taken();
        // SAFETY: the memory is fresh and of an allowed type.
        let bound = unsafe { context.device.bind_buffer_memory(self.handle, self.shared, 0) };
        bound.map_err(failed("vkBindBufferMemory"))?;
        Ok(self)
    }
}

/// Imports a copy of a descriptor, and closes the descriptor itself only once all has succeeded: what fails after the
/// driver has taken its descriptor would else leave the host with one that is closed. `import` calls its second
/// argument then.
///
/// # Safety
/// `fd` is open and the caller's to give away.
pub(super) unsafe fn import_fd<T>(
    fd: i32,
    import: impl FnOnce(i32, &mut dyn FnMut()) -> Result<T>,
) -> Result<T> {
    // SAFETY: open by the caller's promise; if it is not, the copy fails.
    let copy = unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned();
    let copy = copy.map_err(|e| Error::Vulkan { call: "dup", result: format!("descriptor {fd}: {e}") })?;
    let raw = copy.as_raw_fd();
    let mut copy = Some(copy);
    let imported = import(raw, &mut || std::mem::forget(copy.take()))?;
    // SAFETY: the caller gives it away by success.
    drop(unsafe { OwnedFd::from_raw_fd(fd) });
    Ok(imported)
}

/// Software drivers hand out memory as files: one that is smaller than the caller says would end the process when it is
/// touched. Of other descriptors the size cannot be asked.
pub(super) fn refuse_small(fd: i32, bytes: u64) -> Result<()> {
    // SAFETY: open: it was duplicated just now.
    let file = unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned().map(std::fs::File::from);
    let about = file.and_then(|f| f.metadata());
    let about =
        about.map_err(|e| Error::Vulkan { call: "fstat", result: format!("descriptor {fd}: {e}") })?;
    if !about.is_file() || about.len() >= bytes {
        return Ok(());
    }
    let why = "the memory that the descriptor stands for".to_owned();
    Err(Error::Limit { what: "size of imported memory, bytes", value: bytes, limit: about.len(), why })
}

/// The two kinds of semaphores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SemaphoreKind {
    /// Signalled or not; each wait takes one signal.
    Binary,
    /// Counts up: waits are for a value, and may come before the signal.
    Timeline,
}

impl SemaphoreKind {
    fn vk(self) -> vk::SemaphoreType {
        match self {
            Self::Binary => vk::SemaphoreType::BINARY,
            Self::Timeline => vk::SemaphoreType::TIMELINE,
        }
    }
}

/// A semaphore that passes between queues of this library and of its host.
pub struct Semaphore {
    pub(super) handle: vk::Semaphore,
    kind: SemaphoreKind,
    /// Whether it is destroyed with this; else it is the host's own.
    owned: bool,
    context: Arc<Context>,
}

/// A semaphore, and the value that a timeline is waited for or set to (unused with binary ones).
pub type SignalAt = (Arc<Semaphore>, u64);

impl Semaphore {
    /// The host's own semaphore, of the very device that this context works on.
    ///
    /// # Safety
    /// `semaphore` is a `VkSemaphore` of the context's device and of that kind, and outlives this and all work that
    /// uses it.
    pub unsafe fn of_host(context: &Arc<Context>, semaphore: u64, kind: SemaphoreKind) -> Self {
        Self { handle: vk::Semaphore::from_raw(semaphore), kind, owned: false, context: context.clone() }
    }

    /// One whose descriptor [`Self::export_fd`] hands out; timelines start at 0.
    ///
    /// # Errors
    /// A device that cannot; out of memory.
    pub fn exportable(context: &Arc<Context>, kind: SemaphoreKind) -> Result<Self> {
        Self::require(context, kind)?;
        Self::create(context, kind, true)
    }

    /// One that another user exported. The descriptor belongs to the driver from a successful call on.
    ///
    /// # Safety
    /// `fd` is an opaque descriptor of a semaphore of that kind that this very device and driver exported.
    ///
    /// # Errors
    /// A device that cannot; a descriptor that the driver refuses; out of memory.
    pub unsafe fn import_fd(context: &Arc<Context>, fd: i32, kind: SemaphoreKind) -> Result<Self> {
        Self::require(context, kind)?;
        let semaphore = Self::create(context, kind, false)?;
        let loader = ash::khr::external_semaphore_fd::Device::new(&context.root.instance, &context.device);
        let info = vk::ImportSemaphoreFdInfoKHR::default()
            .semaphore(semaphore.handle)
            .handle_type(SEMAPHORE_FD)
            .fd(fd);
        // SAFETY: the extension is enabled, the descriptor is a semaphore's by the caller's promise.
        unsafe { loader.import_semaphore_fd(&info) }.map_err(failed("vkImportSemaphoreFdKHR"))?;
        Ok(semaphore)
    }

    /// An opaque descriptor; the caller closes it.
    ///
    /// # Errors
    /// Out of memory, too many open files.
    pub fn export_fd(&self) -> Result<i32> {
        let context = &self.context;
        let loader = ash::khr::external_semaphore_fd::Device::new(&context.root.instance, &context.device);
        let info = vk::SemaphoreGetFdInfoKHR::default().semaphore(self.handle).handle_type(SEMAPHORE_FD);
        // SAFETY: the extension is enabled and the semaphore was made for export.
        unsafe { loader.get_semaphore_fd(&info) }.map_err(failed("vkGetSemaphoreFdKHR"))
    }

    /// Its kind.
    pub fn kind(&self) -> SemaphoreKind {
        self.kind
    }

    fn require(context: &Context, kind: SemaphoreKind) -> Result<()> {
        let sharing = context.sharing();
        match kind {
            SemaphoreKind::Binary if !sharing.semaphore_fd => {
                Err(context.lacks("VK_KHR_external_semaphore_fd (semaphores by file descriptor)"))
            }
            SemaphoreKind::Timeline if !sharing.timeline_fd => {
                Err(context.lacks("timeline semaphores by VK_KHR_external_semaphore_fd"))
            }
            _ => Ok(()),
        }
    }

    fn create(context: &Arc<Context>, kind: SemaphoreKind, export: bool) -> Result<Self> {
        let mut of_kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(kind.vk());
        let mut exported = vk::ExportSemaphoreCreateInfo::default().handle_types(SEMAPHORE_FD);
        let mut info = vk::SemaphoreCreateInfo::default().push_next(&mut of_kind);
        if export {
            info = info.push_next(&mut exported);
        }
        // SAFETY: the device is alive and `info` is complete.
        let handle = unsafe { context.device.create_semaphore(&info, None) };
        let handle = handle.map_err(failed("vkCreateSemaphore"))?;
        Ok(Self { handle, kind, owned: true, context: context.clone() })
    }
}

impl Drop for Semaphore {
    fn drop(&mut self) {
        if self.owned && self.context.alive() {
            // SAFETY: slots wait for their work before the semaphores they use are dropped.
            unsafe { self.context.device.destroy_semaphore(self.handle, None) };
        }
    }
}
