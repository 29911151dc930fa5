//! The ISP's smoothing against noise: a Gaussian on brightness and a wider one on colour (luma and both colour
//! differences of ITU-R BT.601, as in JFIF), on encoded values. It makes the noise of neighbours alike. Clipped only
//! when rounded.
//!
//! With `edge` above 0 edges are spared: a neighbour counts exp(-d^2 / (2 edge^2)) as much, where d is its difference
//! in luma (Tomasi, Manduchi: "Bilateral filtering for gray and color images", ICCV 1998), along rows and then along
//! columns (Pham, van Vliet: "Separable bilateral filtering for fast video preprocessing", ICME 2005).

use super::gaussian;
use crate::chain::{
    Domain, Effect, Filter, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Pass, Settings, Stage,
    View, Work,
};
use crate::plane::Plane;
use crate::plane::stats::{LUMA, luma};

/// The effect; its values live in [`Settings`].
pub struct NoiseReduction;

const ID: &str = "noise_reduction";
/// Bit of the kernel's mode.
const KEEPS_EDGES: u32 = 2;
pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("luma_sigma_px", "px", (0.0, 10.0), 0.0, "standard deviation of luma's Gaussian").fit(
        Fit::by(0.1).within(0.0, 5.0).starts(&[0.5, 1.0, 2.0]).trial(Law::Up, 0.5, 1.5).graded(0.1, 2.0),
    ),
    ParamSpec::number(
        "chroma_sigma_px",
        "px",
        (0.0, 10.0),
        0.0,
        "standard deviation of the colours' Gaussian",
    )
    .fit(Fit::by(0.2).within(0.0, 8.0).starts(&[0.5, 2.0, 2.0]).trial(Law::Even, 0.5, 3.0)),
    ParamSpec::number(
        "edge",
        "",
        (0.0, 1.0),
        0.0,
        "difference in luma from which an edge is spared; 0: none is",
    )
    .beside(&["luma_sigma_px", "chroma_sigma_px"]),
];

const EDGE: Number = Number::of(ID, SPECS, "edge");
const LUMA_SIGMA_PX: Number = Number::of(ID, SPECS, "luma_sigma_px");
const CHROMA_SIGMA_PX: Number = Number::of(ID, SPECS, "chroma_sigma_px");

fn sigmas_px(settings: &Settings) -> [f64; 2] {
    [LUMA_SIGMA_PX, CHROMA_SIGMA_PX].map(|of| settings.value(of))
}

fn edge(settings: &Settings) -> f64 {
    settings.value(EDGE)
}

/// Weights of luma and colours by distance, both to the wider one's radius.
fn weights(settings: &Settings) -> [Vec<f32>; 2] {
    let of = |sigma: f64| if sigma > 0.0 { gaussian::weights(sigma) } else { vec![1.0] };
    let mut both = sigmas_px(settings).map(of);
    let longest = both[0].len().max(both[1].len());
    both.iter_mut().for_each(|w| w.resize(longest, 0.0));
    both
}

/// The radius, if the kernel's loops are unrolled.
fn unrolled(settings: &Settings) -> Option<u32> {
    let radius = weights(settings)[0].len() - 1;
    (radius <= gaussian::MAX_UNROLLED).then_some(radius as u32)
}

/// Luma, and red and blue against it.
fn to_luma([r, g, b]: [f32; 3]) -> [f32; 3] {
    let y = luma(&[r, g, b]);
    [y, r - y, b - y]
}

fn to_rgb([y, r, b]: [f32; 3]) -> [f32; 3] {
    [y + r, y - (LUMA[0] * r + LUMA[2] * b) / LUMA[1], y + b]
}

/// One direction, of luma and colours, where no edge is spared.
fn smoothed(source: &Plane<f32>, axis: usize, weights: &[Vec<f32>; 2]) -> Plane<f32> {
    let used = |all: &[f32]| all.iter().rposition(|w| *w > 0.0).map_or(1, |last| last + 1);
    let [luma, mut out] = weights.each_ref().map(|w| gaussian::along(source, axis, &w[..used(w)]));
    let own = |p: Plane<f32>| p.data.into_iter().step_by(source.channels);
    out.data.iter_mut().step_by(source.channels).zip(own(luma)).for_each(|(to, from)| *to = from);
    out
}

