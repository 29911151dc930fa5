//! Whether colours were filled in from the sites of a Bayer mosaic, told from the frames alone: filled in again from
//! what the sites saw themselves they come out as they are, whatever the picture shows and however noisy it was before.
//! What mixes pixels or colours behind the mosaic hides that; nothing is told then.

use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::model::{P, Theta, candidate_of, combinations};
use crate::diagnose::expect::settings::settings_of;
use crate::diagnose::expect::tone::{Tone, dn_per_linear, noiseless};
use shutterbug::chain::rng::random_uniform;
use shutterbug::effects::BayerMosaic;
use shutterbug::plane::{Plane, three};
use shutterbug::reference::moments::mixed;

/// Frames that are looked at, and the side of the square in the middle of each, px: it is even.
const FRAMES: usize = 4;
const SIDE_PX: usize = 512;
/// How far filters reach, px.
const REACH_PX: usize = 2;
/// What is left by rounding to whole DN may be so many times as much: an encoding may be off by a tenth of a DN.
const ROUNDING: f64 = 1.5;

/// The pattern and the filter that the frames (places) show, of the camera `base`; nothing where they show none, or
/// where they show no pattern more than another.
pub(crate) fn mosaic(evidence: &Evidence, frames: &[usize], base: &Theta) -> Vec<(P, f64)> {
    let tone = Tone::new(&noiseless(base));
    if !tone.keeps_steps() {
        return Vec::new();
    }
    let some: Vec<Sites> =
        spread_out(frames, FRAMES).iter().map(|&at| Sites::of(evidence, at, &tone)).collect();
    let parameters = candidate_of("bayer_mosaic").parameters;
    let (&pattern, beside) = parameters.split_first().expect("a choice");
    let mut best: Vec<(f64, Theta)> = Vec::new();
    for option in 1..=pattern.spec().range[1] as usize {
        let with = combinations(beside, &base.with(pattern, option as f64));
        let off = with.into_iter().map(|theta| (off(&some, &theta), theta));
        best.extend(off.min_by(|a, b| a.0.total_cmp(&b.0)));
    }
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [first, second, ..] = &best[..] else { return Vec::new() };
    tracing::debug!("filled in again: {:.2} and {:.2} times what rounding leaves", first.0, second.0);
    if first.0 > ROUNDING || second.0 <= ROUNDING {
        return Vec::new();
    }
    parameters.iter().map(|&p| (p, first.1.get(p))).collect()
}

/// What each site of the mosaic of `theta` saw itself; the other colours are 0. As it is without a mosaic.
pub(crate) fn own(dn: &Plane<f32>, theta: &Theta) -> Plane<f32> {
    let Some(color) = colors(dn, theta) else { return dn.clone() };
    let mut own = dn.clone();
    for (pixel, color) in own.data.chunks_exact_mut(3).zip(&color.data) {
        (0..3).filter(|c| *c != *color as usize).for_each(|c| pixel[c] = 0.0);
    }
    own
}

/// The number of the colour of each site, shape `[height, width, 1]`; nothing without a mosaic.
fn colors(like: &Plane<f32>, theta: &Theta) -> Option<Plane<f32>> {
    let numbers = Plane::from_fn(like.width, like.height, |_, _| [0.0, 1.0, 2.0]);
    BayerMosaic::raw(&settings_of(theta), &numbers)
}

/// The middle of a frame.
struct Sites {
    /// Linear values, and those of a frame that was rounded otherwise.
    linear: [Plane<f32>; 2],
    /// DN a linear unit; 0 for pixels near which a value is clipped.
    slope: Plane<f32>,
}

impl Sites {
    fn of(evidence: &Evidence, at: usize, tone: &Tone) -> Self {
        let dn = middle(&evidence.frames[at].dn);
        let linear = |off: &dyn Fn(usize) -> f32| {
            let one = |(i, v): (usize, &f32)| tone.decode(v + off(i), i % 3);
            Plane { data: dn.data.iter().enumerate().map(one).collect(), ..dn }
        };
        let random = |i: usize| random_uniform([i as u32, at as u32], 0, 0, [0, 1])[0] - 0.5;
        let slope = Plane::from_fn(dn.width, dn.height, |x, y| {
            let seen = dn.pixel(x, y);
            let of = |c: usize| dn_per_linear(tone, seen[c], c);
            if is_whole(&dn, x, y) { three(of) } else { [0.0; 3] }
        });
        Self { linear: [linear(&|_| 0.0), linear(&random)], slope }
    }

