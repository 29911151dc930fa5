//! How noise hangs together between pixels and colours behind a mosaic of filters.

use crate::plane::Plane;

/// Pixels that share noise are no further apart than this along either axis, px: each filled-in colour is made of
/// pixels up to two away.
pub(super) const APART: usize = 4;
/// Sides of the picture in which single pixels and rows are followed, px.
const SIDE: usize = 16;
/// The upper left of the four pixels that are looked at in it.
const MIDDLE: usize = 6;

/// By distance along a column and along a row, 0 to [`APART`]: what two places have in common of noise whose variance
/// was 1 and which was independent in each pixel; over the four pixels of a cell on average. Either direction is alike.
pub(super) type Table = [[f64; APART + 1]; APART + 1];

/// By pixel of a cell of four and by the colour ahead whose noise it is: what pairs of colours have in common in that
/// pixel, `[one][other]`.
pub type Origins = [[[[f64; 3]; 3]; 3]; 4];

/// What pairs of colours have in common: `[one][other]`.
#[derive(Clone, Debug)]
pub struct Spread {
    origins: Origins,
    /// Of noise that is new in each pixel.
    pixels: [[Table; 3]; 3],
    /// Of the noise of rows, by distance along a column, and whether the columns lie an even or an odd number apart.
    rows: [[[[f64; 2]; APART + 1]; 3]; 3],
}

impl Spread {
    /// Where no pixel has anything of another's.
    pub fn white() -> Self {
        let mut spread = Self::nothing();
        for c in 0..3 {
            spread.pixels[c][c][0][0] = 1.0;
            spread.origins.iter_mut().for_each(|pixel| pixel[c][c][c] = 1.0);
            // A row's noise is the same in all colours.
            (0..3).for_each(|other| spread.rows[c][other][0] = [1.0; 2]);
        }
        spread
    }

    /// Behind a step that is linear, reaches two px and repeats every two.
    pub fn behind(step: impl Fn(&Plane<f32>) -> Plane<f32>) -> Self {
        let mut spread = Self::nothing();
        let colours = || (0..9).map(|i| (i / 3, i % 3));
        let cell = || (0..4).map(|i| [MIDDLE + i % 2, MIDDLE + i / 2]);
        for (at, of) in (0..SIDE * SIDE).flat_map(|at| (0..3).map(move |of| (at, of))) {
            let noise =
                |x: usize, y: usize| [0, 1, 2].map(|c| f32::from(u8::from([y * SIDE + x, c] == [at, of])));
            let seen = step(&Plane::from_fn(SIDE, SIDE, noise));
            let value = |[x, y]: [usize; 2], c: usize| f64::from(seen.pixel(x, y)[c]);
            for ((a, b), (pixel, [x, y])) in colours().flat_map(|ab| cell().enumerate().map(move |p| (ab, p)))
            {
                spread.origins[pixel][of][a][b] += value([x, y], a) * value([x, y], b);
                for (dy, dx) in (0..=APART).flat_map(|dy| (0..=APART).map(move |dx| (dy, dx))) {
                    spread.pixels[a][b][dy][dx] += 0.25 * value([x, y], a) * value([x + dx, y + dy], b);
                }
            }
        }
        for of in 0..SIDE {
            let seen = step(&Plane::from_fn(SIDE, SIDE, |_, y| [f32::from(u8::from(y == of)); 3]));
            let value = |[x, y]: [usize; 2], c: usize| f64::from(seen.pixel(x, y)[c]);
            for ((a, b), [x, y]) in colours().flat_map(|ab| cell().map(move |p| (ab, p))) {
                for (dy, dx) in (0..=APART).flat_map(|dy| (0..2).map(move |dx| (dy, dx))) {
                    spread.rows[a][b][dy][dx] += 0.25 * value([x, y], a) * value([x + dx, y + dy], b);
                }
            }
        }
        spread
    }

    fn nothing() -> Self {
        Self { origins: Default::default(), pixels: Default::default(), rows: Default::default() }
    }

    /// See [`Origins`].
    pub(super) fn origins(&self) -> &Origins {
        &self.origins
    }

    /// What two mixtures of the colours have in common, by distance along a column and along a row.
    pub(super) fn of(&self, one: &[f64; 3], other: &[f64; 3]) -> Table {
        let mut sum = Table::default();
        for (a, b) in (0..9).map(|i| (i / 3, i % 3)) {
            for (to, from) in sum.iter_mut().flatten().zip(self.pixels[a][b].iter().flatten()) {
                *to += one[a] * other[b] * from;
            }
        }
        sum
    }

    /// The same of the noise of rows, by distance along a column and whether columns lie an odd number apart.
    pub(super) fn of_rows(&self, one: &[f64; 3], other: &[f64; 3]) -> [[f64; 2]; APART + 1] {
        let mut sum = [[0.0; 2]; APART + 1];
        for (a, b) in (0..9).map(|i| (i / 3, i % 3)) {
            for (to, from) in sum.iter_mut().flatten().zip(self.rows[a][b].iter().flatten()) {
                *to += one[a] * other[b] * from;
            }
        }
        sum
    }
}
