//! Handles: numbers that stand for live objects, never addresses of them. A handle that was destroyed, belongs to
//! another kind of object or was made up is found out by looking it up, so no memory of the caller's or of ours is
//! touched.
//!
//! The table (`table.rs`) is the one thing that all engines of a process share. It holds nothing but which handles are
//! alive, is empty (and owns no memory) when all are destroyed, and is locked only while a handle is looked up. In a
//! forked child the parent's handles answer with FORKED, and nothing of theirs is touched.

use std::any::Any;
use std::panic::{AssertUnwindSafe, UnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError, TryLockError};

use tracing::Dispatch;

use super::status::{self, Fault, Outcome, Status};
use super::table::{Object, table};

/// What stands behind a handle.
pub struct Cell<T> {
    /// `None` once destroyed.
    state: Mutex<Option<T>>,
    unusable: AtomicBool,
    last_error: Mutex<String>,
    /// Where log messages of calls on this handle go.
    log: Option<Dispatch>,
}

impl<T: Send + 'static> Object for Cell<T> {
    fn error_text(&self) -> String {
        self.last_error.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

const FORKED: &str = "the handle belongs to the process that forked this one: its device and threads are not here. \
    Make an engine of your own after the fork; destroying this handle drops it and nothing else";

/// Puts an object behind a new handle. Handles are never given out twice.
pub fn insert<T: Send + 'static>(state: T, log: Option<Dispatch>) -> usize {
    let cell = Cell {
        state: Mutex::new(Some(state)),
        unusable: AtomicBool::new(false),
        last_error: Mutex::new(String::new()),
        log,
    };
    table().insert(Arc::new(cell))
}

/// The object behind a handle.
pub fn find<T: Send + 'static>(handle: usize) -> Outcome<Arc<Cell<T>>> {
    let table = table();
    if table.inherited(handle) {
        return Err(Fault::new(status::FORKED, FORKED));
    }
    let any: Option<Arc<dyn Any + Send + Sync>> = table.get(handle).map(|object| object as _);
    let cell = any.and_then(|any| any.downcast().ok());
    cell.ok_or_else(|| Fault::new(status::HANDLE, "no such handle"))
}

/// The cell of any handle's last error text.
pub fn last_error(handle: usize) -> Option<String> {
    if table().inherited(handle) {
        return Some(FORKED.to_owned());
    }
    Some(table().get(handle)?.error_text())
}

impl<T: Send + 'static> Cell<T> {
    fn remember(&self, text: String) {
        *self.last_error.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }

    /// Runs `f` on the object if nobody else does; a panic makes the object unusable. Keeps the fault's text.
    pub fn run<R>(&self, f: impl FnOnce(&mut T) -> Outcome<R>) -> Outcome<R> {
        let done = self.attempt(f);
        if let Err(fault) = &done
            && fault.status != status::BUSY
        {
            self.remember(fault.text.clone());
        }
        done
    }

    fn attempt<R>(&self, f: impl FnOnce(&mut T) -> Outcome<R>) -> Outcome<R> {
        let mut guard = match self.state.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                return Err(Fault::new(status::BUSY, "another thread is using the handle"));
            }
        };
        let Some(state) = guard.as_mut() else {
            return Err(Fault::new(status::HANDLE, "the handle was destroyed"));
        };
        if self.unusable.load(Ordering::Acquire) {
            let (said, since) = (self.error_text(), "unusable since: ");
            // It is kept as the last error: the next call must not put another one before it.
            let text = if said.starts_with(since) { said } else { format!("{since}{said}") };
            return Err(Fault::new(status::POISONED, text));
        }
        let call = AssertUnwindSafe(|| f(state));
        let done = match &self.log {
            Some(log) => tracing::dispatcher::with_default(log, || caught(call)),
            None => caught(call),
        };
        done.unwrap_or_else(|panic| {
            self.unusable.store(true, Ordering::Release);
            Err(Fault::new(status::PANIC, panic_text(&*panic)))
        })
    }

    /// Removes the object, if no thread is using it.
    fn take(&self) -> Outcome<T> {
        let mut guard = match self.state.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                return Err(Fault::new(status::BUSY, "another thread is using the handle"));
            }
        };
        guard.take().ok_or_else(|| Fault::new(status::HANDLE, "the handle was destroyed"))
    }
}

/// Destroys the object behind a handle. Null is fine.
pub fn destroy<T: Send + 'static>(handle: usize) -> Status {
    if handle == 0 {
        return status::OK;
    }
    if table().inherited(handle) {
        table().drop_inherited(handle);
        return status::OK;
    }
    let taken = find::<T>(handle).and_then(|cell| {
        let state = cell.take()?;
        table().remove(handle);
        Ok((state, cell))
    });
    match taken {
        Err(fault) => fault.status,
        Ok((state, cell)) => {
            let drop_it = AssertUnwindSafe(|| drop(state));
            let done = match &cell.log {
                Some(log) => tracing::dispatcher::with_default(log, || caught(drop_it)),
                None => caught(drop_it),
            };
            if done.is_err() { status::PANIC } else { status::OK }
        }
    }
}

/// Runs `f` on the object behind a handle.
pub fn with<T: Send + 'static, R>(handle: usize, f: impl FnOnce(&mut T) -> Outcome<R>) -> Outcome<R> {
    find::<T>(handle)?.run(f)
}

