//! Poses in another convention than the capture's: each is tried, and the one in which the frames resemble the
//! simulation is named.

use glam::DQuat;

use super::geometry::{LEFT, UNLIKE};
use super::thumbs::Thumb;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use shutterbug::camera::Pose;
use shutterbug::capture::Capture;
use shutterbug::error::Result;
use shutterbug::plane::stats::median;

/// Most frames that are rendered for each convention.
const FRAMES: usize = 6;

/// A convention, in words, and the pose that is meant by one that was read.
type Convention = (&'static str, fn(&Pose) -> Pose);

/// Conventions that poses are often written in.
const CONVENTIONS: [Convention; 5] = [
    ("from the world to the camera, the inverse of what is asked for", Pose::inverse),
    ("with w before x, y and z of the quaternions", |p| turned(p, w_first(p.rotation))),
    ("of a camera whose y axis points up and z axis backwards (OpenGL, Blender, NeRF)", |p| {
        turned(p, p.rotation * Pose::opengl_from_camera())
    }),
    ("of a body whose x axis points forward, y left and z up (ROS)", |p| {
        turned(p, p.rotation * Pose::body_from_camera())
    }),
    ("of a camera in the axes of a robot's body: x where the picture's z is", |p| {
        turned(p, p.rotation * Pose::body_from_camera().conjugate())
    }),
];

fn turned(pose: &Pose, rotation: DQuat) -> Pose {
    Pose { rotation, ..*pose }
}

/// Four numbers w, x, y, z that were read as x, y, z, w.
fn w_first(read: DQuat) -> DQuat {
    DQuat::from_xyzw(read.y, read.z, read.w, read.x)
}

/// In which convention the poses seem to be, if the frames do not resemble the simulation as the poses were read.
///
/// # Errors
/// Those of rendering. [`shutterbug::error::Error::OutOfTime`].
pub(super) fn convention(
    forward: &Forward,
    capture: &Capture,
    evidence: &Evidence,
    (given, as_is): (&Theta, f64),
) -> Result<Option<String>> {
    let (Some(context), None) = (&forward.context, &forward.outside) else { return Ok(None) };
    if as_is <= UNLIKE {
        return Ok(None);
    }
    let all: Vec<usize> = (0..evidence.frames.len()).collect();
    let frames = spread_out(&all, FRAMES).into_iter().map(|at| evidence.frames[at].clone()).collect();
    let some = Evidence { frames, ..evidence.clone() };
    let places: Vec<usize> = (0..some.frames.len()).collect();
    let real: Vec<Thumb> = some.frames.iter().map(|f| Thumb::of(&f.dn)).collect();
    let mut other = capture.clone();
    let mut best: Option<(f64, &str)> = None;
    for (name, meant) in CONVENTIONS {
        other.trajectory = capture.trajectory.mapped(meant);
        let mut forward = Forward::new(Some(context), &other, &some, None, forward.budget.clone())?;
        let pictures = forward.simulate(&places, given, Quality::Coarse)?;
        let unlike = median(real.iter().zip(&pictures).map(|(real, dn)| real.unlike(&Thumb::of(dn))));
        if best.is_none_or(|b| unlike < b.0) {
            best = Some((unlike, name));
        }
    }
    let told = best.filter(|(left, _)| *left < UNLIKE && *left < LEFT * as_is);
    Ok(told.map(|(_, name)| {
        format!(
            "the poses of trajectory.tum look like those {name}: read so, the real frames resemble the simulation, as \
             they are they do not; expected are poses of the camera in the world (x right, y down, z forward), \
             quaternions as x y z w"
        )
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn each_convention_gives_back_the_pose_that_was_meant() {
        let rotation = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.9, 0.2);
        let pose = Pose { rotation, translation_m: DVec3::new(1.0, 2.0, 3.0) };
        let r = rotation;
        let gl = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z));
        let written = [
            pose.inverse(),
            turned(&pose, DQuat::from_xyzw(r.w, r.x, r.y, r.z)),
            turned(&pose, r * gl),
            turned(&pose, r * Pose::body_from_camera().conjugate()),
            turned(&pose, r * Pose::body_from_camera()),
        ];
        for ((name, meant), read) in CONVENTIONS.iter().zip(written) {
            let back = meant(&read);
            assert!(back.rotation.dot(r).abs() > 1.0 - 1e-12, "{name}: {back:?}");
            assert!((back.translation_m - pose.translation_m).length() < 1e-12, "{name}");
            assert!(read.rotation.dot(r).abs() < 0.999, "control: {name} changes the pose");
        }
        let forward = Pose::body_from_camera() * DVec3::Z;
        assert!((forward - DVec3::X).length() < 1e-12, "a camera looks along the body's x axis: {forward}");
    }
}
