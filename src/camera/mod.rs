//! Pure mathematics of a camera: pose, intrinsics, trajectory, shutter timing. Knows no scene and no Vulkan.

pub mod accumulation;
mod cubic;
mod distortion;
mod gaps;
mod intrinsics;
mod pose;
pub mod samples;
mod stamp;
mod timing;
mod trajectory;

pub use distortion::{Distortion, ExtendedLens, Lens};
pub use gaps::Gap;
pub use intrinsics::{Intrinsics, NEAR_M};
pub use pose::Pose;
pub use stamp::{Stamp, StampFault};
pub use timing::{ScanOrder, ShutterTiming};
pub use trajectory::{TIME_TOLERANCE_S, Trajectory};
