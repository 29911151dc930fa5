//! `shutterbug presets`.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::args::{Presets, PresetsAction};
use super::terminal::print;
use crate::formats::{PRESETS, Preset, Profile, Profiles, preset};
use shutterbug::effects::{MotionBlur, RollingShutter};
use shutterbug::error::{Result, counted, one_line};

/// Where the name is given.
const ARGUMENT: &str = "<NAME>";
/// Names a folder of lens profiles.
const FOLDER: &str = "SHUTTERBUG_PROFILES";

/// Lists presets, searches them, or prints one.
pub fn run(args: &Presets) -> Result<()> {
    match (&args.action, &args.name) {
        (Some(PresetsAction::Show { name, profiles }), _) => {
            print(&find_preset(name, profiles.as_deref(), ARGUMENT)?.toml)
        }
        (Some(PresetsAction::Search { words, profiles }), _) => search(words, profiles.as_deref()),
        (None, Some(name)) => print(&find_preset(name, None, ARGUMENT)?.toml),
        (None, None) => list(),
    }
}

/// The preset of that name: one that ships, or one of the folder of lens profiles that is named. `option` is where the
/// name was given.
pub fn find_preset(name: &str, folder: Option<&Path>, option: &str) -> Result<Preset> {
    // Those that ship need no folder, not even one that is wrong.
    if PRESETS.iter().any(|p| p.name == name) {
        return preset(name, None, option);
    }
    preset(name, read(folder)?.as_ref(), option)
}

/// The profiles of the folder, or of the one that the environment names.
fn read(folder: Option<&Path>) -> Result<Option<Profiles>> {
    let named = std::env::var_os(FOLDER).filter(|f| !f.is_empty()).map(PathBuf::from);
    folder.map(Path::to_owned).or(named).map(|f| Profiles::read(&f)).transpose()
}

fn list() -> Result<()> {
    let mut text: String = PRESETS.iter().map(describe).collect::<Result<_>>()?;
    text += "\nshutterbug presets NAME prints one with the source of every number.\n";
    text += "shutterbug presets search WORDS --profiles DIR finds cameras among lens profiles.\n";
    text += "shutterbug simulate CAPTURE --preset NAME adds its effects to a capture's camera.\n";
    print(&text)
}

fn search(words: &[String], folder: Option<&Path>) -> Result<()> {
    let profiles = read(folder)?;
    let mut text = String::new();
    for shipped in PRESETS {
        let all = format!("{} {}", shipped.name, shipped.about()).to_lowercase();
        if words.iter().all(|w| all.contains(&w.to_lowercase())) {
            text += &describe(shipped)?;
        }
    }
    let found = profiles.as_ref().map(|p| p.search(words)).unwrap_or_default();
    let lines: Vec<_> = found.par_iter().map(|p| line(p)).collect();
    text.extend(lines);
    match &profiles {
        Some(profiles) if !profiles.refused.is_empty() => {
            let what = counted(
                profiles.refused.len(),
                "entry is no usable profile",
                "entries are no usable profiles",
            );
            tracing::warn!("{what}, such as: {}", profiles.refused[0]);
        }
        Some(_) => {}
        None => tracing::warn!(
            "only what ships was searched: --profiles DIR or {FOLDER} names a folder of lens profiles"
        ),
    }
    if text.is_empty() {
        text = "no preset has all of these words\n".to_owned();
    }
    print(&text)
}

/// A profile: its name, what it is, and whether a pinhole's picture can show it.
fn line(profile: &Profile) -> String {
    let usable = match profile.check() {
        Ok(()) => String::new(),
        Err(_) => "; sees 90 degrees or folds: not usable".to_owned(),
    };
    // Its words are a stranger's.
    let about = one_line(&format!("{}: {}{usable}", profile.title(), profile.describe()));
    format!("{}\n    {about}\n", profile.name)
}

fn describe(preset: &Preset) -> Result<String> {
    let camera = preset.camera()?;
    let k = &camera.intrinsics;
    let fov_deg = 2.0 * (0.5 * f64::from(k.width) / k.fx).atan().to_degrees();
    let shutter = match RollingShutter::readout_time_s(&camera.settings) {
        0.0 => "global shutter".to_owned(),
        readout_s => format!("rolling shutter {:.1} ms", readout_s * 1e3),
    };
    let exposure_ms = MotionBlur::exposure_time_s(&camera.settings) * 1e3;
    Ok(format!(
        "{:<16} {}\n\
         {:16} {}x{}, {:.0} frames a second, {fov_deg:.0} degrees across, {shutter}, exposure {exposure_ms:.1} ms\n",
        preset.name,
        preset.about(),
        "",
        k.width,
        k.height,
        1.0 / camera.frame_period_s,
    ))
}
