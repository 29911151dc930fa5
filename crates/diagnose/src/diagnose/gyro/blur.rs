//! How long exposures are, from how blurred neighbouring frames are against each other.
//!
//! An exposure of e s blurs each frame along its own motion, by e v. If each of two neighbours is blurred once more
//! by what the other one has, both show the same, whatever that is. With a wrong e they differ by the second
//! derivative of what they show along both motions, times (e^2 - e0^2) / 24 of the squares of these. So the next e0
//! follows from the difference by least squares, and the last one leaves none: that the two become alike when
//! everything is blurred away is no solution, since the slope is followed and not the difference made small.
//! Brightness, and a remaining displacement, of each block are fitted beside it.

use glam::DVec2;
use rayon::prelude::*;

use super::input::Footage;
use super::paths::{GROUPS, Numbers, Timed, jackknife, rate, seen, time_s};
use super::step::Step;
use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::expect::linear::solve;
use shutterbug::error::Result;
use shutterbug::plane::{Plane, srgb_decode};

/// Most pairs of frames: those whose motions differ most.
const MOST_PAIRS: usize = 16;
/// Side of a block, px of the smaller pictures, and the share of a block that both frames must show.
const BLOCK_PX: usize = 32;
const LEAST_SHARE: f64 = 0.8;
/// Frames wider than this are shrunk by a whole number, px.
const WIDEST_PX: usize = 800;
/// Blur before anything is read between pixels or differentiated, px: a cubic then reads what is there. Measured: 11.65
/// ms for 12 with a noise of 1 DN, 11.43 with a blur of 2.5 px; 19.87 ms for 20 without noise.
const SOFT_PX: f64 = 1.5;
/// What an exposure is known to at best, as a part of it: what the measurements above were off by, and a little more.
const AT_BEST: f64 = 0.04;
/// Rounds, and exposures below which there is none, s.
const ROUNDS: usize = 10;
const NONE_S: f64 = 1e-4;
/// Part of the time between frames at which a search for an exposure has run to its end.
const LONGEST: f64 = 0.999;
/// What an exposure must be known to, as a part of it, and least blur that shows, px.
const KNOWN: f64 = 0.3;
const LEAST_BLUR_PX: f64 = 0.8;

/// What was found.
pub(super) struct Blurred {
    /// Exposure, s, and the half width of its 95 % interval.
    pub exposure_s: f64,
    pub half_s: f64,
    /// Longest that it may be, s.
    pub most_s: f64,
    /// Time from frame to frame, s.
    pub period_s: f64,
    /// Usual length of the blur, px.
    pub blur_px: f64,
}

impl Blurred {
    /// Whether the exposure is told.
    pub(super) fn is_known(&self) -> bool {
        self.half_s < KNOWN * self.exposure_s && self.blur_px >= LEAST_BLUR_PX && !self.is_too_long()
    }

    /// Whether it is as long as frames are apart: no exposure is, so what was compared is no blur of motion.
    pub(super) fn is_too_long(&self) -> bool {
        self.exposure_s >= LONGEST * self.period_s
    }
}

/// A pair of frames on the second one's pixels.
struct Both {
    /// Linear light, soft: the first frame's content where the second one has it, and the second frame.
    light: [Plane<f32>; 2],
    /// Motion of each, px/s, by pixel.
    speed: Vec<[DVec2; 2]>,
    /// Whether both show the pixel.
    shown: Vec<bool>,
}

/// Sums of one pair: of the slope with itself and with the difference.
type Sums = [f64; 2];

