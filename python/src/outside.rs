//! A frame from outside, as Python gives it: a dictionary with the names of `shutterbug_outside`.
#![allow(unsafe_code)]

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use shutterbug::capi::{
    Status, shutterbug_body, shutterbug_depth_convention, shutterbug_image, shutterbug_motion_convention,
    shutterbug_outside, shutterbug_picture,
};

use crate::abi::sized;
use crate::buffers::{Kind, Picture};
use crate::convert::{MotionConvention, Poses};

/// Colour, depth and ids of one instant.
struct Shot {
    time_s: f64,
    color: Picture,
    depth: Option<Picture>,
    ids: Option<Picture>,
}

/// All that a frame is made of. It keeps Python's arrays while the library reads them.
pub struct Outside {
    numbers: Numbers,
    shots: Vec<Shot>,
    motions: Vec<Picture>,
    poses: Option<Py<Poses>>,
    bodies: Vec<(u32, Py<Poses>)>,
    motion_convention: shutterbug_motion_convention,
    depth_convention: shutterbug_depth_convention,
}

/// What is neither a picture nor a pose.
#[derive(Clone, Copy)]
struct Numbers {
    frame_index: u32,
    time_s: f64,
    first_motion_time_s: f64,
    motion_step_s: f64,
    nearest_m: f64,
    flags: u32,
    encoding: u32,
    margin_px: (u32, u32),
}

fn wanted<'py, T>(given: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error: Into<PyErr>>,
{
    let value = given.get_item(name)?.ok_or_else(|| PyTypeError::new_err(format!("`{name}` is missing")))?;
    value.extract().map_err(Into::into)
}

impl Outside {
    /// Reads the dictionary that `shutterbug/camera.py` makes.
    pub fn read(py: Python<'_>, given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let shots: Vec<ShotGiven<'_>> = wanted(given, "pictures")?;
        let motions: Vec<Bound<'_, PyAny>> = wanted(given, "motions")?;
        let bodies: Vec<(u32, Bound<'_, Poses>)> = wanted(given, "bodies")?;
        let poses: Option<Bound<'_, Poses>> = wanted(given, "poses")?;
        Ok(Self {
            numbers: Numbers {
                frame_index: wanted(given, "frame_index")?,
                time_s: wanted(given, "time_s")?,
                first_motion_time_s: wanted(given, "first_motion_time_s")?,
                motion_step_s: wanted(given, "motion_step_s")?,
                nearest_m: wanted(given, "nearest_m")?,
                flags: wanted(given, "flags")?,
                encoding: wanted(given, "encoding")?,
                margin_px: wanted(given, "margin_px")?,
            },
            shots: shots.iter().map(|shot| Shot::read(py, shot)).collect::<PyResult<_>>()?,
            motions: motions.iter().map(|m| Picture::of(py, m, Kind::Motion)).collect::<PyResult<_>>()?,
            poses: poses.map(Bound::unbind),
            bodies: bodies.into_iter().map(|(id, poses)| (id, poses.unbind())).collect(),
            motion_convention: motion_convention(wanted(given, "motion_convention")?),
            depth_convention: depth_convention(wanted(given, "depth_convention")?),
        })
    }

    /// Calls the library with the struct of the C ABI, which points into this.
    pub fn with(&self, call: impl FnOnce(*const shutterbug_outside) -> Status) -> Status {
        let images = |pictures: &[Picture]| -> Vec<shutterbug_image> {
            // SAFETY: an image of a picture that is alive, read as the plain numbers that it is.
            pictures.iter().map(|p| unsafe { *p.image() }).collect()
        };
        let (motions, first) = (images(&self.motions), &self.shots[0]);
        let bodies: Vec<_> = self.bodies.iter().map(|(id, poses)| body(*id, poses.get())).collect();
        let further: Vec<_> = self.shots[1..].iter().map(Shot::picture).collect();
        let (n, mut o) = (self.numbers, sized::<shutterbug_outside>());
        (o.frame_index, o.time_s, o.color_time_s) = (n.frame_index, n.time_s, first.time_s);
        (o.first_motion_time_s, o.motion_step_s) = (n.first_motion_time_s, n.motion_step_s);
        (o.flags, o.encoding, o.nearest_m) = (n.flags, n.encoding, n.nearest_m);
        (o.margin_x_px, o.margin_y_px) = n.margin_px;
        (o.color, o.depth, o.ids) = (first.color.image(), image(&first.depth), image(&first.ids));
        if !motions.is_empty() {
            (o.motions, o.motion_count) = (motions.as_ptr(), motions.len() as u32);
            o.motion_convention = &raw const self.motion_convention;
        }
        o.depth_convention = &raw const self.depth_convention;
        if let Some(poses) = &self.poses {
            let poses = &poses.get().0;
            (o.poses, o.pose_count) = (poses.as_ptr(), poses.len() as u32);
        }
        if !bodies.is_empty() {
            (o.bodies, o.body_count) = (bodies.as_ptr(), bodies.len() as u32);
        }
        if !further.is_empty() {
            (o.pictures, o.picture_count) = (further.as_ptr(), further.len() as u32);
        }
        call(&raw const o)
    }
}

/// Time, colour, and depth and ids where they are given.
type ShotGiven<'py> = (f64, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

impl Shot {
    fn read(py: Python<'_>, (time_s, color, depth, ids): &ShotGiven<'_>) -> PyResult<Self> {
        let take = |array: &Option<Bound<'_, PyAny>>, kind| {
            array.as_ref().map(|array| Picture::of(py, array, kind)).transpose()
        };
        Ok(Self {
            time_s: *time_s,
            color: Picture::of(py, color, Kind::Color)?,
            depth: take(depth, Kind::Depth)?,
            ids: take(ids, Kind::Ids)?,
        })
    }

    fn picture(&self) -> shutterbug_picture {
        let (color, depth, ids) = (self.color.image(), image(&self.depth), image(&self.ids));
        shutterbug_picture { time_s: self.time_s, color, depth, ids }
    }
}

fn image(picture: &Option<Picture>) -> *const shutterbug_image {
    picture.as_ref().map_or(std::ptr::null(), Picture::image)
}

fn body(id: u32, poses: &Poses) -> shutterbug_body {
    shutterbug_body { id, pose_count: poses.0.len() as u32, poses: poses.0.as_ptr() }
}

fn motion_convention(
    (direction, unit, y_axis, scale, interval_s): MotionConvention,
) -> shutterbug_motion_convention {
    let mut convention: shutterbug_motion_convention = sized();
    (convention.direction, convention.unit, convention.y_axis) = (direction, unit, y_axis);
    ((convention.scale_x, convention.scale_y), convention.interval_s) = (scale, interval_s);
    convention
}

fn depth_convention((kind, near_m, far_m): (u32, f64, f64)) -> shutterbug_depth_convention {
    let mut convention: shutterbug_depth_convention = sized();
    (convention.kind, convention.near_m, convention.far_m) = (kind, near_m, far_m);
    convention
}
