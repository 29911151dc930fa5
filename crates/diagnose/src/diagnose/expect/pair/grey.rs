//! A picture of one channel: halved, softened, and read between its pixels with its slopes.

use rayon::prelude::*;
use shutterbug::plane::{Plane, srgb_decode};

/// A single-channel picture.
#[derive(Clone)]
pub(super) struct Grey {
    pub w: usize,
    pub h: usize,
    pub data: Vec<f32>,
}

/// A value blurred with its neighbours on two sides.
fn of_five(v: [f32; 5]) -> f32 {
    0.375 * v[2] + 0.25 * (v[1] + v[3]) + 0.0625 * (v[0] + v[4])
}

impl Grey {
    /// Linear light of a picture, 255 where it is white: a blur is the same on both sides of an edge in light, and not
    /// in values. DN, shape `[height, width, 3]`.
    pub fn of(plane: &Plane<f32>) -> Self {
        let light = |v: &f32| 255.0 * srgb_decode(v / 255.0);
        let mean = |p: &[f32]| p.iter().map(light).sum::<f32>() / 3.0;
        let data = plane.data.chunks_exact(3).map(mean).collect();
        Self { w: plane.width, h: plane.height, data }
    }

    /// Half the size.
    pub fn half(&self) -> Self {
        let soft = self.soft();
        let (w, h) = (self.w / 2, self.h / 2);
        let at = |x: usize, y: usize| soft.data[y * self.w + x];
        let mean = |i: usize| {
            let (x, y) = (2 * (i % w), 2 * (i / w));
            0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
        };
        Self { w, h, data: (0..w * h).map(mean).collect() }
    }

