//! Displacements of a grid of windows, smooth from window to window.

use std::ops::Range;

/// Windows across a picture.
pub(super) const ACROSS: usize = 12;
/// Weight of a window's neighbours beside what it sees itself, as a part of what windows see on average.
const SMOOTH: f64 = 0.3;
/// A window shows the same in both frames if it correlates so well.
pub(super) const ALIKE: f64 = 0.8;

/// Displacements of a grid of windows, px: where content of the first picture is in the second.
#[derive(Clone)]
pub(super) struct Field {
    pub nx: usize,
    pub ny: usize,
    pub at: Vec<[f64; 2]>,
}

/// What one window sees: the normal equations of its displacement, and how alike the pictures are in it.
#[derive(Clone, Copy, Default)]
pub(super) struct Window {
    pub a: [f64; 3],
    pub b: [f64; 2],
    pub alike: f64,
}

impl Field {
    pub(super) fn zero(w: usize, h: usize) -> Self {
        Self::across(ACROSS, w, h)
    }

    pub(super) fn across(nx: usize, w: usize, h: usize) -> Self {
        let ny = (nx * h / w).max(3);
        Self { nx, ny, at: vec![[0.0; 2]; nx * ny] }
    }

    /// Middle of a window in a picture of that size, px.
    pub(super) fn middle(&self, i: usize, (w, h): (usize, usize)) -> [f64; 2] {
        let part = |k: usize, n: usize, side: usize| (k as f64 + 0.5) / n as f64 * side as f64 - 0.5;
        [part(i % self.nx, self.nx, w), part(i / self.nx, self.ny, h)]
    }

    /// The window left of (or above) a pixel, and how far beyond its middle the pixel lies. Straight on beyond the
    /// outer windows: displacements by a turn grow towards the border.
    pub(super) fn place(v: f64, n: usize, side: usize) -> (usize, f64) {
        let u = (v + 0.5) / side as f64 * n as f64 - 0.5;
        let low = (u.floor().max(0.0) as usize).min(n - 2);
        (low, u - low as f64)
    }

    /// The displacement at a place between windows.
    pub(super) fn between(&self, (x0, fx): (usize, f64), (y0, fy): (usize, f64)) -> [f64; 2] {
        let at = |x: usize, y: usize, k: usize| self.at[y * self.nx + x][k];
        [0, 1].map(|k| {
            (at(x0, y0, k) * (1.0 - fx) + at(x0 + 1, y0, k) * fx) * (1.0 - fy)
                + (at(x0, y0 + 1, k) * (1.0 - fx) + at(x0 + 1, y0 + 1, k) * fx) * fy
        })
    }

    /// Number of windows.
    pub(super) fn len(&self) -> usize {
        self.at.len()
    }

    /// Columns and rows of a window that reaches so far from its middle, over its own width and height, in a picture of
    /// that size. Pixels at the border have no slopes.
    pub(super) fn range(&self, i: usize, size: (usize, usize), reach: f64) -> [Range<usize>; 2] {
        let middle = self.middle(i, size);
        let range = |middle: f64, n: usize, side: usize| {
            let half = side as f64 / n as f64 * reach;
            ((middle - half).max(1.0) as usize)..((middle + half).min(side as f64 - 2.0).max(1.0) as usize)
        };
        [range(middle[0], self.nx, size.0), range(middle[1], self.ny, size.1)]
    }

    /// The displacement at a pixel of a picture of that size.
    pub(super) fn read(&self, x: f64, y: f64, (w, h): (usize, usize)) -> [f64; 2] {
        self.between(Self::place(x, self.nx, w), Self::place(y, self.ny, h))
    }

    /// The windows beside one.
    pub(super) fn around(&self, i: usize) -> Vec<usize> {
        let (x, y) = ((i % self.nx) as isize, (i / self.nx) as isize);
        let inside =
            |(x, y): &(isize, isize)| *x >= 0 && *y >= 0 && *x < self.nx as isize && *y < self.ny as isize;
        let all = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
        all.into_iter().filter(inside).map(|(x, y)| y as usize * self.nx + x as usize).collect()
    }

    /// Values of windows with their weights, smooth from window to window. In a window at whose rim an edge ends, a
    /// gain of fifty makes the foot of a sharp edge that of a soft one: its neighbours know better.
    pub(super) fn smoothed(&self, own: &[(f64, f64)]) -> Vec<f64> {
        let mean = own.iter().map(|o| o.1).sum::<f64>() / own.len() as f64;
        let start = own.iter().map(|o| o.0 * o.1).sum::<f64>() / (mean * own.len() as f64).max(1e-9);
        let mut out = vec![start; own.len()];
        let beside = SMOOTH * mean.max(1e-9);
        for _ in 0..60 {
            for (i, (value, weight)) in own.iter().enumerate() {
                let around = self.around(i);
                let near = around.iter().map(|&j| out[j]).sum::<f64>() / around.len() as f64;
                out[i] = (weight * value + beside * near) / (weight + beside);
            }
        }
        out
    }

    /// Moves every window by what it and its neighbours see.
    pub(super) fn step(&mut self, windows: &[Window]) {
        let trace = windows.iter().map(|w| 0.5 * (w.a[0] + w.a[2])).sum::<f64>() / windows.len() as f64;
        let lambda = SMOOTH * trace.max(1e-9);
        let old = self.at.clone();
        // What differs from the mean of the neighbours pays; straight lines from window to window pay nothing inside.
        for _ in 0..60 {
            for i in 0..self.at.len() {
                let around = self.around(i);
                let n = around.len() as f64;
                let mean = [0, 1].map(|k| around.iter().map(|&j| self.at[j][k]).sum::<f64>() / n);
                let (w, l) = (&windows[i], lambda * if around.len() == 4 { 1.0 } else { 0.1 });
                let (a, b, c) = (w.a[0] + l, w.a[1], w.a[2] + l);
                let r = [0, 1].map(|k| {
                    let own = if k == 0 {
                        w.a[0] * old[i][0] + w.a[1] * old[i][1]
                    } else {
                        w.a[1] * old[i][0] + w.a[2] * old[i][1]
                    };
                    own + w.b[k] + l * mean[k]
                });
                let d = a * c - b * b;
                if d > 0.0 {
                    self.at[i] = [(c * r[0] - b * r[1]) / d, (a * r[1] - b * r[0]) / d];
                }
            }
        }
    }

    pub(super) fn rms(&self, windows: &[Window]) -> Option<f64> {
        let seen: Vec<usize> = (0..windows.len()).filter(|&i| windows[i].alike > ALIKE).collect();
        // A few windows may be alike by chance.
        if 4 * seen.len() < windows.len() {
            return None;
        }
        let square: f64 = seen.iter().map(|&i| self.at[i][0].powi(2) + self.at[i][1].powi(2)).sum();
        Some((square / seen.len() as f64).sqrt())
    }
}

/// Covariances of what is seen at some places, several values each.
pub(super) fn covariances<const N: usize>(seen: &[[f64; N]]) -> [[f64; N]; N] {
    let n = seen.len() as f64;
    let mean: [f64; N] = std::array::from_fn(|k| seen.iter().map(|s| s[k]).sum::<f64>() / n);
    let mut c = [[0.0; N]; N];
    for s in seen {
        let d: [f64; N] = std::array::from_fn(|k| s[k] - mean[k]);
        (0..N).for_each(|i| (0..N).for_each(|j| c[i][j] += d[i] * d[j]));
    }
    c.map(|row| row.map(|v| v / n))
}
