//! `undescribed_object`: something moves otherwise than the scene says, or is not in the scene. No parameter of a
//! camera or of a surface makes a picture of it, so its places are found and left out, as long as they are the
//! smaller part.
//!
//! A block of a frame shows something else if what is left of it is better explained as the difference of two pictures
//! that have nothing in common than as what is left elsewhere. What is fixed to the lens or the sensor is no object,
//! and nothing is one that leaves the rest of the picture unexplained.

use super::found::Found;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::room;
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::judge::{ALPHA, Judge, Scores, closed_fraction};
use crate::diagnose::search::Search;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Blocks over the width of a picture: a cell of a factor is as wide.
const ACROSS: usize = 40;
/// Most of the pictures that objects may cover.
const MOST: f64 = 0.25;
/// Share of the gap that must be closed elsewhere for another search there to be worth its time, or that is gone with
/// the places: as for names beside what is unknown.
const REST: f64 = super::decide::NAMED[0];
/// Blocks that an object covers at least, in a frame: two by two, or it is an edge.
const FEWEST: usize = 4;
/// Quantiles of what is left, over the flat blocks and beside edges: most of a picture is as described.
const TYPICAL: [f64; 2] = [0.5, 0.75];

/// Where something is that the scene does not have.
pub(crate) struct Objects {
    /// Where frames are compared, by place: where they were, less the objects.
    pub masks: Vec<Plane<f32>>,
    /// Share of what was compared that objects cover.
    pub share: f64,
}

/// What is left of one block.
#[derive(Clone, Copy, Default)]
struct Block {
    /// Mean square of what is left, what of it the noise makes, and mean square of the slopes of what is simulated,
    /// DN^2.
    left: f64,
    noise: f64,
    slopes: f64,
    /// Whether most of it is compared.
    open: bool,
}

/// The blocks of one frame.
struct Blocks {
    side: usize,
    across: usize,
    all: Vec<Block>,
    /// Variance of the difference between two pictures of such values that have nothing in common, DN^2.
    apart: f64,
}

impl Blocks {
    fn of(real: &Plane<f32>, mean: &Plane<f32>, mask: Option<&Plane<f32>>, tone: &Tone) -> Self {
        let (w, h) = (real.width, real.height);
        let side = w.div_ceil(ACROSS).max(4);
        let (across, down) = (w.div_ceil(side), h.div_ceil(side));
        let mut sums = vec![[0.0f64; 4]; across * down];
        let mut values = [0.0f64; 3];
        for i in 0..w * h {
            if mask.is_some_and(|m| m.data[i] <= 0.5) {
                continue;
            }
            let (x, y) = (i % w, i / w);
            let (right, below) = (y * w + (x + 1).min(w - 1), (y + 1).min(h - 1) * w + x);
            let sum = &mut sums[y / side * across + x / side];
            for c in 0..3 {
                let at = |k: usize| mean.data[3 * k + c];
                let v = tone.spread_of(&mean.data[3 * i..3 * i + 3], c);
                let d = real.data[3 * i + c] - at(i);
                sum[0] += f64::from(d * d);
                sum[1] += f64::from((at(right) - at(i)).powi(2) + (at(below) - at(i)).powi(2));
                sum[2] += 1.0;
                sum[3] += f64::from(v.free + v.row + v.fixed);
                let value = f64::from(real.data[3 * i + c]);
                values = [values[0] + 1.0, values[1] + value, values[2] + value * value];
            }
        }
        let full = (3 * side * side) as f64;
        let all = sums.iter().map(|s| Block {
            left: s[0] / s[2].max(1.0),
            noise: s[3] / s[2].max(1.0),
            slopes: s[1] / s[2].max(1.0),
            open: s[2] >= 0.5 * full,
        });
        let mean = values[1] / values[0].max(1.0);
        let variance = values[2] / values[0].max(1.0) - mean * mean;
        Self { side, across, all: all.collect(), apart: 2.0 * variance }
    }

    /// Which blocks show something else: large differences, in patches.
    fn foreign(&self, typical: [f64; 2]) -> Vec<bool> {
        let odds = 2.0 * (1.0 / ALPHA).ln();
        let of = |b: &Block| {
            let expected = b.noise + typical[0] + typical[1] * b.slopes;
            let apart = self.apart.max(expected);
            b.open && b.left * (1.0 / expected - 1.0 / apart) > (apart / expected).ln() + odds
        };
        patches(&self.all.iter().map(of).collect::<Vec<_>>(), self.across)
    }
}

