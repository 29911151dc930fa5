//! Memory and semaphores shared with the host.

use std::ffi::c_void;
use std::os::fd::BorrowedFd;
use std::os::unix::fs::FileTypeExt as _;
use std::sync::Arc;

use super::Handle;
use super::handle::{self, code, with};
use super::session::Session;
use super::status::{self, Fault, Outcome, Status};
use crate::gpu::{Buffer, Context, Semaphore, SemaphoreKind, Shared, SharedFormat, SignalAt};

/// What stands behind shared memory's handle.
pub struct MemoryState {
    pub(super) shared: Shared,
    pub(super) context: Arc<Context>,
}

/// What stands behind a shared semaphore's handle.
pub struct SemaphoreState {
    pub(super) semaphore: Arc<Semaphore>,
    pub(super) context: Arc<Context>,
}

pub(super) fn check_out<T>(out: *mut T, what: &str) -> Outcome<()> {
    match out.is_null() || !out.is_aligned() {
        true => Err(Fault::argument(format!("{what} is null or misaligned"))),
        false => Ok(()),
    }
}

/// Refuses what is no descriptor of memory or of a semaphore: software drivers read from what they get, and would wait
/// for ever at a pipe. (A driver's own descriptors are regular files, devices, or of no kind at all.)
pub(super) fn check_fd(fd: i32) -> Outcome<()> {
    if fd < 0 {
        return Err(Fault::argument(format!("the descriptor is {fd}")));
    }
    // SAFETY: borrowed for this call; if it is not open, the copy fails.
    let copy = unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned().map(std::fs::File::from);
    let about = copy.and_then(|file| file.metadata());
    let kind = about.map_err(|e| Fault::argument(format!("descriptor {fd}: {e}")))?.file_type();
    if kind.is_fifo() || kind.is_socket() || kind.is_dir() {
        return Err(Fault::argument(format!("descriptor {fd} is a pipe, a socket or a folder")));
    }
    Ok(())
}

/// Only what is on the engine's own device can be shared by its Vulkan handle.
pub(super) fn on_host_device(context: &Context, what: &str) -> Outcome<()> {
    if context.is_host_device() {
        return Ok(());
    }
    let text = format!(
        "the engine has a device of its own: {what} of another one are shared by file descriptor, or create the engine \
         on your device (shutterbug_engine_options.host)"
    );
    Err(Fault::new(status::UNSUPPORTED, text))
}

/// Makes something on an engine's device and gives it its handle.
unsafe fn make<T: Send + 'static>(
    engine: Handle,
    (out, what): (*mut Handle, &str),
    make: impl FnOnce(&Arc<Context>) -> Outcome<T>,
) -> Status {
    code(with(engine as usize, |session: &mut Session| {
        check_out(out, what)?;
        let context = session.context().clone();
        let made = session.use_device(|| make(&context))?;
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe { out.write(handle::insert(made, None) as Handle) };
        Ok(())
    }))
}

/// Makes shared memory on an engine's device.
pub(super) unsafe fn make_memory(
    engine: Handle,
    memory: *mut Handle,
    share: impl FnOnce(&Arc<Context>) -> Outcome<Shared>,
) -> Status {
    let state =
        |context: &Arc<Context>| Ok(MemoryState { shared: share(context)?, context: context.clone() });
    // SAFETY: the caller's promise.
    unsafe { make(engine, (memory, "memory"), state) }
}

/// `shutterbug_memory_import_host`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_import_host(
    engine: Handle,
    pointer: *mut c_void,
    bytes: u64,
    memory: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_memory(engine, memory, |context| {
            if pointer.is_null() {
                return Err(Fault::argument("pointer is null"));
            }
            Ok(Shared::Buffer(Arc::new(Buffer::import_host(context, pointer, bytes)?)))
        })
    }
}

/// `shutterbug_memory_import_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_import_fd(
    engine: Handle,
    fd: i32,
    bytes: u64,
    memory: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_memory(engine, memory, |context| {
            check_fd(fd)?;
            Ok(Shared::Buffer(Arc::new(Buffer::import_fd(context, fd, bytes)?)))
        })
    }
}

/// `shutterbug_memory_export_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_export_fd(
    engine: Handle,
    bytes: u64,
    memory: *mut Handle,
    fd: *mut i32,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_memory(engine, memory, |context| {
            check_out(fd, "fd")?;
            let buffer = Buffer::exportable(context, bytes)?;
            let exported = buffer.export_fd()?;
            // SAFETY: not null and aligned; writable by the caller's promise.
            fd.write(exported);
            Ok(Shared::Buffer(Arc::new(buffer)))
        })
    }
}

