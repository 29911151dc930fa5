//! Presets from a folder of lens profiles that the user names: Gyroflow's JSON files, and tables of them
//! (`brand,model,lens,setting,width_px,...`). None of them ships: their numbers are their owners'.
//!
//! Such a preset holds what its source states: pinhole, lens, frame rate, readout. Noise and full well are not stated,
//! and so they are absent.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::gyroflow::{self, About};
use super::presets::{PRESETS, Preset};
use super::yaml::{self, Field};
use super::{CameraModel, common};
use shutterbug::camera::{Distortion, Intrinsics};
use shutterbug::capture::read_text;
use shutterbug::error::{Error, Quoted, Result, counted};
use shutterbug::files::{Limit, read_if_there};

/// Deepest folder, and most files, that are looked at.
const MAX_DEPTH: usize = 6;
const MAX_FILES: usize = 100_000;
/// First columns of a table, and all that are needed.
const COLUMNS: [&str; 19] = [
    "brand",
    "model",
    "lens",
    "setting",
    "width_px",
    "height_px",
    "fps",
    "readout_ms",
    "distortion_model",
    "fx_px",
    "fy_px",
    "cx_px",
    "cy_px",
    "d1",
    "d2",
    "d3",
    "d4",
    "rms_px",
    "images",
];

/// One camera in one of its modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// What the command line calls it: words of its description, joined by hyphens.
    pub name: String,
    /// Its camera.
    pub camera: CameraModel,
    about: About,
    /// File, and line in a table.
    source: String,
}

/// All profiles of a folder.
#[derive(Clone, Debug)]
pub struct Profiles {
    folder: PathBuf,
    licence: String,
    all: Vec<Profile>,
    /// One sentence for each file or line that could not be used.
    pub refused: Vec<String>,
}

impl Profiles {
    /// Reads a folder, and all folders in it.
    ///
    /// # Errors
    /// A folder that cannot be read, or has none. Files that are no usable profiles are counted in [`Self::refused`].
    pub fn read(folder: &Path) -> Result<Self> {
        let mut files = Vec::new();
        find(folder, MAX_DEPTH, &mut files)?;
        files.sort();
        let mut profiles = Self {
            folder: folder.to_owned(),
            licence: licence(folder),
            all: Vec::new(),
            refused: Vec::new(),
        };
        for file in &files {
            let text = match read_text(file, "lens profiles", Limit::SETTINGS) {
                Ok(text) => text,
                Err(error) => {
                    profiles.refused.push(error.to_string());
                    continue;
                }
            };
            if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
                profiles.add_table(file, &text);
            } else {
                let read = of_json(file, &text, profiles.shown(file));
                profiles.add(read);
            }
        }
        let mut met: HashMap<String, usize> = HashMap::new();
        for profile in &mut profiles.all {
            let count = met.entry(profile.name.clone()).or_default();
            *count += 1;
            if *count > 1 {
                profile.name = format!("{}-{count}", profile.name);
            }
        }
        if profiles.all.is_empty() && profiles.refused.is_empty() {
            let expected = "lens profiles of Gyroflow, or a table of them";
            return Err(Error::input(folder, None, "no lens profile", expected));
        }
        Ok(profiles)
    }

    /// Those in whose description every word occurs, whatever their case.
    pub fn search(&self, words: &[String]) -> Vec<&Profile> {
        let words: Vec<_> = words.iter().map(|w| plain(w)).collect();
        self.all.iter().filter(|p| words.iter().all(|w| p.name.contains(w.as_str()))).collect()
    }

    /// The preset of that name; `None` if there is none, an error if no pinhole picture can show its field of view.
    pub fn preset(&self, name: &str) -> Option<Result<Preset>> {
        let profile = self.all.iter().find(|p| p.name == name)?;
        let text = profile.check().and_then(|()| profile.toml(&self.licence));
        Some(text.map(|toml| Preset { name: Cow::Owned(name.to_owned()), toml: Cow::Owned(toml) }))
    }

    /// All names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.all.iter().map(|p| p.name.as_str())
    }

    /// A file as its source is written: below the folder.
    fn shown(&self, file: &Path) -> String {
        file.strip_prefix(&self.folder).unwrap_or(file).to_string_lossy().into_owned()
    }

    fn add(&mut self, read: Result<Profile>) {
        match read {
            Ok(profile) => self.all.push(profile),
            Err(error) => self.refused.push(error.to_string()),
        }
    }

    fn add_table(&mut self, file: &Path, text: &str) {
        let mut lines = text.lines();
        let head: Vec<String> = lines.next().map(cells).unwrap_or_default();
        if head.len() < COLUMNS.len() || head.iter().zip(COLUMNS).any(|(had, column)| had != column) {
            let expected = format!("the columns {}", COLUMNS.join(","));
            self.refused.push(Error::input(file, 1, "another table", expected).to_string());
            return;
        }
        let origin = head.iter().position(|column| column == "source_path");
        for (i, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let row = cells(line);
            let from =
                origin.and_then(|at| row.get(at)).map_or_else(String::new, |from| format!(", from {from}"));
            let source = format!("{} line {}{from}", self.shown(file), i + 2);
            self.add(of_row(file, i + 2, &row, source));
        }
    }
}

