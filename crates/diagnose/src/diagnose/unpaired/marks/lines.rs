//! What the pixels of a row, or of a column, have in common.

use std::collections::HashMap;

use super::blocks::{BLOCK_PX, Block};
use super::{FEWEST_BLOCKS, HIGH_PASS, LINEAR, LINES, Mark};

/// Blocks of one line of blocks that do not overlap: sums of their values by line of pixels, of the squares, and their
/// number.
#[derive(Clone, Copy, Default)]
struct Band {
    sums: [f64; BLOCK_PX],
    squares: f64,
    count: f64,
}

impl Band {
    fn add(&mut self, lines: &[f64; BLOCK_PX]) {
        for (sum, v) in self.sums.iter_mut().zip(lines) {
            *sum += v;
            self.squares += v * v;
        }
        self.count += 1.0;
    }

    /// Sum of the products of all pairs of different blocks, a line of pixels, and the number of pairs.
    fn pairs(&self) -> [f64; 2] {
        let all: f64 = self.sums.iter().map(|s| s * s).sum();
        [(all - self.squares) / BLOCK_PX as f64, self.count * (self.count - 1.0)]
    }
}

/// Variance of what the pixels of a row, or of a column, have in common: products of flat blocks beside each other, so
/// that the pixels' own noise has no part in it. All pairs of a band count: texture that goes on from one block to the
/// next does not go on across the picture.
pub(super) fn line_marks(flat: &[&Block], out: &mut [Mark]) {
    for k in 0..2 {
        let mut bands: HashMap<[usize; 2], Band> = HashMap::new();
        for b in flat {
            let (along, line) = (b.at[k], b.at[1 - k]);
            // Neighbouring blocks overlap by half: every other one is a band of its own.
            bands.entry([line, along % 2]).or_default().add(if k == 0 { &b.rows } else { &b.columns });
        }
        let pairs = bands.values().map(Band::pairs).fold([0.0; 2], |a, p| [a[0] + p[0], a[1] + p[1]]);
        if pairs[1] >= FEWEST_BLOCKS as f64 {
            out[LINES[k]] = Some([LINEAR * pairs[0] / pairs[1] / HIGH_PASS, pairs[1].sqrt()]);
        }
    }
}
