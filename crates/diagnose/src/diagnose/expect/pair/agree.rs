//! Whether the planes beside simulated frames fit them: depth and poses, or motion, have to carry one frame onto the
//! next. These frames have no noise and no unknown camera, so what does not carry them is wrong itself: a unit, a sign,
//! an order of numbers.

use std::path::Path;

use glam::Vec2;

use super::align::apart_px;
use super::sample::read;
use super::{Geometry, GoOn, SimFrames, encoded};
use crate::diagnose::evidence::quality::Quality;
use shutterbug::camera::{Intrinsics, Trajectory};
use shutterbug::error::{Error, Result};
use shutterbug::plane::stats::median;
use shutterbug::plane::{Plane, three};

/// Pairs of frames that are looked at.
const LOOKED_AT: usize = 5;
/// Planes that leave more than this part of how far content moves are wrong: a coarse depth leaves a few per cent.
const LEAVES: f64 = 0.25;
/// From this part on they are said to fit badly.
const FITS_BADLY: f64 = 0.1;
/// Content that moves less is not seen to move, px.
const LEAST_PX: f64 = 0.5;

/// What does not fit, if it is little.
///
/// # Errors
/// Planes that carry no frame onto the next. No time is left.
pub(super) fn notes(
    sim: &Path,
    frames: &SimFrames,
    k: &Intrinsics,
    path: Option<&Trajectory>,
    go_on: GoOn<'_>,
) -> Result<Option<String>> {
    if frames.geometry == Geometry::None {
        return Ok(None);
    }
    let steps: Vec<usize> = (1..frames.frames.len()).filter(|&i| frames.follows(i)).collect();
    let some = (0..steps.len().min(LOOKED_AT)).map(|n| steps[n * steps.len() / steps.len().min(LOOKED_AT)]);
    let (mut moved, mut left) = (Vec::new(), Vec::new());
    for i in some {
        go_on()?;
        let Some(carried) = carried(frames, k, path, i) else { continue };
        let [from, to] = [i - 1, i].map(|i| encoded(&frames.frames[i].radiance));
        let Some(px) = apart_px(&from, &to, go_on)?.filter(|px| *px >= LEAST_PX) else { continue };
        moved.push(px);
        // Nothing in common: no better than not carried at all.
        left.push(apart_px(&from, &carried, go_on)?.unwrap_or(px).min(px));
    }
    if moved.is_empty() {
        return Ok(None);
    }
    let (moved, left) = (median(moved), median(left));
    let planes = match (frames.geometry, path) {
        (Geometry::Motion, _) => "motion/",
        _ => "depth/ and the camera's path",
    };
    let said = format!(
        "content moves {moved:.1} px from one simulated frame to the next, and {planes} leave {left:.1}"
    );
    if left > LEAVES * moved {
        return Err(Error::input(
            sim,
            None,
            said,
            "planes that carry a simulated frame onto the next: depth in m along the optical axis; motion in px a \
             frame period, to where content is next; poses from the camera to the world, in m, as x y z qx qy qz qw; \
             fx, fy, cx and cy in px",
        ));
    }
    Ok((left > FITS_BADLY * moved).then(|| {
        format!("{said}: times, lenses and poses are no better known than that; check units, poses and camera.toml")
    }))
}

