//! Sharpness from a slanted edge (ISO 12233:2017, annex D): the edge crosses pixels at all their places, so that their
//! values, ordered by distance from it, are the edge four times finer than the pixels. Its slope's spectrum is the
//! response (MTF). What blurs and what sharpens are fitted to the same values: a step, seen by square pixels through a
//! Gaussian, encoded, and sharpened by an unsharp mask as in [`shutterbug::effects`].

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::course::{Line, REACH_PX as BOTH_SIDES_PX};
use super::frames::Encoding;
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;
use shutterbug::plane::stats::erf;

/// Values a pixel along the edge's normal.
const BINS: usize = 4;
/// Furthest from the edge that is looked at, px: no lens of a camera in use blurs further.
const REACH_PX: f64 = 24.0;
/// Smallest and largest slope of the edge against the pixels: less crosses too few of their places, more is nearer to
/// the other axis.
const SLANT: [f64; 2] = [0.017, 0.7];
/// Most rounds of fits.
const ROUNDS: usize = 60;
/// A blurred step leaves no more of the contrast than this: charts leave 2 %, noise, print and round things 4 % and
/// more.
const MOST_LEFT_RMS: f64 = 0.035;
/// Most that an edge may leave its line at the ends of the part that is looked at, px.
const MOST_BENT_PX: f64 = 1.0;
/// Most that leaving its line may add to the width of an edge: what is found by it is the lens's, within a twentieth.
const MOST_BENT_SHARE: f64 = 0.05;
/// Widest lens of which both sides are in reach, px.
const WIDEST_PX: f64 = REACH_PX / 3.0;
/// Widest interval of the lens that says anything, px, or as a share of it.
const WIDEST_HALF: [f64; 2] = [0.3, 0.3];
/// Linear light of a side: beyond, the fit makes up what black or white cut off.
const SIDES: [f64; 2] = [-0.02, 1.02];
/// Weights of the unsharp mask that the effect has.
const AMOUNTS: [f64; 2] = [0.0, 10.0];
/// Regions that are tried where none is given: of the clearest edges, and of the steepest.
const TRIED: [usize; 2] = [6, 6];
/// Smallest window in which an edge is looked for, px: both sides of a lens in use, and lines enough to tell it by.
const LEAST_WINDOW_PX: usize = 24;

/// A part of a picture: left, top, width, height, px.
pub type Region = [usize; 4];

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fitted {
    /// The number.
    pub value: f64,
    /// Half width of its interval.
    pub half: f64,
}

/// What an edge tells.
#[derive(Clone, Debug, Serialize)]
pub struct Edge {
    /// Where it was looked at.
    pub region: Region,
    /// Whether it is nearer to upright.
    pub upright: bool,
    /// Angle against the pixels, degrees.
    pub slant_deg: f64,
    /// Linear light on its dark and on its bright side.
    pub sides: [f64; 2],
    /// Frequency at which half of the contrast is left, cycles a px; none where it is beyond 1.
    pub mtf50: Option<f64>,
    /// Response at 0, 0.01, ... 1 cycles a px.
    pub mtf: Vec<f64>,
    /// Gaussian of the lens, px.
    pub defocus_sigma_px: Fitted,
    /// Weight and standard deviation of the unsharp mask, where there is one.
    pub sharpening: Option<[Fitted; 2]>,
    /// What the fit leaves, of the contrast.
    pub left_rms: f64,
    /// Gaussians of all edges that could be measured where none was asked for, px, this one's the first.
    pub among_px: Vec<f64>,
    /// Encoded values against the distance from the edge, px.
    pub profile: Vec<[f64; 2]>,
}

/// The distance from the edge (px, bright side positive) and the value of each pixel.
struct Points {
    line: Line,
    list: Vec<[f64; 2]>,
    /// The line of pixels of each.
    lines: Vec<usize>,
}

