//! What two correct simulations of one camera may differ by: the only place that says so. Weights, intervals, the
//! score, the checks and `no_gap` all take it from here.
//!
//! The numbers were measured on captures of an independent path tracer that hide nothing (`d00`, `d08`), rendered by
//! `shutterbug simulate --method exact`, as differences of delivered values.

use std::sync::LazyLock;

use shutterbug::chain::rng::{random_normal, seed_words};
use shutterbug::plane::{Plane, three};

/// Error of a value at an edge, px of displacement, independent from pixel to pixel: sampling of the pixel's area.
///
/// Measured: standard deviation over gradient 0.045 to 0.07 for gradients of 4 to 128 DN a px, d00 and d08.
pub(crate) const EDGE_PX: f64 = 0.055;
/// The same of the sampling of time, for each px that the content moves while a pixel is exposed.
///
/// Measured: standard deviation over gradient and path 0.012 to 0.016 for 32 to 256 DN over the path, d02 (7 px) and
/// d14 (24 px).
pub(crate) const PATH_PX: f64 = 0.015;
/// Error of a colour, DN, the same wherever the colour is: texture decoding, half floats.
///
/// Measured: mean difference of textured places 0.09 DN (withheld captures, CPU reference against lavapipe) to 0.2 DN
/// (d08), of solid colours below 0.01 (d00).
pub(crate) const COLOUR_DN: f64 = 0.1;
/// Error of all colours alike, DN.
///
/// Measured: textured places of d08 lie 0.20 to 0.22 DN below ours, whatever their colour, which is the reach of this
/// error; gains and gammas of withheld captures were off by 0.05 to 0.06 DN beyond what single colours explain.
pub(crate) const COMMON_DN: f64 = 0.1;
/// Error that may look like anything, DN: the half width that it gives an interval.
///
/// Measured: readouts, vignetting and gamma of another renderer's captures were off by 0.1 to 1 % so.
pub(crate) const ANYTHING_DN: f64 = 0.03;
/// Error of the place of all edges alike, px.
///
/// Measured: exposures of slow motions of withheld captures were off by as much.
pub(crate) const PLACE_PX: f64 = 0.01;
/// Difference of the variances of two pixel filters, px^2.
///
/// Measured: where nothing is hidden a blur of 0.28 to 0.30 px lowers the score most (d08, withheld captures).
pub(crate) const FILTER_PX2: f64 = 0.09;
/// Error of a variance of noise, as a part of it: clipping, bins of finite width, what is not flat.
///
/// Measured: variances of noise of known strength (`diagnose::noise` tests) come out within 7 %.
pub(crate) const SPREAD_ERROR: f32 = 0.05;
/// The same where neighbours are mixed behind the noise: their correlation is known on average only.
///
/// Measured: floors behind a Bayer pattern were 8 % below what the true parameters score (withheld captures).
pub(crate) const MIXED_ERROR: f32 = 0.1;
/// The discrepancy may reach so many of its standard deviations before it is called a gap.
pub(crate) const REACH: f64 = 2.0;

/// Draws of another correct simulation, see [`off_by`].
pub(crate) const DRAWS: usize = 4;
/// Whole DN that count as one colour.
pub(crate) const ALIKE_DN: usize = 4;

static OFF: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let colours = 256 / ALIKE_DN + 1;
    // So few draws are scaled to the variance that they stand for.
    let scaled = |of: &dyn Fn(u32) -> f32| -> [f32; DRAWS] {
        let drawn: [f32; DRAWS] = std::array::from_fn(|draw| of(draw as u32));
        let size = (drawn.iter().map(|v| v * v).sum::<f32>() / DRAWS as f32).sqrt();
        drawn.map(|v| v / size)
    };
    let normal = |at: [u32; 2], draw: u32| random_normal(at, draw, STREAM_COLOURS, seed_words(0));
    let common = scaled(&|draw| normal([0, 1], draw)[0]);
    let own: Vec<[[f32; DRAWS]; 3]> = (0..colours as u32)
        .map(|colour| std::array::from_fn(|c| scaled(&|draw| normal([colour, 0], draw)[c])))
        .collect();
    let at = |i: usize| {
        let (draw, colour) = (i / colours, i % colours);
        three(|c| COLOUR_DN as f32 * own[colour][c][draw] + COMMON_DN as f32 * common[draw])
    };
    (0..DRAWS * colours).map(at).collect()
});

/// Stream of what colours may be off by ("CO"), and values at edges ("ED").
const STREAM_COLOURS: u32 = 0x434F;
/// See [`STREAM_COLOURS`].
const STREAM_EDGES: u32 = 0x4544;

