//! Linear radiance to the values that the camera would have delivered, on the CPU: the effects after the geometry, in
//! light-path order. The mean over the noise; unrounded, so that derivatives exist. `tests` holds it to the chain's own
//! references.

use super::model::{P, Theta};
use super::packing::packed_mean;
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
    let shading = shading_of(theta, k, w, h);
    let flicker = flicker_of(theta, lines, w, h);
    let mosaic = theta.get(P::Mosaic) as usize;
    let mut dn = Plane::new(w, h, 3);
    for (y, row) in dn.data.chunks_exact_mut(3 * w).enumerate() {
        for (x, (from, to)) in linear.row(y).chunks_exact(3).zip(row.chunks_exact_mut(3)).enumerate() {
            let pass = shading.as_ref().map_or(1.0, |s| s[y * w + x]);
            let light = flicker.as_ref().map_or(1.0, |(by_line, rows)| by_line[if *rows { y } else { x }]);
            for c in 0..3 {
                let sensor = tone.sensor(from[c], pass, light);
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
    match (quality, tone.is_noisy()) {
        (0, _) => dn,
        (_, false) => compressed(&dn, quality),
        (_, true) => {
            let variance = |(i, v): (usize, &f32)| {
                let spread = tone.spread(*v, i % 3);
                spread.free + spread.row + spread.fixed
            };
            let variance: Vec<f32> = dn.data.iter().enumerate().map(variance).collect();
            packed_mean(&dn, &variance, quality)
        }
    }
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

/// What vignetting lets through, by pixel; nothing where there is none.
fn shading_of(theta: &Theta, k: &Intrinsics, w: usize, h: usize) -> Option<Vec<f32>> {
    let (a1, a2) = (theta.get(P::A1) as f32, theta.get(P::A2) as f32);
    if a1 == 0.0 && a2 == 0.0 {
        return None;
    }
    let corner = 0.25 * ((w * w + h * h) as f32);
    let of = |x: usize, y: usize| {
        let (dx, dy) = (x as f32 + 0.5 - k.cx as f32, y as f32 + 0.5 - k.cy as f32);
        let q = (dx * dx + dy * dy) / corner;
        (1.0 + q * (a1 + q * a2)).max(0.0)
    };
    Some((0..h).flat_map(|y| (0..w).map(move |x| of(x, y))).collect())
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
    let mut wide = vec![0.0; (w + 2 * radius) * n];
    for (y, target) in across.data.chunks_exact_mut(w * n).enumerate() {
        let row = plane.row(y);
        for (x, to) in wide.chunks_exact_mut(n).enumerate() {
            let x = x.saturating_sub(radius).min(w - 1);
            to.copy_from_slice(&row[x * n..(x + 1) * n]);
        }
        for (v, s) in target.iter_mut().zip(row) {
            *v = kernel[0] * s;
        }
        for (i, k) in kernel.iter().enumerate().skip(1) {
            let (before, after) = (&wide[(radius - i) * n..], &wide[(radius + i) * n..]);
            for ((v, a), b) in target.iter_mut().zip(before).zip(after) {
                *v += k * (a + b);
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
pub(super) fn demosaicked(plane: &Plane<f32>, pattern: usize) -> Plane<f32> {
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
pub(super) fn subsampled(dn: &Plane<f32>, scheme: usize) -> Plane<f32> {
    let (w, h) = (dn.width, dn.height);
    let rows = if scheme == 1 { 2 } else { 1 };
    let mut out = Plane::new(w, h, 3);
    for y0 in (0..h).step_by(rows) {
        for x0 in (0..w).step_by(2) {
            let (mut cb, mut cr, mut n) = (0.0, 0.0, 0.0);
            let cell = || (y0..(y0 + rows).min(h)).flat_map(|y| (x0..(x0 + 2).min(w)).map(move |x| (x, y)));
            for (x, y) in cell() {
                let [b, r] = chroma(dn.pixel(x, y));
                cb += b;
                cr += r;
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

/// The two colour differences of a pixel (ITU-T T.871).
pub(super) fn chroma(p: &[f32]) -> [f32; 2] {
    let luma = luma(p);
    [(p[2] - luma) / 1.772, (p[0] - luma) / 1.402]
}

/// Through a JPEG encoder and back.
pub(super) fn compressed(dn: &Plane<f32>, quality: u8) -> Plane<f32> {
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

#[cfg(test)]
mod tests {
    use super::super::model::candidate_of;
    use super::super::settings::apply;
    use super::*;
    use crate::camera::ShutterTiming;
    use crate::chain::{Settings, View};
    use crate::effects;
    use crate::reference::chain;

    const INTRINSICS: Intrinsics =
        Intrinsics { width: 42, height: 31, fx: 40.0, fy: 41.0, cx: 20.7, cy: 15.9 };

    /// Patches with hard edges, dark to beyond white.
    fn radiance() -> Plane<f32> {
        Plane::from_fn(42, 31, |x, y| {
            let v = |c: usize| ((x / 5 * 7 + y / 4 * 13 + c * 5) % 23) as f32 / 20.0;
            [v(0), v(1) * 0.6, v(2) * 0.3, 1.0]
        })
    }

    /// Largest difference of one effect, or several, to the chain's own reference, DN.
    fn difference(names: &[&'static str], theta: &Theta) -> f32 {
        let mut settings = Settings::default();
        assert!(apply(&mut settings, theta, names).expect("in range").is_empty());
        let shutter = ShutterTiming {
            start_s: 12.345,
            exposure_time_s: 0.0,
            readout_time_s: theta.get(P::Readout),
            scan_order: theta.scan_order,
            line_count: 31,
        };
        let view = View { intrinsics: INTRINSICS, shutter, frame: 3, seed: 1 };
        let radiance = radiance();
        let packed = theta.is_on(P::Quality);
        let expected: Vec<f32> = if packed {
            let picture = chain::picture(effects::LIST, &settings, &view, &radiance);
            picture.data.iter().map(|v| f32::from(*v)).collect()
        } else {
            let values = chain::values(effects::LIST, &settings, &view, &radiance);
            let pixels = values.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
            pixels.map(|v| 255.0 * v.clamp(0.0, 1.0)).collect()
        };
        let rgb = radiance.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let linear = Plane { width: 42, height: 31, channels: 3, data: rgb };
        let lines = LineTimes {
            start_s: shutter.start_s,
            readout_s: shutter.readout_time_s,
            scan_order: theta.scan_order,
        };
        let dn = develop(&linear, theta, &Tone::new(theta), &INTRINSICS, lines);
        dn.data.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn every_effect_on_values_is_the_chain_s_own() {
        let cases: &[(&'static str, &[(P, f64)])] = &[
            ("defocus", &[(P::Defocus, 1.3)]),
            ("vignetting", &[(P::A1, -0.5), (P::A2, 0.1)]),
            ("glare", &[(P::Veil, 0.2), (P::Level, 0.4)]),
            ("exposure_gain", &[(P::Gain, 0.7)]),
            ("flicker", &[(P::FlickerF, 103.0), (P::FlickerC, 0.12), (P::FlickerS, -0.1)]),
            ("bayer_mosaic", &[(P::Mosaic, 1.0)]),
            ("bayer_mosaic", &[(P::Mosaic, 2.0)]),
            ("bayer_mosaic", &[(P::Mosaic, 3.0)]),
            ("bayer_mosaic", &[(P::Mosaic, 4.0)]),
            ("black_level", &[(P::Black, 0.06)]),
            ("white_balance", &[(P::WbR, 1.3), (P::WbB, 0.8)]),
            ("gamma", &[(P::Gamma, 1.15)]),
            ("sharpening", &[(P::Sharpen, 0.8), (P::Radius, 1.1)]),
            ("chroma_subsampling", &[(P::Chroma, 1.0)]),
            ("chroma_subsampling", &[(P::Chroma, 2.0)]),
            ("jpeg", &[(P::Quality, 60.0)]),
        ];
        for (name, values) in cases {
            let mut theta = Theta::neutral();
            values.iter().for_each(|&(p, v)| theta.set(p, v));
            let off = difference(&[name], &theta);
            assert!(off < 0.06, "{name} {values:?}: off by {off} DN");
            // Control: a value a little off is seen.
            let choice = theta.is_on(P::Mosaic) || theta.is_on(P::Chroma);
            if candidate_of(name).parameters.len() == 1 && !choice {
                let p = values[0].0;
                let wrong = theta.with(p, values[0].1 * 0.9);
                assert!(wrong == theta || difference_of(&wrong, &theta) > 0.3, "{name}: the control passes");
            }
        }
    }

    fn difference_of(a: &Theta, b: &Theta) -> f32 {
        let rgb = radiance().data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let linear = Plane { width: 42, height: 31, channels: 3, data: rgb };
        let lines = LineTimes { start_s: 1.0, readout_s: 0.0, scan_order: ScanOrder::TopToBottom };
        let [a, b] = [a, b].map(|t| develop(&linear, t, &Tone::new(t), &INTRINSICS, lines));
        a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn effects_together_stand_in_the_chain_s_order() {
        let mut theta = Theta::neutral().with(P::Readout, 0.02);
        theta.scan_order = ScanOrder::BottomToTop;
        for (p, v) in [
            (P::Defocus, 0.8),
            (P::A1, -0.3),
            (P::Veil, 0.1),
            (P::Level, 0.3),
            (P::Gain, 1.2),
            (P::FlickerF, 100.0),
            (P::FlickerC, 0.1),
            (P::Black, 0.03),
            (P::Mosaic, 3.0),
            (P::WbR, 1.2),
            (P::WbB, 0.9),
            (P::Gamma, 0.9),
            (P::Chroma, 1.0),
        ] {
            theta.set(p, v);
        }
        let names = [
            "defocus",
            "vignetting",
            "glare",
            "exposure_gain",
            "flicker",
            "bayer_mosaic",
            "black_level",
            "white_balance",
            "gamma",
            "chroma_subsampling",
        ];
        let off = difference(&names, &theta);
        assert!(off < 0.1, "off by {off} DN");
    }

    #[test]
    fn the_mean_under_noise_is_that_of_many_frames() {
        use crate::chain::Value;
        // A dark grey under noise that reaches below black: the mean moves by several DN.
        let theta = Theta::neutral().with(P::Read, 0.03).with(P::Shot, 1.0 / 500.0);
        let tone = Tone::new(&theta);
        let mut settings = Settings::default();
        apply(&mut settings, &theta, &["read_noise", "shot_noise"]).expect("in range");
        assert_eq!(settings.get("read_noise", "sigma"), Some(Value::Number(0.03)));
        let shutter = ShutterTiming {
            start_s: 0.0,
            exposure_time_s: 0.0,
            readout_time_s: 0.0,
            scan_order: ScanOrder::TopToBottom,
            line_count: 64,
        };
        let intrinsics = Intrinsics { width: 64, height: 64, ..INTRINSICS };
        for linear in [0.005f32, 0.02, 0.2, 0.9] {
            let flat = Plane::from_fn(64, 64, |_, _| [linear, linear, linear, 1.0]);
            let (mut sum, mut square, mut n) = (0.0f64, 0.0, 0.0);
            for frame in 0..4 {
                let view = View { intrinsics, shutter, frame, seed: 5 };
                let picture = chain::picture(effects::LIST, &settings, &view, &flat);
                for v in picture.data.iter().map(|v| f64::from(*v)) {
                    (sum, square, n) = (sum + v, square + v * v, n + 1.0);
                }
            }
            let (mean, variance) = (sum / n, square / n - (sum / n).powi(2));
            let expected = f64::from(tone.encode(linear, 1));
            // The standard error of the mean of 49152 values is a 220th of their spread; but two or three electrons are no
            // normal distribution (measured at 0.005: 22.7 DN, where a normal one has 23.3).
            assert!((mean - expected).abs() < 0.25 + variance.sqrt() / 40.0, "{linear}: {mean} {expected}");
            let spread = f64::from(tone.spread(expected as f32, 1).free);
            let most = if linear < 0.01 { 0.3 } else { 0.12 };
            assert!((variance / spread - 1.0).abs() < most, "{linear}: {variance} {spread}");
        }
        let silent = f64::from(Tone::new(&Theta::neutral()).encode(0.005, 1));
        let shift = f64::from(tone.encode(0.005, 1)) - silent;
        assert!(shift > 3.0, "control: without noise the mean is elsewhere, by {shift} DN");
    }

    #[test]
    fn pixels_that_share_their_chroma_keep_a_part_of_the_noise() {
        let theta = Theta::neutral().with(P::Read, 0.01);
        let variance = |theta: &Theta, names: &[&'static str]| {
            let mut settings = Settings::default();
            apply(&mut settings, theta, names).expect("in range");
            let shutter = ShutterTiming {
                start_s: 0.0,
                exposure_time_s: 0.0,
                readout_time_s: 0.0,
                scan_order: ScanOrder::TopToBottom,
                line_count: 96,
            };
            let view = View {
                intrinsics: Intrinsics { width: 96, height: 96, ..INTRINSICS },
                shutter,
                frame: 0,
                seed: 5,
            };
            let flat = Plane::from_fn(96, 96, |_, _| [0.4f32, 0.4, 0.4, 1.0]);
            let picture = chain::picture(effects::LIST, &settings, &view, &flat);
            let n = picture.data.len() as f64;
            let mean = picture.data.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
            picture.data.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n - 1.0 / 12.0
        };
        let whole = variance(&theta, &["read_noise"]);
        for scheme in [1.0, 2.0] {
            let shared = theta.with(P::Chroma, scheme);
            let seen = variance(&shared, &["read_noise", "chroma_subsampling"]) / whole;
            let told = f64::from(Tone::new(&shared).left(&[100.0; 3], 1).pixel);
            assert!((seen / told - 1.0).abs() < 0.06, "{scheme}: {seen} {told}");
            assert!(told < 0.8, "control: all of it would be 1");
        }
    }
}
