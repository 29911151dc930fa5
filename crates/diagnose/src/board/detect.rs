//! Checkerboards in a picture: the detector of `calib-targets` finds the grid, its place on the board follows from its
//! size.

use calib_targets_chessboard::{ChessboardDetector, ChessboardParams, detect_corner_frame};
use calib_targets_core::{GrayImageView, default_chess_config};
use glam::DVec2;

use super::refine::refined;
use super::target::Seen;
use shutterbug::plane::Plane;

/// The detector's rings have a radius of some px: pictures are shrunk until their longer side is at most this long, px,
/// and tried in other sizes where that finds no whole board.
const LONGEST_PX: usize = 1600;
/// Less than this long nothing is left of a board, px.
const SHORTEST_PX: usize = 240;

/// Points of a grid that is part of a board, counted from its own corner.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Column and row, and place in the picture, px.
    pub points: Vec<([usize; 2], DVec2)>,
    /// Columns and rows.
    pub size: [usize; 2],
}

/// What a picture shows of a checkerboard.
#[derive(Clone, Debug)]
pub(super) enum Found {
    Board(Vec<Seen>),
    /// So many columns and rows of inner corners, which lie nowhere or in several places on the board.
    Other([usize; 2]),
    Nothing,
}

/// Finds a board of so many inner corners.
pub(super) fn find(grey: &Plane<u8>, size: [usize; 2]) -> Found {
    let mut best: Option<Vec<Seen>> = None;
    let mut other: Option<[usize; 2]> = None;
    for shrunk in sizes(grey) {
        let Some(grid) = grid_in(grey, shrunk) else { continue };
        let Some(seen) = place(&grid, size) else {
            if other.is_none_or(|o| o[0] * o[1] < grid.size[0] * grid.size[1]) {
                other = Some(grid.size);
            }
            continue;
        };
        let whole = seen.len() == size[0] * size[1];
        if best.as_ref().is_none_or(|b| b.len() < seen.len()) {
            best = Some(to_the_fraction(grey, seen, shrunk));
        }
        if whole {
            break;
        }
    }
    match (best, other) {
        (Some(seen), _) => Found::Board(seen),
        (None, Some(size)) => Found::Other(size),
        (None, None) => Found::Nothing,
    }
}

/// Smallest side in which a grid is looked for, px: the detectors take a margin off each for granted.
const LEAST_PX: usize = 32;

/// How many times to shrink, in the order in which it is tried.
pub(super) fn sizes(grey: &Plane<u8>) -> Vec<usize> {
    let longest = grey.width.max(grey.height);
    let mut first = 1;
    while longest / first > LONGEST_PX {
        first *= 2;
    }
    let smaller = [2 * first, 4 * first].into_iter().filter(|s| longest / s >= SHORTEST_PX);
    let larger = (first > 1).then_some(first / 2);
    let all = [first].into_iter().chain(larger).chain(smaller);
    all.filter(|s| grey.width.min(grey.height) / s >= LEAST_PX).collect()
}

/// The largest grid in the picture.
pub(super) fn grid_in(grey: &Plane<u8>, shrunk: usize) -> Option<Grid> {
    let small = shrink(grey, shrunk);
    let view = GrayImageView { width: small.width, height: small.height, data: &small.data };
    let corners = detect_corner_frame(&view, &default_chess_config()).corners;
    let detector = ChessboardDetector::new(ChessboardParams::default()).ok()?;
    let board = detector.detect(&corners)?;
    let points: Vec<_> = board
        .corners
        .iter()
        .filter_map(|c| {
            let at = [usize::try_from(c.grid.u).ok()?, usize::try_from(c.grid.v).ok()?];
            // The detector counts from centres of pixels.
            let px = DVec2::new(f64::from(c.position.x), f64::from(c.position.y)) + 0.5;
            Some((at, px * shrunk as f64))
        })
        .collect();
    let most = |axis: usize| points.iter().map(|p| p.0[axis] + 1).max();
    let size = [most(0)?, most(1)?];
    Some(Grid { points, size })
}