/// Measures the edge in a part of a picture of encoded values.
///
/// # Errors
/// A part that leaves the picture or is too small, without an edge, or with one that is not slanted.
pub fn measure_edge(
    picture: &Plane<f32>,
    region: Region,
    encoding: Encoding,
    path: &std::path::Path,
) -> Result<Edge> {
    let refuse = |found: String, expected: &str| Err(Error::input(path, None, found, expected));
    let [x0, y0, w, h] = region;
    let fits = x0.checked_add(w).is_some_and(|r| r <= picture.width)
        && y0.checked_add(h).is_some_and(|b| b <= picture.height);
    if !fits || w < 16 || h < 16 {
        let found = format!("a part of {w}x{h} px at {x0}, {y0}");
        return refuse(found, "one of at least 16x16 px inside of the picture");
    }
    let expected = "one edge, straight from end to end and slanted by 1 to 35 degrees, between two even surfaces, \
        neither black nor white";
    let Some(points) = points(picture, region, encoding) else {
        return refuse("no straight edge".to_owned(), expected);
    };
    if !(SLANT[0]..=SLANT[1]).contains(&points.line.slant.abs()) {
        let found =
            format!("an edge {:.1} degrees off the pixels", points.line.slant.atan().to_degrees().abs());
        return refuse(found, "one slanted by 1 to 35 degrees, best 5");
    }
    let course = match points.line.course(picture, region, encoding) {
        Ok(course) => course,
        Err(found) => return refuse(found, expected),
    };
    // What was not looked at is not measured.
    let lines = points.list.iter().zip(&points.lines);
    let seen: Vec<[f64; 2]> =
        lines.filter(|(_, line)| course.lines.contains(line)).map(|(p, _)| *p).collect();
    let profile = profile(&seen);
    let shown = profile.first().zip(profile.last()).map_or(0.0, |(first, last)| last[0].min(-first[0]));
    if shown < BOTH_SIDES_PX {
        return refuse(format!("an edge that shows {shown:.1} px of a side: too few places"), expected);
    }
    let mtf = response(&profile, encoding);
    let mut fit = fit(&profile, encoding);
    if let Some(found) = fit.doubtful().or_else(|| fit.widened(course.bend_px)) {
        return refuse(found, expected);
    }
    let half = mtf.iter().position(|m| *m < 0.5);
    let mtf50 = half.filter(|i| *i > 0).map(|i| 0.01 * (i as f64 - (0.5 - mtf[i]) / (mtf[i - 1] - mtf[i])));
    Ok(Edge {
        region,
        upright: points.line.upright,
        slant_deg: points.line.slant.atan().to_degrees().abs(),
        sides: fit.sides,
        mtf50,
        mtf,
        defocus_sigma_px: fit.sigma_px,
        sharpening: fit.sharpening,
        left_rms: fit.left_rms,
        among_px: vec![fit.sigma_px.value],
        profile,
    })
}

/// The edge in green alone, where each colour is sharper than all together, beyond both intervals: then they lie apart,
/// and the lens is no softer than one of them.
pub fn sharper_green(
    together: &Edge,
    picture: &Plane<f32>,
    encoding: Encoding,
    path: &std::path::Path,
) -> Option<Edge> {
    let of = |colour: usize| {
        let one = |p: &[f32]| [p[colour]; 3];
        let data = picture.data.chunks_exact(3).flat_map(one).collect();
        measure_edge(&Plane { data, ..picture.clone() }, together.region, encoding, path).ok()
    };
    if picture.channels != 3 {
        return None;
    }
    let sharpest = together.defocus_sigma_px.value - together.defocus_sigma_px.half;
    let sharper = |e: &Edge| e.defocus_sigma_px.value + e.defocus_sigma_px.half < sharpest;
    let all: Option<Vec<Edge>> = (0..3).map(|colour| of(colour).filter(sharper)).collect();
    all?.into_iter().nth(1)
}

