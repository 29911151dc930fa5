//! What the methods that render a scene share: the scene on the device, the lens, margins, the sharp planes, and the
//! passes that more than one of them runs.

pub(crate) mod accumulate;
pub(crate) mod lens;
pub(crate) mod margin;
pub(crate) mod planes;
pub(crate) mod resolve;
pub(crate) mod taps;

use std::sync::Arc;

use crate::camera::{Intrinsics, ShutterTiming, Trajectory};
use crate::engine::frame::{FrameInstants, FrameRequest};
use crate::error::Result;
use crate::gpu::Context;
use crate::raster::{SamplePlan, SceneBuffers};
use crate::scene::Scene;

use lens::LensStage;

/// What all passes share.
pub(crate) struct Stage {
    pub(crate) buffers: SceneBuffers,
    pub(crate) scene: Arc<Scene>,
    pub(crate) trajectory: Arc<Trajectory>,
    pub(crate) intrinsics: Intrinsics,
    pub(crate) plan: SamplePlan,
    /// The lens of the frame that is being made.
    pub(crate) lens: Option<LensStage>,
    pub(crate) context: Arc<Context>,
}

/// The camera's path as the frame sees it.
pub(crate) fn camera_path(stage: &Stage, request: &FrameRequest) -> Arc<Trajectory> {
    if request.static_camera {
        Arc::new(Trajectory::fixed(stage.trajectory.pose_at(request.shutter.start_s)))
    } else {
        stage.trajectory.clone()
    }
}

/// Instants and poses of a frame.
pub(crate) fn instants(path: &Trajectory, shutter: &ShutterTiming) -> FrameInstants {
    let at = |time_s: f64| (time_s, path.pose_at(time_s));
    FrameInstants {
        first_line_start: at(shutter.start_s),
        middle: at(shutter.middle_s()),
        last_line_end: at(shutter.end_s()),
    }
}

/// Whether camera and objects have poses for the whole frame.
pub(crate) fn check_coverage(stage: &Stage, request: &FrameRequest) -> Result<()> {
    let what = format!("frame {}", request.index);
    let (start_s, end_s) = (request.shutter.start_s, request.shutter.end_s());
    stage.trajectory.require(start_s, if request.static_camera { start_s } else { end_s }, &what)?;
    for object in &stage.scene.objects {
        if let Some(trajectory) = &object.trajectory {
            trajectory.require(start_s, end_s, &format!("{what}, object `{}`", object.name))?;
        }
    }
    Ok(())
}

/// Times for which camera and all objects have poses.
pub(crate) fn covered_span_s(stage: &Stage, path: &Trajectory) -> (f64, f64) {
    let objects = stage.scene.objects.iter().filter_map(|o| o.trajectory.as_deref());
    objects
        .chain(std::iter::once(path))
        .map(Trajectory::span_s)
        .fold((f64::NEG_INFINITY, f64::INFINITY), |(from, to), (first, last)| (from.max(first), to.min(last)))
}
