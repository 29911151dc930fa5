//! One physical effect a file, listed in light-path order.

mod motion_blur;
mod paper_noise;
mod rolling_shutter;

pub use motion_blur::MotionBlur;
pub use paper_noise::{PaperNoise, PaperNoiseSigma, paper_noise};
pub use rolling_shutter::RollingShutter;

use crate::chain::Effect;

/// All effects in the order in which light meets them. The only place that states the order.
pub const LIST: &[&dyn Effect] = &[&RollingShutter, &MotionBlur, &PaperNoise];

/// The effect of that stem.
pub fn by_id(id: &str) -> Option<&'static dyn Effect> {
    LIST.iter().copied().find(|e| e.id() == id)
}
