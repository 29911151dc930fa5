//! The kernel that places vertices at the times of their lines (`exact_place.comp`).

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{Geometry, LensPush, SceneBuffers};
use crate::assert_push_layout;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, Buffer, ComputePipeline, Context, Recorder};
use crate::kernels::kernel;

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

/// The kernels.
pub struct Place {
    /// That read texels, and that read storage buffers; of each without and with a lens, whose bindings are the same.
    kernels: [[ComputePipeline; 2]; 2],
}

/// A geometry and the knots, bound for the kernels that can read them.
pub struct PlaceInput {
    group: BindGroup,
    words: bool,
}

impl Place {
    /// For a scene, lit or not.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, scene: &SceneBuffers) -> Result<Self> {
        let texels = const { kernel("exact_place.comp") };
        let words = const { kernel("exact_place_words.comp") };
        let make =
            |kernel, lens: u32| ComputePipeline::specialized(context, kernel, &[scene.lit.into(), lens]);
        let kernels = [[make(texels, 0)?, make(texels, 1)?], [make(words, 0)?, make(words, 1)?]];
        Ok(Self { kernels })
    }

    /// Binds a geometry and the rows of [`super::MotionGroups::knot_rows`].
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, scene: &SceneBuffers, geometry: &Geometry, knots: &Buffer) -> Result<PlaceInput> {
        let words = [&geometry.vertices, knots, &scene.materials].iter().any(|b| !b.has_texels());
        let group = self.kernels[usize::from(words)][0].bind(&[
            ("vertices", Bound::Buffer(&geometry.vertices)),
            ("knots", Bound::Buffer(knots)),
            ("materials", Bound::Buffer(&scene.materials)),
            ("PlacedVertices", Bound::Buffer(&geometry.placed)),
        ])?;
        Ok(PlaceInput { group, words })
    }

    /// Places all vertices of the geometry that the input binds.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        geometry: &Geometry,
        input: &PlaceInput,
        push: &PlacePush,
    ) {
        let push = PlacePush { vertex_count: geometry.vertex_count, ..*push };
        let kernel = &self.kernels[usize::from(input.words)][push.lens.index()];
        recorder.dispatch(kernel, &input.group, &push, [geometry.vertex_count, 1]);
    }
}
