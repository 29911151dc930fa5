//! What messages contain, whatever their encoding: pictures, cameras, coordinate frames, inertial samples.

use std::borrow::Cow;

use glam::{DQuat, DVec3};

use super::wire::Fault;
use shutterbug::camera::Pose;
use shutterbug::error::Quoted;

/// How far the length of a quaternion may be from 1.
const QUATERNION_TOLERANCE: f64 = 1e-2;
/// Furthest coordinate, m.
const MAX_COORDINATE_M: f64 = 1e9;

/// A picture in a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture<'a> {
    pub(super) stamp_ns: i64,
    pub(super) frame: String,
    pub(super) body: Body<'a>,
}

/// Its values.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Body<'a> {
    /// As they are.
    Raw { width: u32, height: u32, encoding: String, big_endian: bool, step: u32, data: Cow<'a, [u8]> },
    /// A file's bytes; what it is called there.
    Packed { format: String, data: Cow<'a, [u8]> },
}

/// A camera's description.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct CameraInfo {
    pub(super) frame: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) model: String,
    pub(super) d: Vec<f64>,
    pub(super) k: [f64; 9],
    pub(super) r: [f64; 9],
    pub(super) p: [f64; 12],
    /// 0 and 1 both mean none.
    pub(super) binning: [u32; 2],
    /// x, y, width, height.
    pub(super) roi: [u32; 4],
}

/// One frame in another at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Link {
    pub(super) stamp_ns: i64,
    pub(super) parent: String,
    /// Empty where the message does not say whose pose it is.
    pub(super) child: String,
    pub(super) pose: Pose,
}

/// A sample of an inertial sensor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Inertial {
    pub(super) stamp_ns: i64,
    pub(super) frame: String,
    pub(super) turn_rad_s: DVec3,
    pub(super) acceleration_m_s2: DVec3,
}

/// Unit quaternion and position, or what is wrong with them.
pub(super) fn checked_pose(p: [f64; 3], q: [f64; 4]) -> Result<Pose, Fault> {
    if let Some(far) = p.iter().find(|v| v.is_nan() || v.abs() > MAX_COORDINATE_M) {
        return Err(Fault::new(format!("a coordinate of {} m", Quoted(*far)), "1e9 m at most"));
    }
    let rotation = DQuat::from_array(q);
    let length = rotation.length();
    if length.is_nan() || (length - 1.0).abs() > QUATERNION_TOLERANCE {
        return Err(Fault::new(
            format!("a quaternion of length {:.6}", Quoted(length)),
            "a unit quaternion x, y, z, w",
        ));
    }
    Ok(Pose { rotation: rotation.normalize(), translation_m: DVec3::from_array(p) })
}
