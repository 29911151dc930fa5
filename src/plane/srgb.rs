//! The curve of sRGB (IEC 61966-2-1), twin of `glsl/include/srgb.glsl`: polynomials in roots of the value, in the
//! kernels' order of operations. A power costs a software device twice as much, and devices round it in their own ways.

/// Of the fourth root of linear radiance from 0.0031308 to 1, highest first: nearest to 1.055 l^(1/2.4) - 0.055.
#[allow(clippy::excessive_precision)]
const ENCODE: [f32; 8] = [
    -0.076_208_11,
    0.394_703_92,
    -0.898_396_25,
    1.209_134_2,
    -1.155_886_8,
    1.461_522_8,
    0.123_576_38,
    -0.058_446_15,
];

/// Of the root of (e + 0.055) / 1.055, e from 0.04045 to 1, highest first: nearest to its power 4.8.
#[allow(clippy::excessive_precision)]
const DECODE: [f32; 7] =
    [-0.035_358_537, 0.807_914_2, 0.312_242_57, -0.111_279_73, 0.031_333_66, -0.005_231_237, 3.790_928_5e-4];

/// Linear radiance (1 = white) to the sRGB-encoded value in 0..=1; clips first.
pub fn srgb_encode(linear: f32) -> f32 {
    let l = linear.clamp(0.0, 1.0);
    let q = l.sqrt().sqrt();
    let p = ENCODE[1..].iter().fold(ENCODE[0], |p, c| p * q + c);
    if l <= 0.003_130_8 { 12.92 * l } else { p }
}

/// sRGB-encoded value in 0..=1 to linear radiance.
pub fn srgb_decode(encoded: f32) -> f32 {
    let s = (encoded * 0.947_867_3 + 0.052_132_7).max(0.0).sqrt();
    let p = DECODE[1..].iter().fold(DECODE[0], |p, c| p * s + c);
    if encoded <= 0.040_45 { encoded * 0.077_399_38 } else { p }
}

/// Slope of the standard's curve: encoded value by linear radiance, both 1 = white.
pub fn srgb_slope(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 } else { 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0) }
}

/// Linear radiance to an 8-bit sRGB value: `round(255 srgb(L))`.
pub fn srgb8(linear: f32) -> u8 {
    (255.0 * srgb_encode(linear) + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(l: f64) -> f64 {
        if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 }
    }

    fn decode(e: f64) -> f64 {
        if e <= 0.040_45 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) }
    }

    #[test]
    fn both_curves_are_the_standards() {
        let worst = |f: fn(f32) -> f32, want: fn(f64) -> f64| {
            let values = (0..=1_000_000_u32).map(|i| i as f32 * 1e-6);
            values.map(|v| (f64::from(f(v)) - want(f64::from(v))).abs()).fold(0.0, f64::max)
        };
        let (there, back) = (worst(srgb_encode, encode), worst(srgb_decode, decode));
        assert!(there < 1e-6 && back < 7e-7, "{there:e}, {back:e}");
        assert_eq!((srgb_encode(1.0), srgb_decode(1.0)), (1.0, 1.0), "white is white");
        // Control: the usual shortcut, a power of 2.2.
        assert!(worst(|v| v.powf(1.0 / 2.2), encode) > 1e-2 && worst(|v| v.powf(2.2), decode) > 1e-3);
    }

    #[test]
    fn all_8_bit_values_come_back() {
        for v in 0..=255_u8 {
            assert_eq!(srgb8(srgb_decode(f32::from(v) / 255.0)), v);
        }
        assert_eq!((srgb8(-1.0), srgb8(9.0), srgb8(f32::NAN)), (0, 255, 0));
    }

    #[test]
    fn brighter_is_never_darker() {
        let mut last = [0.0; 2];
        for i in 0..=2_000_000_u32 {
            let v = i as f32 * 5e-7;
            let now = [srgb_encode(v), srgb_decode(v)];
            // A polynomial's own rounding.
            assert!((0..2).all(|k| now[k] >= last[k] - 2e-7), "{v}: {now:?} after {last:?}");
            last = now;
        }
    }
}
