//! Traces of the camera that do not depend on content, called marks, measured in single frames.
//!
//! Noise is measured between near pixels of flat blocks.

mod blocks;
mod edges;
mod flat;
mod lines;
mod mosaic;
mod pattern;

pub(super) use blocks::{Block, blocks};
pub(super) use flat::flat;
pub(super) use pattern::pattern_marks;

use crate::diagnose::expect::pair::slopes_to;
use shutterbug::plane::Plane;
use shutterbug::plane::srgb_decode;

/// Fewest flat blocks of a frame and brightness.
const FEWEST_BLOCKS: usize = 3;
/// Bins of brightness, and the width of one, DN.
pub(super) const BINS: usize = 10;
const BIN_DN: f64 = 24.0;
/// Brightness of the first bin's begin, DN.
const FIRST_DN: f64 = 8.0;
/// Variance of a value less the mean of two others.
const HIGH_PASS: f64 = 1.5;
/// Linear variances are told in squares of a 255th of full scale.
pub(super) const LINEAR: f64 = 255.0 * 255.0;

/// The marks of a frame, in this order.
pub(super) const MARKS: usize = BINS + 14;
pub(super) const NEIGHBOURS: [usize; 2] = [BINS, BINS + 1];
pub(super) const LINES: [usize; 2] = [BINS + 2, BINS + 3];
pub(super) const EDGES: [usize; 2] = [BINS + 4, BINS + 5];
pub(super) const LATERAL: [usize; 2] = [BINS + 6, BINS + 7];
pub(super) const MOSAIC: [usize; 3] = [BINS + 8, BINS + 9, BINS + 10];
pub(super) const PATTERN: [usize; 2] = [BINS + 11, BINS + 12];
pub(super) const STUCK: usize = BINS + 13;

/// What a mark is called.
pub(super) fn name(mark: usize) -> String {
    match mark {
        m if m < BINS => {
            let [from, to] = bin_dn(m);
            format!("noise at {from:.0} to {to:.0} DN (linear variance, squares of 1/255)")
        }
        m if m == NEIGHBOURS[0] => "noise of neighbours across, over that of values 2 px apart".to_owned(),
        m if m == NEIGHBOURS[1] => "noise of neighbours down, over that of values 2 px apart".to_owned(),
        m if m == LINES[0] => "noise of rows (linear variance, squares of 1/255)".to_owned(),
        m if m == LINES[1] => "noise of columns (linear variance, squares of 1/255)".to_owned(),
        m if m == EDGES[0] => "width of the sharpest edges across, px".to_owned(),
        m if m == EDGES[1] => "width of the sharpest edges down, px".to_owned(),
        m if m == LATERAL[0] => "magnification of red over green".to_owned(),
        m if m == LATERAL[1] => "magnification of blue over green".to_owned(),
        m if m == MOSAIC[0] => {
            "sharpness of green, even over odd pixels of a chess board (logarithm)".to_owned()
        }
        m if m == MOSAIC[1] => "sharpness of red, even over odd columns (logarithm)".to_owned(),
        m if m == MOSAIC[2] => "sharpness of red, even over odd rows (logarithm)".to_owned(),
        m if m == PATTERN[0] => {
            "pattern that all frames share, dark (linear variance, squares of 1/255)".to_owned()
        }
        m if m == PATTERN[1] => {
            "pattern that all frames share, bright (linear variance, squares of 1/255)".to_owned()
        }
        _ => "pixels that are bright in every frame".to_owned(),
    }
}

/// Brightness of a bin, DN.
pub(super) fn bin_dn(bin: usize) -> [f64; 2] {
    [0.0, 1.0].map(|k| FIRST_DN + BIN_DN * (bin as f64 + k))
}

/// A mark of one frame, and how much it saw of it; nothing where it saw none.
pub(super) type Mark = Option<[f64; 2]>;

/// The marks of a picture and of its flat blocks.
pub(super) fn marks(dn: &Plane<f32>, flat: &[&Block]) -> Vec<Mark> {
    let mut out = vec![None; MARKS];
    noise_marks(flat, &mut out);
    lines::line_marks(flat, &mut out);
    for (k, mark) in EDGES.into_iter().enumerate() {
        out[mark] = edges::edge_width(dn, k == 1);
    }
    for (channel, mark) in [0, 2].into_iter().zip(LATERAL) {
        out[mark] = lateral(dn, channel);
    }
    mosaic::mosaic_marks(dn, &mut out);
    out
}

fn noise_marks(flat: &[&Block], out: &mut [Mark]) {
    for (bin, mark) in out.iter_mut().enumerate().take(BINS) {
        let [from, to] = bin_dn(bin).map(|dn| f64::from(srgb_decode((dn / 255.0) as f32)));
        let own: Vec<f64> = flat.iter().filter(|b| (from..to).contains(&b.level)).map(|b| b.fine).collect();
        if own.len() >= FEWEST_BLOCKS {
            *mark = Some([LINEAR * own.iter().sum::<f64>() / own.len() as f64, own.len() as f64]);
        }
    }
    let n = flat.len() as f64;
    if flat.len() < FEWEST_BLOCKS {
        return;
    }
    let sum = |f: &dyn Fn(&Block) -> f64| flat.iter().map(|b| f(b)).sum::<f64>();
    // Without noise a ratio says nothing: what rounding leaves counts as some.
    let rounding = n * HIGH_PASS / 24.0;
    for k in 0..2 {
        out[NEIGHBOURS[k]] = Some([(sum(&|b| b.near[k]) + rounding) / (sum(&|b| b.far[k]) + rounding), n]);
    }
}

