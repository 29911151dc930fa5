//! Displacement per block, as by Lucas and Kanade, along each block's dominant gradient.

use super::filter::gaussian;
use shutterbug::plane::Plane;

/// Side of a block, px.
pub(super) const BLOCK_PX: usize = 32;

/// Calls `f` with the pixel indices of every whole block.
pub(super) fn for_each_block(
    width: usize,
    height: usize,
    mut f: impl FnMut(&mut dyn Iterator<Item = usize>),
) {
    for by in 0..height / BLOCK_PX {
        for bx in 0..width / BLOCK_PX {
            let start = by * BLOCK_PX * width + bx * BLOCK_PX;
            f(&mut (0..BLOCK_PX * BLOCK_PX).map(|i| start + i / BLOCK_PX * width + i % BLOCK_PX));
        }
    }
}

#[derive(Clone, Copy)]
pub(super) struct Block {
    pub(super) displacement_px: f64,
    pub(super) sigma_px: f64,
    pub(super) textured: bool,
}

impl Block {
    pub(super) fn displaced(&self) -> bool {
        self.textured && self.displacement_px.abs() > (5.0 * self.sigma_px).max(0.1)
    }
}

pub(super) struct Blocks {
    pub(super) all: Vec<Block>,
    across: usize,
}

impl Blocks {
    /// Displacement at a pixel, px, where its block tells one.
    pub(super) fn at(&self, x: usize, y: usize) -> Option<f64> {
        let (bx, by) = (x / BLOCK_PX, y / BLOCK_PX);
        let block = self.all.get(by * self.across + bx).filter(|_| bx < self.across)?;
        block.textured.then_some(block.displacement_px)
    }

    /// Displacement of each block along its dominant gradient.
    pub(super) fn measure([a, b]: &[Plane<f32>; 2]) -> Self {
        let (a, b) = (gaussian(&luma(a), 1.5), gaussian(&luma(b), 1.5));
        let mut sums: Vec<[f64; 6]> = Vec::new();
        for_each_block(a.width, a.height, |pixels| {
            let mut s = [0.0f64; 6];
            let mut mean_d = 0.0;
            let mut all = Vec::with_capacity(BLOCK_PX * BLOCK_PX);
            for i in pixels {
                let (x, y) = (i % a.width, i / a.width);
                if x == 0 || y == 0 || x + 1 == a.width || y + 1 == a.height {
                    continue;
                }
                let mean = |j: usize| f64::from(a.data[j] + b.data[j]);
                let d = f64::from(b.data[i] - a.data[i]);
                let gx = 0.25 * (mean(i + 1) - mean(i - 1));
                let gy = 0.25 * (mean(i + a.width) - mean(i - a.width));
                mean_d += d;
                all.push((gx, gy, d));
            }
            mean_d /= all.len() as f64;
            for (gx, gy, d) in &all {
                let d = d - mean_d;
                let add = [gx * gx, gx * gy, gy * gy, gx * d, gy * d, d * d];
                s.iter_mut().zip(add).for_each(|(s, v)| *s += v);
            }
            sums.push(s);
        });
        let noise = Self::noise_variance(&sums);
        // Pixels that act as one after the smoothing, with some for noise that was smooth before.
        let together = 4.0 * std::f64::consts::PI * (1.5f64.powi(2) + 1.0);
        let all = sums.iter().map(|s| {
            let [xx, xy, yy, xd, yd, _] = *s;
            let half = 0.5 * (xx - yy);
            let root = half.hypot(xy);
            let energy = 0.5 * (xx + yy) + root;
            let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
            // Content that moved by v gives b - a = -v g.
            let displacement_px = -(xd * angle.cos() + yd * angle.sin()) / energy.max(1e-12);
            let sigma_px = (noise * together / energy.max(1e-12)).sqrt();
            Block { displacement_px, sigma_px, textured: sigma_px < 0.05 }
        });
        Self { all: all.collect(), across: a.width / BLOCK_PX }
    }

    /// Variance of the smoothed difference where there is the least texture, less what a displacement of the block
    /// explains: in a scene that moved as a whole there is no block without.
    fn noise_variance(sums: &[[f64; 6]]) -> f64 {
        let mut by_texture: Vec<_> = sums.iter().collect();
        by_texture.sort_by(|p, q| (p[0] + p[2]).total_cmp(&(q[0] + q[2])));
        let quiet = &by_texture[..by_texture.len().div_ceil(3)];
        let unexplained = |&&[xx, xy, yy, xd, yd, dd]: &&[f64; 6]| {
            let determinant = xx * yy - xy * xy;
            let explained = (yy * xd * xd - 2.0 * xy * xd * yd + xx * yd * yd) / determinant.max(1e-300);
            (dd - explained.min(dd)) / (BLOCK_PX * BLOCK_PX) as f64
        };
        let variances: Vec<f64> = quiet.iter().map(unexplained).filter(|v| *v > 0.0).collect();
        percentile(&variances, 0.5).max(1e-9)
    }
}

pub(super) fn luma(plane: &Plane<f32>) -> Plane<f32> {
    let data = plane.data.chunks_exact(3).map(|p| 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]).collect();
    Plane { width: plane.width, height: plane.height, channels: 1, data }
}

/// The value below which a share of `values` lies; 0 of none.
pub fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0) * share).round().max(0.0) as usize).copied().unwrap_or(0.0)
}