/// `shutterbug_memory_destroy`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_memory_destroy(memory: Handle) -> Status {
    handle::destroy::<MemoryState>(memory as usize)
}

unsafe fn make_semaphore(
    engine: Handle,
    semaphore: *mut Handle,
    share: impl FnOnce(&Arc<Context>) -> Outcome<Semaphore>,
) -> Status {
    let state = |context: &Arc<Context>| {
        Ok(SemaphoreState { semaphore: Arc::new(share(context)?), context: context.clone() })
    };
    // SAFETY: the caller's promise.
    unsafe { make(engine, (semaphore, "semaphore"), state) }
}

fn kind_of(kind: u32) -> Outcome<SemaphoreKind> {
    match kind {
        0 => Ok(SemaphoreKind::Binary),
        1 => Ok(SemaphoreKind::Timeline),
        kind => Err(Fault::argument(format!("there is no kind {kind} of semaphores"))),
    }
}

/// `shutterbug_semaphore_use`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_semaphore_use(
    engine: Handle,
    vk_semaphore: u64,
    kind: u32,
    semaphore: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    unsafe {
        make_semaphore(engine, semaphore, |context| {
            let kind = kind_of(kind)?;
            if vk_semaphore == 0 {
                return Err(Fault::argument("vk_semaphore is null"));
            }
            on_host_device(context, "semaphores")?;
            Ok(Semaphore::of_host(context, vk_semaphore, kind))
        })
    }
}

/// `shutterbug_semaphore_import_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_semaphore_import_fd(
    engine: Handle,
    fd: i32,
    kind: u32,
    semaphore: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_semaphore(engine, semaphore, |context| {
            let kind = kind_of(kind)?;
            check_fd(fd)?;
            Ok(Semaphore::import_fd(context, fd, kind)?)
        })
    }
}

/// `shutterbug_semaphore_export_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_semaphore_export_fd(
    engine: Handle,
    kind: u32,
    semaphore: *mut Handle,
    fd: *mut i32,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_semaphore(engine, semaphore, |context| {
            let kind = kind_of(kind)?;
            check_out(fd, "fd")?;
            let made = Semaphore::exportable(context, kind)?;
            let exported = made.export_fd()?;
            // SAFETY: not null and aligned; writable by the caller's promise.
            fd.write(exported);
            Ok(made)
        })
    }
}

/// `shutterbug_semaphore_destroy`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_semaphore_destroy(semaphore: Handle) -> Status {
    handle::destroy::<SemaphoreState>(semaphore as usize)
}

/// What is behind a handle of shared memory, if it is on this device.
pub(super) fn shared(memory: usize, context: &Arc<Context>) -> Outcome<Shared> {
    with(memory, |state: &mut MemoryState| match Arc::ptr_eq(&state.context, context) {
        true => Ok(state.shared.clone()),
        false => Err(Fault::argument("the memory belongs to another engine")),
    })
}

/// The semaphore behind a handle (none for null) with its value, if it is on this device.
pub(super) fn semaphore(handle: Handle, value: u64, context: &Arc<Context>) -> Outcome<Option<SignalAt>> {
    if handle.is_null() {
        return Ok(None);
    }
    with(handle as usize, |state: &mut SemaphoreState| match Arc::ptr_eq(&state.context, context) {
        true => Ok(Some((state.semaphore.clone(), value))),
        false => Err(Fault::new(status::ARGUMENT, "the semaphore belongs to another engine")),
    })
}

/// Where a picture of that size goes as well (null: nowhere), if it fits there.
pub(super) fn picture_memory(
    memory: Handle,
    size: [u32; 2],
    context: &Arc<Context>,
) -> Outcome<Option<Shared>> {
    if memory.is_null() {
        return Ok(None);
    }
    let shared = shared(memory as usize, context)?;
    let [width, height] = size;
    match &shared {
        Shared::Buffer(buffer) => {
            let needed = u64::from(width) * u64::from(height) * 4;
            if buffer.bytes() < needed {
                let text = format!("picture_memory has {} bytes, the picture takes {needed}", buffer.bytes());
                return Err(Fault::new(status::TOO_SMALL, text));
            }
        }
        Shared::Image(image) if image.format() != SharedFormat::Rgba8 => {
            let text = "an image that takes the picture is VK_FORMAT_R8G8B8A8_UNORM or _SRGB";
            return Err(Fault::new(status::FORMAT, text));
        }
        Shared::Image(image) if image.spec().size != size => {
            let [w, h] = image.spec().size;
            let text = format!("picture_memory is an image of {w}x{h} px, the picture has {width}x{height}");
            return Err(Fault::argument(text));
        }
        Shared::Image(_) => {}
    }
    Ok(Some(shared))
}
