//! Pure mathematics of a camera: pose, intrinsics, trajectory, shutter timing. Knows no scene and no Vulkan.

pub mod accumulation;
mod intrinsics;
mod pose;
pub mod samples;
mod timing;
mod trajectory;

pub use intrinsics::{Intrinsics, NEAR_M};
pub use pose::Pose;
pub use timing::{ScanOrder, ShutterTiming};
pub use trajectory::Trajectory;
