//! The list of effects on means and spreads instead of values: what frames of a camera are on average over its noise,
//! and how far single ones are from that. Unrounded, so that derivatives exist.
//!
//! Ahead of the noise the mean is what the twins make of the radiance. Noise comes in as variances that depend on the
//! value; the encoding bends and clips what has both, by an integral over a normal distribution; steps that mix pixels
//! behind it leave a part of the spread. The spread is known by delivered value: a colour's is taken to be that of a
//! grey as bright, except where colours are made of each other ahead of the encoding.

mod clipped;
mod coloured;
mod curve;
mod picture;
mod places;
mod tone;

pub use coloured::Sources;
pub use picture::{Lattice, expected, expected_on, is_pointwise, mixed, through_converter, through_file};
pub use tone::Tone;

#[cfg(test)]
mod tests;
