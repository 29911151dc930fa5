//! `shutterbug calibrate noise A B ... --out DIR`.

use std::path::{Path, PathBuf};

use super::args::CalibrateNoise;
use super::terminal::print;
use shutterbug::camera::Intrinsics;
use shutterbug::capture::CameraFile;
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::by_id;
use shutterbug::error::{Error, Result, one_line};
use shutterbug::plane::{write_atomic, write_png_atomic};
use shutterbug_diagnose::calibrate::{
    Calibration, Frame, NoiseOptions, calibrate_noise, chain_settings, chart, figure, paper_settings,
};
use shutterbug_diagnose::out::{Out, OutRules, make_folder};

/// Runs the command.
pub fn run(args: &CalibrateNoise) -> Result<()> {
    let base = args.camera.as_deref().map(CameraFile::read).transpose()?;
    let frames: Vec<Frame> = args.frames.iter().map(|p| Frame::read(p)).collect::<Result<_>>()?;
    if let Some(base) = &base {
        check_sizes(base, &frames)?;
    }
    let black_level = base.as_ref().map(|b| b.settings.number("black_level", "offset", 0.0));
    let options = NoiseOptions { encoding: args.encoding.into(), seed: args.seed, black_level };
    let inputs: Vec<&Path> = args.frames.iter().map(PathBuf::as_path).collect();
    let rules =
        OutRules { command: "calibrate noise", inputs: &inputs, overwrite: args.overwrite, goes_on: false };
    let out = Out::open(&args.out, &rules)?;
    if !args.pairs {
        let done = calibrate_noise(&frames, options)?;
        out.start_together()?;
        write(&args.out, &done, base.as_ref())?;
        out.appear()?;
        return print(summary(&done));
    }
    if frames.len() % 2 == 1 {
        let last = frames.last().map_or(Path::new(""), |f| &f.path);
        return Err(Error::input(last, None, "an odd number of frames", "pairs: A B, C D, ... with --pairs"));
    }
    for (k, pair) in frames.chunks_exact(2).enumerate() {
        let done = calibrate_noise(pair, options)?;
        out.start_together()?;
        let folder = args.out.join(format!("pair_{k:02}"));
        write(&folder, &done, base.as_ref())?;
        out.appear()?;
        print(summary(&done))?;
    }
    Ok(())
}

/// Noise per pixel is that of a camera of the frames' size.
fn check_sizes(base: &CameraFile, frames: &[Frame]) -> Result<()> {
    frames.iter().try_for_each(|f| check_size(base, [f.encoded.width, f.encoded.height], &f.path))
}

/// Whether a camera's pictures have the size of that one.
pub(super) fn check_size(camera: &CameraFile, size: [usize; 2], picture: &Path) -> Result<()> {
    let k = &camera.intrinsics;
    if size == [k.width as usize, k.height as usize] {
        return Ok(());
    }
    let found = format!("a picture of {}x{} px", size[0], size[1]);
    let expected = format!("{}x{} px, as {} says", k.width, k.height, camera.path.display());
    Err(Error::input(picture, None, found, expected))
}

fn write(out: &Path, done: &Calibration, base: Option<&CameraFile>) -> Result<()> {
    make_folder(out)?;
    write_png_atomic(&out.join("noise.png"), &figure::figure(done)?)?;
    write_png_atomic(&out.join("ptc.png"), &chart::photon_transfer(done)?)?;
    write_camera(&out.join("camera.toml"), &chain_settings(&done.chain_camera)?, done, base)?;
    write_camera(&out.join("camera_paper.toml"), &paper_settings(done)?, done, base)?;
    let json = serde_json::to_string_pretty(done).expect("a report of numbers and names");
    write_atomic(&out.join("report.json"), json.as_bytes())
}

/// Effects that a calibration measures: those of the base camera give way to them.
const MEASURED: [&str; 8] = [
    "paper_noise",
    "shot_noise",
    "row_noise",
    "read_noise",
    "bayer_mosaic",
    "sharpening",
    "chroma_subsampling",
    "jpeg",
];

