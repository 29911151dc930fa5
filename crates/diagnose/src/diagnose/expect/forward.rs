//! From parameters to simulated frames. Everything about geometry (time, pose, focal length, lens) is a render, and is
//! kept; the rest is pointwise or a small filter, on the CPU.

use std::sync::{Arc, Mutex};
use std::time::Instant;

use glam::{DQuat, DVec3};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::bench::{Bench, Engines, Key, in_flight, options};
use super::description::Known;
use super::journal::Journal;
use super::model::{P, Theta};
use super::pair::{Outside, SimFrames};
use super::settings::lens;
use super::sharp::Sharp;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::budget::{Budget, Budgeted};
use crate::diagnose::evidence::quality::Quality;
use shutterbug::camera::{Intrinsics, ShutterTiming, Trajectory};
use shutterbug::capture::Capture;
use shutterbug::engine::{Engine, EngineOptions, FrameRequest};
use shutterbug::error::Result;
use shutterbug::gpu::Context;
use shutterbug::plane::Plane;
use shutterbug::scene::Scene;

/// Most bytes of renders that are kept.
const CACHE_BYTES: usize = 512 << 20;
/// Half of the interval over which speeds are measured, s.
const SPEED_STEP_S: f64 = 2e-3;

/// Renders the frames of a capture for any parameters.
pub(crate) struct Forward {
    /// Of both benches.
    pub(crate) engines: Engines,
    pub(crate) bench: Bench,
    /// The other bench: while something is tried, the one that waits; else the one for what is tried.
    pub(crate) aside: Bench,
    /// Whether something is tried.
    pub(crate) trying: bool,
    /// Renders; frames of another simulator need none.
    pub(crate) context: Option<Arc<Context>>,
    /// The frames of another simulator, in the place of a scene.
    pub(crate) outside: Option<Arc<Outside>>,
    /// Whether the engine draws through a lens, as in what is reported; else fits' quicker way is taken.
    pub(crate) native: bool,
    pub(crate) scene: Arc<Scene>,
    pub(crate) trajectory: Arc<Trajectory>,
    pub(crate) static_camera: bool,
    /// The camera as given.
    pub(crate) intrinsics: Intrinsics,
    /// From one frame to the next, s.
    pub(crate) period_s: f64,
    /// By place in [`Evidence::frames`].
    pub(crate) starts_s: Vec<f64>,
    pub(crate) reach_s: [f64; 2],
    /// Light of each frame by place: 1, unless photographs of a camera at rest were lit differently.
    pub(crate) light: Vec<f64>,
    /// Sharp planes by place.
    pub(crate) sharp: Vec<Sharp>,
    /// Pixels that are stuck.
    pub(crate) stuck: Arc<Vec<usize>>,
    /// How much time there is.
    pub(crate) budget: Budget,
    /// Renders made so far, and the time they took, s.
    pub(crate) renders: (usize, f64),
    /// What has been worked out about the description.
    pub(crate) description: Known,
    /// How often where frames are compared has been changed: results of before are others.
    pub(crate) compared: u32,
    /// What has been worked out.
    pub(crate) journal: Arc<Mutex<Journal>>,
    /// Side of the squares of the camera's pixels whose means are compared, px.
    pub(crate) pooled: usize,
    /// The same frames with fewer pixels, where these are many.
    pub(crate) reduced: Option<Box<Reduced>>,
}

/// The frames of a capture with fewer pixels.
pub(crate) struct Reduced {
    pub forward: Forward,
    pub evidence: Evidence,
    /// By place; 1 where compared.
    pub masks: Vec<Plane<f32>>,
}

/// What stands for the margin in the key of a picture that is read through a lens.
const READ: u64 = u64::MAX;

/// Parameters of the lens.
const LENS: [P; 5] = [P::K1, P::K2, P::P1, P::P2, P::K3];
/// All that a render depends on besides its times: set-up and lens.
const GEOMETRY: [P; 9] = [P::RotX, P::RotY, P::RotZ, P::Focal, P::K1, P::K2, P::P1, P::P2, P::K3];

impl Budgeted for Forward {
    fn budget(&mut self) -> &mut Budget {
        &mut self.budget
    }
}

