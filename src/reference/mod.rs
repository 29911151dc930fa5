//! The CPU oracle, in three parts.
//!
//! Twins of the kernels: one file a kernel or include, of the same stem, written to be read, in the kernels' own `f32`
//! and in the same order of operations, so that a difference means a mistake, not a rounding (up to divisions, square
//! roots and powers, which devices may round in their own way).
//!
//! `moments` propagates mean and variance through the same list of effects, without drawing noise.
//!
//! `raster` and `accumulate`: the scene rendered from first principles in double precision. Nothing there is tuned to
//! agree with a device: a ray is cast through every sample, the nearest triangle that it meets is shaded, samples are
//! averaged.

pub mod accumulate;
pub mod chain;
mod cubic;
pub mod develop;
pub mod exact_gather;
pub mod exact_neighbours;
pub mod exact_paths;
pub mod exact_place;
pub mod exact_push;
pub mod exact_still;
pub mod exact_tiles;
pub mod fast_claims;
pub mod fast_depth;
pub mod fast_gather;
mod fast_pixel;
pub mod fast_push;
pub mod fast_seeds;
pub mod fast_silhouettes;
mod fast_weight;
pub mod fused;
pub mod lens;
pub mod moments;
pub mod motion;
pub mod motion_blur;
pub mod motion_from_depth;
pub mod outside_blend;
pub mod outside_gather;
pub mod paper_fast;
pub mod paper_gather;
pub mod path;
pub mod raster;
pub mod resolve;
pub mod rgb9e5;
pub mod rolling_shutter;
pub mod sample;
mod shade;
pub use shade::Shader;
pub mod timing;
pub mod unpack;
mod window;
