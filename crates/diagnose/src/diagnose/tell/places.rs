//! Where the gap lies: differences before and after, by what they may depend on.

use std::collections::BTreeMap;

use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::compared::Compared;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::report::{Bin, Measure, Where};
use shutterbug::effects::gaussian::blurred;
use shutterbug::plane::{Plane, metrics};

/// Sums of one bin.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    before: f64,
    after: f64,
    bias_before: f64,
    bias_after: f64,
    count: f64,
}

impl Sums {
    fn add(&mut self, before: f32, after: f32) {
        let (b, a) = (f64::from(before), f64::from(after));
        self.before += b.abs();
        self.after += a.abs();
        self.bias_before += b;
        self.bias_after += a;
        self.count += 1.0;
    }

    fn bin(&self, from: f64, to: f64, label: String, total: f64) -> Bin {
        let n = self.count.max(1.0);
        Bin {
            from,
            to,
            label,
            before: self.before / n,
            after: self.after / n,
            bias_before: self.bias_before / n,
            bias_after: self.bias_after / n,
            weight: self.count / total.max(1.0),
        }
    }
}

/// A profile under construction: sums by the number of the bin.
#[derive(Default)]
struct Profile(BTreeMap<usize, Sums>);

impl Profile {
    fn add(&mut self, bin: usize, before: f32, after: f32) {
        self.0.entry(bin).or_default().add(before, after);
    }

    fn bins(&self, width: f64, label: impl Fn(f64, f64) -> String) -> Vec<Bin> {
        let total: f64 = self.0.values().map(|s| s.count).sum();
        self.0
            .iter()
            .map(|(&i, s)| {
                let (from, to) = (i as f64 * width, (i + 1) as f64 * width);
                s.bin(from, to, label(from, to), total)
            })
            .collect()
    }
}

const RADIUS_PX: f64 = 20.0;
const SPEED_PX_PER_S: f64 = 50.0;
const DIRECTION_DEG: f64 = 30.0;
const INTENSITY_DN: f64 = 16.0;
/// Beyond this all speeds share a bin, px/s.
const MOST_SPEED: f64 = 2000.0;

