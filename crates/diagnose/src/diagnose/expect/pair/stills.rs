//! A few stills: too few to fit some and judge by others. Each is then taken several times, every time with other parts
//! of the picture open, so that no part that is judged has been fitted.

use super::frames::SimFrame;
use shutterbug::plane::Plane;

/// Pairs from which on whole frames are fitted and judged.
const ENOUGH: usize = 4;
/// Parts that there are to be, of all stills together.
const PARTS: usize = 6;
/// Tiles along the shorter side of a picture: small enough that each part sees all of it, large beside what mixes
/// pixels.
const TILES: usize = 8;
/// Least side of a tile, px.
const LEAST_TILE_PX: usize = 16;

/// Why a sensor's own pattern is not told of by them, and what to give.
pub(crate) const FEW: [&str; 2] = [
    "in so few pictures what stays with the sensor cannot be told from what the picture shows",
    "four pictures or more of different content",
];
/// Effects for which pictures of different content, or times, are needed.
const NEED_MORE: [&str; 3] = ["fixed_pattern_noise", "hot_pixels", "flicker"];

/// Into how many parts each of so many stills is divided.
pub(super) fn parts(count: usize) -> usize {
    if count >= ENOUGH { 1 } else { PARTS.div_ceil(count) }
}

/// Whether an effect cannot be told of by a few stills.
pub(crate) fn needs_more(name: &str) -> bool {
    NEED_MORE.contains(&name)
}

/// A still, so many times, each with its own part of the picture open.
pub(super) fn divided(frame: SimFrame, parts: usize) -> Vec<SimFrame> {
    let own = |part: usize| SimFrame { open: part_of(&frame.open, part, parts), ..frame.clone() };
    (0..parts).map(own).collect()
}

/// `open` where a tile belongs to a part: tiles in turn, along rows and down columns.
fn part_of(open: &Plane<f32>, part: usize, parts: usize) -> Plane<f32> {
    let tile = (open.width.min(open.height) / TILES).max(LEAST_TILE_PX);
    Plane::from_fn(open.width, open.height, |x, y| {
        let own = (x / tile + y / tile) % parts == part;
        [if own { open.pixel(x, y)[0] } else { 0.0 }]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_open_in_one_part_and_no_part_lacks_a_corner_of_the_picture() {
        let open = Plane::from_fn(320, 240, |x, _| [if x == 7 { 0.0 } else { 1.0f32 }]);
        for count in 1..ENOUGH {
            let parts = parts(count);
            let all: Vec<Plane<f32>> = (0..parts).map(|p| part_of(&open, p, parts)).collect();
            for (i, was) in open.data.iter().enumerate() {
                assert_eq!(all.iter().map(|p| p.data[i]).sum::<f32>(), *was);
            }
            for (part, [x, y]) in
                all.iter().flat_map(|p| [[0, 0], [160, 0], [0, 120], [160, 120]].map(|at| (p, at)))
            {
                let quarter =
                    (0..120 * 160).filter(|k| part.pixel(x + k % 160, y + k / 160)[0] > 0.0).count();
                assert!(quarter > 120 * 160 / parts / 3, "{quarter} of a quarter in one of {parts}");
            }
        }
        assert_eq!(parts(ENOUGH), 1);
    }
}