/// The picture of another correct simulation, DN: a draw of what colours and edges may be off by. Colours are off by
/// the same in all frames, edges are not.
pub(crate) fn off_by(mean: &Plane<f32>, path: Option<&Plane<f32>>, draw: usize, frame: usize) -> Plane<f32> {
    let off = &OFF[draw * (256 / ALIKE_DN + 1)..];
    let mut out = mean.clone();
    for (i, (p, edge)) in out.data.chunks_exact_mut(3).zip(edges(mean, path).chunks_exact(3)).enumerate() {
        let at_edge = random_normal([i as u32, draw as u32], frame as u32, STREAM_EDGES, seed_words(0));
        for c in 0..3 {
            let at = p[c].clamp(0.0, 255.0) / ALIKE_DN as f32;
            let (k, f) = (at as usize, at.fract());
            let colour = off[k][c] * (1.0 - f) + off[(k + 1).min(256 / ALIKE_DN)][c] * f;
            p[c] += colour + edge[c].sqrt() * at_edge[c];
        }
    }
    out
}

/// Variance that edges may have of a simulated picture's values, DN^2. `path`: how far the content moves while a pixel
/// is exposed, px, shape `[height, width, 2]`; nothing where the exposure is none.
///
/// A renderer averages samples, which are spread over the pixel's area and over the path. A value that changes by g a
/// px varies by g over the one, and by the product of g and the path over the other.
pub(crate) fn edges(mean: &Plane<f32>, path: Option<&Plane<f32>>) -> Vec<f32> {
    let (w, h) = (mean.width, mean.height);
    let [area, time] = [EDGE_PX, PATH_PX].map(|px| (0.25 * px * px) as f32);
    let mut out = Vec::with_capacity(mean.data.len());
    for y in 0..h {
        let (up, down) = (y.saturating_sub(1) * w, (y + 1).min(h - 1) * w);
        for x in 0..w {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(w - 1));
            let along = path.map_or([0.0; 2], |p| [p.pixel(x, y)[0], p.pixel(x, y)[1]]);
            for c in 0..3 {
                let at = |i: usize| mean.data[3 * i + c];
                let (gx, gy) = (at(y * w + right) - at(y * w + left), at(down + x) - at(up + x));
                let over_path = gx * along[0] + gy * along[1];
                out.push(area * (gx * gx + gy * gy) + time * over_path * over_path);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draws_vary_by_what_is_said_of_a_colour_and_of_all_of_them() {
        let colours = 256 / ALIKE_DN + 1;
        let size = |of: &dyn Fn(usize) -> f32| {
            ((0..DRAWS).map(|draw| of(draw).powi(2)).sum::<f32>() / DRAWS as f32).sqrt()
        };
        let whole = (COLOUR_DN.hypot(COMMON_DN)) as f32;
        let all: Vec<f32> =
            (0..3 * colours).map(|i| size(&|d| OFF[d * colours + i / 3][i % 3]).powi(2)).collect();
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        assert!((mean.sqrt() / whole - 1.0).abs() < 0.05, "{mean}");
        let common = size(&|d| {
            OFF[d * colours..(d + 1) * colours].iter().flatten().sum::<f32>() / (3 * colours) as f32
        });
        assert!((common / COMMON_DN as f32 - 1.0).abs() < 0.1, "{common}");
    }

    #[test]
    fn a_step_of_ten_dn_may_be_off_by_half_a_dn_and_a_flat_place_by_nothing() {
        let step = Plane::from_fn(8, 4, |x, _| [if x < 4 { 100.0 } else { 110.0 }; 3]);
        let seen = edges(&step, None);
        assert!((f64::from(seen[3 * 3]).sqrt() - 5.0 * EDGE_PX).abs() < 1e-6, "{}", seen[9]);
        assert_eq!(seen[0], 0.0, "control");
    }

    #[test]
    fn samples_spread_over_a_path_are_off_by_what_changes_along_it() {
        let ramp = Plane::from_fn(9, 9, |x, _| [10.0 * x as f32; 3]);
        let variance = |path: [f32; 2]| {
            let path = Plane::from_fn(9, 9, |_, _| path);
            f64::from(edges(&ramp, Some(&path))[3 * (4 * 9 + 4)])
        };
        let still = (10.0 * EDGE_PX).powi(2);
        assert!((variance([0.0, 0.0]) / still - 1.0).abs() < 1e-5);
        let moving = still + (80.0 * PATH_PX).powi(2);
        assert!((variance([8.0, 0.0]) / moving - 1.0).abs() < 1e-5);
        assert!((variance([0.0, 8.0]) / still - 1.0).abs() < 1e-5, "control: along the edge nothing changes");
    }
}
