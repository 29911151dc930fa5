//! `shutterbug calibrate flat` and `edge`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::args_calibrate::{CalibrateEdge, CalibrateFlat, Common};
use super::calibrate::{check_size, placeholder};
use super::terminal::print;
use super::together::Together;
use shutterbug::capture::CameraFile;
use shutterbug::chain::Value;
use shutterbug::effects::by_id;
use shutterbug::error::{Error, Result, counted};
use shutterbug::plane::{Plane, read_exr_plane, write_atomic, write_exr_plane, write_png_atomic};
use shutterbug_diagnose::calibrate::chart_edge::edge_figure;
use shutterbug_diagnose::calibrate::dark::{Dark, DarkSums};
use shutterbug_diagnose::calibrate::edge::{Edge, find_edge, measure_edge, sharper_green};
use shutterbug_diagnose::calibrate::flat::{Flat, FlatSums, Measured, likeness};
use shutterbug_diagnose::calibrate::{Encoding, Frame};
use shutterbug_diagnose::out::{Out, OutRules};

/// Channel of a pattern's file.
const PATTERN: [&str; 1] = ["gain"];

/// An effect of camera.toml, and values of its parameters.
pub(super) type Table = (&'static str, Vec<(&'static str, Value)>);

/// A table of numbers.
fn numbers(effect: &'static str, values: impl IntoIterator<Item = (&'static str, f64)>) -> Table {
    (effect, values.into_iter().map(|(name, value)| (name, Value::Number(value))).collect())
}

impl Common {
    /// `inputs`: what is read beside the camera.
    pub(super) fn open(&self, command: &'static str, inputs: &[PathBuf]) -> Result<Out> {
        let inputs: Vec<&Path> = inputs.iter().chain(&self.camera).map(PathBuf::as_path).collect();
        Out::open(
            &self.out,
            &OutRules { command, inputs: &inputs, overwrite: self.overwrite, goes_on: false },
        )
    }

    /// The given camera, which must be one of pictures of that size: what is measured of others is not its.
    pub(super) fn own_camera(&self, size: [usize; 2], picture: &Path) -> Result<Option<CameraFile>> {
        let camera = self.camera.as_deref().map(CameraFile::read).transpose()?;
        if let Some(camera) = &camera {
            check_size(camera, size, picture)?;
        }
        Ok(camera)
    }

    /// Writes report.json, and camera.toml: the user's `own` camera, or a placeholder of that size, with these tables.
    pub(super) fn write(
        &self,
        own: Option<CameraFile>,
        size: [usize; 2],
        report: &Json,
        tables: &[Table],
    ) -> Result<()> {
        let path = self.out.join("camera.toml");
        let mut text = String::new();
        let mut camera = match own {
            Some(camera) => camera,
            None => {
                text += "# Focal length, principal point and frame period are placeholders: give --camera FILE for \
                    yours.\n";
                placeholder(&path, size)
            }
        };
        for (effect, values) in tables {
            let known = by_id(effect).expect("names of effects");
            camera.settings.disable(effect);
            camera.settings.enable(known);
            for (name, value) in values {
                camera.settings.set(known, name, *value)?;
            }
        }
        write_atomic(&path, format!("{text}{}", camera.to_toml()).as_bytes())?;
        let json = serde_json::to_string_pretty(report).expect("numbers and names") + "\n";
        write_atomic(&self.out.join("report.json"), json.as_bytes())
    }
}

/// The pictures of a folder, or those given.
fn listed(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    Ok(shutterbug_diagnose::board::pictures(given)?.into_iter().map(|p| p.path).collect())
}