/// The exposure; nothing where frames cannot tell or there is no time.
///
/// # Errors
/// Frames that cannot be read.
pub(super) fn exposure(
    footage: &Footage,
    steps: &[Step],
    timed: &Timed,
    budget: &Budget,
) -> Result<Option<Blurred>> {
    let mut order: Vec<(f64, usize)> =
        steps.iter().enumerate().map(|(k, s)| (unlike(footage, s, &timed.numbers), k)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut pairs = Vec::new();
    for (_, k) in order.into_iter().take(MOST_PAIRS) {
        if budget.is_over() {
            break;
        }
        pairs.push(Both::of(footage, &steps[k], &timed.numbers)?);
    }
    if pairs.len() < 4 {
        return Ok(None);
    }
    let Some(squared) = solved(&pairs, footage.period_s, budget) else { return Ok(None) };
    // Left out in turn, from the end on: one round of all sums tells.
    let all: Vec<Sums> = pairs.par_iter().map(|p| p.sums(squared.max(0.0).sqrt())).collect();
    let groups = GROUPS.min(pairs.len());
    let without = |g: usize| {
        let some = all.iter().enumerate().filter(|(k, _)| k % groups != g);
        let sums = some.fold([0.0; 2], |a, (_, s)| [a[0] + s[0], a[1] + s[1]]);
        squared + sums[1] / sums[0].max(1e-30)
    };
    let half = jackknife(&(0..groups).map(without).collect::<Vec<_>>());
    let exposure_s = squared.max(0.0).sqrt();
    let speeds = pairs.iter().map(Both::speed_px_s).sum::<f64>() / pairs.len() as f64;
    tracing::info!("exposure^2 {squared:.3e} +- {half:.1e} s^2, {speeds:.0} px/s");
    Ok(Some(Blurred {
        exposure_s,
        half_s: if exposure_s > NONE_S {
            (0.5 * half / exposure_s).hypot(AT_BEST * exposure_s)
        } else {
            f64::INFINITY
        },
        period_s: footage.period_s,
        most_s: (squared + half).max(0.0).sqrt(),
        blur_px: speeds * exposure_s,
    }))
}

/// The square of the exposure at which the difference has no slope left, s^2; negative where frames are sharper than
/// they can be.
fn solved(pairs: &[Both], period_s: f64, budget: &Budget) -> Option<f64> {
    let most = period_s * period_s;
    let mut squared = 0.1 * most;
    for _ in 0..ROUNDS {
        if budget.is_over() {
            return None;
        }
        let at_s = squared.max(0.0).sqrt();
        let all: Vec<Sums> = pairs.par_iter().map(|p| p.sums(at_s)).collect();
        let sums = all.iter().fold([0.0; 2], |a, s| [a[0] + s[0], a[1] + s[1]]);
        if !(sums[0] > 0.0) {
            return None;
        }
        let next = (squared.max(0.0) + sums[1] / sums[0]).clamp(-0.2 * most, most);
        let moved = (next - squared).abs();
        squared = next;
        if moved < 1e-4 * most {
            break;
        }
    }
    Some(squared)
}

/// How unlike the motions of both frames are, the middle of the picture standing for all.
fn unlike(footage: &Footage, step: &Step, n: &Numbers) -> f64 {
    let k = footage.intrinsics();
    let middle = DVec2::new(0.5 * f64::from(k.width), 0.5 * f64::from(k.height));
    let [a, b] = step.frames.map(|f| speed(footage, n, f, middle));
    let square = |a: DVec2, b: DVec2| (a.x * a.x - b.x * b.x).powi(2) + (a.y * a.y - b.y * b.y).powi(2);
    square(a, b) + 2.0 * (a.x * a.y - b.x * b.y).powi(2)
}

/// Motion of what a pixel shows, px/s.
fn speed(footage: &Footage, n: &Numbers, frame: usize, px: DVec2) -> DVec2 {
    let k = footage.intrinsics();
    let focal = DVec2::new(k.fx, k.fy);
    let ray = (px - DVec2::new(k.cx, k.cy)) / focal;
    let rate = rate(footage, n, time_s(footage, n, frame, px));
    let moved = -rate.cross(ray.extend(1.0));
    focal * (moved.truncate() - ray * moved.z)
}

impl Both {
    fn of(footage: &Footage, step: &Step, n: &Numbers) -> Result<Self> {
        let k = footage.intrinsics();
        let times = (k.width as usize).div_ceil(WIDEST_PX);
        let soft = |frame: usize| -> Result<Plane<f32>> {
            Ok(softened(&light(&footage.picture(frame)?, times), SOFT_PX))
        };
        let [a, b] = [soft(step.frames[0])?, soft(step.frames[1])?];
        let (w, h) = (b.width, b.height);
        let scale = times as f64;
        let (focal, centre) = (DVec2::new(k.fx, k.fy), DVec2::new(k.cx, k.cy));
        let one = |i: usize| {
            let px = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5) * scale;
            let to_s = time_s(footage, n, step.frames[1], px);
            let ray = (px - centre) / focal;
            // The time of the line it was seen in before is that of the place, which follows from the time.
            let mut before = px;
            for _ in 0..4 {
                let from_s = time_s(footage, n, step.frames[0], before);
                before = centre + focal * seen(footage, n, ray, to_s, from_s);
            }
            let speeds = [(step.frames[0], before), (step.frames[1], px)];
            (before / scale, speeds.map(|(frame, px)| speed(footage, n, frame, px) / scale))
        };
        let all: Vec<(DVec2, [DVec2; 2])> = (0..w * h).into_par_iter().map(one).collect();
        let data = all.par_iter().map(|(p, _)| read(&a, *p)).collect();
        let margin = |p: &DVec2| p.x > 4.0 && p.y > 4.0 && p.x < w as f64 - 4.0 && p.y < h as f64 - 4.0;
        Ok(Self {
            light: [Plane { width: w, height: h, channels: 1, data }, b],
            shown: all.iter().map(|(p, _)| margin(p)).collect(),
            speed: all.into_iter().map(|(_, v)| v).collect(),
        })
    }

    /// Usual speed, px/s.
    fn speed_px_s(&self) -> f64 {
        self.speed.iter().step_by(97).map(|v| 0.5 * (v[0].length() + v[1].length())).sum::<f64>()
            / self.speed.len().div_ceil(97) as f64
    }

    /// Each frame blurred by what the other one has of an exposure.
    fn alike(&self, exposure_s: f64) -> [Plane<f32>; 2] {
        [0, 1].map(|k| {
            let plane = &self.light[k];
            let one = |i: usize| along(plane, i, self.speed[i][1 - k] * exposure_s);
            let data = (0..plane.data.len()).into_par_iter().map(one).collect();
            Plane { data, ..*plane }
        })
    }

    /// See [`Sums`].
    fn sums(&self, exposure_s: f64) -> Sums {
        let [a, b] = self.alike(exposure_s);
        let (w, h) = (a.width, a.height);
        let mean = Plane { data: a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect(), ..a };
        // Blurred lines reach out of the frame near its border.
        let reach =
            |i: usize| 2.0 + 0.5 * exposure_s * self.speed[i][0].length().max(self.speed[i][1].length());
        let inside = |i: usize| {
            let (x, y, r) = ((i % w) as f64, (i / w) as f64, reach(i) + 2.0);
            self.shown[i] && x > r && y > r && x < w as f64 - r && y < h as f64 - r
        };
        let mut sums = [0.0; 2];
        for (bx, by) in (0..w / BLOCK_PX).flat_map(|bx| (0..h / BLOCK_PX).map(move |by| (bx, by))) {
            let cells = (0..BLOCK_PX * BLOCK_PX)
                .map(|c| (by * BLOCK_PX + c / BLOCK_PX) * w + bx * BLOCK_PX + c % BLOCK_PX);
            let rows: Vec<[f64; 6]> =
                cells.filter(|i| inside(*i)).map(|i| self.row(i, [&a, &b, &mean])).collect();
            if rows.len() as f64 > LEAST_SHARE * (BLOCK_PX * BLOCK_PX) as f64
                && let Some(block) = block(&rows)
            {
                (0..2).for_each(|k| sums[k] += block[k]);
            }
        }
        sums
    }

    /// Of a pixel: difference, slope by the square of the exposure, and what else may make a difference.
    fn row(&self, i: usize, [a, b, mean]: [&Plane<f32>; 3]) -> [f64; 6] {
        let w = mean.width;
        let m = |i: usize| f64::from(mean.data[i]);
        let xx = m(i + 1) - 2.0 * m(i) + m(i - 1);
        let yy = m(i + w) - 2.0 * m(i) + m(i - w);
        let xy = 0.25 * (m(i + w + 1) - m(i + w - 1) - m(i - w + 1) + m(i - w - 1));
        let second = |v: DVec2| v.x * v.x * xx + 2.0 * v.x * v.y * xy + v.y * v.y * yy;
        let [va, vb] = self.speed[i];
        let slope = (second(va) - second(vb)) / 24.0;
        let (gx, gy) = (0.5 * (m(i + 1) - m(i - 1)), 0.5 * (m(i + w) - m(i - w)));
        [f64::from(a.data[i]) - f64::from(b.data[i]), slope, 1.0, m(i), gx, gy]
    }
}