/// Measures the edges of windows all over the picture and gives the sharpest: what lies in one plane with the sharpest
/// is no sharper than the lens, and shadows, round things and what is out of focus are softer.
///
/// # Errors
/// A picture without a slanted edge; what is wrong with the clearest, where none of those tried can be measured.
pub fn find_edge(picture: &Plane<f32>, encoding: Encoding, path: &std::path::Path) -> Result<Edge> {
    let (mut first, mut found) = (None, Vec::new());
    let measured: Vec<Result<Edge>> = candidates(picture, encoding)
        .par_iter()
        .map(|region| measure_edge(picture, *region, encoding, path))
        .collect();
    for one in measured {
        match one {
            Ok(edge) => found.push(edge),
            Err(error) => first = first.or(Some(error)),
        }
    }
    // By what it is at most, so that no edge is the sharpest for being known the worst.
    let most = |e: &Edge| e.defocus_sigma_px.value + e.defocus_sigma_px.half;
    found.sort_by(|a, b| most(a).total_cmp(&most(b)));
    let among_px: Vec<f64> = found.iter().map(|e| e.defocus_sigma_px.value).collect();
    let expected = "a straight edge slanted by 1 to 35 degrees, or --region where it is";
    match found.into_iter().next() {
        Some(edge) => Ok(Edge { among_px, ..edge }),
        None => Err(first.unwrap_or_else(|| Error::input(path, None, "no slanted edge", expected))),
    }
}

/// Windows with an edge, of several sizes: the straightest for their contrast, then the sharpest.
fn candidates(picture: &Plane<f32>, encoding: Encoding) -> Vec<Region> {
    let least = picture.width.min(picture.height);
    let mut all: Vec<([f64; 2], Region)> = Vec::new();
    let mut side = (least / 6).clamp(32, 96);
    while side >= LEAST_WINDOW_PX {
        for y in (0..=picture.height.saturating_sub(side)).step_by(side / 2) {
            for x in (0..=picture.width.saturating_sub(side)).step_by(side / 2) {
                let region = [x, y, side.min(picture.width), side.min(picture.height)];
                let Some(points) = points(picture, region, encoding) else { continue };
                if (SLANT[0]..=SLANT[1]).contains(&points.line.slant.abs())
                    && points.line.course(picture, region, encoding).is_ok()
                {
                    all.push((worth(&points.list), region));
                }
            }
        }
        side /= 2;
    }
    let mut chosen: Vec<Region> = Vec::new();
    for (order, tried) in TRIED.into_iter().enumerate() {
        all.sort_by(|a, b| b.0[order].total_cmp(&a.0[order]));
        let new: Vec<Region> = all.iter().map(|b| b.1).filter(|r| !chosen.contains(r)).take(tried).collect();
        chosen.extend(new);
    }
    chosen
}

/// Contrast between both sides over what is left beside the profile: the wider the profile, the more; and the steeper.
fn worth(list: &[[f64; 2]]) -> [f64; 2] {
    let profile = profile(list);
    let (Some(first), Some(last)) = (profile.first(), profile.last()) else { return [0.0; 2] };
    let at = |d: f64| {
        let i = ((d - first[0]) * BINS as f64).round().clamp(0.0, profile.len() as f64 - 1.0) as usize;
        profile[i][1]
    };
    let left = list.iter().map(|p| (p[1] - at(p[0])).powi(2)).sum::<f64>() / list.len().max(1) as f64;
    let contrast = (last[1] - first[1]).abs() / (left.sqrt() + 2e-3);
    // Over two bins: half of the slope of a step that is one pixel wide.
    let steepest = profile.windows(3).map(|w| (w[2][1] - w[0][1]).abs()).fold(0.0, f64::max);
    let steep = steepest / (last[1] - first[1]).abs().max(1e-9);
    // Wide profiles are worth more: they show both sides.
    [contrast * (last[0] - first[0]).min(REACH_PX), contrast * steep.min(1.0)]
}

/// Brightness of the pixels of a region, row by row, encoded. Colours are mixed as light: the mean of encoded values is
/// no blurred edge's where one colour rises and another falls.
fn brightness(picture: &Plane<f32>, [x0, y0, w, h]: Region, encoding: Encoding) -> Vec<f64> {
    let mixed = |i: usize| {
        let p = picture.pixel(x0 + i % w, y0 + i / w);
        let light = p.iter().map(|v| encoding.decode(*v)).sum::<f32>() / p.len() as f32;
        f64::from(encoding.encode(light))
    };
    (0..w * h).map(mixed).collect()
}