/// All profiles and the sentences.
pub(crate) fn places(
    frames: &[Compared<'_>],
    forward: &Forward,
    evidence: &Evidence,
    nothing: bool,
) -> Where {
    let k = &forward.intrinsics;
    let mut by: [Profile; 8] = Default::default();
    for f in frames {
        let (w, h) = (f.real.width, f.real.height);
        for y in 0..h {
            for x in 0..w {
                if f.mask.is_some_and(|m| m.pixel(x, y)[0] <= 0.5) {
                    continue;
                }
                let v = f.sharp.velocity.pixel(x, y);
                let speed = f64::from(v[0].hypot(v[1])).min(MOST_SPEED);
                let degrees = f64::from(v[1].atan2(v[0])).to_degrees().rem_euclid(360.0);
                let (dx, dy) = (x as f64 + 0.5 - k.cx, y as f64 + 0.5 - k.cy);
                let radius = (dx.hypot(dy) / RADIUS_PX) as usize;
                let (real, before, after) = (f.real.pixel(x, y), f.before.pixel(x, y), f.after.pixel(x, y));
                for c in 0..3 {
                    let (b, a) = (real[c] - before[c], real[c] - after[c]);
                    by[0].add(y, b, a);
                    by[1].add(x, b, a);
                    by[2].add(radius, b, a);
                    by[3].add((speed / SPEED_PX_PER_S) as usize, b, a);
                    if speed > 20.0 {
                        by[4].add((degrees / DIRECTION_DEG) as usize, b, a);
                    }
                    by[5].add((f64::from(before[c]).clamp(0.0, 255.0) / INTENSITY_DN) as usize, b, a);
                    by[6].add(c, b, a);
                    by[7].add(f.index, b, a);
                }
            }
        }
    }
    let range = |unit: &'static str| move |from: f64, to: f64| format!("{from:.0}-{to:.0} {unit}");
    let named = |name: &'static str| move |from: f64, _: f64| format!("{name} {from:.0}");
    let mut places = Where {
        summary: Vec::new(),
        by_row: by[0].bins(1.0, named("row")),
        by_column: by[1].bins(1.0, named("column")),
        by_radius: by[2].bins(RADIUS_PX, range("px")),
        by_speed: by[3].bins(SPEED_PX_PER_S, range("px/s")),
        by_direction: by[4].bins(DIRECTION_DEG, range("deg")),
        by_intensity: by[5].bins(INTENSITY_DN, range("DN")),
        by_channel: by[6].bins(1.0, |c, _| ["red", "green", "blue"][c as usize].to_owned()),
        by_frequency: frequencies(frames),
        by_object: objects(frames, forward, evidence),
        by_frame: by[7].bins(1.0, |frame, _| {
            let at = evidence.frames.iter().find(|f| f.index == frame as usize).map_or(0.0, |f| f.start_s);
            format!("frame {frame:.0}, {:.3} s", at - evidence.frames[0].start_s)
        }),
    };
    places.summary = super::sentences::sentences(&places, frames, nothing);
    places
}

/// Bands between Gaussians of growing width: the share of the difference at each scale.
fn frequencies(frames: &[Compared<'_>]) -> Vec<Bin> {
    let edges = [0.0f32, 1.0, 2.0, 4.0, 8.0, 16.0];
    let mut sums = vec![Sums::default(); edges.len()];
    for f in frames {
        let minus = |other: &Plane<f32>| {
            let data = f.real.data.iter().zip(&other.data).map(|(r, s)| r - s).collect();
            Plane { data, ..f.real.clone() }
        };
        let (mut before, mut after) = (minus(f.before), minus(f.after));
        for (i, sum) in sums.iter_mut().enumerate() {
            let last = i + 1 == edges.len();
            let soft = |p: &Plane<f32>| {
                if last { Plane::new(p.width, p.height, 3) } else { blurred(p, f64::from(edges[i + 1])) }
            };
            let (b, a) = (soft(&before), soft(&after));
            for j in (0..b.data.len()).filter(|&j| f.mask.is_none_or(|m| m.data[j / 3] > 0.5)) {
                sum.add(before.data[j] - b.data[j], after.data[j] - a.data[j]);
            }
            (before, after) = (b, a);
        }
    }
    let total: f64 = sums.iter().map(|s| s.count).sum();
    sums.iter()
        .enumerate()
        .map(|(i, s)| {
            let from = f64::from(edges[i]);
            let to = edges.get(i + 1).map_or(f64::MAX, |e| f64::from(*e));
            let label = match edges.get(i + 1) {
                Some(to) => format!("details of {from:.0}-{to:.0} px"),
                None => format!("beyond {from:.0} px"),
            };
            s.bin(from, to, label, total)
        })
        .collect()
}

/// By the nearest object of the scene at each pixel (a few samples a pixel suffice: every fourth is looked at).
fn objects(frames: &[Compared<'_>], forward: &Forward, evidence: &Evidence) -> Vec<Bin> {
    let mut by = Profile::default();
    for f in frames {
        let Some(at) = evidence.frames.iter().position(|r| r.index == f.index) else { continue };
        let ids = forward.objects(at, 4);
        for (y, x, id) in ids {
            if f.mask.is_some_and(|m| m.pixel(x, y)[0] <= 0.5) {
                continue;
            }
            let (real, before, after) = (f.real.pixel(x, y), f.before.pixel(x, y), f.after.pixel(x, y));
            (0..3).for_each(|c| by.add(id, real[c] - before[c], real[c] - after[c]));
        }
    }
    let names = forward.object_names();
    by.bins(1.0, |from, _| names.get(from as usize).cloned().unwrap_or_default())
}

/// Measures for people: mean absolute difference, PSNR and SSIM.
pub(crate) fn measures(frames: &[Compared<'_>]) -> Vec<Measure> {
    let bytes = |p: &Plane<f32>| Plane {
        width: p.width,
        height: p.height,
        channels: 3,
        data: p.data.iter().map(|v| (v + 0.5).clamp(0.0, 255.0) as u8).collect::<Vec<u8>>(),
    };
    let mut sums = [[0.0f64; 2]; 3];
    for f in frames {
        let real = bytes(f.real);
        for (i, simulated) in [bytes(f.before), bytes(f.after)].iter().enumerate() {
            sums[0][i] += metrics::mean_absolute_difference(&real, simulated);
            sums[1][i] += metrics::psnr_db(&real, simulated).min(99.0);
            sums[2][i] += ssim(&real, simulated);
        }
    }
    let n = frames.len().max(1) as f64;
    [("mean_absolute_difference", "DN"), ("psnr", "dB"), ("ssim", "")]
        .into_iter()
        .zip(sums)
        .map(|((name, unit), [before, after])| Measure {
            name: name.to_owned(),
            unit: unit.to_owned(),
            before: before / n,
            after: after / n,
        })
        .collect()
}

/// Structural similarity (Wang et al. 2004) of luma, with means over blocks of 8x8 px.
fn ssim(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    const C1: f64 = 6.5025;
    const C2: f64 = 58.5225;
    let luma = |p: &[u8]| 0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2]);
    let (mut sum, mut count) = (0.0, 0.0);
    for y0 in (0..a.height.saturating_sub(7)).step_by(4) {
        for x0 in (0..a.width.saturating_sub(7)).step_by(4) {
            let mut m = [0.0f64; 5];
            for y in y0..y0 + 8 {
                for x in x0..x0 + 8 {
                    let (u, v) = (luma(a.pixel(x, y)), luma(b.pixel(x, y)));
                    m = [m[0] + u, m[1] + v, m[2] + u * u, m[3] + v * v, m[4] + u * v];
                }
            }
            let m = m.map(|v| v / 64.0);
            let (va, vb, cov) = (m[2] - m[0] * m[0], m[3] - m[1] * m[1], m[4] - m[0] * m[1]);
            sum += (2.0 * m[0] * m[1] + C1) * (2.0 * cov + C2)
                / ((m[0] * m[0] + m[1] * m[1] + C1) * (va + vb + C2));
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}
