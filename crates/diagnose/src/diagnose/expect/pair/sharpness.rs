//! Pictures of unlike sharpness lie on each other all the same: before displacements are measured, one is made as soft
//! or as sharp as the other. Else an edge that is blurred at the rim of a window looks as if it had moved.

use rayon::prelude::*;

use super::field::{Field, covariances};
use super::grey::Grey;
use crate::diagnose::expect::linear::solve;

/// Blurred copies that a picture's sharpness is mixed from: about one and two px, along rows and along columns.
const COPIES: usize = 4;
/// Pixels that are looked at in a window: five numbers are wanted of the whole picture.
const WINDOW_PX: usize = 1 << 10;
/// Times that the gain of each window and the sharpness of the whole are worked out, each from the other.
const ROUNDS: usize = 3;
/// Share of its own curvature that is added to that of a copy's part.
const RIDGE: f64 = 1e-3;

/// A picture and what each blur changes of it.
pub(super) struct Blurred<'a> {
    plain: &'a Grey,
    changes: [Grey; COPIES],
}

/// Covariances in a window of the other picture, this one and the changes.
type Products = [[f64; COPIES + 2]; COPIES + 2];

/// Variances in a window of the other picture and of this one as it is mixed, and their covariance.
struct Mixed {
    other: f64,
    own: f64,
    both: f64,
}

impl Mixed {
    fn of(p: &Products, parts: &[f64; COPIES]) -> Self {
        let of = |i: usize| p[i][1] + (0..COPIES).map(|k| parts[k] * p[i][k + 2]).sum::<f64>();
        let own = of(1) + (0..COPIES).map(|k| parts[k] * of(k + 2)).sum::<f64>();
        Self { other: p[0][0], own, both: of(0) }
    }

    /// The gain that fits best, and how well it is known.
    fn gain(&self) -> (f64, f64) {
        let gain = self.both / self.own.max(1e-9);
        (gain, if gain > 0.0 { self.own / self.rest(gain).max(0.1) } else { 0.0 })
    }

    fn rest(&self, gain: f64) -> f64 {
        self.other - 2.0 * gain * self.both + gain * gain * self.own
    }
}

impl<'a> Blurred<'a> {
    pub(super) fn of(plain: &'a Grey) -> Self {
        let along = |rows: bool| {
            let once = plain.softened(1, rows);
            let twice = once.softened(2, rows);
            [once, twice]
        };
        let [a, b] = along(true);
        let [c, d] = along(false);
        let mut changes = [a, b, c, d];
        for change in &mut changes {
            change.data.par_iter_mut().zip(&plain.data).for_each(|(c, p)| *c -= p);
        }
        Self { plain, changes }
    }

    /// This picture, as sharp as the other one, which lies on it as `field` says.
    pub(super) fn as_sharp_as(&self, other: &Grey, field: &Field) -> Grey {
        let parts = self.parts(other, field);
        let mut out = self.plain.clone();
        for (change, part) in self.changes.iter().zip(parts) {
            out.data.par_iter_mut().zip(&change.data).for_each(|(o, c)| *o += part as f32 * c);
        }
        out
    }

    /// How much of each change makes it so.
    fn parts(&self, other: &Grey, field: &Field) -> [f64; COPIES] {
        let all: Vec<Products> =
            (0..field.len()).into_par_iter().map(|i| self.products(other, field, i)).collect();
        let mut parts = [0.0; COPIES];
        for _ in 0..ROUNDS {
            let mut a = vec![vec![0.0; COPIES]; COPIES];
            let mut b = vec![0.0; COPIES];
            let mixes: Vec<Mixed> = all.iter().map(|p| Mixed::of(p, &parts)).collect();
            let gains = field.smoothed(&mixes.iter().map(Mixed::gain).collect::<Vec<_>>());
            for ((p, mixed), gain) in all.iter().zip(&mixes).zip(gains) {
                let weight = 1.0 / mixed.rest(gain).max(0.1);
                for j in 0..COPIES {
                    (0..COPIES).for_each(|k| a[j][k] += weight * gain * gain * p[j + 2][k + 2]);
                    b[j] += weight * gain * (p[j + 2][0] - gain * p[j + 2][1]);
                }
            }
            let Some(solved) = solve(&a, &b, RIDGE) else { return parts };
            parts = std::array::from_fn(|k| solved[k]);
        }
        parts
    }

    fn products(&self, other: &Grey, field: &Field, i: usize) -> Products {
        let [columns, rows] = field.range(i, (other.w, other.h), 0.5);
        let every = (columns.len() * rows.len()).div_ceil(WINDOW_PX).isqrt().max(1);
        let mut seen: Vec<[f64; COPIES + 2]> = Vec::new();
        for (x, y) in rows.step_by(every).flat_map(|y| columns.clone().step_by(every).map(move |x| (x, y))) {
            let [u, v] = field.read(x as f64, y as f64, (other.w, other.h));
            let (px, py) = (x as f64 + u, y as f64 + v);
            if px < 1.0 || py < 1.0 || px >= other.w as f64 - 2.0 || py >= other.h as f64 - 2.0 {
                continue;
            }
            seen.push(std::array::from_fn(|k| {
                f64::from(match k {
                    0 => other.data[y * other.w + x],
                    1 => self.plain.value(px, py),
                    _ => self.changes[k - 2].value(px, py),
                })
            }));
        }
        if seen.len() < 12 { [[0.0; COPIES + 2]; COPIES + 2] } else { covariances(&seen) }
    }
}
