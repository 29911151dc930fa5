//! The width of the sharpest edges.

use super::Mark;
use shutterbug::plane::Plane;

/// Least contrast of an edge whose width is measured, DN.
const EDGE_DN: f32 = 40.0;
/// Px to each side of an edge that belong to it.
const EDGE_PX: usize = 4;
/// Share of the edges that are sharpest: what is blurred by its own nature is not among them.
const SHARPEST: f64 = 0.02;
/// Fewest edges.
const FEWEST_EDGES: usize = 100;

/// Width of the sharpest edges of any colour: contrast over the steepest slope, px. A step between two pixels has 2.
pub(super) fn edge_width(dn: &Plane<f32>, down: bool) -> Mark {
    let mut widths: Vec<f64> = (0..3).flat_map(|c| widths(dn, c, down)).collect();
    if widths.len() < FEWEST_EDGES {
        return None;
    }
    let place = (SHARPEST * widths.len() as f64) as usize;
    let width = *widths.select_nth_unstable_by(place, f64::total_cmp).1;
    Some([width, widths.len() as f64])
}

/// Widths of the edges of one colour along rows or down columns.
fn widths(dn: &Plane<f32>, c: usize, down: bool) -> Vec<f64> {
    let (w, h) = (dn.width, dn.height);
    let (step, along, lines) = if down { (w, h, w) } else { (1, w, h) };
    let reach = EDGE_PX + 3;
    let mut widths: Vec<f64> = Vec::new();
    for line in 0..lines {
        let begin = if down { line } else { line * w };
        for k in reach..along.saturating_sub(reach) {
            let at = |d: isize| dn.data[3 * (begin as isize + (k as isize + d) * step as isize) as usize + c];
            let slope = |d: isize| 0.5 * (at(d + 1) - at(d - 1)).abs();
            let steep = slope(0);
            if steep < 0.1 * EDGE_DN || steep < slope(1) || steep <= slope(-1) {
                continue;
            }
            let e = EDGE_PX as isize;
            let contrast = at(e) - at(-e);
            // Flat on either side: two things beside each other, and nothing else.
            let flat = (at(e + 3) - at(e)).abs() + (at(-e - 3) - at(-e)).abs();
            if contrast.abs() >= EDGE_DN && flat < 0.15 * contrast.abs() {
                widths.push(f64::from(contrast.abs() / steep));
            }
        }
    }
    widths
}
