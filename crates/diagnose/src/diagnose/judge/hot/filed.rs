//! Stuck pixels behind compression: a coarse one spreads them over their blocks, and leaves little of them in their own
//! place.

use rayon::prelude::*;

use crate::diagnose::dct::{AREA, Dct, SIDE, luma_block, steps};
use shutterbug::plane::Plane;

/// Brightness of a pixel that is stuck at white, as the file codes it, DN.
const WHITE_DN: f32 = 127.0;

/// A block of a frame: coefficients of its brightness.
struct Block {
    /// Simulated ahead of the file.
    ahead: [f32; AREA],
    seen: [f32; AREA],
    /// Simulated brightness, as the file codes it, DN.
    values: [f32; AREA],
}

/// What blocks are looked at with.
struct File {
    dct: Dct,
    steps: [f32; AREA],
    /// Coefficients of a block with 1 in one place, by place.
    single: Vec<[f32; AREA]>,
}

/// Places (row by row) of pixels that are stuck at white. In every frame their block is nearer to what the file makes
/// of it with such a pixel than to what it makes of it without. `ahead`: simulated frames ahead of the file.
pub(super) fn stuck(reals: &[&Plane<f32>], ahead: &[Plane<f32>], quality: u8) -> Vec<usize> {
    let dct = Dct::new();
    let single = |i: usize| dct.forward(&std::array::from_fn(|j| f32::from(u8::from(i == j))));
    let single = (0..AREA).map(single).collect();
    let file = File { steps: steps(quality, false), single, dct };
    let Some(first) = ahead.first().filter(|_| ahead.len() >= 2) else { return Vec::new() };
    let width = first.width;
    let in_block = |i: usize| {
        let (x0, y0) = (i % (width / SIDE) * SIDE, i / (width / SIDE) * SIDE);
        let blocks =
            reals.iter().zip(ahead).map(|(real, ahead)| file.block([real, ahead], [x0, y0])).collect();
        let place = |p: usize| (y0 + p / SIDE) * width + x0 + p % SIDE;
        file.stuck_in(blocks).into_iter().map(place).collect::<Vec<_>>()
    };
    (0..width / SIDE * (first.height / SIDE)).into_par_iter().flat_map_iter(in_block).collect()
}

impl File {
    /// The block of a real and of a simulated frame that begins there.
    fn block(&self, frames: [&Plane<f32>; 2], at: [usize; 2]) -> Block {
        let [seen, values] = frames.map(|frame| luma_block(frame, at));
        Block { ahead: self.dct.forward(&values), seen: self.dct.forward(&seen), values }
    }

    /// Places in the block of the pixels that are stuck, one block a frame.
    fn stuck_in(&self, mut blocks: Vec<Block>) -> Vec<usize> {
        let mut places = Vec::new();
        loop {
            let gain = |place: usize| {
                let gains = blocks.iter().map(|block| self.gain(block, place));
                gains.map(|gain| (gain > 0.0).then_some(gain)).sum::<Option<f32>>()
            };
            let all = (0..AREA).filter_map(|place| Some((place, gain(place)?)));
            let Some((place, _)) = all.max_by(|a, b| a.1.total_cmp(&b.1)) else { return places };
            places.push(place);
            blocks.iter_mut().for_each(|block| self.put(block, place));
        }
    }

    /// By how much a stuck pixel there lowers the squared distance of what is seen and what the file makes of what is
    /// simulated, DN^2. The mean of a block tells nothing: the simulation may be brighter or darker.
    fn gain(&self, block: &Block, place: usize) -> f32 {
        let more = WHITE_DN - block.values[place];
        let mut gain = 0.0;
        for (i, single) in self.single[place].iter().enumerate().skip(1) {
            let step = self.steps[i];
            let rounded = |v: f32| (v / step).round() * step;
            let (without, with) = (rounded(block.ahead[i]), rounded(block.ahead[i] + more * single));
            gain += (block.seen[i] - without).powi(2) - (block.seen[i] - with).powi(2);
        }
        gain
    }

    /// The block with a stuck pixel there.
    fn put(&self, block: &mut Block, place: usize) {
        let more = WHITE_DN - block.values[place];
        block.ahead.iter_mut().zip(&self.single[place]).for_each(|(c, single)| *c += more * single);
        block.values[place] = WHITE_DN;
    }
}
