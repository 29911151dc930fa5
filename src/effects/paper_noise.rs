//! The paper's noise (section 3.4): static, colour and edge parts as variances per channel, on linear radiance, with
//! what the paper lacks: the static part stays with the sensor, the others are new in every frame.

use crate::chain::rng::{self, FIXED_FRAME, random_normal};
use crate::chain::{Domain, Effect, ParamKind, ParamSpec, Settings, Stage};

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

/// Standard deviations of the three parts, in fractions of full scale: red, green, blue and an unused zero (kernels take
/// them as `vec4`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PaperNoiseSigma {
    /// Of the sensor's pattern.
    pub static_sigma: [f32; 4],
    /// Of the white part.
    pub color_sigma: [f32; 4],
    /// Per unit of gradient (full scale a px).
    pub edge_sigma: [f32; 4],
}

impl PaperNoiseSigma {
    /// Parts that are not neutral: 1 static, 2 colour, 4 edge. The value of the kernel's specialization constant 0
    /// (`PAPER_NOISE_PARTS`; all parts unless set): a software device runs both sides of a branch, so it saves time only
    /// on what the pipeline leaves out.
    pub fn parts(&self) -> u32 {
        let parts = [self.static_sigma, self.color_sigma, self.edge_sigma];
        (0..3).filter(|&k| parts[k][..3] != [0.0; 3]).map(|k| 1 << k).sum()
    }
}

impl PaperNoise {
    /// Roots of the variances in `settings`; zero when the effect is off.
    pub fn sigma(settings: &Settings) -> PaperNoiseSigma {
        let sigma = |names: [&str; 3]| {
            let [r, g, b] = names.map(|name| settings.number("paper_noise", name, 0.0).sqrt() as f32);
            [r, g, b, 0.0]
        };
        PaperNoiseSigma {
            static_sigma: sigma(["static_variance_r", "static_variance_g", "static_variance_b"]),
            color_sigma: sigma(["color_variance_r", "color_variance_g", "color_variance_b"]),
            edge_sigma: sigma(["edge_variance_r", "edge_variance_g", "edge_variance_b"]),
        }
    }
}

/// Noise on one pixel's linear radiance (the function of the same name in `glsl/include/paper_noise.glsl`).
///
/// `gradient` is the magnitude of the noise-free picture's gradient, per channel and px. The static part depends on
/// pixel and seed only, the others on the frame too. A part without sigma changes no bit.
pub fn paper_noise(
    linear: [f32; 3],
    gradient: [f32; 3],
    pixel: [u32; 2],
    frame: u32,
    seed: [u32; 2],
    sigma: &PaperNoiseSigma,
) -> [f32; 3] {
    let mut noisy = linear;
    let mut add = |sigma: [f32; 3], frame: u32, stream: u32| {
        let normal = random_normal(pixel, frame, stream, seed);
        for channel in 0..3 {
            noisy[channel] += sigma[channel] * normal[channel];
        }
    };
    let [fixed, color, edge] =
        [sigma.static_sigma, sigma.color_sigma, sigma.edge_sigma].map(|s| [s[0], s[1], s[2]]);
    if fixed != [0.0; 3] {
        add(fixed, FIXED_FRAME, rng::STREAM_PAPER_NOISE_STATIC);
    }
    if color != [0.0; 3] {
        add(color, frame, rng::STREAM_PAPER_NOISE_COLOR);
    }
    if edge != [0.0; 3] {
        add([0, 1, 2].map(|c| edge[c] * gradient[c]), frame, rng::STREAM_PAPER_NOISE_EDGE);
    }
    noisy
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Value;

    #[test]
    fn sigma_is_the_root_of_the_variance_in_settings() {
        let mut settings = Settings::default();
        assert_eq!(PaperNoise::sigma(&settings), PaperNoiseSigma::default());
        assert_eq!(PaperNoise::sigma(&settings).parts(), 0);
        let mut set = |name, value| settings.set(&PaperNoise, name, Value::Number(value)).expect("in range");
        set("color_variance_g", 0.04);
        set("edge_variance_b", 0.25);
        let sigma = PaperNoise::sigma(&settings);
        assert_eq!(sigma.color_sigma, [0.0, 0.2, 0.0, 0.0]);
        assert_eq!(sigma.edge_sigma, [0.0, 0.0, 0.5, 0.0]);
        assert_eq!((sigma.static_sigma, sigma.parts()), ([0.0; 4], 6));
    }
}
