//! `shutterbug._core`: the C ABI as Python objects, and what needs no engine. `tools/stubs` writes
//! `python/shutterbug/_core.pyi` from the signatures and comments here.
//!
//! It calls the C ABI (`include/shutterbug.h`) and not the Rust engine, because that contract is what a Python object
//! needs: statuses with sentences, one user a handle, answers in a forked child, and no panic that leaves the library.
//! What the C ABI has no call for (cameras' text, presets, the command line) is the Rust library's own.

mod abi;
mod buffers;
mod camera;
mod convert;
mod driver;
mod engine;
mod frame;
mod outside;
mod status;

use pyo3::prelude::pymodule;

/// The compiled part: the C ABI as objects. `shutterbug` is what to use; this has no promise of staying as it is.
#[pymodule(gil_used = false)]
mod _core {
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_export]
    use crate::camera::{check_camera, import_camera, preset_text, presets, run_command_line};
    #[pymodule_export]
    use crate::convert::{Poses, check_conventions, motion_preset};
    #[pymodule_export]
    use crate::driver::devices;
    #[pymodule_export]
    use crate::engine::Engine;
    #[pymodule_export]
    use crate::frame::Frame;
    #[pymodule_export]
    use crate::status::statuses;
}
