//! Frames of a scene: the methods that render them, and what the methods share: lens, sharp planes, camera path.

use std::sync::Arc;
use std::time::Duration;

use super::accumulation::AccumulationOptions;
use super::delivery::Delivery;
use super::exact::ExactOptions;
use super::fast::FastOptions;
use super::finish::Finish;
use super::flight::{Flight, MAX_IN_FLIGHT, Room, Ticket};
use super::frame::{Frame, FrameInstants, FrameRequest};
use super::paper::PaperOptions;
use super::scene::clusters::Clusters;
use super::scene::lens::{LensKey, LensStage};
use super::scene::planes::PlanesPass;
use super::scene::taps::{GatherInputs, Taps, WarpInputs, read_back};
use super::scene::{Choices, Renderer, Shot, Stage, camera_path, check_coverage, instants};
use super::slots::FrameSlot;
use super::source::Source;
use super::{Engine, EngineOf};
use crate::camera::{Intrinsics, Trajectory};
use crate::effects::Defocus;
use crate::error::Result;
use crate::gpu::{Context, Image};
use crate::plane::Plane;
use crate::raster::{SamplePlan, SceneBuffers};
use crate::scene::Scene;

/// How a frame with shutter and blur is made.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// The paper's: one render, up to six motion images, remap and blur as a gather.
    Paper(PaperOptions),
    /// One render and a warp along true paths, silhouettes kept apart by depth.
    Fast(FastOptions),
    /// One render with every line at its own time, blurred along the paths of its samples.
    Exact(ExactOptions),
    /// Many renders over the frame's interval, each weighed into the lines that see it: the reference.
    Accumulation(AccumulationOptions),
}

impl Method {
    /// The only place that tells methods apart.
    fn choices(&self) -> &dyn Choices {
        match self {
            Self::Paper(options) => options,
            Self::Fast(options) => options,
            Self::Exact(options) => options,
            Self::Accumulation(options) => options,
        }
    }
}

/// How to make an [`Engine`].
#[derive(Clone, Debug)]
pub struct EngineOptions {
    /// How frames are made.
    pub method: Method,
    /// Samples a pixel: 1, 4 or 16.
    pub samples: u32,
    /// Frames in flight, 1 to [`MAX_IN_FLIGHT`].
    pub frames_in_flight: u32,
    /// Whether frames may ask for sharp planes.
    pub planes: bool,
    /// Longest time one submission may take.
    pub time_limit: Duration,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self {
            method: Method::Accumulation(AccumulationOptions::default()),
            samples: 16,
            frames_in_flight: 2,
            planes: false,
            time_limit: Duration::from_secs(600),
        }
    }
}

/// Frames of a scene, by one of the methods.
pub struct Scenes {
    renderer: Box<dyn Renderer>,
    planes: Option<PlanesPass>,
    options: EngineOptions,
    stage: Stage,
}

/// A frame of a scene.
pub struct SceneFrame<'a> {
    request: &'a FrameRequest,
    delivery: &'a Delivery,
}

impl Scenes {
    /// Makes what depends on the lens for frames like `expected`, or lets it go.
    fn set_lens(
        (stage, options): (&mut Stage, &EngineOptions),
        room: &mut Room<'_>,
        expected: &[FrameRequest],
    ) -> Result<()> {
        stage.lens = None;
        let settings = expected.first().map(|first| &first.settings);
        let Some((key, settings)) = settings.and_then(|s| Some((LensKey::of(s)?, s))) else { return Ok(()) };
        let choices = options.method.choices();
        choices.check_lens()?;
        let mut lens = LensStage::new(stage, key, expected, room)?;
        if options.planes || Defocus::needs_depth(settings) || choices.draws_instants() {
            lens.cut(stage)?;
        }
        stage.lens = Some(lens);
        Ok(())
    }

    /// Rebuilds what depends on the lens if it, or the camera behind it, is another than for the frame before.
    fn fit_lens(&mut self, request: &FrameRequest, room: &mut Room<'_>) -> Result<()> {
        let fits = match (&self.stage.lens, LensKey::of(&request.settings)) {
            (Some(lens), Some(key)) => lens.is_of(key, &self.stage.intrinsics),
            (lens, key) => lens.is_none() && key.is_none(),
        };
        if fits {
            return Ok(());
        }
        room.settle()?;
        self.renderer.forget_lens();
        Self::set_lens((&mut self.stage, &self.options), room, std::slice::from_ref(request))
    }

