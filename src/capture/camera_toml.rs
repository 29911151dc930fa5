//! `camera.toml`: the pinhole, and one table per modelled effect. Effects and their parameters come from
//! [`effects::LIST`], so a new effect needs nothing here.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use super::effect_tables::{KEYS, choose, read_effects};
use super::text::{Entry, TomlText, read_text};
use crate::camera::{Intrinsics, ShutterTiming};
use crate::chain::{ParamKind, Settings, Value};
use crate::effects::{self, MotionBlur, RollingShutter, TimeOffset};
use crate::error::{Error, Result};
use crate::files::Limit;
use crate::plane::MAX_SIDE_PX;

/// What `camera.toml` says.
#[derive(Clone, Debug)]
pub struct CameraFile {
    /// The file.
    pub path: PathBuf,
    /// Size and pinhole.
    pub intrinsics: Intrinsics,
    /// Time from one frame to the next, s.
    pub frame_period_s: f64,
    /// Pixels that no geometry covers are left out of every comparison (else they are black).
    pub background_ignored: bool,
    /// The camera rests during each frame: poses are looked up, never differenced.
    pub static_camera: bool,
    /// Whether the scene is lit by `lights.toml` (else `kd` is radiance).
    pub lit: bool,
    /// Whether pictures of the simulator beside the file hold linear radiance (else sRGB).
    pub linear: bool,
    /// The modelled effects.
    pub settings: Settings,
    /// What is allowed but worth saying: "readout longer than the frame period".
    pub warnings: Vec<String>,
}

/// Focal lengths outside this are no camera's, px; inside it every ray stays finite in an `f32`.
const FOCAL_RANGE_PX: (f64, f64) = (1e-3, 1e7);
/// Furthest principal point from the picture's corner, px: crops may have theirs outside.
const MAX_CENTRE_PX: f64 = 1e6;
/// Longest frame period, s: one frame a day, for time lapse.
const MAX_FRAME_PERIOD_S: f64 = 86_400.0;