thread_local! {
    /// Whether this thread is inside a call, whose panics are caught.
    static IN_CALL: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Catches a panic. What it says goes to the host's log, where there is one, and not to the host's stderr.
fn caught<R>(f: impl FnOnce() -> R + UnwindSafe) -> std::thread::Result<R> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| match IN_CALL.get() {
            true => tracing::error!("a bug in shutterbug: {panic}"),
            // Of the host's own, where it is written in Rust too.
            false => before(panic),
        }));
    });
    let outer = IN_CALL.replace(true);
    let done = catch_unwind(f);
    IN_CALL.set(outer);
    done
}

/// Runs a call that has no handle yet.
pub fn guarded<R>(f: impl FnOnce() -> Outcome<R>) -> Outcome<R> {
    caught(AssertUnwindSafe(f)).unwrap_or_else(|panic| Err(Fault::new(status::PANIC, panic_text(&*panic))))
}

/// The code of an outcome without value.
pub fn code(outcome: Outcome<()>) -> Status {
    outcome.map_or_else(|fault| fault.status, |()| status::OK)
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("a bug in shutterbug: {}", text.unwrap_or_else(|| "panic".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::c_char;

    use crate::capi::session::Session;
    use crate::capi::*;

    /// What the host's log function has heard.
    static HEARD: Mutex<Vec<(u32, String)>> = Mutex::new(Vec::new());

    unsafe extern "C" fn hear(user: *mut std::ffi::c_void, level: u32, text: *const c_char) {
        assert_eq!(user as usize, 77, "the host's own pointer");
        // SAFETY: the library passes a text that ends.
        let text = unsafe { std::ffi::CStr::from_ptr(text) }.to_string_lossy().into_owned();
        HEARD.lock().expect("one thread").push((level, text));
    }

    fn engine(log: Option<LogFn>) -> Option<Handle> {
        // SAFETY: every bit pattern is a value; zero is each option's default.
        let mut options: shutterbug_engine_options = unsafe { std::mem::zeroed() };
        options.struct_size = size_of::<shutterbug_engine_options>() as u32;
        (options.log, options.log_user) = (log, 77 as *mut std::ffi::c_void);
        let mut engine = std::ptr::null_mut();
        // SAFETY: both live through the call.
        let made = unsafe { shutterbug_engine_create(&options, &mut engine) };
        if [status::NO_DEVICE, status::UNSUPPORTED].contains(&made) {
            assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "a device is required");
            eprintln!("SKIPPED capi::handle: no device");
            return None;
        }
        assert_eq!(made, status::OK);
        Some(engine)
    }

    fn set_camera(engine: Handle, text: &std::ffi::CStr) -> Status {
        // SAFETY: a text that ends.
        unsafe { shutterbug_engine_set_camera_text(engine, text.as_ptr()) }
    }

    fn text_of(handle: Handle) -> String {
        last_error(handle as usize).expect("alive")
    }

    const CAMERA: &std::ffi::CStr =
        c"width = 8\nheight = 8\nfx = 8\nfy = 8\ncx = 4\ncy = 4\nframe_period_s = 0.04";

    #[test]
    fn a_panic_is_a_status_and_poisons_that_handle_alone() {
        let (Some(broken), Some(other)) = (engine(None), engine(None)) else { return };
        let panics = code(with(broken as usize, |_: &mut Session| -> Outcome<()> { panic!("on purpose") }));
        assert_eq!(panics, status::PANIC);
        assert!(text_of(broken).contains("on purpose"), "{}", text_of(broken));
        assert_eq!(set_camera(broken, CAMERA), status::POISONED);
        assert!(text_of(broken).contains("unusable since") && text_of(broken).contains("on purpose"));
        let said = text_of(broken);
        assert_eq!(set_camera(broken, CAMERA), status::POISONED, "and stays so");
        assert_eq!(text_of(broken), said, "its text does not grow");
        assert_eq!(set_camera(other, CAMERA), status::OK, "no other handle");
        assert_eq!(shutterbug_engine_destroy(broken), status::OK);
        assert_eq!(set_camera(broken, CAMERA), status::HANDLE);
        // Control: without panic nothing of the kind.
        assert_eq!(code(with(other as usize, |_: &mut Session| Ok(()))), status::OK);
        assert_eq!(shutterbug_engine_destroy(other), status::OK);
    }

    #[test]
    fn the_log_function_hears_its_own_engine_and_no_other() {
        let (Some(heard), Some(silent)) = (engine(Some(hear)), engine(None)) else { return };
        let speak = |_: &mut Session| {
            tracing::error!("one {}", 1);
            tracing::warn!("two");
            tracing::info!("three");
            tracing::debug!("not told");
            Ok(())
        };
        HEARD.lock().expect("one thread").clear();
        assert_eq!(code(with(silent as usize, speak)), status::OK);
        tracing::error!("of no call");
        assert!(HEARD.lock().expect("one thread").is_empty(), "control: not its own");
        assert_eq!(code(with(heard as usize, speak)), status::OK);
        let told = std::mem::take(&mut *HEARD.lock().expect("one thread"));
        let want = [(1, "one 1"), (2, "two"), (3, "three")];
        assert_eq!(told, want.map(|(level, text)| (level, text.to_owned())));
        // A bug in this library is reported there too.
        let bug = |_: &mut Session| -> Outcome<()> { panic!("on purpose") };
        assert_eq!(code(with(heard as usize, bug)), status::PANIC);
        let told = std::mem::take(&mut *HEARD.lock().expect("one thread"));
        assert!(
            matches!(&told[..], [(1, text)] if text.contains("a bug") && text.contains("on purpose")),
            "{told:?}"
        );
        for engine in [heard, silent] {
            assert_eq!(shutterbug_engine_destroy(engine), status::OK);
        }
    }
}
