//! Is the scene static? Registration of the frames, brightness, and the mask of pixels whose difference is noise alone.
//!
//! Displacement is measured per block as by Lucas and Kanade (IJCAI 1981), along the block's dominant gradient only, so
//! that one edge suffices. Where displacement v and gradient g make v g as large as a fifth of the noise, the pixel is
//! left out: that adds at most 5 % to a variance.

use rayon::prelude::*;
use serde::Serialize;

use super::blocks::{BLOCK_PX, Blocks, for_each_block, luma, percentile};
use super::filter::{dilate, gaussian, masked_mean};
use super::frames::{Encoding, Frame};
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;

/// Largest whole shift that is searched and taken back, px.
const MAX_SHIFT_PX: i32 = 8;
/// Of all places that a block of [`BLOCK_PX`] may have come from, chance makes one in ten thousand look so much better
/// than another: a ratio of two squared differences of noise that is smooth over 1.5 px, with as many degrees of
/// freedom as a block has of it (1024 over 4 pi 1.5^2; Fisher's z).
const CHANCE: f64 = 0.29;
/// Brightness changes beyond this are another exposure, not flicker.
const MAX_GAIN_CHANGE: f64 = 0.2;
/// Usual difference of the means of blocks beyond which it is another scene: a share of the scene's contrast, and so
/// many times what noise alone makes of a mean (more than once, as noise is smooth in processed pictures).
const MOST_UNLIKE: f64 = 0.25;
const NOISE_OF_A_BLOCK: f64 = 3.0;
/// Largest part of the noise's sigma that displacement may add at a pixel.
pub(super) const MAX_CONTAMINATION: f64 = 0.22;
/// Radius around edges that displaced frames lose, px.
const EDGE_RADIUS_PX: usize = 5;
/// Half side of the window whose mean is taken off the difference of displaced frames, px.
pub const LOCAL_MEAN_RADIUS_PX: usize = 24;
/// Fewer usable pixels than this give no curve.
const MIN_USABLE_PX: usize = 5_000;

/// What the two frames of a pair are to each other.
#[derive(Clone, Debug, Serialize)]
pub struct Registration {
    /// Shift of the second against the first, whole px (x, y); taken back by cropping, never by interpolation.
    pub shift_px: [i32; 2],
    /// Median, over the blocks with texture, of the displacement that is left, px.
    pub residual_median_px: f64,
    /// Its 95th percentile, px.
    pub residual_p95_px: f64,
    /// Blocks with enough texture to tell a displacement.
    pub textured_blocks: usize,
    /// Share of those that are displaced significantly.
    pub displaced_fraction: f64,
    /// Whether the camera moved between the frames.
    pub moved: bool,
    /// Brightness of the second over the first, per channel, in linear values; taken back.
    pub gain: [f64; 3],
    /// Share of the picture left out because something may have moved or saturated there.
    pub masked_fraction: f64,
}

/// A pair of frames made comparable.
#[derive(Clone, Debug)]
pub struct AlignedPair {
    /// Both frames over the common area, encoded, the second with the first one's brightness.
    pub frames: [Plane<f32>; 2],
    /// Pixels whose difference is noise.
    pub usable: Vec<bool>,
    /// How it was made.
    pub registration: Registration,
}

impl AlignedPair {
    /// Mean of the two frames, encoded.
    pub fn mean(&self) -> Plane<f32> {
        let [a, b] = &self.frames;
        Plane { data: a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect(), ..*a }
    }

    /// Second less first, after `f`; of displaced frames without its mean over a window of
    /// [`LOCAL_MEAN_RADIUS_PX`], which shading that moved would fill.
    pub fn difference(&self, f: impl Fn(f32) -> f32) -> Plane<f32> {
        difference(&self.frames, &self.usable, self.registration.moved, f)
    }
}

/// As [`AlignedPair::difference`], of any two pictures with that mask.
pub fn difference(
    [a, b]: &[Plane<f32>; 2],
    usable: &[bool],
    moved: bool,
    f: impl Fn(f32) -> f32,
) -> Plane<f32> {
    let mut d = Plane { data: a.data.iter().zip(&b.data).map(|(a, b)| f(*b) - f(*a)).collect(), ..*a };
    if moved {
        let local = masked_mean(&d, usable, LOCAL_MEAN_RADIUS_PX);
        d.data.iter_mut().zip(&local.data).for_each(|(d, m)| *d -= m);
    }
    d
}

