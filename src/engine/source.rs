//! The interface of a source: what makes the radiance of an engine's frames.

use std::time::Duration;

use super::delivery::Delivery;
use super::finish::Finish;
use super::flight::Room;
use super::frame::{FrameInstants, FrameRequest};
use super::slots::FrameSlot;
use crate::camera::Intrinsics;
use crate::error::Result;
use crate::gpu::Context;
use std::sync::Arc;

/// Makes the radiance of frames.
pub(crate) trait Source {
    /// A frame as it is asked for.
    type Frame<'a>;

    /// What every frame has: the request, and where its picture goes.
    fn asked<'f>(frame: &'f Self::Frame<'_>) -> (&'f FrameRequest, &'f Delivery);

    /// The device.
    fn context(&self) -> &Arc<Context>;

    /// Size and pinhole of the pictures.
    fn intrinsics(&self) -> &Intrinsics;

    /// Checks a frame and makes what it needs, if it is not there. Nothing is in flight in slot `index`; the others are
    /// waited for by [`Room::settle`] where something that they use is made anew.
    fn fit(&mut self, frame: &Self::Frame<'_>, room: Room<'_>, index: usize) -> Result<FrameInstants>;

    /// Records a frame that fits, its end included, and hands it to the device.
    fn submit(
        &mut self,
        frame: &Self::Frame<'_>,
        slot: &mut FrameSlot,
        finish: &Finish,
        limit: Duration,
    ) -> Result<()>;
}