impl Forward {
    /// With `sim` its frames are read; else the scene of the capture is rendered, which needs a device.
    pub(crate) fn new(
        context: Option<&Arc<Context>>,
        capture: &Capture,
        evidence: &Evidence,
        sim: Option<&Arc<SimFrames>>,
        budget: Budget,
    ) -> Result<Self> {
        let mut forward = Self {
            engines: Engines::default(),
            bench: Bench::default(),
            aside: Bench::default(),
            trying: false,
            context: context.cloned(),
            outside: sim.map(|sim| Arc::new(Outside::new(sim, evidence))),
            native: false,
            scene: Arc::new(capture.scene.clone()),
            trajectory: Arc::new(capture.trajectory.clone()),
            static_camera: capture.camera.static_camera,
            intrinsics: capture.camera.intrinsics,
            period_s: capture.camera.frame_period_s,
            starts_s: evidence.frames.iter().map(|f| f.start_s).collect(),
            reach_s: evidence.reach_s,
            light: vec![1.0; evidence.frames.len()],
            sharp: Vec::new(),
            stuck: Arc::default(),
            budget,
            renders: (0, 0.0),
            compared: 0,
            journal: Arc::default(),
            description: Known::new(evidence),
            pooled: 1,
            reduced: None,
        };
        if let Some(outside) = &forward.outside {
            forward.sharp = (0..evidence.frames.len()).map(|at| outside.sharp(at)).collect();
            forward.add_camera_velocity();
            return Ok(forward);
        }
        let options = EngineOptions { planes: true, ..options(Quality::Fit) };
        let (scene, path) = (forward.scene.clone(), forward.trajectory.clone());
        let mut engine = Engine::new(forward.device(), scene, path, forward.intrinsics, options, &[])?;
        forward.sharp =
            (0..evidence.frames.len()).map(|at| forward.measure(at, &mut engine)).collect::<Result<_>>()?;
        Ok(forward)
    }

    /// Results are noted there.
    pub(crate) fn keep_in(&mut self, journal: &Arc<Mutex<Journal>>) {
        self.journal = journal.clone();
        if let Some(reduced) = &mut self.reduced {
            reduced.forward.keep_in(journal);
        }
    }

    /// Renders made so far, of fewer pixels too, and the time they took, s.
    pub(crate) fn renders_made(&self) -> (usize, f64) {
        let of = self.reduced.as_ref().map_or((0, 0.0), |reduced| reduced.forward.renders);
        (self.renders.0 + of.0, self.renders.1 + of.1)
    }

    /// Lets go of the engines, and of pictures of what was tried: the finest samples of large frames need their room.
    pub(crate) fn forget_tries(&mut self) {
        (self.engines, self.aside) = (Engines::default(), Bench::default());
        if let Some(reduced) = &mut self.reduced {
            let forward = &mut reduced.forward;
            (forward.bench, forward.aside) = (Bench::default(), Bench::default());
            forward.engines = Engines::default();
        }
    }

    /// Lets go of all that only a search needs.
    pub(crate) fn ends_search(&mut self) {
        self.renders = self.renders_made();
        (self.reduced, self.aside) = (None, Bench::default());
    }

    /// The instant of the sharp planes: in the middle of where exposures lie; the timestamp for a camera at rest, which
    /// is elsewhere a moment later.
    pub(crate) fn sharp_time_s(&self, at: usize) -> f64 {
        if self.static_camera || self.outside.is_some() {
            return self.starts_s[at];
        }
        let after_s = (0.4 * self.period_s).min((self.reach_s[1] - 2.0 * SPEED_STEP_S).max(0.0));
        self.starts_s[at] + after_s + SPEED_STEP_S
    }

    fn measure(&self, at: usize, engine: &mut Engine) -> Result<Sharp> {
        self.budget.go_on()?;
        // Speed over a short time, forward from its beginning.
        let mut request = self.request(at, &Theta::neutral());
        let early_s = if self.static_camera { 0.0 } else { SPEED_STEP_S };
        request.shutter.start_s = self.sharp_time_s(at) - early_s;
        request.frame_interval_s = 2.0 * SPEED_STEP_S;
        request.planes = true;
        let ticket = engine.submit(&request)?;
        let planes = engine.collect(ticket)?.planes.expect("planes were asked for");
        let per_s = if self.static_camera { 0.0 } else { (0.5 / SPEED_STEP_S) as f32 };
        let mut velocity = planes.motion_px;
        velocity.data.iter_mut().for_each(|v| *v = if v.is_finite() { *v * per_s } else { 0.0 });
        let (w, h) = (planes.color.width, planes.color.height);
        let coverage = Plane::from_fn(w, h, |x, y| [planes.color.pixel(x, y)[3]]);
        let mut sharp = Sharp { velocity, own: None, depth: planes.depth_m, coverage };
        if self.scene.objects.iter().any(|o| o.trajectory.is_some()) && !self.static_camera {
            let time_s = self.sharp_time_s(at);
            let camera = self.camera_velocity(&sharp.depth, &Theta::neutral(), |_| time_s);
            let data = sharp.velocity.data.iter().zip(&camera.data).map(|(v, c)| v - c).collect();
            sharp.own = Some(Plane { width: w, height: h, channels: 2, data });
        }
        Ok(sharp)
    }

