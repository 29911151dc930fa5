//! Linear radiance to the values that the camera would have delivered, on the CPU: the effects after the geometry, in
//! light-path order. The mean over the noise; unrounded, so that derivatives exist. `tests` holds it to the chain's own
//! references.

use super::model::{P, Theta};
use super::tone::{Tone, Variances};
use crate::camera::{Intrinsics, ScanOrder};
use crate::plane::Plane;

/// What a frame's lines see of a light that flickers.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineTimes {
    /// Start of the first line, s.
    pub start_s: f64,
    /// From the first line's start to that after the last's, s.
    pub readout_s: f64,
    /// Order of the lines.
    pub scan_order: ScanOrder,
}

/// Develops a frame: DN (0 to 255, unrounded), shape `[height, width, 3]`. `linear`: the same shape.
pub(super) fn develop(
    linear: &Plane<f32>,
    theta: &Theta,
    tone: &Tone,
    k: &Intrinsics,
    lines: LineTimes,
) -> Plane<f32> {
    let blurred;
    let sigma = theta.get(P::Defocus) as f32;
    let linear = if sigma > 0.0 {
        blurred = gaussian(linear, sigma);
        &blurred
    } else {
        linear
    };
    let (w, h) = (linear.width, linear.height);
    let corner = 0.25 * ((w * w + h * h) as f32);
    let (a1, a2) = (theta.get(P::A1) as f32, theta.get(P::A2) as f32);
    let flicker = flicker_of(theta, lines, w, h);
    let mosaic = theta.get(P::Mosaic) as usize;
    let mut dn = Plane::new(w, h, 3);
    for y in 0..h {
        let dy = y as f32 + 0.5 - k.cy as f32;
        for x in 0..w {
            let dx = x as f32 + 0.5 - k.cx as f32;
            let q = (dx * dx + dy * dy) / corner;
            let pass = (1.0 + q * (a1 + q * a2)).max(0.0);
            let (from, to) = (linear.pixel(x, y), dn.pixel_mut(x, y));
            let light = flicker.as_ref().map(|(by_line, rows)| by_line[if *rows { y } else { x }]);
            for c in 0..3 {
                let sensor = match light {
                    None => tone.sensor(from[c], pass),
                    Some(light) => tone.sensor_lit(from[c], pass, light),
                };
                to[c] = if mosaic > 0 { sensor } else { tone.encode(sensor, c) };
            }
        }
    }
    if mosaic > 0 {
        dn = demosaicked(&dn, mosaic);
        for p in dn.data.chunks_exact_mut(3) {
            (0..3).for_each(|c| p[c] = tone.encode(p[c], c));
        }
    }
    behind_encoding(dn, theta, tone)
}

fn behind_encoding(mut dn: Plane<f32>, theta: &Theta, tone: &Tone) -> Plane<f32> {
    let amount = theta.get(P::Sharpen) as f32;
    let sharpened = amount != 0.0;
    if sharpened {
        let soft = gaussian(&dn, theta.get(P::Radius) as f32);
        for (i, (v, s)) in dn.data.iter_mut().zip(&soft.data).enumerate() {
            let spread = if tone.is_noisy() { tone.spread(*v, i % 3) } else { Variances::default() };
            *v = clipped_mean(*v + amount * (*v - s), (spread.free + spread.fixed).sqrt());
        }
    }
    let scheme = theta.get(P::Chroma) as usize;
    if scheme > 0 {
        dn = subsampled(&dn, scheme);
    }
    if sharpened || scheme > 0 {
        dn.data.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
    }
    let quality = theta.get(P::Quality) as u8;
    if quality > 0 { compressed(&dn, quality) } else { dn }
}

/// Mean of a normal value that is clipped to 0 and 255.
fn clipped_mean(mean: f32, sigma: f32) -> f32 {
    if sigma <= 0.05 || (mean > 4.0 * sigma && mean < 255.0 - 4.0 * sigma) {
        return mean;
    }
    // What lies below 0 on average, and what lies above 255.
    let beyond = |z: f32| {
        let density = (-0.5 * z * z).exp() * 0.398_942_3;
        let above = 0.5 * (1.0 - super::score::erf(f64::from(z) * std::f64::consts::FRAC_1_SQRT_2)) as f32;
        sigma * (density - z * above)
    };
    mean + beyond(mean / sigma) - beyond((255.0 - mean) / sigma)
}

fn flicker_of(theta: &Theta, lines: LineTimes, w: usize, h: usize) -> Option<(Vec<f32>, bool)> {
    let (c, s) = (theta.get(P::FlickerC), theta.get(P::FlickerS));
    if c == 0.0 && s == 0.0 {
        return None;
    }
    let order = lines.scan_order;
    let count = order.line_count(w as u32, h as u32);
    let omega = std::f64::consts::TAU * theta.get(P::FlickerF);
    let by_line = (0..count)
        .map(|at| {
            let (x, y) = if order.lines_are_rows() { (0, at) } else { (at, 0) };
            let line = order.line_of(x, y, w as u32, h as u32);
            let t = lines.start_s + lines.readout_s * f64::from(line) / f64::from(count);
            // depth sin(wt + phase) = depth cos(phase) sin(wt) + depth sin(phase) cos(wt).
            let (sin, cos) = (omega * t).sin_cos();
            (1.0 + c * sin + s * cos) as f32
        })
        .collect();
    Some((by_line, order.lines_are_rows()))
}

