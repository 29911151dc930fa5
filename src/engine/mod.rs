//! A capture's frames on the device: owns the resources, records one submission a frame, reads the picture back.
//!
//! ```text
//! FrameRequest ─ method (raster, gather | accumulate) ─ radiance ─ chain of pixel effects ─ readback ─ Frame
//! ```
//!
//! Every instant comes from the request: nothing depends on a previous call, so frames may be asked for in any order.

mod accumulation;
mod delivery;
mod exact;
mod fast;
mod finish;
mod frame;
mod outside;
mod paper;
mod pixel_chain;
mod scene;
mod slots;

use std::sync::Arc;
use std::time::Duration;

use crate::camera::{Intrinsics, Trajectory};
use crate::chain::Settings;
use crate::effects::Defocus;
use crate::error::{Error, Result};
use crate::gpu::{Context, PassTime};
use crate::raster::{SamplePlan, SceneBuffers};
use crate::scene::Scene;

pub use accumulation::AccumulationOptions;
pub use delivery::Delivery;
pub use exact::ExactOptions;
pub use fast::FastOptions;
pub use fast::pass::{FastBinding, FastGather, FastImages, FastKind, FastTiming, MOVED_BYTES, MOVED_STEPS};
pub use frame::{Frame, FrameInstants, FrameRequest, FrameStatistics, Planes};
pub use outside::OutsideEngine;
pub use outside::frame::{
    MAX_BODIES, MAX_OUTSIDE_MOTIONS, MAX_PICTURES, OutsideBodies, OutsideFrame, OutsideMotion,
    OutsidePicture, OutsidePixels, PixelSource,
};
pub use outside::lens::{BorderRays, MarginNeed, OutsideLens};
pub use paper::gather::{
    ChosenBy, GATHER_KERNELS, Gather, GatherChoice, GatherKernel, cache_path, choose_gather,
};
pub use paper::{MotionSource, PaperOptions, Shift};
pub use pixel_chain::PixelChain;
pub use scene::margin::{Reach, reach};
pub use scene::taps::{GatherInputs, WarpInputs};

use accumulation::Accumulation;
use exact::Exact;
use fast::Fast;
use finish::Finish;
use paper::Paper;
use scene::Stage;
use scene::lens::{LensKey, LensStage};
use scene::planes::PlanesPass;
use slots::{FrameSlot, free_slot};

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

/// Most frames in flight.
pub const MAX_IN_FLIGHT: u32 = 16;

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

/// Renders frames of one scene through one camera.
pub struct Engine {
    slots: Vec<FrameSlot>,
    next: usize,
    renderer: Renderer,
    finish: Finish,
    planes: Option<PlanesPass>,
    options: EngineOptions,
    stage: Stage,
}

enum Renderer {
    Paper(Box<Paper>),
    Fast(Box<Fast>),
    Exact(Box<Exact>),
    Accumulation(Box<Accumulation>),
}

