//! `shutterbug calibrate noise A B ... --out DIR`.

use std::fs;
use std::path::{Path, PathBuf};

use super::args::{CalibrateNoise, EncodingName};
use crate::calibrate::{
    Calibration, Encoding, Frame, NoiseOptions, Table, calibrate_noise, camera_tables, chart, figure,
    paper_tables, to_toml,
};
use crate::capture::CameraFile;
use crate::error::{Error, Result};
use crate::plane::{write_atomic, write_png_atomic};

/// Runs the command.
pub fn run(args: &CalibrateNoise) -> Result<()> {
    let base = args.camera.as_deref().map(CameraFile::read).transpose()?;
    let frames: Vec<Frame> = args.frames.iter().map(|p| Frame::read(p)).collect::<Result<_>>()?;
    let options = NoiseOptions {
        encoding: match args.encoding {
            EncodingName::Srgb => Encoding::Srgb,
            EncodingName::Linear => Encoding::Linear,
        },
        seed: args.seed,
    };
    if !args.pairs {
        let done = calibrate_noise(&frames, options)?;
        write(&args.out, &done, base.as_ref())?;
        print!("{}", summary(&done));
        return Ok(());
    }
    if frames.len() % 2 == 1 {
        let last = frames.last().map_or(Path::new(""), |f| &f.path);
        return Err(Error::input(last, None, "an odd number of frames", "pairs: A B, C D, ... with --pairs"));
    }
    for (k, pair) in frames.chunks_exact(2).enumerate() {
        let done = calibrate_noise(pair, options)?;
        let folder = args.out.join(format!("pair_{k:02}"));
        write(&folder, &done, base.as_ref())?;
        print!("{}", summary(&done));
    }
    Ok(())
}

fn write(out: &Path, done: &Calibration, base: Option<&CameraFile>) -> Result<()> {
    fs::create_dir_all(out).map_err(|e| Error::io(out, "create the folder", e))?;
    write_png_atomic(&out.join("noise.png"), &figure::figure(done)?)?;
    write_png_atomic(&out.join("ptc.png"), &chart::photon_transfer(done)?)?;
    let missing = write_camera(&out.join("camera.toml"), &camera_tables(&done.camera), done, base)?;
    write_camera(&out.join("camera_paper.toml"), &paper_tables(done), done, base)?;
    if !missing.is_empty() {
        tracing::warn!(
            "camera.toml holds as comments what this build has no effect for: {}",
            missing.join(", ")
        );
    }
    let json = serde_json::to_string_pretty(done).expect("a report of numbers and names");
    write_atomic(&out.join("report.json"), json.as_bytes())
}

/// The camera without the effects that the tables replace, then the tables.
fn write_camera(
    path: &PathBuf,
    tables: &[Table],
    done: &Calibration,
    base: Option<&CameraFile>,
) -> Result<Vec<String>> {
    let head = match base {
        Some(base) => {
            let mut kept = base.clone();
            let noise = camera_tables(&done.camera).into_iter().chain(paper_tables(done));
            noise.for_each(|t| kept.settings.disable(t.effect));
            kept.to_toml()
        }
        None => {
            let (w, h) = (done.pictures.real.width, done.pictures.real.height);
            let (cx, cy) = (w as f64 / 2.0, h as f64 / 2.0);
            format!(
                "# Size of the frames; focal length and frame period are placeholders (give --camera FILE for yours).\n\
                 width = {w}\nheight = {h}\nfx = {w}.0\nfy = {w}.0\ncx = {cx:?}\ncy = {cy:?}\n\
                 frame_period_s = 0.033333333\n"
            )
        }
    };
    let (text, missing) = to_toml(tables);
    let from = done.frames.join(", ");
    let notes: String = done.notes.iter().map(|n| format!("# {n}\n")).collect();
    write_atomic(path, format!("{head}\n# Noise measured from {from}.\n{notes}{text}").as_bytes())?;
    Ok(missing)
}

/// What was found, a few lines.
fn summary(c: &Calibration) -> String {
    let percent = |v: [f64; 3]| v.map(|v| format!("{:.1} %", 100.0 * v)).join("  ");
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
    for note in &c.notes {
        text += &format!("  note: {note}\n");
    }
    text
}
