//! One small picture an effect, `tests/golden/<stem>.png`, by the CPU chain and on the device. A change of the pictures
//! is a decision: `SHUTTERBUG_BLESS=1 cargo test --release --test golden effects::` writes those that are missing or
//! differ; look at them, then commit.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use crate::effects_support::{view, visible};
use crate::gpu_support::device;
use shutterbug::chain::{Effect, Settings, Stage, View};
use shutterbug::effects::LIST;
use shutterbug::engine::PixelChain;
use shutterbug::plane::{Plane, read_rgb8, write_png_atomic};
use shutterbug::reference::chain::picture;

const WIDTH: usize = 32;
const HEIGHT: usize = 24;
/// All of them together, bytes.
const ROOM: u64 = 64 * 1024;

fn golden(stem: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{stem}.png"))
}

fn blessing() -> bool {
    std::env::var_os("SHUTTERBUG_BLESS").is_some_and(|v| v == "1")
}

/// Slopes of light and colour, a bright disc, dark bars: something for every effect to act on.
fn scene() -> Plane<f32> {
    Plane::from_fn(WIDTH, HEIGHT, |x, y| {
        let (u, v) = (x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32);
        let disc = (u - 0.7).hypot(0.75 * (v - 0.35)) < 0.13;
        let bar = v > 0.66 && (x / 3) % 2 == 0;
        match (disc, bar) {
            (true, _) => [1.1, 0.9, 0.3, 1.0],
            (_, true) => [0.02, 0.03, 0.05, 1.0],
            _ => [0.1 + 0.5 * u, 0.2 + 0.4 * v, 0.5 - 0.3 * u, 1.0],
        }
    })
}

fn golden_view() -> View {
    view(WIDTH as u32, HEIGHT as u32)
}

/// Effects with a picture, and the plain chain.
fn kinds() -> Vec<(&'static str, Settings)> {
    let of_pixels = |e: &&&dyn Effect| matches!(e.stage(), Stage::Pixel(..));
    let mut kinds = vec![("plain", Settings::default())];
    kinds.extend(LIST.iter().filter(of_pixels).map(|e| (e.id(), visible(*e))));
    kinds
}

/// Share of values that differ, and by how many levels at most. Powers are rounded in each library's own way, which can
/// move a value by one level where it lies between two; noise that is rounded to electrons, by a few.
fn differs(a: &Plane<u8>, b: &Plane<u8>) -> (f64, u8) {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    let off: Vec<u8> = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).filter(|d| *d > 0).collect();
    (off.len() as f64 / a.data.len() as f64, off.into_iter().max().unwrap_or(0))
}

fn agrees(stem: &str, (share, most): (f64, u8)) -> bool {
    // A JPEG spreads one level over its block.
    let (share_allowed, most_allowed) = if stem == "jpeg" { (0.2, 4) } else { (0.01, 2) };
    share <= share_allowed && most <= most_allowed
}

/// Whether its picture is there and agrees. A blessing leaves it then: another machine's rounding is no decision.
fn stands(stem: &str, got: &Plane<u8>) -> bool {
    let same_size = |p: &Plane<u8>| (p.width, p.height) == (got.width, got.height);
    read_rgb8(&golden(stem)).is_ok_and(|old| same_size(&old) && agrees(stem, differs(got, &old)))
}

fn check(stem: &str, got: &Plane<u8>) {
    let path = golden(stem);
    assert!(path.is_file(), "no tests/golden/{stem}.png: run with SHUTTERBUG_BLESS=1, look at it, commit it");
    let want = read_rgb8(&path).unwrap();
    let difference = differs(got, &want);
    if !agrees(stem, difference) {
        let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{stem}.got.png"));
        write_png_atomic(&out, got).unwrap();
        panic!(
            "{stem} differs from its golden picture: {difference:?} (share, levels); see {}",
            out.display()
        );
    }
}

#[test]
fn the_reference_gives_the_golden_pictures() {
    let kinds = kinds();
    for (stem, settings) in &kinds {
        let got = picture(LIST, settings, &golden_view(), &scene());
        if blessing() && !stands(stem, &got) {
            write_png_atomic(&golden(stem), &got).unwrap();
        }
        check(stem, &got);
        let plain = read_rgb8(&golden("plain")).unwrap();
        assert!(
            *stem == "plain" || !agrees(stem, differs(&got, &plain)),
            "control: {stem} looks like the plain picture"
        );
    }
    let (mut there, mut bytes) = (BTreeSet::new(), 0);
    for entry in fs::read_dir(golden("plain").parent().unwrap()).unwrap() {
        let entry = entry.unwrap();
        if entry.path().extension().is_some_and(|e| e == "rs") {
            continue;
        }
        bytes += entry.metadata().unwrap().len();
        there.insert(entry.path().file_stem().unwrap().to_str().unwrap().to_owned());
    }
    // Those of the render are made by `frames`.
    let rendered = LIST.iter().filter(|e| matches!(e.stage(), Stage::Geometry | Stage::Time)).map(|e| e.id());
    let wanted: BTreeSet<String> =
        kinds.iter().map(|(stem, _)| *stem).chain(rendered).map(str::to_owned).collect();
    assert_eq!(there, wanted, "pictures without an effect, or the reverse");
    assert!(bytes <= ROOM, "the golden pictures have {bytes} bytes");
}

#[test]
fn the_device_gives_the_golden_pictures() {
    let Some(context) = device("the_device_gives_the_golden_pictures") else { return };
    let mut chain = PixelChain::new(&context.0, [WIDTH as u32, HEIGHT as u32]).unwrap();
    chain.load(&scene()).unwrap();
    for (stem, settings) in kinds() {
        check(stem, &chain.picture(&settings, &golden_view()).unwrap());
    }
}
