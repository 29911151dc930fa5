//! Frames in flight, of any source: the slots that hold them, the pixel chain that finishes them, and the caller's
//! operations on them. docs/synchronization.md says what waits for what.

use std::sync::Arc;
use std::time::Duration;

use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::gpu::{Context, Image};

use super::finish::{Finish, prepare};
use super::frame::Frame;
use super::slots::FrameSlot;

/// Most frames in flight.
pub const MAX_IN_FLIGHT: u32 = 16;

/// A frame that was submitted; hand it to [`super::EngineOf::collect`].
#[derive(Debug)]
#[must_use = "a submitted frame is lost unless it is collected"]
pub struct Ticket {
    pub(super) slot: usize,
}

/// Slots, and the chain behind them.
pub(crate) struct Flight {
    pub(super) slots: Vec<FrameSlot>,
    pub(super) finish: Finish,
    pub(super) limit: Duration,
    next: usize,
    size: [u32; 2],
}

/// What images and buffers are made in, for all slots.
pub(crate) struct Room<'a> {
    pub(crate) context: &'a Arc<Context>,
    pub(crate) slots: &'a mut [FrameSlot],
    /// Where the radiance goes.
    pub(crate) radiance: &'a Image,
    limit: Duration,
}

impl Room<'_> {
    /// Waits for all work in flight. Only then may the images and buffers that it uses be replaced.
    pub(crate) fn settle(&mut self) -> Result<()> {
        self.slots.iter_mut().try_for_each(|slot| slot.settle(self.limit))
    }

    /// Brings new images into their layout, at once.
    pub(crate) fn prepare<'i>(&mut self, images: impl IntoIterator<Item = &'i Image>) -> Result<()> {
        prepare(&mut self.slots[0].gpu, images)
    }
}

impl Flight {
    /// `count` slots for pictures of a camera, of a scene with `objects` objects.
    ///
    /// # Errors
    /// Sizes that the device cannot do, out of memory.
    pub(super) fn new(
        context: &Arc<Context>,
        camera: &Intrinsics,
        (count, objects): (u32, usize),
        limit: Duration,
    ) -> Result<Self> {
        let size = [camera.width, camera.height];
        check_size(size)?;
        let slot = |i| FrameSlot::new(context, size, objects, i);
        let mut slots = (0..count as usize).map(slot).collect::<Result<Vec<_>>>()?;
        let finish = Finish::new(context, size, slots.len(), &mut slots[0].gpu)?;
        Ok(Self { slots, finish, limit, next: 0, size })
    }

    /// Where a source makes what it needs.
    pub(super) fn room<'a>(&'a mut self, context: &'a Arc<Context>) -> Room<'a> {
        Room { context, slots: &mut self.slots, radiance: self.finish.radiance(), limit: self.limit }
    }

    /// The slot that the next frame takes: the first in turn that holds no frame and has nothing in flight. Frames may
    /// be collected in any order, so the next in turn may be taken while another one is free.
    fn free(&self) -> Option<usize> {
        // Where it cannot be asked, the submission says why.
        let free = |s: &FrameSlot| !s.pending() && s.finished().unwrap_or(true);
        let count = self.slots.len();
        (0..count).map(|i| (self.next + i) % count).find(|&i| free(&self.slots[i]))
    }

    /// A slot for a frame, with nothing in flight.
    ///
    /// # Panics
    /// If all slots hold frames that were not collected.
    pub(super) fn take(&mut self) -> Result<usize> {
        let index = self.free().expect("collect a frame before submitting more than fit in flight");
        // A frame that was given up between its parts may still be at work here.
        self.slots[index].wait(self.limit)?;
        Ok(index)
    }

    /// A frame is on its way in that slot.
    pub(super) fn sent(&mut self, index: usize) -> Ticket {
        self.next = (index + 1) % self.slots.len();
        Ticket { slot: index }
    }

    pub(crate) fn has_room(&self) -> bool {
        self.free().is_some()
    }

    pub(crate) fn pending(&self) -> usize {
        self.slots.iter().filter(|s| s.pending()).count()
    }

    pub(crate) fn finished(&self, ticket: &Ticket) -> Result<bool> {
        self.slots[ticket.slot].finished()
    }

    pub(crate) fn wait(&mut self, ticket: &Ticket, limit: Duration) -> Result<()> {
        self.slots[ticket.slot].wait(limit)
    }

    pub(crate) fn give_up(&mut self, ticket: &Ticket) {
        self.slots[ticket.slot].cancel();
    }

    pub(crate) fn collect(&mut self, ticket: Ticket) -> Result<Frame> {
        let slot = &mut self.slots[ticket.slot];
        let times = slot.finish(self.limit)?;
        Ok(slot.take_frame(self.size, times, &self.finish))
    }
}

fn check_size(size: [u32; 2]) -> Result<()> {
    let limit = crate::plane::MAX_SIDE_PX;
    match size.into_iter().find(|&side| side == 0 || side > limit) {
        None => Ok(()),
        Some(side) => Err(Error::Limit {
            what: "side of the picture, px",
            value: side.into(),
            limit: limit.into(),
            why: "pictures have 1 to 16384 px a side".to_owned(),
        }),
    }
}
