//! Rigid transforms, named by the spaces they join: `world_from_camera`, `world_from_object`.

use glam::{DMat3, DMat4, DQuat, DVec3};

/// A rigid transform `p_to = rotation p_from + translation_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Position of the origin of the source frame, m.
    pub translation_m: DVec3,
}

impl Pose {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation_m: DVec3::ZERO };

    /// Between `self` (at 0) and `other` (at 1): linear position, rotation on the shorter arc
    /// (docs/reference/capture.md).
    pub fn interpolate(&self, other: &Self, at: f64) -> Self {
        Self {
            rotation: self.rotation.slerp(other.rotation, at).normalize(),
            translation_m: self.translation_m.lerp(other.translation_m, at),
        }
    }

    /// The inverse transform.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation_m: -(rotation * self.translation_m) }
    }

    /// `self` after `other`: `world_from_camera.then_from(camera_from_x)` is `world_from_x`.
    pub fn then_from(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation_m: self.rotation * other.translation_m + self.translation_m,
        }
    }

    /// `other` seen from `self`: `a_from_world.inverse()` after the other's, without what both are far from the origin.
    pub fn relative(&self, other: &Self) -> Self {
        let back = self.rotation.conjugate();
        Self {
            rotation: back * other.rotation,
            translation_m: back * (other.translation_m - self.translation_m),
        }
    }

    /// Transforms a point, m.
    #[inline]
    pub fn transform(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation_m
    }

    /// A camera's axes (x right, y down, z forward) in those of OpenGL and Blender (x right, y up, z backward).
    pub fn opengl_from_camera() -> DQuat {
        DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0)
    }

    /// The axes of a camera that looks along the x axis of a robot's body, in the body's (x forward, y left, z up; ROS
    /// REP 103).
    pub fn body_from_camera() -> DQuat {
        DQuat::from_mat3(&DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X))
    }

    /// As a column-major matrix.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_rotation_translation(self.rotation, self.translation_m)
    }
}