/// Registers two frames and masks what is not static.
///
/// # Errors
/// A camera that moved more than can be taken back, a scene of which too little rested, another exposure.
pub fn align(a: &Frame, b: &Frame, encoding: Encoding) -> Result<AlignedPair> {
    let refuse = |found: String| {
        Error::input(&b.path, None, found, format!("the static scene of {}", a.path.display()))
    };
    let shift_px = whole_shift(&luma(&a.encoded), &luma(&b.encoded));
    if shift_px.iter().any(|s| s.abs() >= MAX_SHIFT_PX) {
        return Err(refuse(format!(
            "no shift within {MAX_SHIFT_PX} px that lines the frames up: the camera moved"
        )));
    }
    let frames = crop(&a.encoded, &b.encoded, shift_px);
    let (gain, frames) = equalise(frames, encoding);
    if let Some(g) = gain.iter().find(|g| (*g - 1.0).abs() > MAX_GAIN_CHANGE) {
        return Err(refuse(format!("a brightness of {g:.3} times the first frame's: another exposure")));
    }
    if let Some(found) = other_scene(&frames) {
        return Err(refuse(found));
    }
    let blocks = Blocks::measure(&frames);
    let textured: Vec<f64> =
        blocks.all.iter().filter(|b| b.textured).map(|b| b.displacement_px.abs()).collect();
    let displaced = blocks.all.iter().filter(|b| b.displaced()).count();
    let displaced_fraction = displaced as f64 / textured.len().max(1) as f64;
    let (median, p95) = (percentile(&textured, 0.5), percentile(&textured, 0.95));
    // A camera that moves takes nearly all texture along; what moves by itself leaves the median where it is.
    let moved = shift_px != [0, 0] || displaced_fraction > 0.5 || (displaced_fraction > 0.1 && median > 0.05);
    if median > 1.5 {
        return Err(refuse(format!("a displacement of {median:.2} px in half of the textured picture")));
    }
    let usable = if moved {
        rest_mask(&frames, &blocks, percentile(&textured, 0.75).max(0.1))
    } else {
        vec![true; frames[0].width * frames[0].height]
    };
    let usable = without_outliers(&frames, usable, &blocks, moved);
    let count = usable.iter().filter(|u| **u).count();
    let masked_fraction = 1.0 - count as f64 / usable.len() as f64;
    let enough = count >= MIN_USABLE_PX.min(usable.len() / 2) && (moved || masked_fraction < 0.5);
    if !enough {
        return Err(refuse(format!(
            "only {:.1} % of the picture at rest (displacement {median:.2} px, 95 % of it below {p95:.2} px)",
            100.0 - 100.0 * masked_fraction
        )));
    }
    let registration = Registration {
        shift_px,
        residual_median_px: median,
        residual_p95_px: p95,
        textured_blocks: textured.len(),
        displaced_fraction,
        moved,
        gain,
        masked_fraction,
    };
    Ok(AlignedPair { frames, usable, registration })
}

/// What shows that the second frame is of another scene, or from another place, if anything does.
fn other_scene(frames: &[Plane<f32>; 2]) -> Option<String> {
    if let Some(share) = unlike(frames) {
        return Some(format!("a coarse difference of {:.0} % of the scene's own contrast", 100.0 * share));
    }
    wanders(frames).map(|px| {
        format!(
            "parts of the picture that lie {px:.0} px beside the first frame's, in more than half of those that tell"
        )
    })
}

/// The usual difference of the means of blocks over the scene's own contrast, where that is more than noise and a scene
/// at rest have: another scene. What moves in a part of the scene leaves most blocks as they are.
fn unlike([a, b]: &[Plane<f32>; 2]) -> Option<f64> {
    let (a, b) = (luma(a), luma(b));
    let (mut means, mut differences, mut spreads) = (Vec::new(), Vec::new(), Vec::new());
    for_each_block(a.width, a.height, |pixels| {
        let all: Vec<[f64; 2]> =
            pixels.map(|i| [f64::from(a.data[i]), f64::from(b.data[i] - a.data[i])]).collect();
        let n = all.len() as f64;
        let [mean, difference] = [0, 1].map(|k| all.iter().map(|v| v[k]).sum::<f64>() / n);
        means.push(mean);
        differences.push(difference);
        spreads.push(all.iter().map(|v| (v[1] - difference).powi(2)).sum::<f64>() / n);
    });
    let middle = percentile(&differences, 0.5);
    let off: Vec<f64> = differences.iter().map(|d| (d - middle).abs()).collect();
    let usual = percentile(&off, 0.5);
    let centre = means.iter().sum::<f64>() / means.len().max(1) as f64;
    let contrast =
        (means.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / means.len().max(1) as f64).sqrt();
    let noise = percentile(&spreads, 0.5).sqrt() / BLOCK_PX as f64;
    (usual > MOST_UNLIKE * contrast + NOISE_OF_A_BLOCK * noise).then(|| usual / contrast)
}

