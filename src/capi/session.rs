//! The object behind an engine's handle: a device, a camera, and the engines that are made from them on first use.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::exposure::{Exposure, Place};
use super::options::Settings;
use super::status::{self, Fault, Outcome};
use crate::camera::{Distortion, Intrinsics, Lens, Pose, ShutterTiming, Trajectory};
use crate::capture::{CameraFile, Capture};
use crate::chain::{Effect, Settings as Effects, Work};
use crate::effects::{BayerMosaic, ChromaticAberration, FocalLengthError, LIST, LensDistortion, PoseOffset};
use crate::engine::{
    Delivery, Engine, EngineOptions, Flight, Frame, FrameRequest, Method, OutsideEngine, OutsideFrame, Ticket,
};
use crate::error::counted;
use crate::gpu::Context;
use crate::scene::{Scene, Shading, load_obj};

/// The state.
pub struct Session {
    outside: Option<OutsideEngine>,
    engine: Option<Engine>,
    camera: Option<CameraFile>,
    scene: Option<Arc<Scene>>,
    trajectory: Option<Arc<Trajectory>>,
    /// Start of each frame of a capture, s.
    frame_times_s: Vec<f64>,
    epoch_ns: i64,
    exposure: Exposure,
    settings: Settings,
    lost: bool,
    /// Whether an odd depth was spoken of.
    depth_heard: bool,
    context: Arc<Context>,
}

/// A frame on its way.
pub struct Submitted {
    ticket: Ticket,
    outside: bool,
    place: Place,
    /// Factor on its radiance, automatic exposure included.
    pub gain: f64,
    /// When its lines are exposed.
    pub shutter: ShutterTiming,
    /// Number of the frame.
    pub index: u32,
    /// Its poses, as far as they are known.
    pub path: Option<Arc<Trajectory>>,
}

impl Session {
    /// A session on a device.
    pub fn new(context: Arc<Context>, settings: Settings) -> Self {
        Self {
            outside: None,
            engine: None,
            camera: None,
            scene: None,
            trajectory: None,
            frame_times_s: Vec::new(),
            epoch_ns: 0,
            exposure: Exposure::default(),
            settings,
            lost: false,
            depth_heard: false,
            context,
        }
    }

    /// The device.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// What it was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The camera, if one was set.
    pub fn camera(&self) -> Option<&CameraFile> {
        self.camera.as_ref()
    }

    /// Starts of a capture's frames, s, and the zero of its clock, ns.
    pub fn capture_times(&self) -> (&[f64], i64) {
        (&self.frame_times_s, self.epoch_ns)
    }

    fn pending(&self) -> usize {
        self.engine.as_ref().map_or(0, Engine::pending)
            + self.outside.as_ref().map_or(0, OutsideEngine::pending)
    }

    fn idle(&self, what: &str) -> Outcome<()> {
        match self.pending() {
            0 => Ok(()),
            n => Err(Fault::new(
                status::STATE,
                format!("{} in flight: {what} after waiting for all", counted(n, "frame is", "frames are")),
            )),
        }
    }

    /// Sets the camera. Engines are replaced only if size, pinhole or mounting change.
    pub fn set_camera(&mut self, camera: CameraFile) -> Outcome<()> {
        let sides = [camera.intrinsics.width, camera.intrinsics.height];
        let limit = self.settings.max_side_px.min(self.context.info().max_image_side_px);
        if let Some(side) = sides.iter().find(|&&s| s > limit) {
            return Err(Fault::new(status::LIMIT, format!("a side of {side} px; the limit is {limit} px")));
        }
        // A lens that folds inside the picture is refused here, not with the first frame.
        Lens::new(true_intrinsics(&camera), LensDistortion::distortion(&camera.settings))?;
        let kind = |c: &CameraFile| (c.intrinsics, true_intrinsics(c), PoseOffset::rotation(&c.settings));
        if self.camera.as_ref().map(kind) != Some(kind(&camera)) {
            self.idle("the camera's size is set")?;
            (self.engine, self.outside) = (None, None);
        }
        camera.warnings.iter().for_each(|w| tracing::warn!("{w}"));
        self.exposure.set(&camera.settings);
        self.camera = Some(camera);
        Ok(())
    }