/// Finds the line of the edge: where each line of pixels is steepest.
fn points(picture: &Plane<f32>, region: Region, encoding: Encoding) -> Option<Points> {
    let [.., w, h] = region;
    let greys = brightness(picture, region, encoding);
    let grey = |x: usize, y: usize| greys[y * w + x];
    let slopes = |dx: usize, dy: usize| -> f64 {
        (0..h - dy)
            .flat_map(|y| (0..w - dx).map(move |x| (x, y)))
            .map(|(x, y)| (grey(x + dx, y + dy) - grey(x, y)).powi(2))
            .sum()
    };
    let upright = slopes(1, 0) >= slopes(0, 1);
    let (across, lines) = if upright { (w, h) } else { (h, w) };
    let at = |i: usize, line: usize| if upright { grey(i, line) } else { grey(line, i) };
    // Everything is weighed around the line as it is known: first the middle of the strongest slope, then the line.
    let mut line: Option<[f64; 2]> = None;
    for round in 0..4 {
        let reach = [across as f64, 12.0, 8.0, 6.0][round];
        let centre = |j: usize| -> Option<[f64; 3]> {
            let middle = line.map(|[a, b]| a + b * j as f64);
            let (mut sum, mut weights) = (0.0, 0.0);
            for i in 0..across - 1 {
                let x = i as f64 + 1.0;
                let near = middle.map_or(1.0, |m| (1.0 - ((x - m) / reach).powi(2)).max(0.0));
                // The fourth power at first: noise of flat places adds up.
                let slope = at(i + 1, j) - at(i, j);
                let weight = near * if round == 0 { slope.powi(4) } else { slope * slope };
                (sum, weights) = (sum + weight * x, weights + weight);
            }
            (weights > 1e-9).then(|| [j as f64, sum / weights, weights])
        };
        let centres: Vec<[f64; 3]> = (0..lines).filter_map(centre).collect();
        let near = straight(&centres, lines)?;
        if round == 3 && is_bent(&centres, near) {
            return None;
        }
        line = Some(near);
    }
    let [a, b] = line?;
    let (mut list, mut of_line): (Vec<[f64; 2]>, Vec<usize>) = Default::default();
    let norm = (1.0 + b * b).sqrt();
    for j in 0..lines {
        for i in 0..across {
            let d = (i as f64 + 0.5 - (a + b * j as f64)) / norm;
            if d.abs() <= REACH_PX {
                list.push([d, at(i, j)]);
                of_line.push(j);
            }
        }
    }
    let side = |sign: f64| {
        let side: Vec<f64> = list.iter().filter(|p| p[0] * sign > 3.0).map(|p| p[1]).collect();
        (side.len() > lines).then(|| side.iter().sum::<f64>() / side.len() as f64)
    };
    if side(1.0)? < side(-1.0)? {
        list.iter_mut().for_each(|p| p[0] = -p[0]);
    }
    Some(Points { line: Line { upright, start: a, slant: b }, list, lines: of_line })
}

/// Whether the centres follow an arc rather than the line: a round thing's rim is blurred by its own bend.
fn is_bent(centres: &[[f64; 3]], [a, b]: [f64; 2]) -> bool {
    let n = centres.len() as f64;
    let middle = centres.iter().map(|c| c[0]).sum::<f64>() / n;
    let square = |c: &[f64; 3]| (c[0] - middle).powi(2);
    let mean = centres.iter().map(square).sum::<f64>() / n;
    let offs: Vec<[f64; 2]> = centres.iter().map(|c| [square(c) - mean, c[1] - a - b * c[0]]).collect();
    let along = offs.iter().map(|o| o[0] * o[0]).sum::<f64>().max(1e-9);
    let bend = offs.iter().map(|o| o[0] * o[1]).sum::<f64>() / along;
    let left = offs.iter().map(|o| (o[1] - bend * o[0]).powi(2)).sum::<f64>() / n;
    let reach = centres.iter().map(square).fold(0.0, f64::max);
    bend.abs() * reach > MOST_BENT_PX && bend.abs() > 4.0 * (left / along).sqrt()
}