/// Fine structure: ramps would take a change of brightness or plain chance for a shift.
fn fine(plane: &Plane<f32>) -> Plane<f32> {
    let (mut narrow, wide) = (gaussian(plane, 1.5), gaussian(plane, 6.0));
    narrow.data.iter_mut().zip(&wide.data).for_each(|(n, w)| *n -= w);
    narrow
}

/// How far blocks lie beside where they were, px in the median, where that is 2 px or more in most of those that tell:
/// a camera that turned or came nearer, which no shift of the whole takes back. Slopes do not tell so much: they see no
/// texture where things moved by more than its grain.
fn wanders([a, b]: &[Plane<f32>; 2]) -> Option<f64> {
    let (a, b) = (fine(&luma(a)), fine(&luma(b)));
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    for_each_block(a.width, a.height, |pixels| blocks.push(pixels.collect()));
    let side = 2 * MAX_SHIFT_PX + 1;
    let cost = |block: &[usize], [dx, dy]: [i32; 2]| -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0usize);
        for i in block {
            let (x, y) = ((i % a.width) as i32 + dx, (i / a.width) as i32 + dy);
            if (0..a.width as i32).contains(&x) && (0..a.height as i32).contains(&y) {
                sum += f64::from(b.data[y as usize * a.width + x as usize] - a.data[*i]).powi(2);
                count += 1;
            }
        }
        (2 * count > block.len()).then(|| sum / count as f64)
    };
    // 0 for a block that lies where it was.
    let beside_px = |block: &Vec<usize>| -> Option<f64> {
        let all = (0..side * side).map(|i| [i % side - MAX_SHIFT_PX, i / side - MAX_SHIFT_PX]);
        let mut costs: Vec<_> = all.filter_map(|shift| Some((cost(block, shift)?, shift))).collect();
        costs.sort_by(|p, q| p.0.total_cmp(&q.0));
        let ((best, shift), usual) = (*costs.first()?, costs[costs.len() / 2].0);
        let px = f64::from(shift[0]).hypot(f64::from(shift[1]));
        let displaced = px >= 2.0 && best < CHANCE * cost(block, [0, 0])?;
        (best < CHANCE * usual).then_some(if displaced { px } else { 0.0 })
    };
    let found: Vec<f64> = blocks.par_iter().filter_map(beside_px).collect();
    let displaced: Vec<f64> = found.iter().copied().filter(|px| *px > 0.0).collect();
    (2 * displaced.len() > found.len()).then(|| percentile(&displaced, 0.5))
}

/// The whole shift with the least squared difference of the fine structure.
fn whole_shift(a: &Plane<f32>, b: &Plane<f32>) -> [i32; 2] {
    let margin = MAX_SHIFT_PX as usize;
    let (a, b) = (fine(a), fine(b));
    let cost = |dx: i32, dy: i32| -> f64 {
        let mut sum = 0.0;
        for y in (margin..a.height - margin).step_by(3) {
            let other = b.row((y as i32 + dy) as usize);
            let row = a.row(y);
            for x in (margin..a.width - margin).step_by(3) {
                sum += f64::from(other[(x as i32 + dx) as usize] - row[x]).powi(2);
            }
        }
        sum
    };
    let side = 2 * MAX_SHIFT_PX + 1;
    let costs: Vec<f64> = (0..side * side)
        .into_par_iter()
        .map(|i| cost(i % side - MAX_SHIFT_PX, i / side - MAX_SHIFT_PX))
        .collect();
    let at = |i: usize| [i as i32 % side - MAX_SHIFT_PX, i as i32 / side - MAX_SHIFT_PX];
    let best = (0..costs.len()).min_by(|i, j| costs[*i].total_cmp(&costs[*j])).unwrap_or(0);
    // Pictures without texture have a best shift by chance, a little better than none.
    let rest = costs[costs.len() / 2];
    if costs[best] > 0.8 * rest { [0, 0] } else { at(best) }
}

