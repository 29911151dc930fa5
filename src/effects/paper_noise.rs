//! The paper's noise (section 3.4): static, colour and edge parts as variances per channel, on linear radiance, with
//! what the paper lacks: the static part stays with the sensor, the others are new in every frame.

use crate::chain::{Domain, Effect, ParamKind, ParamSpec, Stage};

/// The effect; its values live in [`crate::chain::Settings`].
pub struct PaperNoise;

const fn variance(name: &'static str, about: &'static str) -> ParamSpec {
    ParamSpec {
        name,
        unit: "fraction of full scale, squared",
        kind: ParamKind::Number { min: 0.0, max: 1.0, neutral: 0.0 },
        about,
    }
}

const STATIC: &str = "variance of a pattern that belongs to the sensor: the same in every frame";
const COLOR: &str = "variance of white noise, independent by pixel, channel and frame";
const EDGE: &str =
    "variance added per squared gradient (full scale a pixel) of the picture, new in every frame";

const SPECS: &[ParamSpec] = &[
    variance("static_variance_r", STATIC),
    variance("static_variance_g", STATIC),
    variance("static_variance_b", STATIC),
    variance("color_variance_r", COLOR),
    variance("color_variance_g", COLOR),
    variance("color_variance_b", COLOR),
    variance("edge_variance_r", EDGE),
    variance("edge_variance_g", EDGE),
    variance("edge_variance_b", EDGE),
];

impl Effect for PaperNoise {
    fn id(&self) -> &'static str {
        "paper_noise"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }
}
