//! What holds for every effect of the list, without a device: names, files, streams, order, neutrality, and that no
//! parameter is without consequence.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::effects_support::{by_id, random_radiance, settings, view, visible};
use shutterbug::chain::{
    Domain, Effect, ParamKind, ParamSpec, Plan, Settings, Stage, Step, Value, Wanted, Work, check_order,
};
use shutterbug::effects::LIST;
use shutterbug::kernels::{POINTWISE, TABLE};
use shutterbug::reference::chain::{picture, values};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn pixel_effects() -> impl Iterator<Item = &'static &'static dyn Effect> {
    LIST.iter().filter(|e| matches!(e.stage(), Stage::Pixel(..)))
}

fn neutral(spec: &ParamSpec) -> Value {
    match spec.kind {
        ParamKind::Number { neutral, .. } | ParamKind::Integer { neutral, .. } => Value::Number(neutral),
        ParamKind::Choice { neutral, .. } => Value::Choice(neutral),
        ParamKind::Vector3 { .. } => Value::Vector3([0.0; 3]),
    }
}

#[test]
fn the_fused_kernel_has_the_lists_effects_in_the_lists_order() {
    let pointwise: Vec<_> =
        LIST.iter().filter(|e| matches!(e.work(), Work::Pointwise(_))).map(|e| e.id()).collect();
    assert_eq!(POINTWISE, pointwise, "glsl/include/effects/list.glsl and effects::LIST");
}

#[test]
fn one_effect_one_stem() {
    for effect in LIST {
        let (stem, text) = (effect.id(), format!("src/effects/{}.rs", effect.id()));
        let rust = fs::read_to_string(root().join(&text)).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert!(rust.starts_with("//! "), "{text} has no module doc");
        match effect.work() {
            Work::Pointwise(_) => {
                let glsl =
                    fs::read_to_string(root().join(format!("glsl/include/effects/{stem}.glsl"))).unwrap();
                assert!(glsl.contains(&format!("vec3 {stem}(vec3 value, uvec2 pixel, uint slot)")), "{stem}");
            }
            Work::Neighbourhood { passes, .. } => {
                for pass in passes(&visible(*effect)) {
                    assert_eq!(pass.file, format!("{stem}.comp"));
                    assert!(TABLE.iter().any(|k| k.file == pass.file));
                }
            }
            Work::Host(_) | Work::Elsewhere => {}
        }
        assert_eq!(
            matches!(effect.work(), Work::Elsewhere),
            !matches!(effect.stage(), Stage::Pixel(..)),
            "{stem}"
        );
        for spec in effect.specs() {
            assert!(!spec.about.is_empty(), "{stem}.{}", spec.name);
        }
    }
}

/// Constants `STREAM_...` of files in a folder.
fn streams(folder: &Path, extension: &str, prefix: &str) -> BTreeMap<String, u32> {
    let mut found = BTreeMap::new();
    let files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    for file in files.iter().filter(|f| f.extension().is_some_and(|e| e == extension)) {
        for line in fs::read_to_string(file).unwrap().lines().filter_map(|l| l.strip_prefix(prefix)) {
            let Some((name, value)) = line.split_once('=') else { continue };
            let name = name.trim().trim_end_matches(": u32").to_owned();
            let digits = value.trim().trim_start_matches("0x").trim_end_matches([';', 'u']).replace('_', "");
            let value = u32::from_str_radix(&digits, 16).unwrap();
            assert!(found.insert(name.clone(), value).is_none(), "{name} is stated twice");
        }
    }
    found
}

#[test]
fn every_purpose_has_a_stream_of_its_own_and_both_languages_agree() {
    let rust = streams(&root().join("src/effects"), "rs", "pub const STREAM_");
    let mut glsl = streams(&root().join("glsl/include/effects"), "glsl", "const uint STREAM_");
    // Drawn on the host only.
    for host in ["ROW_NOISE", "COLUMN_NOISE", "HOT_PIXELS"] {
        glsl.insert(host.to_owned(), rust[host]);
    }
    assert_eq!(rust, glsl);
    assert!(rust.len() >= 10, "{rust:?}");
    let mut numbers: Vec<u32> = rust.values().copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    assert_eq!(numbers.len(), rust.len(), "two purposes share a stream: {rust:?}");
}

