//! Lenses that are none: a focal length that is off moves everything in proportion to its radius, and a lens whose
//! coefficients bend it to one side and back does nearly the same.

use super::model::{P, Theta};
use crate::camera::Intrinsics;

/// Share of a lens's displacement that a focal length makes too, from which on it is suspected: lenses with k1 alone have 0.84 to
/// 0.87, and 15 that stood for a focal length had 0.93 to 0.98.
const MOST_ALIKE: f64 = 0.945;
/// The largest focal length error that is suspected, as a ratio: wide lenses, bent as strongly, are alike too, but move the
/// picture by more.
const MOST_RATIO: f64 = 0.06;

/// Whether the lens of `theta` does what a focal length does: nearly all of its displacement grows in proportion to the radius, by a
/// few per cent.
pub(super) fn is_a_magnification(theta: &Theta, k: &Intrinsics) -> bool {
    let [k1, k2, k3] = [P::K1, P::K2, P::K3].map(|p| theta.get(p));
    let (mut both, mut radius2, mut displaced2) = (0.0, 0.0, 0.0);
    for y in 0..k.height {
        for x in 0..k.width {
            let (x, y) = ((f64::from(x) + 0.5 - k.cx) / k.fx, (f64::from(y) + 0.5 - k.cy) / k.fy);
            let r2 = x * x + y * y;
            // Displacement over radius.
            let share = r2 * (k1 + r2 * (k2 + r2 * k3));
            both += share * r2;
            radius2 += r2;
            displaced2 += share * share * r2;
        }
    }
    let (alike, ratio) = (both * both / (radius2 * displaced2).max(1e-30), both / radius2);
    alike > MOST_ALIKE && ratio.abs() < MOST_RATIO
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(fx: f64, [k1, k2, k3]: [f64; 3]) -> bool {
        let k = Intrinsics { width: 320, height: 240, fx, fy: fx, cx: 160.0, cy: 120.0 };
        is_a_magnification(&Theta::neutral().with(P::K1, k1).with(P::K2, k2).with(P::K3, k3), &k)
    }

    #[test]
    fn lenses_that_stood_for_a_focal_length_are_told_from_lenses() {
        // Blind captures whose focal length was off and no candidate.
        assert!(lens(260.0, [-0.1125, 0.3799, -0.3933]));
        assert!(lens(291.0, [0.1549, -0.3095, 0.0]));
        assert!(lens(335.0, [-0.1848, 0.4934, 0.0]));
        // Lenses: barrel, pincushion, with a second coefficient, wide, and none.
        for k in [[-0.2, 0.0, 0.0], [0.19, -0.015, 0.0], [-0.0976, -0.0192, 0.0], [-0.29, 0.1, 0.0]] {
            assert!(!lens(300.0, k), "{k:?}");
        }
        assert!(!lens(150.0, [-0.4, 0.2, 0.0]), "wide: alike, but by 17 %");
        assert!(!lens(300.0, [0.0; 3]));
    }
}