/// `calibrate flat`.
pub fn flat(args: &CalibrateFlat) -> Result<()> {
    let (bright, dark) =
        (listed(&args.frames)?, if args.dark.is_empty() { Vec::new() } else { listed(&args.dark)? });
    let inputs: Vec<PathBuf> = args.frames.iter().chain(&args.dark).chain(&args.pattern).cloned().collect();
    let out = args.common.open("calibrate flat", &inputs)?;
    let encoding: Encoding = args.common.encoding.into();
    let mut together = Together::default();
    together.begin(&bright[0])?;
    let mut offsets: Option<DarkSums> = None;
    together.each(&dark, |f| {
        offsets.get_or_insert_with(|| DarkSums::new(encoding)).add(&f.encoded);
    })?;
    let offsets = offsets.map(|d| d.measure(&args.dark[0])).transpose()?;
    let black = offsets.as_ref().map_or(0.0, |d| d.lowest);
    let mut sums: Option<FlatSums> = None;
    together.each(&bright, |f| {
        let new = || FlatSums::new(f.encoded.width, f.encoded.height, encoding, black);
        sums.get_or_insert_with(new).add(&f.encoded, f.step);
    })?;
    let sums = sums.expect("a picture at least");
    let own = args.common.own_camera(together.size.unwrap_or_default(), &bright[0])?;
    if let Some(dark) = &offsets {
        check_dark(&args.dark[0], dark, sums.level(), 0.0)?;
    }
    if let (Some((at, level)), true) = (sums.unlit(), bright.len() > 1) {
        let found = format!("a mean of {level:.3} of white{}", beyond_black(offsets.as_ref()));
        let expected = "a surface that is neither black nor white: 0.01 to 0.98";
        return Err(Error::input(&bright[at], None, found, expected));
    }
    let found = sums.measure(&args.frames[0])?;
    check_alike(&bright, &found)?;
    if let Some(dark) = &offsets {
        check_dark(&args.dark[0], dark, found.level, found.temporal)?;
    }
    let other = args.pattern.as_deref().map(|p| same_sensor(p, &found)).transpose()?;
    out.start_together()?;
    let mut tables: Vec<Table> = Vec::new();
    let falls_off = found.a1.is_some() || found.a2.is_some();
    if falls_off && !brightens(&found) {
        tables.push(numbers("vignetting", [("a1", found.a1.value), ("a2", found.a2.value)]));
    }
    if let Some(level) = offsets.as_ref().and_then(Dark::black_level) {
        tables.push(numbers("black_level", [("offset", level)]));
    }
    let dsnu = offsets.as_ref().and_then(|d| d.dsnu).filter(Measured::is_some).map(|d| ("dsnu", d.value));
    let prnu = found.prnu.is_some().then_some(("prnu", found.prnu.value));
    if prnu.is_some() || dsnu.is_some() {
        tables.push(numbers("fixed_pattern_noise", prnu.into_iter().chain(dsnu)));
    }
    if found.stuck > 0 {
        tables.push(numbers("hot_pixels", [("count", found.stuck as f64)]));
    }
    let report = json!({ "flat": found, "dark": offsets, "other_pattern": other });
    args.common.write(own, found.size_px, &report, &tables)?;
    write_exr_plane(&args.common.out.join("pattern.exr"), &found.pattern, &PATTERN)?;
    out.appear()?;
    print(flat_text(&found, offsets.as_ref(), other.as_ref()))
}

/// Whether corners are brighter than the middle, which is said.
fn brightens(found: &Flat) -> bool {
    if found.corner > 1.0 {
        tracing::warn!(
            "corners get {:.1} % of the middle, and no lens brightens them: the light is uneven, or these are \
             negatives; no [vignetting] is written",
            100.0 * found.corner
        );
    }
    found.corner > 1.0
}

/// Said of a level that is one beyond that of dark pictures.
fn beyond_black(dark: Option<&Dark>) -> String {
    dark.map_or_else(String::new, |d| format!(" beyond the {:.4} of the dark pictures", d.lowest))
}

/// Most pictures that an error names.
const MOST_PICTURES: usize = 5;

/// Pictures of one sensor share its pattern.
fn check_alike(paths: &[PathBuf], flat: &Flat) -> Result<()> {
    let Some(odd) = &flat.odd else { return Ok(()) };
    let named = |all: &[usize]| {
        let names: Vec<String> =
            all.iter().take(MOST_PICTURES).map(|i| paths[*i].display().to_string()).collect();
        names.join(", ") + if all.len() > MOST_PICTURES { ", ..." } else { "" }
    };
    let [first, others @ ..] = odd.pictures.as_slice() else { return Ok(()) };
    let more = if others.is_empty() { String::new() } else { format!(" (and so has {})", named(others)) };
    let found = format!("a pattern that is not that of {}{more}", named(&odd.others));
    let expected = "pictures of one sensor, none turned, cut, resized or taken with the cap on";
    Err(Error::input(&paths[*first], None, found, expected))
}

/// Pictures with the cap on are darker than those of a surface, by more than the noise of a pixel. `level`: of the
/// latter, beyond that of no light; `noise`: of one of them, of the level.
fn check_dark(path: &Path, dark: &Dark, level: f64, noise: f64) -> Result<()> {
    if dark.level - dark.lowest + dark.temporal.hypot(noise * level) < level {
        return Ok(());
    }
    let found = format!("pictures with a mean of {:.4} of white", dark.level);
    let expected =
        format!("pictures with the cap on, darker than the {:.4} of the flat field", dark.lowest + level);
    Err(Error::input(path, None, found, expected))
}