/// Sums of a block over its noise, when brightness and a displacement of its own have taken what they can.
fn block(rows: &[[f64; 6]]) -> Option<Sums> {
    let (mut a, mut b) = (vec![vec![0.0; 4]; 4], [vec![0.0; 4], vec![0.0; 4]]);
    for r in rows {
        for p in 0..4 {
            (0..4).for_each(|q| a[p][q] += r[2 + p] * r[2 + q]);
            (0..2).for_each(|k| b[k][p] += r[2 + p] * r[k]);
        }
    }
    let taken = [solve(&a, &b[0], 1e-9)?, solve(&a, &b[1], 1e-9)?];
    let (mut square, mut product, mut differ) = (0.0, 0.0, 0.0);
    for r in rows {
        let [d, s] = [0, 1].map(|k| r[k] - (0..4).map(|p| taken[k][p] * r[2 + p]).sum::<f64>());
        square += s * s;
        product += s * d;
        differ += d * d;
    }
    // What differs for other reasons (an edge that hides, a light that changed) shall not outvote the rest.
    let noise = differ / rows.len() as f64 + 1e-9;
    Some([square / noise, product / noise])
}

/// Brightness of a frame in linear light, shrunk by a whole number of px.
fn light(dn: &Plane<f32>, times: usize) -> Plane<f32> {
    let (w, h) = (dn.width / times, dn.height / times);
    let decode = |v: f32| srgb_decode(v / 255.0);
    Plane::from_fn(w, h, |x, y| {
        let mut sum = 0.0;
        for (i, j) in (0..times).flat_map(|j| (0..times).map(move |i| (i, j))) {
            let p = dn.pixel(x * times + i, y * times + j);
            sum += decode(p[0]) + decode(p[1]) + decode(p[2]);
        }
        [sum / (3 * times * times) as f32]
    })
}

