//! `camera.toml`: the pinhole, and one table per modelled effect. Effects and their parameters come from
//! [`effects::LIST`], so a new effect needs nothing here.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::text::{Entry, TomlText, read_text};
use crate::camera::Intrinsics;
use crate::chain::{Effect, ParamKind, ParamSpec, Settings, Value};
use crate::effects;
use crate::error::{Error, Result};
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
    /// The modelled effects.
    pub settings: Settings,
    /// What is allowed but worth saying: "readout longer than the frame period".
    pub warnings: Vec<String>,
}

const KEYS: [&str; 10] =
    ["width", "height", "fx", "fy", "cx", "cy", "frame_period_s", "background", "static", "shading"];

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
        let text = read_text(path, "the camera: its size, pinhole, frame period and effects")?;
        let camera = Self::parse(path, &text)?;
        for warning in &camera.warnings {
            tracing::warn!("{}: {warning}", path.display());
        }
        Ok(camera)
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
        let (settings, warnings) = read_effects(&toml, &table, frame_period_s)?;
        Ok(Self {
            path: path.to_owned(),
            intrinsics,
            frame_period_s,
            background_ignored: keys.choice("background", ["black", "ignore"])?,
            static_camera: keys.flag("static")?,
            lit: keys.choice("shading", ["unlit", "lit"])?,
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
        ];
        text.extend(stated.into_iter().filter(|(on, _)| *on).map(|(_, line)| line));
        for effect in effects::LIST.iter().filter(|e| self.settings.has(e.id())) {
            text += &format!("\n[{}]\n", effect.id());
            for spec in effect.specs() {
                if let Some(value) = self.settings.get(effect.id(), spec.name) {
                    line(&mut text, spec.name, &value);
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

/// One of `options`.
fn choose(toml: &TomlText, name: &str, value: &Entry, options: &[&'static str]) -> Result<&'static str> {
    let given = value.get_ref().as_str();
    options.iter().find(|o| Some(**o) == given).copied().ok_or_else(|| {
        let list: Vec<String> = options.iter().map(|o| format!("{o:?}")).collect();
        toml.unexpected(name, value, list.join(" or "))
    })
}

/// The effects' tables, and what their own checks have to say.
fn read_effects(toml: &TomlText, table: &DeTable, frame_period_s: f64) -> Result<(Settings, Vec<String>)> {
    let mut settings = Settings::default();
    for effect in effects::LIST {
        if let Some(entries) = table.get(effect.id()).and_then(|t| t.get_ref().as_table()) {
            settings.enable(*effect);
            for (key, value) in entries.iter() {
                read_parameter(toml, *effect, key, value, &mut settings)?;
            }
        }
    }
    let mut warnings = Vec::new();
    for effect in effects::LIST.iter().filter(|e| settings.has(e.id())) {
        let line = table.get(effect.id()).map(|t| toml.line(t.span()));
        warnings.extend(
            effect
                .check(&settings, frame_period_s)
                .map_err(|problem| at(toml, line, problem, String::new()))?,
        );
    }
    Ok((settings, warnings))
}

fn read_parameter(
    toml: &TomlText,
    effect: &'static dyn Effect,
    key: &Spanned<std::borrow::Cow<str>>,
    value: &Entry,
    settings: &mut Settings,
) -> Result<()> {
    let (name, line) = (key.get_ref().as_ref(), toml.line(key.span()));
    let Some(spec) = effect.specs().iter().find(|s| s.name == name) else {
        if KEYS.contains(&name) {
            let found = format!("`{name}` in the table [{}]", effect.id());
            return Err(Error::input(
                toml.path(),
                line,
                found,
                "it above the first table: it belongs to the camera",
            ));
        }
        let known = effect.specs().iter().map(|s| s.name);
        return Err(Error::unknown_name(toml.path(), line, "parameter", name, known));
    };
    let parsed = parameter_value(toml, effect.id(), spec, value)?;
    settings.set(effect, name, parsed).map_err(|problem| {
        let hint = unit_hint(&problem);
        at(toml, Some(line), problem, hint)
    })
}

fn parameter_value(toml: &TomlText, effect: &str, spec: &ParamSpec, value: &Entry) -> Result<Value> {
    let name = format!("{effect}.{}", spec.name);
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" of unit {}", spec.unit) };
    Ok(match spec.kind {
        ParamKind::Number { min, max, .. } => {
            Value::Number(toml.number(&name, value, &format!("a finite number{unit}, {min} to {max}"))?)
        }
        ParamKind::Choice { options, .. } => Value::Choice(choose(toml, &name, value, options)?),
        ParamKind::Vector3 { max } => Value::Vector3(toml.vector3(
            &name,
            value,
            &format!("a list of three finite numbers{unit}, -{max} to {max}"),
        )?),
    })
}

fn at(toml: &TomlText, line: Option<usize>, problem: Error, hint: String) -> Error {
    Error::At { path: toml.path().to_owned(), line, problem: Box::new(problem), hint }
}

/// "; is it in ms?" where seconds are meant and the same number of ms, us or ns would be in range.
fn unit_hint(problem: &Error) -> String {
    let Error::Parameter { value, min, max, unit: "s", .. } = problem else { return String::new() };
    let smaller = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    let meant = smaller.iter().find(|(_, s)| (*min..=*max).contains(&(value * s)));
    // A negative value is out of range in every unit, unless the range holds negative ones.
    meant.map(|(name, _)| format!("; is it in {name}?")).unwrap_or_default()
}
