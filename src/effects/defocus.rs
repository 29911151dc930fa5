//! The lens is not in focus: a Gaussian of `sigma_px` on L (CAPTURE contract), the usual model of a small blur; or, with
//! `disc_radius_px`, the uniform disc that an open round aperture makes of a point (geometric optics), whose rim cuts a
//! pixel by its share. Both together apply one after the other. Linear radiance; what lies beyond the picture's border
//! is taken to be like the border.

use super::gaussian;
use crate::chain::{Domain, Effect, Packer, ParamSpec, Parameters, Pass, Settings, Stage, View, Work};
use crate::plane::Plane;

/// The effect; its values live in [`Settings`].
pub struct Defocus;

const SPECS: &[ParamSpec] = &[
    ParamSpec::number("sigma_px", "px", (0.0, 50.0), 0.0, "standard deviation of the Gaussian"),
    ParamSpec::number("disc_radius_px", "px", (0.0, 20.0), 0.0, "radius of the disc"),
];

/// Steps a side in which a pixel's share of the disc is counted.
const SHARE_STEPS: i32 = 16;

fn sigma_px(settings: &Settings) -> f64 {
    settings.number("defocus", "sigma_px", 0.0)
}

fn disc_radius_px(settings: &Settings) -> f64 {
    settings.number("defocus", "disc_radius_px", 0.0)
}

/// Radius of the square that holds the disc, whole px, and the weights of its pixels, row by row; they add up to 1.
fn disc(radius_px: f64) -> (i32, Vec<f32>) {
    let radius = (radius_px + 0.5).ceil() as i32 - 1;
    let share = |x: i32, y: i32| {
        let inside = |i: i32| {
            let offset =
                |n: i32, step: i32| f64::from(n) + (f64::from(step) + 0.5) / f64::from(SHARE_STEPS) - 0.5;
            offset(x, i % SHARE_STEPS).hypot(offset(y, i / SHARE_STEPS)) <= radius_px
        };
        (0..SHARE_STEPS * SHARE_STEPS).filter(|i| inside(*i)).count() as f64
    };
    let places = (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| (x, y)));
    let shares: Vec<f64> = places.map(|(x, y)| share(x, y)).collect();
    let sum: f64 = shares.iter().sum();
    // Smaller than the finest step: the pixel itself.
    if sum == 0.0 {
        return (0, vec![1.0]);
    }
    (radius, shares.into_iter().map(|s| (s / sum) as f32).collect())
}

/// Twin of `glsl/defocus.comp`.
fn reference(source: &Plane<f32>, settings: &Settings, _: &Parameters) -> Plane<f32> {
    let mut seen = source.clone();
    if sigma_px(settings) > 0.0 {
        let weights = gaussian::weights(sigma_px(settings));
        seen = gaussian::along(&gaussian::along(&seen, 0, &weights), 1, &weights);
    }
    if disc_radius_px(settings) > 0.0 {
        let (radius, weights) = disc(disc_radius_px(settings));
        let side = 2 * radius as usize + 1;
        let before = seen;
        seen = gaussian::filter(&before, |x, y| {
            let mut sum = [0.0; 3];
            for (i, weight) in weights.iter().enumerate() {
                let offset = [i % side, i / side].map(|o| o as i64 - i64::from(radius));
                let value = gaussian::clamped(&before, [x as i64 + offset[0], y as i64 + offset[1]]);
                sum = [0, 1, 2].map(|c| sum[c] + weight * value[c]);
            }
            sum
        });
    }
    seen
}

fn passes(settings: &Settings) -> Vec<Pass> {
    let mut passes = Vec::new();
    if sigma_px(settings) > 0.0 {
        passes.extend(gaussian::passes("defocus.comp", sigma_px(settings)));
    }
    if disc_radius_px(settings) > 0.0 {
        passes.push(Pass { file: "defocus.comp", constants: [2, 0], run: [1, 1] });
    }
    passes
}

impl Effect for Defocus {
    fn id(&self) -> &'static str {
        "defocus"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let (radius, weights) = match disc_radius_px(settings) {
            0.0 => (0, Vec::new()),
            radius_px => disc(radius_px),
        };
        packer.bits(radius as u32);
        packer.table(weights);
        if sigma_px(settings) > 0.0 {
            gaussian::pack(sigma_px(settings), packer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_has_its_area_and_second_moment() {
        for radius_px in [1.0, 2.3, 7.5, 20.0] {
            let (radius, weights) = disc(radius_px);
            let side = 2 * radius + 1;
            assert_eq!(weights.len() as i32, side * side);
            let square: f64 = weights
                .iter()
                .enumerate()
                .map(|(i, w)| f64::from(*w) * f64::from((i as i32 % side - radius).pow(2)))
                .sum();
            // Mean of x^2 over a disc is r^2 / 4; shares of whole pixels add a pixel's own 1/12.
            let want = 0.25 * radius_px * radius_px + 1.0 / 12.0;
            assert!((square - want).abs() < 0.07 + 0.01 * want, "{radius_px}: {square} for {want}");
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
        assert_eq!(disc(0.01), (0, vec![1.0]));
    }
}