    /// What scenes are rendered on.
    pub(crate) fn device(&self) -> &Arc<Context> {
        self.context.as_ref().expect("a scene comes with a device")
    }

    /// The middle of the footage, s.
    pub(crate) fn middle_s(&self) -> f64 {
        0.5 * (self.starts_s[0] + self.starts_s[self.starts_s.len() - 1])
    }

    /// The shutter for `theta`, kept inside the time for which there are poses.
    pub(crate) fn shutter(&self, at: usize, theta: &Theta) -> ShutterTiming {
        let k = &self.intrinsics;
        let offset_s = theta.get(P::Offset).clamp(-self.reach_s[0], self.reach_s[1]);
        let room_s = (self.reach_s[1] - offset_s).max(0.0);
        let exposure_time_s = theta.get(P::Exposure).min(room_s);
        ShutterTiming {
            start_s: self.starts_s[at] + offset_s,
            exposure_time_s,
            readout_time_s: theta.get(P::Readout).min(room_s - exposure_time_s),
            scan_order: theta.scan_order,
            line_count: theta.scan_order.line_count(k.width, k.height),
        }
    }

    /// Longest readout or exposure: no line is exposed or read again before it is done, and every frame needs poses for
    /// it.
    pub(crate) fn longest_s(&self) -> f64 {
        self.reach_s[1].min(self.period_s)
    }

    /// Earliest and latest offset, s.
    pub(crate) fn offsets_s(&self) -> [f64; 2] {
        [-self.reach_s[0].min(2.0 * self.period_s), self.reach_s[1].min(2.0 * self.period_s)]
    }

    /// `theta` with its times inside what the trajectory covers.
    pub(crate) fn bounded(&self, mut theta: Theta) -> Theta {
        let [from_s, to_s] = self.offsets_s();
        theta.set(P::Offset, theta.get(P::Offset).clamp(from_s, to_s));
        let longest_s = self.longest_s();
        for p in [P::Readout, P::Exposure] {
            theta.set(p, theta.get(p).min(longest_s));
        }
        theta
    }

    fn request(&self, at: usize, theta: &Theta) -> FrameRequest {
        FrameRequest {
            index: at as u32,
            shutter: self.shutter(at, theta),
            frame_interval_s: self.period_s,
            seed: 0,
            settings: lens(theta),
            static_camera: self.static_camera,
            planes: false,
            statistics: true,
        }
    }

    /// The trajectory of the camera of `theta`.
    pub(crate) fn path(&self, theta: &Theta) -> Arc<Trajectory> {
        let turn = [P::RotX, P::RotY, P::RotZ].map(|p| theta.get(p));
        let path = if theta.room.poses.is_empty() {
            self.trajectory.clone()
        } else {
            Arc::new(self.corrected(&self.trajectory, theta))
        };
        if turn == [0.0; 3] {
            path
        } else {
            Arc::new(path.turned(DQuat::from_scaled_axis(DVec3::from(turn))))
        }
    }

    /// Linear radiance as the sensor sees it, shape `[height, width, 3]`, of several frames (by place), of the surfaces
    /// as they are described, at the poses of `theta`.
    pub(crate) fn bare_radiance(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let green = self.render(frames, theta, 1.0, quality)?;
        let scales = [theta.get(P::ScaleR), 1.0, theta.get(P::ScaleB)];
        if scales == [1.0; 3] {
            return Ok(green);
        }
        let red = self.render(frames, theta, scales[0], quality)?;
        let blue = self.render(frames, theta, scales[2], quality)?;
        let merged = green.iter().zip(red.iter().zip(&blue)).map(|(g, (r, b))| {
            let mut out = (**g).clone();
            for i in (0..out.data.len()).step_by(3) {
                (out.data[i], out.data[i + 2]) = (r.data[i], b.data[i + 2]);
            }
            Arc::new(out)
        });
        Ok(merged.collect())
    }

