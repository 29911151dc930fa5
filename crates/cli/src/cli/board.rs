//! `shutterbug board FRAMES --out CAPTURE`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec3;

use super::args_board::{Board, PatternName};
use super::interrupt::Interrupt;
use super::terminal::{print, say};
use crate::formats::{KalibrTarget, read_target};
use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug_diagnose::board::{
    BoardFit, Observed, Picture, Real, Seen, Source, Target, Timing, fit_board, measure_tone, observe,
    pictures, read_corners, times_of, write_capture,
};
use shutterbug_diagnose::out::{Out, OutRules};

/// Time between two lines of progress.
const LOG_INTERVAL: Duration = Duration::from_secs(2);
/// What `--tag-spacing`, `--marker-share` and `--dictionary` are without being given.
const TAG_SPACING: f64 = 0.3;
const MARKER_SHARE: f64 = 0.75;
const DICTIONARY: &str = "DICT_5X5_100";
/// Memory of a diagnosis for each pixel of each frame, bytes: measured on 17 frames of 1280x960 px (docs/board.md).
const BYTES_OF_A_PIXEL: usize = 250;
/// From so much on it is worth a word: what small machines have.
const LARGE_DIAGNOSIS_GB: f64 = 8.0;
/// Largest side of a square or tag that boards are made with; without a length it is the unit, which this is, too.
const LARGEST_SQUARE_M: f64 = 1.0;
/// Most pictures without a board that an error names.
const MAX_NAMED: usize = 5;

/// Runs the command.
pub fn run(args: &Board) -> Result<()> {
    let pictures = pictures(&args.frames)?;
    let times_ns = times_of(&args.frames, pictures.len(), args.fps)?;
    let table = args.corners.as_deref().map(read_corners).transpose()?;
    let target = target(args, table.as_ref())?;
    let inputs: Vec<&Path> = args.frames.iter().map(PathBuf::as_path).collect();
    let rules = OutRules { command: "board", inputs: &inputs, overwrite: args.overwrite, goes_on: false };
    let out = Out::open(&args.out, &rules)?;
    let source = match (&table, &args.corners) {
        (Some(table), Some(path)) => Source::Table(table, path),
        _ => Source::Pictures,
    };
    let observed = observed(&pictures, &target, source, times_ns.is_some())?;
    let timing = match &times_ns {
        Some(all) => Timing::Frames(all.iter().map(|t| (t - all[0]) as f64 * 1e-9).collect()),
        None => Timing::Stills,
    };
    let fit = fit_board(&target, &observed.views, observed.size, &timing, &args.frames[0])
        .map_err(|e| with_left_out(e, &observed))?;
    let tone = measure_tone(&pictures, &target, &observed.views, &fit, observed.even_is_dark)?;
    out.start()?;
    let real = Real { times_ns: times_ns.as_deref(), shrink: args.shrink };
    let written = write_capture(&args.out, &pictures, &target, &observed, &fit, &tone, real)?;
    let doubts = doubt_of_unit(&target, &fit) + &doubts(&pictures, &observed, &fit);
    print(summary(&pictures, &observed, &fit, times_ns.is_some()) + &doubts)?;
    if written.cut_px != [0; 2] {
        let [across, down] = written.cut_px;
        say(format_args!(
            "the frames lack {} and {} on each side: no ray of the fitted lens reaches the \
             corners there",
            counted(across as usize, "column", "columns"),
            counted(down as usize, "row", "rows")
        ));
    }
    out.check_same()?;
    let to = args.out.display();
    say(format_args!(
        "{} written to {to}: `shutterbug diagnose` names what the pinhole lacks",
        counted(written.frames, "frame", "frames")
    ));
    let pixels = observed.size.iter().map(|s| *s as usize / args.shrink).product::<usize>() * written.frames;
    let needed_gb = (pixels * BYTES_OF_A_PIXEL) as f64 / 1e9;
    if needed_gb > LARGE_DIAGNOSIS_GB {
        say(format_args!(
            "`diagnose` takes about {needed_gb:.0} GB for frames of this size; --shrink 2 or more writes smaller ones"
        ));
    }
    Ok(())
}

