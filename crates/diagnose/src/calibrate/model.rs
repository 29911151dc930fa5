//! A camera's noise from the photon to the file, as a forward simulation: what the calibration fits and what its
//! figures are compared with. Behind [`CameraModel`], so that the engine's chain can take its place.

use serde::Serialize;

use super::filter::{convolve_separable, gaussian};
use shutterbug::chain::rng::{random_bits, random_normal, seed_words};
use shutterbug::error::{Error, Result};
use shutterbug::plane::{Plane, srgb_decode, srgb_encode, three};

/// Makes frames of a noise-free picture.
pub trait CameraModel: Sync {
    /// Frame number `frame` of `clean` (linear, 1 = white, shape `[height, width, 3]`): encoded values in 0 to 1.
    ///
    /// # Errors
    /// A picture that the JPEG encoder refuses.
    fn frame(&self, clean: &Plane<f32>, frame: u32, seed: u64) -> Result<Plane<f32>>;
}

/// Parameters of [`IspCamera`]: sensor, mosaic, colour, smoothing, file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IspCamera {
    /// Electrons at 1 on the sensor's scale.
    pub full_well_e: f64,
    /// Read noise, fraction of full scale on the sensor's scale.
    pub read_sigma: f64,
    /// Noise that a row shares, fraction of full scale.
    pub row_sigma: f64,
    /// Whether a Bayer mosaic (RGGB) and a bilinear demosaic lie between.
    pub bayer: bool,
    /// Gains of red, green (1) and blue behind the sensor.
    pub white_balance: [f64; 3],
    /// From the sensor's colours to the picture's, rows sum to 1.
    pub color_matrix: [[f64; 3]; 3],
    /// Factor on the differences from luma, behind the encoding and its clipping at black (sRGB only); 1 = none.
    pub saturation: f64,
    /// Gaussian smoothing of luma (encoded values), px.
    pub luma_sigma_px: f64,
    /// Gaussian smoothing of both chroma planes, px.
    pub chroma_sigma_px: f64,
    /// Luma samples a chroma sample, horizontally and vertically.
    pub chroma_step: [u8; 2],
    /// Quality of the JPEG; `None` = none.
    pub jpeg_quality: Option<u32>,
    /// Whether values are sRGB-encoded (else linear).
    pub srgb: bool,
    /// Distance of two values of the file; 0 = not quantized.
    pub step: f64,
    /// What the noise reduction leaves of the noise, over the encoded value: knots (value in 0 to 1, factor) per
    /// channel; empty = all. Real ones smooth dark and bright parts differently.
    pub level_gain: [Vec<[f64; 2]>; 3],
}

/// Weights of luma (ITU-T T.871, as in JPEG).
pub const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

impl IspCamera {
    /// A sensor alone: shot and read noise on linear values, nothing behind it but the encoding.
    pub fn sensor(full_well_e: f64, read_sigma: f64, srgb: bool, step: f64) -> Self {
        Self {
            full_well_e,
            read_sigma,
            row_sigma: 0.0,
            bayer: false,
            white_balance: [1.0; 3],
            color_matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            saturation: 1.0,
            luma_sigma_px: 0.0,
            chroma_sigma_px: 0.0,
            chroma_step: [1, 1],
            jpeg_quality: None,
            srgb,
            step,
            level_gain: Default::default(),
        }
    }

    /// The (linear) colour ahead of the saturation, not below black.
    pub fn vivid(&self, color: [f64; 3]) -> [f64; 3] {
        if self.saturation == 1.0 || !self.srgb {
            return color;
        }
        let encoded = color.map(|v| f64::from(srgb_encode(v as f32)));
        let luma: f64 = (0..3).map(|c| LUMA[c] * encoded[c]).sum();
        encoded.map(|v| f64::from(srgb_decode((luma + (v - luma) / self.saturation).clamp(0.0, 1.0) as f32)))
    }

    /// What the sensor must have seen for this colour: the inverse of matrix and gains, not below 0.
    pub fn sensor_color(&self, inverse: &[[f64; 3]; 3], color: [f64; 3]) -> [f64; 3] {
        let color = self.vivid(color);
        std::array::from_fn(|k| {
            let raw: f64 = (0..3).map(|i| inverse[k][i] * color[i]).sum();
            raw.max(0.0) / self.white_balance[k]
        })
    }

