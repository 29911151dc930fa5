//! Delivered pictures of more than 8 bits: 16-bit values, linear floats, raw numbers in words and packed. Frames from
//! outside and of a scene.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ptr::null_mut;

use crate::capi_support::*;
use shutterbug::capi::*;
use shutterbug::plane::{PixelFormat, srgb_encode};

const SIZE: [u32; 2] = [32, 24];
const W: usize = 32;
const H: usize = 24;
const RAW: u32 = 6;

const CAMERA: &str = "width = 32\nheight = 24\nfx = 16\nfy = 16\ncx = 16\ncy = 12\nframe_period_s = 0.04\n\
    [rolling_shutter]\nreadout_time_s = 0.02\n[exposure_gain]\ngain = 0.7\n[black_level]\noffset = 0.0625\n";

fn set(engine: Handle, more: &str) {
    must(
        unsafe { shutterbug_engine_set_camera_text(engine, text(&format!("{CAMERA}{more}")).as_ptr()) },
        engine,
    );
}

fn taken(engine: Handle, o: &shutterbug_outside) -> Handle {
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, o, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    frame
}

/// Rows of a plane, with padding that is left alone.
fn rows(frame: Handle, plane: u32, format: u32, row_bytes: usize) -> Vec<Vec<u8>> {
    let stride = row_bytes + 6 + row_bytes % 2;
    let mut words = vec![0x5a5au16; (stride * H).div_ceil(2)];
    let mut to: shutterbug_image = sized();
    (to.format, to.width, to.height, to.stride_bytes) = (format, SIZE[0], SIZE[1], stride as u64);
    (to.capacity_bytes, to.pixels) = ((stride * (H - 1) + row_bytes) as u64, words.as_mut_ptr().cast());
    must(unsafe { shutterbug_frame_read(frame, plane, &to) }, frame);
    let bytes: &[u8] = bytemuck::cast_slice(&words);
    let split = |y: usize| bytes[y * stride..(y + 1) * stride].split_at(row_bytes);
    assert!((0..H).all(|y| split(y).1.iter().all(|b| *b == 0x5a)), "bytes between rows are left alone");
    (0..H).map(|y| split(y).0.to_vec()).collect()
}

fn words(rows: &[Vec<u8>]) -> Vec<u16> {
    rows.iter().flat_map(|r| r.chunks_exact(2).map(|w| u16::from_le_bytes([w[0], w[1]]))).collect()
}

fn rgb8(frame: Handle) -> Vec<u8> {
    let mut rgb = vec![0; W * H * 3];
    must(unsafe { shutterbug_frame_read(frame, 1, &image(PixelFormat::Rgb8, W, H, &mut rgb)) }, frame);
    rgb
}

fn floats(frame: Handle, plane: u32) -> Vec<f32> {
    let mut out = vec![0f32; W * H * 4];
    let to = image(PixelFormat::Rgba32f, W, H, bytemuck::cast_slice_mut(&mut out));
    must(unsafe { shutterbug_frame_read(frame, plane, &to) }, frame);
    out
}

#[test]
fn pictures_of_16_bits_and_floats_are_the_same_less_rounded() {
    let test = "pictures_of_16_bits_and_floats_are_the_same_less_rounded";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    set(engine, "[read_noise]\nsigma = 0.01\n[shot_noise]\nfull_well_e = 4000.0\n");
    let small = Small::new(SIZE[0], SIZE[1]);
    let plain = rgb8(taken(engine, &small.outside));
    let frame = taken(engine, &shutterbug_outside { flags: 4, ..small.outside });
    let rgb = rgb8(frame);
    assert!(rgb == plain, "the picture is none other for it");
    let wide = words(&rows(frame, 1, 13, 6 * W));
    // A value rounds to both: half a step of each, and no more.
    let off = |v: f64, to: u8| (255.0 * v - f64::from(to)).abs();
    let worst = wide.iter().zip(&rgb).map(|(w, b)| off(f64::from(*w) / 65535.0, *b)).fold(0.0, f64::max);
    assert!((0.45..0.503).contains(&worst), "{worst} steps of 8 bits");
    assert!(wide.iter().any(|w| w % 257 != 0), "control: more than 8 bits in it");
    let with_alpha = words(&rows(frame, 1, 14, 8 * W));
    let same = |(a, b): (&[u16], &[u16])| a[..3] == *b && a[3] == 65535;
    assert!(with_alpha.chunks(4).zip(wide.chunks(3)).all(same));
    let flipped = rows(frame, 1, 13 | 0x1_0000, 6 * W);
    assert!(flipped.iter().rev().eq(rows(frame, 1, 13, 6 * W).iter()) && flipped[0] != flipped[H - 1]);
    // Linear floats: their sRGB is the picture's value; control: they are not that value themselves.
    let linear = floats(frame, 1);
    let values = || linear.chunks(4).flat_map(|p| &p[..3]).zip(&wide);
    assert!(values().all(|(l, w)| (65535.0 * srgb_encode(*l) - f32::from(*w)).abs() < 0.7));
    assert!(values().any(|(l, w)| (65535.0 * l - f32::from(*w)).abs() > 3000.0), "control");
    assert!(linear.chunks(4).all(|p| p[3] == 1.0));
    must(shutterbug_frame_destroy(frame), null_mut());
    finish(engine);
}

