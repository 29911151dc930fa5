//! The paper's noise (section 3.4): static, colour and edge parts as variances per channel, on linear radiance, with
//! what the paper lacks: the static part stays with the sensor, the others are new in every frame.

use crate::chain::rng::{self, FIXED_FRAME, random_normal};
use crate::chain::{
    At, Domain, Effect, Moments, Noise, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::plane::Plane;

/// The effect; its values live in [`crate::chain::Settings`].
pub struct PaperNoise;

const fn variance(name: &'static str, about: &'static str) -> ParamSpec {
    ParamSpec::number(name, "fraction of full scale, squared", (0.0, 1.0), 0.0, about)
}

const STATIC: &str = "variance of a pattern that belongs to the sensor: the same in every frame";
const COLOR: &str = "variance of white noise, independent by pixel, channel and frame";
const EDGE: &str =
    "variance added per squared gradient (full scale a pixel) of the picture, new in every frame";

pub(super) const SPECS: &[ParamSpec] = &[
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

/// Bit of the variant that reads neighbours.
const EDGE_PART: u32 = 4;

/// Stream of the sensor's pattern.
pub const STREAM_PAPER_NOISE_STATIC: u32 = 0x5354;
/// Stream of the white part.
pub const STREAM_PAPER_NOISE_COLOR: u32 = 0x434f;
/// Stream of the part that grows with the gradient.
pub const STREAM_PAPER_NOISE_EDGE: u32 = 0x4544;

/// Standard deviations of the three parts, in fractions of full scale: red, green, blue and an unused zero (kernels
/// take them as `vec4`).
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
    /// Parts that are not neutral: 1 static, 2 colour, 4 edge: the effect's variant. A software device runs both sides
    /// of a branch, so it saves time only on what the pipeline leaves out.
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

/// Noise on one pixel's linear radiance (the function of the same name in `glsl/include/effects/paper_noise.glsl`).
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
        add(fixed, FIXED_FRAME, STREAM_PAPER_NOISE_STATIC);
    }
    if color != [0.0; 3] {
        add(color, frame, STREAM_PAPER_NOISE_COLOR);
    }
    if edge != [0.0; 3] {
        add([0, 1, 2].map(|c| edge[c] * gradient[c]), frame, STREAM_PAPER_NOISE_EDGE);
    }
    noisy
}

/// Magnitude of the central-difference gradient, per channel and px; the border repeats outwards.
pub fn gradient_magnitude(radiance: &Plane<f32>, x: usize, y: usize) -> [f32; 3] {
    let left = radiance.pixel(x.saturating_sub(1), y);
    let right = radiance.pixel((x + 1).min(radiance.width - 1), y);
    let above = radiance.pixel(x, y.saturating_sub(1));
    let below = radiance.pixel(x, (y + 1).min(radiance.height - 1));
    [0, 1, 2].map(|c| {
        let (dx, dy) = (0.5 * (right[c] - left[c]), 0.5 * (below[c] - above[c]));
        (dx * dx + dy * dy).sqrt()
    })
}

/// The same with what the chain gives.
fn at_pixel(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let part = |first: usize| [p.number(first), p.number(first + 1), p.number(first + 2), 0.0];
    let sigma = PaperNoiseSigma { static_sigma: part(0), color_sigma: part(3), edge_sigma: part(6) };
    let gradient = match at.variant & EDGE_PART {
        0 => [0.0; 3],
        _ => gradient_magnitude(at.source, at.pixel[0] as usize, at.pixel[1] as usize),
    };
    paper_noise(value, gradient, at.pixel, at.view.frame, rng::seed_words(at.view.seed), &sigma)
}

/// Without the part at edges: flat places have none.
fn noise(settings: &Settings) -> [Noise; 3] {
    let sigma = PaperNoise::sigma(settings);
    [0, 1, 2].map(|c| {
        let square = |s: [f32; 4]| [f64::from(s[c]).powi(2), 0.0, 0.0];
        Noise { free: square(sigma.color_sigma), fixed: square(sigma.static_sigma), ..Noise::default() }
    })
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

    fn variant(&self, settings: &Settings) -> u32 {
        Self::sigma(settings).parts()
    }

    fn moments(&self) -> Moments {
        Moments::Noise(noise)
    }

    fn undiagnosed(&self) -> Option<&'static str> {
        Some(
            "read_noise and fixed_pattern_noise say the same of single colours; what it adds at edges no bin of the \
             measured noise has",
        )
    }

    fn work(&self) -> Work {
        Work::Pointwise(at_pixel)
    }

    fn reads_neighbours(&self, settings: &Settings) -> bool {
        self.variant(settings) & EDGE_PART != 0
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let sigma = Self::sigma(settings);
        for part in [sigma.static_sigma, sigma.color_sigma, sigma.edge_sigma] {
            part[..3].iter().for_each(|s| packer.number(f64::from(*s)));
        }
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
