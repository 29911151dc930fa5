//! Pixels that are stuck, found as what stands out from its neighbours in every frame, wherever the scene moves.

mod filed;

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::diagnose::evidence::Evidence;
use shutterbug::plane::{Plane, three};

/// How far above its neighbours a stuck pixel is, DN.
const ABOVE_DN: f32 = 25.0;
/// Least value of a pixel that is stuck at white, whatever gains lie behind the sensor, DN.
const LEAST_DN: f32 = 130.0;
/// How far a stuck pixel may change from frame to frame, DN.
const STEADY_DN: f32 = 60.0;

/// A stuck pixel.
#[derive(Clone, Debug, PartialEq)]
struct Stuck {
    /// Its place, row by row.
    place: usize,
    /// The value that it has, DN; none if it is seen in what a file makes of its block.
    dn: Option<[f32; 3]>,
}

/// The stuck pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct HotMap {
    pixels: Vec<Stuck>,
    /// Number of pixels that would show it.
    of: usize,
    /// Columns of the pictures.
    width: usize,
}

impl HotMap {
    /// Finds them in `frames` (places). A scene that rests has bright spots of its own: `means`, the simulated values,
    /// must not be as bright. `file`: the quality of the file behind which the frames are seen; `means` are those ahead
    /// of it.
    pub(crate) fn find(
        evidence: &Evidence,
        frames: &[usize],
        means: &[Plane<f32>],
        file: Option<u8>,
    ) -> Self {
        let Some(first) = means.first().filter(|_| frames.len() >= 2) else { return Self::default() };
        let (w, h) = (first.width, first.height);
        let reals: Vec<&Plane<f32>> = frames.iter().map(|&at| &*evidence.frames[at].dn).collect();
        let (mut pixels, mut of) = (Vec::new(), 0);
        for y in 0..h {
            for x in 0..w {
                let i = y * w + x;
                // Among bright ones a stuck pixel cannot be told.
                of += usize::from(means.iter().all(|m| (0..3).any(|c| m.data[3 * i + c] < 220.0)));
                let above = |c: usize| {
                    reals
                        .iter()
                        .zip(means)
                        .all(|(real, m)| real.data[3 * i + c] > m.data[3 * i + c] + ABOVE_DN)
                };
                let stands_out = |c: usize| above(c) && is_steady_spot(&reals, x, y, c);
                if (0..3).any(stands_out) {
                    let mean = three(|c| {
                        let sum: f32 = frames.iter().map(|&at| evidence.frames[at].dn.data[3 * i + c]).sum();
                        sum / frames.len() as f32
                    });
                    pixels.push((i, mean));
                }
            }
        }
        if is_drawn(&pixels, w) {
            pixels.clear();
        }
        let pixels = pixels.into_iter().map(|(place, dn)| Stuck { place, dn: Some(dn) }).collect();
        let mut hot = Self { pixels, of, width: w };
        hot.find_filed(&reals, means, file);
        hot
    }

    /// Finds what is seen behind a file, in the place of what was seen of the same before.
    fn find_filed(&mut self, reals: &[&Plane<f32>], means: &[Plane<f32>], file: Option<u8>) {
        let all: HashSet<usize> =
            file.map(|q| filed::stuck(reals, means, q).into_iter().collect()).unwrap_or_default();
        // What is bright in all of a place is content that the simulation lacks.
        let is_single = |i: &usize| touching(*i, self.width).all(|j| !all.contains(&j));
        let mut filed: Vec<usize> = all.iter().copied().filter(is_single).collect();
        filed.sort_unstable();
        let is_filed = |i: usize| filed.binary_search(&i).is_ok();
        let is_new = |p: &Stuck| !is_filed(p.place) && !touching(p.place, self.width).any(is_filed);
        self.pixels.retain(|p| p.dn.is_some() && is_new(p));
        self.pixels.extend(filed.into_iter().map(|place| Stuck { place, dn: None }));
    }