/// The line through centres, by least squares, without the tenth that lies furthest from it.
fn straight(centres: &[[f64; 3]], lines: usize) -> Option<[f64; 2]> {
    let mut kept = centres.to_vec();
    let mut line = [0.0; 2];
    for _ in 0..3 {
        let n = kept.len() as f64;
        if kept.len() * 2 < lines {
            return None;
        }
        let (mx, my) =
            (kept.iter().map(|c| c[0]).sum::<f64>() / n, kept.iter().map(|c| c[1]).sum::<f64>() / n);
        let sxx: f64 = kept.iter().map(|c| (c[0] - mx).powi(2)).sum();
        let sxy: f64 = kept.iter().map(|c| (c[0] - mx) * (c[1] - my)).sum();
        let b = sxy / sxx.max(1e-9);
        line = [my - b * mx, b];
        let off = |c: &[f64; 3]| (c[1] - line[0] - line[1] * c[0]).abs();
        kept.sort_by(|p, q| off(p).total_cmp(&off(q)));
        kept.truncate(kept.len() - kept.len() / 10);
    }
    Some(line)
}

/// Mean values by distance, four a pixel.
fn profile(list: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let count = (2.0 * REACH_PX) as usize * BINS;
    let mut bins = vec![[0.0f64; 3]; count];
    for [d, v] in list {
        let at = ((d + REACH_PX) * BINS as f64).floor();
        if (0.0..count as f64).contains(&at) {
            let bin = &mut bins[at as usize];
            (bin[0], bin[1], bin[2]) = (bin[0] + 1.0, bin[1] + d, bin[2] + v);
        }
    }
    // The longest run of bins with values, about the edge.
    let full = |i: usize| bins[i][0] > 0.0;
    let middle = count / 2;
    let from = (0..middle).rev().find(|i| !full(*i)).map_or(0, |i| i + 1);
    let to = (middle..count).find(|i| !full(*i)).unwrap_or(count);
    let mean = |i: usize| [(i as f64 + 0.5) / BINS as f64 - REACH_PX, bins[i][2] / bins[i][0]];
    (from..to).map(mean).collect()
}

/// Response at 0, 0.01, ... 1 cycles a px of linear light.
fn response(profile: &[[f64; 2]], encoding: Encoding) -> Vec<f64> {
    let linear: Vec<f64> = profile.iter().map(|p| f64::from(encoding.decode(p[1] as f32))).collect();
    let step = 1.0 / BINS as f64;
    let slope: Vec<[f64; 2]> = (1..linear.len().max(2) - 1)
        .map(|i| [profile[i][0], 0.5 * (linear[i + 1] - linear[i - 1])])
        .collect();
    let reach = profile.iter().map(|p| p[0].abs()).fold(0.0, f64::max);
    // Hamming's window about the edge, as in the standard.
    let windowed: Vec<[f64; 2]> =
        slope.iter().map(|[d, s]| [*d, s * (0.54 + 0.46 * (PI * d / reach.max(1e-9)).cos())]).collect();
    let at = |f: f64| {
        let [c, s] = windowed.iter().fold([0.0; 2], |a, [d, v]| {
            let (sin, cos) = (TAU * f * d).sin_cos();
            [a[0] + v * cos, a[1] + v * sin]
        });
        // The difference over two bins, and the bin itself, are filters of their own.
        let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
        c.hypot(s) / (sinc(2.0 * f * step) * sinc(f * step)).max(0.1)
    };
    let whole = at(0.0).max(1e-12);
    (0..=100).map(|i| at(0.01 * f64::from(i)) / whole).collect()
}

struct Fit {
    /// Where the step is against the line of the edge, px.
    place_px: f64,
    sides: [f64; 2],
    sigma_px: Fitted,
    sharpening: Option<[Fitted; 2]>,
    left_rms: f64,
}

impl Fit {
    /// Why this is no edge, where it is none: the numbers would be of something else.
    fn doubtful(&self) -> Option<String> {
        let [least, share] = WIDEST_HALF;
        let Fitted { value, half } = self.sigma_px;
        if !(self.left_rms <= MOST_LEFT_RMS) {
            let percent = 100.0 * self.left_rms;
            return Some(format!("values of which a blurred step leaves {percent:.1} % of the contrast"));
        }
        if !self.sides.iter().all(|s| (SIDES[0]..=SIDES[1]).contains(s)) {
            let [dark, bright] = self.sides;
            return Some(format!(
                "sides of linear light {dark:.3} and {bright:.3}: black or white cut them off"
            ));
        }
        if self.place_px.abs() > value.max(1.0) {
            let beside = self.place_px.abs();
            return Some(format!("a step {beside:.1} px beside the line along which values change most"));
        }
        if value > WIDEST_PX {
            return Some(format!("an edge {value:.1} px wide, of which no side is in reach"));
        }
        let known = half <= least.max(share * value);
        (!known).then(|| format!("an edge of sigma {value:.3} +- {half:.3} px: too faint, or too few places"))
    }
}

