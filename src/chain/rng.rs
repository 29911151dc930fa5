//! Counter-based random numbers, the twin of `glsl/include/rng.glsl`.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw: "Parallel random numbers: as easy as 1, 2, 3", SC 2011): 128 bits are a
//! pure function of the counter (x, y, frame, stream) and the key (seed). There is no state and no order, so the same
//! seed, frame and pixel give the same bits on any device, with any number of threads.
//!
//! pcg4d (Jarzynski, Olano: "Hash functions for GPU rendering", JCGT 2020) was measured beside it and not taken: see
//! `tests/property/noise_statistics.rs`.
//!
//! Each purpose has a stream of its own, a constant STREAM_... of the effect that draws from it, in its kernel and its
//! Rust file (`tests/property/effects_registry.rs` checks that they agree and that no two are equal). Fixed patterns
//! pass [`FIXED_FRAME`] in place of the frame and the sensor's seed in place of the run's.
//!
//! Normal numbers need a logarithm and a circle. Both are polynomials made of sums and products only, which IEEE 754
//! and Vulkan round alike; `ln`, `sin` and `cos` need not agree between two devices. What is left to the device is one
//! square root.

use std::f32::consts::{FRAC_PI_2, LN_2};

/// Stands in for the frame in patterns that belong to the sensor and must not flicker.
pub const FIXED_FRAME: u32 = 0xffff_ffff;

/// The seed as the two words that kernels take, low word first.
pub fn seed_words(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}

/// The block function: 128 bits from a counter and a key, ten rounds.
pub fn philox4x32_10(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let a = 0xD251_1F53_u64 * u64::from(counter[0]);
        let b = 0xCD9E_8D57_u64 * u64::from(counter[2]);
        let (high_a, high_b) = ((a >> 32) as u32, (b >> 32) as u32);
        counter = [high_b ^ counter[1] ^ key[0], b as u32, high_a ^ counter[3] ^ key[1], a as u32];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

/// 128 random bits of a pixel, frame and stream.
pub fn random_bits(pixel: [u32; 2], frame: u32, stream: u32, seed: [u32; 2]) -> [u32; 4] {
    philox4x32_10([pixel[0], pixel[1], frame, stream], seed)
}

/// Four independent numbers, each anywhere from 0 to 1, of a pixel, frame and stream.
pub fn random_uniform(pixel: [u32; 2], frame: u32, stream: u32, seed: [u32; 2]) -> [f32; 4] {
    random_bits(pixel, frame, stream, seed).map(|b| b as f32 / u32::MAX as f32)
}

/// `-2 ln((bits + 1) / 2^32)`: 0 to 44.4, relative error below 3e-7.
fn minus_two_log(bits: u32) -> f32 {
    let raw = (bits as f32 + 1.0).to_bits();
    let above = u32::from(raw & 0x7f_ffff > 0x35_04f3);
    let exponent = ((raw >> 23) as i32 - 127 + above as i32) as f32;
    let x = f32::from_bits((raw & 0x7f_ffff) | ((127 - above) << 23)) - 1.0;
    // Interpolates (ln(1 + x) - x + x^2/2) / x^3 at the Chebyshev nodes of [sqrt(1/2) - 1, sqrt(2) - 1]; the error of
    // the logarithm is below 3e-9.
    const P: [f32; 9] = [
        0.069_716_12,
        -0.114_797_34,
        0.116_854_2,
        -0.124_256_87,
        0.142_490_58,
        -0.166_678_03,
        0.200_007_16,
        -0.249_999_97,
        0.333_333_3,
    ];
    let p = P[1..].iter().fold(P[0], |p, c| p * x + c);
    let square = x * x;
    let log_mantissa = x - 0.5 * square + x * square * p;
    let log_u = (32.0 - exponent) * LN_2 - log_mantissa;
    (2.0 * log_u).max(0.0)
}

/// A point of the unit circle: two bits choose the quadrant, thirty the angle within (-pi/4, pi/4) of its middle.
fn unit_circle(bits: u32) -> [f32; 2] {
    let angle = ((bits & 0x3fff_ffff) as f32 * 9.313_226e-10 - 0.5) * FRAC_PI_2;
    let q = angle * angle;
    let sine =
        angle * (1.0 + q * (-0.166_666_67 + q * (0.008_333_334 + q * (-0.000_198_412_7 + q * 2.755_732e-6))));
    let cosine = 1.0
        + q * (-0.5
            + q * (0.041_666_668 + q * (-0.001_388_888_9 + q * (2.480_158_7e-5 + q * -2.755_732e-7))));
    match bits >> 30 {
        0 => [cosine, sine],
        1 => [-sine, cosine],
        2 => [-cosine, -sine],
        _ => [sine, -cosine],
    }
}

/// Four independent normal numbers (Box-Muller; up to 6.66 sigma) of a pixel, frame and stream.
pub fn random_normal(pixel: [u32; 2], frame: u32, stream: u32, seed: [u32; 2]) -> [f32; 4] {
    normal_of_bits(random_bits(pixel, frame, stream, seed))
}

/// The same from bits that were drawn already.
pub fn normal_of_bits(bits: [u32; 4]) -> [f32; 4] {
    let pair = |radius: u32, angle: u32| {
        let (radius, point) = (minus_two_log(radius).sqrt(), unit_circle(angle));
        [radius * point[0], radius * point[1]]
    };
    let ([a, b], [c, d]) = (pair(bits[0], bits[1]), pair(bits[2], bits[3]));
    [a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The authors' own vectors (`kat_vectors` of Random123): zeros, ones, digits of pi.
    #[test]
    fn philox_gives_the_published_vectors() {
        let zero = philox4x32_10([0; 4], [0; 2]);
        assert_eq!(zero, [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        let ones = philox4x32_10([u32::MAX; 4], [u32::MAX; 2]);
        assert_eq!(ones, [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let pi =
            philox4x32_10([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]);
        assert_eq!(pi, [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]);
    }

    #[test]
    fn logarithm_and_circle_agree_with_the_standard_library() {
        let mut bits = 0x1234_5678_u32;
        for step in 0..400_000_u32 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let sample = match step {
                0..1000 => step,
                1000..2000 => u32::MAX - (step - 1000),
                _ => bits,
            };
            // The float nearest bits + 1 is the argument: its own rounding is the same on every device.
            let u = f64::from(sample as f32 + 1.0) / 4_294_967_296.0;
            let (got, want) = (f64::from(minus_two_log(sample)), -2.0 * u.ln());
            assert!((got - want).abs() <= 3e-7 * want, "bits {sample:#x}: {got} for {want}");
            let angle = (f64::from(sample) / 4_294_967_296.0 - 0.125) * std::f64::consts::TAU;
            let [x, y] = unit_circle(sample).map(f64::from);
            assert!(
                (x - angle.cos()).abs() < 2e-7 && (y - angle.sin()).abs() < 2e-7,
                "angle {angle}: {x} {y}"
            );
        }
        assert!((minus_two_log(0).sqrt() - 6.660_4).abs() < 1e-3, "the tails reach 6.66 sigma");
        assert_eq!(minus_two_log(u32::MAX), 0.0);
    }
}
