//! Poses in any convention, and whether what is said of frames agrees with them.
#![allow(unsafe_code)]

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use shutterbug::capi::{
    self, shutterbug_agreement, shutterbug_camera, shutterbug_depth_convention, shutterbug_motion_convention,
    shutterbug_pose, shutterbug_pose_convention, shutterbug_stamped_pose, shutterbug_view,
};

use crate::abi::sized;
use crate::buffers::{Doubles, Kind, Picture};
use crate::status::exception;

const NO_POSE: shutterbug_pose =
    shutterbug_pose { translation_m: [0.0; 3], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] };

/// How motion vectors are meant: direction, unit, y axis, scale, and the time that one spans, s.
pub type MotionConvention = (u32, u32, u32, (f64, f64), f64);

/// Poses over time in the library's own convention.
#[pyclass(frozen, module = "shutterbug._core")]
pub struct Poses(pub Vec<shutterbug_stamped_pose>);

#[pymethods]
impl Poses {
    /// `times_s`: (n) of float64, s. `values`: (n, 16) of float64, 4x4 matrices row by row, or (n, 7). `form`, `axes`
    /// and `direction` are the numbers of `shutterbug_pose_convention`; `metres` is one unit of the translation.
    #[new]
    fn new(
        py: Python<'_>,
        times_s: Doubles,
        values: Doubles,
        form: u32,
        axes: u32,
        direction: u32,
        metres: f64,
    ) -> PyResult<Self> {
        let (times, numbers) = (times_s.0.to_vec(py)?, values.0.to_vec(py)?);
        let each = if form >= 2 { 16 } else { 7 };
        if numbers.len() != times.len() * each {
            let text = format!("{} times and {} numbers: each pose has {each}", times.len(), numbers.len());
            return Err(PyValueError::new_err(text));
        }
        let mut convention: shutterbug_pose_convention = sized();
        (convention.form, convention.axes) = (form, axes);
        (convention.direction, convention.metres) = (direction, metres);
        let poses = times.iter().zip(numbers.chunks_exact(each));
        poses
            .map(|(time_s, values)| stamped(py, &convention, *time_s, values))
            .collect::<PyResult<_>>()
            .map(Self)
    }

    /// The poses as (time, x, y, z, qx, qy, qz, qw), s and m.
    fn values(&self) -> Vec<[f64; 8]> {
        let row = |p: &shutterbug_stamped_pose| {
            let ([x, y, z], q) = (p.world_from_camera.translation_m, p.world_from_camera.rotation_xyzw);
            [p.time_s, x, y, z, q[0], q[1], q[2], q[3]]
        };
        self.0.iter().map(row).collect()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

fn stamped(
    py: Python<'_>,
    convention: &shutterbug_pose_convention,
    time_s: f64,
    values: &[f64],
) -> PyResult<shutterbug_stamped_pose> {
    let (mut pose, mut text) = (NO_POSE, [0u8; 512]);
    // SAFETY: all is alive through the call, `values` has as many numbers as the form says, `text` the room that is
    // stated.
    let status = unsafe {
        let said = text.as_mut_ptr().cast();
        capi::shutterbug_pose_convert(convention, values.as_ptr(), &raw mut pose, said, text.len() as u64)
    };
    if status != 0 {
        return Err(exception(py, status, &until_nul(&text)));
    }
    Ok(shutterbug_stamped_pose { time_s, world_from_camera: pose })
}

fn until_nul(text: &[u8]) -> String {
    let length = text.iter().position(|b| *b == 0).unwrap_or(text.len());
    String::from_utf8_lossy(&text[..length]).into_owned()
}

/// A preset of `shutterbug_motion_preset` by its number: direction, unit, y axis, scale and interval.
#[pyfunction]
pub fn motion_preset(py: Python<'_>, preset: u32) -> PyResult<MotionConvention> {
    let (mut c, mut text): (shutterbug_motion_convention, _) = (sized(), [0u8; 512]);
    // SAFETY: all is alive through the call; `text` has the room that is stated.
    let status = unsafe {
        capi::shutterbug_motion_preset(preset, &raw mut c, text.as_mut_ptr().cast(), text.len() as u64)
    };
    if status != 0 {
        return Err(exception(py, status, &until_nul(&text)));
    }
    Ok((c.direction, c.unit, c.y_axis, (c.scale_x, c.scale_y), c.interval_s))
}

/// Whether two frames agree with what is said of their depth and poses: verdict, bits of the better convention, mean
/// difference as given and at best, and a sentence. `camera`: (width, height, fx, fy, cx, cy). `poses`: two, as the
/// user hands them in.
#[pyfunction]
pub fn check_conventions(
    py: Python<'_>,
    camera: (u32, u32, f64, f64, f64, f64),
    colors: [Bound<'_, PyAny>; 2],
    depths: [Bound<'_, PyAny>; 2],
    poses: PyRef<'_, Poses>,
) -> PyResult<(u32, u32, f64, f64, String)> {
    if poses.0.len() != 2 {
        return Err(PyValueError::new_err("two poses are expected"));
    }
    let mut pinhole: shutterbug_camera = sized();
    (pinhole.width, pinhole.height, pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px) = camera;
    pinhole.frame_period_s = 1.0;
    let metres: shutterbug_depth_convention = sized();
    let mut held = Vec::new();
    for (color, depth) in colors.iter().zip(&depths) {
        held.push((Picture::of(py, color, Kind::Color)?, Picture::of(py, depth, Kind::Depth)?));
    }
    let view = |i: usize| {
        let mut view: shutterbug_view = sized();
        (view.color, view.depth) = (held[i].0.image(), held[i].1.image());
        (view.depth_convention, view.world_from_camera) = (&raw const metres, poses.0[i].world_from_camera);
        view
    };
    let (first, second) = (view(0), view(1));
    let (mut agreement, mut text): (shutterbug_agreement, _) = (sized(), [0u8; 1024]);
    // SAFETY: all is alive through the call; `text` has the room that is stated.
    let status = unsafe {
        let said = text.as_mut_ptr().cast();
        let found = &raw mut agreement;
        capi::shutterbug_check_conventions(&pinhole, &first, &second, found, said, text.len() as u64)
    };
    if status != 0 {
        return Err(exception(py, status, &until_nul(&text)));
    }
    let a = agreement;
    Ok((a.verdict, a.change, a.as_given, a.best, until_nul(&text)))
}