impl Profile {
    /// One line: size, rate, lens, shutter, error.
    pub fn describe(&self) -> String {
        let k = &self.camera.intrinsics;
        let rate = self.camera.rate_hz.map_or_else(String::new, |r| format!(", {r:.2} frames a second"));
        let readout_s = shutterbug::effects::RollingShutter::readout_time_s(&self.camera.settings);
        let shutter = match readout_s {
            0.0 => "readout not stated".to_owned(),
            readout_s => format!("rolling shutter {:.1} ms", readout_s * 1e3),
        };
        format!("{}x{}{rate}, {shutter}, {}", k.width, k.height, self.error())
    }

    /// Whether every pixel has a ray less than 90 degrees from the axis. Takes some 10 ms.
    ///
    /// # Errors
    /// [`Error::LensFolds`] with the first pixel that has none.
    pub fn check(&self) -> Result<()> {
        self.camera.check_lens().map_err(|problem| Error::At {
            path: PathBuf::from(&self.source),
            line: None,
            problem: Box::new(problem),
            hint: String::new(),
        })
    }

    /// Brand, model, lens and setting.
    pub fn title(&self) -> String {
        self.about.words.join(", ")
    }

    fn error(&self) -> String {
        match (self.about.rms_px, self.about.images) {
            (Some(rms_px), Some(images)) => {
                format!(
                    "calibrated to {rms_px} px rms with {}",
                    counted(images as usize, "picture", "pictures")
                )
            }
            (Some(rms_px), None) => format!("calibrated to {rms_px} px rms"),
            _ => "error of the calibration not stated".to_owned(),
        }
    }

    /// The whole camera, with source, error and licence in its head.
    fn toml(&self, licence: &str) -> Result<String> {
        let (file, notes) = self.camera.to_camera_file(Path::new(&self.source), None)?;
        let mut head = vec![
            format!("{}: {}", self.title(), self.describe()),
            String::new(),
            format!("Source: {}.", self.source),
            format!("Licence: {licence}."),
            format!(
                "Error: {}. Owners measured it; profiles of one model differ by some per cent.",
                self.error()
            ),
            "Not stated by the source, and so absent: exposure time, noise, full well, processing."
                .to_owned(),
        ];
        head.extend(notes);
        Ok(common::comments(&head) + "\n" + &file.to_toml())
    }
}

/// The preset of that name: one that ships, or one of `profiles`. `option` is where the name was given.
///
/// # Errors
/// An unknown name, with the nearest known one; a profile whose lens no pinhole's picture shows.
pub fn preset(name: &str, profiles: Option<&Profiles>, option: &str) -> Result<Preset> {
    if let Some(known) = PRESETS.iter().find(|p| p.name == name) {
        return Ok(known.clone());
    }
    profiles.and_then(|p| p.preset(name)).unwrap_or_else(|| {
        let names = PRESETS.iter().map(|p| p.name.as_ref()).chain(profiles.iter().flat_map(|p| p.names()));
        Err(Error::unknown_name(Path::new(option), None, "preset", name, names))
    })
}

/// Files below a folder that may hold profiles.
fn find(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |e| Error::io(folder, "read", e);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
        let hidden = entry.file_name().to_string_lossy().starts_with('.');
        if kind.is_dir() && !hidden && depth > 0 {
            find(&path, depth - 1, files)?;
        } else if kind.is_file() && is_profile(&path) {
            files.push(path);
        }
        if files.len() > MAX_FILES {
            let found = format!("more than {MAX_FILES} files");
            return Err(Error::input(folder, None, found, "a folder of lens profiles"));
        }
    }
    Ok(())
}

fn is_profile(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json") || e.eq_ignore_ascii_case("csv"))
}

/// What the folder says of its licence: the first line of its licence file, or the line of its README that names one.
fn licence(folder: &Path) -> String {
    for name in ["LICENSE", "LICENSE.md", "LICENSE.txt", "README.md"] {
        let Ok(Some(bytes)) = read_if_there(&folder.join(name), Limit::SETTINGS) else { continue };
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.lines().map(str::trim);
        let found = if name.starts_with("README") {
            let told = text.lines().find_map(|l| {
                let at = l.to_lowercase().find("licence:").or_else(|| l.to_lowercase().find("license:"))?;
                l.get(at + "licence:".len()..)
            });
            told.map(str::trim)
        } else {
            lines.find(|l| !l.is_empty())
        };
        if let Some(found) = found {
            return found.trim_end_matches('.').to_owned();
        }
    }
    "not stated in the folder".to_owned()
}

fn of_json(file: &Path, text: &str, source: String) -> Result<Profile> {
    let documents = yaml::parse(file, text)?;
    let top = Field::top(file, &documents[0]);
    let camera = gyroflow::read(&top)?.camera;
    Ok(named(camera, gyroflow::about(&top), source))
}

