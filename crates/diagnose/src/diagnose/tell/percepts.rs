//! The task-level gap: corners, lines and blobs that image processing finds in real and in simulated frames, and how
//! many of them agree. A program that tracks corners does not care for grey levels; it cares whether its percepts are
//! where they would be in reality ("dots and lines represent percepts": Fig. 6 of the paper).
//!
//! Found by the crate `imageproc` with the same thresholds in every picture: FAST-9 corners, lines by Canny and Hough
//! with the longest run of edge pixels as their ends, blobs as connected components of what is brighter or darker than
//! its surroundings. Two percepts agree if each is the other's nearest and they lie no further apart than the
//! tolerance.

use image::{GrayImage, Luma};
use imageproc::contrast::adaptive_threshold;
use imageproc::corners::corners_fast9;
use imageproc::edges::canny;
use imageproc::hough::{LineDetectionOptions, detect_lines};
use imageproc::region_labelling::{Connectivity, connected_components};
use imageproc::suppress::local_maxima;

use shutterbug::plane::Plane;

/// Difference from the circle around it that makes a corner, DN.
const CORNER_DN: u8 = 24;
/// Gradients (Sobel, DN) at which an edge goes on, and at which it begins.
const EDGE_DN: [f32; 2] = [60.0, 140.0];
/// Difference from the mean of the surroundings that makes a blob, DN.
const BLOB_DN: i32 = 14;
/// Most percepts of a kind a picture: the strongest.
const MOST: usize = 250;
/// Angle up to which lines agree, rad.
const ANGLE_RAD: f32 = 0.06;

/// What image processing finds in one picture; px, the centre of the first pixel at (0.5, 0.5).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOf {
    /// `[x, y]`.
    pub corners: Vec<[f32; 2]>,
    /// `[x, y, x, y]` of both ends.
    pub lines: Vec<[f32; 4]>,
    /// `[x, y, radius]` of the disc of the same area.
    pub blobs: Vec<[f32; 3]>,
}

/// Percepts of one kind in two pictures of the same frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Whether each percept of the first picture has one in the second.
    pub matched: Vec<bool>,
    /// Mean distance of those that agree, px; 0 where none does.
    pub offset_px: f64,
    /// Twice the number of pairs over the number of percepts in both pictures: 1 if all agree; 1 where there are none.
    pub share: f64,
}

/// How far apart percepts may lie to be the same one, px: a hundredth of the width.
pub fn tolerance_px(width: usize) -> f32 {
    (0.01 * width as f32).max(2.0)
}

/// Finds corners, lines and blobs. `picture`: shape `[height, width, 3]`, 8-bit.
pub fn find(picture: &Plane<u8>) -> PictureOf {
    let gray = GrayImage::from_fn(picture.width as u32, picture.height as u32, |x, y| {
        let p = picture.pixel(x as usize, y as usize);
        let luma = 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]);
        Luma([(luma + 0.5) as u8])
    });
    // Below this no circle around a pixel and no neighbourhood fits.
    if picture.width < 16 || picture.height < 16 {
        return PictureOf::default();
    }
    PictureOf { corners: corners(&gray), lines: lines(&gray), blobs: blobs(&gray) }
}

fn corners(gray: &GrayImage) -> Vec<[f32; 2]> {
    let mut found = local_maxima(&corners_fast9(gray, CORNER_DN), 3);
    found.sort_by(|a, b| b.score.total_cmp(&a.score).then((a.y, a.x).cmp(&(b.y, b.x))));
    found.iter().take(MOST).map(|c| [c.x as f32 + 0.5, c.y as f32 + 0.5]).collect()
}

