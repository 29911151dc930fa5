//! All that mixes the pixels of a camera, and what it makes of noise.

use std::sync::LazyLock;

use super::filter::{Filter, only};
use super::mixing::Mixing;
use super::moments::Moments;
use super::spread::{Origins, Spread};
use super::{Effect, Settings};
use crate::plane::stats::LUMA;

/// A mosaic, filters behind it, and colour that blocks share behind those. They are taken together: what a filter
/// removes the next cannot raise, and what a mosaic spreads a filter does not average away.
pub struct Mixed {
    spread: &'static Spread,
    filter: Filter,
    /// Columns and rows of the blocks.
    block: Option<[usize; 2]>,
}

static WHITE: LazyLock<Spread> = LazyLock::new(Spread::white);

/// What the effects of a camera that mix pixels leave of white noise.
pub fn mixing(effects: &[&dyn Effect], settings: &Settings) -> Mixing {
    Mixed::of(effects, settings).mixing()
}

impl Mixed {
    /// Of a camera.
    pub fn of(effects: &[&dyn Effect], settings: &Settings) -> Self {
        let mut mixed = Self { spread: &WHITE, filter: Filter::none(), block: None };
        for effect in effects.iter().filter(|e| e.variant(settings) != 0) {
            match effect.moments() {
                Moments::Mosaic(of) => mixed.spread = of(settings),
                Moments::Filter(of) => mixed.filter = mixed.filter.then(&of(settings)),
                Moments::Shares(of) => mixed.block = Some(of(settings)),
                _ => {}
            }
        }
        mixed
    }

    /// Whose noise a mosaic gives each colour, ahead of all filters; each its own without one.
    pub fn origins(&self) -> &'static Origins {
        self.spread.origins()
    }

    /// Whether nothing mixes pixels.
    pub fn is_none(&self) -> bool {
        self.keeps_neighbours_apart() && self.block.is_none()
    }

    /// Whether noise is white ahead of what blocks share.
    fn keeps_neighbours_apart(&self) -> bool {
        std::ptr::eq(self.spread, &raw const *WHITE) && self.filter.is_none()
    }

    /// What is left of noise that was as much in each colour.
    pub fn mixing(&self) -> Mixing {
        let mixing =
            if self.keeps_neighbours_apart() { Mixing::NONE } else { self.filter.mixing(self.spread) };
        let shared = self.block.map(|block| {
            let behind = [0, 1, 2].map(only).map(|c| self.filter.in_common(self.spread, block, [&c; 2]));
            shared((block[0] * block[1]) as f64, mixing.pixel.map(f64::from), behind)
        });
        Mixing { shared, ..mixing }
    }

    /// What two mixtures of the colours have in common in a pixel, of noise whose variance was 1 in each colour.
    pub fn common(&self, one: &[f64; 3], other: &[f64; 3]) -> f64 {
        self.filter.in_common(self.spread, self.block.unwrap_or([1, 1]), [one, other])
    }

    /// Variance of a mixture of the colours in each product of two waves, of which the first, along a row, changes
    /// fastest; of noise whose variance was 1 in each colour. `waves`: by frequency and place.
    pub fn spectrum<const N: usize>(&self, mixture: &[f64; 3], waves: &[[f64; N]; N]) -> Vec<f64> {
        self.filter.spectrum(self.spread, self.block.unwrap_or([1, 1]), mixture, waves)
    }

    /// The same of the noise of rows, which was 1 and is the same in all colours: in products of the first wave along a
    /// row with each along a column.
    pub fn row_spectrum<const N: usize>(&self, mixture: &[f64; 3], waves: &[[f64; N]; N]) -> [f64; N] {
        self.filter.row_spectrum(self.spread, self.block.unwrap_or([1, 1]), mixture, waves)
    }
}

/// What each colour has of each colour's variance, `[of][from]`, where `n` pixels share the differences to luma. Of
/// independent pixels it keeps its own brightness and the mean over n of its difference; `ahead` and `behind` are the
/// variances of pixels that are not, before and after.
fn shared(n: f64, ahead: [f64; 3], behind: [f64; 3]) -> [[f32; 3]; 3] {
    let weight = |of: usize, from: usize| {
        let luma = f64::from(LUMA[from]);
        let difference = if of == from { 1.0 - luma } else { -luma };
        (luma + difference / n).powi(2) + (n - 1.0) * (difference / n).powi(2)
    };
    [0, 1, 2].map(|of| {
        let independent: f64 = (0..3).map(|from| weight(of, from) * ahead[from]).sum();
        [0, 1, 2].map(|from| (weight(of, from) * behind[of] / independent) as f32)
    })
}