/// Looks at the pictures, and says how far it is; `near`: they follow each other in time.
fn observed(pictures: &[Picture], target: &Target, source: Source<'_>, near: bool) -> Result<Observed> {
    let (mut said, interrupt) = (Instant::now(), Interrupt::listen());
    let mut watch = |done: usize| {
        if interrupt.requested() {
            return Err(Error::Stopped { done, total: pictures.len() });
        }
        if said.elapsed() >= LOG_INTERVAL {
            said = Instant::now();
            say(format_args!("looking for the board: {done} of {} pictures", pictures.len()));
        }
        Ok(())
    };
    // What detectors warn of is said here, of each picture that is left out.
    let quiet = tracing::subscriber::NoSubscriber::default();
    tracing::subscriber::with_default(quiet, || observe(pictures, target, source, near, &mut watch))
}

fn target(args: &Board, table: Option<&BTreeMap<String, Vec<Seen>>>) -> Result<Target> {
    if let Some(path) = &args.target {
        return match read_target(path)? {
            KalibrTarget::Checkerboard { inner_corners, square_m } => {
                Ok(Target::checkerboard(inner_corners, square_m))
            }
            KalibrTarget::Aprilgrid { tags, side_m, spacing } => aprilgrid(path, tags, side_m, spacing),
        };
    }
    let last = |axis: usize| table.and_then(|t| t.values().flatten().map(|s| s.point[axis] + 1).max());
    let usage = |found: String, expected: &str| Error::input(Path::new("--pattern"), None, found, expected);
    match args.pattern {
        PatternName::Checkerboard => {
            let size = args.size.or_else(|| Some([last(0)?, last(1)?]));
            let expected = "--size COLUMNSxROWS, the inner corners of the board, or --target";
            let size = size.ok_or_else(|| usage("no --size".to_owned(), expected))?;
            Ok(Target::checkerboard(size, [args.square_m; 2]))
        }
        PatternName::Aprilgrid => {
            let expected = "--size COLUMNSxROWS, the tags of the board, or --target";
            let size = args.size.ok_or_else(|| usage("no --size".to_owned(), expected))?;
            aprilgrid(Path::new("--size"), size, args.square_m, args.tag_spacing.unwrap_or(TAG_SPACING))
        }
        PatternName::Charuco => {
            let expected = "--size COLUMNSxROWS, the squares of the board";
            let size = args.size.ok_or_else(|| usage("no --size".to_owned(), expected))?;
            let expected = "a dictionary of OpenCV with a marker for every bright square, as DICT_5X5_100";
            let (share, name) = (args.marker_share.unwrap_or(MARKER_SHARE), args.dictionary.as_deref());
            let name = name.unwrap_or(DICTIONARY);
            Target::charuco(size, args.square_m, share, name).ok_or_else(|| {
                let found = format!("the dictionary `{name}`");
                Error::input(Path::new("--dictionary"), None, found, expected)
            })
        }
    }
}

/// A grid of tags; `said` is what errors name.
fn aprilgrid(said: &Path, tags: [usize; 2], side_m: f64, spacing: f64) -> Result<Target> {
    Target::aprilgrid(tags, side_m, spacing).ok_or_else(|| {
        let found = format!("{}x{} tags", tags[0], tags[1]);
        Error::input(said, None, found, "at most as many as the family t36h11 has: 587")
    })
}

/// An error that tells what the pictures show in place of the board.
fn with_left_out(error: Error, observed: &Observed) -> Error {
    let Error::Input { path, line, found, expected } = error else { return error };
    let all = &observed.left_out;
    if all.is_empty() {
        return Error::Input { path, line, found, expected };
    }
    let named: Vec<String> = all.iter().take(MAX_NAMED).map(|l| format!("{}: {}", l.name, l.why)).collect();
    let more =
        if all.len() > MAX_NAMED { format!("; and {} more", all.len() - MAX_NAMED) } else { String::new() };
    Error::Input { path, line, found: format!("{found} ({}{more})", named.join("; ")), expected }
}

/// What was found, a few lines.
fn summary(pictures: &[Picture], observed: &Observed, fit: &BoardFit, moving: bool) -> String {
    let points: usize = observed.views.iter().map(|v| v.seen.len()).sum();
    let mut text = format!(
        "board in {} of {}, {}\n",
        observed.views.len(),
        counted(pictures.len(), "picture", "pictures"),
        counted(points, "point", "points")
    );
    for left_out in &observed.left_out {
        text += &format!("  left out: {}: {}\n", one_line(&left_out.name), left_out.why);
    }
    let with = if moving { "with lens and readout" } else { "with lens" };
    let [pinhole, whole] = fit.rms_px;
    text += &format!("points are off by {pinhole:.3} px rms with a pinhole alone, by {whole:.3} px {with}\n");
    for (name, half) in &fit.half {
        text += &format!(
            "  {name:<18} {} +- {} (95 %)\n",
            figures(fit.camera.get(name), *half),
            figures(*half, *half)
        );
    }
    for (view, rms) in observed.views.iter().zip(&fit.view_rms_px) {
        let name = one_line(&pictures[view.picture].name);
        text += &format!("  {name:<24} {:>4} points  {rms:.3} px\n", view.seen.len());
    }
    text
}