/// How much larger a colour's picture is than that of green, less 1.
fn lateral(dn: &Plane<f32>, channel: usize) -> Mark {
    let only = |c: usize| Plane { data: dn.data.chunks_exact(3).flat_map(|p| [p[c]; 3]).collect(), ..*dn };
    let (green, other) = (only(1), only(channel));
    let (mut ab, mut aa) = (0.0, 0.0);
    let centre = [0.5 * dn.width as f64, 0.5 * dn.height as f64];
    for (middle, a, b) in slopes_to(&green, &other) {
        let r = [middle[0] - centre[0], middle[1] - centre[1]];
        ab += r[0] * b[0] + r[1] * b[1];
        aa += a[0] * r[0] * r[0] + 2.0 * a[1] * r[0] * r[1] + a[2] * r[1] * r[1];
    }
    (aa > 0.0).then(|| [ab / aa, aa])
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    fn noisy(sigma: impl Fn(f32) -> f32, row: f32) -> Plane<f32> {
        Plane::from_fn(320, 240, |x, y| {
            let ramp = 40.0 + 150.0 * x as f32 / 320.0 + if (x / 40 + y / 40) % 2 == 0 { 20.0 } else { 0.0 };
            let [r, g, b, _] = random_normal([x as u32, y as u32], 0, 5, [1, 2]);
            let [of_row, ..] = random_normal([y as u32, 9], 0, 6, [1, 2]);
            [r, g, b].map(|n| (ramp + sigma(ramp) * n + row * of_row).round())
        })
    }

    fn of(p: &Plane<f32>) -> Vec<Mark> {
        let all = vec![blocks(p)];
        let flat = flat(&all);
        marks(p, &all[0].iter().zip(&flat[0]).filter(|(_, f)| **f).map(|(b, _)| b).collect::<Vec<_>>())
    }

    #[test]
    fn noise_is_measured_by_brightness_and_that_of_rows_apart_from_it() {
        let linear = |dn: f64| f64::from(srgb_decode((dn / 255.0) as f32));
        let slope = |dn: f64| linear(dn + 0.5) - linear(dn - 0.5);
        // Read noise and shot noise, linear variance.
        let variance = |dn: f64| 1e-5 + 4e-4 * linear(dn);
        let found = of(&noisy(|dn| (variance(f64::from(dn)).sqrt() / slope(f64::from(dn))) as f32, 1.5));
        for bin in 2..6 {
            let [from, to] = bin_dn(bin);
            let dn = 0.5 * (from + to);
            let truth = LINEAR * (variance(dn) + slope(dn).powi(2) / 12.0);
            let [v, _] = found[bin].expect("seen");
            assert!((v / truth - 1.0).abs() < 0.1, "bin {bin}: {v} for {truth}");
        }
        let ([rows, _], [columns, _]) = (found[LINES[0]].expect("seen"), found[LINES[1]].expect("seen"));
        assert!(rows > 0.3 && columns.abs() < 0.15 * rows, "{rows} {columns}");
        let [near, _] = found[NEIGHBOURS[0]].expect("seen");
        assert!((near - 1.0).abs() < 0.06, "{near}");
    }

    #[test]
    fn texture_beside_flat_places_is_no_noise() {
        let share = |amplitude: f32| {
            let p = noisy(|_| 2.0, 0.0);
            let textured = Plane::from_fn(320, 240, |x, y| {
                let more = if (x / 64 + y / 64) % 2 == 0 { amplitude * (1.3 * x as f32).sin() } else { 0.0 };
                [0, 1, 2].map(|c| p.pixel(x, y)[c] + more)
            });
            of(&textured)[4].expect("seen")[0]
        };
        assert!((share(8.0) / share(0.0) - 1.0).abs() < 0.1, "{} {}", share(8.0), share(0.0));
        let all = blocks(&noisy(|_| 2.0, 0.0));
        assert!(flat(&[all])[0].iter().filter(|f| **f).count() > 500, "control: flat blocks are found");
    }

    #[test]
    fn a_blurred_edge_is_wider_and_noise_of_neighbours_then_alike() {
        let sharp = noisy(|_| 2.0, 0.0);
        let boxes = |sigma: f64| {
            let p = Plane::from_fn(320, 240, |x, y| {
                [if (x / 40 + y / 40) % 2 == 0 { 60.0 } else { 160.0f32 }; 3]
            });
            if sigma > 0.0 { shutterbug::effects::gaussian::blurred(&p, sigma) } else { p }
        };
        let width = |p: &Plane<f32>| of(p)[EDGES[0]].expect("edges")[0];
        assert!((width(&boxes(0.0)) - 2.0).abs() < 0.01, "{}", width(&boxes(0.0)));
        // Contrast over the slope of a Gaussian edge: sigma times the root of 2 pi, the pixels' own width with it.
        let wide = width(&boxes(1.5));
        assert!(
            (wide / (1.5f64.powi(2) + 1.0 / 12.0 + 1.0 / 3.0).sqrt() / 2.507 - 1.0).abs() < 0.08,
            "{wide}"
        );
        let soft = shutterbug::effects::gaussian::blurred(&sharp, 1.0);
        let near = |p: &Plane<f32>| of(p)[NEIGHBOURS[1]].expect("seen")[0];
        assert!(near(&soft) < 0.6 * near(&sharp), "{} {}", near(&soft), near(&sharp));
    }
}