    /// Rebuilds the images if a frame needs a wider margin than all frames before, or other images.
    fn fit_renderer(&mut self, request: &FrameRequest, room: &mut Room<'_>) -> Result<()> {
        if self.renderer.fits(&self.stage, request) {
            return Ok(());
        }
        room.settle()?;
        let before = self.renderer.margin_px();
        self.renderer.fit(&self.stage, room, request)?;
        let margin_px = self.renderer.margin_px();
        if margin_px != before {
            tracing::info!("the margin grew to {margin_px:?} px for frame {}", request.index);
        }
        Ok(())
    }
}

impl Source for Scenes {
    type Frame<'a> = SceneFrame<'a>;

    fn asked<'f>(frame: &'f SceneFrame<'_>) -> (&'f FrameRequest, &'f Delivery) {
        (frame.request, frame.delivery)
    }

    fn context(&self) -> &Arc<Context> {
        &self.stage.context
    }

    fn intrinsics(&self) -> &Intrinsics {
        &self.stage.intrinsics
    }

    fn fit(&mut self, frame: &SceneFrame<'_>, mut room: Room<'_>, _: usize) -> Result<FrameInstants> {
        let request = frame.request;
        check_coverage(&self.stage, request)?;
        self.fit_lens(request, &mut room)?;
        self.fit_renderer(request, &mut room)?;
        if self.planes.is_none() && Defocus::needs_depth(&request.settings) {
            room.settle()?;
            self.planes = Some(PlanesPass::new(&self.stage, &mut room)?);
        }
        Ok(instants(&camera_path(&self.stage, request), &request.shutter))
    }

    fn submit(
        &mut self,
        frame: &SceneFrame<'_>,
        slot: &mut FrameSlot,
        finish: &Finish,
        limit: Duration,
    ) -> Result<()> {
        let (stage, planes, request) = (&self.stage, self.planes.as_ref(), frame.request);
        let path = &camera_path(stage, request);
        self.renderer.submit(Shot { stage, slot: &mut *slot, request, path, finish, planes, limit })?;
        slot.deliver(&stage.context, frame.delivery)
    }
}

impl Engine {
    /// Uploads the scene and makes what every frame needs. For the paper's method, `expected` are frames that will be
    /// asked for: the margin of the extended field of view is computed from their motion (a later frame that needs
    /// more makes the images anew).
    ///
    /// # Errors
    /// Sizes that the device cannot do, out of memory.
    pub fn new(
        context: &Arc<Context>,
        scene: Arc<Scene>,
        trajectory: Arc<Trajectory>,
        intrinsics: Intrinsics,
        options: EngineOptions,
        expected: &[FrameRequest],
    ) -> Result<Self> {
        let slots = (options.frames_in_flight.clamp(1, MAX_IN_FLIGHT), scene.objects.len());
        let mut flight = Flight::new(context, &intrinsics, slots, options.time_limit)?;
        let mut stage = Stage {
            buffers: SceneBuffers::new(context, &scene)?,
            plan: SamplePlan::new(options.samples, &context.info().sample_counts)?,
            clusters: Clusters::new(&scene),
            scene,
            trajectory,
            intrinsics,
            lens: None,
            context: context.clone(),
        };
        let mut room = flight.room(context);
        Scenes::set_lens((&mut stage, &options), &mut room, expected)?;
        let renderer = options.method.choices().make(&stage, &mut room, expected)?;
        let by_depth = |r: &FrameRequest| Defocus::needs_depth(&r.settings);
        let planes = (options.planes || expected.iter().any(by_depth))
            .then(|| PlanesPass::new(&stage, &mut room))
            .transpose()?;
        Ok(EngineOf { source: Scenes { renderer, planes, options, stage }, flight })
    }

    /// Gives the engine another camera of the same size, or another path: what a fit of the set-up does between frames.
    ///
    /// # Panics
    /// If the size differs: a bug of the caller.
    pub fn aim(&mut self, intrinsics: Intrinsics, trajectory: Arc<Trajectory>) {
        let stage = &mut self.source.stage;
        let size = |k: &Intrinsics| (k.width, k.height);
        assert_eq!(size(&intrinsics), size(&stage.intrinsics), "an engine's pictures keep their size");
        (stage.intrinsics, stage.trajectory) = (intrinsics, trajectory);
    }