/// A row of a table, and where it stands: errors name the file and the line.
struct Row<'a> {
    file: &'a Path,
    line: usize,
    cells: &'a [String],
}

impl Row<'_> {
    fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::input(self.file, self.line, found, expected)
    }

    /// The text of a cell; empty where the row is too short.
    fn cell(&self, column: &str) -> &str {
        let at = COLUMNS.iter().position(|c| *c == column).expect("a column");
        self.cells.get(at).map_or("", String::as_str)
    }

    fn number(&self, column: &str) -> Result<f64> {
        let cell = self.cell(column);
        cell.parse()
            .ok()
            .filter(|n: &f64| n.is_finite())
            .ok_or_else(|| self.error(format!("{column} = `{}`", yaml::shortened(cell)), "a number"))
    }

    fn numbers(&self, columns: [&str; 4]) -> Result<[f64; 4]> {
        let [a, b, c, d] = columns.map(|column| self.number(column));
        Ok([a?, b?, c?, d?])
    }

    /// A side of the picture, px.
    fn side(&self, column: &str) -> Result<u32> {
        match self.number(column)? {
            n if n.fract() == 0.0 && (1.0..=f64::from(shutterbug::plane::MAX_SIDE_PX)).contains(&n) => {
                Ok(n as u32)
            }
            n => Err(self.error(format!("{column} = {}", Quoted(n)), "a whole number of px")),
        }
    }

    fn within(&self, column: &str, value: f64, (min, max): (f64, f64)) -> Result<f64> {
        match value {
            v if (min..=max).contains(&v) => Ok(v),
            v => Err(self.error(format!("{column} = {}", Quoted(v)), format!("{min} to {max}"))),
        }
    }

    fn intrinsics(&self) -> Result<Intrinsics> {
        let [fx, fy, cx, cy] = self.numbers(["fx_px", "fy_px", "cx_px", "cy_px"])?;
        let (width, height) = (self.side("width_px")?, self.side("height_px")?);
        for (column, value, range) in [
            ("fx_px", fx, common::FOCAL_PX),
            ("fy_px", fy, common::FOCAL_PX),
            ("cx_px", cx, common::CENTRE_PX),
            ("cy_px", cy, common::CENTRE_PX),
        ] {
            self.within(column, value, range)?;
        }
        let half = common::PIXEL_CENTRE;
        Ok(Intrinsics { width, height, fx, fy, cx: cx + half, cy: cy + half })
    }
}

fn of_row(file: &Path, line: usize, cells: &[String], source: String) -> Result<Profile> {
    let row = Row { file, line, cells };
    if row.cell("distortion_model") != "opencv_fisheye" {
        return Err(row.error(row.cell("distortion_model"), "opencv_fisheye"));
    }
    let mut camera = CameraModel::new("camera", row.intrinsics()?);
    camera.distortion = Distortion::Equidistant { k: row.numbers(["d1", "d2", "d3", "d4"])? };
    // 0 says that it is not known.
    camera.rate_hz = match row.number("fps")? {
        0.0 => None,
        fps => Some(row.within("fps", fps, super::RATE_HZ)?),
    };
    gyroflow::set_readout_ms(&mut camera, row.number("readout_ms")?).map_err(|problem| Error::At {
        path: file.to_owned(),
        line: Some(line),
        problem: Box::new(problem),
        hint: String::new(),
    })?;
    let words = ["brand", "model", "lens", "setting"].map(|c| row.cell(c).trim().to_owned());
    let about = About {
        words: words.into_iter().filter(|w| !w.is_empty()).collect(),
        rms_px: row.number("rms_px").ok(),
        images: row.cell("images").parse().ok(),
    };
    Ok(named(camera, about, source))
}

/// Names a profile. Equal names are made unique later.
fn named(mut camera: CameraModel, about: About, source: String) -> Profile {
    let k = &camera.intrinsics;
    let rate = camera.rate_hz.map_or_else(String::new, |r| format!(" {r:.0}fps"));
    let name = plain(&format!("{} {}x{}{rate}", about.words.join(" "), k.width, k.height));
    camera.name.clone_from(&name);
    Profile { name, camera, about, source }
}

/// Letters and digits in lower case; runs of anything else become a hyphen.
fn plain(text: &str) -> String {
    let kept = text.to_lowercase();
    let words: Vec<_> = kept.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    words.join("-")
}

/// Cells of a line of a table: commas part them, quotes keep them together.
fn cells(line: &str) -> Vec<String> {
    let (mut all, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => all.push(std::mem::take(&mut cell)),
            _ => cell.push(c),
        }
    }
    all.push(cell);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_words_and_cells_keep_their_commas() {
        assert_eq!(plain("GoPro HERO9 Black, Wide (4:3)"), "gopro-hero9-black-wide-4-3");
        assert_eq!(cells("a,\"b, c\",,d"), ["a", "b, c", "", "d"]);
    }
}