/// What is left of blocks as a rule: in flat ones, and for each unit of the slopes of others.
fn typical<'a>(blocks: impl Iterator<Item = &'a Block>) -> [f64; 2] {
    let mut open: Vec<&Block> = blocks.filter(|b| b.open).collect();
    if open.is_empty() {
        return [1.0, 1.0];
    }
    open.sort_by(|a, b| a.slopes.total_cmp(&b.slopes));
    let (flat, edges) = open.split_at(open.len() / 2);
    // Rounding leaves a twelfth, and as much again where colours are off by what correct simulations differ by.
    let base = quantile(flat.iter().map(|b| b.left - b.noise), TYPICAL[0]).max(0.2);
    let beside = quantile(edges.iter().map(|b| (b.left - b.noise - base) / b.slopes.max(1e-3)), TYPICAL[1]);
    [base, beside.max(0.0)]
}

fn quantile(values: impl Iterator<Item = f64>, at: f64) -> f64 {
    let mut all: Vec<f64> = values.collect();
    if all.is_empty() {
        return 0.0;
    }
    let place = (at * (all.len() - 1) as f64) as usize;
    *all.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Those of the blocks that form squares of two by two, with what touches such squares.
fn patches(set: &[bool], across: usize) -> Vec<bool> {
    let down = set.len() / across.max(1);
    let is = |x: usize, y: usize| x < across && y < down && set[y * across + x];
    let mut out = vec![false; set.len()];
    for (x, y) in (0..down).flat_map(|y| (0..across).map(move |x| (x, y))) {
        let square = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        if square.iter().filter(|&&(x, y)| is(x, y)).count() == FEWEST {
            // What lies around belongs to it: its border crosses blocks.
            let (left, top) = (x.saturating_sub(1), y.saturating_sub(1));
            for (u, v) in
                (top..(y + 3).min(down)).flat_map(|v| (left..(x + 3).min(across)).map(move |u| (u, v)))
            {
                out[v * across + u] = true;
            }
        }
    }
    out
}

/// Whether what blocks show stays in its place in the picture while the content moves: of the two frames between which
/// that has gone farthest, by how much they overlap as they are and when one follows the content. `way`: how far the
/// content has gone by each frame, blocks. Content that goes less than a block does not tell.
fn is_fixed(frames: &[Vec<bool>], across: usize, way: &[[f64; 2]]) -> bool {
    let shows = |f: &usize| frames[*f].iter().any(|b| *b);
    let seen: Vec<usize> = (0..frames.len()).filter(shows).collect();
    let apart = |a: usize, b: usize| [0, 1].map(|k| (way[b][k] - way[a][k]).round() as isize);
    let far = |(a, b): &(usize, usize)| apart(*a, *b).map(|d| d * d).iter().sum::<isize>();
    let pairs = seen.iter().enumerate().flat_map(|(i, &a)| seen[i + 1..].iter().map(move |&b| (a, b)));
    let Some((a, b)) = pairs.max_by_key(far) else { return false };
    let by = apart(a, b);
    by != [0; 2]
        && overlap(&frames[a], &frames[b], across, [0; 2]) > overlap(&frames[a], &frames[b], across, by)
}

/// Blocks that are in both of two sets when one moves by so many blocks, over those of the first that stay in the
/// picture.
fn overlap(a: &[bool], b: &[bool], across: usize, by: [isize; 2]) -> f64 {
    let down = a.len() / across;
    let (mut both, mut all) = (0.0, 0.0f64);
    for i in (0..a.len()).filter(|&i| a[i]) {
        let (x, y) = ((i % across) as isize + by[0], (i / across) as isize + by[1]);
        if (0..across as isize).contains(&x) && (0..down as isize).contains(&y) {
            all += 1.0;
            both += f64::from(u8::from(b[y as usize * across + x as usize]));
        }
    }
    both / all.max(1.0)
}

impl Search<'_> {
    /// Where something is that the scene does not have, if that is why a search left more than the discrepancy.
    pub(crate) fn undescribed(&mut self, found: &Found) -> Result<Option<Objects>> {
        let theta = &found.fit.theta;
        let left = self.judge.scores(self.forward, theta)?;
        if self.late() || left.beyond_bounds().is_empty() {
            return Ok(None);
        }
        let all: Vec<usize> = (0..self.evidence.frames.len()).collect();
        let means = self.forward.pictures(&all, theta, Quality::Fit)?;
        let tone = Tone::new(theta);
        let masks = self.judge.masks;
        // Only where frames are compared with this model: the factors of what no other frame saw are guesses.
        let seen = self.forward.masked(masks, theta.room.without(room::POSES).kind());
        let of = |at: &usize| {
            let mask = seen.as_ref().map(|m| &m[*at]);
            Blocks::of(&self.evidence.frames[*at].dn, &means[*at], mask, &tone)
        };
        let blocks: Vec<Blocks> = all.iter().map(of).collect();
        let typical = typical(blocks.iter().flat_map(|b| &b.all));
        let foreign: Vec<Vec<bool>> = blocks.iter().map(|b| b.foreign(typical)).collect();
        let (covered, open) = (count(&foreign, &blocks, true), count(&foreign, &blocks, false));
        let share = covered / open.max(1.0);
        tracing::info!("something else in {:.1} % of the pictures, typical {typical:.2?}", 100.0 * share);
        if share == 0.0
            || share > MOST
            || is_fixed(&foreign, blocks[0].across, &self.content_way(blocks[0].side))
        {
            return Ok(None);
        }
        let masks: Vec<Plane<f32>> = all
            .iter()
            .map(|&at| less(masks.map(|m| &m[at]), &means[at], &blocks[at], &foreign[at]))
            .collect();
        Ok(self.objects_explain(theta, &left, &masks)?.then_some(Objects { masks, share }))
    }

    /// How far the content has gone by each frame since the first, as a rule, in blocks of so many px.
    fn content_way(&self, side: usize) -> Vec<[f64; 2]> {
        let mean = |at: usize| {
            let v = &self.forward.sharp[at].velocity.data;
            let n = (v.len() / 2).max(1) as f64;
            [0, 1].map(|k| v.iter().skip(k).step_by(2).map(|v| f64::from(*v)).sum::<f64>() / n)
        };
        let mut way = vec![[0.0; 2]];
        for at in 1..self.evidence.frames.len() {
            let time_s = self.forward.starts_s[at] - self.forward.starts_s[at - 1];
            let (a, b, was) = (mean(at - 1), mean(at), way[at - 1]);
            way.push([0, 1].map(|k| was[k] + 0.5 * (a[k] + b[k]) * time_s / side as f64));
        }
        way
    }

    /// Whether it is these places that a model fails at: what is compared elsewhere is explained, and most of what was
    /// left beyond the discrepancy is gone with them. What is left everywhere has the largest blocks too, and they are
    /// no objects.
    fn objects_explain(&mut self, theta: &Theta, left: &Scores, masks: &[Plane<f32>]) -> Result<bool> {
        let mut judge = Judge::new(self.evidence, Some(masks), self.judge.seed, self.judge.hot.clone());
        (judge.quality, judge.kind) = (self.judge.quality, theta.room.kind());
        let [before, after] = [&self.base.clone(), theta].map(|t| judge.scores(self.forward, t));
        let (before, after) = (before?, after?);
        let closed = closed_fraction(before.mean(), after.mean(), after.floor());
        let beyond = after.beyond_bounds();
        let [was, is] = [left, &after].map(|s| (s.mean() - s.bound()).max(0.0));
        tracing::info!(
            "elsewhere {closed:.3} of the gap is closed, {was:.3} to {is:.3} DN beyond: {beyond:?}"
        );
        // An effect that the places hid from the search is found once they are left out.
        Ok(beyond.is_empty() || (closed >= REST && is < 0.5 * was) || is < (1.0 - REST) * was)
    }
}