/// The list without an effect, and with it at another place.
fn moved(id: &str, before: &str) -> Vec<&'static dyn Effect> {
    let mut list: Vec<&dyn Effect> = LIST.iter().copied().filter(|e| e.id() != id).collect();
    let place = list.iter().position(|e| e.id() == before).map_or(list.len(), |p| p);
    list.insert(place, by_id(id));
    list
}

#[test]
fn domains_go_forward_only() {
    check_order(LIST).unwrap();
    // Noise behind the tone curve, in every flavour; the tone curve before the sensor; lens behind the sensor.
    for (id, before) in [
        ("read_noise", "tone_curve"),
        ("shot_noise", "jpeg"),
        ("row_noise", ""),
        ("fixed_pattern_noise", "sharpening"),
        ("paper_noise", "sharpening"),
        ("gamma", "shot_noise"),
        ("sharpening", "vignetting"),
        ("vignetting", "black_level"),
        ("white_balance", "tone_curve"),
        ("motion_blur", "shot_noise"),
    ] {
        let error = check_order(&moved(id, before)).expect_err(id).to_string();
        assert!(error.contains("acts on"), "{error}");
    }
    let without: Vec<&dyn Effect> = LIST.iter().copied().filter(|e| e.id() != "gamma").collect();
    check_order(&without).expect("the ISP's effects state their own domain");
    let linear: Vec<&dyn Effect> =
        LIST.iter().copied().filter(|e| !matches!(e.stage(), Stage::Pixel(_, Domain::EncodedRgb))).collect();
    assert!(check_order(&linear).is_err(), "nothing encodes");
    // Control: a harmless exchange is none.
    check_order(&moved("glare", "vignetting")).unwrap();
}

#[test]
fn neutral_parameters_change_no_bit() {
    let (view, radiance) = (view(37, 23), random_radiance(37, 23));
    let plain = picture(LIST, &Settings::default(), &view, &radiance);
    let plan = Plan::new(LIST, &Settings::default(), Wanted::PIXELS);
    assert_eq!(plan.steps.len(), 1, "the plain chain is one dispatch");
    for effect in LIST {
        let mut settings = Settings::default();
        settings.enable(*effect);
        assert_eq!(
            Plan::new(LIST, &settings, Wanted::PIXELS),
            plan,
            "{} does something while neutral",
            effect.id()
        );
        assert_eq!(picture(LIST, &settings, &view, &radiance), plain, "{}", effect.id());
    }
    // Control: each that acts on pixels does something when it is not neutral.
    for effect in pixel_effects() {
        assert_ne!(picture(LIST, &visible(*effect), &view, &radiance), plain, "{}", effect.id());
    }
}

#[test]
fn every_parameter_changes_some_pixel() {
    let (view, radiance) = (view(64, 48), random_radiance(64, 48));
    let plain = picture(LIST, &Settings::default(), &view, &radiance);
    for effect in pixel_effects() {
        let all = visible(*effect);
        let seen = picture(LIST, &all, &view, &radiance);
        for spec in effect.specs() {
            let (mut without, mut alone) = (all.clone(), Settings::default());
            without.set(*effect, spec.name, neutral(spec)).unwrap();
            alone.set(*effect, spec.name, all.get(effect.id(), spec.name).unwrap()).unwrap();
            let matters = picture(LIST, &without, &view, &radiance) != seen
                || picture(LIST, &alone, &view, &radiance) != plain;
            assert!(matters, "{}.{} changes nothing", effect.id(), spec.name);
            // What changes nothing alone is said, and no more than that.
            let idle = picture(LIST, &alone, &view, &radiance) == plain;
            let said = effect.warnings(&alone, 0.1).unwrap();
            let names_it = said.iter().any(|s| s.contains(spec.name) && s.contains("changes nothing"));
            assert!(names_it || !idle, "{}.{} alone: {said:?}", effect.id(), spec.name);
            let said = alone.idle(effect.id(), effect.specs());
            assert!(said.is_empty() || idle, "{}.{} alone: {said:?}", effect.id(), spec.name);
            assert!(all.idle(effect.id(), effect.specs()).is_empty(), "control: {}", effect.id());
        }
    }
}

