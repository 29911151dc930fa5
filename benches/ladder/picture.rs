//! Pictures of the ladder: reference, method, difference times 8 about mid grey.

use shutterbug::plane::Plane;

use super::report::Row;

/// Size of the detail that shows a failure, px, and how large each of its pixels is drawn.
const DETAIL_PX: [usize; 2] = [96, 72];
const ENLARGED: usize = 4;

/// All of the pictures, one row each.
pub fn sheet(rows: &[&Row]) -> Plane<u8> {
    let Some(first) = rows.first() else { return Plane::new(1, 1, 3) };
    let size = [first.picture.width, first.picture.height];
    stacked(rows, size, 1, |_| [0, 0])
}

/// The detail of each picture that differs most, enlarged.
pub fn failures(rows: &[&Row]) -> Plane<u8> {
    stacked(rows, DETAIL_PX, ENLARGED, worst_detail)
}

fn stacked(
    rows: &[&Row],
    [w, h]: [usize; 2],
    enlarged: usize,
    corner: impl Fn(&Row) -> [usize; 2],
) -> Plane<u8> {
    let mut sheet = Plane::new((3 * w * enlarged).max(1), (h * rows.len() * enlarged).max(1), 3);
    for (i, row) in rows.iter().enumerate() {
        let [left, top] = corner(row);
        for (y, x) in (0..h * enlarged).flat_map(|y| (0..w * enlarged).map(move |x| (y, x))) {
            let at = [left + x / enlarged, top + y / enlarged];
            for (column, value) in columns(row, at).into_iter().enumerate() {
                let to = sheet.pixel_mut(column * w * enlarged + x, i * h * enlarged + y);
                to.copy_from_slice(&value);
            }
        }
    }
    sheet
}

fn columns(row: &Row, [x, y]: [usize; 2]) -> [[u8; 3]; 3] {
    let (want, got) = (row.reference.pixel(x, y), row.picture.pixel(x, y));
    let channel = |p: &[u8]| std::array::from_fn(|c| p[c]);
    let difference =
        std::array::from_fn(|c| (128 + 8 * (i32::from(got[c]) - i32::from(want[c]))).clamp(0, 255) as u8);
    [channel(want), channel(got), difference]
}

/// Upper left corner of the detail with the largest squared difference, on a grid of 8 px.
fn worst_detail(row: &Row) -> [usize; 2] {
    const STEP: usize = 8;
    let last = [row.picture.width - DETAIL_PX[0], row.picture.height - DETAIL_PX[1]];
    let error = |[left, top]: [usize; 2]| -> u64 {
        let rows = (top..top + DETAIL_PX[1]).map(|y| {
            let range = 3 * left..3 * (left + DETAIL_PX[0]);
            let pairs = row.picture.row(y)[range.clone()].iter().zip(&row.reference.row(y)[range]);
            pairs.map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum::<u64>()
        });
        rows.sum()
    };
    let corners = (0..=last[1]).step_by(STEP).flat_map(|y| (0..=last[0]).step_by(STEP).map(move |x| [x, y]));
    corners.max_by_key(|corner| error(*corner)).unwrap_or_default()
}
