//! One physical effect a file, listed in light-path order.

mod auto_exposure;
mod bayer_mosaic;
mod black_level;
pub mod chroma_subsampling;
mod chromatic_aberration;
mod color_matrix;
mod dark_current;
mod defocus;
mod exposure_gain;
mod fixed_pattern_noise;
mod flicker;
mod focal_length_error;
mod gamma;
pub mod gaussian;
mod glare;
pub(crate) mod hot_pixels;
pub mod jpeg;
mod lens_distortion;
mod motion_blur;
mod noise_reduction;
mod paper_noise;
mod pose_offset;
mod quantization;
mod read_noise;
mod response;
mod response_curve;
mod rolling_shutter;
mod row_noise;
mod saturation;
mod sensor_color;
mod sharpening;
mod shot_noise;
#[cfg(any(test, feature = "added-effect"))]
mod split_toning;
mod time_offset;
mod tone_curve;
mod vignetting;
mod white_balance;

pub use auto_exposure::{AutoExposure, ExposureControl};
pub use bayer_mosaic::BayerMosaic;
pub use black_level::BlackLevel;
pub use chroma_subsampling::ChromaSubsampling;
pub use chromatic_aberration::ChromaticAberration;
pub use color_matrix::ColorMatrix;
pub use dark_current::DarkCurrent;
pub use defocus::Defocus;
pub use exposure_gain::ExposureGain;
pub use fixed_pattern_noise::{FixedPatternNoise, STREAM_FIXED_PATTERN_DSNU, STREAM_FIXED_PATTERN_PRNU};
pub use flicker::Flicker;
pub use focal_length_error::FocalLengthError;
pub use gamma::Gamma;
pub use glare::Glare;
pub use hot_pixels::{HotPixels, STREAM_HOT_PIXELS};
pub use jpeg::Jpeg;
pub use lens_distortion::LensDistortion;
pub use motion_blur::MotionBlur;
pub use noise_reduction::NoiseReduction;
pub use paper_noise::{
    PaperNoise, PaperNoiseSigma, STREAM_PAPER_NOISE_COLOR, STREAM_PAPER_NOISE_EDGE,
    STREAM_PAPER_NOISE_STATIC, gradient_magnitude, paper_noise,
};
pub use pose_offset::PoseOffset;
pub use quantization::Quantization;
pub use read_noise::{ReadNoise, STREAM_READ_NOISE};
pub use response_curve::ResponseCurve;
pub use rolling_shutter::RollingShutter;
pub use row_noise::{RowNoise, STREAM_COLUMN_NOISE, STREAM_ROW_NOISE};
pub use saturation::Saturation;
pub use sensor_color::SensorColor;
pub use sharpening::Sharpening;
pub use shot_noise::{STREAM_SHOT_NOISE, ShotNoise, poisson};
#[cfg(any(test, feature = "added-effect"))]
pub use split_toning::SplitToning;
pub use time_offset::TimeOffset;
pub use tone_curve::ToneCurve;
pub use vignetting::Vignetting;
pub use white_balance::WhiteBalance;

use crate::chain::{Effect, ParamSpec};

macro_rules! light_path {
    ($($(#[$only:meta])? $stem:ident: $effect:ident,)*) => {
        /// All effects in the order in which light meets them. The only place that states the order.
        pub const LIST: &[&dyn Effect] = &[$($(#[$only])? &$effect),*];

        /// Stem and parameters of each of them, as constants.
        pub const PARAMETERS: &[(&str, &[ParamSpec])] = &[$($(#[$only])? (stringify!($stem), $stem::SPECS)),*];
    };
}

light_path! {
    time_offset: TimeOffset,
    pose_offset: PoseOffset,
    focal_length_error: FocalLengthError,
    auto_exposure: AutoExposure,
    lens_distortion: LensDistortion,
    chromatic_aberration: ChromaticAberration,
    rolling_shutter: RollingShutter,
    motion_blur: MotionBlur,
    defocus: Defocus,
    vignetting: Vignetting,
    glare: Glare,
    exposure_gain: ExposureGain,
    flicker: Flicker,
    sensor_color: SensorColor,
    dark_current: DarkCurrent,
    paper_noise: PaperNoise,
    shot_noise: ShotNoise,
    fixed_pattern_noise: FixedPatternNoise,
    row_noise: RowNoise,
    read_noise: ReadNoise,
    hot_pixels: HotPixels,
    black_level: BlackLevel,
    quantization: Quantization,
    bayer_mosaic: BayerMosaic,
    white_balance: WhiteBalance,
    color_matrix: ColorMatrix,
    gamma: Gamma,
    tone_curve: ToneCurve,
    noise_reduction: NoiseReduction,
    response_curve: ResponseCurve,
    saturation: Saturation,
    #[cfg(any(test, feature = "added-effect"))] split_toning: SplitToning,
    sharpening: Sharpening,
    chroma_subsampling: ChromaSubsampling,
    jpeg: Jpeg,
}

/// The effect of that stem.
pub fn by_id(id: &str) -> Option<&'static dyn Effect> {
    LIST.iter().copied().find(|e| e.id() == id)
}