#[test]
fn what_a_parameter_counts_beside_is_one_of_its_effects() {
    for effect in LIST {
        let known = |name: &&str| effect.specs().iter().any(|s| s.name == *name);
        for spec in effect.specs() {
            assert!(spec.beside.iter().all(known) && !spec.beside.contains(&spec.name), "{spec:?}");
        }
    }
}

#[test]
fn what_stands_between_resamplings_is_one_dispatch() {
    let count = |of: &[(&str, &str, f64)]| Plan::new(LIST, &settings(of), Wanted::PIXELS).steps.len();
    let pointwise: Vec<_> = [
        ("vignetting", "a1", -0.1),
        ("glare", "veil", 0.1),
        ("flicker", "depth", 0.1),
        ("shot_noise", "full_well_e", 1e4),
        ("read_noise", "sigma", 0.01),
        ("black_level", "offset", 0.01),
        ("gamma", "exponent", 1.1),
    ]
    .to_vec();
    assert_eq!(count(&pointwise), 1);
    let mut with_edges = pointwise.clone();
    with_edges.push(("paper_noise", "edge_variance_r", 0.01));
    assert_eq!(count(&with_edges), 2, "the gradient is that of the picture before the noise");
    let mut with_lens = pointwise.clone();
    with_lens.push(("defocus", "sigma_px", 1.0));
    assert_eq!(count(&with_lens), 2, "the second pass of the lens runs the fused effects behind it");
    let last = Plan::new(LIST, &settings(&with_lens), Wanted::PIXELS).steps.pop().unwrap();
    let Step::Neighbourhood { id: "defocus", tail, last: true, .. } = last else { panic!("{last:?}") };
    assert_eq!(tail.iter().filter(|v| **v != 0).count(), pointwise.len());
    let mut looking = with_edges.clone();
    looking.push(("defocus", "sigma_px", 1.0));
    assert_eq!(count(&looking), 3, "the noise looks at what the lens and the effects behind it made");
    let last = Plan::new(LIST, &settings(&looking), Wanted::PIXELS).steps.pop().unwrap();
    assert!(matches!(last, Step::Pointwise { last: true, .. }), "{last:?}");
}

/// The chain without further effects is `develop`, which was written on its own.
#[test]
fn the_plain_chain_is_develop() {
    use shutterbug::effects::PaperNoise;
    use shutterbug::reference::develop::{Push, develop};
    let (view, radiance) = (view(61, 33), random_radiance(61, 33));
    let mut noisy = Settings::default();
    for spec in PaperNoise.specs() {
        noisy.set(&PaperNoise, spec.name, Value::Number(2e-3)).unwrap();
    }
    for settings in [Settings::default(), noisy] {
        let sigma = PaperNoise::sigma(&settings);
        let push = Push {
            size: [61, 33],
            seed: shutterbug::chain::rng::seed_words(view.seed),
            frame: view.frame,
            static_sigma: sigma.static_sigma,
            color_sigma: sigma.color_sigma,
            edge_sigma: sigma.edge_sigma,
            ..Push::default()
        };
        let want: Vec<u8> = develop(&push, &radiance).data.chunks(4).flat_map(|p| p[..3].to_vec()).collect();
        assert_eq!(picture(LIST, &settings, &view, &radiance).data, want);
        // Control: another frame has other noise, if it has any.
        let other = picture(LIST, &settings, &shutterbug::chain::View { frame: 4, ..view }, &radiance);
        assert_eq!(other.data == want, sigma.parts() == 0);
    }
    assert_eq!(values(LIST, &Settings::default(), &view, &radiance).channels, 4);
}
