//! Where the samples of a picture behind a lens come from: each is traced back to the ideal picture by the inverse of
//! the lens, in double precision. No vertex is moved and nothing is cut: what a ray meets is what is seen.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::window::Window;
use crate::camera::{Intrinsics, Lens};

/// Pixels a side of the blocks by which a region of the ideal picture is found.
const BLOCK: u32 = 8;

/// Ideal positions of all samples of a picture.
#[derive(Clone, Debug)]
pub struct LensGrid {
    width: u32,
    samples: usize,
    /// `[height, width, samples]`, px; NaN where no ray falls on the sample.
    ideal_px: Vec<DVec2>,
    /// Columns, rows, smallest and largest ideal position of each block.
    blocks: Vec<(Range<u32>, Range<u32>, DVec2, DVec2)>,
}

impl LensGrid {
    /// The samples (places inside a pixel) of a lens's picture, drawn `magnification` times larger about (cx, cy): what
    /// lateral chromatic aberration does to one colour.
    pub fn new(lens: &Lens, samples: &[[f32; 2]], magnification: f64) -> Self {
        let k: &Intrinsics = lens.intrinsics();
        let axis = DVec2::new(k.cx, k.cy);
        let (width, count) = (k.width as usize, samples.len());
        let mut ideal_px = vec![DVec2::NAN; width * k.height as usize * count];
        ideal_px.par_chunks_mut(width * count).enumerate().for_each(|(y, row)| {
            for (i, ideal) in row.iter_mut().enumerate() {
                let [sx, sy] = samples[i % count].map(f64::from);
                let px = DVec2::new((i / count) as f64 + sx, y as f64 + sy);
                let seen = axis + (px - axis) / magnification;
                *ideal = lens.undistort_px(seen).unwrap_or(DVec2::NAN);
            }
        });
        let mut grid = Self { width: k.width, samples: count, ideal_px, blocks: Vec::new() };
        for y in (0..k.height).step_by(BLOCK as usize) {
            for x in (0..k.width).step_by(BLOCK as usize) {
                let (columns, rows) = (x..(x + BLOCK).min(k.width), y..(y + BLOCK).min(k.height));
                let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                for (row, column) in rows.clone().flat_map(|r| columns.clone().map(move |c| (r, c))) {
                    // `min` and `max` pass over NaN.
                    for ideal in grid.of_pixel(column, row).iter().filter(|p| p.is_finite()) {
                        (low, high) = (low.min(*ideal), high.max(*ideal));
                    }
                }
                grid.blocks.push((columns, rows, low, high));
            }
        }
        grid
    }

    /// Ideal positions of a pixel's samples, px.
    pub fn of_pixel(&self, x: u32, y: u32) -> &[DVec2] {
        let at = (y as usize * self.width as usize + x as usize) * self.samples;
        &self.ideal_px[at..at + self.samples]
    }

    /// Columns and rows that hold all pixels of a window whose samples come from a rectangle of the ideal picture;
    /// `None`: there are none.
    pub(super) fn touched(
        &self,
        low: DVec2,
        high: DVec2,
        window: Window,
    ) -> Option<(Range<u32>, Range<u32>)> {
        let hit = |b: &&(Range<u32>, Range<u32>, DVec2, DVec2)| b.2.cmple(high).all() && b.3.cmpge(low).all();
        let all = self.blocks.iter().filter(hit).fold(None, |all, (columns, rows, ..)| {
            let (c, r): (Range<u32>, Range<u32>) = all.unwrap_or((columns.clone(), rows.clone()));
            Some((
                c.start.min(columns.start)..c.end.max(columns.end),
                r.start.min(rows.start)..r.end.max(rows.end),
            ))
        });
        let within = |range: Range<u32>, first: u32, count: u32| {
            let range = range.start.max(first)..range.end.min(first + count);
            (range.start < range.end).then_some(range)
        };
        let (columns, rows) = all?;
        Some((within(columns, window.x, window.width)?, within(rows, window.y, window.height)?))
    }
}

/// Where samples stand in the ideal picture.
pub(super) enum Places<'a> {
    /// The same in every pixel.
    Pinhole(Vec<DVec2>),
    /// Traced back.
    Lens(&'a LensGrid),
}

impl Places<'_> {
    /// Samples a pixel.
    pub fn count(&self) -> usize {
        match self {
            Self::Pinhole(samples) => samples.len(),
            Self::Lens(grid) => grid.samples,
        }
    }

    /// Ideal position of a sample of pixel (x, y), px.
    pub fn at(&self, x: u32, y: u32, sample: usize) -> DVec2 {
        match self {
            Self::Pinhole(samples) => DVec2::new(f64::from(x), f64::from(y)) + samples[sample],
            Self::Lens(grid) => grid.of_pixel(x, y)[sample],
        }
    }
}
