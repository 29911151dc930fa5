//! The lens is not in focus: a Gaussian of `sigma_px` on L (docs/reference/camera.md), the usual model of a small blur;
//! or, with `disc_radius_px`, the uniform disc that an open round aperture makes of a point (geometric optics), whose
//! rim cuts a pixel by its share. Both together apply one after the other. Linear radiance; what lies beyond the
//! picture's border is taken to be like the border.
//!
//! By depth, as a thin lens does: a point at distance d is spread over a disc of diameter A fx |1/f - 1/d| px, for an
//! aperture of diameter A m and a focus at f m, both small beside f (Potmesil, Chakravarty: "A lens and aperture camera
//! model for synthetic image generation", SIGGRAPH 1981); `shape` is that disc, or the Gaussian of its standard
//! deviation, a quarter of the diameter. Each pixel gathers from those whose disc reaches it; what lies behind it
//! counts with no larger disc than its own, so that a blurred background does not spill over a sharp foreground.
//! Distances are those of the middle of the frame, one a pixel; the part of the background that a blurred foreground
//! would uncover is not known. Radii are cut at `max_radius_px`. One over the distance (1/m) stands in the picture's
//! fourth channel then.

use super::gaussian;
use crate::chain::{
    Choice, Domain, Effect, Fit, Law, Number, Packer, ParamSpec, Parameters, Pass, Settings, Stage, View,
    Work,
};
use crate::plane::{Plane, three};

/// The effect; its values live in [`Settings`].
pub struct Defocus;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("sigma_px", "px", (0.0, 50.0), 0.0, "standard deviation of the Gaussian").fit(
        Fit::by(0.1).within(0.0, 8.0).starts(&[0.4, 0.8, 1.5, 3.0]).trial(Law::Up, 0.5, 2.5).graded(0.1, 2.0),
    ),
    ParamSpec::number("disc_radius_px", "px", (0.0, 20.0), 0.0, "radius of the disc"),
    ParamSpec::number("aperture_m", "m", (0.0, 0.2), 0.0, "diameter of the aperture; 0: not by depth"),
    ParamSpec::number("focus_m", "m", (0.01, 1e6), 1e6, "distance that is sharp").beside(&["aperture_m"]),
    ParamSpec::choice("shape", &["disc", "gaussian"], "by depth: what a point becomes")
        .beside(&["aperture_m"]),
    ParamSpec::number("max_radius_px", "px", (1.0, 20.0), 8.0, "by depth: larger discs are cut to this")
        .beside(&["aperture_m"]),
];

const FOCUS_M: Number = Number::of("defocus", SPECS, "focus_m");
const MAX_RADIUS_PX: Number = Number::of("defocus", SPECS, "max_radius_px");
const SIGMA_PX: Number = Number::of("defocus", SPECS, "sigma_px");
const DISC_RADIUS_PX: Number = Number::of("defocus", SPECS, "disc_radius_px");
const APERTURE_M: Number = Number::of("defocus", SPECS, "aperture_m");
const SHAPE: Choice = Choice::of("defocus", SPECS, "shape");

/// Steps a side in which a pixel's share of the disc is counted.
const SHARE_STEPS: i32 = 16;

fn sigma_px(settings: &Settings) -> f64 {
    settings.value(SIGMA_PX)
}

fn disc_radius_px(settings: &Settings) -> f64 {
    settings.value(DISC_RADIUS_PX)
}

impl Defocus {
    /// Whether the fourth channel of the radiance must hold one over the distance, 1/m.
    pub fn needs_depth(settings: &Settings) -> bool {
        settings.value(APERTURE_M) > 0.0
    }
}

fn is_gaussian(settings: &Settings) -> bool {
    settings.chosen(SHAPE) == Some("gaussian")
}

/// What a pixel whose disc has that radius gives to another one so many px away; not normalised.
fn share(radius_px: f32, away_px: f32, gaussian: bool) -> f32 {
    if gaussian {
        let sigma = (0.5 * radius_px).max(0.05);
        return (-0.5 * away_px * away_px / (sigma * sigma)).exp() / (sigma * sigma);
    }
    let radius = radius_px.max(0.5);
    (radius + 0.5 - away_px).clamp(0.0, 1.0) / (radius * radius)
}

/// The gather by depth; `numbers`: aperture times focal length (px m), 1 / focus (1/m), largest radius (px).
fn by_depth(source: &Plane<f32>, [scale, focus, most]: [f32; 3], gaussian: bool) -> Plane<f32> {
    let clamped = |x: i64, y: i64| {
        source.pixel(
            x.clamp(0, source.width as i64 - 1) as usize,
            y.clamp(0, source.height as i64 - 1) as usize,
        )
    };
    let radius_of = |nearness: f32| (0.5 * scale * (nearness - focus).abs()).min(most);
    gaussian::filter(source, |x, y| {
        let (x, y) = (x as i64, y as i64);
        let own = clamped(x, y)[3];
        let (mut sum, mut total) = ([0.0f32; 3], 0.0f32);
        let reach = most.ceil() as i64;
        for (dy, dx) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dy, dx))) {
            let p = clamped(x + dx, y + dy);
            let mut radius = radius_of(p[3]);
            if p[3] < own {
                radius = radius.min(radius_of(own));
            }
            let weight = share(radius, ((dx * dx + dy * dy) as f32).sqrt(), gaussian);
            sum = three(|c| sum[c] + weight * p[c]);
            total += weight;
        }
        sum.map(|v| v / total)
    })
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
fn reference(source: &Plane<f32>, settings: &Settings, p: &Parameters) -> Plane<f32> {
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
                sum = three(|c| sum[c] + weight * value[c]);
            }
            sum
        });
    }
    if Defocus::needs_depth(settings) {
        seen = by_depth(&seen, three(|i| p.table(2, i)), is_gaussian(settings));
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
    if Defocus::needs_depth(settings) {
        let mode = if is_gaussian(settings) { 4 } else { 3 };
        passes.push(Pass { file: "defocus.comp", constants: [mode, 0], run: [1, 1] });
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

    fn shown_by(&self) -> &'static str {
        "slanted edges at several distances, camera at rest"
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }

    fn variant(&self, settings: &Settings) -> u32 {
        let on = sigma_px(settings) > 0.0 || disc_radius_px(settings) > 0.0 || Self::needs_depth(settings);
        u32::from(on)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        let (radius, weights) = match disc_radius_px(settings) {
            0.0 => (0, Vec::new()),
            radius_px => disc(radius_px),
        };
        packer.bits(radius as u32);
        packer.table(weights);
        let scale = settings.value(APERTURE_M) * view.intrinsics.fx;
        let depth = [scale, 1.0 / settings.value(FOCUS_M), settings.value(MAX_RADIUS_PX)];
        packer.table(depth.map(|v| v as f32));
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