/// Means over blocks of `times` px.
pub(super) fn shrink(grey: &Plane<u8>, times: usize) -> Plane<u8> {
    if times == 1 {
        return grey.clone();
    }
    let count = (times * times) as u32;
    Plane::from_fn(grey.width / times, grey.height / times, |x, y| {
        let block = (0..times).flat_map(|j| {
            let from = (y * times + j) * grey.width + x * times;
            grey.data[from..from + times].iter()
        });
        [((block.map(|v| u32::from(*v)).sum::<u32>() + count / 2) / count) as u8]
    })
}

/// The grid as part of a board of `size`: upright or turned by a quarter, where exactly one place of the board in it
/// holds the most points. A grid that is smaller than the board could lie in several places.
fn place(grid: &Grid, size: [usize; 2]) -> Option<Vec<Seen>> {
    let [columns, _] = grid.size;
    let upright = grid.points.clone();
    // (u, v) to (v, columns - 1 - u): turned, not mirrored.
    let turned: Vec<_> = grid.points.iter().map(|&([u, v], px)| ([v, columns - 1 - u], px)).collect();
    let mut best: Vec<(usize, Vec<Seen>)> = Vec::new();
    for (points, held) in [(upright, grid.size), (turned, [grid.size[1], grid.size[0]])] {
        if held[0] < size[0] || held[1] < size[1] {
            continue;
        }
        for (left, above) in
            (0..=held[0] - size[0]).flat_map(|i| (0..=held[1] - size[1]).map(move |j| (i, j)))
        {
            let inside = |&([u, v], px): &([usize; 2], DVec2)| {
                let point = [u.checked_sub(left)?, v.checked_sub(above)?];
                (point[0] < size[0] && point[1] < size[1]).then_some(Seen { point, px })
            };
            let seen: Vec<Seen> = points.iter().filter_map(inside).collect();
            best.push((seen.len(), seen));
        }
        // A square board looks the same turned.
        if !best.is_empty() {
            break;
        }
    }
    let most = best.iter().map(|b| b.0).max()?;
    let mut winners = best.into_iter().filter(|b| b.0 == most);
    let (_, seen) = winners.next()?;
    winners.next().is_none().then_some(seen)
}

/// Each point refined in the picture at its full size; points that cannot be are left out.
pub(super) fn to_the_fraction(grey: &Plane<u8>, seen: Vec<Seen>, shrunk: usize) -> Vec<Seen> {
    let refine = |s: &Seen| {
        let free_px = nearest_px(&seen, s);
        refined(grey, s.px, free_px, shrunk).map(|px| Seen { px, ..*s })
    };
    seen.iter().filter_map(refine).collect()
}

/// Distance of the nearest other point, px.
pub(super) fn nearest_px(seen: &[Seen], of: &Seen) -> f64 {
    let others = seen.iter().filter(|s| s.point != of.point);
    others.map(|s| (s.px - of.px).length()).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(size: [usize; 2]) -> Grid {
        let points = (0..size[0] * size[1]).map(|i| [i % size[0], i / size[0]]);
        let points = points.map(|p| (p, DVec2::new(p[0] as f64, p[1] as f64))).collect();
        Grid { points, size }
    }

    #[test]
    fn a_grid_is_placed_where_it_can_lie_once_and_never_mirrored() {
        let seen = place(&grid([9, 6]), [9, 6]).expect("as it is");
        assert_eq!(seen[10].point, [1, 1]);
        let turned = place(&grid([6, 9]), [9, 6]).expect("turned");
        assert_eq!(turned.len(), 54);
        // Turned, not mirrored: columns across rows keep their sense.
        let at = |p: [usize; 2]| turned.iter().find(|s| s.point == p).expect("seen").px;
        let (x, y) = (at([1, 0]) - at([0, 0]), at([0, 1]) - at([0, 0]));
        assert!(x.perp_dot(y) > 0.0);
        assert!(place(&grid([8, 6]), [9, 6]).is_none(), "smaller");
        assert!(place(&grid([10, 6]), [9, 6]).is_none(), "two places");
        // One point beyond the board: the place that holds the rest wins.
        let mut more = grid([9, 6]);
        more.points.push(([9, 3], DVec2::new(9.0, 3.0)));
        more.size = [10, 6];
        assert_eq!(place(&more, [9, 6]).expect("one place").len(), 54);
    }
}