    /// Inverse of the colour matrix; `None` where it has none.
    pub fn inverse_matrix(&self) -> Option<[[f64; 3]; 3]> {
        let m = glam::DMat3::from_cols_array_2d(&self.color_matrix);
        (m.determinant().abs() > 1e-3).then(|| m.inverse().to_cols_array_2d())
    }

    /// Noise on what the sensor saw: electrons, rows, amplifier.
    fn sensor_noise(&self, seen: &mut Plane<f32>, frame: u32, seed: u64) {
        let (width, words) = (seen.width, seed_words(seed));
        let full_well = self.full_well_e;
        let sigma = self.read_sigma as f32;
        use rayon::prelude::*;
        seen.data.par_chunks_mut(width * 3).enumerate().for_each(|(y, row)| {
            let of_row = self.row_sigma as f32 * random_normal([0, y as u32], frame, STREAM_ROW, words)[0];
            for x in 0..width {
                let at = [x as u32, y as u32];
                let shot = random_normal(at, frame, STREAM_SHOT, words);
                let read = random_normal(at, frame, STREAM_READ, words);
                for c in 0..3 {
                    let v = &mut row[x * 3 + c];
                    let mean = f64::from(*v) * full_well;
                    let electrons = if mean < FEW {
                        few(mean, random_bits(at, frame, STREAM_FEW, words)[c])
                    } else {
                        mean + mean.sqrt() * f64::from(shot[c])
                    };
                    *v = (electrons / full_well) as f32 + of_row + sigma * read[c];
                }
            }
        });
    }
}

/// Below this mean the Gaussian is not good enough for the Poisson distribution.
const FEW: f64 = 50.0;
const STREAM_SHOT: u32 = 0x4341_0001;
const STREAM_READ: u32 = 0x4341_0002;
const STREAM_ROW: u32 = 0x4341_0003;
const STREAM_FEW: u32 = 0x4341_0004;

/// The smallest count whose distribution function reaches a uniform number.
fn few(mean: f64, bits: u32) -> f64 {
    let u = (f64::from(bits) + 0.5) / 4_294_967_296.0;
    let (mut term, mut sum, mut count) = ((-mean).exp(), (-mean).exp(), 0.0);
    while sum < u && count < 10.0 * FEW {
        count += 1.0;
        term *= mean / count;
        sum += term;
    }
    count
}

/// Linear between the knots, constant beyond them.
pub fn at_knots(knots: &[[f64; 2]], at: f64) -> f64 {
    match knots.iter().position(|k| k[0] >= at) {
        Some(0) => knots[0][1],
        Some(i) => {
            let ([x0, y0], [x1, y1]) = (knots[i - 1], knots[i]);
            y0 + (y1 - y0) * (at - x0) / (x1 - x0).max(1e-12)
        }
        None => knots.last().map_or(1.0, |k| k[1]),
    }
}

impl CameraModel for IspCamera {
    fn frame(&self, clean: &Plane<f32>, frame: u32, seed: u64) -> Result<Plane<f32>> {
        let mut noisy = self.developed(clean, Some((frame, seed)));
        if self.level_gain.iter().any(|k| !k.is_empty()) {
            let still = self.developed(clean, None);
            for (i, (v, s)) in noisy.data.iter_mut().zip(&still.data).enumerate() {
                *v = s + at_knots(&self.level_gain[i % 3], f64::from(*s)) as f32 * (*v - s);
            }
        }
        self.file(noisy)
    }
}