impl Fit {
    /// Takes what the edge leaves its line by (standard deviation, px) into the interval: it widens the profile as the
    /// lens does. Why this is no straight edge, where that is too much.
    fn widened(&mut self, bend_px: f64) -> Option<String> {
        let Fitted { value, half } = &mut self.sigma_px;
        // Squares add up, and those of the pixel's own side with them.
        let (square, bend) = (*value * *value + 1.0 / 12.0, bend_px * bend_px);
        if bend > 2.0 * MOST_BENT_SHARE * square {
            return Some(format!("an edge that leaves its line by {bend_px:.2} px rms"));
        }
        *half += *value - (*value * *value - bend).max(0.0).sqrt();
        None
    }
}

/// Where fits of the mask begin.
const MASKS: [[f64; 2]; 3] = [[0.5, 0.7], [0.5, 1.5], [1.0, 1.0]];

/// Fits the step without and with an unsharp mask; the mask is taken where it pays (Schwarz's criterion).
fn fit(profile: &[[f64; 2]], encoding: Encoding) -> Fit {
    let n = profile.len() as f64;
    let linear = |i: usize| f64::from(encoding.decode(profile[i][1] as f32));
    let edge = 2 * BINS;
    let mean = |range: std::ops::Range<usize>| {
        let count = range.len().max(1) as f64;
        range.map(linear).sum::<f64>() / count
    };
    let (dark, bright) =
        (mean(0..edge.min(profile.len())), mean(profile.len().saturating_sub(edge)..profile.len()));
    let plain = [0.5, 1.0, 2.0].map(|sigma| descend(profile, encoding, vec![0.0, dark, bright, sigma]));
    let plain = best(plain.into_iter());
    let [x, d, b, s] = [0, 1, 2, 3].map(|i| plain.0[i]);
    let masks = MASKS.iter().flat_map(|[amount, radius]| {
        [s, 0.6 * s + 0.1, s + 0.4].map(|s| descend(profile, encoding, vec![x, d, b, s, *amount, *radius]))
    });
    let masked = best(masks);
    let criterion = |cost: f64, count: usize| n * (cost / n).max(1e-12).ln() + count as f64 * n.ln();
    // A mask that could as well be none, or many times as strong, is none that the edge shows.
    let is_mask = (AMOUNTS[0]..=AMOUNTS[1]).contains(&masked.0[4])
        && deviations(profile, encoding, &masked.0, masked.1)[4] < 0.5 * masked.0[4];
    let sharpened = criterion(masked.1, 6) < criterion(plain.1, 4) && is_mask;
    let (values, cost) = if sharpened { masked } else { plain };
    let half = deviations(profile, encoding, &values, cost);
    let of = |i: usize| Fitted { value: values[i].abs(), half: 1.96 * half[i] };
    let contrast = profile.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max)
        - profile.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    Fit {
        place_px: values[0],
        sides: [values[1], values[2]],
        sigma_px: of(3),
        sharpening: sharpened.then(|| [of(4), of(5)]),
        left_rms: (cost / n).sqrt() / contrast.max(1e-9),
    }
}

fn best(fits: impl Iterator<Item = (Vec<f64>, f64)>) -> (Vec<f64>, f64) {
    fits.min_by(|a, b| a.1.total_cmp(&b.1)).expect("starts there are")
}