fn crop(a: &Plane<f32>, b: &Plane<f32>, [dx, dy]: [i32; 2]) -> [Plane<f32>; 2] {
    let (width, height) = (a.width - dx.unsigned_abs() as usize, a.height - dy.unsigned_abs() as usize);
    let cut = |plane: &Plane<f32>, x0: i32, y0: i32| {
        let (x0, y0) = (x0.max(0) as usize, y0.max(0) as usize);
        let mut data = Vec::with_capacity(width * height * 3);
        for y in 0..height {
            data.extend_from_slice(&plane.row(y + y0)[x0 * 3..(x0 + width) * 3]);
        }
        Plane { width, height, channels: 3, data }
    };
    [cut(a, -dx, -dy), cut(b, dx, dy)]
}

/// Takes back a change of brightness: the median over blocks of the ratio of linear means, per channel.
fn equalise([a, b]: [Plane<f32>; 2], encoding: Encoding) -> ([f64; 3], [Plane<f32>; 2]) {
    let gain = [0, 1, 2].map(|c| {
        let mut ratios = Vec::new();
        for_each_block(a.width, a.height, |pixels| {
            let (mut sums, mut cut) = ([0.0f64; 2], false);
            for i in pixels {
                let (p, q) = (a.data[i * 3 + c], b.data[i * 3 + c]);
                cut |= p.max(q) >= 0.996;
                sums[0] += f64::from(encoding.decode(p));
                sums[1] += f64::from(encoding.decode(q));
            }
            if !cut && sums[0] > 0.005 * (BLOCK_PX * BLOCK_PX) as f64 {
                ratios.push(sums[1] / sums[0]);
            }
        });
        if ratios.len() < 4 { 1.0 } else { percentile(&ratios, 0.5) }
    });
    // Less than a tenth of a per cent is no change: correcting it would only move quantized values off their steps.
    if gain.iter().all(|g| (g - 1.0).abs() < 1e-3) {
        return (gain, [a, b]);
    }
    let data = b.data.iter().enumerate().map(|(i, v)| {
        // Cut-off values stay cut off.
        if *v >= 0.998 { *v } else { encoding.encode(encoding.decode(*v) / gain[i % 3] as f32) }
    });
    let corrected = Plane { data: data.collect(), ..b };
    (gain, [a, corrected])
}

/// Pixels of displaced frames at which the displacement adds less than [`MAX_CONTAMINATION`] of the noise: that of the
/// pixel's block where its texture tells one, `typical_px` elsewhere.
fn rest_mask(frames: &[Plane<f32>; 2], blocks: &Blocks, typical_px: f64) -> Vec<bool> {
    let [a, b] = frames;
    let (width, height) = (a.width, a.height);
    let mean = Plane { data: a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect(), ..*a };
    let smooth = gaussian(&mean, 4.0);
    let fine = gaussian(&mean, 1.5);
    // The noise of the quieter half of all blocks, per channel.
    let sigma = [0, 1, 2].map(|c| {
        let mut variances = Vec::new();
        for_each_block(width, height, |pixels| {
            let (mut n, mut sum, mut square) = (0.0, 0.0, 0.0f64);
            for i in pixels {
                let d = f64::from(b.data[i * 3 + c] - a.data[i * 3 + c]);
                (n, sum, square) = (n + 1.0, sum + d, square + d * d);
            }
            let variance = 0.5 * (square / n - (sum / n).powi(2));
            // Saturated blocks have none.
            if variance > 1e-7 {
                variances.push(variance);
            }
        });
        percentile(&variances, 0.3).sqrt().max(1e-4)
    });
    let edge: Vec<bool> = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let (x0, x1) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let (y0, y1) = (y.saturating_sub(1), (y + 1).min(height - 1));
            let displacement_px =
                blocks.at(x, y).map_or(typical_px, |v| v.abs().clamp(0.1, 3.0 * typical_px));
            (0..3).any(|c| {
                let gradient = |p: &Plane<f32>| {
                    let at = |x: usize, y: usize| f64::from(p.data[(y * width + x) * 3 + c]);
                    (0.5 * (at(x1, y) - at(x0, y))).hypot(0.5 * (at(x, y1) - at(x, y0)))
                };
                let allowed = MAX_CONTAMINATION * sigma[c] / displacement_px;
                // The finer gradient sees thin lines, but also three times the noise.
                gradient(&smooth) > allowed || gradient(&fine) > 3.0 * allowed + sigma[c]
            })
        })
        .collect();
    let wide = dilate(&edge, width, EDGE_RADIUS_PX);
    let border = 2 * EDGE_RADIUS_PX;
    (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let inside = x >= border && y >= border && x + border < width && y + border < height;
            inside && !wide[i]
        })
        .collect()
}

