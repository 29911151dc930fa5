//! Linear radiance to the values that the camera would have delivered, on the CPU: the effects after the geometry, in
//! light-path order, without noise. Values stay unrounded, so that derivatives exist.

use super::model::{P, Theta};
use crate::camera::{Intrinsics, ScanOrder};
use crate::plane::{Plane, srgb_encode};

/// Entries of the table of encoded values: linear interpolation is within 0.01 DN above linear 0.001.
const TABLE: usize = 8192;

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

/// Encoded picture and the slope of encoding.
pub(super) struct Developed {
    /// DN (0 to 255, unrounded), shape `[height, width, 3]`.
    pub dn: Plane<f32>,
}

/// Everything that happens to a value on its own, as a table.
pub(super) struct Tone {
    table: Vec<f32>,
    /// Gain per channel before the table.
    gain: [f32; 3],
    black: f32,
    veil: f32,
    veil_level: f32,
}

impl Tone {
    pub(super) fn new(theta: &Theta) -> Self {
        let exponent = theta.get(P::Gamma) as f32;
        let encode = |i: usize| {
            let value = srgb_encode(i as f32 / TABLE as f32);
            255.0 * if exponent == 1.0 { value } else { value.powf(exponent) }
        };
        let gain = theta.get(P::Gain) as f32;
        Self {
            table: (0..=TABLE + 1).map(encode).collect(),
            gain: [gain * theta.get(P::WbR) as f32, gain, gain * theta.get(P::WbB) as f32],
            black: theta.get(P::Black) as f32,
            veil: theta.get(P::Veil) as f32,
            veil_level: (theta.get(P::Veil) * theta.get(P::Level)) as f32,
        }
    }

    /// Linear value on the sensor, before encoding, of radiance `linear` that the lens let pass by `pass`.
    fn sensor(&self, linear: f32, channel: usize, pass: f32) -> f32 {
        let seen = (1.0 - self.veil) * linear * pass + self.veil_level;
        // White balance stands after the black level, so a gain of a channel lifts the black too.
        let wb = self.gain[channel] / self.gain[1];
        wb * (self.black + (1.0 - self.black) * self.gain[1] * seen)
    }

    fn encode(&self, sensor: f32) -> f32 {
        let at = sensor.clamp(0.0, 1.0) * TABLE as f32;
        let i = at as usize;
        let f = at - i as f32;
        self.table[i] * (1.0 - f) + self.table[i + 1] * f
    }

    /// DN per unit of the sensor's linear value that encodes to `dn`; 0 where clipped.
    pub(super) fn slope_at(&self, dn: f32) -> f32 {
        if dn >= 254.9 {
            return 0.0;
        }
        let i = self.table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        (self.table[i] - self.table[i - 1]) * TABLE as f32
    }

    /// The sensor's linear value (0 to 1) that encodes to `dn`.
    pub(super) fn decode(&self, dn: f32) -> f32 {
        let i = self.table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        let (a, b) = (self.table[i - 1], self.table[i]);
        ((i - 1) as f32 + ((dn - a) / (b - a).max(1e-9)).clamp(0.0, 1.0)) / TABLE as f32
    }
}

/// Develops a frame. `linear`: shape `[height, width, 3]`.
pub(super) fn develop(linear: &Plane<f32>, theta: &Theta, k: &Intrinsics, lines: LineTimes) -> Developed {
    let blurred;
    let sigma = theta.get(P::Defocus) as f32;
    let linear = if sigma > 0.0 {
        blurred = gaussian(linear, sigma);
        &blurred
    } else {
        linear
    };
    let tone = Tone::new(theta);
    let (w, h) = (linear.width, linear.height);
    let corner = 0.25 * ((w * w + h * h) as f32);
    let (a1, a2) = (theta.get(P::A1) as f32, theta.get(P::A2) as f32);
    let flicker = flicker_of(theta, lines, w, h);
    let mosaic = theta.get(P::Mosaic) as usize;
    let mut sensor = Plane::new(w, h, 3);
    for y in 0..h {
        let dy = y as f32 + 0.5 - k.cy as f32;
        for x in 0..w {
            let dx = x as f32 + 0.5 - k.cx as f32;
            let q = (dx * dx + dy * dy) / corner;
            let mut pass = 1.0 + a1 * q + a2 * q * q;
            if let Some((by_line, rows)) = &flicker {
                pass *= by_line[if *rows { y } else { x }];
            }
            let (from, to) = (linear.pixel(x, y), sensor.pixel_mut(x, y));
            for c in 0..3 {
                to[c] = tone.sensor(from[c], c, pass);
            }
        }
    }
    if mosaic > 0 {
        sensor = demosaicked(&sensor, mosaic);
    }
    let mut dn = sensor;
    dn.data.iter_mut().for_each(|v| *v = tone.encode(*v));
    let amount = theta.get(P::Sharpen) as f32;
    if amount != 0.0 {
        let soft = gaussian(&dn, theta.get(P::Radius) as f32);
        for (v, s) in dn.data.iter_mut().zip(&soft.data) {
            *v = (*v + amount * (*v - s)).clamp(0.0, 255.0);
        }
    }
    let dn = match theta.get(P::Chroma) as usize {
        0 => dn,
        scheme => subsampled(&dn, scheme),
    };
    let quality = theta.get(P::Quality) as u8;
    Developed { dn: if quality > 0 { compressed(&dn, quality) } else { dn } }
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

/// Gaussian of `sigma` px, truncated at 3.5 sigma; the border repeats outwards.
pub(super) fn gaussian(plane: &Plane<f32>, sigma: f32) -> Plane<f32> {
    let radius = (3.5 * sigma).ceil().max(1.0) as usize;
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

/// One colour a pixel, then bilinear.
fn demosaicked(plane: &Plane<f32>, pattern: usize) -> Plane<f32> {
    let (w, h) = (plane.width, plane.height);
    // Place of red in the 2x2 cell; blue lies diagonally opposite.
    let red = [(0, 0), (0, 0), (1, 1), (1, 0), (0, 1)][pattern];
    let channel = |x: usize, y: usize| match ((x + red.0) % 2, (y + red.1) % 2) {
        (0, 0) => 0,
        (1, 1) => 2,
        _ => 1,
    };
    let mut out = Plane::new(w, h, 3);
    for y in 0..h {
        for x in 0..w {
            let (mut sum, mut count) = ([0.0f32; 3], [0.0f32; 3]);
            for dy in -1i64..=1 {
                for dx in -1i64..=1 {
                    let (u, v) = (x as i64 + dx, y as i64 + dy);
                    if u < 0 || v < 0 || u >= w as i64 || v >= h as i64 {
                        continue;
                    }
                    let (u, v) = (u as usize, v as usize);
                    let c = channel(u, v);
                    let own = channel(x, y) == c;
                    if own && (dx != 0 || dy != 0) {
                        continue;
                    }
                    // Green at a red or blue place comes from the four edge neighbours only.
                    if c == 1 && dx != 0 && dy != 0 {
                        continue;
                    }
                    sum[c] += plane.pixel(u, v)[c];
                    count[c] += 1.0;
                }
            }
            let to = out.pixel_mut(x, y);
            for c in 0..3 {
                to[c] = sum[c] / count[c].max(1.0);
            }
        }
    }
    out
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
                out.pixel_mut(x, y).copy_from_slice(&rgb.map(|v| v.clamp(0.0, 255.0)));
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
    let bytes: Vec<u8> = dn.data.iter().map(|v| (v + 0.5) as u8).collect();
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