/// Encoded values of the model at the profile's places: place of the edge, its sides, the lens's Gaussian, and the
/// mask's weight and Gaussian, if there is one.
fn model(profile: &[[f64; 2]], encoding: Encoding, v: &[f64]) -> Vec<f64> {
    // Gaussian and square pixel together; the mean of a bin is that of its middle to second order.
    let step = |d: f64| {
        let s = v[3].abs().max(0.02);
        let primitive = |t: f64| {
            // Integral of the Gaussian's distribution function.
            let z = t / s;
            t * 0.5 * (1.0 + erf(z / 2f64.sqrt())) + s * (-0.5 * z * z).exp() / TAU.sqrt()
        };
        primitive(d + 0.5) - primitive(d - 0.5)
    };
    let encoded = |d: f64| {
        let light = v[1] + (v[2] - v[1]) * step(d - v[0]);
        f64::from(encoding.encode(light.clamp(0.0, 1.0) as f32))
    };
    if v.len() < 6 {
        return profile.iter().map(|p| encoded(p[0])).collect();
    }
    let radius = v[5].abs().clamp(0.2, 8.0);
    // The mask is a sum over pixels, as effects make it: at whole steps along the normal, which is nearly an axis.
    let reach = (3.0 * radius).ceil() as i32;
    let weights: Vec<f64> =
        (-reach..=reach).map(|k| (-0.5 * (f64::from(k) / radius).powi(2)).exp()).collect();
    let whole: f64 = weights.iter().sum();
    let masked = |d: f64| {
        let blurred: f64 =
            (-reach..=reach).zip(&weights).map(|(k, w)| w * encoded(d + f64::from(k))).sum::<f64>() / whole;
        let own = encoded(d);
        (own + v[4] * (own - blurred)).clamp(0.0, 1.0)
    };
    profile.iter().map(|p| masked(p[0])).collect()
}

fn cost(profile: &[[f64; 2]], encoding: Encoding, v: &[f64]) -> f64 {
    model(profile, encoding, v).iter().zip(profile).map(|(m, p)| (p[1] - m).powi(2)).sum()
}

/// Derivatives of the model by differences.
fn slopes(profile: &[[f64; 2]], encoding: Encoding, v: &[f64]) -> DMatrix<f64> {
    const STEP: f64 = 1e-3;
    let columns: Vec<Vec<f64>> = (0..v.len())
        .map(|i| {
            let moved = |by: f64| {
                let mut v = v.to_vec();
                v[i] += by;
                model(profile, encoding, &v)
            };
            moved(STEP).iter().zip(moved(-STEP)).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
        })
        .collect();
    DMatrix::from_fn(profile.len(), v.len(), |r, c| columns[c][r])
}

/// Levenberg-Marquardt from a start: values and cost.
fn descend(profile: &[[f64; 2]], encoding: Encoding, start: Vec<f64>) -> (Vec<f64>, f64) {
    let (mut v, mut damping) = (start, 1e-3);
    let mut now = cost(profile, encoding, &v);
    for _ in 0..ROUNDS {
        let j = slopes(profile, encoding, &v);
        let left = DVector::from_iterator(
            profile.len(),
            model(profile, encoding, &v).iter().zip(profile).map(|(m, p)| p[1] - m),
        );
        let (normal, right) = (j.transpose() * &j, j.transpose() * left);
        let before = now;
        while damping < 1e6 {
            let mut damped = normal.clone();
            (0..v.len()).for_each(|i| damped[(i, i)] += damping * (normal[(i, i)] + 1e-12));
            let Some(step) = damped.cholesky().map(|c| c.solve(&right)) else {
                damping *= 10.0;
                continue;
            };
            let next: Vec<f64> = v.iter().zip(step.iter()).map(|(a, b)| a + b).collect();
            let lower = cost(profile, encoding, &next);
            if lower < now {
                (v, now) = (next, lower);
                damping = (damping * 0.2).max(1e-9);
                break;
            }
            damping *= 5.0;
        }
        if !(before - now > 1e-9 * before) {
            break;
        }
    }
    (v, now)
}

fn deviations(profile: &[[f64; 2]], encoding: Encoding, v: &[f64], cost: f64) -> Vec<f64> {
    let j = slopes(profile, encoding, v);
    let variance = cost / (profile.len() as f64 - v.len() as f64).max(1.0);
    match (j.transpose() * &j).try_inverse() {
        Some(c) => (0..v.len()).map(|i| (variance * c[(i, i)]).max(0.0).sqrt()).collect(),
        None => vec![f64::INFINITY; v.len()],
    }
}

#[cfg(test)]
mod tests;
