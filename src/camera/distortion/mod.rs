//! Lens distortion: where a ray really falls. Brown-Conrady with OpenCV's five coefficients, OpenCV's rational model
//! with eight, the equidistant fisheye (Kannala-Brandt) with Kalibr's and OpenCV's four, and the division model with
//! one; both directions of the mapping, and the radius up to which it can be inverted.
//!
//! All coordinates are normalised: x = (u - cx) / fx, y = (v - cy) / fy. *Ideal* is where the pinhole would put a ray
//! (X / Z, Y / Z), *distorted* is where the lens puts it. OpenCV counts pixels from their centres; u and cx shift by
//! the same half pixel, so the coefficients are the same here and there.
//!
//! All models have a symmetric Jacobian: they are gradients of a potential. Where that Jacobian is positive definite
//! on a disc the potential is convex, so the mapping is one-to-one there, and Newton with a shrinking step finds the
//! inverse from any start. [`Lens`] holds such a disc, as large as it can be.

mod division;
mod extended;
mod fold;
mod lens;
mod rational;
#[cfg(test)]
mod tests;

pub use extended::ExtendedLens;
pub use lens::Lens;

use glam::{DMat2, DVec2};

/// Steps of Newton's method at most. Sane coefficients need 3 to 6; the rest is for points beside the fold.
const MAX_STEPS: usize = 60;
/// Newton stops when the distorted point is met this closely (normalised): far below 1e-10 of the ideal point unless
/// the Jacobian is nearly singular.
const RESIDUAL: f64 = 1e-14;
/// The loosest residual that still counts as a solution, where rounding forbids a closer one.
const ACCEPTED_RESIDUAL: f64 = 1e-12;

/// A distortion model with its coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Distortion {
    /// The ideal pinhole.
    #[default]
    None,
    /// Brown-Conrady as in OpenCV (`plumb_bob`, `radtan`, `radial-tangential`).
    BrownConrady {
        /// k1, k2, k3: radial, on r^2, r^4, r^6.
        k: [f64; 3],
        /// p1, p2: tangential.
        p: [f64; 2],
    },
    /// Equidistant fisheye (Kannala-Brandt): the angle from the axis becomes
    /// theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
    Equidistant {
        /// k1 to k4.
        k: [f64; 4],
    },
    /// OpenCV's rational model: the radial factor is (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
    Rational {
        /// k1 to k6.
        k: [f64; 6],
        /// p1, p2: tangential, as Brown-Conrady's.
        p: [f64; 2],
    },
    /// Division model: ideal = distorted / (1 + k1 r^2), r the distorted radius.
    Division {
        /// Below zero: barrel.
        k1: f64,
    },
}

impl Distortion {
    /// Whether every point stays where it is.
    pub fn is_identity(&self) -> bool {
        match self {
            Self::None => true,
            Self::BrownConrady { k, p } => *k == [0.0; 3] && *p == [0.0; 2],
            // Zeros are the ideal fisheye, which is no pinhole.
            Self::Equidistant { .. } => false,
            // Equal halves of the quotient cancel.
            Self::Rational { k, p } => k[..3] == k[3..] && *p == [0.0; 2],
            Self::Division { k1 } => *k1 == 0.0,
        }
    }

    /// "k1 = 0.19, k2 = -0.01, ...", in the order in which OpenCV lists them.
    pub fn coefficients(&self) -> String {
        let list = |names: &[&str], values: &[f64]| {
            let pairs: Vec<_> = names.iter().zip(values).map(|(n, v)| format!("{n} = {v}")).collect();
            pairs.join(", ")
        };
        match self {
            Self::None => "none".to_owned(),
            Self::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
                list(&["k1", "k2", "p1", "p2", "k3"], &[*k1, *k2, *p1, *p2, *k3])
            }
            Self::Equidistant { k } => list(&["equidistant k1", "k2", "k3", "k4"], k),
            Self::Rational { k, p } => list(
                &["rational k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
                &[k[0], k[1], p[0], p[1], k[2], k[3], k[4], k[5]],
            ),
            Self::Division { k1 } => list(&["division k1"], &[*k1]),
        }
    }