impl CameraFile {
    /// Reads the file and emits its warnings.
    ///
    /// # Errors
    /// A missing file, and those of [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self> {
        let text =
            read_text(path, "the camera: its size, pinhole, frame period and effects", Limit::SETTINGS)?;
        let camera = Self::parse(path, &text)?;
        for warning in &camera.warnings {
            tracing::warn!("{}: {warning}", path.display());
        }
        Ok(camera)
    }

    /// A camera without effects.
    pub fn pinhole(path: PathBuf, intrinsics: Intrinsics, frame_period_s: f64) -> Self {
        Self {
            path,
            intrinsics,
            frame_period_s,
            background_ignored: false,
            static_camera: false,
            lit: false,
            linear: false,
            settings: Settings::default(),
            warnings: Vec::new(),
        }
    }

    /// When each line of the frame of a timestamp (s) is exposed.
    pub fn shutter_at(&self, timestamp_s: f64) -> ShutterTiming {
        let scan_order = RollingShutter::scan_order(&self.settings);
        ShutterTiming {
            start_s: timestamp_s + TimeOffset::offset_s(&self.settings),
            exposure_time_s: MotionBlur::exposure_time_s(&self.settings),
            readout_time_s: RollingShutter::readout_time_s(&self.settings),
            scan_order,
            line_count: scan_order.line_count(self.intrinsics.width, self.intrinsics.height),
        }
    }

    /// Reads the file's text; `path` is what errors name.
    ///
    /// # Errors
    /// An unknown key, effect or parameter (with the nearest known one), a missing key, a value of the wrong type or
    /// outside its range; with file and line.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let toml = TomlText::new(path, text);
        let table = toml.parse()?;
        // Unknown names first: a missing `width` is then not reported in place of a `widht`.
        check_names(&toml, &table)?;
        let keys = Keys { toml: &toml, table: &table };
        let intrinsics = Intrinsics {
            width: keys.side_px("width")?,
            height: keys.side_px("height")?,
            fx: keys.number_in("fx", "px", FOCAL_RANGE_PX)?,
            fy: keys.number_in("fy", "px", FOCAL_RANGE_PX)?,
            cx: keys.number_in("cx", "px", (-MAX_CENTRE_PX, MAX_CENTRE_PX))?,
            cy: keys.number_in("cy", "px", (-MAX_CENTRE_PX, MAX_CENTRE_PX))?,
        };
        let frame_period_s = keys.frame_period_s()?;
        let (settings, mut warnings) = read_effects(&toml, &table, frame_period_s)?;
        warnings.extend(intrinsics.doubts());
        Ok(Self {
            path: path.to_owned(),
            intrinsics,
            frame_period_s,
            background_ignored: keys.choice("background", ["black", "ignore"])?,
            static_camera: keys.flag("static")?,
            lit: keys.choice("shading", ["unlit", "lit"])?,
            linear: keys.flag("linear")?,
            settings,
            warnings,
        })
    }

    /// The text of a `camera.toml` that says the same: reading it back gives every value bit for bit. Effects stand in
    /// light-path order, with all their parameters.
    pub fn to_toml(&self) -> String {
        let k = &self.intrinsics;
        let mut text = format!("width = {}\nheight = {}\n", k.width, k.height);
        let period = ("frame_period_s", self.frame_period_s);
        for (name, value) in [("fx", k.fx), ("fy", k.fy), ("cx", k.cx), ("cy", k.cy), period] {
            line(&mut text, name, &Value::Number(value));
        }
        let stated = [
            (self.background_ignored, "background = \"ignore\"\n"),
            (self.static_camera, "static = true\n"),
            (self.lit, "shading = \"lit\"\n"),
            (self.linear, "linear = true\n"),
        ];
        text.extend(stated.into_iter().filter(|(on, _)| *on).map(|(_, line)| line));
        for effect in effects::LIST.iter().filter(|e| self.settings.has(e.id())) {
            text += &format!("\n[{}]\n", effect.id());
            for spec in effect.specs() {
                match (spec.kind, self.settings.get(effect.id(), spec.name)) {
                    (ParamKind::Integer { .. }, Some(Value::Number(n))) => {
                        writeln!(text, "{} = {n:.0}", spec.name).expect("writing to a String cannot fail");
                    }
                    (_, Some(value)) => line(&mut text, spec.name, &value),
                    (_, None) => {}
                }
            }
        }
        text
    }
}

/// Appends `name = value`. `{:?}` of an `f64` is the shortest text that reads back as the same bits, and valid TOML.
fn line(text: &mut String, name: &str, value: &Value) {
    let written = match value {
        Value::Number(n) => writeln!(text, "{name} = {n:?}"),
        Value::Choice(c) => writeln!(text, "{name} = {c:?}"),
        Value::Vector3([x, y, z]) => writeln!(text, "{name} = [{x:?}, {y:?}, {z:?}]"),
    };
    written.expect("writing to a String cannot fail");
}

/// Refuses top-level names that mean nothing.
fn check_names(toml: &TomlText, table: &DeTable) -> Result<()> {
    for (key, value) in table.iter() {
        let name = key.get_ref().as_ref();
        if KEYS.contains(&name) {
            continue;
        }
        let ids = effects::LIST.iter().map(|e| e.id());
        match (effects::by_id(name), value.get_ref()) {
            (Some(_), DeValue::Table(_)) => {}
            (Some(_), _) => {
                return Err(toml.unexpected(name, value, format!("a table: `[{name}]` and its parameters")));
            }
            (None, DeValue::Table(_)) => {
                return Err(Error::unknown_name(toml.path(), toml.line(key.span()), "effect", name, ids));
            }
            (None, _) => {
                // A parameter above its table's header is a common slip: `motion_blur.exposure_time_s` is meant.
                let dotted: Vec<String> = effects::LIST
                    .iter()
                    .flat_map(|e| e.specs().iter().map(|s| (e.id(), s.name)))
                    .filter(|(_, parameter)| *parameter == name)
                    .map(|(effect, parameter)| format!("{effect}.{parameter}"))
                    .collect();
                let mut error = Error::unknown_name(toml.path(), toml.line(key.span()), "key", name, KEYS);
                if let (Error::UnknownName { nearest, .. }, Some(dotted)) = (&mut error, dotted.first()) {
                    *nearest = Some(dotted.clone());
                }
                return Err(error);
            }
        }
    }
    Ok(())
}

