//! Slopes of the light and of the lens along a picture's lines, and waves beside them.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// Degree of the polynomial that slopes are.
const DEGREE: usize = 3;
/// Degree of one that is as good at slopes as a cubic is with two waves of three numbers each.
const FINER_DEGREE: usize = 9;

/// Polynomials up to a degree over `lines` places, each of length 1 and at right angles to the others; columns.
fn polynomials(lines: usize, degree: usize) -> Vec<DVector<f64>> {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let along = |i: usize| 2.0 * i as f64 / (lines.max(2) - 1) as f64 - 1.0;
    for power in 0..=degree {
        let next = DVector::from_fn(lines, |i, _| along(i).powi(power as i32));
        let next = beside(&basis, next);
        basis.push(next.normalize());
    }
    basis
}

/// A column without what it has of some others.
fn beside(basis: &[DVector<f64>], mut column: DVector<f64>) -> DVector<f64> {
    for b in basis {
        let along = b.dot(&column);
        column.axpy(-along, b, 1.0);
    }
    column
}

/// Values by line, less the nearest polynomial of a degree.
fn less(values: Vec<f64>, degree: usize) -> Vec<f64> {
    beside(&polynomials(values.len(), degree), DVector::from_vec(values)).as_slice().to_vec()
}

/// Values by line, less the nearest cubic.
pub(super) fn without(values: Vec<f64>) -> Vec<f64> {
    less(values, DEGREE)
}

/// Values by line, less all that may be a slope: waves of fewer than three periods too.
pub(super) fn without_finer(values: Vec<f64>) -> Vec<f64> {
    less(values, FINER_DEGREE)
}

/// Whether a wave in values is a part of a slope: beside a finer polynomial less than half of it is left. A wave of
/// three periods and more stays as high as it is.
pub(super) fn explain(values: &[f64], frequency: f64) -> bool {
    let height = |degree| {
        let wave = Slopes::beside(values, degree).fitted(frequency, 1);
        wave.map_or(0.0, |(parts, _)| parts.norm())
    };
    height(FINER_DEGREE) < 0.5 * height(DEGREE)
}

/// Values by line, and the slopes that waves in them are fitted beside.
pub(super) struct Slopes {
    values: DVector<f64>,
    basis: Vec<DVector<f64>>,
}

impl Slopes {
    /// `values`: without slopes (see [`without`]).
    pub(super) fn of(values: &[f64]) -> Self {
        Self::beside(values, DEGREE)
    }

    fn beside(values: &[f64], degree: usize) -> Self {
        Self { values: DVector::from_column_slice(values), basis: polynomials(values.len(), degree) }
    }

    /// Sum of squares of the values that a wave of `frequency` (cycles a line) and its harmonics explain beside
    /// slopes: what few periods have of a slope says nothing of their frequency.
    pub(super) fn explained(&self, frequency: f64, harmonics: usize) -> f64 {
        self.fitted(frequency, harmonics).map_or(0.0, |(parts, sums)| parts.dot(&sums))
    }

    /// The values without a wave of `frequency` and its harmonics, as they fit.
    pub(super) fn without_wave(&self, frequency: f64, harmonics: usize) -> Option<Vec<f64>> {
        let (parts, _) = self.fitted(frequency, harmonics)?;
        let left = &self.values - self.waves(frequency, harmonics) * parts;
        Some(left.as_slice().to_vec())
    }

    /// Cosines and sines of a wave and its harmonics, as they fit, and their products with the values.
    fn fitted(&self, frequency: f64, harmonics: usize) -> Option<(DVector<f64>, DVector<f64>)> {
        let waves = self.waves(frequency, harmonics);
        let (squares, sums) = (waves.tr_mul(&waves), waves.tr_mul(&self.values));
        Some((squares.cholesky()?.solve(&sums), sums))
    }

    /// Columns: cosines and sines of a wave and of its harmonics below half a cycle a line, without slopes.
    fn waves(&self, frequency: f64, harmonics: usize) -> DMatrix<f64> {
        let harmonics = ((0.45 / frequency) as usize).clamp(1, harmonics);
        let wave = |k: usize| {
            let turn = |i: usize| TAU * frequency * (k / 2 + 1) as f64 * i as f64;
            let side = |i: usize| if k.is_multiple_of(2) { turn(i).cos() } else { turn(i).sin() };
            DVector::from_fn(self.values.len(), |i, _| side(i))
        };
        let columns: Vec<_> = (0..2 * harmonics).map(|k| beside(&self.basis, wave(k))).collect();
        DMatrix::from_columns(&columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: usize = 200;

    fn over_lines(light: impl Fn(f64) -> f64) -> Vec<f64> {
        without((0..LINES).map(|i| light(i as f64 / LINES as f64).ln()).collect())
    }

    #[test]
    fn slopes_are_no_stripes_and_stripes_are_no_slope() {
        let step = 1.0 / LINES as f64;
        let spot = |x: f64| 0.8 / (1.0 + ((x - 0.3) / 0.3).powi(2));
        for light in [&spot as &dyn Fn(f64) -> f64, &|x| 0.1 + 0.8 * x, &|x| 0.2 + 0.6 * x] {
            let values = over_lines(light);
            assert!([3.0, 3.1, 3.5, 4.0].iter().all(|f| explain(&values, f * step)));
        }
        for periods in [3.0, 3.2, 4.0, 10.0] {
            for depth in [0.01, 0.5] {
                let values =
                    over_lines(|x| (0.1 + 0.8 * x) * (1.0 + depth * (TAU * periods * x + 1.0).sin()));
                // Few and faint beside a steep slope are taken for a part of it.
                let clear = depth > 0.1 || periods > 5.0;
                assert!(!clear || !explain(&values, periods * step), "{periods} of {depth}");
                let flat = over_lines(|x| 1.0 + depth * (TAU * periods * x + 1.0).sin());
                assert!(!explain(&flat, periods * step), "{periods} of {depth}");
            }
        }
    }

    #[test]
    fn a_wave_explains_most_at_its_own_frequency() {
        for periods in [3.2, 5.5, 10.0] {
            let values = over_lines(|x| 1.0 + 0.5 * (TAU * periods * x).sin());
            let slopes = Slopes::of(&values);
            let at = |off: f64| slopes.explained((periods + off) / LINES as f64, 4);
            assert!(at(0.0) > at(0.01) && at(0.0) > at(-0.01), "{periods}");
        }
    }
}
