//! What effects do to the mean and the spread of values: beside its kernel and twin an effect says how noise comes in,
//! is bent, mixed and rounded. `reference::moments` runs the list.

use super::filter::Filter;
use super::spread::Spread;
use super::{Parameters, Settings, View};

/// Variances of one value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variances {
    /// New in every pixel and frame.
    pub free: f32,
    /// The same for a whole row.
    pub row: f32,
    /// The same in every frame.
    pub fixed: f32,
}

impl Variances {
    /// Standard deviation of all of them.
    pub fn width(&self) -> f32 {
        (self.free + self.row + self.fixed).sqrt()
    }

    /// The sum, each times a factor.
    pub fn plus(self, share: f32, other: &Self) -> Self {
        let sum = |a: f32, b: f32| a + share * b;
        Self {
            free: sum(self.free, other.free),
            row: sum(self.row, other.row),
            fixed: sum(self.fixed, other.fixed),
        }
    }
}

/// Noise that an effect adds: variances of a value x as polynomials 1, x, x^2 of it (x at least 0), fractions of full
/// scale.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// As in [`Variances`].
    pub free: [f64; 3],
    /// As in [`Variances`].
    pub row: [f64; 3],
    /// As in [`Variances`].
    pub fixed: [f64; 3],
}

impl Noise {
    /// Two noises, independent of each other.
    pub fn plus(&self, other: &Self) -> Self {
        let sum = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] + b[i]);
        Self {
            free: sum(self.free, other.free),
            row: sum(self.row, other.row),
            fixed: sum(self.fixed, other.fixed),
        }
    }

    /// Whether there is any.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }

    /// Variances of the value `x`.
    pub fn at(&self, x: f32) -> Variances {
        let x = x.max(0.0);
        let of = |p: &[f64; 3]| p[0] as f32 + x * (p[1] as f32 + x * p[2] as f32);
        Variances { free: of(&self.free), row: of(&self.row), fixed: of(&self.fixed) }
    }
}

/// What an effect does to the mean and the spread of values.
#[derive(Clone, Copy)]
pub enum Moments {
    /// Nothing to the spread: it acts where there is no noise yet, and the mean is what its twin makes of it.
    Twin,
    /// To each value a factor that depends on the place: those of a row's pixels.
    Light(fn(&Parameters<'_>, &View, usize, &mut [f32])),
    /// To each value a factor and a term, by channel.
    Affine(fn(&Settings, &View) -> [[f64; 2]; 3]),
    /// Adds noise, by channel; the mean stays.
    Noise(fn(&Settings) -> [Noise; 3]),
    /// Holds single pixels at full scale. Which ones is found place by place; it spreads nothing over the others.
    Stuck,
    /// Bends each value alone: the mean and the spread are integrals of its twin over the noise.
    Curve,
    /// Makes each colour of all three: `[of][from]`.
    Colors(fn(&Settings) -> [[f64; 3]; 3]),
    /// Fills in the colours that a mosaic leaves out: noise of one pixel and colour gets into others.
    Mosaic(fn(&Settings) -> &'static Spread),
    /// Filters, alike in all places: several filters are one.
    Filter(fn(&Settings) -> Filter),
    /// Makes the colours' difference to luma one in blocks of so many columns and rows.
    Shares(fn(&Settings) -> [usize; 2]),
    /// Rounds to multiples of this step.
    Steps(fn(&Settings) -> f64),
    /// Rounds the coefficients of blocks, at this quality.
    File(fn(&Settings) -> u8),
}

impl Moments {
    /// Whether it mixes pixels, and no more.
    pub fn mixes(&self) -> bool {
        matches!(self, Self::Mosaic(_) | Self::Filter(_) | Self::Shares(_))
    }

    /// Whether it makes noise, and leaves the mean of all but single pixels as it is.
    pub fn is_noise(&self) -> bool {
        matches!(self, Self::Noise(_) | Self::Stuck)
    }
}