impl IspCamera {
    /// Everything before the file: encoded values, with the noise of a frame and seed or without.
    fn developed(&self, clean: &Plane<f32>, noise: Option<(u32, u64)>) -> Plane<f32> {
        let inverse = self.inverse_matrix().unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let mut picture = clean.clone();
        for p in picture.data.chunks_exact_mut(3) {
            let raw = self.sensor_color(&inverse, [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])]);
            (0..3).for_each(|c| p[c] = raw[c] as f32);
        }
        if let Some((frame, seed)) = noise {
            self.sensor_noise(&mut picture, frame, seed);
        }
        if self.bayer {
            picture = bilinear_demosaic(&picture);
        }
        for p in picture.data.chunks_exact_mut(3) {
            let balanced = three(|c| f64::from(p[c]) * self.white_balance[c]);
            for (c, row) in self.color_matrix.iter().enumerate() {
                let value = (0..3).map(|k| row[k] * balanced[k]).sum::<f64>() as f32;
                p[c] = if self.srgb { srgb_encode(value) } else { value };
            }
            if self.srgb && self.saturation != 1.0 {
                let luma: f32 = (0..3).map(|c| LUMA[c] as f32 * p[c]).sum();
                p.iter_mut().for_each(|v| *v = luma + self.saturation as f32 * (*v - luma));
            }
        }
        self.smoothed(picture)
    }

    /// Smoothing and chroma subsampling of encoded values.
    fn smoothed(&self, mut picture: Plane<f32>) -> Plane<f32> {
        if self.luma_sigma_px > 0.0 || self.chroma_sigma_px > 0.0 || self.chroma_step != [1, 1] {
            let luma_of = |p: &[f32]| (0..3).map(|c| LUMA[c] as f32 * p[c]).sum::<f32>();
            let luma =
                Plane { channels: 1, data: picture.data.chunks_exact(3).map(luma_of).collect(), ..picture };
            // R - Y, G - Y, B - Y are linear in Cb and Cr: smoothing them smooths those.
            for (p, y) in picture.data.chunks_exact_mut(3).zip(&luma.data) {
                p.iter_mut().for_each(|v| *v -= y);
            }
            let mut chroma = gaussian(&picture, self.chroma_sigma_px);
            if self.chroma_step == [2, 2] {
                chroma = subsample(&chroma);
            } else if self.chroma_step != [1, 1] {
                chroma = convolve_separable(&chroma, &[0.5, 0.25]);
            }
            let luma = gaussian(&luma, self.luma_sigma_px);
            picture = chroma;
            for (p, y) in picture.data.chunks_exact_mut(3).zip(&luma.data) {
                p.iter_mut().for_each(|v| *v += y);
            }
        }
        picture
    }

    /// JPEG, or rounding to the file's steps.
    fn file(&self, mut picture: Plane<f32>) -> Result<Plane<f32>> {
        if let Some(quality) = self.jpeg_quality {
            return jpeg(&picture, quality);
        }
        if self.step > 0.0 {
            let step = self.step as f32;
            picture.data.iter_mut().for_each(|v| *v = ((v.clamp(0.0, 1.0) / step).round()) * step);
        }
        Ok(picture)
    }
}

/// RGGB mosaic of the picture, and back by the mean of the nearest of each colour.
fn bilinear_demosaic(full: &Plane<f32>) -> Plane<f32> {
    let (width, height) = (full.width as i64, full.height as i64);
    let color = |x: i64, y: i64| (x.rem_euclid(2) + y.rem_euclid(2)) as usize;
    // Mirrored about the border pixel, which keeps the colours in step.
    let mirror = |v: i64, n: i64| {
        if v < 0 {
            -v
        } else if v >= n {
            2 * n - 2 - v
        } else {
            v
        }
    };
    let mut out = Plane::new(full.width, full.height, 3);
    use rayon::prelude::*;
    out.data.par_chunks_mut(full.width * 3).enumerate().for_each(|(y, row)| {
        let y = y as i64;
        for x in 0..width {
            let (mut sums, mut weights) = ([0.0f32; 3], [0.0f32; 3]);
            for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
                let (u, v) = (mirror(x + dx, width), mirror(y + dy, height));
                let c = color(x + dx, y + dy);
                let weight = if dx == 0 && dy == 0 {
                    1e6
                } else if dx == 0 || dy == 0 {
                    1.0
                } else {
                    0.5
                };
                // Green's diagonal neighbours are of its own colour and not its nearest.
                if c == 1 && dx != 0 && dy != 0 {
                    continue;
                }
                sums[c] += weight * full.data[((v * width + u) * 3) as usize + c];
                weights[c] += weight;
            }
            for c in 0..3 {
                row[x as usize * 3 + c] = sums[c] / weights[c];
            }
        }
    });
    out
}