    /// Renders what is not kept yet, through a lens that magnifies by `scale`.
    fn render(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        scale: f64,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let mut geometry: Vec<u64> = GEOMETRY.iter().map(|&p| theta.get(p).to_bits()).collect();
        geometry.push(scale.to_bits());
        let lens = LENS.iter().any(|&p| theta.is_on(p)) && self.outside.is_none();
        let reads = lens && !self.native && self.has_room(theta);
        geometry.push(if reads { READ } else { 0 });
        let key = |at: usize| -> Key {
            let s = self.shutter(at, theta);
            let times = [s.start_s, s.exposure_time_s, s.readout_time_s].map(f64::to_bits);
            let pose = theta.room.poses.get(at).into_iter().flatten().map(|v| v.to_bits());
            (at, quality, times, s.scan_order, pose.chain(geometry.iter().copied()).collect())
        };
        let keys: Vec<Key> = frames.iter().map(|&at| key(at)).collect();
        let kept = |key: &Key| {
            let aside = self.trying.then(|| self.aside.cache.get(key)).flatten();
            self.bench.cache.get(key).or(aside).map(|(_, plane)| plane.clone())
        };
        let mut found: Vec<Option<Arc<Plane<f32>>>> = keys.iter().map(kept).collect();
        let missing: Vec<_> = (0..frames.len()).filter(|&i| found[i].is_none()).collect();
        if !missing.is_empty() {
            self.journal().go_on()?;
            self.budget.go_on()?;
            let requests: Vec<_> = missing.iter().map(|&i| self.request(frames[i], theta)).collect();
            let clock = Instant::now();
            let places: Vec<usize> = missing.iter().map(|&i| frames[i]).collect();
            let done = if let Some(outside) = &self.outside {
                self.warped(outside, &places, theta, scale, quality)
            } else if reads {
                self.read(&places, &requests, theta, scale, quality)?
            } else {
                self.rendered(&requests, theta, scale, quality)?
            };
            self.renders.0 += done.len();
            self.renders.1 += clock.elapsed().as_secs_f64();
            for (&i, plane) in missing.iter().zip(done) {
                let plane = Arc::new(plane);
                self.bench.cache.insert(keys[i].clone(), (0, plane.clone()));
                found[i] = Some(plane);
            }
        }
        self.bench.clock += 1;
        for key in &keys {
            if let Some(entry) = self.bench.cache.get_mut(key) {
                entry.0 = self.bench.clock;
            }
        }
        let out = found.into_iter().map(|f| f.expect("just rendered")).collect();
        self.forget();
        Ok(out)
    }

    /// Whether there are poses for the lines of a larger picture.
    fn has_room(&self, theta: &Theta) -> bool {
        let (k, s) = (&self.intrinsics, self.shutter(0, theta));
        let lines = f64::from(theta.scan_order.line_count(k.width, k.height));
        let more_s = s.readout_time_s * (f64::from(self.bench.wide.margin_px.max(24)) + 1.0) / lines;
        let early_s = theta.get(P::Offset) - more_s;
        let late_s = theta.get(P::Offset) + s.readout_time_s + s.exposure_time_s + more_s;
        early_s >= -self.reach_s[0] && late_s <= self.reach_s[1]
    }

    /// What `work` works out from `key` and the input, or what an earlier run has left of it. It is worked out on a
    /// bench of its own, and leaves the other bench as it was; before and after it the engines are as if nothing had
    /// been rendered. Whether it is worked out or taken from the journal, all that follows is the same to the last bit.
    /// Within such work nothing is kept.
    ///
    /// # Errors
    /// Those of `work`; a journal that cannot be written.
    pub(crate) fn tried<W, T: Serialize + DeserializeOwned>(
        who: &mut W,
        forward: fn(&mut W) -> &mut Self,
        (kind, key): (&str, &str),
        work: impl FnOnce(&mut W) -> Result<T>,
    ) -> Result<T> {
        let this = forward(who);
        if this.trying {
            return work(who);
        }
        let key = format!("{key} {} {} {}", this.native, this.compared, this.pooled);
        let known = this.journal().recall(kind, &key);
        if let Some(value) = known {
            return this.forget_frames().map(|()| value);
        }
        this.swap_benches(true)?;
        let value = work(who);
        let this = forward(who);
        this.swap_benches(false)?;
        let value = value?;
        // What the time limit has cut short is no result.
        if !this.budget.is_over() {
            this.journal().note(kind, &key, &value)?;
        }
        Ok(value)
    }

    fn swap_benches(&mut self, trying: bool) -> Result<()> {
        std::mem::swap(&mut self.bench, &mut self.aside);
        self.trying = trying;
        if trying {
            self.bench.clear();
            self.bench.wide.begin(self.aside.wide.margin_px);
        } else {
            self.aside.clear();
        }
        self.engines.forget()?;
        self.reduced.as_mut().map_or(Ok(()), |reduced| reduced.forward.swap_benches(trying))
    }

    /// The engines are as if nothing had been rendered.
    fn forget_frames(&mut self) -> Result<()> {
        self.engines.forget()?;
        self.reduced.as_mut().map_or(Ok(()), |reduced| reduced.forward.forget_frames())
    }