/// Number of open blocks, of all or of those that show something else.
fn count(foreign: &[Vec<bool>], blocks: &[Blocks], only: bool) -> f64 {
    let open = |(f, b): (&Vec<bool>, &Blocks)| {
        f.iter().zip(&b.all).filter(|(f, b)| b.open && (!only || **f)).count()
    };
    foreign.iter().zip(blocks).map(open).sum::<usize>() as f64
}

/// A mask without the blocks that show something else.
fn less(mask: Option<&Plane<f32>>, like: &Plane<f32>, blocks: &Blocks, foreign: &[bool]) -> Plane<f32> {
    Plane::from_fn(like.width, like.height, |x, y| {
        let open = mask.map_or(1.0, |m| m.pixel(x, y)[0]);
        [if foreign[y / blocks.side * blocks.across + x / blocks.side] { 0.0 } else { open }]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::P;
    use shutterbug::chain::rng::random_normal;

    /// A textured picture, seen again with small errors, and with a patch of something else at `place`.
    fn frame(place: Option<[usize; 2]>) -> (Plane<f32>, Plane<f32>) {
        let texture = |x: usize, y: usize| 120.0 + 60.0 * ((x * 7 + y * 3) as f32 * 0.11).sin();
        let mean = Plane::from_fn(160, 120, |x, y| [texture(x, y); 3]);
        let real = Plane::from_fn(160, 120, |x, y| {
            let inside = place.is_some_and(|[u, v]| (u..u + 20).contains(&x) && (v..v + 20).contains(&y));
            [if inside { 30.0 } else { texture(x, y) + ((x * 31 + y * 17) % 5) as f32 - 2.0 }; 3]
        });
        (real, mean)
    }

    fn found(places: &[Option<[usize; 2]>]) -> Vec<Vec<bool>> {
        let tone = Tone::new(&Theta::neutral());
        let blocks: Vec<Blocks> = places
            .iter()
            .map(|p| frame(*p))
            .map(|(real, mean)| Blocks::of(&real, &mean, None, &tone))
            .collect();
        let typical = typical(blocks.iter().flat_map(|b| &b.all));
        blocks.iter().map(|b| b.foreign(typical)).collect()
    }

    #[test]
    fn a_patch_of_something_else_is_found_where_it_is_and_nothing_where_there_is_none() {
        let all = found(&[Some([40, 40]), None]);
        let at = |x: usize, y: usize| all[0][y / 4 * 40 + x / 4];
        assert!(at(50, 50) && at(41, 58), "inside");
        assert!(!at(100, 100) && !at(5, 5), "outside");
        assert!(all[1].iter().all(|f| !f), "control: nothing there");
    }

    #[test]
    fn noise_that_is_large_in_a_few_blocks_is_no_object() {
        // Noise of 12 DN, of which a model knows: blocks of 48 values differ by chance.
        let tone = Tone::new(&Theta::neutral().with(P::Read, 0.05));
        let (_, mean) = frame(None);
        let noisy = |seed: u32| {
            let spread = |i: usize| tone.spread_of(&mean.data[i - i % 3..i - i % 3 + 3], i % 3).free.sqrt();
            let normal = |i: usize| random_normal([i as u32, seed], 0, 7, [1, 2])[0];
            let data = (0..mean.data.len()).map(|i| mean.data[i] + spread(i) * normal(i)).collect();
            Plane { data, ..mean }
        };
        let blocks: Vec<Blocks> = (0..8).map(|s| Blocks::of(&noisy(s), &mean, None, &tone)).collect();
        let typical = typical(blocks.iter().flat_map(|b| &b.all));
        assert!(blocks.iter().all(|b| b.foreign(typical).iter().all(|f| !f)));
        let silent = Tone::new(&Theta::neutral());
        let few = Blocks::of(&noisy(1), &mean, None, &silent);
        assert!(
            few.foreign([0.2, 0.0]).iter().any(|f| *f),
            "control: without the noise's own spread they are"
        );
    }

    #[test]
    fn what_stays_in_its_place_in_the_picture_is_no_object() {
        let stays = found(&[Some([40, 40]), Some([40, 40]), Some([40, 40])]);
        let goes = found(&[Some([40, 40]), Some([80, 40]), Some([120, 60])]);
        // Content that goes by 40 px to the right, ten blocks, from frame to frame.
        let way = [[0.0, 0.0], [10.0, 0.0], [20.0, 5.0]];
        assert!(is_fixed(&stays, 40, &way));
        assert!(!is_fixed(&goes, 40, &way), "control: it moves with the content");
        assert!(!is_fixed(&stays, 40, &[[0.0; 2]; 3]), "content at rest does not tell");
    }

    #[test]
    fn a_line_of_blocks_is_an_edge_and_a_square_is_not() {
        let line: Vec<bool> = (0..100).map(|i| i / 10 == 4).collect();
        assert!(patches(&line, 10).iter().all(|b| !b));
        let square: Vec<bool> =
            (0..100).map(|i| (4..6).contains(&(i / 10)) && (4..6).contains(&(i % 10))).collect();
        assert_eq!(patches(&square, 10).iter().filter(|b| **b).count(), 16);
    }
}
