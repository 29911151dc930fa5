//! `--method exact` with an exposure: how each tile is gathered. Twin of `glsl/exact_neighbours.comp`.

use std::ops::Range;

use glam::Vec4;

use super::exact_tiles::{FLAT, FLAT_SHARE, SHORTEST_PX, TILE, Tile};

/// How a tile is gathered; the number is `WAY` of `exact_gather.comp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Nothing moves, or nothing that moves has another colour.
    Resting = 0,
    /// One surface.
    Smooth = 1,
    /// Several.
    Layered = 2,
}

/// Paths of the nearest and of the farthest that may come into a tile, and how it is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Around {
    /// Path of the nearest.
    pub near: Vec4,
    /// Path of the farthest.
    pub far: Vec4,
    /// `None` for tiles that hold no delivered pixel.
    pub way: Option<Way>,
}

/// Looks `radius` tiles around in a picture of `size` tiles, of which those in `delivered` (columns, rows) are
/// delivered.
///
/// # Panics
/// If there are not as many tiles.
pub fn exact_neighbours(
    tiles: &[Tile],
    [width, height]: [usize; 2],
    delivered: [Range<usize>; 2],
    radius: usize,
) -> Vec<Around> {
    let around = |x: usize, y: usize| {
        let own = &tiles[y * width + x];
        let (mut near, mut far, mut reach, mut jumps, mut differs) =
            (own, own, own.reach, own.jumps, 0.0_f32);
        for v in y.saturating_sub(radius)..=(y + radius).min(height - 1) {
            for u in x.saturating_sub(radius)..=(x + radius).min(width - 1) {
                let other = &tiles[v * width + u];
                // Whole tiles between the two.
                let [across, down] = [x.abs_diff(u), y.abs_diff(v)].map(|d| (d.max(1) - 1) * TILE);
                let farthest = own.reach.max(other.reach);
                if across as f32 > farthest.x || down as f32 > farthest.y {
                    continue;
                }
                near = if other.near_inverse > near.near_inverse { other } else { near };
                far = if other.far_inverse < far.far_inverse { other } else { far };
                reach = reach.max(other.reach);
                jumps |= other.jumps;
                differs = differs.max((other.color - own.color).abs().max_element() + other.away);
            }
        }
        let flat = !jumps && differs <= FLAT_SHARE * own.color.max_element() + FLAT;
        let way = match (flat || reach.max_element() < SHORTEST_PX, jumps) {
            (true, _) => Way::Resting,
            (false, false) => Way::Smooth,
            (false, true) => Way::Layered,
        };
        let inside = delivered[0].contains(&x) && delivered[1].contains(&y);
        Around { near: near.near, far: far.far, way: inside.then_some(way) }
    };
    (0..width * height).map(|i| around(i % width, i / width)).collect()
}
