//! Least squares with few parameters that all views share and six of each view's own: the own ones are eliminated
//! (Schur complement), so that hundreds of views cost no more than their number.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Parameters of a pose.
pub(super) const OWN: usize = 6;

/// Normal equations of one view.
#[derive(Clone, Debug)]
pub(super) struct Block {
    shared: DMatrix<f64>,
    cross: DMatrix<f64>,
    own: SMatrix<f64, OWN, OWN>,
    shared_right: DVector<f64>,
    own_right: SVector<f64, OWN>,
}

impl Block {
    /// Of nothing, with so many shared parameters.
    pub(super) fn new(shared: usize) -> Self {
        Self {
            shared: DMatrix::zeros(shared, shared),
            cross: DMatrix::zeros(shared, OWN),
            own: SMatrix::zeros(),
            shared_right: DVector::zeros(shared),
            own_right: SVector::zeros(),
        }
    }

    /// Adds a residual (measured minus predicted) with the prediction's derivatives.
    pub(super) fn add(&mut self, by_shared: &[f64], by_own: &[f64; OWN], residual: f64, weight: f64) {
        for (i, a) in by_shared.iter().enumerate() {
            let a = weight * a;
            by_shared.iter().enumerate().for_each(|(j, b)| self.shared[(i, j)] += a * b);
            by_own.iter().enumerate().for_each(|(j, b)| self.cross[(i, j)] += a * b);
            self.shared_right[i] += a * residual;
        }
        for (i, a) in by_own.iter().enumerate() {
            let a = weight * a;
            by_own.iter().enumerate().for_each(|(j, b)| self.own[(i, j)] += a * b);
            self.own_right[i] += a * residual;
        }
    }
}

impl Block {
    /// What a residual with these derivatives pulls the shared parameters by, once the pose has taken up what it can.
    /// `None` where the view cannot fix its pose.
    pub(super) fn pull(&self) -> Option<impl Fn(&[f64], &[f64; OWN]) -> DVector<f64> + '_> {
        let own = self.own.cholesky()?;
        Some(move |by_shared: &[f64], by_own: &[f64; OWN]| {
            DVector::from_column_slice(by_shared) - &self.cross * own.solve(&SVector::from(*by_own))
        })
    }
}

/// A step of all parameters.
pub(super) struct Step {
    pub shared: DVector<f64>,
    pub own: Vec<SVector<f64, OWN>>,
}

/// The shared parameters' own equations, with what the poses take up of them removed: matrix and right side. `None`
/// where a view cannot fix its pose.
fn reduced(blocks: &[Block], damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let n = blocks.first()?.shared_right.len();
    let (mut a, mut b) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for block in blocks {
        let inverse = damped(&block.own, damping).cholesky()?.inverse();
        let taken = &block.cross * inverse;
        a += &block.shared - &taken * block.cross.transpose();
        b += &block.shared_right - &taken * block.own_right;
        for i in 0..n {
            a[(i, i)] += damping * block.shared[(i, i)];
        }
    }
    Some((a, b))
}

fn damped(own: &SMatrix<f64, OWN, OWN>, damping: f64) -> SMatrix<f64, OWN, OWN> {
    let mut own = *own;
    for i in 0..OWN {
        own[(i, i)] *= 1.0 + damping;
    }
    own
}

/// The step of Levenberg and Marquardt; `None` where the equations have no single solution.
pub(super) fn step(blocks: &[Block], damping: f64) -> Option<Step> {
    let (a, b) = reduced(blocks, damping)?;
    let shared = if b.is_empty() { b } else { a.cholesky()?.solve(&b) };
    let own = blocks.iter().map(|block| {
        let right = block.own_right - block.cross.transpose() * &shared;
        Some(damped(&block.own, damping).cholesky()?.solve(&right))
    });
    let own = own.collect::<Option<Vec<_>>>()?;
    (shared.iter().chain(own.iter().flatten()).all(|v| v.is_finite())).then_some(Step { shared, own })
}

/// Covariance of the shared parameters over the variance of a residual.
pub(super) fn covariance(blocks: &[Block]) -> Option<DMatrix<f64>> {
    Some(reduced(blocks, 0.0)?.0.cholesky()?.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = s0 + s1 x + own: the solution of the whole system, found without elimination.
    #[test]
    fn elimination_solves_what_the_whole_system_does() {
        let mut dice = 1u64;
        let mut roll = || {
            dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (dice >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let (views, shared) = (3, 2);
        let n = shared + OWN * views;
        let (mut whole, mut right) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
        let mut blocks = vec![Block::new(shared); views];
        for view in 0..views {
            for _ in 0..20 {
                let by_shared = [roll(), roll()];
                let by_own: [f64; OWN] = std::array::from_fn(|_| roll());
                let residual = roll();
                blocks[view].add(&by_shared, &by_own, residual, 2.0);
                let mut row = DVector::<f64>::zeros(n);
                (0..shared).for_each(|i| row[i] = by_shared[i]);
                (0..OWN).for_each(|i| row[shared + OWN * view + i] = by_own[i]);
                whole += 2.0 * &row * row.transpose();
                right += 2.0 * residual * &row;
            }
        }
        let inverse = whole.cholesky().expect("regular").inverse();
        let should = &inverse * right;
        let is = step(&blocks, 0.0).expect("regular");
        assert!((is.shared[1] - should[1]).abs() < 1e-9);
        assert!((is.own[2][5] - should[n - 1]).abs() < 1e-9);
        let spread = covariance(&blocks).expect("regular");
        assert!((spread[(0, 1)] - inverse[(0, 1)]).abs() < 1e-9);
        // Control: without elimination the shared parameters come out otherwise.
        let alone: DMatrix<f64> = blocks.iter().map(|b| b.shared.clone()).sum();
        assert!((alone.cholesky().expect("regular").inverse()[(0, 1)] - inverse[(0, 1)]).abs() > 1e-4);
    }
}
