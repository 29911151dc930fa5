//! The C ABI. `include/shutterbug.h` is its manual; here stands only how its promises are kept.
//!
//! Handles are looked up, never followed (`handle.rs`). Every call checks its arguments, catches panics, and returns
//! one of the codes of `status.rs`. What is written to the caller's memory is written on success only.
#![allow(unsafe_code)]

mod agreement;
mod camera;
mod convert;
mod depth;
mod encoding;
mod engine;
mod exposure;
mod finer;
mod frame;
mod gpu_image;
mod handle;
mod image;
mod log;
mod margin;
mod nv12;
mod options;
mod outside;
mod picture;
mod pose;
mod rows;
mod session;
mod sharing;
mod status;
mod table;
mod types;

pub use agreement::shutterbug_check_conventions;
pub use convert::*;
pub use engine::*;
pub use frame::*;
pub use gpu_image::{
    shutterbug_memory_export_image_fd, shutterbug_memory_import_image_fd, shutterbug_memory_use_image,
};
pub use log::LogFn;
pub use margin::shutterbug_engine_margin;
pub use options::{ENGINE_PLANES, ENGINE_VALIDATION};
pub use outside::*;
pub use pose::shutterbug_pose_convert;
pub use sharing::{
    shutterbug_memory_destroy, shutterbug_memory_export_fd, shutterbug_memory_import_fd,
    shutterbug_memory_import_host, shutterbug_semaphore_destroy, shutterbug_semaphore_export_fd,
    shutterbug_semaphore_import_fd, shutterbug_semaphore_use,
};
pub use status::{ALL as STATUSES, Status};
pub use types::*;

use std::ffi::{c_char, c_void};

/// A handle as C sees it. Never followed.
pub type Handle = *mut c_void;

/// The header that belongs to this library.
pub const HEADER: &str = include_str!("../../include/shutterbug.h");

/// `shutterbug_version`: major * 1 000 000 + minor * 1 000 + patch.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_version() -> u32 {
    let number = |text: &str| text.parse::<u32>().unwrap_or(0);
    number(env!("CARGO_PKG_VERSION_MAJOR")) * 1_000_000
        + number(env!("CARGO_PKG_VERSION_MINOR")) * 1_000
        + number(env!("CARGO_PKG_VERSION_PATCH"))
}

/// `shutterbug_status_text`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_status_text(code: Status) -> *const c_char {
    status::text(code).as_ptr()
}

/// `shutterbug_last_error`: the text of the last failed call on a handle.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_last_error(handle: Handle, text: *mut c_char, capacity: usize) -> usize {
    let error = handle::last_error(handle as usize).unwrap_or_else(|| "no such handle".to_owned());
    // SAFETY: the caller's promise: `capacity` writable characters.
    unsafe { types::give_text((text, capacity as u64), &error) };
    error.len()
}