    /// Loads a capture's scene, trajectory and frame times, and its camera.
    pub fn load_capture(&mut self, root: &Path) -> Outcome<()> {
        self.idle("a capture is loaded")?;
        let capture = Capture::read(root, None)?;
        self.set_camera(capture.camera)?;
        self.exposure.reset();
        self.engine = None;
        self.scene = Some(Arc::new(capture.scene));
        self.trajectory = Some(Arc::new(capture.trajectory));
        self.frame_times_s = capture.frames.iter().map(|f| f.start_s).collect();
        self.epoch_ns = capture.epoch_ns;
        Ok(())
    }

    /// Loads an OBJ file, unlit.
    pub fn load_scene(&mut self, path: &Path) -> Outcome<()> {
        self.idle("a scene is loaded")?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut scene = load_obj(path, folder)?;
        scene.shading = Shading::Unlit;
        self.exposure.reset();
        self.engine = None;
        self.scene = Some(Arc::new(scene));
        self.frame_times_s.clear();
        self.epoch_ns = 0;
        Ok(())
    }

    /// Restarts automatic exposure.
    pub fn reset_exposure(&mut self) {
        self.exposure.reset();
    }

    /// Sets the camera's poses over time.
    pub fn set_trajectory(&mut self, times_s: Vec<f64>, poses: Vec<Pose>) -> Outcome<()> {
        self.idle("the trajectory is set")?;
        let path = Trajectory::new(Path::new("shutterbug_engine_set_trajectory"), times_s, poses)?;
        self.exposure.reset();
        self.engine = None;
        self.trajectory = Some(Arc::new(path));
        Ok(())
    }

    fn request(&self, index: u32, time_s: f64, planes: bool) -> Outcome<FrameRequest> {
        let camera = self.camera.as_ref();
        let camera = camera.ok_or_else(|| Fault::new(status::STATE, "no camera is set"))?;
        Ok(FrameRequest {
            index,
            shutter: camera.shutter_at(time_s),
            frame_interval_s: camera.frame_period_s,
            seed: self.settings.seed,
            settings: camera.settings.clone(),
            static_camera: camera.static_camera,
            planes,
            statistics: false,
        })
    }

    fn not_lost(&self) -> Outcome<()> {
        if self.lost {
            return Err(Fault::new(
                status::DEVICE_LOST,
                "the device was lost in an earlier call; destroy the engine",
            ));
        }
        Ok(())
    }

    /// A frame whose picture goes to shared memory, or is wanted in more than 8 bits, may not be changed in host memory
    /// afterwards; raw pictures have a mosaic.
    fn check_delivery(&self, delivery: &Delivery) -> Outcome<()> {
        let Some(settings) = self.camera.as_ref().map(|c| &c.settings) else { return Ok(()) };
        if delivery.raw && !BayerMosaic::is_there(settings) {
            let text =
                "a raw picture has one colour a pixel: the camera's text names the pattern (bayer_mosaic)";
            return Err(Fault::new(status::INPUT, text));
        }
        let on_host = |e: &&dyn Effect| matches!(e.work(), Work::Host(_)) && e.variant(settings) != 0;
        let elsewhere = delivery.to.is_some() || delivery.values;
        match LIST.iter().copied().find(on_host).filter(|_| elsewhere) {
            None => Ok(()),
            Some(effect) => Err(Fault::new(
                status::UNSUPPORTED,
                format!(
                    "`{}` acts in host memory on values of 8 bits: with it, a picture comes through \
                     shutterbug_frame_read only, not through picture_memory, and has 8 bits",
                    effect.id()
                ),
            )),
        }
    }

    fn on_its_way(
        &mut self,
        (ticket, outside): (Ticket, bool),
        request: &FrameRequest,
        path: Option<Arc<Trajectory>>,
    ) -> Submitted {
        let gain = request.settings.number("exposure_gain", "gain", 1.0);
        let place = self.exposure.submitted();
        Submitted { ticket, outside, place, gain, shutter: request.shutter, index: request.index, path }
    }