/// Gaussian of `sigma` px, truncated at 4 sigma as in the chain; the border repeats outwards.
pub(super) fn gaussian(plane: &Plane<f32>, sigma: f32) -> Plane<f32> {
    let radius = (4.0 * sigma + 0.5).floor().max(1.0) as usize;
    let mut kernel: Vec<f32> = (0..=radius).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    kernel.iter_mut().for_each(|v| *v /= sum);
    let (w, h, n) = (plane.width, plane.height, plane.channels);
    let mut across = Plane::new(w, h, n);
    for y in 0..h {
        let row = plane.row(y);
        for x in 0..w {
            for c in 0..n {
                let mut sum = kernel[0] * row[x * n + c];
                for (i, k) in kernel.iter().enumerate().skip(1) {
                    sum += k * (row[x.saturating_sub(i) * n + c] + row[(x + i).min(w - 1) * n + c]);
                }
                across.data[(y * w + x) * n + c] = sum;
            }
        }
    }
    let mut out = Plane::new(w, h, n);
    let stride = w * n;
    for y in 0..h {
        let target = &mut out.data[y * stride..(y + 1) * stride];
        for (v, s) in target.iter_mut().zip(across.row(y)) {
            *v = kernel[0] * s;
        }
        for (i, k) in kernel.iter().enumerate().skip(1) {
            let (above, below) = (across.row(y.saturating_sub(i)), across.row((y + i).min(h - 1)));
            for ((v, a), b) in target.iter_mut().zip(above).zip(below) {
                *v += k * (a + b);
            }
        }
    }
    out
}

/// One colour a pixel, then bilinear; the picture is mirrored about its outermost pixels.
fn demosaicked(plane: &Plane<f32>, pattern: usize) -> Plane<f32> {
    let (w, h) = (plane.width, plane.height);
    // Place of red in the 2x2 cell; blue lies diagonally opposite.
    let red = [(0, 0), (0, 0), (1, 1), (1, 0), (0, 1)][pattern];
    let channel = |x: usize, y: usize| match ((x + red.0) % 2, (y + red.1) % 2) {
        (0, 0) => 0,
        (1, 1) => 2,
        _ => 1,
    };
    let mirrored = |at: i64, side: usize| {
        let last = side as i64 - 1;
        (last - (last - at.abs()).abs()).clamp(0, last) as usize
    };
    Plane::from_fn(w, h, |x, y| {
        let at = |dx: i64, dy: i64| {
            let (u, v) = (mirrored(x as i64 + dx, w), mirrored(y as i64 + dy, h));
            plane.data[3 * (v * w + u) + channel(u, v)]
        };
        let own = at(0, 0);
        let (row, column) = (0.5 * (at(-1, 0) + at(1, 0)), 0.5 * (at(0, -1) + at(0, 1)));
        let cross = 0.5 * (row + column);
        let diagonal = 0.25 * (at(-1, -1) + at(1, -1) + at(-1, 1) + at(1, 1));
        match channel(x, y) {
            0 => [own, cross, diagonal],
            2 => [diagonal, cross, own],
            _ if (y + red.1) % 2 == 0 => [row, own, column],
            _ => [column, own, row],
        }
    })
}

/// Colour at half the resolution: 1 both ways, 2 along rows only.
fn subsampled(dn: &Plane<f32>, scheme: usize) -> Plane<f32> {
    let (w, h) = (dn.width, dn.height);
    let rows = if scheme == 1 { 2 } else { 1 };
    let mut out = Plane::new(w, h, 3);
    for y0 in (0..h).step_by(rows) {
        for x0 in (0..w).step_by(2) {
            let (mut cb, mut cr, mut n) = (0.0, 0.0, 0.0);
            let cell = || (y0..(y0 + rows).min(h)).flat_map(|y| (x0..(x0 + 2).min(w)).map(move |x| (x, y)));
            for (x, y) in cell() {
                let p = dn.pixel(x, y);
                let luma = luma(p);
                cb += (p[2] - luma) / 1.772;
                cr += (p[0] - luma) / 1.402;
                n += 1.0;
            }
            let (cb, cr) = (cb / n, cr / n);
            for (x, y) in cell() {
                let l = luma(dn.pixel(x, y));
                let rgb = [l + 1.402 * cr, l - 0.344_136 * cb - 0.714_136 * cr, l + 1.772 * cb];
                out.pixel_mut(x, y).copy_from_slice(&rgb);
            }
        }
    }
    out
}

fn luma(p: &[f32]) -> f32 {
    0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]
}

/// Through a JPEG encoder and back.
fn compressed(dn: &Plane<f32>, quality: u8) -> Plane<f32> {
    let bytes: Vec<u8> = dn.data.iter().map(|v| (v + 0.5).clamp(0.0, 255.0) as u8).collect();
    let mut jpeg = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, quality.clamp(1, 100));
    let size = (dn.width as u32, dn.height as u32);
    let encoded = encoder.encode(&bytes, size.0, size.1, image::ExtendedColorType::Rgb8);
    let decoded = encoded
        .and_then(|()| image::load_from_memory_with_format(&jpeg, image::ImageFormat::Jpeg))
        .expect("what was just encoded in memory can be decoded");
    let data = decoded.into_rgb8().into_raw().into_iter().map(f32::from).collect();
    Plane { width: dn.width, height: dn.height, channels: 3, data }
}
