//! Background that a moving object uncovers during the exposure. The picture at the middle of the exposure does not
//! show it; the picture at its begin or its end does. So two more pictures are drawn, with one sample a pixel, around
//! such objects only. They fill what is behind the object for a part of the exposure. Where only the camera moves, the
//! uncovered strip is narrow and is filled from its neighbours.

use glam::{DVec2, DVec3};

use super::Input;
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::Stage;
use crate::engine::scene::{camera_path, check_coverage};
use crate::error::Result;
use crate::gpu::{Image, Recorder, RenderArea};
use crate::raster::{
    Geometry, Mesh, MotionGroups, RasterInput, RasterKind, RasterTarget, SamplePlan, SceneBuffers,
};

/// Objects that move by less during an exposure uncover too little to be seen, px.
const MIN_PATH_PX: f64 = 5.0;
/// What is nearer to the camera's plane, or behind it, is taken to be so near, m.
const NEAREST_M: f64 = 0.1;
/// When in the exposure, -0.5 to 0.5.
pub(super) const INSTANTS: [f64; 2] = [-0.5, 0.5];

/// Corners of the boxes around everything that moves by itself, each in its group's own frame, m.
pub(super) struct Bounds(Vec<(usize, [DVec3; 8])>);

impl Bounds {
    /// `mesh`: vertices hold numbers of groups.
    pub(super) fn new(mesh: &Mesh, groups: &MotionGroups) -> Self {
        let mut spans = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); groups.count()];
        for vertex in &mesh.vertices {
            let (low, high) = &mut spans[vertex.object as usize];
            let p = DVec3::from(vertex.position_m.map(f64::from));
            (*low, *high) = (low.min(p), high.max(p));
        }
        let corners = |(low, high): (DVec3, DVec3)| {
            [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
                let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
                DVec3::new(pick(0), pick(1), pick(2))
            })
        };
        let moving = spans.into_iter().enumerate().skip(1).filter(|(_, (low, _))| low.is_finite());
        Self(moving.map(|(group, span)| (group, corners(span))).collect())
    }

    /// Where something in view moves so far against the world during an exposure that what it uncovers is seen: a
    /// rectangle around all such things (low and high x and y, px of the picture, not limited to it; behind a lens
    /// without limits).
    pub(super) fn uncover(
        &self,
        stage: &Stage,
        groups: &MotionGroups,
        request: &FrameRequest,
    ) -> Option<[DVec2; 2]> {
        let shutter = &request.shutter;
        if self.0.is_empty() || shutter.exposure_time_s <= 0.0 || check_coverage(stage, request).is_err() {
            return None;
        }
        let path = camera_path(stage, request);
        let k = &stage.intrinsics;
        let size = DVec2::new(f64::from(k.width), f64::from(k.height));
        let (first_s, last_s) = (shutter.start_s, shutter.end_s() - shutter.exposure_time_s);
        let mut around: Option<[DVec2; 2]> = None;
        for begin_s in [first_s, 0.5 * (first_s + last_s), last_s] {
            let end_s = begin_s + shutter.exposure_time_s;
            let camera_from_world = path.pose_at(0.5 * (begin_s + end_s)).inverse();
            for (group, corners) in &self.0 {
                if !groups.covers(*group, begin_s) || !groups.covers(*group, end_s) {
                    continue;
                }
                let [from, to] = [begin_s, end_s].map(|t| {
                    let pose = camera_from_world.then_from(&groups.world_from_object(*group, t));
                    corners.map(|c| {
                        let p = pose.transform(c);
                        DVec2::new(k.fx * p.x, k.fy * p.y) / p.z.max(NEAREST_M) + DVec2::new(k.cx, k.cy)
                    })
                });
                let low = from.iter().chain(&to).copied().fold(DVec2::INFINITY, DVec2::min);
                let high = from.iter().chain(&to).copied().fold(DVec2::NEG_INFINITY, DVec2::max);
                let in_view = low.cmplt(size).all() && high.cmpgt(DVec2::ZERO).all();
                if in_view && from.iter().zip(&to).any(|(a, b)| (*a - *b).length() > MIN_PATH_PX) {
                    let [l, h] = around.unwrap_or([low, high]);
                    around = Some([l.min(low), h.max(high)]);
                }
            }
        }
        // Where a lens puts them is not where they are here: the whole picture then.
        around.map(|seen| match stage.lens {
            Some(_) => [DVec2::NEG_INFINITY, DVec2::INFINITY],
            None => seen,
        })
    }
}

/// The pictures of the begin and of the end of every line's exposure.
pub(super) struct Uncover {
    targets: [RasterTarget; 2],
    /// By frame in flight.
    inputs: Vec<[RasterInput; 2]>,
}

impl Uncover {
    /// Of `size` px, margin included.
    pub(super) fn new(stage: &Stage, room: &mut Room<'_>, size: [u32; 2], inputs: &[Input]) -> Result<Self> {
        let plan = SamplePlan { grid: 1, msaa: 1 };
        let target = || RasterTarget::new(&stage.context, &stage.buffers, RasterKind::Exact, size, plan);
        let targets = [target()?, target()?];
        room.prepare(targets.iter().flat_map(|t| t.attachments.images()))?;
        let bind = |input: &Input| -> Result<[RasterInput; 2]> {
            let bind = |t: &RasterTarget| t.bind_exact(&stage.buffers, &input.camera);
            Ok([bind(&targets[0])?, bind(&targets[1])?])
        };
        let inputs = inputs.iter().map(bind).collect::<Result<_>>()?;
        Ok(Self { targets, inputs })
    }

    /// Draws the triangles as they were just placed for one of [`INSTANTS`].
    pub(super) fn draw(
        &self,
        recorder: &mut Recorder<'_>,
        scene: (&SceneBuffers, &Geometry),
        (slot, instant): (usize, usize),
        area: RenderArea,
    ) {
        self.targets[instant].draw_exact(recorder, scene, &self.inputs[slot][instant], area);
    }

    /// Radiance at one of [`INSTANTS`].
    pub(super) fn picture(&self, instant: usize) -> &Image {
        &self.targets[instant].attachments.colors()[0]
    }
}
