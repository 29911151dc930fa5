//! Where a lens looks, by the five coefficients of the camera contract.

use glam::DVec2;

use super::model::{P, Theta};

/// Undistorted point of a distorted one (both over the focal length), by Newton's method on the radius and the
/// tangential part.
pub(crate) fn undistort(distorted: DVec2, theta: &Theta) -> DVec2 {
    let [k1, k2, p1, p2, k3] = [P::K1, P::K2, P::P1, P::P2, P::K3].map(|p| theta.get(p));
    if [k1, k2, p1, p2, k3] == [0.0; 5] {
        return distorted;
    }
    let mut at = distorted;
    for _ in 0..12 {
        let r2 = at.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let tangential = DVec2::new(
            2.0 * p1 * at.x * at.y + p2 * (r2 + 2.0 * at.x * at.x),
            p1 * (r2 + 2.0 * at.y * at.y) + 2.0 * p2 * at.x * at.y,
        );
        let error = at * radial + tangential - distorted;
        // The radial slope alone suffices: tangential terms are small. Never steps over a fold.
        let slope = (1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + 7.0 * r2 * k3))).max(0.3);
        let along = if r2 > 0.0 { at * (error.dot(at) / r2) } else { DVec2::ZERO };
        at -= along / slope + (error - along) / radial.max(0.3);
        if error.length_squared() < 1e-20 {
            break;
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undistortion_inverts_the_contract_s_formula() {
        let mut theta = Theta::neutral();
        for (k1, k2, p1, p2) in
            [(0.19, -0.015, 0.0, 0.0), (-0.1, -0.02, 0.003, -0.002), (-0.3, 0.1, 0.0, 0.01)]
        {
            for (p, v) in [(P::K1, k1), (P::K2, k2), (P::P1, p1), (P::P2, p2)] {
                theta.set(p, v);
            }
            for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-0.55, 0.4), (0.02, 0.5)] {
                let r2: f64 = x * x + y * y;
                let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
                let distorted = DVec2::new(
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                );
                let back = undistort(distorted, &theta);
                assert!((back - DVec2::new(x, y)).length() < 1e-6, "{k1} {k2}: {back} for {x} {y}");
            }
        }
    }
}
