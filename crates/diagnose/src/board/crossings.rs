//! Whether the corners of a table are those of its picture: four squares meet there, dark and bright in turn (ChESS, S.
//! Bennett and J. Lasenby, Computer Vision and Image Understanding 118, 2014).

use glam::DVec2;

use super::detect::nearest_px;
use super::refine::{is_inside, sample};
use super::target::Seen;
use shutterbug::plane::Plane;

/// Places on the ring around a corner.
const RING: usize = 16;
/// Its radius in px, and as a share of the way to the next corner: half of that lies on the next edge.
const RADIUS_PX: [f64; 2] = [2.0, 5.0];
const SHARE: f64 = 0.3;

/// What makes a picture's points none of its own; `None` if most of them lie at crossings.
pub(super) fn why_not(grey: &Plane<u8>, seen: &[Seen]) -> Option<String> {
    let told: Vec<bool> = seen.iter().filter_map(|s| is_crossing(grey, s.px, nearest_px(seen, s))).collect();
    let there = told.iter().filter(|t| **t).count();
    (2 * there < told.len())
        .then(|| format!("of {} corners in the table {there} lie where squares meet", told.len()))
}

/// Whether values opposite each other on a ring are alike and those a quarter further are not; nothing where the ring
/// leaves the picture.
fn is_crossing(grey: &Plane<u8>, at: DVec2, free_px: f64) -> Option<bool> {
    let radius = (SHARE * free_px).clamp(RADIUS_PX[0], RADIUS_PX[1]);
    if !is_inside(grey, at, radius + 1.0) {
        return None;
    }
    let ring: Vec<f64> = (0..RING)
        .map(|i| {
            let turn = std::f64::consts::TAU * i as f64 / RING as f64;
            sample(grey, at + radius * DVec2::from_angle(turn))
        })
        .collect();
    let of = |i: usize| ring[i % RING];
    let (quarter, half) = (RING / 4, RING / 2);
    let crossed: f64 =
        (0..quarter).map(|i| (of(i) + of(i + half) - of(i + quarter) - of(i + half + quarter)).abs()).sum();
    let edge: f64 = (0..half).map(|i| (of(i) - of(i + half)).abs()).sum();
    let near = [DVec2::ZERO, DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y];
    let middle = near.iter().map(|d| sample(grey, at + *d)).sum::<f64>() / near.len() as f64;
    let mean = ring.iter().sum::<f64>() / RING as f64;
    Some(crossed > edge + RING as f64 * (middle - mean).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A checkerboard of squares of 20 px, its first inner corner at (20, 20), a little soft.
    fn board() -> Plane<u8> {
        let value = |x: f64, y: f64| {
            if ((x / 20.0).floor() + (y / 20.0).floor()) % 2.0 == 0.0 { 30.0 } else { 200.0 }
        };
        Plane::from_fn(160, 120, |x, y| {
            let part = |i: usize| (i as f64 + 0.5) / 4.0 * 2.0 - 0.5;
            let sum: f64 = (0..16).map(|i| value(x as f64 + part(i % 4), y as f64 + part(i / 4))).sum();
            [(sum / 16.0) as u8]
        })
    }

    fn corners(at: impl Fn(usize, usize) -> DVec2) -> Vec<Seen> {
        (0..35).map(|i| Seen { point: [i % 7, i / 7], px: at(i % 7, i / 7) }).collect()
    }

    #[test]
    fn corners_of_another_picture_are_none_of_this_one() {
        let grey = board();
        let right = |x: usize, y: usize| 20.0 * DVec2::new(x as f64 + 1.0, y as f64 + 1.0);
        assert_eq!(why_not(&grey, &corners(right)), None);
        // As OpenCV counts, and a lens that is a little soft.
        assert_eq!(why_not(&grey, &corners(|x, y| right(x, y) - 0.5)), None);
        let half_size = |x: usize, y: usize| 0.5 * right(x, y);
        let shifted = |x: usize, y: usize| right(x, y) + DVec2::new(7.0, 3.0);
        let along_an_edge = |x: usize, y: usize| right(x, y) + DVec2::new(8.0, 0.0);
        for wrong in [&half_size as &dyn Fn(usize, usize) -> DVec2, &shifted, &along_an_edge] {
            assert!(why_not(&grey, &corners(wrong)).is_some());
        }
    }
}