    /// Keeps the pixels that stand above better means too: before a camera that hardly moves, a bright spot that a lens
    /// has put elsewhere is as steady as a stuck pixel.
    /// Behind a file all are looked for anew.
    pub(crate) fn keep_above(
        &mut self,
        evidence: &Evidence,
        frames: &[usize],
        means: &[Plane<f32>],
        file: Option<u8>,
    ) {
        let above = |i: usize| {
            let one =
                |(&at, mean): (&usize, &Plane<f32>)| evidence.frames[at].dn.data[i] > mean.data[i] + ABOVE_DN;
            frames.iter().zip(means).all(one)
        };
        self.pixels.retain(|p| (3 * p.place..3 * p.place + 3).any(above));
        let reals: Vec<&Plane<f32>> = frames.iter().map(|&at| &*evidence.frames[at].dn).collect();
        self.find_filed(&reals, means, file);
    }

    /// Share of the pixels that are stuck themselves.
    pub(crate) fn fraction(&self) -> f64 {
        self.count() as f64 / self.of.max(1) as f64
    }

    /// Number of them.
    pub(crate) fn count(&self) -> usize {
        self.places().len()
    }

    /// The pixels that are stuck themselves: where colours are filled in, some of their neighbours stand out as well.
    pub(crate) fn places(&self) -> Vec<usize> {
        let spots: Vec<_> = self.pixels.iter().filter_map(|p| Some((p.place, p.dn?))).collect();
        let peaks = peaks(&spots, self.width, 0.0);
        let own = |p: &&Stuck| p.dn.is_none() || peaks.contains(&p.place);
        self.pixels.iter().filter(own).map(|p| p.place).collect()
    }

    /// Puts the stuck pixels into a simulated frame, but for those that a file has spread: they are simulated.
    pub(crate) fn put(&self, mean: &mut Plane<f32>) {
        for (i, dn) in self.pixels.iter().filter_map(|p| Some((p.place, p.dn?))) {
            mean.data[3 * i..3 * i + 3].copy_from_slice(&dn);
        }
    }

    /// `masks` with the stuck pixels and the neighbours that share their colour closed.
    pub(crate) fn close(&self, masks: &mut [Plane<f32>]) {
        for mask in masks {
            self.pixels.iter().for_each(|p| mask.data[p.place] = 0.0);
        }
    }
}

/// Whether a colour of a pixel is bright, brighter than around it, and the same, in every picture.
fn is_steady_spot(frames: &[&Plane<f32>], x: usize, y: usize, c: usize) -> bool {
    let value = |frame: &Plane<f32>| frame.pixel(x, y)[c];
    let (lo, hi) =
        frames.iter().map(|f| value(f)).fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(v), b.max(v)));
    lo > LEAST_DN && hi - lo < STEADY_DN && frames.iter().all(|f| value(f) > around(f, x, y, c) + ABOVE_DN)
}

/// Whether spots (places row by row, with their values) are something drawn on the pictures, as a text is, and no stuck
/// pixels: most of them touch another one. Which pixels of a sensor are stuck is chance. What is filled in around one,
/// and is less bright, is no spot of its own.
fn is_drawn(spots: &[(usize, [f32; 3])], width: usize) -> bool {
    let peaks = peaks(spots, width, ABOVE_DN);
    let touched = peaks.iter().filter(|i| touching(**i, width).any(|j| peaks.contains(&j))).count();
    2 * touched > peaks.len()
}

/// Spots that none of their neighbours among the spots outshines by more than `least`, DN.
fn peaks(spots: &[(usize, [f32; 3])], width: usize, least: f32) -> HashSet<usize> {
    let bright: HashMap<usize, f32> = spots.iter().map(|(i, v)| (*i, v.iter().sum())).collect();
    let is_peak = |i: &usize| {
        let mut near = touching(*i, width).filter_map(|j| bright.get(&j));
        near.all(|v| *v <= bright[i] + least)
    };
    bright.keys().copied().filter(is_peak).collect()
}

/// Places of the eight neighbours, those below the picture included.
fn touching(i: usize, width: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (i % width, i / width);
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    let rows = y.saturating_sub(1)..y + 2;
    rows.flat_map(move |v| columns.clone().map(move |u| v * width + u)).filter(move |j| *j != i)
}

