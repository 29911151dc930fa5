//! CPU twins of the kernels: one file a kernel or include, of the same stem, written to be read. They are the oracle
//! that the Vulkan kernels are compared with, and need no device.
//!
//! All are written in the kernels' own `f32` and in the same order of operations, so that a difference means a mistake,
//! not a rounding (up to divisions, square roots and powers, which devices may round in their own way).

pub mod develop;
pub mod motion;
pub mod motion_blur;
pub mod motion_from_depth;
pub mod paper_gather;
pub mod rolling_shutter;
pub mod sample;
pub mod timing;
