//! Radiance to the delivered picture where `paper_noise` is the only effect on pixels: linear noise, sRGB, 8 bits,
//! written on its own. A chain without further effects must give the same bits.

use bytemuck::{Pod, Zeroable};

pub use crate::effects::gradient_magnitude;
use crate::effects::{PaperNoiseSigma, paper_noise};
use crate::plane::{Plane, srgb8};

/// Alpha 0 instead of 255 where the radiance's alpha is negative (a sample left the rendered picture).
pub const FLAG_MARK_CLAMPED: u32 = 1;

/// The kernel's parameters.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height, px.
    pub size: [u32; 2],
    /// [`crate::chain::rng::seed_words`] of the seed.
    pub seed: [u32; 2],
    /// Number of the frame.
    pub frame: u32,
    /// [`FLAG_MARK_CLAMPED`] or 0.
    pub flags: u32,
    /// Keeps the vectors at multiples of 16 bytes.
    pub padding: [u32; 2],
    /// As in [`PaperNoiseSigma`].
    pub static_sigma: [f32; 4],
    /// As in [`PaperNoiseSigma`].
    pub color_sigma: [f32; 4],
    /// As in [`PaperNoiseSigma`].
    pub edge_sigma: [f32; 4],
}

/// The delivered picture, shape `[height, width, 4]`: sRGB-encoded RGB and an alpha of 255.
///
/// `radiance`: shape `[height, width, 4]`, linear RGB and the alpha of [`super::paper_gather::paper_gather`].
///
/// # Panics
/// If the radiance has another shape than `push.size`.
pub fn develop(push: &Push, radiance: &Plane<f32>) -> Plane<u8> {
    let [width, height] = push.size.map(|side| side as usize);
    assert_eq!((radiance.width, radiance.height, radiance.channels), (width, height, 4), "radiance");
    let sigma = PaperNoiseSigma {
        static_sigma: push.static_sigma,
        color_sigma: push.color_sigma,
        edge_sigma: push.edge_sigma,
    };
    Plane::from_fn(width, height, |x, y| {
        let seen = radiance.pixel(x, y);
        let gradient = gradient_magnitude(radiance, x, y);
        let linear = [seen[0], seen[1], seen[2]];
        let noisy = paper_noise(linear, gradient, [x as u32, y as u32], push.frame, push.seed, &sigma);
        let marked = push.flags & FLAG_MARK_CLAMPED != 0 && seen[3] < 0.0;
        let [r, g, b] = noisy.map(srgb8);
        [r, g, b, if marked { 0 } else { 255 }]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_sigma_nothing_but_the_encoding_happens() {
        let values = [-1.0, 0.0, 1e-4, 0.0031308, 0.2, 0.5, 0.999, 1.0, 7.0, f32::NAN, f32::INFINITY];
        let radiance =
            Plane::from_fn(values.len(), 1, |x, _| [values[x], 1.0 - values[x], 0.25, 1.0 - x as f32]);
        let mut push = Push { size: [values.len() as u32, 1], seed: [7, 9], frame: 3, ..Push::default() };
        let picture = develop(&push, &radiance);
        for (x, v) in values.into_iter().enumerate() {
            assert_eq!(picture.pixel(x, 0), [srgb8(v), srgb8(1.0 - v), srgb8(0.25), 255], "{v}");
        }
        push.flags = FLAG_MARK_CLAMPED;
        let alpha: Vec<u8> = develop(&push, &radiance).data.chunks(4).map(|p| p[3]).collect();
        assert_eq!(alpha[..3], [255, 255, 0], "only negative alpha is marked");
        // Control: the smallest useful sigma changes the picture.
        push.color_sigma = [0.01; 4];
        assert_ne!(develop(&push, &radiance).data, picture.data);
    }
}
