//! Up to which radius a distortion can be inverted.

use glam::{DMat2, DVec2};

/// Rays from the axis that are searched for the first singular Jacobian. Where it lies varies smoothly with the
/// direction; the best ray is refined.
const DIRECTIONS: usize = 128;

/// A polynomial of a radius, lowest power first. Degree at most 20: the determinant of the rational model.
pub(super) type Polynomial = Vec<f64>;

/// Of the fisheye: up to where the slope of theta vanishes.
pub(super) fn equidistant(k: &[f64; 4], limit: f64) -> f64 {
    let slope = vec![1.0, 0.0, 3.0 * k[0], 0.0, 5.0 * k[1], 0.0, 7.0 * k[2], 0.0, 9.0 * k[3]];
    // A falling slope of theta also makes the ratio to r fall to zero later than this, never before.
    match first_root(&slope, limit.atan()) {
        Some(theta) => theta.tan().min(limit),
        None => limit,
    }
}

/// Of Brown-Conrady: up to the first singular Jacobian of any direction.
pub(super) fn brown_conrady(k: &[f64; 3], p: &[f64; 2], limit: f64) -> f64 {
    least_over_directions(p, limit, |angle| {
        first_singular(k, p, DVec2::from_angle(angle), limit).unwrap_or(limit)
    })
}

/// The least of what every direction gives, at most `limit`; without tangential coefficients all are alike.
pub(super) fn least_over_directions(p: &[f64; 2], limit: f64, on_ray: impl Fn(f64) -> f64) -> f64 {
    if *p == [0.0; 2] {
        return on_ray(0.0);
    }
    let step = std::f64::consts::TAU / DIRECTIONS as f64;
    let (mut least, mut at) = (limit, 0.0);
    for i in 0..DIRECTIONS {
        let radius = on_ray(i as f64 * step);
        if radius < least {
            (least, at) = (radius, i as f64 * step);
        }
    }
    let (mut from, mut to) = (at - step, at + step);
    for _ in 0..24 {
        let (a, b) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
        let (at_a, at_b) = (on_ray(a), on_ray(b));
        least = least.min(at_a).min(at_b);
        if at_a < at_b { to = b } else { from = a }
    }
    least
}

/// The first radius in (0, limit] on the ray along `n` where the Jacobian has no inverse. It is the identity on the
/// axis and symmetric, so up to there it is positive definite.
fn first_singular(k: &[f64; 3], p: &[f64; 2], n: DVec2, limit: f64) -> Option<f64> {
    let even = |a: f64, b: f64, c: f64| vec![1.0, 0.0, a, 0.0, b, 0.0, c];
    let along = even(3.0 * k[0], 5.0 * k[1], 7.0 * k[2]);
    let across = even(k[0], k[1], k[2]);
    let [nn, mm, nm] = tangential_entries(p, n);
    let (nn, mm, nm) = (add(&along, &[0.0, nn]), add(&across, &[0.0, mm]), [0.0, nm]);
    let off: Polynomial = multiply(&nm, &nm).iter().map(|v| -v).collect();
    first_root(&add(&multiply(&nn, &mm), &off), limit)
}

/// The tangential part of the Jacobian on the ray along `n`, times 1 / r: along the ray, across it, and mixed.
pub(super) fn tangential_entries(p: &[f64; 2], n: DVec2) -> [f64; 3] {
    let (c, s) = (n.x, n.y);
    let tangential = DMat2::from_cols(
        DVec2::new(2.0 * p[0] * s + 6.0 * p[1] * c, 2.0 * (p[0] * c + p[1] * s)),
        DVec2::new(2.0 * (p[0] * c + p[1] * s), 6.0 * p[0] * s + 2.0 * p[1] * c),
    );
    let m = n.perp();
    let entry = |a: DVec2, b: DVec2| a.dot(tangential * b);
    [entry(n, n), entry(m, m), entry(n, m)]
}

pub(super) fn add(a: &[f64], b: &[f64]) -> Polynomial {
    let at = |p: &[f64], i: usize| p.get(i).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|i| at(a, i) + at(b, i)).collect()
}

