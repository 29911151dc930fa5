//! Makes one capture: scene, motion, times, the nominal camera, and the frames of the TRUE camera by the CPU oracle.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::draw::Draw;
use super::falsify::{Falsified, falsify};
use super::hidden::Hidden;
use super::{WithholdOptions, motion, room};
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{Intrinsics, Lens, ShutterTiming, Trajectory};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::chain::{Settings, Value, View};
use shutterbug::effects::{self, ChromaticAberration, LensDistortion};
use shutterbug::error::{Error, Result};
use shutterbug::plane::{Plane, write_atomic, write_png_atomic};
use shutterbug::reference::lens::LensGrid;
use shutterbug::reference::{accumulate, chain};
use shutterbug::scene::load_obj;

/// Frame period of the made cameras, s.
const FRAME_PERIOD_S: f64 = 1.0 / 30.0;
/// Motion before the first and after the last frame, s: a time offset is looked for there.
const MARGIN_S: f64 = 0.3;
/// Motion between two renders, px. What lies between them is taken to be linear in time, which blurs a little more.
const STEP_PX: f64 = 0.2;
/// Most renders of a frame.
const MOST_RENDERS: u32 = 400;
/// Fewest renders of an exposure: n steps make it look longer by 1 / n^2 (with steps of 0.5 px, 3 to 9 of them, the
/// hidden exposures were 1 to 9 % longer than they said).
const LEAST_RENDERS: u32 = 25;
/// Timestamp of the first frame, s.
const START_S: f64 = 10.0;

/// A case before its frames are rendered.
pub(super) struct Case {
    pub(super) index: usize,
    pub(super) hidden: Hidden,
    pub(super) motion: String,
    /// What of the description is not right.
    falsified: Vec<Falsified>,
    described_lit: bool,
    capture: Capture,
    noise_seed: u64,
}

impl Case {
    /// Draws the case and writes everything but its frames into `folder`. `plain`: the nominal camera models no effect.
    /// `hide` chooses what is hidden beside what the nominal camera models.
    ///
    /// # Errors
    /// Files that cannot be written, recordings that cannot be read.
    pub(super) fn make(
        options: &WithholdOptions,
        index: usize,
        folder: &Path,
        plain: bool,
        hide: &dyn Fn(&CameraFile) -> Result<Hidden>,
    ) -> Result<Self> {
        let stream = |purpose: &str| Draw::new(options.seed, index, purpose);
        for made in [folder.to_owned(), folder.join("objects"), folder.join("real")] {
            fs::create_dir_all(&made).map_err(|e| Error::io(&made, "create the folder", e))?;
        }
        let mut room = room::write(folder, &mut stream("scene"))?;
        let lamps = options.falsified.contains(&Falsified::Lamps);
        if lamps && !room.lit {
            write_atomic(&folder.join("lights.toml"), room::lights(&mut stream("lamps")).as_bytes())?;
            room.lit = true;
        }
        let mut draw = stream("camera");
        let frames = options.frames.unwrap_or_else(|| 10 + draw.index(7));
        let mut camera = camera(options, &mut draw, room.lit, folder);
        if plain {
            camera.settings = Settings::default();
        }
        let duration_s = 2.0 * MARGIN_S + (frames + 2) as f64 * FRAME_PERIOD_S;
        let motion = motion::Motion::draw(&mut stream("motion"), &options.recordings, duration_s)?;
        let from_s = START_S - MARGIN_S;
        write_atomic(&folder.join("trajectory.tum"), motion.tum(from_s).as_bytes())?;
        for mover in &room.movers {
            let path = folder.join("objects").join(format!("{}.tum", mover.name));
            write_atomic(&path, motion::object_tum(mover, from_s, duration_s).as_bytes())?;
        }
        let mut csv = String::from("#timestamp [ns],filename\n");
        for frame in 0..frames {
            let stamp_ns = ((START_S + frame as f64 * FRAME_PERIOD_S) * 1e9).round() as i64;
            csv += &format!("{stamp_ns},{frame:06}.png\n");
        }
        write_atomic(&folder.join("frames.csv"), csv.as_bytes())?;
        write_atomic(&folder.join("camera.toml"), camera.to_toml().as_bytes())?;
        let hidden = hide(&camera)?;
        // What a stranger would read, but with the true camera; its file is written only when the answer is opened.
        let nominal = Capture::read(folder, None)?;
        let truth = CameraFile { settings: hidden.settings.clone(), ..nominal.camera };
        let scene = load_scene(folder, &nominal.scene.shading)?;
        let capture = Capture::with_scene(folder, truth, scene)?;
        // From here on the folder is what a diagnosis is told.
        falsify(folder, &options.falsified, &mut stream("falsified"))?;
        let described_lit = room.lit && !lamps;
        if lamps {
            camera.lit = false;
            write_atomic(&folder.join("camera.toml"), camera.to_toml().as_bytes())?;
        }
        let falsified = options.falsified.clone();
        let noise_seed = stream("noise").bits();
        Ok(Self { index, hidden, motion: motion.name, falsified, described_lit, capture, noise_seed })
    }