/// Pictures tell a board's size but for a factor: one that nobody prints is in another unit.
fn doubt_of_unit(target: &Target, fit: &BoardFit) -> String {
    let side_m = target.square_m[0].max(target.square_m[1]);
    if side_m <= LARGEST_SQUARE_M {
        return String::new();
    }
    let away = fit.poses.iter().map(|pose| pose.transform(DVec3::ZERO).length());
    let [near, far] = away.fold([f64::INFINITY, 0.0], |[near, far], m| [near.min(m), f64::max(far, m)]);
    format!(
        "WARNING: a side of {side_m} m, of a board that is {near:.0} to {far:.0} m away; expected at most \
         {LARGEST_SQUARE_M} m: is it in mm? All lengths of the capture are in its unit\n"
    )
}

/// What speaks against one camera with one lens and one board.
fn doubts(pictures: &[Picture], observed: &Observed, fit: &BoardFit) -> String {
    let of_camera = fit.camera.intrinsics().doubts();
    let mut text: String =
        of_camera.iter().map(|d| format!("WARNING: {d} (or the board is another)\n")).collect();
    text += &outliers(pictures, observed, fit);
    let Some(of) = &fit.one_camera else { return text };
    let own = &of.own_focal;
    if !own.is_empty() {
        let name = |v: usize| one_line(&pictures[observed.views[v].picture].name);
        let named: Vec<String> =
            own.iter().take(MAX_NAMED).map(|(v, times)| format!("{} {times:.3}", name(*v))).collect();
        let more = if own.len() > MAX_NAMED { ", ..." } else { "" };
        text += &format!(
            "WARNING: {} of {} for a focal length of their own, beyond what chance does once in a hundred \
             times ({}{more} times the common one): another camera, zoom, focus or cut. The camera above is none of \
             theirs\n",
            own.len(),
            counted(observed.views.len(), "picture asks", "pictures ask"),
            named.join(", ")
        );
    }
    if of.is_misfit() {
        text += &format!(
            "WARNING: neighbouring points share {:.0} % of what they are off by, which is not how well corners are \
             found: pictures that were changed, several cameras, a board that is bent, or a lens this is no model of\n",
            100.0 * of.shared
        );
    }
    text
}

/// Pictures whose points are off by far more than the others': beyond the upper quartile by three times the distance of
/// the quartiles (Tukey's far out), of the logarithms.
fn outliers(pictures: &[Picture], observed: &Observed, fit: &BoardFit) -> String {
    let logs: Vec<f64> = fit.view_rms_px.iter().map(|rms| rms.max(1e-6).ln()).collect();
    let mut sorted = logs.clone();
    sorted.sort_by(f64::total_cmp);
    let [lower, middle, upper] = [1, 2, 3].map(|k| sorted[(sorted.len() - 1) * k / 4]);
    let far: Vec<String> = logs
        .iter()
        .enumerate()
        .filter(|(_, log)| **log > upper + 3.0 * (upper - lower).max(std::f64::consts::LN_2 / 3.0))
        .map(|(v, log)| {
            let name = one_line(&pictures[observed.views[v].picture].name);
            format!("{name} by {:.2} px", log.exp())
        })
        .collect();
    if far.is_empty() {
        return String::new();
    }
    let more = if far.len() > MAX_NAMED { ", ..." } else { "" };
    format!(
        "WARNING: points are off in {}{more}, and by {:.2} px in the middle one of the pictures: a reflection, a \
         board that moved or bent, or corners in wrong places. Leave such pictures out\n",
        far[..far.len().min(MAX_NAMED)].join(", "),
        middle.exp()
    )
}

/// A number to two figures of its uncertainty.
fn figures(value: f64, half: f64) -> String {
    let digits = if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 12.0) as usize } else { 6 };
    format!("{value:.digits$}")
}