fn lines(gray: &GrayImage) -> Vec<[f32; 4]> {
    let edges = canny(gray, EDGE_DN[0], EDGE_DN[1]);
    let shortest = (0.1 * gray.width().min(gray.height()) as f32).max(12.0);
    let options = LineDetectionOptions { vote_threshold: shortest as u32, suppression_radius: 4 };
    let mut found: Vec<(f32, [f32; 4])> = detect_lines(&edges, options)
        .iter()
        .filter_map(|l| longest_run(&edges, l.r, (l.angle_in_degrees as f32).to_radians()))
        .map(|l| ((l[2] - l[0]).hypot(l[3] - l[1]), l))
        .filter(|(length, _)| *length >= shortest)
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<[f32; 4]> = Vec::new();
    for (_, line) in found {
        // Neighbouring cells of the Hough space show one edge several times.
        if kept.len() < MOST && !kept.iter().any(|k| lines_apart(k, &line, 3.0).is_some()) {
            kept.push(line);
        }
    }
    kept
}

/// The longest run of edge pixels along `x cos + y sin = r`, gaps of up to 3 px bridged, straightened by least squares.
fn longest_run(edges: &GrayImage, r: f32, angle: f32) -> Option<[f32; 4]> {
    const GAP_PX: i32 = 3;
    let (sin, cos) = angle.sin_cos();
    let at =
        |s: i32, off: f32| [(r + 0.5 + off) * cos - s as f32 * sin, (r + 0.5 + off) * sin + s as f32 * cos];
    let edge = |[x, y]: [f32; 2]| {
        let (x, y) = (x.round(), y.round());
        let inside = x >= 0.0 && y >= 0.0 && x < edges.width() as f32 && y < edges.height() as f32;
        (inside && edges.get_pixel(x as u32, y as u32)[0] > 0).then_some([x, y])
    };
    let reach = edges.width().max(edges.height()) as i32 * 2;
    let (mut best, mut run, mut last): (Vec<[f32; 2]>, Vec<[f32; 2]>, i32) = (Vec::new(), Vec::new(), -reach);
    for s in -reach..=reach {
        let Some(p) = [0.0, 1.0, -1.0].into_iter().find_map(|off| edge(at(s, off))) else { continue };
        if s - last > GAP_PX {
            run.clear();
        }
        run.push(p);
        last = s;
        if run.len() > best.len() {
            best.clone_from(&run);
        }
    }
    straightened(&best)
}

/// The ends of the line through points: total least squares. Centres of pixels are at half px.
fn straightened(points: &[[f32; 2]]) -> Option<[f32; 4]> {
    let n = points.len() as f32;
    if n < 4.0 {
        return None;
    }
    let mean = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f32>() / n);
    let part = |i: usize, j: usize| points.iter().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum::<f32>();
    let angle = 0.5 * (2.0 * part(0, 1)).atan2(part(0, 0) - part(1, 1));
    let (sin, cos) = angle.sin_cos();
    let along = points.iter().map(|p| (p[0] - mean[0]) * cos + (p[1] - mean[1]) * sin);
    let (from, to) = along.fold((f32::MAX, f32::MIN), |(a, b), s| (a.min(s), b.max(s)));
    let end = |s: f32| [mean[0] + s * cos + 0.5, mean[1] + s * sin + 0.5];
    let ([a, b], [c, d]) = (end(from), end(to));
    Some([a, b, c, d])
}

fn blobs(gray: &GrayImage) -> Vec<[f32; 3]> {
    let (w, h) = (gray.width(), gray.height());
    let radius = (w.min(h) / 12).max(4);
    let largest = (w * h / 40) as f32;
    let inverse = GrayImage::from_fn(w, h, |x, y| Luma([255 - gray.get_pixel(x, y)[0]]));
    let mut found: Vec<[f32; 3]> = Vec::new();
    for picture in [gray, &inverse] {
        // A negative delta: as bright as the surroundings is not enough.
        let bright = adaptive_threshold(picture, radius, -BLOB_DN);
        let labels = connected_components(&bright, Connectivity::Four, Luma([0u8]));
        let count = labels.iter().copied().max().unwrap_or(0) as usize;
        // Number, sum of x, sum of y, whether the border of the picture cuts it.
        let mut sums = vec![(0.0f32, 0.0f64, 0.0f64, false); count + 1];
        for (x, y, l) in labels.enumerate_pixels() {
            let sum = &mut sums[l[0] as usize];
            let border = x == 0 || y == 0 || x + 1 == w || y + 1 == h;
            *sum = (sum.0 + 1.0, sum.1 + f64::from(x), sum.2 + f64::from(y), sum.3 || border);
        }
        for &(area, x, y, cut) in &sums[1..] {
            if !cut && (12.0..=largest).contains(&area) {
                let middle = |v: f64| (v / f64::from(area)) as f32 + 0.5;
                found.push([middle(x), middle(y), (area / std::f32::consts::PI).sqrt()]);
            }
        }
    }
    found.sort_by(|a, b| b[2].total_cmp(&a[2]).then(a[1].total_cmp(&b[1])).then(a[0].total_cmp(&b[0])));
    found.truncate(MOST);
    found
}

