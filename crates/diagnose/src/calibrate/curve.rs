//! A smooth curve over intensity through uncertain points.

/// Knots, equally spaced over the values from 0 to 1.
pub(super) const KNOTS: usize = 17;

/// A measured value of the curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Where, 0 to 1.
    pub at: f64,
    /// The value there.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Values at the knots, linear between, by least squares; a pull towards straight and level lines decides where nothing
/// was measured. `None`: no point.
pub(super) fn through(points: &[Point]) -> Option<[f64; KNOTS]> {
    /// What a bend, and a slope, of 1 from knot to knot counts against a standard deviation of 1.
    const BEND: f64 = 4.0;
    const SLOPE: f64 = 0.4;
    if points.is_empty() {
        return None;
    }
    let (mut normal, mut right) = ([[0.0; KNOTS]; KNOTS], [0.0; KNOTS]);
    let mut add = |terms: &[(usize, f64)], value: f64, weight: f64| {
        for (i, a) in terms {
            right[*i] += weight * a * value;
            terms.iter().for_each(|(j, b)| normal[*i][*j] += weight * a * b);
        }
    };
    for p in points {
        let place = (p.at * (KNOTS - 1) as f64).clamp(0.0, (KNOTS - 1) as f64);
        let before = (place as usize).min(KNOTS - 2);
        let share = place - before as f64;
        add(&[(before, 1.0 - share), (before + 1, share)], p.value, p.sigma.powi(-2));
    }
    (1..KNOTS - 1).for_each(|i| add(&[(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)], 0.0, BEND));
    (1..KNOTS).for_each(|i| add(&[(i - 1, -1.0), (i, 1.0)], 0.0, SLOPE));
    Some(solve(normal, right))
}

/// Gauss's elimination of a symmetric positive definite system.
fn solve(mut a: [[f64; KNOTS]; KNOTS], mut b: [f64; KNOTS]) -> [f64; KNOTS] {
    for i in 0..KNOTS {
        for j in i + 1..KNOTS {
            let (factor, row) = (a[j][i] / a[i][i], a[i]);
            (i..KNOTS).for_each(|k| a[j][k] -= factor * row[k]);
            b[j] -= factor * b[i];
        }
    }
    for i in (0..KNOTS).rev() {
        let known: f64 = (i + 1..KNOTS).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - known) / a[i][i];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_met_where_it_was_measured_and_a_single_point_is_level() {
        let line = |at: f64| 0.3 - 0.8 * at;
        let points: Vec<Point> = (6..26)
            .map(|i| f64::from(i) / 32.0)
            .map(|at| Point { at, value: line(at), sigma: 0.05 })
            .collect();
        let curve = through(&points).expect("points");
        for i in 4..13 {
            let at = i as f64 / (KNOTS - 1) as f64;
            assert!((curve[i] - line(at)).abs() < 0.01, "{at}: {} for {}", curve[i], line(at));
        }
        assert!(curve.iter().all(|v| v.abs() < 0.6), "beyond the points it does not run away: {curve:?}");
        let level = through(&[Point { at: 0.4, value: 1.7, sigma: 0.1 }]).expect("a point");
        assert!(level.iter().all(|v| (v - 1.7).abs() < 1e-6), "{level:?}");
        assert!(through(&[]).is_none());
    }
}