/// Number of such pixels, whatever the pictures show. Before a camera that rests they may be content.
pub(crate) fn steady_spots(frames: &[&Plane<f32>]) -> usize {
    let Some(first) = frames.first().filter(|f| frames.iter().all(|o| o.data.len() == f.data.len())) else {
        return 0;
    };
    let (w, h) = (first.width, first.height);
    let spot = |i: &usize| (0..3).any(|c| is_steady_spot(frames, i % w, i / w, c));
    let value = |i: usize| (i, three(|c| first.data[3 * i + c]));
    let spots: Vec<_> = (0..w * h).into_par_iter().filter(spot).map(value).collect();
    if is_drawn(&spots, w) { 0 } else { spots.len() }
}

/// Median of the eight neighbours (fewer at the border).
fn around(plane: &Plane<f32>, x: usize, y: usize, c: usize) -> f32 {
    let mut values = Vec::with_capacity(8);
    for v in y.saturating_sub(1)..(y + 2).min(plane.height) {
        for u in x.saturating_sub(1)..(x + 2).min(plane.width) {
            if (u, v) != (x, y) {
                values.push(plane.data[3 * (v * plane.width + u) + c]);
            }
        }
    }
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::effects::jpeg::compressed;

    fn picture(bright: impl Fn(usize, usize) -> bool) -> Plane<f32> {
        Plane::from_fn(120, 90, |x, y| [if bright(x, y) { 255.0 } else { 60.0 }; 3])
    }

    #[test]
    fn single_spots_are_stuck_pixels_and_strokes_are_drawn() {
        let single = picture(|x, y| (x * 7919 + y * 104_729) % 97 == 3);
        let count = (0..120 * 90).filter(|i| single.data[3 * i] > 200.0).count();
        assert_eq!(steady_spots(&[&single, &single]), count);
        let strokes = picture(|x, y| (20..60).contains(&x) && (y == 20 || (y > 20 && y < 34 && x % 8 == 4)));
        assert_eq!(steady_spots(&[&strokes, &strokes]), 0);
        // A few that touch by chance are among many that do not.
        let both = picture(|x, y| (x * 7919 + y * 104_729) % 97 == 3 || (y == 80 && (50..54).contains(&x)));
        assert!(steady_spots(&[&both, &both]) >= count);
    }

    #[test]
    fn stuck_pixels_are_found_behind_a_coarse_file() {
        let (w, h) = (160, 96);
        let is_stuck = |x: usize, y: usize| (x * 7919 + y * 104_729) % 331 == 3;
        // A scene that moves, and is simulated brighter than it is, and out of place.
        let scene = |x: usize, y: usize, frame: usize| {
            let wave = |v: usize| (v as f32 * 0.37).sin() + (v as f32 * 0.11).cos();
            90.0 + 20.0 * wave(x + 3 * frame) + 15.0 * wave(y + 2 * frame)
        };
        let seen = |frame: usize, has_stuck: bool| {
            let dn = |x, y| if has_stuck && is_stuck(x, y) { 255.0 } else { scene(x, y, frame) };
            compressed(&Plane::from_fn(w, h, |x, y| [dn(x, y).round(); 3]), 29)
        };
        let ahead: Vec<_> =
            (0..6).map(|f| Plane::from_fn(w, h, |x, y| [1.1 * scene(x + 1, y, f) + 8.0; 3])).collect();
        let found = |has_stuck: bool| {
            let reals: Vec<_> = (0..6).map(|f| seen(f, has_stuck)).collect();
            let mut hot = HotMap { width: w, ..HotMap::default() };
            hot.find_filed(&reals.iter().collect::<Vec<_>>(), &ahead, Some(29));
            hot.places()
        };
        let there: Vec<usize> = (0..w * h).filter(|i| is_stuck(i % w, i / w)).collect();
        let places = found(true);
        let right = places.iter().filter(|i| there.contains(i)).count();
        assert!(10 * right >= 9 * there.len(), "{right} of {}", there.len());
        assert!(20 * (places.len() - right) <= there.len(), "{} are not there", places.len() - right);
        assert_eq!(found(false), Vec::<usize>::new(), "control: none is there");
    }
}