/// The base camera (or a placeholder of the frames' size) with the measured effects.
fn write_camera(path: &Path, noise: &Settings, done: &Calibration, base: Option<&CameraFile>) -> Result<()> {
    let from = done.frames.join(", ");
    let mut text = format!("# Noise measured from {}.\n", one_line(&from));
    let mut camera = match base {
        Some(base) => base.clone(),
        None => {
            text += "# Focal length, principal point and frame period are placeholders: give --camera FILE for \
                yours.\n";
            placeholder(path, done.size_px)
        }
    };
    done.notes.iter().for_each(|n| text += &format!("# {}\n", one_line(n)));
    MEASURED.iter().for_each(|effect| camera.settings.disable(effect));
    if let Some(black) = &done.black_level {
        let offset = by_id("black_level").expect("a known effect");
        camera.settings.set(offset, "offset", Value::Number(black.value))?;
    }
    for (id, values) in noise.iter() {
        let effect = by_id(id).expect("settings hold known effects");
        for (name, value) in values {
            camera.settings.set(effect, name, *value)?;
        }
    }
    write_atomic(path, format!("{text}{}", camera.to_toml()).as_bytes())
}

/// A camera of pictures of a size, px, of which nothing else is known.
pub(super) fn placeholder(path: &Path, size_px: [usize; 2]) -> CameraFile {
    let [width, height] = size_px.map(|side| side as u32);
    let (fx, cx, cy) = (f64::from(width), 0.5 * f64::from(width), 0.5 * f64::from(height));
    CameraFile::pinhole(path.to_owned(), Intrinsics { width, height, fx, fy: fx, cx, cy }, 1.0 / 30.0)
}

/// A share; what is none was not compared.
fn in_percent(share: f64) -> String {
    if share.is_finite() { format!("{:.1} %", 100.0 * share) } else { "not compared".to_owned() }
}

/// What was found, a few lines.
fn summary(c: &Calibration) -> String {
    let percent = |v: [f64; 3]| v.map(in_percent).join("  ");
    let mut text = format!("{}\n", c.frames.join(" "));
    for k in 0..3 {
        let n = &c.real.neighbours[k];
        let s = &c.simulated.neighbours[k];
        let full_well = c.real.fits[k].as_ref().map_or("-".to_owned(), |f| {
            let e = &f.full_well_e;
            format!(
                "{:.0} e- [{:.0}, {:.0}]{}",
                e.value,
                e.ci95[0],
                e.ci95[1],
                if f.linear { "" } else { " (no line)" }
            )
        });
        text += &format!(
            "  {}  full well {full_well}  neighbours h {:.2} v {:.2} d {:.2} (simulated {:.2} {:.2} {:.2})\n",
            ["R", "G", "B"][k],
            n.horizontal,
            n.vertical,
            n.diagonal,
            s.horizontal,
            s.vertical,
            s.diagonal
        );
    }
    text += &format!(
        "  simulated against real variance, mean deviation over pixels  {}\n",
        percent(c.comparison.mean_deviation)
    );
    text += &format!("  pixels in bins within 10 %  {}\n", percent(c.comparison.within_10_percent));
    text += &format!("  or within chance  {}\n", percent(c.comparison.within_10_percent_or_chance));
    if let Some(held_out) = &c.comparison_held_out {
        text += &format!("  on blocks without fit: mean deviation  {}\n", percent(held_out.mean_deviation));
        text += &format!("  on blocks without fit: within 10 %  {}\n", percent(held_out.within_10_percent));
        text += &format!("  or within chance  {}\n", percent(held_out.within_10_percent_or_chance));
    }
    if c.camera.bayer {
        text += &format!(
            "  camera.toml in the chain: mean deviation  {}\n",
            percent(c.comparison_chain.mean_deviation)
        );
        let [r, g, b] = c.comparison_chain.correlation_error;
        text += &format!("  camera.toml in the chain: correlation off by  {r:.2}  {g:.2}  {b:.2}\n");
    }
    for note in &c.notes {
        text += &format!("  note: {note}\n");
    }
    text
}
