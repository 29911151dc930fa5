//! An engine: a device, a camera, and frames from outside.
#![allow(unsafe_code)]

use std::ffi::{CString, c_void};
use std::ptr::null_mut;
use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use shutterbug::capi::{
    self, Handle, shutterbug_engine_info, shutterbug_engine_options, shutterbug_motion_bound,
};

use crate::abi::{Log, Shared, fixed_text, sized};
use crate::driver;
use crate::frame::Frame;
use crate::outside::Outside;
use crate::status::exception;

/// An engine of the C ABI.
#[pyclass(frozen, module = "shutterbug._core")]
pub struct Engine(Arc<Shared>);

fn c_text(text: &str, what: &str) -> PyResult<CString> {
    CString::new(text).map_err(|_| PyValueError::new_err(format!("{what} holds a NUL")))
}

#[pymethods]
impl Engine {
    /// Opens a device: `device` is an index, UUID or part of a name; `driver` is the file of a Vulkan driver that is
    /// asked without a loader; `limits` are frames in flight, the number of the method, and blur samples at most.
    #[new]
    #[pyo3(signature = (device=None, driver=None, seed=0, limits=(2, 0, 0), time_limit_s=0.0),
        text_signature = "(device=None, driver=None, seed=0, limits=(2, 0, 0), time_limit_s=0.0)")]
    fn new(
        py: Python<'_>,
        device: Option<&str>,
        driver: Option<&str>,
        seed: u64,
        limits: (u32, u32, u32),
        time_limit_s: f64,
    ) -> PyResult<Self> {
        let device = device.map(|d| c_text(d, "device")).transpose()?;
        let loader = driver.map(driver::proc_addr).transpose()?.map_or(0, |p| p as usize);
        let (log, mut text) = (Box::<Log>::default(), vec![0u8; 4096]);
        let opened = py.detach(|| {
            let mut options: shutterbug_engine_options = sized();
            (options.seed, options.time_limit_s) = (seed, time_limit_s);
            (options.frames_in_flight, options.method, options.max_blur_samples) = limits;
            options.device = device.as_ref().map_or(std::ptr::null(), |d| d.as_ptr());
            options.get_instance_proc_addr = loader as *const c_void;
            options.log = Some(Log::hear);
            options.log_user = (&raw const *log).cast_mut().cast();
            (options.error_text, options.error_capacity) = (text.as_mut_ptr().cast(), text.len() as u64);
            let mut engine: Handle = null_mut();
            // SAFETY: all that the options point to lives through the call, log and loader as long as the engine.
            let status = unsafe { capi::shutterbug_engine_create(&raw const options, &raw mut engine) };
            if status == 0 { Ok(engine as usize) } else { Err(status) }
        });
        match opened {
            Ok(handle) => Ok(Self(Arc::new(Shared::new(handle as Handle, log)))),
            Err(status) => {
                let length = text.iter().position(|b| *b == 0).unwrap_or(0);
                Err(exception(py, status, &String::from_utf8_lossy(&text[..length])))
            }
        }
    }

    /// Sets the camera by the text of a `camera.toml`.
    fn set_camera(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        let text = c_text(text, "the camera")?;
        self.0.call(py, None, |engine| {
            // SAFETY: the text lives through the call.
            (unsafe { capi::shutterbug_engine_set_camera_text(engine, text.as_ptr()) }, ())
        })
    }

    /// Automatic exposure begins anew.
    fn reset_exposure(&self, py: Python<'_>) -> PyResult<()> {
        self.0.call(py, None, |engine| (capi::shutterbug_engine_reset_exposure(engine), ()))
    }

    /// Columns and rows that a frame needs beyond each side when the camera moves so at most.
    #[pyo3(signature = (turn_rate_rad_s, speed_m_s=0.0, nearest_m=0.0, color_delay_s=0.0))]
    fn margin(
        &self,
        py: Python<'_>,
        turn_rate_rad_s: f64,
        speed_m_s: f64,
        nearest_m: f64,
        color_delay_s: f64,
    ) -> PyResult<(u32, u32)> {
        self.0.call(py, None, |engine| {
            let mut bound: shutterbug_motion_bound = sized();
            (bound.turn_rate_rad_s, bound.speed_m_s) = (turn_rate_rad_s, speed_m_s);
            (bound.nearest_m, bound.color_delay_s) = (nearest_m, color_delay_s);
            let (mut x, mut y) = (0, 0);
            // SAFETY: all is alive through the call.
            let status =
                unsafe { capi::shutterbug_engine_margin(engine, &raw const bound, &raw mut x, &raw mut y) };
            (status, (x, y))
        })
    }

    /// Hands a frame to the device.
    #[pyo3(signature = (given: "dict[str, Any]"))]
    fn submit(&self, py: Python<'_>, given: &Bound<'_, PyDict>) -> PyResult<Frame> {
        let outside = Outside::read(py, given)?;
        let frame = self.0.call(py, None, |engine| {
            let mut frame: Handle = null_mut();
            // SAFETY: `outside` and all that it points to live through the call.
            let status = outside
                .with(|o| unsafe { capi::shutterbug_engine_submit_outside(engine, o, &raw mut frame) });
            (status, frame as usize)
        })?;
        Ok(Frame::new(self.0.clone(), frame))
    }

    /// What the engine runs on.
    #[pyo3(signature = () -> "dict[str, Any]")]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = self.0.call(py, None, |engine| {
            let mut info: shutterbug_engine_info = sized();
            // SAFETY: it is alive through the call.
            let status = unsafe { capi::shutterbug_engine_get_info(engine, &raw mut info) };
            (status, info)
        })?;
        let about = PyDict::new(py);
        about.set_item("name", fixed_text(&info.device_name))?;
        about.set_item("driver", fixed_text(&info.driver))?;
        let kinds = ["other", "discrete GPU", "integrated GPU", "virtual GPU", "software"];
        about.set_item("kind", kinds.get(info.device_kind as usize).copied().unwrap_or("other"))?;
        about.set_item("uuid", info.device_uuid.iter().map(|b| format!("{b:02x}")).collect::<String>())?;
        about.set_item("frames_in_flight", info.frames_in_flight)?;
        Ok(about)
    }

    /// Waits for what is in flight and frees all.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.0.close());
    }
}