    /// Lets go of what the frames so far have left behind for those that follow: triangles cut for the longest readout,
    /// images with the widest margin, a lens. The pictures of the exact method are from here on those of a fresh
    /// engine, to the last bit; the next frame takes longer.
    ///
    /// # Errors
    /// Device lost, or the time limit passed: frames in flight are waited for.
    pub fn forget(&mut self) -> Result<()> {
        let Self { source, flight } = self;
        flight.room(&source.stage.context).settle()?;
        source.stage.lens = None;
        source.renderer.forget();
        Ok(())
    }

    /// Pixels rendered beyond each side of the picture (columns, rows).
    pub fn margin_px(&self) -> [u32; 2] {
        self.source.renderer.margin_px()
    }

    /// Records a frame and hands it to the device.
    ///
    /// # Errors
    /// A trajectory that does not cover the frame; device lost; out of memory.
    ///
    /// # Panics
    /// If all slots hold frames that were not collected: a bug of the caller.
    pub fn submit(&mut self, request: &FrameRequest) -> Result<Ticket> {
        self.submit_to(request, &Delivery::default())
    }

    /// The same; the picture goes elsewhere on the device too.
    ///
    /// # Errors
    /// As for [`Self::submit`].
    ///
    /// # Panics
    /// As [`Self::submit`].
    pub fn submit_to(&mut self, request: &FrameRequest, delivery: &Delivery) -> Result<Ticket> {
        self.send(&SceneFrame { request, delivery })
    }

    /// Submits and collects one frame.
    ///
    /// # Errors
    /// As for [`Self::submit`] and [`Self::collect`].
    pub fn render(&mut self, request: &FrameRequest) -> Result<Frame> {
        let ticket = self.submit(request)?;
        self.collect(ticket)
    }

    /// Renders a frame by the paper's method and reads back what its gather was given; `None` for other methods.
    ///
    /// # Errors
    /// As for [`Engine::render`].
    ///
    /// # Panics
    /// If frames are in flight.
    pub fn gather_inputs(&mut self, request: &FrameRequest) -> Result<Option<GatherInputs>> {
        let margin_px = self.rendered_margin_px(request)?;
        self.with_taps(request, |taps, read| {
            let Taps::Gather([color, motion, depth], times) = taps else { return Ok(None) };
            let mut motion_px = read(motion)?;
            motion_px.truncate(times.count);
            Ok(Some(GatherInputs {
                color: read(color)?.swap_remove(0),
                motion_px,
                depth_m: read(depth)?.swap_remove(0),
                margin_px,
                color_time_s: times.reference_s,
                first_motion_time_s: times.first_motion_s,
                motion_step_s: times.step_s,
            }))
        })
    }

    /// Renders a frame by the method `fast` and reads back what its warp was given; `None` for other methods, and where
    /// paths are drawn.
    ///
    /// # Errors
    /// As for [`Engine::render`].
    ///
    /// # Panics
    /// If frames are in flight.
    pub fn warp_inputs(&mut self, request: &FrameRequest) -> Result<Option<WarpInputs>> {
        let margin_px = self.rendered_margin_px(request)?;
        self.with_taps(request, |taps, read| {
            let Taps::Warp([color, depth], knots_s) = taps else { return Ok(None) };
            Ok(Some(WarpInputs {
                color: read(color)?.swap_remove(0),
                inverse_depth: read(depth)?.swap_remove(0),
                margin_px,
                color_time_s: request.shutter.middle_s(),
                knots_s,
            }))
        })
    }

    fn rendered_margin_px(&mut self, request: &FrameRequest) -> Result<[u32; 2]> {
        assert_eq!(self.pending(), 0, "inputs are read between frames");
        self.render(request)?;
        Ok(self.margin_px())
    }

    fn with_taps<T>(
        &mut self,
        request: &FrameRequest,
        take: impl FnOnce(Taps<'_>, &mut dyn FnMut(&Image) -> Result<Vec<Plane<f32>>>) -> Result<Option<T>>,
    ) -> Result<Option<T>> {
        let Self { source: Scenes { renderer, stage, .. }, flight } = self;
        let Some(taps) = renderer.taps(stage, request, &camera_path(stage, request)) else { return Ok(None) };
        take(taps, &mut |image| read_back(&stage.context, &mut flight.slots[0], image, flight.limit))
    }
}
