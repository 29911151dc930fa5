//! Every effect's kernel against its reference, on random radiance and odd sizes, one by one and all together.
#![allow(clippy::unwrap_used)]

use crate::effects_support::{random_radiance, view, visible};
use crate::gpu_support::device;
use crate::long_support::some_of;
use shutterbug::camera::ScanOrder;
use shutterbug::chain::{Settings, Stage, Value, View};
use shutterbug::effects::LIST;
use shutterbug::engine::PixelChain;
use shutterbug::plane::Plane;
use shutterbug::reference::chain::{picture, raw, values};

const SIZES: [[u32; 2]; 4] = [[1, 1], [3, 2], [67, 41], [130, 97]];

/// Encoded values are of a power that devices round in their own way: 8 units of 2^-24 relative, times what sharpening
/// and matrices make of it.
const ROUNDING: f32 = 4e-6;
/// Where a value is rounded to a whole (electrons, steps), a rounding error before it can be a whole step after it: so
/// many values in a million may be further off.
const FLIPS: f64 = 500.0;

/// Values further off than rounding, in a million, and the largest difference.
fn off(a: &Plane<f32>, b: &Plane<f32>) -> (f64, f32) {
    let differences = a.data.iter().zip(&b.data).map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() });
    let (mut count, mut most) = (0, 0.0_f32);
    for d in differences {
        // NaN counts.
        count += usize::from(!(d <= ROUNDING));
        most = if d <= most { most } else { d };
    }
    (1e6 * count as f64 / a.data.len() as f64, most)
}

fn compare(chain: &mut PixelChain, name: &str, settings: &Settings, view: &View, radiance: &Plane<f32>) {
    let got = chain.values(settings, view).unwrap();
    let want = values(LIST, settings, view, radiance);
    let (flips, most) = off(&got, &want);
    eprintln!(
        "{name} {}x{}: {flips:.0} in a million beyond rounding, largest {most:.2e}",
        got.width, got.height
    );
    assert!(flips <= FLIPS, "{name}: {flips} in a million beyond rounding, largest {most}");
    let (got, want) = (chain.picture(settings, view).unwrap(), picture(LIST, settings, view, radiance));
    let levels = got.data.iter().zip(&want.data).filter(|(a, b)| a != b).count();
    // A JPEG makes one level into several.
    let allowed = if settings.has("jpeg") { 0.2 } else { 2e-3 };
    assert!(levels as f64 <= allowed * got.data.len() as f64 + 1.0, "{name}: {levels} values differ");
}

fn everything() -> Settings {
    let mut all = Settings::default();
    for effect in LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..))) {
        let own = visible(*effect);
        for spec in effect.specs() {
            all.set(*effect, spec.name, own.get(effect.id(), spec.name).unwrap()).unwrap();
        }
    }
    all
}

#[test]
fn every_kernel_is_its_reference() {
    let test = "every_kernel_is_its_reference";
    let Some(context) = device(test) else { return };
    for [width, height] in some_of(test, 2, SIZES) {
        let (mut view, radiance) = (view(width, height), random_radiance(width as usize, height as usize));
        view.shutter.scan_order = if width == 67 { ScanOrder::RightToLeft } else { ScanOrder::BottomToTop };
        let (w, h) = (width, height);
        view.shutter.line_count = view.shutter.scan_order.line_count(w, h);
        let mut chain = PixelChain::new(&context.0, [width, height]).unwrap();
        chain.load(&radiance).unwrap();
        compare(&mut chain, "none", &Settings::default(), &view, &radiance);
        for effect in LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..))) {
            compare(&mut chain, effect.id(), &visible(*effect), &view, &radiance);
            // Parts of an effect are kernels of their own, compiled for each size: one size is enough for them, and a
            // single parameter is no part.
            let parts =
                if [width, height] == [67, 41] && effect.specs().len() > 1 { effect.specs() } else { &[] };
            for spec in parts {
                let mut alone = Settings::default();
                alone.set(*effect, spec.name, visible(*effect).get(effect.id(), spec.name).unwrap()).unwrap();
                let name = format!("{}.{}", effect.id(), spec.name);
                compare(&mut chain, &name, &alone, &view, &radiance);
            }
        }
        // Wider than what is unrolled.
        let wide =
            [("defocus", "sigma_px", 4.0), ("sharpening", "amount", 1.0), ("sharpening", "radius_px", 5.0)];
        compare(&mut chain, "wide", &crate::effects_support::settings(&wide), &view, &radiance);
        compare(&mut chain, "all", &everything(), &view, &radiance);
    }
}

