//! Means over rows and over columns, which noise of rows and banding show in.

use std::sync::Arc;

use super::alike::Alike;
use super::{Blocks, Seen, SeenIn, Sums};
use crate::diagnose::expect::discrepancy::DRAWS;
use shutterbug::plane::Plane;

/// Sums over a row or a column: error, variance, noise of rows, number, what single values and colours may be off by;
/// and what each draw is off by.
#[derive(Clone, Copy, Default)]
struct Line {
    sums: [f64; 6],
    drawn: [f64; DRAWS],
}

impl Line {
    /// Adds a value that keeps `free` of its own noise, and of that of rows what adds up along the line: its size in a
    /// row, where it is one draw, and its variance in a column.
    fn add(&mut self, v: &Seen, free: f32, of_rows: f32, drawn: &[Arc<Plane<f32>>], i: usize) {
        let add = [v.error, free, of_rows, 1.0, v.single, v.common];
        for (sum, add) in self.sums.iter_mut().zip(add) {
            *sum += f64::from(add);
        }
        for (sum, draw) in self.drawn.iter_mut().zip(drawn) {
            *sum += f64::from(draw.data[i]);
        }
    }

    /// Variance of the mean that correct simulations may differ by; `alike`: see [`Alike::in_mean`].
    fn off(&self, alike: f64) -> f64 {
        let n = self.sums[3];
        let drawn = self.drawn.iter().map(|d| (d / n).powi(2)).sum::<f64>() / DRAWS as f64;
        self.sums[4] / (n * n) + self.sums[5] / n + drawn + alike
    }

    /// Adds the mean; `row`: its variance from noise of rows.
    fn count(&self, sums: &mut Sums, block: usize, row: f64, unsure: f64, alike: f64) {
        let ([error, free, _, n, ..], off) = (self.sums, self.off(alike));
        let noise = free / (n * n) + row;
        sums.add(block, error / n, noise + off, off + unsure * noise);
    }
}

/// Means over rows and over columns.
pub(super) fn lines(frame: &SeenIn, blocks: Blocks, sums: &mut [Sums]) {
    let ([w, h], unsure) = (frame.size, f64::from(frame.unsure));
    let mut rows = vec![Line::default(); h * 3];
    let mut columns = vec![Line::default(); w * 3];
    let mut alike = [h, w].map(|lines| Alike::new(3 * lines, frame.given));
    for (i, v) in frame.values.iter().enumerate() {
        let Some(v) = v else { continue };
        let (x, y, c) = (i / 3 % w, i / 3 / w, i % 3);
        rows[y * 3 + c].add(v, v.lines[0], v.in_row.sqrt(), &frame.drawn, i);
        columns[x * 3 + c].add(v, v.lines[1], v.in_row, &frame.drawn, i);
        alike[0].add(y * 3 + c, v);
        alike[1].add(x * 3 + c, v);
    }
    for (i, r) in rows.iter().enumerate().filter(|(_, r)| r.sums[3] >= 0.25 * w as f64) {
        let row = (r.sums[2] / r.sums[3]).powi(2);
        r.count(&mut sums[0], blocks.row(i / 3), row, unsure, alike[0].in_mean(i, r.sums[3]));
    }
    for (i, c) in columns.iter().enumerate().filter(|(_, c)| c.sums[3] >= 0.25 * h as f64) {
        let alike = alike[1].in_mean(i, c.sums[3]);
        c.count(&mut sums[1], blocks.column(i / 3), c.sums[2] / c.sums[3].powi(2), unsure, alike);
    }
}
