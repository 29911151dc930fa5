//! ChArUco boards: a checkerboard whose bright squares hold markers, by which every part of it names itself. Layout and
//! numbers are OpenCV's since 4.6: the first square is dark, marker 0 is in the second of the first row.

use calib_targets_charuco::{
    CharucoBoard, CharucoBoardSpec, CharucoDetector, CharucoParams, Dictionary, GrayImageView,
    resolve_dictionary,
};
use glam::DVec2;

use super::detect::{shrink, sizes, to_the_fraction};
use super::sheet::{Ink, Sheet};
use super::target::{Marker, Pattern, Seen, Target};
use shutterbug::plane::Plane;

/// Cells of a marker's dark frame.
const FRAME: usize = 1;

impl Target {
    /// A board of so many squares (not corners), with markers of a share of a square's side; `None` for a dictionary
    /// that OpenCV does not have, or one with too few markers.
    pub fn charuco(squares: [usize; 2], square_m: f64, share: f64, dictionary: &str) -> Option<Self> {
        let dictionary = resolve_dictionary(&dictionary.to_uppercase())?;
        let target = Self {
            pattern: Pattern::Charuco,
            size: squares.map(|s| s - 1),
            square_m: [square_m; 2],
            marker: Some(Marker { share, dictionary: dictionary.name() }),
            tag_spacing: None,
        };
        board(&target)?;
        Some(target)
    }
}

fn dictionary_of(target: &Target) -> Option<Dictionary> {
    resolve_dictionary(target.marker.as_ref()?.dictionary)
}

fn board(target: &Target) -> Option<CharucoBoard> {
    let marker = target.marker.as_ref()?;
    let [columns, rows] = target.size.map(|s| s as u32 + 1);
    let spec = CharucoBoardSpec::new(rows, columns, 1.0, marker.share as f32, dictionary_of(target)?);
    CharucoBoard::new(spec).ok()
}

/// Finds the inner corners of a board.
pub(super) fn find(grey: &Plane<u8>, target: &Target) -> Option<Vec<Seen>> {
    let spec = board(target)?.spec();
    let mut best: Option<Vec<Seen>> = None;
    for shrunk in sizes(grey) {
        let small = shrink(grey, shrunk);
        let view = GrayImageView { width: small.width, height: small.height, data: &small.data };
        let detector = CharucoDetector::new(CharucoParams::for_board(spec)).ok()?;
        let Ok(found) = detector.detect(&view) else { continue };
        let columns = target.size[0];
        let seen = found.corners.iter().map(|c| {
            let id = c.id as usize;
            let px = DVec2::new(f64::from(c.position.x), f64::from(c.position.y)) + 0.5;
            Seen { point: [id % columns, id / columns], px: px * shrunk as f64 }
        });
        let seen = to_the_fraction(grey, seen.filter(|s| s.point[1] < target.size[1]).collect(), shrunk);
        let whole = seen.len() == target.count();
        if best.as_ref().is_none_or(|b| b.len() < seen.len()) {
            best = Some(seen);
        }
        if whole {
            break;
        }
    }
    best
}

/// The print, with its markers.
pub(super) fn sheet(target: &Target) -> Option<Sheet> {
    let (board, dictionary) = (board(target)?, dictionary_of(target)?);
    let share = target.marker.as_ref()?.share;
    let across = dictionary.marker_size() + 2 * FRAME;
    // A square's cells: the margin before the marker, its cells, the margin behind.
    let per_square = across + 2;
    let margin = 0.5 * (1.0 - share);
    let borders = |axis: usize| -> Vec<f64> {
        let squares = target.size[axis] + 1;
        let side_m = target.square_m[axis];
        let cell = |k: usize| if k == 0 { 0.0 } else { margin + share * (k - 1) as f64 / across as f64 };
        let inner = (0..squares).flat_map(|s| (0..per_square).map(move |k| (s, k)));
        let at = inner.map(|(s, k)| (s as f64 - 1.0 + cell(k)) * side_m);
        at.chain([(squares as f64 - 1.0) * side_m]).collect()
    };
    let ink = |x: usize, y: usize| {
        let (column, row) = (x / per_square, y / per_square);
        let id = (0..board.marker_count() as i32).find(|id| board.marker_cell(*id) == Some((column, row)));
        if (column + row) % 2 == 0 {
            return Ink::Dark;
        }
        let inside = |k: usize| (k % per_square).checked_sub(1).filter(|k| *k < across);
        let (Some(id), Some(i), Some(j)) = (id, inside(x), inside(y)) else { return Ink::Bright };
        let payload = |k: usize| k.checked_sub(FRAME).filter(|k| *k < dictionary.marker_size());
        let (Some(i), Some(j)) = (payload(i), payload(j)) else { return Ink::Dark };
        // Row by row, the first bit the lowest; dark bits are 1.
        let bit = (dictionary.codes()[id as usize] >> (j * dictionary.marker_size() + i)) & 1;
        if bit == 1 { Ink::Dark } else { Ink::Bright }
    };
    let (x_m, y_m) = (borders(0), borders(1));
    let (columns, rows) = (x_m.len() - 1, y_m.len() - 1);
    let cells = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| ink(x, y)).collect();
    Some(Sheet { x_m, y_m, cells })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen_straight_on(target: &Target, first: DVec2) -> Plane<u8> {
        sheet(target).expect("drawn").picture([480, 400], first, DVec2::splat(56.0 / 0.04))
    }

    #[test]
    fn what_is_drawn_is_found_with_its_numbers() {
        let target = Target::charuco([7, 5], 0.04, 0.75, "DICT_5X5_100").expect("a dictionary of OpenCV");
        let first = DVec2::new(70.0, 90.0);
        let seen = find(&seen_straight_on(&target, first), &target).expect("found");
        assert!(seen.len() >= 20, "{}", seen.len());
        for s in &seen {
            let should = first + 56.0 * DVec2::new(s.point[0] as f64, s.point[1] as f64);
            assert!((s.px - should).length() < 0.6, "{s:?} {should}");
        }
        // Control: markers of another dictionary are none of this board's.
        let other = Target::charuco([7, 5], 0.04, 0.75, "DICT_5X5_1000").map(|t| sheet(&t).expect("drawn"));
        assert!(other.is_some());
        let other = Target::charuco([7, 5], 0.04, 0.75, "DICT_6X6_250").expect("a dictionary");
        let found = find(&seen_straight_on(&other, first), &target);
        assert!(found.is_none_or(|s| s.len() < 4));
        assert!(Target::charuco([7, 5], 0.04, 0.75, "DICT_3X3_9").is_none());
    }
}
