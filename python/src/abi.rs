//! An engine of the C ABI behind a lock, and what it says.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};

use pyo3::prelude::*;
use shutterbug::capi::{self, Handle, Status};

use crate::status;

/// A struct of the C ABI, zero but for its size: every one of them takes zero as each option's default.
pub fn sized<T: capi::Sized32>() -> T {
    // SAFETY: `Sized32` promises `repr(C)`, a first field `struct_size: u32`, and that every bit pattern is a value.
    unsafe {
        let mut value = std::mem::zeroed::<T>();
        (&raw mut value).cast::<u32>().write(size_of::<T>() as u32);
        value
    }
}

/// What the library said during calls: levels (1 error, 2 warning, 3 information) and sentences.
#[derive(Default)]
pub struct Log(Mutex<Vec<(u32, String)>>);

impl Log {
    /// The function that the library calls, with this as its `user`.
    pub unsafe extern "C" fn hear(user: *mut c_void, level: u32, text: *const c_char) {
        // SAFETY: `user` is the log of a live engine and `text` a text of the library that lives through the call.
        let (log, text) = unsafe { (&*user.cast::<Self>(), CStr::from_ptr(text)) };
        lock(&log.0).push((level, text.to_string_lossy().into_owned()));
    }

    /// What was said since this was asked last.
    pub fn take(&self) -> Vec<(u32, String)> {
        std::mem::take(&mut lock(&self.0))
    }
}

/// A lock whose last holder panicked is as good as any: it guards no half-done work.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|e| e.into_inner())
}

/// An engine that an `Engine` and its frames share. One call at a time; others wait with the interpreter let go.
pub struct Shared {
    turn: Mutex<()>,
    /// The handle as a number; 0 once it was destroyed.
    handle: AtomicUsize,
    log: Box<Log>,
}

impl Shared {
    /// Takes over a handle and the log that its engine was made with.
    pub fn new(handle: Handle, log: Box<Log>) -> Self {
        Self { turn: Mutex::default(), handle: AtomicUsize::new(handle as usize), log }
    }

    /// One call of the C ABI: waits for its turn with the interpreter let go, hands on what the library said, and makes
    /// a failure the exception of its status. `of` is the handle whose sentence belongs to a failure; `None`: the
    /// engine's.
    pub fn call<T: Send>(
        &self,
        py: Python<'_>,
        of: Option<usize>,
        work: impl FnOnce(Handle) -> (Status, T) + Send,
    ) -> PyResult<T> {
        let (status, value, sentence) = py.detach(|| {
            let _turn = lock(&self.turn);
            let handle = self.handle.load(Ordering::Acquire);
            let (status, value) = work(handle as Handle);
            let sentence = if status == 0 { String::new() } else { sentence(of.unwrap_or(handle), status) };
            (status, value, sentence)
        });
        self.pass_on(py)?;
        if status == 0 { Ok(value) } else { Err(status::exception(py, status, &sentence)) }
    }

    /// Hands what the library said to Python's log `shutterbug`.
    fn pass_on(&self, py: Python<'_>) -> PyResult<()> {
        let said = self.log.take();
        if said.is_empty() {
            return Ok(());
        }
        let logger = py.import("logging")?.call_method1("getLogger", ("shutterbug",))?;
        for (level, text) in said {
            // A failure is an exception already.
            let method = if level == 2 { "warning" } else { "debug" };
            logger.call_method1(method, ("%s", text))?;
        }
        Ok(())
    }

    /// Destroys the engine; a second time does nothing.
    pub fn close(&self) {
        let _turn = lock(&self.turn);
        let handle = self.handle.swap(0, Ordering::AcqRel);
        capi::shutterbug_engine_destroy(handle as Handle);
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // Waits for what is in flight. Nobody else can have a turn: this is the last user.
        let handle = self.handle.swap(0, Ordering::AcqRel);
        capi::shutterbug_engine_destroy(handle as Handle);
    }
}

/// What the library said of a handle's last failure, or what the status means.
fn sentence(handle: usize, status: Status) -> String {
    let own = ["HANDLE", "BUSY", "FORKED"].iter().all(|name| status::number(name) != status);
    let mut text = vec![0u8; 4096];
    if own && handle != 0 {
        // SAFETY: room for as many characters as it says.
        let length =
            unsafe { capi::shutterbug_last_error(handle as Handle, text.as_mut_ptr().cast(), text.len()) };
        text.truncate(length.min(4095));
        return String::from_utf8_lossy(&text).into_owned();
    }
    // SAFETY: a static text with its NUL.
    unsafe { CStr::from_ptr(capi::shutterbug_status_text(status)) }.to_string_lossy().into_owned()
}

/// A text of fixed size that ends with a NUL.
pub fn fixed_text(field: &[c_char]) -> String {
    let bytes: Vec<u8> = field.iter().take_while(|c| **c != 0).map(|c| *c as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
