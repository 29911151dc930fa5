//! What the vertex stage needs of one instant: a matrix per object, computed in double precision.

use bytemuck::{Pod, Zeroable};
use glam::DMat4;

use crate::assert_element_layout;
use crate::camera::{Intrinsics, Trajectory};
use crate::scene::Object;

/// An instant to render, and the span over which motion is measured (equal ends where none is wanted).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// When, s on the capture's clock.
    pub time_s: f64,
    /// Begin of the motion's span, s.
    pub motion_from_s: f64,
    /// End of the motion's span, s.
    pub motion_to_s: f64,
}

impl Instant {
    /// An instant without motion.
    pub fn still(time_s: f64) -> Self {
        Self { time_s, motion_from_s: time_s, motion_to_s: time_s }
    }
}

/// `ObjectAtInstant` of `raster_vert.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ObjectRow {
    clip_from_object: [f32; 16],
    clip_from_object_at_from: [f32; 16],
    clip_from_object_at_to: [f32; 16],
    camera_centred_from_object: [f32; 16],
}

assert_element_layout!(
    "raster_color_motion.vert",
    "Instants",
    ObjectRow {
        clip_from_object,
        clip_from_object_at_from,
        clip_from_object_at_to,
        camera_centred_from_object
    }
);

/// Position of the camera in the world, m; the fourth component is unused.
pub type CameraRow = [f32; 4];

/// The rows of one instant, one per object. All times must lie inside the trajectories.
pub fn instant_rows(
    instant: &Instant,
    intrinsics: &Intrinsics,
    trajectory: &Trajectory,
    objects: &[Object],
) -> (Vec<ObjectRow>, CameraRow) {
    let clip_at = |time_s: f64| intrinsics.clip_from_camera() * trajectory.pose_at(time_s).inverse().matrix();
    let (now, from, to) =
        (clip_at(instant.time_s), clip_at(instant.motion_from_s), clip_at(instant.motion_to_s));
    let eye = trajectory.pose_at(instant.time_s).translation_m;
    let rows = objects.iter().map(|object| {
        let world_at = |time_s: f64| object.world_from_object(time_s).matrix();
        let world = world_at(instant.time_s);
        ObjectRow {
            clip_from_object: single(now * world),
            clip_from_object_at_from: single(from * world_at(instant.motion_from_s)),
            clip_from_object_at_to: single(to * world_at(instant.motion_to_s)),
            camera_centred_from_object: single(DMat4::from_translation(-eye) * world),
        }
    });
    (rows.collect(), [eye.x as f32, eye.y as f32, eye.z as f32, 0.0])
}

fn single(matrix: DMat4) -> [f32; 16] {
    matrix.as_mat4().to_cols_array()
}
