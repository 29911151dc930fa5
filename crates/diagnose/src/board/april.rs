//! AprilGrids, laid out as by Kalibr: tags of the family t36h11 with a dark frame of two cells, squares between them
//! that make every corner of a tag a crossing, numbers row by row from the lower left, places counted to the right
//! and upwards.
//!
//! Corners and codes are found by `calib-targets`. What is here is which four crossings make up a tag: along the
//! edges that leave a crossing, the next ones.
//!
//! Layout: `GridCalibrationTargetAprilgrid.cpp` and `kalibr_create_target_pdf` of ethz-asl/kalibr.

use std::collections::{BTreeMap, BTreeSet};

use calib_targets_aruco::{MarkerCell, Matcher, ScanDecodeConfig, decode_marker_in_cell};
use calib_targets_charuco::{Dictionary, resolve_dictionary};
use calib_targets_chessboard::{ChessCorner, detect_corner_frame};
use calib_targets_core::{Coord, GrayImageView, default_chess_config};
use glam::DVec2;

use super::detect::{shrink, sizes, to_the_fraction};
use super::homography::homography;
use super::sheet::{Ink, Sheet};
use super::target::{Pattern, Seen, Target};
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// The family, by OpenCV's name. Its codes stand on their heads there: a marker of OpenCV's is Kalibr's turned by half.
const DICTIONARY: &str = "DICT_APRILTAG_36h11";
const HALF_TURN: usize = 2;
/// Cells of a tag's dark frame on each side, and of all along one side.
const FRAME: usize = 2;
const CELLS: usize = 10;
/// How many bits of 36 may be wrong: codes differ in 11 at least, and by chance one of 40 000 windows is as near to
/// one of them.
const WRONG_BITS: u8 = 2;
/// How far from an edge's direction the next crossing may lie, as a sine. The crossings inside of a tag are 14
/// degrees off at least.
const ASIDE: f64 = 0.16;
/// Side of a tag as it is read, px of a rectified window.
const READ_PX: f32 = 60.0;
/// Share of the pictures' middle place error over the side of a tag, from which the tags lie otherwise than said:
/// strong lenses stay well below, and numbers in other columns put a tag at least a tag off.
const MISPLACED: f64 = 0.35;

/// What a picture shows of an AprilGrid.
#[derive(Clone, Debug)]
pub(super) enum Found {
    /// Corners of tags, and how far apart tags lie in them over their side.
    Board(Vec<Seen>, Option<f64>),
    /// Tags, of which none or not these belong to the board.
    Other(String),
    Nothing,
}

impl Target {
    /// A grid of so many columns and rows of tags, `side_m` wide, with gaps between them of `spacing` times that;
    /// `None` if there are not so many different tags.
    pub fn aprilgrid(tags: [usize; 2], side_m: f64, spacing: f64) -> Option<Self> {
        let enough = dictionary().codes().len() >= tags[0] * tags[1];
        enough.then(|| Self {
            pattern: Pattern::Aprilgrid,
            size: tags.map(|t| 2 * t),
            square_m: [side_m; 2],
            marker: None,
            tag_spacing: Some(spacing),
        })
    }
}

fn dictionary() -> Dictionary {
    resolve_dictionary(DICTIONARY).expect("a dictionary of OpenCV")
}

/// Corners of a tag as they lie in the grid: upper left, upper right, lower right, lower left.
fn corners_of(id: usize, columns: usize) -> [[usize; 2]; 4] {
    let (x, y) = (2 * (id % columns), 2 * (id / columns));
    [[x, y + 1], [x + 1, y + 1], [x + 1, y], [x, y]]
}