/// A Gaussian.
fn softened(plane: &Plane<f32>, sigma_px: f64) -> Plane<f32> {
    let reach = (4.0 * sigma_px).ceil() as isize;
    let taps: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma_px).powi(2)).exp()).collect();
    let sum: f64 = taps.iter().sum();
    let (w, h) = (plane.width as isize, plane.height as isize);
    let pass = |from: &[f32], dx: isize, dy: isize| -> Vec<f32> {
        let one = |i: isize| {
            let (x, y) = (i % w, i / w);
            let at = |k: isize| {
                let (x, y) = ((x + k * dx).clamp(0, w - 1), (y + k * dy).clamp(0, h - 1));
                f64::from(from[(y * w + x) as usize])
            };
            ((-reach..=reach).zip(&taps).map(|(k, t)| t * at(k)).sum::<f64>() / sum) as f32
        };
        (0..w * h).into_par_iter().map(one).collect()
    };
    let across = pass(&plane.data, 1, 0);
    Plane { data: pass(&across, 0, 1), ..*plane }
}

/// The value at a place (px, centres of pixels at +0.5), by Catmull and Rom's cubic.
fn read(plane: &Plane<f32>, px: DVec2) -> f32 {
    crate::diagnose::expect::pair::channel_at(plane, [px.x as f32, px.y as f32], 0)
}

/// Mean along a line through a pixel's centre, as an exposure would make it: of so many places that its spread is
/// exact.
fn along(plane: &Plane<f32>, i: usize, line: DVec2) -> f32 {
    let length = line.length();
    if length < 0.05 {
        return plane.data[i];
    }
    let count = length.ceil() + 1.0;
    // Places in equal steps spread as a line of this length does.
    let step = line / (count * count - 1.0).sqrt();
    let centre = DVec2::new((i % plane.width) as f64 + 0.5, (i / plane.width) as f64 + 0.5);
    let place = |k: usize| centre + step * (k as f64 - 0.5 * (count - 1.0));
    (0..count as usize).map(|k| read(plane, place(k))).sum::<f32>() / count as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_places_spreads_as_an_exposure_does() {
        // The mean of x^2 along a line of length 5 is 25/12 about its middle.
        let plane = Plane::from_fn(64, 8, |x, _| [(x as f32 + 0.5 - 32.5).powi(2)]);
        let found = along(&plane, 4 * 64 + 32, DVec2::new(5.0, 0.0));
        assert!((found - 25.0 / 12.0).abs() < 1e-3, "{found}");
    }
}
