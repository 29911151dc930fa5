//! The chain by hand: AVX2 gathers of packed texels, weights of 8 bits, sums of 16. What this CPU can do at all, so the
//! floor that a portable kernel is measured against. The last place of the noise is not the point: sums of four bytes.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use super::input::Input;

/// How texels are read.
#[derive(Clone, Copy, PartialEq)]
pub enum Tap {
    Bilinear,
    Nearest,
}

/// One way through the chain.
#[derive(Clone, Copy)]
pub struct Way {
    pub tap: Tap,
    pub taps_per_px: f32,
    /// Count of taps where it does not follow the path.
    pub fixed: Option<i32>,
    pub most: i32,
    /// Standard deviation of the noise, levels of 255.
    pub sigma: f32,
}

pub fn available() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// Runs the chain on `threads` threads; RGBX, 8 bits.
pub fn run(input: &Input, motion: &[Vec<f32>; 2], way: Way, threads: usize, out: &mut [u32]) {
    let [width, height] = input.size;
    assert_eq!(out.len(), width * height);
    assert_eq!(width % 8, 0, "eight pixels at a time");
    let rows = std::sync::Mutex::new(out.chunks_mut(8 * width).enumerate());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let Some((block, rows)) = rows.lock().unwrap().next() else { return };
                    for (i, row) in rows.chunks_mut(width).enumerate() {
                        // SAFETY: `available` was asked; all reads are clamped to the picture.
                        #[cfg(target_arch = "x86_64")]
                        unsafe {
                            line(input, motion, way, 8 * block + i, row);
                        }
                        #[cfg(not(target_arch = "x86_64"))]
                        let _ = (input, motion, way, block, i, row);
                    }
                }
            });
        }
    });
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2,fma")]
fn integral(v0: __m256, v1: __m256, knot: f32) -> __m256 {
    let h = _mm256_set1_ps(knot.clamp(0.0, 1.0));
    let half = _mm256_mul_ps(h, _mm256_set1_ps(0.5));
    let inside = _mm256_mul_ps(h, _mm256_fmadd_ps(half, _mm256_sub_ps(v1, v0), v0));
    _mm256_fmadd_ps(_mm256_set1_ps((knot - 1.0).max(0.0)), v1, inside)
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2,fma")]
fn length(x: __m256, y: __m256) -> __m256 {
    _mm256_sqrt_ps(_mm256_fmadd_ps(x, x, _mm256_mul_ps(y, y)))
}

/// One row of the result.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn line(input: &Input, motion: &[Vec<f32>; 2], way: Way, y: usize, out: &mut [u32]) {
    let [width, height] = input.size;
    let (margin, columns) = (input.margin, width + 2 * input.margin);
    let rows = height + 2 * margin;
    let f = y as f32 / height as f32;
    let texels = input.color.as_ptr().cast::<i32>();
    let motion_at = |image: usize, texel: __m256i, channel: i32| {
        let at = _mm256_add_epi32(_mm256_slli_epi32(texel, 1), _mm256_set1_epi32(channel));
        // SAFETY: the texel lies inside the picture, and the image has two channels.
        unsafe { _mm256_i32gather_ps::<4>(motion[image].as_ptr(), at) }
    };
    let (one, low_mask) = (_mm256_set1_ps(1.0), _mm256_set1_epi32(0x00ff_00ff));
    let (last_x, last_y) = (_mm256_set1_ps(columns as f32 - 1.0), _mm256_set1_ps(rows as f32 - 1.0));
    let pitch = _mm256_set1_epi32(columns as i32);
    let inside = |p: __m256, last: __m256| _mm256_min_ps(_mm256_max_ps(p, one), last);
    let ramp = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let mut state = _mm256_add_epi32(
        _mm256_set1_epi32(0x9e37_79b9_u32 as i32 ^ (y as i32) << 13),
        _mm256_setr_epi32(1, 77, 1234, 9999, 31337, 65537, 99991, 123457),
    );
    for x in (0..width).step_by(8) {
        let base_x = _mm256_add_ps(ramp, _mm256_set1_ps((x + margin) as f32 + 0.5));
        let base_y = _mm256_set1_ps((y + margin) as f32 + 0.5);
        let here = _mm256_add_epi32(
            _mm256_set1_epi32(((y + margin) * columns + margin + x) as i32),
            _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7),
        );
        let mixed = |c: i32| {
            let (a, b) = (motion_at(0, here, c), motion_at(1, here, c));
            _mm256_fmadd_ps(_mm256_set1_ps(f), _mm256_sub_ps(b, a), a)
        };
        let shift = _mm256_set1_ps(0.5 - f);
        let (px, py) = (_mm256_fmadd_ps(shift, mixed(0), base_x), _mm256_fmadd_ps(shift, mixed(1), base_y));
        let (px, py) = (inside(px, last_x), inside(py, last_y));
        let texel =
            _mm256_add_epi32(_mm256_mullo_epi32(_mm256_cvttps_epi32(py), pitch), _mm256_cvttps_epi32(px));
        let path = |c: i32| {
            let (a, b) = (motion_at(0, texel, c), motion_at(1, texel, c));
            let begin = integral(a, b, f);
            (_mm256_sub_ps(integral(a, b, f + 0.5), begin), _mm256_sub_ps(integral(a, b, f + 1.0), begin))
        };
        let ((mx, wx), (my, wy)) = (path(0), path(1));
        let path_px = _mm256_add_ps(length(mx, my), length(_mm256_sub_ps(wx, mx), _mm256_sub_ps(wy, my)));
        let mut lengths = [0f32; 8];
        // SAFETY: eight floats.
        unsafe { _mm256_storeu_ps(lengths.as_mut_ptr(), path_px) };
        let longest = lengths.iter().fold(0.0f32, |m, v| m.max(*v));
        let n = way.fixed.unwrap_or(((longest * way.taps_per_px - 0.001).ceil() as i32).clamp(1, way.most));
        // position(u) = begin + a u + b u^2 through begin, middle and end, all inside.
        let (ex, ey) = (inside(_mm256_sub_ps(px, wx), last_x), inside(_mm256_sub_ps(py, wy), last_y));
        let (cx, cy) = (inside(_mm256_sub_ps(px, mx), last_x), inside(_mm256_sub_ps(py, my), last_y));
        let four = _mm256_set1_ps(4.0);
        let linear = |p: __m256, m: __m256, e: __m256| {
            _mm256_sub_ps(_mm256_mul_ps(four, m), _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(3.0), p), e))
        };
        let square = |p: __m256, m: __m256, e: __m256| {
            _mm256_mul_ps(_mm256_set1_ps(2.0), _mm256_sub_ps(_mm256_add_ps(p, e), _mm256_add_ps(m, m)))
        };
        let (ax, ay, bx, by) =
            (linear(px, cx, ex), linear(py, cy, ey), square(px, cx, ex), square(py, cy, ey));
        let h = 1.0 / n as f32;
        let start = |p: __m256, a: __m256, b: __m256| {
            _mm256_fmadd_ps(_mm256_set1_ps(0.5 * h), _mm256_fmadd_ps(_mm256_set1_ps(0.5 * h), b, a), p)
        };
        let step = |a: __m256, b: __m256| {
            _mm256_mul_ps(_mm256_set1_ps(h), _mm256_fmadd_ps(_mm256_set1_ps(2.0 * h), b, a))
        };
        let bend = |b: __m256| _mm256_mul_ps(_mm256_set1_ps(2.0 * h * h), b);
        let (mut sx, mut sy) = (start(px, ax, bx), start(py, ay, by));
        if way.tap == Tap::Bilinear {
            sx = _mm256_sub_ps(sx, _mm256_set1_ps(0.5));
            sy = _mm256_sub_ps(sy, _mm256_set1_ps(0.5));
        }
        let (mut dx, mut dy, ddx, ddy) = (step(ax, bx), step(ay, by), bend(bx), bend(by));
        // Red and blue, green and alpha: two 16-bit sums a word; 240 taps of 255 fit.
        let (mut rb, mut ga) = (_mm256_setzero_si256(), _mm256_setzero_si256());
        for _ in 0..n {
            let (ix, iy) = (_mm256_cvttps_epi32(sx), _mm256_cvttps_epi32(sy));
            let at = _mm256_add_epi32(_mm256_mullo_epi32(iy, pitch), ix);
            // SAFETY: begin, middle and end of the path are clamped to one px inside the picture.
            let near = unsafe { _mm256_i32gather_epi32::<4>(texels, at) };
            let (tap_rb, tap_ga) = match way.tap {
                Tap::Nearest => (
                    _mm256_and_si256(near, low_mask),
                    _mm256_and_si256(_mm256_srli_epi32::<8>(near), low_mask),
                ),
                Tap::Bilinear => {
                    let weight = |s: __m256, i: __m256i| {
                        let w = _mm256_cvttps_epi32(_mm256_mul_ps(
                            _mm256_sub_ps(s, _mm256_cvtepi32_ps(i)),
                            _mm256_set1_ps(256.0),
                        ));
                        _mm256_or_si256(w, _mm256_slli_epi32::<16>(w))
                    };
                    let (kx, ky) = (weight(sx, ix), weight(sy, iy));
                    // SAFETY: as above; neighbours of what is one px inside.
                    let [right, below, across] = unsafe {
                        [1, columns, columns + 1].map(|by| _mm256_i32gather_epi32::<4>(texels.add(by), at))
                    };
                    let mix = |a: __m256i, b: __m256i, k: __m256i| {
                        let d = _mm256_mullo_epi16(_mm256_sub_epi16(b, a), k);
                        // a + (b - a) k / 256 in 16 bits: the high byte of 256 a + (b - a) k, which fits unsigned.
                        _mm256_srli_epi16::<8>(_mm256_add_epi16(_mm256_slli_epi16::<8>(a), d))
                    };
                    let low = |t: __m256i| _mm256_and_si256(t, low_mask);
                    let high = |t: __m256i| _mm256_and_si256(_mm256_srli_epi32::<8>(t), low_mask);
                    (
                        mix(mix(low(near), low(right), kx), mix(low(below), low(across), kx), ky),
                        mix(mix(high(near), high(right), kx), mix(high(below), high(across), kx), ky),
                    )
                }
            };
            rb = _mm256_add_epi16(rb, tap_rb);
            ga = _mm256_add_epi16(ga, tap_ga);
            sx = _mm256_add_ps(sx, dx);
            sy = _mm256_add_ps(sy, dy);
            dx = _mm256_add_ps(dx, ddx);
            dy = _mm256_add_ps(dy, ddy);
        }
        let mut packed = _mm256_set1_epi32(0xff00_0000_u32 as i32);
        let words = _mm256_set1_epi32(0xffff);
        let sums = [_mm256_and_si256(rb, words), _mm256_and_si256(ga, words), _mm256_srli_epi32::<16>(rb)];
        for (channel, sum) in sums.into_iter().enumerate() {
            let mut value = _mm256_mul_ps(_mm256_cvtepi32_ps(sum), _mm256_set1_ps(h));
            if way.sigma > 0.0 {
                state = _mm256_xor_si256(state, _mm256_slli_epi32::<13>(state));
                state = _mm256_xor_si256(state, _mm256_srli_epi32::<17>(state));
                state = _mm256_xor_si256(state, _mm256_slli_epi32::<5>(state));
                // Four uniform bytes: mean 510, variance 4 * 65535 / 12.
                let pairs = _mm256_add_epi16(
                    _mm256_and_si256(state, low_mask),
                    _mm256_and_si256(_mm256_srli_epi32::<8>(state), low_mask),
                );
                let total = _mm256_add_epi32(_mm256_and_si256(pairs, words), _mm256_srli_epi32::<16>(pairs));
                let normal = _mm256_mul_ps(
                    _mm256_sub_ps(_mm256_cvtepi32_ps(total), _mm256_set1_ps(510.0)),
                    _mm256_set1_ps(1.0 / 147.8),
                );
                value = _mm256_fmadd_ps(normal, _mm256_set1_ps(way.sigma), value);
            }
            let rounded = _mm256_cvttps_epi32(_mm256_min_ps(
                _mm256_max_ps(_mm256_add_ps(value, _mm256_set1_ps(0.5)), _mm256_setzero_ps()),
                _mm256_set1_ps(255.0),
            ));
            packed =
                _mm256_or_si256(packed, _mm256_sll_epi32(rounded, _mm_cvtsi32_si128(8 * channel as i32)));
        }
        // SAFETY: the width is a multiple of eight.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().add(x).cast(), packed) };
    }
}
