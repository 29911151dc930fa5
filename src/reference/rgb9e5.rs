//! Colours as words of shared exponents. Twin of `glsl/include/rgb9e5.glsl`.

use glam::Vec3;

/// The largest number.
const LARGEST: f32 = 65408.0;
/// The smallest of which the exponent takes notice.
const SMALLEST: f32 = 1.0 / 65536.0;

/// Nine bits a channel, rounded down after `up` (from 0 to 1) is added to them, and five of an exponent for all three.
pub fn rgb9e5(color: Vec3, up: f32) -> u32 {
    let inside = color.clamp(Vec3::ZERO, Vec3::splat(LARGEST));
    let largest = inside.max_element().max(SMALLEST);
    let exponent = (largest.to_bits() + 0x7fff) >> 23;
    let nine = (inside * f32::from_bits((262 - exponent) << 23) + up).as_uvec3();
    nine.x | nine.y << 9 | nine.z << 18 | (exponent - 111) << 27
}

/// The colour of a word.
pub fn color(word: u32) -> Vec3 {
    let unit = f32::from_bits((word >> 4 & 0x0f80_0000) + (103 << 23));
    unit * Vec3::new((word & 511) as f32, (word >> 9 & 511) as f32, (word >> 18 & 511) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_come_back_to_nine_bits_and_turns_of_rounding_to_eleven() {
        let mut worst = 0.0_f32;
        for i in 0..4000_i16 {
            let bright = 1.01_f32.powi(i32::from(i % 1000) - 400);
            let wanted = Vec3::new(1.0, f32::from(i % 37) / 37.0, f32::from(i % 11) / 11.0) * bright;
            let step = (2.0 * wanted.max_element() / 512.0).max(SMALLEST / 256.0);
            let near = color(rgb9e5(wanted, 0.5));
            assert!((near - wanted).abs().max_element() <= 0.501 * step, "{wanted}: {near}");
            let turns = [0.125, 0.375, 0.625, 0.875].map(|up| color(rgb9e5(wanted, up)));
            let mean = 0.25 * (turns[0] + turns[1] + turns[2] + turns[3]);
            worst = worst.max((mean - wanted).abs().max_element() / step);
        }
        assert!(worst < 0.13, "an eighth of a step: {worst}");
        assert!(worst > 0.1, "control: no better than eleven bits: {worst}");
        assert_eq!(color(rgb9e5(Vec3::ZERO, 0.875)), Vec3::ZERO);
        assert_eq!(color(rgb9e5(Vec3::new(1e9, 0.0, -1.0), 0.5)), Vec3::new(LARGEST, 0.0, 0.0));
    }
}
