//! Every parser on files that were spoiled at random: an answer or an error of one line, never a panic. `SHUTTERBUG_FUZZ=N` tries
//! N of each (seconds in a test, hours when left alone); what is tried depends on the number alone, so a finding comes back.

use std::panic::{AssertUnwindSafe, catch_unwind};

use shutterbug::camera::Trajectory;
use shutterbug::capture::{CameraFile, parse_frames, parse_lights};
use shutterbug::error::one_line;
use shutterbug::plane::{decode_picture, read_exr};
use shutterbug::scene::load_obj;
use shutterbug_cli::formats::parse_camera;
use shutterbug_diagnose::diagnose::Report;

use super::*;

/// Tried of each parser where nobody asks for more.
const USUAL: u64 = 400;

/// A generator with a fixed start (SplitMix64).
struct Dice(u64);

impl Dice {
    fn roll(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below.max(1) as u64) as usize
    }
}

/// What is put in: ends of ranges, quotes, brackets, escapes, marks.
const PIECES: [&[u8]; 20] = [
    b"-1",
    b"1e400",
    b"nan",
    b"inf",
    b"18446744073709551616",
    b"0x",
    b"\"",
    b"[[",
    b"]]",
    b"{",
    b"\n",
    b"\r",
    b"\0",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"#",
    b"\\",
    b"../",
    b"  ",
];

fn spoiled(whole: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..1 + dice.roll(6) {
        let at = dice.roll(bytes.len() + 1);
        let end = (at + dice.roll(24)).min(bytes.len());
        match dice.roll(6) {
            0 => drop(bytes.drain(at..end)),
            1 => drop(bytes.splice(at..at, PIECES[dice.roll(PIECES.len())].iter().copied())),
            2 => drop(bytes.splice(at..end, PIECES[dice.roll(PIECES.len())].iter().copied())),
            3 => bytes.truncate(at),
            4 => {
                let again = bytes[at..end].repeat(1 + dice.roll(30));
                drop(bytes.splice(at..at, again));
            }
            _ => bytes.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << dice.roll(8)),
        }
    }
    bytes
}

type Parser<'a> = (&'a str, Vec<u8>, Box<dyn Fn(&[u8]) -> Result<(), String> + 'a>);

fn text<T>(parse: impl Fn(&str) -> shutterbug::Result<T>) -> impl Fn(&[u8]) -> Result<(), String> {
    move |bytes| parse(&String::from_utf8_lossy(bytes)).map(drop).map_err(|e| e.to_string())
}

fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let picture =
        image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([x as u8 * 9, y as u8 * 13, (x * y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn parsers(folder: &Path) -> Vec<Parser<'_>> {
    let path = Path::new("input");
    let at = |name: &'static str| folder.join(name);
    let lights = "[[light]]\nposition = [0, 0, 1]\ncolor = [1, 1, 1]\nattenuation = [1, 0, 0.5]\n";
    let effects = format!("{CAMERA}[rolling_shutter]\nreadout_time_s = 0.02\n[lens_distortion]\nk1 = -0.1\n");
    let ros = "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [50.0, 0.0, 31.5, 0.0, 50.0, \
               23.5, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  data: [0.1, 0, 0, 0, 0]\n";
    let poses = "10 0 0 0 0 0 0 1\n10.5 1 0 0 0 0 0 1\n11 2 0 0 0.5 -0.5 0.5 -0.5\n";
    let obj = move |bytes: &[u8]| {
        fs::write(at("colours.mtl"), MATERIALS).unwrap();
        fs::write(at("scene.obj"), bytes).unwrap();
        load_obj(&at("scene.obj"), folder).map(drop).map_err(|e| e.to_string())
    };
    let mtl = move |bytes: &[u8]| {
        fs::write(at("colours.mtl"), bytes).unwrap();
        fs::write(at("scene.obj"), SCENE).unwrap();
        load_obj(&at("scene.obj"), folder).map(drop).map_err(|e| e.to_string())
    };
    let exr = folder.join("whole.exr");
    shutterbug::plane::write_exr_atomic(&exr, 5, 4, &[("Z", &[1.5; 20]), ("A", &[0.5; 20])]).unwrap();
    let exr_bytes = fs::read(&exr).unwrap();
    let read_exr = move |bytes: &[u8]| {
        fs::write(&exr, bytes).unwrap();
        read_exr(&exr).map(drop).map_err(|e| e.to_string())
    };
    let picture = move |bytes: &[u8]| decode_picture(path, bytes).map(drop).map_err(|e| e.to_string());
    vec![
        ("camera.toml", effects.into(), Box::new(text(move |t| CameraFile::parse(path, t)))),
        ("lights.toml", lights.into(), Box::new(text(move |t| parse_lights(path, t)))),
        ("frames.csv", frames_csv(4).into(), Box::new(text(move |t| parse_frames(path, t)))),
        ("trajectory.tum", poses.into(), Box::new(text(move |t| Trajectory::parse(path, t, 0)))),
        ("ROS", ros.into(), Box::new(text(move |t| parse_camera(path, t, None, None)))),
        (
            "report.json",
            b"{\"verdict\":\"no_gap\",\"gap\":{\"unit\":\"DN\"}}".to_vec(),
            Box::new(text(move |t| Report::from_json(path, t))),
        ),
        ("scene.obj", SCENE.into(), Box::new(obj)),
        ("colours.mtl", MATERIALS.into(), Box::new(mtl)),
        ("PNG", encoded(image::ImageFormat::Png), Box::new(picture)),
        ("JPEG", encoded(image::ImageFormat::Jpeg), Box::new(picture)),
        ("EXR", exr_bytes, Box::new(read_exr)),
    ]
}

#[test]
fn parsers_answer_spoiled_files_and_never_panic() {
    let count = std::env::var("SHUTTERBUG_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(USUAL);
    let folder = tempfile::tempdir().unwrap();
    for (name, whole, parse) in parsers(folder.path()) {
        let (mut accepted, mut refused) = (0, 0);
        for number in 0..count {
            let bytes = spoiled(&whole, &mut Dice(number.wrapping_mul(0x1_0001)));
            match catch_unwind(AssertUnwindSafe(|| parse(&bytes))) {
                Ok(Ok(())) => accepted += 1,
                Ok(Err(error)) => {
                    refused += 1;
                    assert!(!one_line(&error).contains(['\n', '\u{1b}']), "{name} {number}: {error:?}");
                }
                Err(_) => panic!("{name}, number {number}: {}", String::from_utf8_lossy(&bytes)),
            }
        }
        // Control: the spoiling does spoil, and the whole file of most is one that is read.
        assert!(refused > 0 && accepted + refused == count, "{name}: {accepted} accepted, {refused} refused");
        if name != "report.json" {
            parse(&whole).unwrap_or_else(|e| panic!("{name}: {e}"));
        }
    }
}

/// What a run that goes on reads of an earlier one: any manifest or simulate.json is refused or gone on with.
#[test]
fn a_spoiled_state_is_refused_or_gone_on_with() {
    if !device_is_there("a_spoiled_state_is_refused_or_gone_on_with") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    let frame = fs::read(out.join("000000.png")).unwrap();
    for name in ["manifest.jsonl", "simulate.json"] {
        let whole = fs::read(out.join(name)).unwrap();
        for number in 0..12 {
            fs::write(out.join(name), spoiled(&whole, &mut Dice(number))).unwrap();
            let output = capture.simulate(&out, &["--resume"]);
            let code = output.status.code();
            assert!(matches!(code, Some(0 | 1)), "{name} {number}: {}", said(&output));
            assert!(!said(&output).contains("panicked"), "{name} {number}: {}", said(&output));
            assert_eq!(fs::read(out.join("000000.png")).unwrap(), frame, "{name} {number}");
            // As it was before the next.
            fs::remove_dir_all(&out).unwrap();
            assert_done(&capture.simulate(&out, &[]));
        }
    }
}