/// Numbers of a row that is packed: each bit by its place in the number of all bits, as CSI-2 sends the low ones.
fn unpacked(row: &[u8], bits: usize) -> Vec<u16> {
    let (pixels, low) = (if bits == 12 { 2 } else { 4 }, bits - 8);
    let one = |group: &[u8]| {
        let rest = group[pixels..].iter().rev().fold(0u32, |all, b| all << 8 | u32::from(*b));
        let of = |p: usize| u32::from(group[p]) << low | (rest >> (low * p)) & ((1 << low) - 1);
        (0..pixels).map(|p| of(p) as u16).collect::<Vec<_>>()
    };
    row.chunks_exact(pixels + pixels * low / 8).flat_map(one).collect()
}

/// Colour of the filter before a pixel.
fn filter(pattern: &str, x: usize, y: usize) -> usize {
    "RGB".find(pattern.as_bytes()[2 * (y % 2) + x % 2] as char).unwrap()
}

/// What a converter without noise makes of radiance: gain, black level, rounding.
fn converted(radiance: f32, bits: u32) -> i32 {
    let largest = f64::from((1u32 << bits) - 1);
    ((0.0625 + 0.9375 * 0.7 * f64::from(radiance)).clamp(0.0, 1.0) * largest + 0.5).floor() as i32
}

#[test]
fn raw_numbers_are_what_the_converter_makes_of_the_light_behind_each_filter() {
    let test = "raw_numbers_are_what_the_converter_makes_of_the_light_behind_each_filter";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let small = Small::new(SIZE[0], SIZE[1]);
    let o = shutterbug_outside { flags: 2 | 8, ..small.outside };
    let after = "[white_balance]\nr = 1.7\n[gamma]\nexponent = 1.3\n";
    for (bits, words_of, packed_of) in
        [(10, 15, Some(19)), (12, 16, Some(20)), (14, 17, Some(21)), (16, 18, None)]
    {
        for pattern in ["RGGB", "BGGR", "GRBG", "GBRG"] {
            let mosaic = format!("[quantization]\nbits = {bits}\n[bayer_mosaic]\npattern = \"{pattern}\"\n");
            set(engine, &format!("{mosaic}{after}"));
            let frame = taken(engine, &o);
            let light = floats(frame, 5);
            let got = words(&rows(frame, RAW, words_of, 2 * W));
            let off = |pattern: &str, black: i32| {
                let at = |i: usize| light[4 * i + filter(pattern, i % W, i / W)];
                let all = (0..W * H).map(|i| (i32::from(got[i]) - black - converted(at(i), bits)).abs());
                all.max().unwrap()
            };
            assert!(off(pattern, 0) <= 1, "{bits} bits, {pattern}: off by {}", off(pattern, 0));
            // Controls: another pattern, and no black level.
            let other = if pattern == "RGGB" { "GRBG" } else { "RGGB" };
            assert!(off(other, 0) > 1 << (bits - 4), "control: {pattern} is no {other}");
            assert!(off(pattern, 1 << (bits - 4)) > 1 << (bits - 5), "control: black");
            if let Some(packed_of) = packed_of {
                let packed = rows(frame, RAW, packed_of, W * bits as usize / 8);
                let all: Vec<u16> = packed.iter().flat_map(|r| unpacked(r, bits as usize)).collect();
                assert!(all == got, "{bits} bits packed");
            }
            must(shutterbug_frame_destroy(frame), null_mut());
        }
    }
    finish(engine);
}