pub(super) fn multiply(a: &[f64], b: &[f64]) -> Polynomial {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

fn value(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// The first change of sign of a polynomial in (0, limit].
pub(super) fn first_root(p: &[f64], limit: f64) -> Option<f64> {
    roots(p, limit).first().copied()
}

/// Every change of sign in (0, limit], ascending. Between two roots of the derivative a polynomial is monotone, so none
/// is missed, however close together they lie.
fn roots(p: &[f64], limit: f64) -> Vec<f64> {
    let degree = p.iter().rposition(|c| *c != 0.0).unwrap_or(0);
    if degree == 0 {
        return Vec::new();
    }
    let derivative: Polynomial = (1..=degree).map(|i| i as f64 * p[i]).collect();
    let mut corners = vec![0.0];
    corners.extend(roots(&derivative, limit));
    corners.push(limit);
    let mut found = Vec::new();
    for pair in corners.windows(2) {
        let (mut from, mut to) = (pair[0], pair[1]);
        let positive = value(p, from) > 0.0;
        if positive == (value(p, to) > 0.0) {
            continue;
        }
        // Until the two are neighbouring numbers.
        loop {
            let middle = 0.5 * (from + to);
            if !(from < middle && middle < to) {
                break;
            }
            if (value(p, middle) > 0.0) == positive { from = middle } else { to = middle }
        }
        found.push(to);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::{Distortion, invertible_radius};
    use super::*;

    #[test]
    fn all_roots_are_found_even_close_together() {
        // (x - 0.5)(x - 0.500001)(x - 2)
        let p = multiply(&multiply(&[-0.5, 1.0], &[-0.500_001, 1.0]), &[-2.0, 1.0]);
        let found = roots(&p, 10.0);
        assert_eq!(found.len(), 3, "{found:?}");
        for (got, want) in found.iter().zip([0.5, 0.500_001, 2.0]) {
            assert!((got - want).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(roots(&p, 1.0).len(), 2);
        assert!(roots(&[1.0, 0.0, 1.0], 1e6).is_empty());
        assert!(roots(&[], 1.0).is_empty() && roots(&[3.0], 1.0).is_empty());
    }

    #[test]
    fn the_radial_fold_is_where_the_closed_form_puts_it() {
        // d/dr (r + k1 r^3) = 0 at r = 1 / sqrt(-3 k1).
        for k1 in [-0.4, -0.1, -0.01] {
            let lens = Distortion::BrownConrady { k: [k1, 0.0, 0.0], p: [0.0; 2] };
            let want = (-1.0 / (3.0 * k1)).sqrt();
            assert!((invertible_radius(&lens, 100.0) - want).abs() < 1e-12, "{k1}");
            assert_eq!(invertible_radius(&lens, 0.5 * want), 0.5 * want);
        }
    }

    #[test]
    fn a_rational_lens_folds_at_its_pole_or_where_its_slope_vanishes() {
        // r / (1 + k4 r^2) turns back at 1 / sqrt(k4); a negative k4 has its pole at 1 / sqrt(-k4).
        for k4 in [0.25, -0.25, 3.0, -3.0f64] {
            let lens = Distortion::Rational { k: [0.0, 0.0, 0.0, k4, 0.0, 0.0], p: [0.0; 2] };
            let want = 1.0 / k4.abs().sqrt();
            assert!((invertible_radius(&lens, 100.0) - want).abs() < 1e-12, "{k4}");
            // Tangential coefficients move it a little, the same in every direction that is looked at.
            let lens = Distortion::Rational { k: [0.0, 0.0, 0.0, k4, 0.0, 0.0], p: [1e-9, -1e-9] };
            assert!((invertible_radius(&lens, 100.0) - want).abs() < 1e-3, "{k4}");
        }
        // Without a denominator it is Brown-Conrady's.
        let (k, p) = ([-0.3, 0.02, 0.001], [0.02, -0.03]);
        let brown = invertible_radius(&Distortion::BrownConrady { k, p }, 100.0);
        let k = [k[0], k[1], k[2], 0.0, 0.0, 0.0];
        assert!((invertible_radius(&Distortion::Rational { k, p }, 100.0) - brown).abs() < 1e-9, "{brown}");
    }

    #[test]
    fn a_division_lens_folds_where_its_root_ends() {
        let lens = |k1: f64| invertible_radius(&Distortion::Division { k1 }, 100.0);
        assert_eq!((lens(0.25), lens(-0.25), lens(0.0)), (1.0, 100.0, 100.0));
    }

    #[test]
    fn the_ray_determinant_is_that_of_the_jacobian() {
        let (k, p) = ([-0.3, 0.02, 0.0], [0.02, -0.03]);
        let lens = Distortion::BrownConrady { k, p };
        for angle in [0.0, 0.4, 1.3, 2.9, -2.0] {
            let n = DVec2::from_angle(angle);
            if let Some(r) = first_singular(&k, &p, n, 3.0) {
                let before = lens.distort_with_jacobian(n * (r * 0.999)).1.determinant();
                let after = lens.distort_with_jacobian(n * (r * 1.001)).1.determinant();
                assert!(before > 0.0 && after < 0.0, "{angle}: {before} {after}");
            }
        }
        assert!(first_singular(&k, &p, DVec2::X, 3.0).is_some());
    }
}