    /// Hands a frame of the scene to the device.
    pub fn submit(
        &mut self,
        index: u32,
        time_s: f64,
        [planes, radiance]: [bool; 2],
        delivery: &Delivery,
    ) -> Outcome<Submitted> {
        self.not_lost()?;
        let mut request = self.request(index, time_s, planes)?;
        request.statistics = radiance;
        self.check_delivery(delivery)?;
        if planes && !self.settings.planes {
            return Err(Fault::new(status::STATE, "the engine was made without SHUTTERBUG_ENGINE_PLANES"));
        }
        let trajectory = self.trajectory.clone();
        let trajectory = trajectory.ok_or_else(|| Fault::new(status::STATE, "no trajectory is set"))?;
        let trajectory = Arc::new(PoseOffset::apply(&request.settings, &trajectory));
        self.make_engine(&request, &trajectory)?;
        let engine = self.engine.as_mut().expect("just made");
        if !engine.has_room() {
            return Err(full(engine.frames_in_flight()));
        }
        self.exposure.apply(&mut request)?;
        let ticket = engine.submit_to(&request, delivery);
        let ticket = self.watch(ticket)?;
        let path = if request.static_camera {
            Arc::new(Trajectory::fixed(trajectory.pose_at(request.shutter.start_s)))
        } else {
            trajectory
        };
        Ok(self.on_its_way((ticket, false), &request, Some(path)))
    }

    fn make_engine(&mut self, request: &FrameRequest, trajectory: &Arc<Trajectory>) -> Outcome<()> {
        if self.engine.is_some() {
            return Ok(());
        }
        let scene = self.scene.clone();
        let scene = scene.ok_or_else(|| Fault::new(status::STATE, "no scene is loaded"))?;
        let options = EngineOptions {
            method: self.settings.method.clone(),
            samples: self.settings.samples,
            frames_in_flight: self.settings.frames_in_flight,
            planes: self.settings.planes,
            time_limit: self.settings.time_limit,
        };
        let camera = true_intrinsics(self.camera.as_ref().expect("the request has one"));
        // Announced to the exact method, the first frame would be drawn from triangles of its own.
        let exact = matches!(options.method, Method::Exact(_));
        let expected = if exact { &[] } else { std::slice::from_ref(request) };
        let made = Engine::new(&self.context, scene, trajectory.clone(), camera, options, expected);
        self.engine = Some(self.watch(made)?);
        Ok(())
    }

    /// The request of an outside frame, for the camera that is set.
    /// `with_path`: it brings depth and the camera's path, and goes through the warp, which knows lenses.
    pub fn outside_request(&self, index: u32, time_s: f64, with_path: bool) -> Outcome<FrameRequest> {
        self.not_lost()?;
        self.settings.takes_outside(with_path)?;
        let request = self.request(index, time_s, false)?;
        match of_warps_only(&request.settings).filter(|_| !with_path) {
            None => Ok(request),
            Some(effect) => Err(Fault::new(
                status::UNSUPPORTED,
                format!(
                    "`{effect}` acts where a pixel looks: of frames from outside, those with depth and poses over \
                     all of the frame (pose_count) can have it"
                ),
            )),
        }
    }

    /// Warns of an odd depth, once: a host hands in one a frame.
    pub fn hear_of_depth(&mut self, complaint: impl FnOnce() -> Option<String>) {
        if self.depth_heard {
            return;
        }
        if let Some(text) = complaint() {
            self.depth_heard = true;
            tracing::warn!("{text}");
        }
    }

