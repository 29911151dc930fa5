//! Reading the claims that `fast_seeds` made. Twin of `glsl/include/fast_claims.glsl`.

use glam::IVec2;

use super::fast_push::{Push, seed_offset};

/// No claim, where the farthest is asked for.
pub const NO_CLAIM: u32 = u32::MAX;
/// Neighbours of more different depth, and different motion, are two surfaces: a quarter of an octave.
const ONE_SURFACE_KEYS: u32 = 32;
const NEIGHBOURS: [[i32; 2]; 5] = [[0, 0], [-1, -1], [1, -1], [-1, 1], [1, 1]];

/// Claims of one slot at a pixel and its four diagonal neighbours.
#[derive(Clone, Copy, Debug)]
pub struct SlotClaims {
    /// The greatest key; 0: none.
    pub nearest: u32,
    /// The smallest key; [`NO_CLAIM`]: none.
    pub farthest: u32,
    /// Whether all of them can be of one surface.
    pub agree: bool,
}

/// The claims around a pixel.
pub fn slot_claims(push: &Push, seeds: &[u32], slot: u32, pixel: IVec2) -> SlotClaims {
    let mut c = SlotClaims { nearest: 0, farthest: NO_CLAIM, agree: false };
    let (mut low, mut high, mut count) = (IVec2::splat(1 << 20), IVec2::splat(-(1 << 20)), 0);
    let last = IVec2::new(push.size[0] as i32 - 1, push.size[1] as i32 - 1);
    for neighbour in NEIGHBOURS {
        let at = (pixel + IVec2::from(neighbour)).clamp(IVec2::ZERO, last);
        let key = seeds[push.seed_index(slot, at)];
        // A gap is no objection: where the picture stretches, some pixels are nobody's.
        if key != 0 {
            c.nearest = c.nearest.max(key);
            c.farthest = c.farthest.min(key);
            low = low.min(seed_offset(key));
            high = high.max(seed_offset(key));
            count += 1;
        }
    }
    // Neighbours on one surface differ by rounding, or because it slants or turns; a step in depth with it is an edge.
    let spread = (high - low).max_element();
    let one_depth = (c.nearest >> 20).wrapping_sub(c.farthest >> 20) <= ONE_SURFACE_KEYS;
    c.agree = count >= 3 && spread <= 1 && (one_depth || spread == 0);
    c
}