/// 4:2:0: means of 2x2, and back by linear interpolation.
fn subsample(chroma: &Plane<f32>) -> Plane<f32> {
    let (w, h) = (chroma.width.div_ceil(2), chroma.height.div_ceil(2));
    let small = Plane::from_fn(w, h, |x, y| {
        let (x1, y1) = ((2 * x + 1).min(chroma.width - 1), (2 * y + 1).min(chroma.height - 1));
        let four = [
            chroma.pixel(2 * x, 2 * y),
            chroma.pixel(x1, 2 * y),
            chroma.pixel(2 * x, y1),
            chroma.pixel(x1, y1),
        ];
        three(|c| four.iter().map(|p| 0.25 * p[c]).sum::<f32>())
    });
    // The nearer small sample weighs 3/4, the one on the pixel's other side 1/4.
    let other = |v: usize, n: usize| {
        if v.is_multiple_of(2) { (v / 2).saturating_sub(1) } else { (v / 2 + 1).min(n - 1) }
    };
    Plane::from_fn(chroma.width, chroma.height, |x, y| {
        let (x0, y0, x1, y1) = (x / 2, y / 2, other(x, w), other(y, h));
        let (a, b, c, d) =
            (small.pixel(x0, y0), small.pixel(x1, y0), small.pixel(x0, y1), small.pixel(x1, y1));
        three(|k| 0.5625 * a[k] + 0.1875 * (b[k] + c[k]) + 0.0625 * d[k])
    })
}

/// Through a JPEG file in memory, at full chroma resolution (the subsampling comes before).
fn jpeg(picture: &Plane<f32>, quality: u32) -> Result<Plane<f32>> {
    let bytes: Vec<u8> = picture.data.iter().map(|v| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8).collect();
    let mut file = Vec::new();
    let fault = |e: image::ImageError| Error::Picture {
        path: "simulated.jpg".into(),
        action: "encode",
        reason: e.to_string(),
    };
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, quality.clamp(1, 100) as u8);
    let (width, height) = (picture.width as u32, picture.height as u32);
    image::ImageEncoder::write_image(encoder, &bytes, width, height, image::ExtendedColorType::Rgb8)
        .map_err(fault)?;
    let back =
        image::load_from_memory_with_format(&file, image::ImageFormat::Jpeg).map_err(fault)?.into_rgb8();
    Ok(Plane { data: back.into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect(), ..*picture })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demosaicked_flat_stays_flat_and_noise_spreads_to_its_neighbours() {
        let flat = Plane::from_fn(20, 14, |_, _| [0.2f32, 0.4, 0.6]);
        assert!(bilinear_demosaic(&flat).data.iter().zip(&flat.data).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(subsample(&flat).data.iter().zip(&flat.data).all(|(a, b)| (a - b).abs() < 1e-6));
        let mut point = Plane::<f32>::new(20, 14, 3);
        // (10, 6) is a red place of RGGB: only red is read there.
        point.pixel_mut(10, 6).copy_from_slice(&[1.0; 3]);
        let seen = bilinear_demosaic(&point);
        assert!((seen.pixel(10, 6)[0] - 1.0).abs() < 1e-4 && (seen.pixel(11, 6)[0] - 0.5).abs() < 1e-4);
        assert!((seen.pixel(11, 7)[0] - 0.25).abs() < 1e-4 && seen.pixel(10, 6)[1] == 0.0);
    }

    #[test]
    fn the_sensor_has_the_variance_of_its_parameters() {
        let camera = IspCamera::sensor(900.0, 0.01, false, 0.0);
        for level in [0.01f32, 0.04, 0.3, 0.8] {
            let clean = Plane::from_fn(200, 200, |_, _| [level; 3]);
            let got = camera.frame(&clean, 0, 5).expect("a frame");
            let n = got.data.len() as f64;
            let mean = got.data.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
            let variance = got.data.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
            let want = f64::from(level) / 900.0 + 1e-4;
            assert!((variance / want - 1.0).abs() < 0.03, "{level}: {variance} for {want}");
            assert!((mean - f64::from(level)).abs() < 4.0 * (want / n).sqrt(), "{level}: {mean}");
        }
    }
}