    /// The distorted point of an ideal one.
    pub fn distort(&self, ideal: DVec2) -> DVec2 {
        let (x, y) = (ideal.x, ideal.y);
        match *self {
            Self::None => ideal,
            Self::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
                let s = ideal.length_squared();
                let radial = 1.0 + s * (k1 + s * (k2 + s * k3));
                let (xy, along) = (2.0 * x * y, DVec2::new(s + 2.0 * x * x, s + 2.0 * y * y));
                ideal * radial + DVec2::new(p1 * xy + p2 * along.x, p1 * along.y + p2 * xy)
            }
            Self::Equidistant { k } => ideal * equidistant_ratio(&k, ideal.length()),
            Self::Rational { k, p } => rational::distort_with_jacobian(&k, p, ideal).0,
            Self::Division { k1 } => ideal * division::ratio_and_slope(k1, ideal.length()).0,
        }
    }

    /// The distorted point and its derivative by the ideal point (symmetric).
    pub fn distort_with_jacobian(&self, ideal: DVec2) -> (DVec2, DMat2) {
        let (x, y) = (ideal.x, ideal.y);
        match *self {
            Self::None => (ideal, DMat2::IDENTITY),
            Self::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
                let s = ideal.length_squared();
                let radial = 1.0 + s * (k1 + s * (k2 + s * k3));
                // Twice the derivative of `radial` by s.
                let slope = 2.0 * (k1 + s * (2.0 * k2 + s * 3.0 * k3));
                let off = slope * x * y + 2.0 * (p1 * x + p2 * y);
                let xx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
                let yy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
                let jacobian = DMat2::from_cols(DVec2::new(xx, off), DVec2::new(off, yy));
                (self.distort(ideal), jacobian)
            }
            Self::Equidistant { k } => {
                let r = ideal.length();
                let across = equidistant_ratio(&k, r);
                let along = equidistant_slope(&k, r.atan()) / (1.0 + r * r);
                (ideal * across, radial_jacobian(ideal, along, across))
            }
            Self::Rational { k, p } => rational::distort_with_jacobian(&k, p, ideal),
            Self::Division { k1 } => {
                let (across, along) = division::ratio_and_slope(k1, ideal.length());
                (ideal * across, radial_jacobian(ideal, along, across))
            }
        }
    }

    /// The ideal point of a distorted one: the one at most `max_radius` from the axis, which must not exceed the radius
    /// of invertibility (as [`Lens`] knows it). `None` if there is none.
    pub(crate) fn undistort_within(&self, distorted: DVec2, max_radius: f64) -> Option<DVec2> {
        if matches!(self, Self::None) {
            return Some(distorted);
        }
        let mut ideal = self.first_guess(distorted, max_radius);
        let (mut at, mut jacobian) = self.distort_with_jacobian(ideal);
        let mut residual = (at - distorted).length();
        for _ in 0..MAX_STEPS {
            if residual <= RESIDUAL * (1.0 + distorted.length()) {
                break;
            }
            let step = jacobian.inverse() * (distorted - at);
            // The residual falls along a Newton step, at first; halving finds where, and keeps inside the disc.
            let better = (0..30).map(|halvings| ideal + step * 0.5f64.powi(halvings)).find_map(|next| {
                let inside = next.length_squared() <= max_radius * max_radius;
                let (next_at, next_jacobian) = self.distort_with_jacobian(next);
                let next_residual = (next_at - distorted).length();
                (inside && next_residual < residual).then_some((next, next_at, next_jacobian, next_residual))
            });
            let Some(better) = better else { break };
            (ideal, at, jacobian, residual) = better;
        }
        (residual <= ACCEPTED_RESIDUAL * (1.0 + distorted.length())).then_some(ideal)
    }

    /// A start from which a few steps suffice.
    fn first_guess(&self, distorted: DVec2, max_radius: f64) -> DVec2 {
        let guess = match self {
            // The inverse of the ideal fisheye; its pole at 90 degrees is what Newton would crawl towards.
            Self::Equidistant { .. } => {
                let theta = distorted.length().min(1.5);
                distorted.normalize_or_zero() * theta.tan()
            }
            Self::Division { k1 } => distorted * division::inverse_ratio(*k1, distorted.length()),
            _ => distorted,
        };
        // Just inside, so that the first Jacobian is regular.
        guess.clamp_length_max(0.999 * max_radius)
    }
}

/// The ideal radius up to which the mapping is one-to-one in every direction, at most `limit`.
fn invertible_radius(distortion: &Distortion, limit: f64) -> f64 {
    match distortion {
        Distortion::None => limit,
        Distortion::Equidistant { k } => fold::equidistant(k, limit),
        Distortion::BrownConrady { k, p } => fold::brown_conrady(k, p, limit),
        Distortion::Rational { k, p } => rational::fold(k, p, limit),
        Distortion::Division { k1 } => division::fold(*k1, limit),
    }
}

/// The Jacobian of a mapping that only stretches: along the ray through a point, and across it.
fn radial_jacobian(at: DVec2, along: f64, across: f64) -> DMat2 {
    let n = at.normalize_or_zero();
    DMat2::IDENTITY * across + DMat2::from_cols(n * n.x, n * n.y) * (along - across)
}

/// Distorted over ideal radius of the fisheye.
fn equidistant_ratio(k: &[f64; 4], r: f64) -> f64 {
    // Below this the quotient loses digits; the next term of the series is r^4.
    if r < 1e-4 {
        return 1.0 + r * r * (k[0] - 1.0 / 3.0);
    }
    let theta = r.atan();
    let t = theta * theta;
    theta * (1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3])))) / r
}

/// Derivative of the fisheye's distorted radius by theta.
fn equidistant_slope(k: &[f64; 4], theta: f64) -> f64 {
    let t = theta * theta;
    1.0 + t * (3.0 * k[0] + t * (5.0 * k[1] + t * (7.0 * k[2] + t * 9.0 * k[3])))
}
