//! When each line is exposed (the paper's eq. 1, 5, 6, in seconds). Twin of `glsl/include/timing.glsl`.

use crate::camera::ScanOrder;

/// The value of a scan order in push constants: its place in [`ScanOrder::ALL`].
pub fn scan_order_code(order: ScanOrder) -> u32 {
    order as u32
}

/// Fraction of the readout after which the line of `pixel` starts: i/N (eq. 6). With `pixel_time` the pixel's place
/// within its line counts too: + k/(N K) (eq. 1, 5). Pixels of a line come in the order of growing x or y.
///
/// `scan_order` is a [`scan_order_code`].
pub fn readout_fraction(pixel: [u32; 2], size: [u32; 2], scan_order: u32, pixel_time: bool) -> f32 {
    let lines_are_rows = scan_order <= ScanOrder::BottomToTop as u32;
    let swap = |v: [u32; 2]| if lines_are_rows { [v[1], v[0]] } else { v };
    let (place, count) = (swap(pixel), swap(size));
    let backwards =
        scan_order == ScanOrder::BottomToTop as u32 || scan_order == ScanOrder::RightToLeft as u32;
    let line = if backwards { count[0] - 1 - place[0] } else { place[0] };
    let fraction = line as f32 / count[0] as f32;
    if pixel_time { fraction + place[1] as f32 / (count[0] as f32 * count[1] as f32) } else { fraction }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_the_camera() {
        let (width, height) = (7, 5);
        for order in ScanOrder::ALL {
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let lines = order.line_count(width, height);
                let want = order.line_of(x, y, width, height) as f32 / lines as f32;
                let code = scan_order_code(order);
                assert_eq!(
                    readout_fraction([x, y], [width, height], code, false),
                    want,
                    "{order} ({x}, {y})"
                );
                let within = readout_fraction([x, y], [width, height], code, true) - want;
                let place = if order.lines_are_rows() { x } else { y };
                let step = 1.0 / (width * height) as f32;
                assert!((within - place as f32 * step).abs() < 1e-6, "{order} ({x}, {y}): {within}");
            }
        }
    }
}
