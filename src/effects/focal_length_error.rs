//! The lens is longer or shorter than `camera.toml` says: true fx, fy = ratio times those (docs/reference/camera.md).
//! Acts where an engine is given its intrinsics: [`crate::capture::Capture::true_intrinsics`].

use crate::camera::Intrinsics;
use crate::chain::{Effect, Fit, Law, Number, ParamSpec, Settings, Stage};

/// The effect; its values live in [`Settings`].
pub struct FocalLengthError;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("ratio", "", (0.5, 2.0), 1.0, "true focal length over that of camera.toml")
        .fit(Fit::by(1e-3).within(0.7, 1.4).trial(Law::Either, 0.006, 0.05).graded(2e-4, 2e-2))];

const RATIO: Number = Number::of("focal_length_error", SPECS, "ratio");

impl FocalLengthError {
    /// The true camera's intrinsics.
    pub fn apply(settings: &Settings, intrinsics: &Intrinsics) -> Intrinsics {
        let ratio = settings.value(RATIO);
        Intrinsics { fx: ratio * intrinsics.fx, fy: ratio * intrinsics.fy, ..*intrinsics }
    }
}

impl Effect for FocalLengthError {
    fn id(&self) -> &'static str {
        "focal_length_error"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::SetUp
    }

    fn shown_by(&self) -> &'static str {
        "straight edges in the middle of the picture and out to its corners, from two distances"
    }
}