fn same_sensor(path: &Path, found: &Flat) -> Result<shutterbug_diagnose::calibrate::flat::Likeness> {
    let other = read_exr_plane(path, &PATTERN)?;
    if [other.width, other.height] != found.size_px {
        let expected = format!("{}x{} px, as of the pictures", found.size_px[0], found.size_px[1]);
        return Err(Error::input(
            path,
            None,
            format!("a pattern of {}x{} px", other.width, other.height),
            expected,
        ));
    }
    Ok(likeness(&found.pattern, &other))
}

fn flat_text(
    f: &Flat,
    dark: Option<&Dark>,
    other: Option<&shutterbug_diagnose::calibrate::flat::Likeness>,
) -> String {
    let percent = |v: f64| format!("{:.3} %", 100.0 * v);
    let mut text = format!(
        "{} of {}x{} px, mean {:.3} of white{}\n",
        counted(f.frames, "picture", "pictures"),
        f.size_px[0],
        f.size_px[1],
        f.level,
        beyond_black(dark)
    );
    let [a1, a2] = [&f.a1, &f.a2].map(|m| format!("{:.4} [{:.4}, {:.4}]", m.value, m.ci95[0], m.ci95[1]));
    let _ =
        writeln!(text, "  fall-off: corners get {:.1} % of the middle; a1 {a1}, a2 {a2}", 100.0 * f.corner);
    if let Some(corners) = f.corner_by_colour {
        let [r, g, b] = corners.map(|c| 100.0 * c);
        let _ = writeln!(
            text,
            "  colours fall off by themselves (colour shading): corners get {r:.1} % of red, {g:.1} % of green, \
             {b:.1} % of blue. [vignetting] of camera.toml is green's, for all three"
        );
    }
    let _ = writeln!(
        text,
        "  the light itself: tilted by {} over half a diagonal, {} rms beyond that (an even fall-off of the light \
         counts as the lens's)",
        percent(f.tilt),
        percent(f.uneven)
    );
    let [low, high] = f.prnu.ci95;
    let _ =
        writeln!(text, "  pattern (PRNU): {} [{}, {}]", percent(f.prnu.value), percent(low), percent(high));
    text += "    a grain of the surface that is as fine looks the same in pictures that do not move: only a camera \
        that is shifted between them tells it from the sensor's\n";
    noise_text(&mut text, f);
    left_out_text(&mut text, f);
    let said = |l: &shutterbug_diagnose::calibrate::flat::Likeness| {
        format!("correlation {:.4}, {:.1} standard deviations of chance", l.correlation, l.deviations)
    };
    let _ =
        writeln!(text, "  the pattern of one half of the pictures beside the others': {}", said(&f.itself));
    let _ = writeln!(
        text,
        "  pixels that are white in every picture: {}, black in every picture: {} (neither are in the pattern)",
        f.stuck, f.dead
    );
    if let Some(dark) = dark {
        dark_text(&mut text, dark);
    }
    if let Some(other) = other {
        let _ = writeln!(text, "  beside the given pattern: {}", said(other));
    }
    text
}

/// What has no part in the figures.
fn left_out_text(text: &mut String, f: &Flat) {
    if f.white > 0.0 {
        let _ = writeln!(
            text,
            "  white in a picture, or beside white: {:.3} %; left out of all of this",
            100.0 * f.white
        );
    }
    if let Some([left, top, right, bottom]) = f.drawn_px.first() {
        let _ = writeln!(
            text,
            "  WARNING: something is drawn on the pictures, or lies on the sensor (a date, a logo, dust), in {}, the \
             largest within ({left}, {top}) to ({right}, {bottom}) px: left out of the pattern",
            counted(f.drawn_px.len(), "place", "places")
        );
    }
}

fn dark_text(text: &mut String, d: &Dark) {
    let dsnu = match d.dsnu {
        Some(Measured { value, ci95: [low, high] }) => format!("{value:.6} [{low:.6}, {high:.6}]"),
        None => {
            format!("not known: {:.1} % of the values are black, which cuts them off", 100.0 * d.black)
        }
    };
    let _ = writeln!(text, "  dark: mean {:.5}, offsets (DSNU) {dsnu}, {} hot pixels", d.level, d.hot);
    let _ = writeln!(
        text,
        "    slow changes over the dark picture, which are not in the offsets: {:.6} rms (amplifier glow, or light \
         that leaks in)",
        d.uneven
    );
}

