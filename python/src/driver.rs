//! Devices, and drivers that are asked without a loader.
#![allow(unsafe_code)]

use std::ffi::c_void;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use shutterbug::gpu::DeviceKind;

use crate::status::input_error;

/// The devices that the machine's Vulkan loader finds, best first, as dictionaries.
#[pyfunction]
#[pyo3(signature = () -> "list[dict[str, Any]]")]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let found = py.detach(shutterbug::gpu::devices).map_err(|e| input_error(py, &e))?;
    found
        .iter()
        .map(|device| {
            let about = PyDict::new(py);
            about.set_item("index", device.index)?;
            about.set_item("name", &device.name)?;
            about.set_item("driver", &device.driver)?;
            about.set_item("uuid", &device.uuid)?;
            about.set_item("kind", kind_name(device.kind))?;
            about.set_item("missing", &device.missing)?;
            Ok(about)
        })
        .collect()
}

fn kind_name(kind: DeviceKind) -> &'static str {
    match kind {
        DeviceKind::DiscreteGpu => "discrete GPU",
        DeviceKind::IntegratedGpu => "integrated GPU",
        DeviceKind::VirtualGpu => "virtual GPU",
        DeviceKind::Other => "other",
        DeviceKind::Cpu => "software",
    }
}

/// `vkGetInstanceProcAddr` of a driver's file. The file stays loaded as long as the process.
pub fn proc_addr(file: &str) -> PyResult<*const c_void> {
    // SAFETY: loading a Vulkan driver, which the caller names, runs its initialisers, which is what it is for.
    let library = unsafe { libloading::Library::new(file) };
    let library = library.map_err(|e| PyOSError::new_err(format!("{file}: {e}")))?;
    // SAFETY: a function, whatever its arguments; only its address is used.
    let symbol = unsafe { library.get::<unsafe extern "C" fn()>(b"vkGetInstanceProcAddr\0") };
    let address =
        symbol.map(|s| *s as *const c_void).map_err(|e| PyOSError::new_err(format!("{file}: {e}")))?;
    std::mem::forget(library);
    Ok(address)
}
