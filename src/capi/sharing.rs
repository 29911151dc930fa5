//! Memory and semaphores shared with the host.

use std::ffi::c_void;
use std::sync::Arc;

use super::Handle;
use super::handle::{self, code, find, with};
use super::session::Session;
use super::status::{self, Fault, Outcome, Status};
use crate::gpu::{Buffer, Context, Semaphore};

/// What stands behind shared memory's handle.
pub struct MemoryState {
    pub(super) buffer: Arc<Buffer>,
    pub(super) context: Arc<Context>,
}

/// What stands behind a shared semaphore's handle.
pub struct SemaphoreState {
    pub(super) semaphore: Arc<Semaphore>,
    pub(super) context: Arc<Context>,
}

fn check_out<T>(out: *mut T, what: &str) -> Outcome<()> {
    match out.is_null() || !out.is_aligned() {
        true => Err(Fault::argument(format!("{what} is null or misaligned"))),
        false => Ok(()),
    }
}

fn check_fd(fd: i32) -> Outcome<()> {
    if fd < 0 { Err(Fault::argument(format!("the descriptor is {fd}"))) } else { Ok(()) }
}

/// Makes shared memory on an engine's device.
unsafe fn make_memory(
    engine: Handle,
    memory: *mut Handle,
    make: impl FnOnce(&Arc<Context>) -> Outcome<Buffer>,
) -> Status {
    code(find::<Session>(engine as usize).and_then(|cell| {
        cell.run(|session| {
            check_out(memory, "memory")?;
            let context = session.context().clone();
            let buffer = Arc::new(session.use_device(|| make(&context))?);
            // SAFETY: not null and aligned; writable by the caller's promise.
            unsafe { memory.write(handle::insert(MemoryState { buffer, context }, None) as Handle) };
            Ok(())
        })
    }))
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
            Ok(Buffer::import_host(context, pointer, bytes)?)
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
            Ok(Buffer::import_fd(context, fd, bytes)?)
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
            Ok(buffer)
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
    make: impl FnOnce(&Arc<Context>) -> Outcome<Semaphore>,
) -> Status {
    code(find::<Session>(engine as usize).and_then(|cell| {
        cell.run(|session| {
            check_out(semaphore, "semaphore")?;
            let context = session.context().clone();
            let made = Arc::new(session.use_device(|| make(&context))?);
            let state = SemaphoreState { semaphore: made, context };
            // SAFETY: not null and aligned; writable by the caller's promise.
            unsafe { semaphore.write(handle::insert(state, None) as Handle) };
            Ok(())
        })
    }))
}

/// `shutterbug_semaphore_import_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_semaphore_import_fd(
    engine: Handle,
    fd: i32,
    semaphore: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_semaphore(engine, semaphore, |context| {
            check_fd(fd)?;
            Ok(Semaphore::import_fd(context, fd)?)
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
    semaphore: *mut Handle,
    fd: *mut i32,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        make_semaphore(engine, semaphore, |context| {
            check_out(fd, "fd")?;
            let made = Semaphore::exportable(context)?;
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

/// The buffer behind a handle, if it is on this device.
pub(super) fn buffer(memory: usize, context: &Arc<Context>) -> Outcome<Arc<Buffer>> {
    with(memory, |state: &mut MemoryState| match Arc::ptr_eq(&state.context, context) {
        true => Ok(state.buffer.clone()),
        false => Err(Fault::argument("the memory belongs to another engine")),
    })
}

/// The semaphore behind a handle (none for null), if it is on this device.
pub(super) fn semaphore(handle: Handle, context: &Arc<Context>) -> Outcome<Option<Arc<Semaphore>>> {
    if handle.is_null() {
        return Ok(None);
    }
    with(handle as usize, |state: &mut SemaphoreState| match Arc::ptr_eq(&state.context, context) {
        true => Ok(Some(state.semaphore.clone())),
        false => Err(Fault::new(status::ARGUMENT, "the semaphore belongs to another engine")),
    })
}
