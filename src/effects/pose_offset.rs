//! The camera is not mounted as assumed: true camera = trajectory camera, then this rotation in its optical frame
//! (docs/reference/camera.md). Acts where an engine is given its trajectory:
//! [`crate::capture::Capture::true_trajectory`].

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::camera::Trajectory;
use crate::chain::{Effect, Fit, Law, ParamSpec, Settings, Stage, Value};

/// The effect; its values live in [`Settings`].
pub struct PoseOffset;

pub(super) const SPECS: &[ParamSpec] = &[ParamSpec::vector3(
    "rotvec_rad",
    "rad",
    PI,
    "axis times angle, in the optical frame (x right, y down, z forward)",
)
.fit(
    // A turn about the optical axis moves what is near it little.
    Fit { step: [5e-4, 5e-4, 1e-3], ..Fit::by(5e-4) }
        .within(-0.3, 0.3)
        .trial(Law::Direction, 0.004, 0.03)
        .graded(1e-4, 1e-2),
)];

impl PoseOffset {
    /// Trajectory camera from true camera; the identity when the effect is off.
    pub fn rotation(settings: &Settings) -> DQuat {
        match settings.get("pose_offset", "rotvec_rad") {
            Some(Value::Vector3(rotvec)) => DQuat::from_scaled_axis(DVec3::from(rotvec)),
            _ => DQuat::IDENTITY,
        }
    }

    /// The true camera's trajectory.
    pub fn apply(settings: &Settings, trajectory: &Trajectory) -> Trajectory {
        let rotation = Self::rotation(settings);
        if rotation == DQuat::IDENTITY { trajectory.clone() } else { trajectory.turned(rotation) }
    }
}

impl Effect for PoseOffset {
    fn id(&self) -> &'static str {
        "pose_offset"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::SetUp
    }

    fn shown_by(&self) -> &'static str {
        "the same place while the camera turns upside down and back"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pose;
    use std::path::Path;

    #[test]
    fn a_turn_about_y_looks_to_the_right() {
        let pose = Pose { rotation: DQuat::from_rotation_x(0.3), translation_m: DVec3::new(1.0, 2.0, 3.0) };
        let other = Pose { rotation: DQuat::from_rotation_x(0.5), translation_m: DVec3::ZERO };
        let path = Trajectory::new(Path::new("t"), vec![0.0, 1.0], vec![pose, other]).expect("two poses");
        let mut settings = Settings::default();
        assert_eq!(PoseOffset::apply(&settings, &path).pose_at(0.5), path.pose_at(0.5));
        settings.set(&PoseOffset, "rotvec_rad", Value::Vector3([0.0, 0.1, 0.0])).expect("in range");
        let turned = PoseOffset::apply(&settings, &path);
        // In the optical frame of the trajectory's camera the true optical axis is turned towards +x.
        for t in [0.0, 0.37, 1.0] {
            let (was, is) = (path.pose_at(t), turned.pose_at(t));
            let axis = was.rotation.inverse() * (is.rotation * DVec3::Z);
            assert!((axis - DVec3::new(0.1_f64.sin(), 0.0, 0.1_f64.cos())).length() < 1e-9, "{t}: {axis}");
            assert_eq!(was.translation_m, is.translation_m);
        }
    }
}