/// One direction, of luma and colours, with edges spared.
fn along(source: &Plane<f32>, axis: usize, [luma, chroma]: &[Vec<f32>; 2], falloff: f32) -> Plane<f32> {
    let (n, radius) = (source.channels, luma.len() - 1);
    let (length, step) = [(source.width, n), (source.height, n * source.width)][axis];
    gaussian::filter(source, |x, y| {
        let here = [x, y][axis];
        let at = (y * source.width + x) * n;
        let line = at - here * step;
        let own = source.data[at];
        let (mut sum, mut total) = ([0.0f32; 3], [0.0f32; 2]);
        for k in 0..=2 * radius {
            // The border repeats outwards.
            let place = line + (here + k).saturating_sub(radius).min(length - 1) * step;
            let value = &source.data[place..place + 3];
            let away = k.abs_diff(radius);
            let difference = value[0] - own;
            let alike = (-falloff * (difference * difference)).exp();
            let (l, c) = (luma[away] * alike, chroma[away] * alike);
            sum = [sum[0] + l * value[0], sum[1] + c * value[1], sum[2] + c * value[2]];
            total = [total[0] + l, total[1] + c];
        }
        [sum[0] / total[0], sum[1] / total[1], sum[2] / total[1]]
    })
}

/// Twin of `glsl/noise_reduction.comp`.
fn reference(source: &Plane<f32>, settings: &Settings, p: &Parameters) -> Plane<f32> {
    let weights = weights(settings);
    let rgb = |plane: &Plane<f32>, x: usize, y: usize| gaussian::clamped(plane, [x as i64, y as i64]);
    let mut seen = gaussian::filter(source, |x, y| to_luma(rgb(source, x, y)));
    let falloff = p.number(3);
    for axis in 0..2 {
        seen = match falloff > 0.0 {
            true => along(&seen, axis, &weights, falloff),
            false => smoothed(&seen, axis, &weights),
        };
    }
    gaussian::filter(&seen, |x, y| to_rgb(rgb(&seen, x, y)))
}

fn passes(settings: &Settings) -> Vec<Pass> {
    let spared = if edge(settings) > 0.0 { KEEPS_EDGES } else { 0 };
    let pass = |axis: u32| Pass {
        file: "noise_reduction.comp",
        constants: [axis | spared, unrolled(settings).unwrap_or(0)],
        run: if axis == 0 { [gaussian::RUN, 1] } else { [1, gaussian::RUN] },
    };
    vec![pass(0), pass(1)]
}

/// Of places without edges: luma and the colours' differences to it are smoothed on their own.
fn smoothing(settings: &Settings) -> Filter {
    let [luma, chroma] = sigmas_px(settings).map(|sigma| match sigma > 0.0 {
        true => gaussian::weights(sigma),
        false => vec![1.0],
    });
    Filter::lifted([(-1.0, &luma), (-1.0, &chroma)])
}

impl Effect for NoiseReduction {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        // An edge is spared of nothing where nothing is smoothed.
        u32::from(sigmas_px(settings).iter().any(|s| *s > 0.0))
    }

    fn moments(&self) -> Moments {
        Moments::Filter(smoothing)
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let [luma, chroma] = weights(settings);
        packer.bits(luma.len() as u32 - 1);
        packer.table(luma);
        packer.table(chroma);
        packer.number(if edge(settings) > 0.0 { 0.5 / edge(settings).powi(2) } else { 0.0 });
        if unrolled(settings).is_some() {
            weights(settings).iter().flatten().for_each(|w| packer.number(f64::from(*w)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::rng::random_normal;

    #[test]
    fn where_no_edge_is_spared_both_ways_of_smoothing_are_one() {
        let source = Plane::from_fn(37, 23, |x, y| {
            [0, 1, 2].map(|c| 0.5 + 0.1 * random_normal([x as u32, y as u32], 0, c, [1, 2])[0])
        });
        for [luma, chroma] in [[0.6, 2.3], [1.7, 0.5]] {
            let mut weights = [luma, chroma].map(gaussian::weights);
            let longest = weights[0].len().max(weights[1].len());
            weights.iter_mut().for_each(|w| w.resize(longest, 0.0));
            for axis in 0..2 {
                let fast = smoothed(&source, axis, &weights);
                // Edges so large that none is one.
                let slow = along(&source, axis, &weights, 1e-30);
                let apart = fast.data.iter().zip(&slow.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(apart < 1e-6, "{luma} {chroma} along {axis}: {apart}");
                let other = along(&source, 1 - axis, &weights, 1e-30);
                assert!(fast.data.iter().zip(&other.data).any(|(a, b)| (a - b).abs() > 1e-2), "control");
            }
        }
    }
}
