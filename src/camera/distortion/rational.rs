//! OpenCV's rational model: Brown-Conrady whose radial factor is a quotient,
//! (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3) with s = r^2.

use glam::{DMat2, DVec2};

use super::fold::{Polynomial, add, first_root, least_over_directions, multiply, tangential_entries};

/// The radial factor at s = r^2, and its derivative by s.
fn factor(k: &[f64; 6], s: f64) -> (f64, f64) {
    let up = 1.0 + s * (k[0] + s * (k[1] + s * k[2]));
    let down = 1.0 + s * (k[3] + s * (k[4] + s * k[5]));
    let up_slope = k[0] + s * (2.0 * k[1] + s * 3.0 * k[2]);
    let down_slope = k[3] + s * (2.0 * k[4] + s * 3.0 * k[5]);
    (up / down, (up_slope * down - up * down_slope) / (down * down))
}

/// The distorted point, and its derivative by the ideal one (symmetric).
pub(super) fn distort_with_jacobian(k: &[f64; 6], [p1, p2]: [f64; 2], ideal: DVec2) -> (DVec2, DMat2) {
    let (x, y, s) = (ideal.x, ideal.y, ideal.length_squared());
    let (radial, slope) = factor(k, s);
    let (xy, along) = (2.0 * x * y, DVec2::new(s + 2.0 * x * x, s + 2.0 * y * y));
    let at = ideal * radial + DVec2::new(p1 * xy + p2 * along.x, p1 * along.y + p2 * xy);
    let slope = 2.0 * slope;
    let off = slope * x * y + 2.0 * (p1 * x + p2 * y);
    let xx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
    let yy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
    (at, DMat2::from_cols(DVec2::new(xx, off), DVec2::new(off, yy)))
}

/// The ideal radius up to which the mapping is one-to-one in every direction: to the first singular Jacobian, or to the
/// first pole, where the denominator vanishes.
pub(super) fn fold(k: &[f64; 6], p: &[f64; 2], limit: f64) -> f64 {
    let even = |a: f64, b: f64, c: f64| -> Polynomial { vec![1.0, 0.0, a, 0.0, b, 0.0, c] };
    let (up, down) = (even(k[0], k[1], k[2]), even(k[3], k[4], k[5]));
    let pole = first_root(&down, limit).unwrap_or(limit);
    // d/dr (r up / down) = (d(r up)/dr down - r up d(down)/dr) / down^2.
    let up_along = even(3.0 * k[0], 5.0 * k[1], 7.0 * k[2]);
    let down_slope = [0.0, 0.0, -2.0 * k[3], 0.0, -4.0 * k[4], 0.0, -6.0 * k[5]];
    let along = add(&multiply(&up_along, &down), &multiply(&up, &down_slope));
    let squared = multiply(&down, &down);
    // The determinant in the basis (along the ray, across it), times down^3.
    let on_ray = |angle: f64| {
        let [nn, mm, nm] = tangential_entries(p, DVec2::from_angle(angle));
        let first = add(&along, &multiply(&[0.0, nn], &squared));
        let second = add(&up, &multiply(&[0.0, mm], &down));
        let off = multiply(&[0.0, 0.0, -nm * nm], &multiply(&squared, &down));
        first_root(&add(&multiply(&first, &second), &off), pole).unwrap_or(pole)
    };
    least_over_directions(p, pole, on_ray)
}
