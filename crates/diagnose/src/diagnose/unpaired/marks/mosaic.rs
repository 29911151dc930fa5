//! What demosaicking leaves: pixels that had the colour themselves differ more from their neighbours than those where
//! it was filled in. Content does not know which pixels these are.

use super::{MOSAIC, Mark};
use shutterbug::plane::Plane;

/// Differences from the neighbours beyond this are edges of the content, DN: they count no more than this.
const EDGE_DN: f64 = 20.0;
/// What rounding makes of such a difference, DN.
const ROUNDING_DN: f64 = 0.3;

/// Mean size of what a colour differs by from its four neighbours, by column and row in a square of 2 x 2.
fn by_place(dn: &Plane<f32>, channel: usize) -> [[f64; 2]; 2] {
    let (mut sums, mut counts) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for y in 1..dn.height.saturating_sub(1) {
        for x in 1..dn.width.saturating_sub(1) {
            let at = |x: usize, y: usize| dn.pixel(x, y)[channel];
            let own = at(x, y);
            // Clipped values have lost it.
            if own <= 0.5 || own >= 254.5 {
                continue;
            }
            let around = 0.25 * (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1));
            sums[y % 2][x % 2] += f64::from((own - around).abs()).min(EDGE_DN);
            counts[y % 2][x % 2] += 1.0;
        }
    }
    [0, 1].map(|y| [0, 1].map(|x| sums[y][x] / f64::max(counts[y][x], 1.0) + ROUNDING_DN))
}

/// Logarithms of how much sharper a colour is where one filter would be than at the others.
pub(super) fn mosaic_marks(dn: &Plane<f32>, out: &mut [Mark]) {
    let seen = (dn.width * dn.height) as f64;
    let [[a, b], [c, d]] = by_place(dn, 1);
    let green = ((a + d) / (b + c)).ln();
    let [[a, b], [c, d]] = by_place(dn, 0);
    let red = [((a + c) / (b + d)).ln(), ((a + b) / (c + d)).ln()];
    for (mark, value) in MOSAIC.into_iter().zip([green, red[0], red[1]]) {
        out[mark] = Some([value, seen]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::{P, Theta};
    use crate::diagnose::unpaired::marks::MARKS;
    use crate::diagnose::unpaired::simulated::Simulated;
    use shutterbug::chain::rng::random_normal;
    use shutterbug::plane::srgb_decode;

    fn of(dn: &Plane<f32>) -> [f64; 3] {
        let mut out = vec![None; MARKS];
        mosaic_marks(dn, &mut out);
        MOSAIC.map(|k| out[k].expect("measured")[0])
    }

    #[test]
    fn each_pattern_leaves_marks_of_its_own_and_no_mosaic_leaves_none() {
        let plain = Plane::from_fn(200, 160, |x, y| {
            let [r, g, b, _] = random_normal([x as u32 / 2, y as u32 / 2], 0, 5, [1, 2]);
            [r, g, b].map(|n| 128.0 + 10.0 * n + 8.0 * (0.9 * x as f32 + 0.4 * y as f32).sin())
        });
        assert!(of(&plain).iter().all(|v| v.abs() < 0.02), "{:?}", of(&plain));
        let decoded = plain.data.chunks_exact(3).flat_map(|p| {
            let [r, g, b] = [0, 1, 2].map(|c| srgb_decode(p[c] / 255.0));
            [r, g, b, 1.0]
        });
        let simulated = Simulated(vec![Plane { data: decoded.collect(), channels: 4, ..plain.clone() }]);
        // Signs: green is sampled off the diagonal of red; red at its own column and row.
        for (pattern, signs) in [
            (1.0, [-1.0, 1.0, 1.0]),
            (2.0, [-1.0, -1.0, -1.0]),
            (3.0, [1.0, -1.0, 1.0]),
            (4.0, [1.0, 1.0, -1.0]),
        ] {
            let theta = Theta::neutral().with(P::Mosaic, pattern);
            let seen = of(&simulated.delivered(&theta, 1)[0]);
            assert!(seen.iter().zip(signs).all(|(v, s)| v * s > 0.1), "{pattern}: {seen:?}");
        }
    }
}
