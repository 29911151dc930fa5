//! Triangles in the device's memory beside those of [`super::SceneBuffers`]: the same scene cut more finely.

use std::mem::offset_of;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};

use super::scene_buffers::vertex_rows;
use super::tessellate::Mesh;
use crate::assert_element_layout;
use crate::error::Result;
use crate::gpu::{Buffer, Context, Location, Slot, Usage, VertexFormat};
use crate::scene::Draw;

/// An upload that takes longer than this is stuck.
const UPLOAD_LIMIT: Duration = Duration::from_secs(120);

/// `Placed` of `exact_place.glsl`.
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
assert_element_layout!(
    "exact_place.comp",
    "PlacedVertices",
    Placed { clip_xyw, position_m, normal, eye_m, uv, kd, ks_ns, group }
);

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

/// Vertices, what a frame makes of them, and indices.
pub struct Geometry {
    pub(super) vertices: Buffer,
    pub(super) vertex_count: u32,
    /// Written by [`super::Place`] in every frame.
    pub(super) placed: Buffer,
    pub(super) indices: Buffer,
    pub(super) draws: Vec<Draw>,
}

impl Geometry {
    /// Uploads a mesh and waits for it.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, mesh: &Mesh) -> Result<Self> {
        let rows = vertex_rows(&mesh.vertices);
        let vertices: &[u8] = bytemuck::cast_slice(&rows);
        let indices: &[u8] = bytemuck::cast_slice(&mesh.indices);
        let staged = |name: &str, bytes: &[u8]| {
            let mut staging =
                Buffer::new(context, name, bytes.len() as u64, Usage::Transfer, Location::Upload)?;
            staging.write(0, bytes);
            Ok(staging)
        };
        let from = [staged("cut vertices", vertices)?, staged("cut indices", indices)?];
        let device = |name: &str, bytes: &[u8], usage: Usage| {
            Buffer::new(context, name, bytes.len() as u64, usage, Location::Device)
        };
        let geometry = Self {
            vertices: device("cut vertices", vertices, Usage::VertexTexels)?,
            vertex_count: mesh.vertices.len() as u32,
            placed: Buffer::new(
                context,
                "placed vertices",
                mesh.vertices.len() as u64 * size_of::<Placed>() as u64,
                Usage::StorageVertex,
                Location::Device,
            )?,
            indices: device("cut indices", indices, Usage::Index)?,
            draws: mesh.draws.clone(),
        };
        let mut slot = Slot::new(context, "geometry upload")?;
        let mut recorder = slot.begin()?;
        for (from, to) in from.iter().zip([&geometry.vertices, &geometry.indices]) {
            recorder.copy_buffer(from, to, from.bytes());
        }
        recorder.barrier();
        recorder.finish();
        slot.submit()?;
        slot.wait(UPLOAD_LIMIT)?;
        Ok(geometry)
    }
}
