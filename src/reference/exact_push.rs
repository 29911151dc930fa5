//! Parameters of the kernels of `--method exact` that gather blur: `exact_tiles`, `exact_neighbours`, `exact_gather`.

use bytemuck::{Pod, Zeroable};

/// Of `exact_tiles.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TilesPush {
    /// Tiles.
    pub size: [u32; 2],
    /// A pixel's part of the picture's sides.
    pub share_per_px: [f32; 2],
    /// Texels of a pixel's side.
    pub grid: f32,
}

/// Of `exact_neighbours.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct NeighboursPush {
    /// Tiles.
    pub size: [u32; 2],
    /// First tile that holds delivered pixels.
    pub first: [u32; 2],
    /// First tile that does not any more.
    pub end: [u32; 2],
    /// Tiles to look at on every side.
    pub radius: i32,
    /// Side of a tile, px.
    pub tile_px: f32,
}

/// Of `exact_gather.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GatherPush {
    /// Delivered px.
    pub size: [u32; 2],
    /// Rendered beyond each side, px.
    pub margin_px: [f32; 2],
    /// All that is rendered, px.
    pub picture_px: [f32; 2],
    /// A pixel's part of the picture's sides.
    pub share_per_px: [f32; 2],
    /// tau per line in scan order, as a vector over the picture.
    pub tau_per_px: [f32; 2],
    /// From where on the pictures of the exposure's begin and end can be read between pixels, px.
    pub drawn_from_px: [f32; 2],
    /// To where they can.
    pub drawn_to_px: [f32; 2],
    /// Most samples.
    pub most: i32,
    /// Tiles of a row.
    pub tiles_across: u32,
}