#[test]
fn a_scenes_frames_have_them_too_by_each_method() {
    let test = "a_scenes_frames_have_them_too_by_each_method";
    for method in 1..=4 {
        let Some(engine) = engine(test, options(method, 1)) else { return };
        must(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine);
        set(engine, "[bayer_mosaic]\npattern = \"GRBG\"\n");
        let mut r: shutterbug_request = sized();
        let submitted = |r: &shutterbug_request| {
            let mut frame = null_mut();
            must(unsafe { shutterbug_engine_submit(engine, r, &mut frame) }, engine);
            frame
        };
        r.time_s = 10.1;
        let plain = submitted(&r);
        r.flags = 2 | 4 | 8;
        let frame = submitted(&r);
        // A frame behind it in flight, which has none of it.
        let behind = submitted(&shutterbug_request { time_s: 10.13, flags: 0, ..r });
        for frame in [plain, frame, behind] {
            must(shutterbug_frame_wait(frame, -1.0), frame);
        }
        let rgb = rgb8(frame);
        assert!(rgb == rgb8(plain), "method {method}: another picture");
        let wide = words(&rows(frame, 1, 13, 6 * W));
        assert!(wide.iter().zip(&rgb).all(|(w, b)| (f64::from(*w) / 257.0 - f64::from(*b)).abs() < 0.503));
        let (light, raw) = (floats(frame, 5), words(&rows(frame, RAW, 18, 2 * W)));
        let off = |pattern: &str| {
            let at = |i: usize| converted(light[4 * i + filter(pattern, i % W, i / W)], 16);
            (0..W * H).map(|i| (i32::from(raw[i]) - at(i)).abs()).max().unwrap()
        };
        assert!(off("GRBG") <= 1, "method {method}: off by {}", off("GRBG"));
        assert!(off("RGGB") > 300, "control: method {method}, another pattern: {}", off("RGGB"));
        let mut to: shutterbug_image = image(PixelFormat::Rgba32f, W, H, &mut []);
        (to.pixels, to.capacity_bytes) = (light.as_ptr().cast_mut().cast(), 16 * (W * H) as u64);
        assert_eq!(unsafe { shutterbug_frame_read(behind, 1, &to) }, status("STATE"));
        for frame in [plain, frame, behind] {
            must(shutterbug_frame_destroy(frame), null_mut());
        }
        finish(engine);
    }
}

#[test]
fn what_cannot_be_had_is_refused() {
    let Some(engine) = engine("what_cannot_be_had_is_refused", options(0, 1)) else { return };
    let small = Small::new(SIZE[0], SIZE[1]);
    let asked = |flags: u32| {
        let mut frame = null_mut();
        let o = shutterbug_outside { flags, ..small.outside };
        let code = unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) };
        assert_eq!(code == OK, !frame.is_null());
        (code, frame)
    };
    set(engine, "");
    assert_eq!(asked(8).0, status("INPUT"));
    assert!(error_of(engine).contains("bayer_mosaic"), "{}", error_of(engine));
    assert_eq!(asked(16).0, status("ARGUMENT"));
    set(engine, "[jpeg]\nquality = 80\n[bayer_mosaic]\npattern = \"RGGB\"\n");
    assert_eq!(asked(4).0, status("UNSUPPORTED"));
    assert!(error_of(engine).contains("jpeg"), "{}", error_of(engine));
    let (code, frame) = asked(8);
    must(code, engine);
    let mut to: shutterbug_image = sized();
    let mut bytes = vec![0u16; 4096];
    (to.width, to.height, to.stride_bytes) = (SIZE[0], SIZE[1], 64);
    (to.format, to.pixels, to.capacity_bytes) = (18, bytes.as_mut_ptr().cast(), 8192);
    let read = |change: &dyn Fn(&mut shutterbug_image)| {
        let mut to = to;
        change(&mut to);
        unsafe { shutterbug_frame_read(frame, if to.format == 13 { 1 } else { RAW }, &to) }
    };
    assert_eq!(read(&|_| ()), status("NOT_READY"));
    must(shutterbug_frame_wait(frame, -1.0), frame);
    assert_eq!(read(&|_| ()), OK, "control");
    let odd = unsafe { to.pixels.cast::<u8>().add(1) }.cast();
    for (what, code, change) in [
        (
            "no stride",
            "TOO_SMALL",
            (&|i: &mut shutterbug_image| i.stride_bytes = 62) as &dyn Fn(&mut shutterbug_image),
        ),
        ("a byte short", "TOO_SMALL", &|i| i.capacity_bytes = 64 * 24 - 1),
        ("an odd stride", "ARGUMENT", &|i| i.stride_bytes = 65),
        ("an odd address", "ARGUMENT", &|i| i.pixels = odd),
        ("no pixels", "ARGUMENT", &|i| i.pixels = null_mut()),
        ("a wide stride", "ARGUMENT", &|i| i.stride_bytes = u64::MAX - 1),
        ("nothing", "ARGUMENT", &|i| i.height = 0),
        ("another size", "ARGUMENT", &|i| i.width = 30),
        ("half a group", "ARGUMENT", &|i| (i.format, i.width) = (19, 30)),
        ("shared memory", "ARGUMENT", &|i| i.memory = made_up(77)),
        ("bottom up", "FORMAT", &|i| i.format |= 0x1_0000),
        ("a picture's format", "FORMAT", &|i| i.format = 1),
        ("none", "FORMAT", &|i| i.format = 22),
        ("16 bits without FINE", "STATE", &|i| i.format = 13),
    ] {
        assert_eq!(read(change), status(code), "{what}: {}", error_of(frame));
        assert!(!error_of(frame).is_empty(), "{what}");
    }
    must(shutterbug_frame_destroy(frame), null_mut());
    finish(engine);
}
