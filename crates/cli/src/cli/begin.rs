//! The start of `simulate`: finds the frames that are still missing, and writes the files that come before the first
//! frame.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::args::{PlaneName, Simulate};
use shutterbug::capture::Capture;
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read_if_there};
use shutterbug::plane::write_atomic;
use shutterbug_diagnose::out::{Out, recorded_reads};

/// Name of a frame without extension, as `frames.csv` has it: results lie under the real frames' names.
pub(super) fn stem(capture: &Capture, frame: usize) -> String {
    let name = Path::new(&capture.frames[frame].filename);
    name.file_stem().map_or_else(|| format!("{frame:06}"), |s| s.to_string_lossy().into_owned())
}

/// What is written when a run begins, which is when its first frame is there.
pub(super) struct Begin<'a> {
    out: &'a Out,
    folder: &'a Path,
    goes_on: bool,
    simulate_json: String,
    instants_csv: String,
    begun: Once,
}

impl<'a> Begin<'a> {
    /// Decides which frames are to be rendered: all, or with `--resume` those that are not there as they were made,
    /// provided that those that are come from the same run.
    pub(super) fn new(args: &'a Simulate, capture: &Capture, out: &'a Out) -> Result<(Vec<usize>, Self)> {
        let path = args.out.join("simulate.json");
        let simulate_json = simulate_json(args);
        let before = if args.resume { read_if_there(&path, Limit::OWN)? } else { None };
        let all = 0..capture.frames.len();
        let there = |f: &usize| args.out.join(format!("{}.png", stem(capture, *f))).is_file();
        if args.resume && before.is_none() && all.clone().any(|f| there(&f)) {
            let found = "frames without a simulate.json beside them";
            let expected = "the folder of an interrupted run, as --resume was given";
            return Err(Error::input(&args.out, None, found, expected));
        }
        if before.as_ref().is_some_and(|b| *b != simulate_json.as_bytes()) {
            let found = "frames of a run with other input or options";
            let expected = "the same as now; use another --out, or leave out --resume";
            return Err(Error::input(&path, None, found, expected));
        }
        let whole = |f: &usize| files_of(args, &stem(capture, *f)).iter().all(|name| out.has(name));
        let todo = all.filter(|f| before.is_none() || !whole(f)).collect();
        let instants_csv = instants_csv(capture);
        let goes_on = before.is_some();
        let begun = Once::default();
        Ok((todo, Self { out, folder: &args.out, goes_on, simulate_json, instants_csv, begun }))
    }

    /// Does so, the first time. What an earlier run made goes, unless this one goes on with it.
    pub(super) fn run(&self) -> Result<()> {
        if self.begun.replace() {
            return Ok(());
        }
        if self.goes_on {
            self.out.go_on()?
        } else {
            self.out.start_together()?
        }
        write_atomic(&self.folder.join("simulate.json"), self.simulate_json.as_bytes())?;
        write_atomic(&self.folder.join("instants.csv"), self.instants_csv.as_bytes())
    }

    /// The first frame is complete: it takes the place of what an earlier run made.
    pub(super) fn appear(&self) -> Result<()> {
        self.out.appear()
    }
}

/// Whether something was done.
#[derive(Default)]
struct Once(AtomicBool);

impl Once {
    /// Notes that it is done; whether it was before.
    fn replace(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }
}

/// The files of a frame, below the folder.
fn files_of(args: &Simulate, stem: &str) -> Vec<String> {
    let planes = args.planes.iter().map(|p| format!("{}/{stem}.exr", plane_folder(*p)));
    planes.chain([format!("{stem}.png")]).collect()
}

/// Folder of a plane, below the output.
pub(super) fn plane_folder(plane: PlaneName) -> &'static str {
    match plane {
        PlaneName::Color => "color",
        PlaneName::Motion => "motion",
        PlaneName::Depth => "depth",
    }
}

/// Everything that decides how the frames look, as JSON: the options, and every file that was read, by its hash.
fn simulate_json(args: &Simulate) -> String {
    let files: serde_json::Map<_, _> =
        recorded_reads().into_iter().map(|(path, hash)| (path.display().to_string(), hash.into())).collect();
    let planes: Vec<_> = args.planes.iter().map(|p| plane_folder(*p)).collect();
    let value = serde_json::json!({
        "shutterbug": env!("CARGO_PKG_VERSION"),
        "method": format!("{:?}", args.engine_method()),
        "samples": args.samples,
        "preset": args.preset,
        "seed": args.seed,
        "planes": planes,
        "files_sha256": files,
    });
    serde_json::to_string_pretty(&value).expect("strings and numbers serialize") + "\n"
}

/// When each frame was taken: start of the first line's exposure, middle, end of the last line's, and the camera's
/// pose at the middle.
fn instants_csv(capture: &Capture) -> String {
    let mut text = String::from(
        "#frame,first_line_start [ns],middle [ns],last_line_end [ns],middle_tx [m],ty,tz,qx,qy,qz,qw\n",
    );
    for frame in 0..capture.frames.len() {
        let shutter = capture.shutter(frame);
        let ns = |time_s: f64| capture.epoch_ns + (time_s * 1e9).round() as i64;
        let pose = capture.world_from_camera(frame, shutter.middle_s());
        let (t, q) = (pose.translation_m, pose.rotation);
        text += &format!(
            "{},{},{},{},{:.9},{:.9},{:.9},{:.12},{:.12},{:.12},{:.12}\n",
            stem(capture, frame),
            capture.frames[frame].timestamp_ns,
            ns(shutter.middle_s()),
            ns(shutter.end_s()),
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w,
        );
    }
    text
}
