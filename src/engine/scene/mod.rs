//! What the methods that render a scene share: the scene on the device, the lens, margins, the sharp planes, and the
//! passes that more than one of them runs.

pub(crate) mod accumulate;
pub(crate) mod clusters;
pub(crate) mod lens;
pub(crate) mod margin;
pub(crate) mod planes;
pub(crate) mod reach;
pub(crate) mod resolve;
pub(crate) mod taps;

use std::sync::Arc;
use std::time::Duration;

use crate::camera::{Intrinsics, ShutterTiming, Trajectory};
use crate::engine::finish::Finish;
use crate::engine::flight::Room;
use crate::engine::frame::{FrameInstants, FrameRequest};
use crate::engine::slots::FrameSlot;
use crate::error::Result;
use crate::gpu::{Context, Recorder};
use crate::raster::{Instant, SamplePlan, SceneBuffers};
use crate::scene::Scene;

use clusters::{Clusters, Sought};
use lens::{Channel, LensStage};
use planes::{Ending, PlanesPass};
use reach::{Projection, Reach};
use taps::Taps;

/// What a method can be told, and how it is made of that: one for each method, in its folder.
pub(crate) trait Choices {
    /// The method, ready for frames like `expected`.
    fn make(
        &self,
        stage: &Stage,
        room: &mut Room<'_>,
        expected: &[FrameRequest],
    ) -> Result<Box<dyn Renderer>>;

    /// Refuses choices that know only the ideal pinhole.
    fn check_lens(&self) -> Result<()> {
        Ok(())
    }

    /// Whether it draws the scene as it stands at an instant: triangles are then cut for the lens ahead of it.
    fn draws_instants(&self) -> bool {
        true
    }
}

/// A way to render the frames of a scene. It owns what it draws into; slots, lens, planes and the chain are given to
/// it.
pub(crate) trait Renderer: Send + Sync {
    /// Columns and rows rendered beyond each side of the picture.
    fn margin_px(&self) -> [u32; 2] {
        [0, 0]
    }

    /// Whether a frame can be made with what there is.
    fn fits(&mut self, _stage: &Stage, _request: &FrameRequest) -> bool {
        true
    }

    /// Makes what such a frame lacks; nothing is in flight.
    fn fit(&mut self, _stage: &Stage, _room: &mut Room<'_>, _request: &FrameRequest) -> Result<()> {
        Ok(())
    }

    /// The lens is another one.
    fn forget_lens(&mut self) {}

    /// What frames so far have left behind goes.
    fn forget(&mut self) {}

    /// Records a frame that fits and hands it to the device.
    fn submit(&mut self, shot: Shot<'_>) -> Result<()>;

    /// What the last pass before the radiance reads for a frame, where others can be handed the same.
    fn taps(&self, _stage: &Stage, _request: &FrameRequest, _path: &Trajectory) -> Option<Taps<'_>> {
        None
    }
}

/// A frame that is being made.
pub(crate) struct Shot<'a> {
    pub(crate) stage: &'a Stage,
    pub(crate) slot: &'a mut FrameSlot,
    pub(crate) request: &'a FrameRequest,
    /// The camera's, as the frame sees it.
    pub(crate) path: &'a Trajectory,
    pub(crate) finish: &'a Finish,
    pub(crate) planes: Option<&'a PlanesPass>,
    /// Longest time that one of several submissions may take.
    pub(crate) limit: Duration,
}

impl<'a> Shot<'a> {
    /// Writes the rows of an instant, seen by `camera`.
    pub(crate) fn add(&mut self, camera: &Intrinsics, instant: &Instant) -> (u32, u32) {
        self.slot.inputs.add((self.path, &self.stage.scene.objects), camera, instant)
    }

    /// Writes what the end of the frame will draw.
    pub(crate) fn ending(&mut self) -> Ending<'a> {
        Ending::new(self.planes, self.stage, self.slot, self.request, self.path)
    }

    /// One submission: what `draw` records for each colour, then the end; `developed`: the chain is done already.
    pub(crate) fn submit(
        self,
        ending: &Ending<'_>,
        developed: bool,
        mut draw: impl FnMut(&mut Recorder<'_>, Channel),
    ) -> Result<()> {
        let Self { stage, slot, request, finish, .. } = self;
        let index = slot.index;
        let (mut recorder, to) = slot.begin()?;
        for channel in stage.channels() {
            draw(&mut recorder, channel);
            stage.merge(&mut recorder, channel);
        }
        ending.record(stage, &mut recorder, index, (finish, request, developed), to);
        recorder.finish();
        slot.gpu.submit()
    }
}

/// What all passes share.
pub(crate) struct Stage {
    pub(crate) buffers: SceneBuffers,
    pub(crate) scene: Arc<Scene>,
    pub(crate) clusters: Clusters,
    pub(crate) trajectory: Arc<Trajectory>,
    pub(crate) intrinsics: Intrinsics,
    pub(crate) plan: SamplePlan,
    /// The lens of the frame that is being made.
    pub(crate) lens: Option<LensStage>,
    pub(crate) context: Arc<Context>,
}

impl Stage {
    /// How far content is at `reference_s` from where it is at each of `times_s`, through the lens if there is one.
    pub(crate) fn reach(&self, path: &Trajectory, times: (f64, &[f64]), sought: Sought) -> Reach {
        let lens = self.lens.as_ref().map(|l| &l.extended);
        let projection = Projection { intrinsics: &self.intrinsics, lens };
        self.clusters.reach(&self.scene, path, &projection, times, sought)
    }
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
