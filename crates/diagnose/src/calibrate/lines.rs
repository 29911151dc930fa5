//! Means of rows and of columns of pictures of a flat field: whether they differ between the pictures, as under a lamp
//! that flickers, and whether a dark frame surrounds the light.

use serde::Serialize;

use super::own::{REPEAT_PX, Z99};
use shutterbug::plane::Plane;

/// Lines that differ from picture to picture, or from each other in all of them.
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

/// Means of lines: their variance, what chance adds to it or takes away, how many pixels each is of, and how many there
/// are.
#[derive(Clone, Copy)]
struct Spread {
    variance: f64,
    chance: f64,
    pixels: f64,
    free: f64,
}

/// Rows (first) or columns that vary by more than their pixels do.
fn unlike(both: [Spread; 2]) -> Option<Bands> {
    let by_chance = (Z99 * (2.0 / both[0].free + 2.0 / both[1].free).sqrt()).exp();
    let more = |axis: usize| {
        let (own, other) = (&both[axis], &both[1 - axis]);
        // Of a pixel, by one and by the other.
        let least = (own.variance - own.chance) * own.pixels;
        least > by_chance * other.variance.max(other.chance) * other.pixels
    };
    let axis = (0..2).find(|axis| more(*axis))?;
    let (own, other) = (&both[axis], &both[1 - axis]);
    let of_pixels = other.variance.max(0.0) * other.pixels / own.pixels;
    Some(Bands { rows: axis == 0, rms: (own.variance - of_pixels).max(0.0).sqrt() })
}

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
            let across = self.0.first().map_or(1, |p| p[1 - axis].len()) as f64;
            Spread {
                variance: self.0.iter().map(square).sum::<f64>() / (free * lines),
                chance: 0.0,
                pixels: across,
                // Lines of one block of a compression are taken for one.
                free: free * lines / REPEAT_PX as f64,
            }
        };
        unlike([0, 1].map(spread))
    }

    /// The same of what lines are beside their neighbours in all pictures: pixels' own patterns spread them alike, but
    /// for their lengths.
    pub(super) fn shared(&self) -> Option<Bands> {
        let n = self.0.len() as f64;
        // Light is even over three lines.
        let beside = |lines: &[f64]| -> Vec<f64> {
            lines.windows(3).map(|w| (w[1] - 0.5 * (w[0] + w[2])) / 1.5f64.sqrt()).collect()
        };
        // Covariance of two different pictures, which noise has no part in but by chance, at 99 %.
        let spread = |axis: usize| {
            let mean = self.mean(axis);
            let lines = mean.len() as f64 - 2.0;
            let sum: f64 = beside(&mean).iter().map(|v| (n * v).powi(2)).sum();
            let own: f64 = self.0.iter().flat_map(|p| beside(&p[axis])).map(|v| v * v).sum();
            let free = lines / REPEAT_PX as f64;
            Spread {
                variance: (sum - own) / (n * (n - 1.0) * lines),
                chance: Z99 * own / (n * lines) * (2.0 / free).sqrt() / (n - 1.0),
                pixels: self.mean(1 - axis).len() as f64,
                free,
            }
        };
        unlike([0, 1].map(spread))
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

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    #[test]
    fn columns_that_all_pictures_share_are_told_and_pixels_of_their_own_are_not() {
        let normal =
            |x: usize, y: usize, stream: u32| random_normal([x as u32, y as u32], 0, stream, [9, 1])[0];
        let seen = |columns: f32, prnu: f32, flicker: f32| {
            let mut lines = Lines::default();
            for frame in 0..4 {
                let picture = Plane::from_fn(320, 256, |x, y| {
                    let gain = 1.0 + prnu * normal(x, y, 1) + columns * normal(x, 0, 2);
                    let lamp = 1.0 + flicker * normal(0, y, 10 + frame);
                    [0.5 * gain * lamp + 0.01 * normal(x, y, 100 + frame)]
                });
                lines.add(&picture, 0.5);
            }
            lines.shared()
        };
        let found = seen(0.004, 0.01, 0.0).expect("columns");
        // As far as so many columns were drawn apart from their neighbours.
        let drawn: Vec<f32> = (0..320).map(|x| 0.004 * normal(x, 0, 2)).collect();
        let beside = drawn.windows(3).map(|w| f64::from(w[1] - 0.5 * (w[0] + w[2])).powi(2));
        let truth = (beside.sum::<f64>() / 318.0 / 1.5).sqrt();
        assert!(!found.rows && (found.rms / truth - 1.0).abs() < 0.05, "{found:?} for {truth}");
        for (prnu, flicker) in [(0.0, 0.0), (0.01, 0.0), (0.05, 0.0), (0.01, 0.01)] {
            assert_eq!(seen(0.0, prnu, flicker), None, "control: {prnu}, {flicker}");
        }
    }
}