/// Distance of two lines that are the same one; nothing where they are not.
fn lines_apart(a: &[f32; 4], b: &[f32; 4], tolerance: f32) -> Option<f32> {
    let direction = |l: &[f32; 4]| {
        let (x, y) = (l[2] - l[0], l[3] - l[1]);
        let length = x.hypot(y).max(1e-6);
        ([x / length, y / length], length)
    };
    let ((u, length_a), (v, length_b)) = (direction(a), direction(b));
    if (u[0] * v[1] - u[1] * v[0]).abs() > ANGLE_RAD {
        return None;
    }
    let middle = |l: &[f32; 4]| [0.5 * (l[0] + l[2]), 0.5 * (l[1] + l[3])];
    let (m, n) = (middle(a), middle(b));
    let d = [n[0] - m[0], n[1] - m[1]];
    let (along, across) = (d[0] * u[0] + d[1] * u[1], (d[0] * u[1] - d[1] * u[0]).abs());
    // They lie beside each other over a part of their length.
    (across <= tolerance && along.abs() < 0.5 * (length_a + length_b)).then_some(across)
}

fn points_apart(a: [f32; 2], b: [f32; 2], tolerance: f32) -> Option<f32> {
    let d = (a[0] - b[0]).hypot(a[1] - b[1]);
    (d <= tolerance).then_some(d)
}

/// How corners, lines and blobs (in this order) of `found` agree with those of `real`; `matched` is by `found`.
pub fn compare(found: &PictureOf, real: &PictureOf, tolerance: f32) -> [Agreement; 3] {
    let blob = |a: &[f32; 3], b: &[f32; 3]| {
        let alike = a[2] < 1.6 * b[2] && b[2] < 1.6 * a[2];
        // The size counts too: a ring has its disc's centre.
        let d = (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2]);
        (alike && d <= tolerance).then_some(d)
    };
    [
        agreement(&found.corners, &real.corners, |a, b| points_apart(*a, *b, tolerance)),
        agreement(&found.lines, &real.lines, |a, b| lines_apart(a, b, tolerance)),
        agreement(&found.blobs, &real.blobs, blob),
    ]
}

/// Pairs of which each is the other's nearest.
fn agreement<T>(a: &[T], b: &[T], apart: impl Fn(&T, &T) -> Option<f32>) -> Agreement {
    let nearest = |one: &T, others: &[T], apart: &dyn Fn(&T, &T) -> Option<f32>| {
        let all = others.iter().enumerate().filter_map(|(i, o)| Some((i, apart(one, o)?)));
        all.min_by(|x, y| x.1.total_cmp(&y.1))
    };
    let back: Vec<Option<usize>> =
        b.iter().map(|o| nearest(o, a, &|o, one| apart(one, o)).map(|n| n.0)).collect();
    let (mut pairs, mut sum) = (0usize, 0.0f64);
    let matched = a
        .iter()
        .enumerate()
        .map(|(i, one)| {
            let Some((j, d)) = nearest(one, b, &apart).filter(|(j, _)| back[*j] == Some(i)) else {
                return false;
            };
            (pairs, sum) = (pairs + usize::from(j < b.len()), sum + f64::from(d));
            true
        })
        .collect();
    let all = a.len() + b.len();
    let share = if all == 0 { 1.0 } else { 2.0 * pairs as f64 / all as f64 };
    Agreement { matched, offset_px: sum / pairs.max(1) as f64, share }
}
