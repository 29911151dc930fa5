//! `--method fast`: depth by texel of the paths. Twin of `glsl/fast_depth.comp`; its multisampled variant differs in
//! nothing but how a sample is fetched.

use crate::plane::Plane;

/// Depth of every `texels`-th texel of a side, from the first on.
pub fn fast_depth(depth: &Plane<f32>, texels: usize) -> Plane<f32> {
    let at = |x: usize, y: usize| [depth.pixel(x * texels, y * texels)[0]];
    Plane::from_fn(depth.width / texels, depth.height / texels, at)
}
