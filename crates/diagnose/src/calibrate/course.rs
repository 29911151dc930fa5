//! Whether an edge runs straight through its part of the picture, from end to end: in every line of pixels, how much of
//! the way across is bright says where the edge crosses it, however sharp it is.

use std::ops::Range;

use super::frames::Encoding;
use shutterbug::plane::Plane;

/// Half of the way across about the edge's line in which the crossing is looked for, and the width of the strips beyond
/// from which the two sides are taken, px. Small windows must hold them.
pub(super) const REACH_PX: f64 = 4.0;
const SIDE_PX: f64 = 3.0;
/// Lines over which the two sides are taken together: light and surface may change along the edge.
const BLOCK: usize = 4;
/// Standard deviations of chance beyond which something is there.
const CLEAR: f64 = 3.0;

/// The line of an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Whether it is nearer to upright: then lines of pixels are rows, else columns.
    pub upright: bool,
    /// Where it crosses the first line of pixels, and how much further it crosses each next one, px.
    pub start: f64,
    /// See `start`.
    pub slant: f64,
}

/// How an edge runs.
#[derive(Clone, Debug)]
pub(super) struct Course {
    /// The lines of pixels in which both sides of the edge are in the picture's part.
    pub lines: Range<usize>,
    /// What it leaves its line by, beyond noise: standard deviation along the normal, px.
    pub bend_px: f64,
}

/// Sums over lines of pixels: of the dark strip, of the bright one, and of what lies between.
#[derive(Clone, Debug, Default)]
struct Block {
    strips: [Vec<f64>; 2],
    between: Vec<f64>,
}

impl Block {
    /// Mean of a strip, and the variance of its pixels.
    fn strip(&self, side: usize) -> [f64; 2] {
        let values = &self.strips[side];
        let n = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / n;
        [mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)]
    }

    /// Difference of both sides, and its standard deviation.
    fn contrast(&self) -> [f64; 2] {
        let ([first, a], [second, b]) = (self.strip(0), self.strip(1));
        let [n, m] = [0, 1].map(|side| self.strips[side].len().max(1) as f64);
        [second - first, (a / n + b / m).sqrt()]
    }
}

impl Line {
    /// Follows the edge through its lines.
    ///
    /// # Errors
    /// What is found instead of an edge that runs through.
    pub(super) fn course(
        &self,
        picture: &Plane<f32>,
        [x0, y0, w, h]: [usize; 4],
        encoding: Encoding,
    ) -> Result<Course, String> {
        let (across, lines) = if self.upright { (w, h) } else { (h, w) };
        let light = |i: usize, line: usize| {
            let (x, y) = if self.upright { (x0 + i, y0 + line) } else { (x0 + line, y0 + i) };
            let p = picture.pixel(x, y);
            p.iter().map(|v| f64::from(encoding.decode(*v))).sum::<f64>() / p.len() as f64
        };
        let reach = REACH_PX + SIDE_PX;
        let crossing = |line: usize| self.start + self.slant * line as f64;
        let inside = |line: &usize| (reach..=across as f64 - reach).contains(&crossing(*line));
        let whole: Vec<usize> = (0..lines).filter(inside).collect();
        if whole.len() * 2 < lines {
            return Err(format!(
                "an edge whose sides, {reach} px of both, are inside in {} of {lines} lines of pixels alone",
                whole.len()
            ));
        }
        let blocks: Vec<Block> = whole
            .chunks_exact(BLOCK)
            .map(|lines| block(lines.iter().map(|line| (*line, crossing(*line))), across, &light))
            .collect();
        runs_through(&blocks)?;
        let lines = whole[0]..whole[0] + BLOCK * blocks.len();
        Ok(Course { lines, bend_px: bend(&blocks) / (1.0 + self.slant * self.slant).sqrt() })
    }
}

/// Sums over lines with the places where the edge crosses them.
fn block(
    lines: impl Iterator<Item = (usize, f64)>,
    across: usize,
    light: &dyn Fn(usize, usize) -> f64,
) -> Block {
    let mut sums = Block::default();
    for (line, crossing) in lines {
        let mut between = 0.0;
        for i in 0..across {
            let off = i as f64 + 0.5 - crossing;
            if off.abs() > REACH_PX + SIDE_PX {
                continue;
            }
            // The part of the pixel that lies in reach.
            let part = (REACH_PX + 0.5 - off.abs()).clamp(0.0, 1.0);
            if part > 0.0 {
                between += part * light(i, line);
            } else {
                sums.strips[usize::from(off > 0.0)].push(light(i, line));
            }
        }
        sums.between.push(between / (2.0 * REACH_PX));
    }
    sums
}

/// Whether there is an edge in all blocks: both sides differ, and by at least half of what they do where they do most.
fn runs_through(blocks: &[Block]) -> Result<(), String> {
    let contrasts: Vec<[f64; 2]> = blocks.iter().map(Block::contrast).collect();
    let [sum, square] =
        contrasts.iter().fold([0.0; 2], |[sum, square], c| [sum + c[0], square + c[1] * c[1]]);
    if sum.abs() <= CLEAR * square.sqrt() {
        return Err("no edge, but noise".to_owned());
    }
    let most = contrasts.iter().map(|c| c[0]).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let lacks = |c: &&[f64; 2]| c[0] * most.signum() + CLEAR * c[1] < 0.5 * most.abs();
    let without = contrasts.iter().filter(lacks).count();
    if without == 0 {
        return Ok(());
    }
    let all = BLOCK * contrasts.len();
    Err(format!("an edge that is in {} of {all} lines of pixels alone", all - BLOCK * without))
}

/// Standard deviation of where the lines are crossed, beyond noise and chance, px across.
fn bend(blocks: &[Block]) -> f64 {
    let mut all: Vec<[f64; 2]> = Vec::new();
    for block in blocks {
        let ([first, a], [second, b]) = (block.strip(0), block.strip(1));
        let contrast = second - first;
        let noise = 0.5 * (a + b) / (contrast * contrast).max(1e-300);
        // Of the values between, and of the sides, which count by half each.
        let of_sides: f64 = block.strips.iter().map(|s| 0.25 / s.len().max(1) as f64).sum();
        let variance = (2.0 * REACH_PX).powi(2) * noise * (0.5 / REACH_PX + of_sides);
        let place = |v: &f64| REACH_PX * (1.0 - 2.0 * (v - first) / contrast);
        all.extend(block.between.iter().map(|v| [place(v), variance]));
    }
    let n = all.len() as f64;
    let mean = all.iter().map(|p| p[0]).sum::<f64>() / n;
    let spread = all.iter().map(|p| (p[0] - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let chance = all.iter().map(|p| p[1]).sum::<f64>() / n;
    if spread > chance * (1.0 + CLEAR * (2.0 / n).sqrt()) { (spread - chance).sqrt() } else { 0.0 }
}