    fn journal(&self) -> std::sync::MutexGuard<'_, Journal> {
        self.journal.lock().expect("nobody panics while it is held")
    }

    /// All that what is seen of a frame depends on: times, pose, lens.
    pub(crate) fn sight_key(&self, at: usize, theta: &Theta) -> Key {
        let s = self.shutter(at, theta);
        let times = [s.start_s, s.exposure_time_s, s.readout_time_s].map(f64::to_bits);
        let pose = theta.room.poses.get(at).into_iter().flatten().copied();
        let geometry = GEOMETRY.iter().map(|&p| theta.get(p)).chain(pose).map(f64::to_bits).collect();
        (at, Quality::Fit, times, s.scan_order, geometry)
    }

    /// The camera of `theta`, through a lens that magnifies by `scale`.
    pub(super) fn magnified(&self, theta: &Theta, scale: f64) -> Intrinsics {
        let factor = theta.get(P::Focal) * scale;
        Intrinsics { fx: self.intrinsics.fx * factor, fy: self.intrinsics.fy * factor, ..self.intrinsics }
    }

    /// Forgets what was read from a picture with less margin.
    pub(crate) fn forget_wide(&mut self) {
        self.bench.cache.retain(|key, _| key.4.last() != Some(&READ));
        self.bench.developed.clear();
    }

    fn rendered(
        &mut self,
        requests: &[FrameRequest],
        theta: &Theta,
        scale: f64,
        quality: Quality,
    ) -> Result<Vec<Plane<f32>>> {
        let k = self.magnified(theta, scale);
        if quality < Quality::Finest {
            return self.rendered_at(requests, theta, k, quality);
        }
        // Sixteen samples at four places of the picture, a quarter of their distance apart, each over its quarter of
        // the exposure.
        let places = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        mean_of_quarters(|i| {
            let (x, y) = places[i];
            let k = Intrinsics { cx: k.cx + x / 16.0, cy: k.cy + y / 16.0, ..k };
            self.rendered_at(&quarters(requests, i), theta, k, Quality::Fine)
        })
    }

    fn rendered_at(
        &mut self,
        requests: &[FrameRequest],
        theta: &Theta,
        k: Intrinsics,
        quality: Quality,
    ) -> Result<Vec<Plane<f32>>> {
        let path = self.path(theta);
        if self.engines.delivered[quality as usize].is_none() {
            let (scene, trajectory) = (self.scene.clone(), self.trajectory.clone());
            let engine =
                Engine::new(self.device(), scene, trajectory, self.intrinsics, options(quality), &[])?;
            self.engines.delivered[quality as usize] = Some(engine);
        }
        let engine = self.engines.delivered[quality as usize].as_mut().expect("just made");
        engine.aim(k, path);
        in_flight(engine, requests)
    }

    fn forget(&mut self) {
        let bytes = |p: &Plane<f32>| p.data.len() * 4;
        let mut total: usize = self.bench.cache.values().map(|(_, p)| bytes(p)).sum();
        if total <= CACHE_BYTES {
            return;
        }
        let mut ages: Vec<_> =
            self.bench.cache.iter().map(|(k, (age, p))| (*age, k.clone(), bytes(p))).collect();
        ages.sort_by(|a, b| (a.0, a.1.0, &a.1.2).cmp(&(b.0, b.1.0, &b.1.2)));
        for (_, key, size) in ages {
            if total <= CACHE_BYTES / 2 {
                break;
            }
            self.bench.cache.remove(&key);
            total -= size;
        }
    }
}

/// Requests for one of the four quarters of their exposures.
pub(super) fn quarters(requests: &[FrameRequest], which: usize) -> Vec<FrameRequest> {
    let mut out = requests.to_vec();
    for FrameRequest { shutter, .. } in &mut out {
        shutter.exposure_time_s *= 0.25;
        shutter.start_s += which as f64 * shutter.exposure_time_s;
    }
    out
}

/// The mean of the pictures of four quarters.
pub(super) fn mean_of_quarters(
    mut of_quarter: impl FnMut(usize) -> Result<Vec<Plane<f32>>>,
) -> Result<Vec<Plane<f32>>> {
    let mut sum = of_quarter(0)?;
    for i in 1..4 {
        let part = of_quarter(i)?;
        let pairs = sum.iter_mut().zip(&part).flat_map(|(s, p)| s.data.iter_mut().zip(&p.data));
        pairs.for_each(|(s, p)| *s += p);
    }
    sum.iter_mut().flat_map(|p| &mut p.data).for_each(|v| *v *= 0.25);
    Ok(sum)
}