/// Finds the corners of a grid's tags.
pub(super) fn find(grey: &Plane<u8>, target: &Target) -> Found {
    let (columns, count) = (target.size[0] / 2, target.count() / 4);
    let mut best: Vec<Seen> = Vec::new();
    let mut foreign = BTreeSet::new();
    for shrunk in sizes(grey) {
        let tags = tags_in(grey, shrunk);
        foreign.extend(tags.keys().copied().filter(|id| *id >= count));
        let all = tags.iter().filter(|(id, _)| **id < count).flat_map(|(id, px)| {
            corners_of(*id, columns).into_iter().zip(px).map(|(point, px)| Seen { point, px: *px })
        });
        let seen = to_the_fraction(grey, all.collect(), shrunk);
        if seen.len() > best.len() {
            best = seen;
        }
        if best.len() == target.count() {
            break;
        }
    }
    if best.is_empty() {
        return match foreign.first() {
            Some(id) => Found::Other(format!("tag {id}, and the last one of the board is {}", count - 1)),
            None => Found::Nothing,
        };
    }
    if misplaced(&best, target) {
        let rows = count / columns;
        return Found::Other(format!("tags that do not lie as those of a board of {columns}x{rows}"));
    }
    let spacing = spacing(&best, target);
    Found::Board(best, spacing)
}

/// How many tags of any number a picture shows; none for less than two, which noise may be.
pub(super) fn count_in(grey: &Plane<u8>) -> Option<usize> {
    sizes(grey).into_iter().map(|shrunk| tags_in(grey, shrunk).len()).max().filter(|count| *count > 1)
}

/// Whether the points are further from where a plane would have them than any lens shifts them.
fn misplaced(seen: &[Seen], target: &Target) -> bool {
    let board: Vec<DVec2> = seen.iter().map(|s| target.point_m(s.point).truncate()).collect();
    let px: Vec<DVec2> = seen.iter().map(|s| s.px).collect();
    let Some(h) = homography(&board, &px) else { return true };
    let off = board.iter().zip(&px).map(|(b, px)| {
        let p = h * b.extend(1.0);
        (p.truncate() / p.z - *px).length()
    });
    median(off) > MISPLACED * median(sides(seen))
}

/// Sides of tags along the rows, px.
fn sides(seen: &[Seen]) -> Vec<f64> {
    let of: BTreeMap<[usize; 2], DVec2> = seen.iter().map(|s| (s.point, s.px)).collect();
    let side = |(p, px): (&[usize; 2], &DVec2)| {
        let next = p[0].is_multiple_of(2).then(|| of.get(&[p[0] + 1, p[1]]))??;
        Some((*next - *px).length())
    };
    of.iter().filter_map(side).collect()
}

/// Gap between neighbouring tags over the mean of their sides, the middle over all: perspective makes one longer and
/// the other shorter.
fn spacing(seen: &[Seen], target: &Target) -> Option<f64> {
    let of: BTreeMap<[usize; 2], DVec2> = seen.iter().map(|s| (s.point, s.px)).collect();
    let mut all = Vec::new();
    for axis in 0..2 {
        for p in of.keys().filter(|p| p[axis].is_multiple_of(2) && p[axis] + 3 < target.size[axis]) {
            let at = |k: usize| {
                let mut next = *p;
                next[axis] += k;
                of.get(&next).copied()
            };
            let [Some(a), Some(b), Some(c), Some(d)] = [0, 1, 2, 3].map(at) else { continue };
            all.push((c - b).length() / (0.5 * ((b - a).length() + (d - c).length())));
        }
    }
    (!all.is_empty()).then(|| median(all))
}

/// Corners of all tags in a picture that was shrunk so many times, by number: upper left, upper right, lower right,
/// lower left, px of the whole picture. A number that is there twice is left out: one of both is no tag of the board.
fn tags_in(grey: &Plane<u8>, shrunk: usize) -> BTreeMap<usize, [DVec2; 4]> {
    let small = shrink(grey, shrunk);
    let view = GrayImageView { width: small.width, height: small.height, data: &small.data };
    let corners = detect_corner_frame(&view, &default_chess_config()).corners;
    let matcher = Matcher::new(dictionary(), WRONG_BITS);
    let config = ScanDecodeConfig::default().with_border_bits(FRAME).with_inset_frac(0.0);
    let mut tags: BTreeMap<usize, Vec<[DVec2; 4]>> = BTreeMap::new();
    for quad in quads(&corners) {
        let cell = MarkerCell::new(Coord::new(0, 0), quad.map(|i| corners[i].position));
        let Some(tag) = decode_marker_in_cell(&view, &cell, READ_PX, &config, &matcher) else { continue };
        if tag.inverted {
            continue;
        }
        // What is upper left in the dictionary lies `rotation` corners further round.
        let from = usize::from(tag.rotation) + HALF_TURN;
        // The detector counts from centres of pixels.
        let px = |i: usize| (place(&corners[quad[(i + from) % 4]]) + 0.5) * shrunk as f64;
        tags.entry(tag.id as usize).or_default().push([px(0), px(1), px(2), px(3)]);
    }
    tags.into_iter().filter_map(|(id, all)| <[_; 1]>::try_from(all).ok().map(|[px]| (id, px))).collect()
}