fn noise_text(text: &mut String, f: &Flat) {
    let percent = |v: f64| format!("{:.3} %", 100.0 * v);
    if let Some(correlation) = f.shared_noise {
        let _ = writeln!(
            text,
            "  WARNING: pictures that follow each other share noise (a correlation of {correlation:.2} beyond what \
             pictures further apart share), as in a video with temporal noise reduction, or of a surface that moves \
             slowly. It counts as pattern: PRNU is at most this, and not written to camera.toml; noise is at least \
             this. Take photographs, or frames of the video that lie a second or more apart"
        );
    }
    let _ = writeln!(text, "  noise of one picture: {} of the level", percent(f.temporal));
    let _ = writeln!(
        text,
        "  rounding of the values: up to {} of the level where that noise does not hide it (in the intervals)",
        percent(f.rounding)
    );
    if let Some(shared) = &f.shared_lines {
        let lines = if shared.rows { "rows" } else { "columns" };
        let _ = writeln!(
            text,
            "  WARNING: {lines} are brighter or darker by {} rms in all pictures: each has an amplifier or a converter \
             of its own. The pattern above is of single pixels, and [fixed_pattern_noise] of camera.toml has no part \
             of this",
            percent(shared.rms)
        );
    }
    if let Some(bands) = &f.bands {
        let lines = if bands.rows { "rows" } else { "columns" };
        let _ = writeln!(
            text,
            "  {lines} differ by {} rms from picture to picture, beyond their pixels' noise: a lamp that flickers, or \
             noise of the {lines}. This is not in pattern and noise, but in fall-off and light: expose for whole \
             periods of the lamp, or take one on direct current",
            percent(bands.rms)
        );
    }
}

/// The edge of all colours together, or of green where they lie apart.
fn edge_of(args: &CalibrateEdge, picture: &Plane<f32>, encoding: Encoding) -> Result<Edge> {
    let together = match args.region {
        Some(region) => measure_edge(picture, region, encoding, &args.photo)?,
        None => find_edge(picture, encoding, &args.photo)?,
    };
    let Some(green) = sharper_green(&together, picture, encoding, &args.photo) else { return Ok(together) };
    tracing::warn!(
        "the colours do not lie on each other at this edge (lateral colour): blurred by {:.3} px together, by {:.3} \
         px in green; what follows is of green",
        together.defocus_sigma_px.value,
        green.defocus_sigma_px.value
    );
    Ok(green)
}

/// `calibrate edge`.
pub fn edge(args: &CalibrateEdge) -> Result<()> {
    let out = args.common.open("calibrate edge", std::slice::from_ref(&args.photo))?;
    let frame = Frame::read(&args.photo)?;
    let picture = &frame.encoded;
    let size = [picture.width, picture.height];
    let own = args.common.own_camera(size, &args.photo)?;
    let encoding: Encoding = args.common.encoding.into();
    let found = edge_of(args, picture, encoding)?;
    out.start_together()?;
    let sigma = found.defocus_sigma_px;
    let mut tables: Vec<Table> = Vec::new();
    if sigma.value > sigma.half {
        tables.push(numbers("defocus", [("sigma_px", sigma.value)]));
    }
    if let Some([amount, radius]) = found.sharpening {
        tables.push(numbers("sharpening", [("amount", amount.value), ("radius_px", radius.value)]));
    }
    args.common.write(own, size, &json!({ "edge": found }), &tables)?;
    write_png_atomic(&args.common.out.join("edge.png"), &edge_figure(&found)?)?;
    out.appear()?;
    let [x, y, w, h] = found.region;
    let mut text = format!(
        "edge in {w}x{h} px at {x}, {y}: {:.1} degrees off {}, linear light {:.3} and {:.3}\n",
        found.slant_deg,
        if found.upright { "upright" } else { "level" },
        found.sides[0],
        found.sides[1]
    );
    let half = found.mtf50.map_or("beyond 1".to_owned(), |f| format!("{f:.3}"));
    let _ = writeln!(text, "  half of the contrast (MTF50) at {half} cycles a px");
    let _ = writeln!(text, "  defocus: sigma {:.3} +- {:.3} px", sigma.value, sigma.half);
    if args.region.is_none() {
        let widest = found.among_px.iter().copied().fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "  the sharpest of {} (the softest: {widest:.3} px): an edge is no sharper than the lens, but shadows and \
             round things are softer, so the lens blurs by this at most; --region names another",
            counted(found.among_px.len(), "edge", "edges")
        );
    }
    match found.sharpening {
        Some([amount, radius]) => {
            let _ = writeln!(
                text,
                "  sharpening: amount {:.2} +- {:.2}, radius {:.2} +- {:.2} px",
                amount.value, amount.half, radius.value, radius.half
            );
        }
        None => text += "  sharpening: none that the edge shows\n",
    }
    let _ = writeln!(text, "  the fit leaves {:.2} % of the contrast", 100.0 * found.left_rms);
    print(text)
}