/// Takes displaced blocks out of the mask (where the camera rests; else the mask knows), and blocks of 16 px whose
/// difference is far beyond that of others as bright: something came, went or changed its light there.
fn without_outliers(
    frames: &[Plane<f32>; 2],
    mut usable: Vec<bool>,
    blocks: &Blocks,
    moved: bool,
) -> Vec<bool> {
    let [a, b] = frames;
    let (width, height) = (a.width, a.height);
    let across = width / BLOCK_PX;
    for (k, _) in blocks.all.iter().enumerate().filter(|(_, b)| !moved && b.displaced()) {
        clear(&mut usable, width, (k % across * BLOCK_PX, k / across * BLOCK_PX), BLOCK_PX);
    }
    const SIDE: usize = 16;
    let mut seen: Vec<(usize, f64, usize, usize)> = Vec::new();
    for y0 in (0..height.saturating_sub(SIDE - 1)).step_by(SIDE) {
        for x0 in (0..width.saturating_sub(SIDE - 1)).step_by(SIDE) {
            let (mut n, mut level, mut square) = (0.0, 0.0, 0.0);
            for i in (0..SIDE * SIDE).map(|i| (y0 + i / SIDE) * width + x0 + i % SIDE) {
                if usable[i] {
                    let d = b.data[i * 3 + 1] - a.data[i * 3 + 1];
                    n += 1.0;
                    level += f64::from(a.data[i * 3 + 1] + b.data[i * 3 + 1]) * 0.5;
                    square += f64::from(d).powi(2);
                }
            }
            if n >= 64.0 {
                seen.push(((level / n * 16.0) as usize, square / n, x0, y0));
            }
        }
    }
    let medians: Vec<f64> = (0..=16)
        .map(|bin| percentile(&seen.iter().filter(|s| s.0 == bin).map(|s| s.1).collect::<Vec<_>>(), 0.5))
        .collect();
    let typical = percentile(&seen.iter().map(|s| s.1).collect::<Vec<_>>(), 0.5);
    for (bin, square, x0, y0) in &seen {
        // Bins of a few odd blocks have no median of their own: never above three times the picture's.
        let expected = medians[*bin].min(3.0 * typical).max(0.3 * typical);
        if *square > 4.0 * expected {
            clear(&mut usable, width, (*x0, *y0), SIDE);
        }
    }
    usable
}

fn clear(mask: &mut [bool], width: usize, (x0, y0): (usize, usize), side: usize) {
    for y in y0..y0 + side {
        mask[y * width + x0..y * width + x0 + side].fill(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nearer by 3 %: no shift takes that back, and half of the picture lies beside where it was.
    #[test]
    fn a_camera_that_came_nearer_is_told_from_one_at_rest() {
        let frame = |nearer: f64, seed: u64, shift: f64| {
            let mut dice = seed;
            let mut noise = || {
                dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (dice >> 40) as f64 / f64::from(1 << 24) - 0.5
            };
            let plane = Plane::from_fn(384, 320, |x, y| {
                let at = |v: usize, middle: f64| middle + (v as f64 + shift - middle) / nearer;
                let (u, v) = (at(x, 192.0), at(y, 160.0));
                // Boxes of several sizes: not one period.
                let tone = |side: f64| {
                    let (i, j) = ((u / side) as u64, (v / side) as u64);
                    (i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663)) % 97
                };
                let value = 0.2 + 0.003 * (tone(9.0) + tone(23.0)) as f64 + 0.02 * noise();
                [value as f32; 3]
            });
            Frame::from_plane("frame", plane, 1.0 / 255.0)
        };
        let first = frame(1.0, 1, 0.0);
        let said = align(&first, &frame(1.03, 2, 0.0), Encoding::Srgb).map(|_| ()).expect_err("nearer");
        assert!(said.to_string().contains("px beside the first frame's"), "{said}");
        align(&first, &frame(1.0, 3, 0.0), Encoding::Srgb).expect("control: at rest");
        let moved =
            align(&first, &frame(1.0, 4, 3.0), Encoding::Srgb).expect("control: a shift is taken back");
        assert!(moved.registration.moved);
    }
}
