//! What steps that mix pixels leave of noise.

use crate::plane::Plane;

/// What is left of the variance of white noise, by statistic: shares of what white noise would give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Of single pixels.
    pub pixel: f32,
    /// Of differences along the row, by their distance of 2 and 4 px.
    pub high_pass: [f32; 2],
    /// Of differences of means over blocks of 2, 4 and 8 px.
    pub bands: [f32; 3],
    /// Of means of rows, and of columns.
    pub lines: [f32; 2],
}

impl Left {
    /// All of the noise.
    pub const ALL: Self = Self { pixel: 1.0, high_pass: [1.0; 2], bands: [1.0; 3], lines: [1.0; 2] };

    fn each(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            pixel: f(self.pixel, other.pixel),
            high_pass: [0, 1].map(|i| f(self.high_pass[i], other.high_pass[i])),
            bands: [0, 1, 2].map(|i| f(self.bands[i], other.bands[i])),
            lines: [0, 1].map(|i| f(self.lines[i], other.lines[i])),
        }
    }

    /// What two steps leave one after the other.
    pub fn times(&self, other: &Self) -> Self {
        self.each(other, |a, b| a * b)
    }

    /// Between the two.
    pub fn mix(&self, other: &Self, t: f32) -> Self {
        self.each(other, |a, b| a * (1.0 - t) + b * t)
    }

    /// Rounding of little noise makes more of it than there was; beyond a limit that is no share of anything.
    pub fn at_most(&self, most: f32) -> Self {
        self.each(self, |v, _| v.min(most))
    }
}

/// What a step that mixes pixels, linearly, leaves of noise that is white before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixing {
    /// Share of the variance of a pixel, by channel.
    pub pixel: [f32; 3],
    /// Share of the variance of the noise of rows in a pixel, by channel.
    pub row: [f32; 3],
    /// The same in the mean of a row over its colours, about rows that are not its neighbours.
    pub row_seen: f32,
    /// By channel: of means over blocks and lines, over what the pixels' own variance behind the step would give them.
    pub left: [Left; 3],
    /// Where colours are mixed with it: what of each colour's variance each colour has, `[of][from]`.
    pub shared: Option<[[f32; 3]; 3]>,
}

impl Mixing {
    /// None.
    pub const NONE: Self =
        Self { pixel: [1.0; 3], row: [1.0; 3], row_seen: 1.0, left: [Left::ALL; 3], shared: None };

    /// One step behind the other, as if the noise were white between them.
    pub fn then(&self, next: &Self) -> Self {
        let times = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|c| a[c] * b[c]);
        Self {
            pixel: times(self.pixel, next.pixel),
            row: times(self.row, next.row),
            row_seen: self.row_seen * next.row_seen,
            left: [0, 1, 2].map(|c| self.left[c].times(&next.left[c])),
            shared: next.shared.or(self.shared),
        }
    }
}

/// Sides of the blocks of [`Left::bands`], px.
pub const BANDS: [usize; 3] = [2, 4, 8];
/// Rows of the picture in which impulses are followed, px: the largest block's neighbourhood and what reaches into it.
const SIDE: usize = 20;
/// Where blocks begin in it, px.
const FROM: usize = 2;

/// Of a filter whose weights reach two px and repeat every two: variances are sums of squares of what single impulses
/// become.
pub fn mixing_of(filter: impl Fn(&Plane<f32>) -> Plane<f32>) -> Mixing {
    let middle = SIDE / 2;
    let mean = |seen: &Plane<f32>, from: [usize; 2], size: [usize; 2], c: usize| -> f64 {
        let values =
            (from[1]..from[1] + size[1]).flat_map(|y| (from[0]..from[0] + size[0]).map(move |x| (x, y)));
        let sum: f32 = values.map(|(x, y)| seen.pixel(x, y)[c]).sum();
        f64::from(sum) / (size[0] * size[1]) as f64
    };
    let cell = |seen: &Plane<f32>, c: usize| -> f64 {
        let places = (0..4).map(|i| seen.pixel(middle + i % 2, middle + i / 2)[c]);
        places.map(|v| 0.25 * f64::from(v * v)).sum()
    };
    let mut sums = [[0.0f64; 3]; 6];
    for at in 0..SIDE * SIDE {
        let seen = filter(&Plane::from_fn(SIDE, SIDE, |x, y| [f32::from(u8::from(y * SIDE + x == at)); 3]));
        for c in 0..3 {
            for (band, n) in BANDS.into_iter().enumerate() {
                let off = mean(&seen, [FROM; 2], [n; 2], c) - mean(&seen, [FROM; 2], [2 * n; 2], c);
                sums[band][c] += off.powi(2) / 0.75 * (n * n) as f64;
            }
            // Lines with and without the colour.
            let length = SIDE - 2 * FROM;
            for line in [8, 9] {
                sums[3][c] += 0.5 * mean(&seen, [FROM, line], [length, 1], c).powi(2) * length as f64;
                sums[4][c] += 0.5 * mean(&seen, [line, FROM], [1, length], c).powi(2) * length as f64;
            }
            sums[5][c] += cell(&seen, c);
        }
    }
    let (mut row, mut row_seen) = ([0.0f64; 3], 0.0f64);
    for of in 0..SIDE {
        let seen = filter(&Plane::from_fn(SIDE, SIDE, |_, y| [f32::from(u8::from(y == of)); 3]));
        (0..3).for_each(|c| row[c] += cell(&seen, c));
        for line in [middle, middle + 1] {
            let all: f64 = (0..3).map(|c| mean(&seen, [middle, line], [2, 1], c)).sum();
            row_seen += 0.5 * (all / 3.0).powi(2);
        }
    }
    let left = [0, 1, 2].map(|c| {
        let of = |k: usize| (sums[k][c] / sums[5][c]) as f32;
        Left { bands: [0, 1, 2].map(of), lines: [3, 4].map(of), ..Left::ALL }
    });
    Mixing {
        pixel: sums[5].map(|v| v as f32),
        row: row.map(|v| v as f32),
        row_seen: row_seen as f32,
        left,
        shared: None,
    }
}