    /// Hands a frame from outside to the device.
    pub fn submit_outside(
        &mut self,
        mut frame: OutsideFrame<'_>,
        path: Option<Arc<Trajectory>>,
    ) -> Outcome<Submitted> {
        self.check_delivery(&frame.delivery)?;
        if self.outside.is_none() {
            let camera = self.camera.as_ref().expect("the request has one").intrinsics;
            let (count, limit) = (self.settings.frames_in_flight, self.settings.time_limit);
            let made = OutsideEngine::new(&self.context, camera, count, limit);
            self.outside = Some(self.watch(made)?);
        }
        let outside = self.outside.as_mut().expect("just made");
        if !outside.has_room() {
            return Err(full(self.settings.frames_in_flight as usize));
        }
        self.exposure.apply(&mut frame.request)?;
        let ticket = outside.submit(&frame);
        let ticket = self.watch(ticket)?;
        Ok(self.on_its_way((ticket, true), &frame.request, path))
    }

    /// Frames in flight of the engine that a frame is of: the scene's, or that of frames from outside.
    fn flight(&mut self, outside: bool) -> Outcome<&mut Flight> {
        let flight = match outside {
            false => self.engine.as_mut().map(Engine::flight),
            true => self.outside.as_mut().map(OutsideEngine::flight),
        };
        flight.ok_or_else(|| {
            Fault::new(status::STATE, "the frame's engine was replaced when the camera changed")
        })
    }

    /// Whether a frame can be collected without waiting.
    pub fn finished(&mut self, submitted: &Submitted) -> Outcome<bool> {
        self.not_lost()?;
        let done = self.flight(submitted.outside)?.finished(&submitted.ticket);
        self.watch(done)
    }

    /// Waits for a frame, at most so long (and never longer than the engine's limit).
    pub fn wait(&mut self, submitted: &Submitted, limit: Duration) -> Outcome<()> {
        self.not_lost()?;
        let limit = limit.min(self.settings.time_limit);
        let done = self.flight(submitted.outside)?.wait(&submitted.ticket, limit);
        let done = self.watch(done);
        if done.as_ref().is_err_and(|fault| fault.status != status::TIMEOUT) {
            self.give_up(submitted);
        }
        done
    }

    /// Gives up a frame that failed or is not wanted any more. Its place in flight is free once the device has
    /// finished.
    pub fn give_up(&mut self, submitted: &Submitted) {
        if let Ok(flight) = self.flight(submitted.outside) {
            flight.give_up(&submitted.ticket);
        }
    }

    /// Reads a frame back that was waited for.
    pub fn collect(&mut self, submitted: Submitted) -> Outcome<Frame> {
        self.not_lost()?;
        let place = submitted.place;
        let frame = self.flight(submitted.outside)?.collect(submitted.ticket);
        let frame = self.watch(frame)?;
        self.exposure.meter(place, &frame);
        Ok(frame)
    }

    /// Runs a call on the device beside the engines, unless the device is lost; notes its loss.
    pub fn use_device<T>(&mut self, call: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
        self.not_lost()?;
        let done = call();
        self.lost |= done.as_ref().is_err_and(|fault| fault.status == status::DEVICE_LOST);
        done
    }

    /// Notes the loss of the device.
    fn watch<T>(&mut self, result: crate::Result<T>) -> Outcome<T> {
        result.map_err(|error| {
            let fault = Fault::from(error);
            self.lost |= fault.status == status::DEVICE_LOST;
            fault
        })
    }
}

/// The pinhole that the frames are taken with.
fn true_intrinsics(camera: &CameraFile) -> Intrinsics {
    FocalLengthError::apply(&camera.settings, &camera.intrinsics)
}

/// An effect that a gather of a frame from outside does not know.
fn of_warps_only(effects: &Effects) -> Option<&'static str> {
    let k = Intrinsics { width: 1, height: 1, fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5 };
    let acts = [
        ("lens_distortion", LensDistortion::distortion(effects) != Distortion::None),
        ("chromatic_aberration", ChromaticAberration::scales(effects) != [1.0; 3]),
        ("focal_length_error", FocalLengthError::apply(effects, &k) != k),
        ("pose_offset", PoseOffset::rotation(effects) != glam::DQuat::IDENTITY),
    ];
    acts.into_iter().find(|(_, acts)| *acts).map(|(effect, _)| effect)
}

fn full(count: usize) -> Fault {
    Fault::new(
        status::FULL,
        format!("{} in flight: wait for any of them first", counted(count, "frame is", "frames are")),
    )
}
