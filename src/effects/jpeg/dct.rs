//! What JPEG does to blocks of 8x8 values: the cosine transform, and the steps that a quality rounds its coefficients
//! to (ITU-T T.81, annex A.3.3 and tables K.1 and K.2; scaled as libjpeg does).

use crate::plane::{Plane, stats};

/// Side of a block, px.
pub const SIDE: usize = 8;
/// Values of a block.
pub const AREA: usize = SIDE * SIDE;
/// Brightness that a file codes as none, DN.
const MIDDLE_DN: f32 = 128.0;

/// Rows of the conversion to brightness and two colours.
pub(crate) const TO_YCC: [[f32; 3]; 3] =
    [stats::LUMA, [-0.168_736, -0.331_264, 0.5], [0.5, -0.418_688, -0.081_312]];

/// Steps of brightness at quality 50, by row.
const LUMA: [u8; AREA] = [
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17,
    22, 29, 51, 87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78,
    87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99,
];
/// Steps of colour at quality 50: the corner of them that is below 99.
const CHROMA: [[u8; 4]; 4] = [[17, 18, 24, 47], [18, 21, 26, 66], [24, 26, 56, 99], [47, 66, 99, 99]];

/// Steps of the coefficients of brightness or of colour at a quality of 1 to 100.
pub fn steps(quality: u8, chroma: bool) -> [f32; AREA] {
    let quality = u32::from(quality.clamp(1, 100));
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    std::array::from_fn(|i| {
        let base = match (chroma, i / SIDE, i % SIDE) {
            (false, ..) => LUMA[i],
            (true, v, u) if v < 4 && u < 4 => CHROMA[v][u],
            _ => 99,
        };
        ((u32::from(base) * scale + 50) / 100).clamp(1, 255) as f32
    })
}

/// Brightness of the block of a picture (three colours, DN) that begins at a pixel, as a file codes it: less the middle
/// of its range.
pub fn luma_block(picture: &Plane<f32>, [x0, y0]: [usize; 2]) -> [f32; AREA] {
    std::array::from_fn(|i| stats::luma(picture.pixel(x0 + i % SIDE, y0 + i / SIDE)) - MIDDLE_DN)
}

/// The orthonormal cosine transform: a block's variance is that of its coefficients.
pub struct Dct {
    /// By frequency, then place.
    pub(super) waves: [[f32; SIDE]; SIDE],
    /// By place, then frequency.
    places: [[f32; SIDE]; SIDE],
}

impl Default for Dct {
    fn default() -> Self {
        Self::new()
    }
}

impl Dct {
    /// The waves, worked out.
    pub fn new() -> Self {
        let wave = |u: usize, x: usize| {
            let angle = std::f32::consts::PI * u as f32 * (x as f32 + 0.5) / SIDE as f32;
            angle.cos() * if u == 0 { 0.125f32.sqrt() } else { 0.5 }
        };
        Self {
            waves: std::array::from_fn(|u| std::array::from_fn(|x| wave(u, x))),
            places: std::array::from_fn(|x| std::array::from_fn(|u| wave(u, x))),
        }
    }

    /// Coefficients of a block; by row: frequency along columns, then along rows.
    pub fn forward(&self, block: &[f32; AREA]) -> [f32; AREA] {
        let rows = product(block, &self.places);
        transposed(&product(&transposed(&rows), &self.places))
    }

    /// The block of coefficients.
    pub(crate) fn inverse(&self, coefficients: &[f32; AREA]) -> [f32; AREA] {
        let rows = product(coefficients, &self.waves);
        transposed(&product(&transposed(&rows), &self.waves))
    }
}

/// Each row times a matrix. A row of the result grows by one row of the matrix at a time: eight sums side by side,
/// which compilers turn into vectors, where one sum after the other is eight chains of additions.
fn product(block: &[f32; AREA], matrix: &[[f32; SIDE]; SIDE]) -> [f32; AREA] {
    let mut out = [0.0; AREA];
    for (from, to) in block.chunks_exact(SIDE).zip(out.chunks_exact_mut(SIDE)) {
        for (value, row) in from.iter().zip(matrix) {
            to.iter_mut().zip(row).for_each(|(sum, m)| *sum += value * m);
        }
    }
    out
}

fn transposed(block: &[f32; AREA]) -> [f32; AREA] {
    std::array::from_fn(|i| block[SIDE * (i % SIDE) + i / SIDE])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_undoes_the_transform_which_keeps_squares() {
        let dct = Dct::new();
        let block: [f32; AREA] = std::array::from_fn(|i| ((i * 37 + 11) % 101) as f32 - 50.0);
        let coefficients = dct.forward(&block);
        let back = dct.inverse(&coefficients);
        let off = block.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-3, "{off}");
        let square = |v: &[f32; AREA]| v.iter().map(|v| v * v).sum::<f32>();
        assert!((square(&block) / square(&coefficients) - 1.0).abs() < 1e-4);
        // One wave along the rows is one coefficient, beside the first of its row.
        let wave: [f32; AREA] = std::array::from_fn(|i| {
            (std::f32::consts::PI * 2.0 * ((i % SIDE) as f32 + 0.5) / SIDE as f32).cos()
        });
        let seen = dct.forward(&wave);
        assert!(seen[2] > 3.9 && seen.iter().enumerate().all(|(i, c)| i == 2 || c.abs() < 1e-4), "{seen:?}");
    }

    #[test]
    fn steps_are_those_that_the_encoder_writes() {
        let picture = vec![128u8; AREA * 3];
        for quality in [10, 50, 77, 95] {
            let mut bytes = Vec::new();
            image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality)
                .encode(&picture, 8, 8, image::ExtendedColorType::Rgb8)
                .expect("into memory");
            let at = bytes.windows(2).position(|w| w == [0xff, 0xdb]).expect("a table");
            // Length, precision and number; then in zigzag: the first three are (0, 0), (0, 1), (1, 0).
            let steps = steps(quality, false);
            let written: Vec<f32> = bytes[at + 5..at + 8].iter().map(|v| f32::from(*v)).collect();
            assert_eq!(written, [steps[0], steps[1], steps[8]], "{quality}");
        }
    }
}
