//! `--method exact` with an exposure: tiles of the picture, what is in them, and what may come into them. Twin of
//! `glsl/exact_tiles.comp` (its constants are those of `glsl/include/exact_tile.glsl`).

use glam::{Vec2, Vec3, Vec4};

use crate::plane::Plane;

/// Pixels a side.
pub const TILE: usize = 8;
/// Shorter paths are not seen, px.
pub const SHORTEST_PX: f32 = 0.02;
/// Paths that jump by less from one px to the next are those of one surface.
pub const SMOOTH_PX: f32 = 0.35;

/// What differs by less, as a share of the brightest channel and by itself, is one colour.
pub const FLAT_SHARE: f32 = 1.0 / 256.0;
/// See [`FLAT_SHARE`].
pub const FLAT: f32 = 1.0 / 8192.0;

/// A tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Path of its nearest pixel.
    pub near: Vec4,
    /// Path of its farthest pixel.
    pub far: Vec4,
    /// 1/m.
    pub near_inverse: f32,
    /// 1/m.
    pub far_inverse: f32,
    /// Longest way to an end of a path along x and along y, px.
    pub reach: Vec2,
    /// Whether some path differs much from that of the pixel to the right or below.
    pub jumps: bool,
    /// Radiance half way between the least and the most of every channel.
    pub color: Vec3,
    /// Largest distance of a channel from it.
    pub away: f32,
}

/// All tiles, row by row. `texels`: radiance, `grid` a pixel's side; `inverses`: inverse distance, 1/m; `paths`:
/// `[height, width, 4]`.
///
/// # Panics
/// If shapes do not fit.
pub fn exact_tiles(texels: &Plane<f32>, inverses: &Plane<f32>, paths: &Plane<f32>, grid: usize) -> Vec<Tile> {
    let tiles = [paths.width.div_ceil(TILE), paths.height.div_ceil(TILE)];
    let all = (0..tiles[1]).flat_map(|y| (0..tiles[0]).map(move |x| [x, y]));
    all.map(|tile| exact_tile((texels, grid), inverses, paths, tile)).collect()
}

fn exact_tile(
    (texels, grid): (&Plane<f32>, usize),
    inverses: &Plane<f32>,
    paths: &Plane<f32>,
    tile: [usize; 2],
) -> Tile {
    let last = [paths.width - 1, paths.height - 1];
    let path = |x: usize, y: usize| Vec4::from_slice(paths.pixel(x.min(last[0]), y.min(last[1])));
    let mut found = Tile {
        near: Vec4::ZERO,
        far: Vec4::ZERO,
        near_inverse: -1.0,
        far_inverse: 1e30,
        reach: Vec2::ZERO,
        jumps: false,
        color: Vec3::ZERO,
        away: 0.0,
    };
    let (mut least, mut most) = (Vec3::splat(1e30), Vec3::splat(-1e30));
    for (row, column) in (0..TILE).flat_map(|row| (0..TILE).map(move |column| (row, column))) {
        // Beyond the border the last pixel is repeated.
        let (x, y) = ((tile[0] * TILE + column).min(last[0]), (tile[1] * TILE + row).min(last[1]));
        let own = path(x, y);
        let jump = (path(x + 1, y) - own).abs().max_element().max((path(x, y + 1) - own).abs().max_element());
        found.jumps |= jump >= SMOOTH_PX;
        found.reach = found.reach.max(own.abs().truncate().truncate().max(Vec2::new(own.z, own.w).abs()));
        for corner in [0, grid - 1] {
            let color = Vec3::from_slice(texels.pixel(x * grid + corner, y * grid + corner));
            (least, most) = (least.min(color), most.max(color));
        }
        let inverse = inverses.pixel(x, y)[0];
        if inverse > found.near_inverse {
            (found.near_inverse, found.near) = (inverse, own);
        }
        if inverse < found.far_inverse {
            (found.far_inverse, found.far) = (inverse, own);
        }
    }
    found.color = 0.5 * (least + most);
    found.away = (0.5 * (most - least)).max_element();
    found
}