    /// Renders the frames of the true camera: the accumulation reference, then the CPU chain.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(super) fn render(&self, stop: &dyn Fn() -> bool) -> Result<()> {
        let capture = &self.capture;
        let (intrinsics, trajectory) = (capture.true_intrinsics(), capture.true_trajectory());
        for (frame, entry) in capture.frames.iter().enumerate() {
            let path = capture.root.join("real").join(&entry.filename);
            if path.is_file() {
                continue;
            }
            if stop() {
                return Err(Error::Interrupted { done: frame, total: capture.frames.len() });
            }
            let shutter = capture.shutter(frame);
            let speed =
                accumulate::largest_speed_px_per_s(&capture.scene, &trajectory, &intrinsics, &shutter);
            let renders = AccumulationPlan::auto_renders(&shutter, speed, STEP_PX, MOST_RENDERS);
            let least = if shutter.exposure_time_s > 0.0 { LEAST_RENDERS } else { 1 };
            let renders = renders.max(least);
            let plan = AccumulationPlan::new(&shutter, renders);
            // Where many renders are averaged, four samples each are more than sixteen of a single one.
            let blurred = shutter.exposure_time_s > 0.0 && plan.instants.len() >= 8;
            let samples = sample_positions(if blurred { 4 } else { 16 });
            let radiance = self.radiance(&trajectory, &shutter, &plan, &samples)?;
            let view = View { intrinsics, shutter, frame: frame as u32, seed: self.noise_seed };
            let picture = chain::picture(effects::LIST, &capture.camera.settings, &view, &radiance);
            write_png_atomic(&path, &picture)?;
        }
        Ok(())
    }

    /// What falls on the sensor, each colour drawn in its own size.
    fn radiance(
        &self,
        trajectory: &Trajectory,
        shutter: &ShutterTiming,
        plan: &AccumulationPlan,
        samples: &[[f32; 2]],
    ) -> Result<Plane<f32>> {
        let (scene, settings) = (&self.capture.scene, &self.capture.camera.settings);
        let intrinsics = self.capture.true_intrinsics();
        let scales = ChromaticAberration::scales(settings);
        let distortion = LensDistortion::distortion(settings);
        if distortion.is_identity() && scales == [1.0; 3] {
            return Ok(accumulate::render_frame(scene, trajectory, &intrinsics, shutter, plan, samples));
        }
        let lens = Lens::new(intrinsics, distortion)?;
        let through = |scale: f64| {
            let grid = LensGrid::new(&lens, samples, scale);
            accumulate::render_frame_through(scene, trajectory, &intrinsics, shutter, plan, &grid)
        };
        let mut seen = through(1.0);
        for channel in [0, 2].into_iter().filter(|&c| scales[c] != 1.0) {
            let colour = through(scales[channel]);
            let pixels = seen.data.chunks_exact_mut(4).zip(colour.data.chunks_exact(4));
            pixels.for_each(|(to, from)| to[channel] = from[channel]);
        }
        Ok(seen)
    }

    /// The answer, as it is sealed.
    pub(super) fn answer(&self) -> String {
        let effect = |name: &&'static str| {
            let table = self.hidden.settings.iter().find(|(n, _)| n == name).map(|(_, t)| t);
            let mut entry = serde_json::Map::new();
            entry.insert("name".to_owned(), json!(name));
            for (parameter, value) in table.into_iter().flatten() {
                let value = match value {
                    Value::Number(n) => json!(n),
                    Value::Choice(c) => json!(c),
                    Value::Vector3(v) => json!(v),
                };
                entry.insert((*parameter).to_owned(), value);
            }
            serde_json::Value::Object(entry)
        };
        let effects: Vec<_> = self.hidden.names.iter().map(effect).collect();
        // The noise seed is no one's guess: without it a hash of few possible answers could be searched.
        let answer = json!({
            "case": self.index, "kind": self.hidden.kind, "effects": effects, "imperfect": self.falsified,
            "noise_seed": self.noise_seed,
        });
        serde_json::to_string_pretty(&answer).expect("strings and numbers serialize") + "\n"
    }

    /// Writes the true camera's `camera.toml`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn write_true_camera(&self, path: &Path) -> Result<()> {
        let camera = CameraFile { lit: self.described_lit, ..self.capture.camera.clone() };
        write_atomic(path, camera.to_toml().as_bytes())
    }
}

fn load_scene(folder: &Path, shading: &shutterbug::scene::Shading) -> Result<shutterbug::scene::Scene> {
    let mut scene = load_obj(&folder.join("scene.obj"), folder)?;
    scene.shading = shading.clone();
    Ok(scene)
}

/// A nominal camera; some model a little noise of their own, so that the noise floor varies.
fn camera(options: &WithholdOptions, draw: &mut Draw, lit: bool, folder: &Path) -> CameraFile {
    let [width, height] = options.size_px;
    let focal = f64::from(width) * draw.between(0.7, 1.1);
    let off = |draw: &mut Draw, side: u32| f64::from(side) * (0.5 + draw.between(-0.01, 0.01));
    let intrinsics = Intrinsics {
        width,
        height,
        fx: focal,
        fy: focal * draw.between(0.995, 1.005),
        cx: off(draw, width),
        cy: off(draw, height),
    };
    let mut settings = Settings::default();
    if draw.chance(0.25)
        && let Some(effect) = effects::by_id("read_noise")
    {
        let sigma = Value::Number(draw.log_between(0.002, 0.01));
        settings.set(effect, "sigma", sigma).expect("in the range of every noise");
    }
    let pinhole = CameraFile::pinhole(PathBuf::from(folder).join("camera.toml"), intrinsics, FRAME_PERIOD_S);
    CameraFile { lit, settings, ..pinhole }
}