fn place(corner: &ChessCorner) -> DVec2 {
    DVec2::new(f64::from(corner.position.x), f64::from(corner.position.y))
}

/// All fours of crossings whose edges run from one to the next, clockwise, each once.
fn quads(corners: &[ChessCorner]) -> Vec<[usize; 4]> {
    let axes = |i: usize| corners[i].axes.map(|a| DVec2::from_angle(f64::from(a.angle)));
    let mut known = BTreeSet::new();
    let mut all = Vec::new();
    for first in 0..corners.len() {
        let [a, b] = axes(first);
        let ways = if a.perp_dot(b) > 0.0 { [a, b, -a, -b] } else { [b, a, -b, -a] };
        for k in 0..4 {
            let (along, aside) = (ways[k], ways[(k + 1) % 4]);
            let (Some(second), Some(fourth)) = (next(corners, first, along), next(corners, first, aside))
            else {
                continue;
            };
            let third = next(corners, second, nearest_way(axes(second), aside));
            if third.is_none() || third != next(corners, fourth, nearest_way(axes(fourth), along)) {
                continue;
            }
            let quad = [first, second, third.unwrap_or(first), fourth];
            let mut sorted = quad;
            sorted.sort_unstable();
            let different = sorted.windows(2).all(|w| w[0] != w[1]);
            if different && known.insert(sorted) {
                all.push(quad);
            }
        }
    }
    all
}

/// Of the four ways that leave a crossing along its edges, the one nearest to `wanted`.
fn nearest_way(axes: [DVec2; 2], wanted: DVec2) -> DVec2 {
    let axis = if axes[0].dot(wanted).abs() > axes[1].dot(wanted).abs() { axes[0] } else { axes[1] };
    if axis.dot(wanted) < 0.0 { -axis } else { axis }
}

