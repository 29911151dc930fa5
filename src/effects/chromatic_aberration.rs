//! Lateral chromatic aberration: the lens draws red and blue in another size than green, about (cx, cy). Acts while the
//! frame is rendered, behind the distortion: a colour's place on the sensor is
//! (cx, cy) + scale (distorted place - (cx, cy)).

use crate::chain::{Effect, Fit, Law, Number, ParamSpec, Settings, Stage};

/// The effect; its values live in [`Settings`].
pub struct ChromaticAberration;

const ID: &str = "chromatic_aberration";
/// Lenses have a few thousandths; a tenth is far beyond any.
const SCALES: (f64, f64) = (0.9, 1.1);

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("scale_r", "", SCALES, 1.0, "radial magnification of red about (cx, cy), green = 1")
        .fit(Fit::by(1e-3).within(0.97, 1.03).trial(Law::Up, 0.001, 0.006).graded(1e-4, 6e-3)),
    ParamSpec::number("scale_b", "", SCALES, 1.0, "radial magnification of blue about (cx, cy), green = 1")
        .fit(Fit::by(1e-3).within(0.97, 1.03).trial(Law::Follows, -1.5, -0.5)),
];

const SCALE_R: Number = Number::of(ID, SPECS, "scale_r");
const SCALE_B: Number = Number::of(ID, SPECS, "scale_b");

impl ChromaticAberration {
    /// Magnification of red, green and blue; 1 when the effect is off.
    pub fn scales(settings: &Settings) -> [f64; 3] {
        [settings.value(SCALE_R), 1.0, settings.value(SCALE_B)]
    }
}

impl Effect for ChromaticAberration {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }
}