/// A frame that was submitted; hand it to [`Engine::collect`].
#[derive(Debug)]
#[must_use = "a submitted frame is lost unless it is collected"]
pub struct Ticket {
    slot: usize,
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
        check_size(&intrinsics)?;
        let mut stage = Stage {
            buffers: SceneBuffers::new(context, &scene)?,
            plan: SamplePlan::new(options.samples, &context.info().sample_counts)?,
            scene,
            trajectory,
            intrinsics,
            lens: None,
            context: context.clone(),
        };
        let count = options.frames_in_flight.clamp(1, MAX_IN_FLIGHT) as usize;
        let mut slots = (0..count).map(|i| FrameSlot::new(&stage, i)).collect::<Result<Vec<_>>>()?;
        let size = [intrinsics.width, intrinsics.height];
        let finish = Finish::new(context, size, count, &mut slots[0].gpu)?;
        let first = expected.first().map(|first| &first.settings);
        if let Some((key, settings)) = first.and_then(|s| Some((LensKey::of(s)?, s))) {
            check_lens(&options.method)?;
            let radiance = finish.radiance();
            let mut lens = LensStage::new(&stage, key, expected, &mut slots, radiance)?;
            if needs_cut(&options, settings) {
                lens.cut(&stage)?;
            }
            stage.lens = Some(lens);
        }
        let renderer = match &options.method {
            Method::Paper(paper) => {
                Renderer::Paper(Box::new(Paper::new(&stage, paper, &mut slots, finish.radiance(), expected)?))
            }
            Method::Fast(fast) => {
                Renderer::Fast(Box::new(Fast::new(&stage, fast, &mut slots, finish.radiance(), expected)?))
            }
            Method::Exact(exact) => {
                Renderer::Exact(Box::new(Exact::new(&stage, exact, &mut slots, finish.radiance(), expected)?))
            }
            Method::Accumulation(accumulation) => {
                let pass = Accumulation::new(&stage, accumulation, &mut slots, finish.radiance())?;
                Renderer::Accumulation(Box::new(pass))
            }
        };
        let by_depth = |r: &FrameRequest| Defocus::needs_depth(&r.settings);
        let planes = if options.planes || expected.iter().any(by_depth) {
            Some(PlanesPass::new(&stage, &mut slots, finish.radiance())?)
        } else {
            None
        };
        Ok(Self { slots, next: 0, renderer, finish, planes, options, stage })
    }

    /// The camera as it was given, without margin.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.stage.intrinsics
    }

    /// Gives the engine another camera of the same size, or another path: what a fit of the set-up does between frames.
    ///
    /// # Panics
    /// If the size differs: a bug of the caller.
    pub fn aim(&mut self, intrinsics: Intrinsics, trajectory: Arc<Trajectory>) {
        let size = |k: &Intrinsics| (k.width, k.height);
        assert_eq!(size(&intrinsics), size(&self.stage.intrinsics), "an engine's pictures keep their size");
        (self.stage.intrinsics, self.stage.trajectory) = (intrinsics, trajectory);
    }

    /// Lets go of what the frames so far have left behind for those that follow: triangles cut for the longest readout,
    /// images with the widest margin, a lens. The pictures of the exact method are from here on those of a fresh engine, to
    /// the last bit; the next frame takes longer.
    ///
    /// # Errors
    /// Device lost, or the time limit passed: frames in flight are waited for.
    pub fn forget(&mut self) -> Result<()> {
        self.settle()?;
        self.stage.lens = None;
        if let Renderer::Exact(exact) = &mut self.renderer {
            exact.forget();
        }
        Ok(())
    }

    /// Pixels rendered beyond each side of the picture (columns, rows).
    pub fn margin_px(&self) -> [u32; 2] {
        match &self.renderer {
            Renderer::Paper(paper) => paper.margin_px(),
            Renderer::Fast(fast) => fast.margin_px(),
            Renderer::Exact(exact) => exact.margin_px(),
            Renderer::Accumulation(_) => [0, 0],
        }
    }

    /// How many frames can be submitted before one must be collected.
    pub fn frames_in_flight(&self) -> usize {
        self.slots.len()
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
        let index = free_slot(&self.slots, self.next);
        let index = index.expect("collect a frame before submitting more than fit in flight");
        // A frame that was given up between its parts may still be at work here.
        self.slots[index].wait(self.options.time_limit)?;
        scene::check_coverage(&self.stage, request)?;
        let path = scene::camera_path(&self.stage, request);
        self.fit_lens(request)?;
        self.widen(request)?;
        if self.planes.is_none() && Defocus::needs_depth(&request.settings) {
            self.settle()?;
            self.planes = Some(PlanesPass::new(&self.stage, &mut self.slots, self.finish.radiance())?);
        }
        let slot = &mut self.slots[index];
        let view = request.view(self.stage.intrinsics);
        self.finish.fit((&request.settings, &view), delivery.wanted(), (&mut slot.gpu, slot.index))?;
        slot.start(request, scene::instants(&path, &request.shutter));
        let last = (&self.finish, self.planes.as_ref());
        let done = match &mut self.renderer {
            Renderer::Paper(pass) => pass.submit(&self.stage, slot, request, &path, last),
            Renderer::Fast(pass) => pass.submit(&self.stage, slot, request, &path, last),
            Renderer::Exact(pass) => pass.submit(&self.stage, slot, request, &path, last),
            Renderer::Accumulation(pass) => {
                pass.submit(&self.stage, slot, request, &path, last, self.options.time_limit)
            }
        };
        if let Err(error) = done.and_then(|()| slot.deliver(&self.stage, delivery)) {
            slot.cancel();
            return Err(error);
        }
        self.next = (index + 1) % self.slots.len();
        Ok(Ticket { slot: index })
    }

    /// Waits for all work in flight.
    fn settle(&mut self) -> Result<()> {
        self.slots.iter_mut().try_for_each(|slot| slot.settle(self.options.time_limit))
    }

    /// Makes what depends on the lens anew where a frame has another one than the frame before it.
    fn fit_lens(&mut self, request: &FrameRequest) -> Result<()> {
        let key = LensKey::of(&request.settings);
        if self.stage.lens.as_ref().map(|l| l.key) == key {
            return Ok(());
        }
        self.settle()?;
        self.stage.lens = None;
        if let Renderer::Exact(exact) = &mut self.renderer {
            exact.forget_lens();
        }
        let Some(key) = key else { return Ok(()) };
        check_lens(&self.options.method)?;
        let expected = std::slice::from_ref(request);
        let radiance = self.finish.radiance();
        let mut lens = LensStage::new(&self.stage, key, expected, &mut self.slots, radiance)?;
        if needs_cut(&self.options, &request.settings) {
            lens.cut(&self.stage)?;
        }
        self.stage.lens = Some(lens);
        Ok(())
    }

    /// Makes the images anew where a frame needs a wider margin than any before it.
    fn widen(&mut self, request: &FrameRequest) -> Result<()> {
        if let Renderer::Exact(exact) = &mut self.renderer {
            if exact.needs_fit(&self.stage, request) {
                for slot in &mut self.slots {
                    slot.settle(self.options.time_limit)?;
                }
                exact.fit(&self.stage, &mut self.slots, self.finish.radiance(), request)?;
            }
            return Ok(());
        }
        let needed = match &self.renderer {
            Renderer::Paper(paper) => paper.needs_wider(&self.stage, request),
            Renderer::Fast(fast) => fast.needs_wider(&self.stage, request),
            Renderer::Exact(_) | Renderer::Accumulation(_) => None,
        };
        let Some(margin_px) = needed else { return Ok(()) };
        self.settle()?;
        tracing::info!("the margin grows to {margin_px:?} px for frame {}", request.index);
        let (stage, slots, radiance) = (&self.stage, &mut self.slots[..], self.finish.radiance());
        match &mut self.renderer {
            Renderer::Paper(paper) => paper.widen(stage, slots, radiance, margin_px),
            Renderer::Fast(fast) => fast.widen(stage, slots, radiance, margin_px),
            Renderer::Exact(_) | Renderer::Accumulation(_) => Ok(()),
        }
    }

    /// Waits for a frame and reads it back.
    ///
    /// # Errors
    /// Device lost, or the time limit passed.
    pub fn collect(&mut self, ticket: Ticket) -> Result<Frame> {
        let slot = &mut self.slots[ticket.slot];
        let times: Vec<PassTime> = slot.finish(self.options.time_limit)?;
        let size = [self.stage.intrinsics.width, self.stage.intrinsics.height];
        let planes = self.planes.as_ref().filter(|_| slot.wants_planes()).map(|p| p.read(slot.index));
        Ok(slot.take_frame(size, times, planes, &self.finish))
    }

    /// Submits and collects one frame.
    ///
    /// # Errors
    /// As for [`Self::submit`] and [`Self::collect`].
    pub fn render(&mut self, request: &FrameRequest) -> Result<Frame> {
        let ticket = self.submit(request)?;
        self.collect(ticket)
    }
}

/// Whether triangles are drawn as they stand at an instant: `exact` cuts its own.
fn needs_cut(options: &EngineOptions, settings: &Settings) -> bool {
    options.planes || Defocus::needs_depth(settings) || !matches!(options.method, Method::Exact(_))
}

/// Refuses a choice of method that knows only the pinhole.
fn check_lens(method: &Method) -> Result<()> {
    match method {
        Method::Paper(PaperOptions { motion_source: MotionSource::Depth, .. }) => Err(Error::Contradiction {
            effect: "lens_distortion",
            what: "motion from depth (the paper's reconstruction) knows only the ideal pinhole; use rasterized motion"
                .to_owned(),
        }),
        _ => Ok(()),
    }
}

fn check_size(intrinsics: &Intrinsics) -> Result<()> {
    for side in [intrinsics.width, intrinsics.height] {
        if side == 0 || side > crate::plane::MAX_SIDE_PX {
            return Err(Error::Limit {
                what: "side of the picture, px",
                value: side.into(),
                limit: crate::plane::MAX_SIDE_PX.into(),
                why: "pictures have 1 to 16384 px a side".to_owned(),
            });
        }
    }
    Ok(())
}