/// A frame as the planes carry it onto the one before it, DN; what they say nothing of stays where it is.
fn carried(frames: &SimFrames, k: &Intrinsics, path: Option<&Trajectory>, i: usize) -> Option<Plane<f32>> {
    let (before, after) = (&frames.frames[i - 1], &frames.frames[i]);
    let motion = before.motion[0].as_ref().filter(|_| frames.geometry == Geometry::Motion);
    if frames.geometry == Geometry::Motion && motion.is_none() {
        return None;
    }
    let poses = path.map(|path| [i - 1, i].map(|i| path.pose_at(frames.times_s[i])));
    let (w, h) = (before.radiance.width, before.radiance.height);
    let to = |at: usize| -> Option<Vec2> {
        let here = Vec2::new((at % w) as f32 + 0.5, (at / w) as f32 + 0.5);
        if let Some(motion) = motion {
            return Some(here + Vec2::new(motion.data[2 * at], motion.data[2 * at + 1]));
        }
        let (depth, [from, to]) = (before.depth.as_ref()?.data[at], poses?);
        // The sky only turns.
        let depth = if depth.is_finite() { f64::from(depth) } else { 1e9 };
        let point = to.inverse().transform(from.transform(k.ray(here.as_dvec2()) * depth));
        Some(k.project(point)?.as_vec2())
    };
    let inside = |s: &Vec2| s.x > 0.0 && s.y > 0.0 && s.x < w as f32 && s.y < h as f32;
    let data = (0..w * h).flat_map(|at| match to(at).filter(inside) {
        Some(s) => read(&after.radiance, s, Quality::Fine),
        None => three(|c| after.radiance.data[3 * at + c]),
    });
    Some(encoded(&Plane { width: w, height: h, channels: 3, data: data.collect() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::pair::align::tests::texture;
    use crate::diagnose::expect::pair::frames::SimFrame;
    use shutterbug::camera::Pose;
    use std::sync::Arc;

    const K: Intrinsics = Intrinsics { width: 96, height: 72, fx: 90.0, fy: 90.0, cx: 48.0, cy: 36.0 };

    /// A wall 3 m away that a camera passes by 0.1 m a frame, with planes that are falsified by a factor.
    fn frames(geometry: Geometry, factor: f32) -> (SimFrames, Trajectory) {
        let wall = |x: f64, y: f64| texture(30.0 * x + 100.0, 30.0 * y + 100.0) / 255.0;
        let one = |i: usize| {
            let radiance = Plane::from_fn(96, 72, |x, y| {
                let ray = K.ray(glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) * 3.0;
                [wall(ray.x + 0.1 * i as f64, ray.y); 3]
            });
            SimFrame {
                radiance: Arc::new(radiance),
                depth: Some(Plane::from_fn(96, 72, |_, _| [3.0 * factor])),
                motion: [Some(Plane::from_fn(96, 72, |_, _| [-3.0 * factor, 0.0])), None],
                own: None,
                open: Plane::from_fn(96, 72, |_, _| [1.0]),
                jumps: None,
            }
        };
        let times_s: Vec<f64> = (0..6).map(|i| 0.05 * f64::from(i)).collect();
        let at =
            |i: usize| Pose { translation_m: glam::DVec3::new(0.1 * i as f64, 0.0, 0.0), ..Pose::IDENTITY };
        let path =
            Trajectory::new(Path::new("path"), times_s.clone(), (0..6).map(at).collect()).expect("a path");
        let frames =
            SimFrames { frames: (0..6).map(one).collect(), times_s, period_s: 0.05, geometry, linear: true };
        (frames, path)
    }

    #[test]
    fn planes_that_do_not_carry_a_frame_onto_the_next_are_refused() {
        let said = |geometry, factor| {
            let (frames, path) = frames(geometry, factor);
            notes(Path::new("sim"), &frames, &K, Some(&path), &|| Ok(()))
        };
        for geometry in [Geometry::Depth, Geometry::Motion] {
            assert_eq!(said(geometry, 1.0).expect("they fit"), None, "{geometry:?}");
            assert!(said(geometry, 1.15).expect("they fit badly").is_some(), "{geometry:?}");
            for factor in [1000.0, f32::NAN, 0.0] {
                let error = said(geometry, factor).expect_err("no planes of these frames").to_string();
                assert!(error.contains("3.0 px from one simulated frame"), "{geometry:?} {factor}: {error}");
            }
        }
        assert!(said(Geometry::Motion, -1.0).is_err() && said(Geometry::Motion, 2.0).is_err());
    }
}
