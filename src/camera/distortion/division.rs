//! The division model (Fitzgibbon 2001): ideal = distorted / (1 + k1 r^2), r the *distorted* radius. One coefficient,
//! and a closed form in both directions.

/// Distorted over ideal radius at an ideal radius, and the slope of the distorted radius there.
///
/// With q = sqrt(1 - 4 k1 r^2): the quadratic's root that is 1 on the axis, written so that nothing cancels, and its
/// derivative.
pub(super) fn ratio_and_slope(k1: f64, r: f64) -> (f64, f64) {
    let q = (1.0 - 4.0 * k1 * r * r).max(0.0).sqrt();
    (2.0 / (1.0 + q), 2.0 / (q * (1.0 + q)))
}

/// Ideal over distorted radius at a distorted radius.
pub(super) fn inverse_ratio(k1: f64, r: f64) -> f64 {
    1.0 / (1.0 + k1 * r * r)
}

/// The ideal radius beyond which no distorted one belongs to it, at most `limit`.
pub(super) fn fold(k1: f64, limit: f64) -> f64 {
    if k1 > 0.0 { (0.5 / k1.sqrt()).min(limit) } else { limit }
}
