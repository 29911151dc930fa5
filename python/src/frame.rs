//! A frame on its way, or delivered.
#![allow(unsafe_code)]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use shutterbug::capi::{
    self, Handle, Status, shutterbug_frame_info, shutterbug_instant, shutterbug_pass_time,
};

use crate::abi::{Shared, fixed_text, sized};
use crate::buffers::Target;
use crate::status::number;

/// How long a wait keeps Python from hearing of Ctrl-C.
const SLICE: Duration = Duration::from_millis(100);
/// As long as any engine waits by default.
const NO_LIMIT_S: f64 = 600.0;

/// A frame of the C ABI.
#[pyclass(frozen, module = "shutterbug._core")]
pub struct Frame {
    engine: Arc<Shared>,
    /// The handle as a number; 0 once it was destroyed.
    handle: AtomicUsize,
}

impl Frame {
    /// Takes over a handle.
    pub fn new(engine: Arc<Shared>, handle: usize) -> Self {
        Self { engine, handle: AtomicUsize::new(handle) }
    }

    fn call<T: Send>(&self, py: Python<'_>, work: impl FnOnce(Handle) -> (Status, T) + Send) -> PyResult<T> {
        let frame = self.handle.load(Ordering::Acquire);
        self.engine.call(py, Some(frame), |_| work(frame as Handle))
    }
}

#[pymethods]
impl Frame {
    /// Waits at most `limit_s` seconds (below 0: ten minutes) and takes the frame from the device. Ctrl-C ends the
    /// wait; the frame can be waited for again.
    #[pyo3(signature = (limit_s=-1.0), text_signature = "($self, limit_s=-1.0)")]
    fn wait(&self, py: Python<'_>, limit_s: f64) -> PyResult<()> {
        let limit_s = if limit_s < 0.0 { NO_LIMIT_S } else { limit_s.min(NO_LIMIT_S) };
        let end = Instant::now() + Duration::from_secs_f64(if limit_s.is_nan() { 0.0 } else { limit_s });
        let timeout = number("TIMEOUT");
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let slice_s = left.min(SLICE).as_secs_f64();
            let last = left <= SLICE;
            let done = self.call(py, |frame| {
                let status = capi::shutterbug_frame_wait(frame, slice_s);
                if status == timeout && !last { (0, false) } else { (status, true) }
            })?;
            if done {
                return Ok(());
            }
            py.check_signals()?;
        }
    }

    /// Whether `wait` would return at once.
    fn ready(&self, py: Python<'_>) -> PyResult<bool> {
        self.call(py, |frame| {
            let mut ready = 0;
            // SAFETY: it is alive through the call.
            let status = unsafe { capi::shutterbug_frame_poll(frame, &raw mut ready) };
            (status, ready == 1)
        })
    }

    /// Copies a plane (1 the picture, 5 the radiance, 6 raw) in a format of `shutterbug_image` to an array of the
    /// camera's size.
    fn read_into(&self, py: Python<'_>, plane: u32, format: u32, to: &Bound<'_, PyAny>) -> PyResult<()> {
        let target = Target::of(to, format)?;
        self.call(py, |frame| {
            // SAFETY: the array is held, and as large as the image says.
            (unsafe { capi::shutterbug_frame_read(frame, plane, target.image()) }, ())
        })
    }

    /// When the frame was taken and how long it took.
    #[pyo3(signature = () -> "dict[str, Any]")]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = self.call(py, |frame| {
            let mut info: shutterbug_frame_info = sized();
            // SAFETY: it is alive through the call.
            let status = unsafe { capi::shutterbug_frame_get_info(frame, &raw mut info) };
            (status, info)
        })?;
        let about = PyDict::new(py);
        for (name, instant) in [
            ("first_line_start", &info.first_line_start),
            ("middle", &info.middle),
            ("last_line_end", &info.last_line_end),
        ] {
            about.set_item(name, at(instant))?;
        }
        about.set_item("host_ms", info.host_ms)?;
        about.set_item("exposure_gain", info.exposure_gain)?;
        Ok(about)
    }

    /// Names of the passes and their times on the device, ms.
    fn times(&self, py: Python<'_>) -> PyResult<Vec<(String, f64)>> {
        let room = 256;
        let times = self.call(py, |frame| {
            let mut times = vec![shutterbug_pass_time { name: [0; 32], ms: 0.0 }; room];
            let mut count = 0;
            // SAFETY: room for as many as is stated.
            let status = unsafe {
                capi::shutterbug_frame_get_times(frame, times.as_mut_ptr(), times.len(), &raw mut count)
            };
            times.truncate(count);
            (status, times)
        })?;
        Ok(times.iter().map(|t| (fixed_text(&t.name), t.ms)).collect())
    }

    /// Frees the frame; one in flight is waited for.
    fn close(&self, py: Python<'_>) {
        let handle = self.handle.swap(0, Ordering::AcqRel);
        // The status says nothing that a closed frame could answer for.
        let _ =
            self.engine.call(py, Some(handle), |_| (capi::shutterbug_frame_destroy(handle as Handle), ()));
    }
}

/// Time, and the pose as (x, y, z, qx, qy, qz, qw) where one is known.
fn at(instant: &shutterbug_instant) -> (f64, Option<[f64; 7]>) {
    let ([x, y, z], q) = (instant.world_from_camera.translation_m, instant.world_from_camera.rotation_xyzw);
    (instant.time_s, (instant.has_pose != 0).then_some([x, y, z, q[0], q[1], q[2], q[3]]))
}

impl Drop for Frame {
    fn drop(&mut self) {
        let handle = self.handle.swap(0, Ordering::AcqRel);
        if handle != 0 {
            Python::attach(|py| {
                let _ = self
                    .engine
                    .call(py, Some(handle), |_| (capi::shutterbug_frame_destroy(handle as Handle), ()));
            });
        }
    }
}
