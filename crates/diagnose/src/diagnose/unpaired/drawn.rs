//! What stands at the same place in every frame of a folder that otherwise shows other moments: a logo, a time, bars,
//! a part of the camera's own carrier. No candidate makes it, and a simulation that lacks it is not like the frames.

use std::borrow::Borrow;

use rayon::prelude::*;

use shutterbug::plane::Plane;
use shutterbug::plane::stats::luma;

/// How far a pixel stands out from those around it, DN.
pub(super) const STANDS_OUT_DN: f32 = 25.0;
/// Steps around the smallest letter that can be read, of 3x5 px.
const FEWEST: f64 = 16.0;
/// Standard deviations of a chance that are none.
const SURE: f64 = 4.0;

/// What one folder has in every frame and the other does not, as words that follow "they differ in".
pub(super) fn said(
    real: &[impl Borrow<Plane<f32>> + Sync],
    simulated: &[impl Borrow<Plane<f32>> + Sync],
) -> Option<String> {
    let [real, simulated] = [Steps::of(real)?, Steps::of(simulated)?];
    let (whose, count) = match [real.own(&simulated), simulated.own(&real)] {
        [Some(count), _] => ("real", count),
        [None, Some(count)] => ("simulated", count),
        [None, None] => return None,
    };
    Some(format!(
        "edges that stand at the same place in every {whose} frame, of {count} px: something drawn on them \
         (bars, a logo, a time), or a part of what carries the camera"
    ))
}

/// Steps of brightness from each pixel to the one on the right and the one below, over the frames of a folder.
struct Steps {
    size: [usize; 2],
    frames: usize,
    /// Of each step in how many frames it goes up and in how many down by [`STANDS_OUT_DN`].
    counts: Vec<[u16; 2]>,
}

impl Steps {
    /// Nothing of pictures of several sizes: no place is the same in them.
    fn of(frames: &[impl Borrow<Plane<f32>> + Sync]) -> Option<Self> {
        let first: &Plane<f32> = frames.first()?.borrow();
        let size = [first.width, first.height];
        if frames.iter().any(|f| [f.borrow().width, f.borrow().height] != size) {
            return None;
        }
        let all: Vec<Vec<i8>> = frames.par_iter().map(|f| steps(f.borrow())).collect();
        let count = |i: usize, sign: i8| all.iter().filter(|f| f[i] == sign).count() as u16;
        let counts = (0..all[0].len()).map(|i| [count(i, 1), count(i, -1)]).collect();
        Some(Self { size, frames: frames.len(), counts })
    }

    /// How many steps are in all of these frames, and in fewer than half of the others; nothing where these may be
    /// chance, or most of what the frames show, of a camera that rests.
    fn own(&self, others: &Self) -> Option<usize> {
        if self.size != others.size {
            return None;
        }
        let stays = |n: u16| usize::from(n) == self.frames;
        let rare = |n: u16| 2 * usize::from(n) < others.frames;
        let both = || self.counts.iter().zip(&others.counts);
        let fixed = self.counts.iter().filter(|c| c.iter().any(|n| stays(*n))).count();
        let own = both().filter(|(a, b)| (0..2).any(|k| stays(a[k]) && rare(b[k]))).count();
        let seen: f64 = self.counts.iter().flatten().map(|n| f64::from(*n)).sum::<f64>() / self.frames as f64;
        // Frames that follow one another are alike: half of them count as moments of their own.
        let (all, moments) = (self.counts.len() as f64, 0.5 * self.frames as f64);
        let chance = all * (seen / all.max(1.0)).powf(moments);
        let beyond_chance = own as f64 > chance + SURE * chance.sqrt() + FEWEST;
        (beyond_chance && 2.0 * (fixed as f64) < seen).then_some(own)
    }
}

/// Signs of the steps of a frame that stand out: to the right, then down, pixel by pixel.
fn steps(dn: &Plane<f32>) -> Vec<i8> {
    let (w, h) = (dn.width, dn.height);
    let light: Vec<f32> = dn.data.chunks_exact(3).map(luma).collect();
    let sign = |by: f32| i8::from(by > STANDS_OUT_DN) - i8::from(by < -STANDS_OUT_DN);
    let step = |i: usize, there: bool, by: usize| if there { sign(light[i + by] - light[i]) } else { 0 };
    let at = |i: usize| [step(i, i % w + 1 < w, 1), step(i, i / w + 1 < h, w)];
    (0..w * h).flat_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes that move on by a few px from frame to frame, with something on top.
    fn frames(from: usize, top: impl Fn(usize, usize) -> Option<f32>) -> Vec<Plane<f32>> {
        let one = |k: usize| {
            Plane::from_fn(160, 120, |x, y| {
                let (u, v) = (x + 7 * (k + from), y + 5 * (k + from));
                let boxed = if (u / 23 + v / 17).is_multiple_of(2) { 150.0 } else { 60.0 };
                [top(x, y).unwrap_or(boxed + (u % 5) as f32); 3]
            })
        };
        (0..8).map(one).collect()
    }

    #[test]
    fn bars_and_marks_in_every_frame_are_seen_and_content_is_not() {
        let plain = frames(30, |_, _| None);
        assert_eq!(said(&frames(0, |_, _| None), &plain), None, "control");
        let bars = frames(0, |_, y| (!(12..108).contains(&y)).then_some(0.0));
        let text = said(&bars, &plain).expect("bars");
        assert!(text.contains("every real frame"), "{text}");
        let mark = |x: usize, y: usize| {
            let inside = (100..140).contains(&x) && (8..20).contains(&y);
            inside.then_some(if (x / 2 + y / 3).is_multiple_of(2) { 255.0 } else { 0.0 })
        };
        assert!(said(&plain, &frames(0, mark)).is_some_and(|t| t.contains("simulated")), "a mark");
        // In both it is no difference.
        assert_eq!(said(&frames(0, mark), &frames(30, mark)), None);
        // A camera that rests: all of its content stays.
        let rests = vec![plain[0].clone(); 8];
        assert_eq!(said(&rests, &plain), None);
    }
}
