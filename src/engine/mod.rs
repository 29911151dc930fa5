//! A capture's frames on the device: owns the resources, records one command submission per frame, reads the picture
//! back.
//!
//! ```text
//! frame ─ source (a scene by one of four methods | pictures from outside) ─ radiance
//!       ─ chain of pixel effects ─ readback ─ Frame
//! ```
//!
//! All times come from the request. Nothing depends on a previous call, so frames may be asked for in any order.
//!
//! [`EngineOf`] has what all frames share: slots, the chain, delivery. A `Source` makes the radiance, and there are
//! two: [`Scenes`] and [`Outside`]. What the four methods of a scene differ in is a `scene::Renderer`.

mod accumulation;
mod delivery;
mod exact;
mod fast;
mod finish;
mod flight;
mod frame;
mod methods;
mod outside;
mod paper;
mod pixel_chain;
mod scene;
mod slots;
mod source;

use std::time::Duration;

use crate::camera::Intrinsics;
use crate::error::Result;

pub use accumulation::AccumulationOptions;
pub use delivery::Delivery;
pub use exact::ExactOptions;
pub use fast::FastOptions;
pub use fast::pass::{FastBinding, FastGather, FastImages, FastKind, FastTiming, MOVED_BYTES, MOVED_STEPS};
pub use flight::{MAX_IN_FLIGHT, Ticket};
pub use frame::{Frame, FrameInstants, FrameRequest, FrameStatistics, Planes};
pub use methods::{EngineOptions, Method, Scenes};
pub use outside::Outside;
pub use outside::frame::{
    MAX_BODIES, MAX_OUTSIDE_MOTIONS, MAX_PICTURES, OutsideBodies, OutsideFrame, OutsideMotion,
    OutsidePicture, OutsidePixels, PixelSource,
};
pub use outside::lens::{BorderRays, MarginNeed, OutsideLens};
pub use paper::gather::{ChosenBy, GatherChoice, cache_path, choose_gather};
pub use paper::kernels::{GATHER_KERNELS, Gather, GatherKernel};
pub use paper::{MotionSource, PaperOptions, Shift};
pub use pixel_chain::PixelChain;
pub use scene::reach::{Reach, reach};
pub use scene::taps::{GatherInputs, WarpInputs};

pub(crate) use flight::Flight;
use source::Source;

/// Frames through one camera, whatever makes their radiance.
pub struct EngineOf<S> {
    source: S,
    flight: Flight,
}

/// Renders frames of one scene through one camera.
pub type Engine = EngineOf<Scenes>;

/// Processes frames from outside for one camera.
pub type OutsideEngine = EngineOf<Outside>;

impl<S> EngineOf<S> {
    /// How many frames can be submitted before one must be collected.
    pub fn frames_in_flight(&self) -> usize {
        self.flight.slots.len()
    }

    /// Whether another frame can be submitted before one is collected.
    pub fn has_room(&self) -> bool {
        self.flight.has_room()
    }

    /// How many frames were submitted and not collected.
    pub fn pending(&self) -> usize {
        self.flight.pending()
    }

    /// Whether a frame can be collected without waiting.
    ///
    /// # Errors
    /// Device lost.
    pub fn finished(&self, ticket: &Ticket) -> Result<bool> {
        self.flight.finished(ticket)
    }

    /// Waits for a frame without taking it.
    ///
    /// # Errors
    /// Device lost; not finished within `limit`: then it can be waited for again.
    pub fn wait(&mut self, ticket: &Ticket, limit: Duration) -> Result<()> {
        self.flight.wait(ticket, limit)
    }

    /// Gives up a frame. Its slot is free once the device has finished the frame's work.
    pub fn give_up(&mut self, ticket: &Ticket) {
        self.flight.give_up(ticket);
    }

    /// Waits for a frame and reads it back. Poses in the instants of a frame from outside are the identity: none are
    /// known.
    ///
    /// # Errors
    /// Device lost, or the time limit passed.
    pub fn collect(&mut self, ticket: Ticket) -> Result<Frame> {
        self.flight.collect(ticket)
    }

    /// What the frames in flight have in common, of any engine.
    pub(crate) fn flight(&mut self) -> &mut Flight {
        &mut self.flight
    }
}

#[expect(private_bounds, reason = "what a source is, is nobody else's business")]
impl<S: Source> EngineOf<S> {
    /// The camera as it was given, without margin.
    pub fn intrinsics(&self) -> &Intrinsics {
        self.source.intrinsics()
    }

    /// Every frame's way to the device.
    fn send(&mut self, frame: &S::Frame<'_>) -> Result<Ticket> {
        let index = self.flight.take()?;
        let (source, flight) = (&mut self.source, &mut self.flight);
        let context = source.context().clone();
        let instants = source.fit(frame, flight.room(&context), index)?;
        let (request, delivery) = S::asked(frame);
        let view = request.view(*source.intrinsics());
        let slot = &mut flight.slots[index];
        flight.finish.fit((&request.settings, &view), delivery.wanted(), (&mut slot.gpu, index))?;
        slot.start(request, instants);
        if let Err(error) = source.submit(frame, slot, &flight.finish, flight.limit) {
            slot.cancel();
            return Err(error);
        }
        Ok(flight.sent(index))
    }
}

impl<S> Drop for EngineOf<S> {
    fn drop(&mut self) {
        // Slots wait for their work when they are dropped; what the work uses goes after them.
        self.flight.slots.clear();
    }
}
