//! One physical effect a file, listed in light-path order.

mod black_level;
mod chromatic_aberration;
mod color_matrix;
mod dark_current;
mod exposure_gain;
mod fixed_pattern_noise;
mod flicker;
mod gamma;
mod glare;
mod hot_pixels;
mod lens_distortion;
mod motion_blur;
mod paper_noise;
mod quantization;
mod read_noise;
mod rolling_shutter;
mod row_noise;
mod shot_noise;
mod tone_curve;
mod vignetting;
mod white_balance;

pub use black_level::BlackLevel;
pub use chromatic_aberration::ChromaticAberration;
pub use color_matrix::ColorMatrix;
pub use dark_current::DarkCurrent;
pub use exposure_gain::ExposureGain;
pub use fixed_pattern_noise::{FixedPatternNoise, STREAM_FIXED_PATTERN_DSNU, STREAM_FIXED_PATTERN_PRNU};
pub use flicker::Flicker;
pub use gamma::Gamma;
pub use glare::Glare;
pub use hot_pixels::{HotPixels, STREAM_HOT_PIXELS};
pub use lens_distortion::LensDistortion;
pub use motion_blur::MotionBlur;
pub use paper_noise::{
    PaperNoise, PaperNoiseSigma, STREAM_PAPER_NOISE_COLOR, STREAM_PAPER_NOISE_EDGE,
    STREAM_PAPER_NOISE_STATIC, gradient_magnitude, paper_noise,
};
pub use quantization::Quantization;
pub use read_noise::{ReadNoise, STREAM_READ_NOISE};
pub use rolling_shutter::RollingShutter;
pub use row_noise::{RowNoise, STREAM_COLUMN_NOISE, STREAM_ROW_NOISE};
pub use shot_noise::{STREAM_SHOT_NOISE, ShotNoise, poisson};
pub use tone_curve::ToneCurve;
pub use vignetting::Vignetting;
pub use white_balance::WhiteBalance;

use crate::chain::Effect;

/// All effects in the order in which light meets them. The only place that states the order.
pub const LIST: &[&dyn Effect] = &[
    &LensDistortion,
    &ChromaticAberration,
    &RollingShutter,
    &MotionBlur,
    &Vignetting,
    &Glare,
    &ExposureGain,
    &Flicker,
    &DarkCurrent,
    &PaperNoise,
    &ShotNoise,
    &FixedPatternNoise,
    &RowNoise,
    &ReadNoise,
    &HotPixels,
    &BlackLevel,
    &Quantization,
    &WhiteBalance,
    &ColorMatrix,
    &Gamma,
    &ToneCurve,
];

/// The effect of that stem.
pub fn by_id(id: &str) -> Option<&'static dyn Effect> {
    LIST.iter().copied().find(|e| e.id() == id)
}