    /// Mean squares of how far colours are from those that are filled in again, and of how far rounding puts them, DN;
    /// sums and number.
    fn off(&self, theta: &Theta) -> [f64; 3] {
        let settings = settings_of(theta);
        let [filled, other] = self.linear.each_ref().map(|linear| mixed(linear, &settings));
        let color = colors(&filled, theta).expect("a mosaic");
        let mut sums = [0.0; 3];
        for (i, slope) in self.slope.data.iter().enumerate() {
            if *slope == 0.0 || i % 3 == color.data[i / 3] as usize {
                continue;
            }
            let dn = |a: f32, b: f32| f64::from((a - b) * slope).powi(2);
            sums[0] += dn(filled.data[i], self.linear[0].data[i]);
            sums[1] += dn(other.data[i], filled.data[i]) + 1.0 / 12.0;
            sums[2] += 1.0;
        }
        sums
    }
}

/// How far colours are from those that are filled in again as `theta` does, in times of what rounding leaves.
fn off(sites: &[Sites], theta: &Theta) -> f64 {
    let mut sums = [0.0; 3];
    for more in sites.iter().map(|s| s.off(theta)) {
        (0..3).for_each(|i| sums[i] += more[i]);
    }
    if sums[2] == 0.0 { f64::INFINITY } else { (sums[0] / sums[1]).sqrt() }
}

/// The middle of a picture, from an even column and row on.
fn middle(dn: &Plane<f32>) -> Plane<f32> {
    let [left, top] = [dn.width, dn.height].map(|side| side.saturating_sub(SIDE_PX) / 4 * 2);
    let [width, height] = [dn.width, dn.height].map(|side| side.min(SIDE_PX));
    Plane::from_fn(width, height, |x, y| {
        let seen = dn.pixel(left + x, top + y);
        [seen[0], seen[1], seen[2]]
    })
}

/// Whether nothing that a filter sees is clipped.
fn is_whole(dn: &Plane<f32>, x: usize, y: usize) -> bool {
    let near = |at: usize, side: usize| at.saturating_sub(REACH_PX)..(at + REACH_PX + 1).min(side);
    let clipped = |v: &f32| *v < 1.0 || *v > 254.0;
    near(y, dn.height).all(|v| near(x, dn.width).all(|u| !dn.pixel(u, v).iter().any(clipped)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;
    use shutterbug::plane::{srgb_decode, srgb_encode};

    /// Tiles with noise behind a camera of `theta`, or smooth ones without.
    fn frame(theta: &Theta, smooth: bool) -> Evidence {
        let source = Plane::from_fn(96, 64, |x, y| {
            let noise = random_normal([x as u32, y as u32], 0, 3, [5, 7]);
            let tile = if (x / 12 + y / 9).is_multiple_of(2) { 60.0 } else { 170.0 };
            [0, 1, 2].map(|c| {
                let dn = if smooth {
                    60.0 + x as f32 + 0.5 * y as f32
                } else {
                    tile + 9.0 * c as f32 + 5.0 * noise[c]
                };
                srgb_decode(dn / 255.0)
            })
        });
        let seen = mixed(&source, &settings_of(theta));
        let data = seen.data.iter().map(|l| (255.0 * srgb_encode(*l)).round().clamp(0.0, 255.0)).collect();
        Evidence::of_one(Plane { data, ..seen })
    }

    /// The parameter that says how colours are filled in.
    fn filled() -> P {
        candidate_of("bayer_mosaic").parameters[1]
    }

    #[test]
    fn each_mosaic_shows_and_what_is_none_does_not() {
        let base = Theta::neutral();
        for pattern in 1..=4 {
            for filter in 0..2 {
                let theta = base.with(P::Mosaic, f64::from(pattern)).with(filled(), f64::from(filter));
                let told = mosaic(&evidence(&theta), &[0], &base);
                assert_eq!(told, [(P::Mosaic, f64::from(pattern)), (filled(), f64::from(filter))]);
            }
        }
        assert_eq!(mosaic(&evidence(&base), &[0], &base), [], "no mosaic");
        assert_eq!(
            mosaic(&frame(&base, true), &[0], &base),
            [],
            "what is smooth is filled in by any pattern"
        );
        let sharpened = base.with(P::Mosaic, 2.0).with(P::Sharpen, 1.0);
        assert_eq!(mosaic(&evidence(&sharpened), &[0], &base), [], "hidden behind a filter");
    }

    fn evidence(theta: &Theta) -> Evidence {
        frame(theta, false)
    }
}