/// The nearest crossing from `from` in a direction of length 1.
fn next(corners: &[ChessCorner], from: usize, way: DVec2) -> Option<usize> {
    let start = place(&corners[from]);
    let ahead = |(i, corner): (usize, &ChessCorner)| {
        let step = place(corner) - start;
        let (along, aside) = (way.dot(step), way.perp_dot(step).abs());
        (along > 1.0 && aside < ASIDE * along).then_some((i, along))
    };
    let all = corners.iter().enumerate().filter_map(ahead);
    all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// The print: tags, squares at their corners, paper between and around.
pub(super) fn sheet(target: &Target) -> Option<Sheet> {
    let spacing = target.tag_spacing?;
    let codes = dictionary().codes();
    let gap_m = |axis: usize| spacing * target.square_m[axis];
    // Before each tag a gap, then its cells; behind the last a gap.
    let borders = |axis: usize| -> Vec<f64> {
        let (tags, side_m) = (target.size[axis] / 2, target.square_m[axis]);
        let tag = |t: usize| {
            let from_m = target.at_m(axis, 2 * t);
            (0..=CELLS).map(move |k| from_m + side_m * k as f64 / CELLS as f64)
        };
        let last_m = target.at_m(axis, target.size[axis] - 1) + gap_m(axis);
        [-gap_m(axis)].into_iter().chain((0..tags).flat_map(tag)).chain([last_m]).collect()
    };
    let columns = target.size[0] / 2;
    let ink = |x: usize, y: usize| {
        // Place in a period of a gap and a tag's cells.
        let ((tag_x, i), (tag_y, j)) = (period(x), period(y));
        match (i.checked_sub(1), j.checked_sub(1)) {
            (None, None) => Ink::Dark,
            (Some(i), Some(j)) => {
                let id = tag_y * columns + tag_x;
                match [i, CELLS - 1 - j].map(|k| k.checked_sub(FRAME).filter(|k| *k < CELLS - 2 * FRAME)) {
                    // In the dictionary's way round; its first bit is the lowest, dark bits are 1.
                    [Some(i), Some(j)] => {
                        let side = CELLS - 2 * FRAME;
                        let bit = (side - 1 - j) * side + (side - 1 - i);
                        if (codes[id] >> bit) & 1 == 1 { Ink::Dark } else { Ink::Bright }
                    }
                    _ => Ink::Dark,
                }
            }
            _ => Ink::Bright,
        }
    };
    let (x_m, y_m) = (borders(0), borders(1));
    let (across, down) = (x_m.len() - 1, y_m.len() - 1);
    let cells = (0..down).flat_map(|y| (0..across).map(move |x| (x, y))).map(|(x, y)| ink(x, y)).collect();
    Some(Sheet { x_m, y_m, cells })
}

/// Which tag a column or row of cells belongs to, and which of its cells it is, the gap before it being the first.
fn period(cell: usize) -> (usize, usize) {
    (cell / (CELLS + 1), cell % (CELLS + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first three codes of the family as Kalibr's `kalibr_create_target_pdf` has them: the highest bit upper
    /// left, 1 is white.
    const KALIBR: [u64; 3] = [0xd5d628584, 0xd97f18b49, 0xdd280910e];

    #[test]
    fn a_tag_is_printed_as_kalibr_prints_it() {
        let target = Target::aprilgrid([3, 1], 0.05, 0.3).expect("three tags");
        let sheet = sheet(&target).expect("drawn");
        let across = sheet.x_m.len() - 1;
        for (id, code) in KALIBR.iter().enumerate() {
            for (row, column) in (0..6).flat_map(|r| (0..6).map(move |c| (r, c))) {
                let x = id * 11 + 1 + FRAME + column;
                // Rows of the code from above, those of the sheet from below.
                let y = 1 + FRAME + (5 - row);
                let white = (code >> (35 - 6 * row - column)) & 1 == 1;
                assert_eq!(sheet.cells[y * across + x] == Ink::Bright, white, "tag {id} {row} {column}");
            }
        }
        assert_eq!(sheet.cells[0], Ink::Dark, "the square at the corner");
        assert!((sheet.x_m[11] - 0.05).abs() < 1e-12 && (sheet.x_m[12] - 0.065).abs() < 1e-12);
    }

    #[test]
    fn what_is_drawn_is_found_with_its_numbers() {
        let target = Target::aprilgrid([4, 3], 0.05, 0.3).expect("twelve tags");
        let (side_px, first) = (62.0, DVec2::new(42.0, 270.0));
        let sheet = sheet(&target).expect("drawn");
        let drawn = sheet.picture([420, 330], first, DVec2::new(1.0, -1.0) * side_px / 0.05);
        let Found::Board(seen, spacing) = find(&drawn, &target) else { panic!("found") };
        assert_eq!(seen.len(), 48);
        for s in &seen {
            let at = target.point_m(s.point).truncate() / 0.05 * side_px;
            let should = first + DVec2::new(at.x, -at.y);
            assert!((s.px - should).length() < 0.6, "{s:?} {should}");
        }
        assert!((spacing.expect("neighbours") - 0.3).abs() < 0.01, "{spacing:?}");
        // Control: counted in other columns the tags lie nowhere.
        let other = Target::aprilgrid([3, 4], 0.05, 0.3).expect("twelve tags");
        assert!(matches!(find(&drawn, &other), Found::Other(_)));
        // Control: seen in a mirror no code is one of the family.
        let mirrored =
            Plane::from_fn(drawn.width, drawn.height, |x, y| [drawn.pixel(drawn.width - 1 - x, y)[0]]);
        assert!(matches!(find(&mirrored, &target), Found::Nothing));
        assert!(Target::aprilgrid([30, 30], 0.05, 0.3).is_none(), "900 tags");
    }
}
