//! Fits this program's five lens coefficients to a lens that was calibrated with more.

use glam::DVec2;

use shutterbug::camera::{Distortion, Intrinsics};

/// Directions and steps of the sample rays.
const RAYS: usize = 72;
const STEPS: usize = 60;

/// The Brown-Conrady lens nearest to `mapping` (ideal to distorted, normalised) over the picture, by least squares of
/// the distorted points, and its largest error there in px. `None` where the mapping leaves nothing to fit.
pub(super) fn fit_brown_conrady(
    k: &Intrinsics,
    mapping: impl Fn(DVec2) -> DVec2,
) -> Option<(Distortion, f64)> {
    let samples = samples(k, &mapping);
    // Unknowns k1 k2 p1 p2 k3: the model is linear in them. A ray has two equations.
    let (mut normal, mut right) = ([[0.0; 5]; 5], [0.0; 5]);
    for &(ideal, distorted) in &samples {
        let (rows, shift) = (equations(ideal), distorted - ideal);
        for (row, b) in rows.iter().zip([shift.x, shift.y]) {
            for i in 0..5 {
                right[i] += row[i] * b;
                for j in 0..5 {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
    }
    let [k1, k2, p1, p2, k3] = solve(normal, right)?;
    let lens = Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] };
    let error_px = |(ideal, distorted): &(DVec2, DVec2)| {
        let off = lens.distort(*ideal) - *distorted;
        (off * DVec2::new(k.fx, k.fy)).length()
    };
    let worst = samples.iter().map(error_px).fold(0.0, f64::max);
    worst.is_finite().then_some((lens, worst))
}

/// Ideal points and where the mapping puts them, on rays from the axis until they leave the picture or turn back.
fn samples(k: &Intrinsics, mapping: &impl Fn(DVec2) -> DVec2) -> Vec<(DVec2, DVec2)> {
    let corner = |x: f64, y: f64| DVec2::new((x - k.cx) / k.fx, (y - k.cy) / k.fy);
    let (low, high) = (corner(0.0, 0.0), corner(f64::from(k.width), f64::from(k.height)));
    let reach = low.abs().max(high.abs()).length();
    let mut samples = Vec::new();
    for ray in 0..RAYS {
        let direction = DVec2::from_angle(ray as f64 * std::f64::consts::TAU / RAYS as f64);
        let mut last = 0.0;
        // A barrel lens shows ideal points far beyond the picture's own reach.
        for step in 1..=4 * STEPS {
            let ideal = direction * (reach * step as f64 / STEPS as f64);
            let distorted = mapping(ideal);
            let radius = distorted.length();
            if radius <= last || radius.is_nan() || distorted.cmplt(low).any() || distorted.cmpgt(high).any()
            {
                break;
            }
            last = radius;
            samples.push((ideal, distorted));
        }
    }
    samples
}

/// Factors of k1 k2 p1 p2 k3 in the shift of an ideal point, for x and y.
fn equations(p: DVec2) -> [[f64; 5]; 2] {
    let s = p.length_squared();
    let (xy, x2, y2) = (2.0 * p.x * p.y, s + 2.0 * p.x * p.x, s + 2.0 * p.y * p.y);
    [[p.x * s, p.x * s * s, xy, x2, p.x * s * s * s], [p.y * s, p.y * s * s, y2, xy, p.y * s * s * s]]
}

/// Gauss with the largest pivot; `None` for a singular matrix.
fn solve(mut a: [[f64; 5]; 5], mut b: [f64; 5]) -> Option<[f64; 5]> {
    for column in 0..5 {
        let pivot = (column..5).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs()))?;
        if a[pivot][column].abs() <= 1e-300 || a[pivot][column].is_nan() {
            return None;
        }
        a.swap(column, pivot);
        b.swap(column, pivot);
        for row in 0..5 {
            if row == column {
                continue;
            }
            let factor = a[row][column] / a[column][column];
            let pivot_row = a[column];
            a[row].iter_mut().zip(pivot_row).for_each(|(v, p)| *v -= factor * p);
            b[row] -= factor * b[column];
        }
    }
    Some([0, 1, 2, 3, 4].map(|i| b[i] / a[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: Intrinsics = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 510.0, cx: 310.0, cy: 250.0 };

    #[test]
    fn a_brown_conrady_lens_is_found_again() {
        let want = Distortion::BrownConrady { k: [-0.28, 0.07, 0.003], p: [0.002, -0.001] };
        let (lens, worst_px) = fit_brown_conrady(&K, |p| want.distort(p)).expect("a fit");
        let Distortion::BrownConrady { k, p } = lens else { panic!("{lens:?}") };
        for (got, want) in k.iter().chain(&p).zip([-0.28, 0.07, 0.003, 0.002, -0.001]) {
            assert!((got - want).abs() < 1e-8, "{lens:?}");
        }
        assert!(worst_px < 1e-6);
    }

    #[test]
    fn a_mapping_without_samples_has_no_fit() {
        assert!(fit_brown_conrady(&K, |_| DVec2::NAN).is_none());
    }
}
