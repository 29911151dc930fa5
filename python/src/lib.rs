//! `shutterbug._core`: the C ABI as Python objects, and what needs no engine. `python/shutterbug/_core.pyi` is its
//! manual.
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

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<engine::Engine>()?;
    module.add_class::<frame::Frame>()?;
    module.add_class::<convert::Poses>()?;
    module.add_function(wrap_pyfunction!(camera::check_camera, module)?)?;
    module.add_function(wrap_pyfunction!(camera::import_camera, module)?)?;
    module.add_function(wrap_pyfunction!(camera::presets, module)?)?;
    module.add_function(wrap_pyfunction!(camera::preset_text, module)?)?;
    module.add_function(wrap_pyfunction!(camera::run_command_line, module)?)?;
    module.add_function(wrap_pyfunction!(convert::motion_preset, module)?)?;
    module.add_function(wrap_pyfunction!(convert::check_conventions, module)?)?;
    module.add_function(wrap_pyfunction!(driver::devices, module)?)?;
    module.add_function(wrap_pyfunction!(status::statuses, module)?)?;
    Ok(())
}
