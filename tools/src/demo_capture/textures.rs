//! The pictures on grass, walls and banners. Texels are about 3 cm, so that none is much smaller than a pixel on the
//! far wall: the contract samples bilinearly, without smaller copies.

use image::{Rgb, RgbImage};

use crate::font;

/// Grass, 2 m: mown stripes with speckles, repeating.
pub fn grass() -> RgbImage {
    RgbImage::from_fn(64, 64, |x, y| {
        let speckle = hash(x, y) % 4;
        let stripe = if x < 32 { 0 } else { 14 };
        let v = (100 + stripe + 8 * speckle) as u8;
        Rgb([v / 2, v, v / 2 - 8])
    })
}

/// Wall panels, 1 m: two panels a metre with dark joints, repeating.
pub fn wall() -> RgbImage {
    RgbImage::from_fn(32, 32, |x, y| match (x % 16, y) {
        (0 | 1, _) | (_, 0) => Rgb([96, 96, 104]),
        _ if x < 16 => Rgb([214, 208, 192]),
        _ => Rgb([188, 186, 178]),
    })
}

/// The banner, 4 m by half a metre: the project's name between coloured bars, repeating along its length.
pub fn banner() -> RgbImage {
    let (width, height, name) = (128u32, 16u32, "SHUTTERBUG");
    let mut picture = RgbImage::from_fn(width, height, |x, _| match x {
        0..6 | 12..18 => Rgb([220, 180, 30]),
        6..12 | 116..122 => Rgb([24, 60, 190]),
        110..116 | 122..128 => Rgb([220, 180, 30]),
        _ => Rgb([238, 238, 234]),
    });
    let left = (width - font::width_px(name)) / 2;
    font::draw(name, |x, y| picture.put_pixel(left + x, 4 + y, Rgb([150, 20, 30])));
    picture
}

/// A fixed scramble of two coordinates (constants of the MurmurHash3 finalizer).
fn hash(x: u32, y: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}
