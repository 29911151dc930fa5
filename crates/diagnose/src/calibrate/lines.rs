//! Means of rows and of columns of pictures of a flat field: whether they differ between the pictures, as under a lamp
//! that flickers, and whether a dark frame surrounds the light.

use serde::Serialize;

use super::own::{REPEAT_PX, Z99};
use shutterbug::plane::Plane;

/// Lines that differ from picture to picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bands {
    /// Whether they are rows (else columns).
    pub rows: bool,
    /// What their means differ by beyond the noise of their pixels: standard deviation, of the level.
    pub rms: f64,
}

/// Means of the rows and of the columns of each picture, over its level.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines(Vec<[Vec<f64>; 2]>);

impl Lines {
    /// Adds a picture of linear values.
    pub(super) fn add(&mut self, light: &Plane<f32>, level: f64) {
        let (w, h) = (light.width, light.height);
        let (mut rows, mut columns) = (vec![0.0f64; h], vec![0.0f64; w]);
        for (y, row) in light.data.chunks_exact(w).enumerate() {
            rows[y] = row.iter().map(|v| f64::from(*v)).sum::<f64>() / w as f64 / level.max(1e-9);
            columns.iter_mut().zip(row).for_each(|(c, v)| *c += f64::from(*v));
        }
        columns.iter_mut().for_each(|c| *c /= h as f64 * level.max(1e-9));
        self.0.push([rows, columns]);
    }

    /// Mean over the pictures.
    fn mean(&self, axis: usize) -> Vec<f64> {
        let n = self.0.len().max(1) as f64;
        let lines = self.0.first().map_or(0, |p| p[axis].len());
        (0..lines).map(|i| self.0.iter().map(|p| p[axis][i]).sum::<f64>() / n).collect()
    }

    /// Noise of the pixels spreads the means of rows and of columns alike, but for their lengths: more in one of both
    /// than chance makes (Fisher's ratio of variances) is the lines' own.
    pub(super) fn bands(&self) -> Option<Bands> {
        let free = self.0.len().saturating_sub(1) as f64;
        let spread = |axis: usize| {
            let mean = self.mean(axis);
            let square =
                |p: &[Vec<f64>; 2]| p[axis].iter().zip(&mean).map(|(v, m)| (v - m).powi(2)).sum::<f64>();
            let lines = mean.len() as f64;
            // Lines of one block of a compression are taken for one.
            (self.0.iter().map(square).sum::<f64>() / (free * lines), free * lines / REPEAT_PX as f64)
        };
        let [(of_rows, freedom_of_rows), (of_columns, freedom_of_columns)] = [0, 1].map(spread);
        let [rows, columns] = [0, 1].map(|axis| self.0.first().map_or(1, |p| p[axis].len()) as f64);
        let by_chance = (Z99 * (2.0 / freedom_of_rows + 2.0 / freedom_of_columns).sqrt()).exp();
        // Of a pixel, by rows and by columns.
        let [by_rows, by_columns] = [of_rows * columns, of_columns * rows];
        let found = |rows: bool, square: f64| Some(Bands { rows, rms: square.max(0.0).sqrt() });
        match () {
            () if by_rows > by_chance * by_columns => found(true, of_rows - by_columns / columns),
            () if by_columns > by_chance * by_rows => found(false, of_columns - by_rows / rows),
            () => None,
        }
    }

    /// Lines at a side that get less than half of the light of those a block of pixels further in: a lens's fall-off is
    /// smooth over the picture, and takes many times as far.
    pub(super) fn dark_frame(&self) -> Option<String> {
        let mut found = Vec::new();
        for (axis, names) in
            [(1, ["columns on the left", "columns on the right"]), (0, ["rows on top", "rows at the bottom"])]
        {
            let mean = self.mean(axis);
            let back: Vec<f64> = mean.iter().rev().copied().collect();
            for (lines, name) in [mean, back].iter().zip(names) {
                // And so does all that lies further out: waves of a texture go up and down.
                let is_dark = |i: &usize| lines[..=*i].iter().all(|v| *v < 0.5 * lines[i + REPEAT_PX]);
                let Some(last) = (0..lines.len() / 2).filter(is_dark).max() else { continue };
                let lit = lines[last + REPEAT_PX];
                let count = (last..).find(|i| lines[*i] >= 0.5 * lit).unwrap_or(last);
                found.push(format!("{count} {name}"));
            }
        }
        (!found.is_empty()).then(|| format!("a dark frame that no light reaches: {}", found.join(", ")))
    }
}
