//! The kernel that places vertices at the times of their lines (`exact_place.comp`).

use std::mem::offset_of;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{Geometry, LensPush, SceneBuffers};
use crate::assert_push_layout;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, Buffer, ComputePipeline, Context, Recorder, VertexFormat};
use crate::kernels::kernel;
use crate::scene::Vertex;

/// Push constants of `exact_place.comp`, explained there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct PlacePush {
    /// Number of vertices; set by [`Place::record`].
    pub vertex_count: u32,
    /// Rows a motion group.
    pub knot_count: u32,
    /// Earliest place among the knots.
    pub place_low: f32,
    /// Latest place among the knots.
    pub place_high: f32,
    /// Places per unit of normalised device coordinates.
    pub place_from_ndc: [f32; 2],
    /// Place of the line through the middle of the attachment.
    pub place_offset: f32,
    /// Nearest distance that is drawn, m.
    pub near_m: f32,
    /// The lens.
    pub lens: LensPush,
}
assert_push_layout!(
    "exact_place.comp",
    PlacePush { vertex_count, knot_count, place_low, place_high, place_from_ndc, place_offset, near_m, lens }
);

/// `Placed` of `exact_place.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Placed {
    clip_xyw: [f32; 3],
    position_m: [f32; 3],
    normal: [f32; 3],
    eye_m: [f32; 3],
    uv: [f32; 2],
    kd: [f32; 3],
    ks_ns: [f32; 4],
    group: u32,
}
// The shader reads vertices as they are.
const _: () = assert!(size_of::<Vertex>() == 40 && size_of::<Placed>() == 88);

pub(super) const PLACED_FORMAT: VertexFormat = VertexFormat {
    stride: size_of::<Placed>() as u32,
    attributes: &[
        (offset_of!(Placed, clip_xyw) as u32, 3),
        (offset_of!(Placed, position_m) as u32, 3),
        (offset_of!(Placed, normal) as u32, 3),
        (offset_of!(Placed, eye_m) as u32, 3),
        (offset_of!(Placed, uv) as u32, 2),
        (offset_of!(Placed, kd) as u32, 3),
        (offset_of!(Placed, ks_ns) as u32, 4),
        (offset_of!(Placed, group) as u32, 0),
    ],
};

/// The kernels.
pub struct Place {
    /// Without and with a lens; the bindings are the same.
    kernels: [ComputePipeline; 2],
}

impl Place {
    /// For a scene, lit or not.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, scene: &SceneBuffers) -> Result<Self> {
        let kernel = const { kernel("exact_place.comp") };
        let make = |lens: u32| ComputePipeline::specialized(context, kernel, &[scene.lit.into(), lens]);
        Ok(Self { kernels: [make(0)?, make(1)?] })
    }

    /// Binds a geometry and the rows of [`super::MotionGroups::knot_rows`].
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, scene: &SceneBuffers, geometry: &Geometry, knots: &Buffer) -> Result<BindGroup> {
        self.kernels[0].bind(&[
            ("Vertices", Bound::Buffer(&geometry.vertices)),
            ("Knots", Bound::Buffer(knots)),
            ("Materials", Bound::Buffer(&scene.materials)),
            ("PlacedVertices", Bound::Buffer(&geometry.placed)),
        ])
    }

    /// Places all vertices of the geometry that the group binds.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        geometry: &Geometry,
        group: &BindGroup,
        push: &PlacePush,
    ) {
        let push = PlacePush { vertex_count: geometry.vertex_count, ..*push };
        recorder.dispatch(&self.kernels[push.lens.index()], group, &push, [geometry.vertex_count, 1]);
    }
}