/// Control: the comparison sees a reference that is wrong by little.
#[test]
fn a_wrong_reference_is_seen() {
    let Some(context) = device("a_wrong_reference_is_seen") else { return };
    let (view, radiance) = (view(67, 41), random_radiance(67, 41));
    let mut chain = PixelChain::new(&context.0, [67, 41]).unwrap();
    chain.load(&radiance).unwrap();
    for effect in LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..))) {
        let settings = visible(*effect);
        let got = chain.values(&settings, &view).unwrap();
        let mut brighter = radiance.clone();
        brighter.data.iter_mut().for_each(|v| *v *= 1.001);
        let (flips, _) = off(&got, &values(LIST, &settings, &view, &brighter));
        assert!(flips > 10.0 * FLIPS, "{}: a brighter picture is taken for the same ({flips})", effect.id());
    }
    for (what, other) in [("frame", View { frame: 4, ..view }), ("seed", View { seed: 7, ..view })] {
        let (a, b) =
            (chain.values(&everything(), &view).unwrap(), chain.values(&everything(), &other).unwrap());
        assert!(off(&a, &b).0 > 10.0 * FLIPS, "{what} changes nothing");
    }
}

/// Pipelines and pictures are made once a plan: the second round of the same settings gives the same pixels.
#[test]
fn settings_may_alternate() {
    let Some(context) = device("settings_may_alternate") else { return };
    let (view, radiance) = (view(67, 41), random_radiance(67, 41));
    let mut chain = PixelChain::new(&context.0, [67, 41]).unwrap();
    chain.load(&radiance).unwrap();
    let kinds = [Settings::default(), everything(), visible(crate::effects_support::by_id("defocus"))];
    let first: Vec<_> = kinds.iter().map(|s| chain.picture(s, &view).unwrap()).collect();
    let second: Vec<_> = kinds.iter().map(|s| chain.picture(s, &view).unwrap()).collect();
    assert_eq!(first, second);
    assert!(first[0] != first[1] && first[1] != first[2], "control");
}

/// Values and raw numbers that are kept on the way: those of the same chain, and the picture is none other for it.
#[test]
fn what_is_kept_on_the_way_changes_no_bit_and_is_its_reference() {
    let Some(context) = device("what_is_kept_on_the_way_changes_no_bit_and_is_its_reference") else { return };
    let (view, radiance) = (view(67, 41), random_radiance(67, 41));
    let mut chain = PixelChain::new(&context.0, [67, 41]).unwrap();
    chain.load(&radiance).unwrap();
    let by_id = crate::effects_support::by_id;
    let mut mosaic = Settings::default();
    mosaic.set(by_id("bayer_mosaic"), "pattern", Value::Choice("GBRG")).unwrap();
    let effects = LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..)));
    let mut kinds: Vec<_> = [("all", everything()), ("none", Settings::default())]
        .into_iter()
        .chain(effects.map(|effect| (effect.id(), visible(*effect))))
        .collect();
    let test = "what_is_kept_on_the_way";
    for (name, settings) in some_of(test, 2, &mut kinds) {
        if *name != "bayer_mosaic" {
            settings.set(by_id("bayer_mosaic"), "pattern", Value::Choice("GBRG")).unwrap();
        }
        let (picture, [kept, numbers]) = chain.finer(settings, &view).unwrap();
        let (kept, numbers) = (kept.unwrap(), numbers.unwrap());
        assert!(kept == chain.values(settings, &view).unwrap(), "{name}: other values");
        if !settings.has("jpeg") {
            assert!(picture == chain.picture(settings, &view).unwrap(), "{name}: another picture");
        }
        let want = raw(LIST, settings, &view, &radiance).unwrap();
        let (flips, most) = off(&numbers, &want);
        assert!(flips <= FLIPS, "{name}: {flips} raw numbers in a million beyond rounding, by {most}");
        // Controls: the filters of another pattern, and the numbers of another frame where there is noise.
        settings.set(by_id("bayer_mosaic"), "pattern", Value::Choice("BGGR")).unwrap();
        let other = raw(LIST, settings, &view, &radiance).unwrap();
        assert!(off(&numbers, &other).0 > 10.0 * FLIPS, "{name}: the pattern changes nothing");
    }
    // What is done to the converter's numbers is not in them.
    let numbers =
        |settings: &Settings, chain: &mut PixelChain| chain.finer(settings, &view).unwrap().1[1].clone();
    let bare = numbers(&mosaic, &mut chain).unwrap();
    for (id, inside) in
        [("white_balance", false), ("gamma", false), ("sharpening", false), ("black_level", true)]
    {
        let mut with = visible(by_id(id));
        with.set(by_id("bayer_mosaic"), "pattern", Value::Choice("GBRG")).unwrap();
        assert_eq!(numbers(&with, &mut chain).unwrap() != bare, inside, "{id}");
    }
    assert!(chain.finer(&Settings::default(), &view).unwrap().1[1].is_none(), "no mosaic, nothing raw");
}