/// The keys above the first table.
struct Keys<'a> {
    toml: &'a TomlText<'a>,
    table: &'a DeTable<'a>,
}

impl<'a> Keys<'a> {
    fn optional(&self, name: &str) -> Option<&'a Entry<'a>> {
        self.table.get(name)
    }

    fn required(&self, name: &str, expected: &str) -> Result<&'a Entry<'a>> {
        let missing = || {
            Error::input(self.toml.path(), None, format!("no `{name}`"), format!("`{name} = ` {expected}"))
        };
        self.optional(name).ok_or_else(missing)
    }

    /// `width`, `height`. The largest side squared is 2^28 pixels, so a side's limit is the picture's too.
    fn side_px(&self, name: &str) -> Result<u32> {
        let expected = format!("a whole number of px, 1 to {MAX_SIDE_PX}");
        let value = self.required(name, &expected)?;
        let whole =
            value.get_ref().as_integer().and_then(|i| u32::from_str_radix(i.as_str(), i.radix()).ok());
        let whole = whole.filter(|side| (1..=MAX_SIDE_PX).contains(side));
        whole.ok_or_else(|| self.toml.unexpected(name, value, expected))
    }

    fn number_in(&self, name: &str, unit: &'static str, (min, max): (f64, f64)) -> Result<f64> {
        let expected = format!("a finite number of {unit}, {min} to {max}");
        let value = self.required(name, &expected)?;
        let number = self.toml.number(name, value, &expected)?;
        let inside = min <= number && number <= max;
        inside.then_some(number).ok_or_else(|| self.toml.unexpected(name, value, expected))
    }

    fn frame_period_s(&self) -> Result<f64> {
        let name = "frame_period_s";
        let expected = format!("a finite number of s above 0 (at most {MAX_FRAME_PERIOD_S})");
        let value = self.required(name, &expected)?;
        let period_s = self.toml.number(name, value, &expected)?;
        let inside = 0.0 < period_s && period_s <= MAX_FRAME_PERIOD_S;
        inside.then_some(period_s).ok_or_else(|| self.toml.unexpected(name, value, expected))
    }