    /// Blurred by one pixel, so that pictures of unlike sharpness have slopes alike.
    pub fn soft(&self) -> Self {
        let (w, h) = (self.w, self.h);
        // Beyond the picture it goes on as at its border.
        let near = |at: usize, side: usize| [0, 1, 2, 3, 4].map(|k| (at + k).saturating_sub(2).min(side - 1));
        let mut across = vec![0.0; w * h];
        across.par_chunks_mut(w).zip(self.data.par_chunks(w)).for_each(|(out, row)| {
            for x in (0..w.min(2)).chain(w.saturating_sub(2)..w) {
                out[x] = of_five(near(x, w).map(|x| row[x]));
            }
            for (out, five) in out.iter_mut().skip(2).zip(row.windows(5)) {
                *out = of_five([five[0], five[1], five[2], five[3], five[4]]);
            }
        });
        let mut data = vec![0.0; w * h];
        data.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
            let [a, b, c, d, e] = near(y, h).map(|y| &across[y * w..][..w]);
            for (x, out) in out.iter_mut().enumerate() {
                *out = of_five([a[x], b[x], c[x], d[x], e[x]]);
            }
        });
        Self { data, ..*self }
    }

    /// Blurred along rows or along columns: by one pixel, or by two where every second of them counts.
    pub fn softened(&self, every: usize, along_rows: bool) -> Self {
        let (w, h) = (self.w, self.h);
        let (step, side) = if along_rows { (1, w) } else { (w, h) };
        let mut data = vec![0.0; w * h];
        data.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
            for (x, out) in out.iter_mut().enumerate() {
                let at = if along_rows { x } else { y };
                let from = y * w + x - at * step;
                // Beyond the picture it goes on as at its border.
                let near = |k: usize| {
                    let to = (at + k * every).saturating_sub(2 * every).min(side - 1);
                    self.data[from + to * step]
                };
                *out = of_five([0, 1, 2, 3, 4].map(near));
            }
        });
        Self { data, ..*self }
    }

    /// Value at a place that lies inside, between four pixels.
    pub fn value(&self, x: f64, y: f64) -> f32 {
        let (x0, y0) = (x as usize, y as usize);
        let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
        let (up, down) = (&self.data[y0 * self.w + x0..], &self.data[(y0 + 1) * self.w + x0..]);
        (up[0] * (1.0 - fx) + up[1] * fx) * (1.0 - fy) + (down[0] * (1.0 - fx) + down[1] * fx) * fy
    }

    /// Value and slopes at a place that lies at least one pixel inside, between four pixels each.
    pub fn read(&self, x: f64, y: f64) -> [f32; 3] {
        let (x0, y0) = (x as usize, y as usize);
        let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
        let row = |j: usize| -> &[f32; 4] {
            let at = (y0 + j - 1) * self.w + x0 - 1;
            self.data[at..at + 4].try_into().expect("four pixels")
        };
        // Places one pixel apart have the same weights.
        let across = |row: &[f32; 4], k: usize| row[k] * (1.0 - fx) + row[k + 1] * fx;
        let rows = [row(0), row(1), row(2), row(3)];
        let column = [across(rows[0], 1), across(rows[1], 1), across(rows[2], 1), across(rows[3], 1)];
        let down = |j: usize| column[j] * (1.0 - fy) + column[j + 1] * fy;
        let beside = |k: usize| across(rows[1], k) * (1.0 - fy) + across(rows[2], k) * fy;
        [down(1), 0.5 * (beside(2) - beside(0)), 0.5 * (down(2) - down(0))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_blurred_up_to_its_border() {
        for (w, h) in [(7, 5), (5, 1), (4, 3), (2, 6), (1, 2)] {
            let data: Vec<f32> = (0..w * h).map(|i| ((i * 7919) % 251) as f32).collect();
            let taps = [(-2, 0.0625), (-1, 0.25), (0, 0.375), (1, 0.25), (2, 0.0625)];
            let near = |at: usize, k: i32, side: usize| (at as i32 + k).clamp(0, side as i32 - 1) as usize;
            let by_hand = |i: usize| -> f64 {
                let one = |(j, b): (i32, f64), (k, a): (i32, f64)| {
                    a * b * f64::from(data[near(i / w, j, h) * w + near(i % w, k, w)])
                };
                taps.iter().flat_map(|&rows| taps.iter().map(move |&columns| one(rows, columns))).sum()
            };
            let soft = Grey { w, h, data: data.clone() }.soft().data;
            for (i, v) in soft.iter().enumerate() {
                assert!((f64::from(*v) - by_hand(i)).abs() < 1e-3, "{w}x{h}, {i}: {v} for {}", by_hand(i));
            }
        }
    }

    #[test]
    fn a_picture_is_blurred_along_one_side_only() {
        let (w, h) = (9, 7);
        let grey = Grey { w, h, data: (0..w * h).map(|i| ((i * 7919) % 251) as f32).collect() };
        let both = grey.softened(1, true).softened(1, false).data;
        let soft = grey.soft().data;
        assert!(both.iter().zip(&soft).all(|(a, b)| (a - b).abs() < 1e-3), "{both:?} for {soft:?}");
        let wide = grey.softened(2, true).data;
        let by_hand = |x: usize| {
            let at = |k: i64| grey.data[3 * w + (x as i64 + k).clamp(0, 8) as usize];
            0.375 * at(0) + 0.25 * (at(-2) + at(2)) + 0.0625 * (at(-4) + at(4))
        };
        assert!((0..w).all(|x| (wide[3 * w + x] - by_hand(x)).abs() < 1e-3), "{wide:?}");
        assert!((grey.value(3.25, 4.5) - grey.read(3.25, 4.5)[0]).abs() < 1e-4);
    }

    #[test]
    fn value_and_slopes_are_those_of_five_places() {
        let (w, h) = (9, 7);
        let grey = Grey { w, h, data: (0..w * h).map(|i| ((i * 7919) % 251) as f32).collect() };
        let one = |x: f64, y: f64| {
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
            let of = |(i, j): (f64, f64)| {
                let at = (x.floor() + i, y.floor() + j);
                let weight = (1.0 - (x - at.0).abs()) * (1.0 - (y - at.1).abs());
                weight * f64::from(grey.data[at.1 as usize * w + at.0 as usize])
            };
            corners.map(of).iter().sum::<f64>()
        };
        for (x, y) in [(1.0, 1.0), (3.25, 4.5), (6.75, 4.125), (4.0, 2.875)] {
            let slopes = [one(x + 1.0, y) - one(x - 1.0, y), one(x, y + 1.0) - one(x, y - 1.0)];
            let expected = [one(x, y), 0.5 * slopes[0], 0.5 * slopes[1]];
            let found = grey.read(x, y);
            for (e, f) in expected.iter().zip(found) {
                assert!((e - f64::from(f)).abs() < 1e-3, "({x}, {y}): {found:?} for {expected:?}");
            }
        }
    }
}
