//! The CPU oracle: the scene rendered from first principles in double precision, slow and plain, so that the Vulkan
//! engine and its approximations have something to be compared with. Nothing here is tuned to agree with a device:
//! a ray is cast through every sample, the nearest triangle that it meets is shaded, samples are averaged.

pub mod accumulate;
pub mod raster;
mod shade;