    /// Whether the second of two names stands there; the first is meant when neither does.
    fn choice(&self, name: &str, options: [&'static str; 2]) -> Result<bool> {
        let Some(value) = self.optional(name) else { return Ok(false) };
        let chosen = choose(self.toml, name, value, &options)?;
        Ok(chosen == options[1])
    }

    fn flag(&self, name: &str) -> Result<bool> {
        let Some(value) = self.optional(name) else { return Ok(false) };
        value.get_ref().as_bool().ok_or_else(|| self.toml.unexpected(name, value, "true or false"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: &str =
        "width = 320\nheight = 240\nfx = 280.82\nfy = 280\ncx = 158.77\ncy = 120.83\nframe_period_s = 0.04\n";

    fn parse(text: &str) -> CameraFile {
        CameraFile::parse(Path::new("camera.toml"), text).unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn what_is_not_said_is_the_ideal_pinhole() {
        let camera = parse(PLAIN);
        let k = Intrinsics { width: 320, height: 240, fx: 280.82, fy: 280.0, cx: 158.77, cy: 120.83 };
        assert_eq!((camera.intrinsics, camera.frame_period_s), (k, 0.04));
        assert!(!camera.background_ignored && !camera.static_camera && !camera.lit);
        assert_eq!(camera.settings, Settings::default());
        assert!(camera.warnings.is_empty());
        let same = parse(&format!("{PLAIN}background = \"black\"\nstatic = false\nshading = \"unlit\"\n"));
        assert_eq!(same.to_toml(), camera.to_toml());
    }

    #[test]
    fn keys_and_effects_are_read() {
        let text = "background = \"ignore\"\nstatic = true\nshading = \"lit\"\n[motion_blur]\nexposure_time_s = 1e-2\n\
                    [rolling_shutter]\nreadout_time_s = 0\nscan_order = \"right_to_left\"";
        let camera = parse(&format!("\u{feff}{}{text}", PLAIN.replace('\n', "\r\n")));
        assert!(camera.background_ignored && camera.static_camera && camera.lit);
        assert_eq!(effects::MotionBlur::exposure_time_s(&camera.settings), 0.01);
        assert_eq!(effects::RollingShutter::readout_time_s(&camera.settings), 0.0);
        assert_eq!(effects::RollingShutter::scan_order(&camera.settings).name(), "right_to_left");
        assert!(!camera.settings.has("paper_noise"));
        assert!(parse(&format!("{PLAIN}[paper_noise]")).settings.has("paper_noise"));
    }

    #[test]
    fn every_effect_survives_the_way_to_toml_and_back() {
        let mut camera =
            parse(&format!("{PLAIN}background = \"ignore\"\nstatic = true\nshading = \"lit\"\n"));
        camera.frame_period_s = 1.0 / 30.0;
        camera.intrinsics.fx = 1e-3 + 1e-17;
        camera.intrinsics.cy = -123_456.789_012_345_67;
        for effect in effects::LIST {
            for (i, spec) in effect.specs().iter().enumerate() {
                let value = match spec.kind {
                    // A third has no end in binary or decimal; a matrix of squares has an inverse.
                    ParamKind::Number { min, max, .. } => {
                        let share = (i as f64 + 1.0) / (effect.specs().len() as f64 + 1.0);
                        Value::Number(min + (max - min) * share * share / 3.0)
                    }
                    ParamKind::Integer { min, max, .. } => Value::Number((0.3 * (max - min) + min).round()),
                    ParamKind::Choice { options, .. } => Value::Choice(options[options.len() - 1]),
                    ParamKind::Vector3 { max } => Value::Vector3([max / 3.0, -max / 7.0, 0.0]),
                };
                camera.settings.set(*effect, spec.name, value).expect("in range");
            }
        }
        let text = camera.to_toml();
        let back = parse(&text);
        assert_eq!(back.intrinsics, camera.intrinsics);
        assert_eq!(back.frame_period_s, camera.frame_period_s);
        assert_eq!(back.settings, camera.settings);
        assert!(back.background_ignored && back.static_camera && back.lit);
        assert_eq!(back.to_toml(), text);
        // Control: one bit more in one value is another text, and reads back as another camera.
        camera.frame_period_s = camera.frame_period_s.next_up();
        assert_ne!(camera.to_toml(), text);
        assert_ne!(parse(&camera.to_toml()).frame_period_s, back.frame_period_s);
    }

    #[test]
    fn effects_are_written_in_light_path_order() {
        let tables: String = effects::LIST.iter().rev().map(|e| format!("[{}]\n", e.id())).collect();
        let text = parse(&format!("{PLAIN}{tables}")).to_toml();
        let at: Vec<_> =
            effects::LIST.iter().map(|e| text.find(&format!("[{}]", e.id())).expect("written")).collect();
        assert!(at.is_sorted(), "{text}");
    }

    #[test]
    fn a_readout_longer_than_the_frame_period_is_a_warning() {
        let camera =
            |readout: &str| parse(&format!("{PLAIN}[rolling_shutter]\nreadout_time_s = {readout}\n"));
        assert!(camera("0.04").warnings.is_empty());
        let warnings = camera("0.05").warnings;
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("0.05 s is longer than frame_period_s = 0.04 s"), "{}", warnings[0]);
    }
}
