//! Whether two pictures under a blinking light show a scene at rest. The light multiplies whole lines, so that what is
//! left of each line over its mean is the scene's: it lies at the same place in both pictures, or at another, where the
//! camera moved. A scene that is even along the lines tells nothing.

use nalgebra::Complex;

use super::box_mean::box_mean;
use super::frames::Encoding;
use super::own::{beyond, common_spectrum, transform};
use shutterbug::plane::Plane;

/// Half a side of the square whose mean is taken off, px: slopes of light and lens stay where they are.
const AROUND_PX: usize = 8;
/// Added to the mean of a line, of white: below, noise is most of what there is.
const DARK: f32 = 0.01;
/// How often displacement, or rest, may be seen where nothing shows it.
const ALPHA: f64 = 0.01;
/// The fourth power of the tiles' soft borders (squares of sines) over their squared square, in the mean along a side:
/// so much wider is chance, of two sides its root.
const SOFTNESS: f64 = (35.0 / 128.0) / (9.0 / 64.0);
/// So near are two displacements one and the same, px: the lens blurs.
const SAME_PX: usize = 2;

/// What the second of two pictures is to the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rest {
    /// The scene lies at the same place.
    Still,
    /// It lies at another, so many columns and rows further.
    Moved([i64; 2]),
    /// Nothing tells.
    Unknown,
}

/// Where the scene of the second picture (encoded values) lies against the first: the phases of what both have in
/// common (Kuglin and Hines, 1975). Two places must differ by more than chance.
pub fn rest([first, second]: [&Plane<f32>; 2], encoding: Encoding, lines_are_rows: bool) -> Rest {
    let [a, b] = [first, second].map(|p| along_lines(p, encoding, lines_are_rows));
    let (mut values, side) = common_spectrum(&a, &b);
    // Every frequency counts alike: what is strongest, slopes and shadows, has no sharp place.
    values.iter_mut().for_each(|v| *v = if v.norm() > 0.0 { *v / v.norm() } else { Complex::new(0.0, 0.0) });
    transform(&mut values, side);
    // Of nothing in common, the values are normal with no more than this deviation: tiles with soft borders are less
    // than whole ones.
    let deviation = side as f64 * SOFTNESS;
    let likeness: Vec<f64> = values.iter().map(|v| v.re / deviation).collect();
    let signed = |i: usize| if i < side / 2 { i as i64 } else { i as i64 - side as i64 };
    let place = |i: usize| [signed(i % side), signed(i / side)];
    let far = |i: usize| place(i).iter().any(|p| p.unsigned_abs() as usize > SAME_PX);
    let best = |far_ones: bool| {
        let all = (0..likeness.len()).filter(|i| far(*i) == far_ones);
        all.max_by(|p, q| likeness[*p].total_cmp(&likeness[*q])).unwrap_or(0)
    };
    let (here, there) = (best(false), best(true));
    // The difference of two such values.
    let clear = 2f64.sqrt() * beyond(ALPHA / likeness.len() as f64);
    let ahead = likeness[here] - likeness[there];
    match () {
        () if ahead > clear => Rest::Still,
        () if ahead < -clear => Rest::Moved(place(there)),
        () => Rest::Unknown,
    }
}

/// What a picture's values are over the mean of their line, without what is even over some pixels.
fn along_lines(picture: &Plane<f32>, encoding: Encoding, lines_are_rows: bool) -> Plane<f32> {
    let (w, h, channels) = (picture.width, picture.height, picture.channels);
    let light = |p: &[f32]| p.iter().map(|v| encoding.decode(*v)).sum::<f32>() / channels as f32;
    let data: Vec<f32> = picture.data.chunks_exact(channels).map(light).collect();
    let lines = if lines_are_rows { h } else { w };
    let line = |i: usize| if lines_are_rows { i / w } else { i % w };
    let mut sums = vec![0.0f64; lines];
    data.iter().enumerate().for_each(|(i, v)| sums[line(i)] += f64::from(*v));
    let mean = |i: usize| (sums[line(i)] / (w * h / lines) as f64) as f32;
    let over: Vec<f32> = data.iter().enumerate().map(|(i, v)| (v - mean(i)) / (mean(i) + DARK)).collect();
    let mut over = Plane { width: w, height: h, channels: 1, data: over };
    let even = box_mean(&over, AROUND_PX);
    over.data.iter_mut().zip(&even.data).for_each(|(v, e)| *v -= e);
    over
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dice(seed: u64) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        }
    }

    #[test]
    fn a_scene_that_moves_is_told_from_one_at_rest() {
        let mut roll = dice(3);
        let things = Plane::from_fn(60, 60, |_, _| [roll()]);
        let mut noise = dice(4);
        let mut picture = |contrast: f32, [dx, dy]: [usize; 2], phase: f32| {
            Plane::from_fn(192, 160, |x, y| {
                let thing = things.pixel((x + 16 - dx) / 4, (y + 16 - dy) / 4)[0];
                let lamp = 0.3 + 0.2 * (y as f32 / 3.0 + phase).sin();
                [lamp * (1.0 + contrast * thing) + 0.01 * noise()]
            })
        };
        let mut found = |contrast: f32, by: [usize; 2]| {
            let pair = [picture(contrast, [0, 0], 0.0), picture(contrast, by, 2.0)];
            rest([&pair[0], &pair[1]], Encoding::Linear, true)
        };
        assert_eq!(found(0.3, [0, 0]), Rest::Still);
        assert_eq!(found(0.3, [3, 5]), Rest::Moved([3, 5]));
        assert_eq!(found(0.3, [0, 7]), Rest::Moved([0, 7]));
        assert_eq!(found(0.0, [0, 4]), Rest::Unknown, "control: nothing but stripes");
    }
}
