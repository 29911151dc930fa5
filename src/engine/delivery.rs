//! Delivers a frame on the device, besides the picture in host memory: waits for and signals the host's semaphores, and
//! copies the picture to the host's memory or image.

use crate::chain::Wanted;
use crate::error::Result;
use crate::gpu::{Buffer, Context, Recorder, Shared, SignalAt, Slot};
use std::sync::Arc;

/// What of the host's takes part in a frame.
#[derive(Clone, Default)]
pub struct Delivery {
    /// The picture is copied there too: bytes get it as tightly packed RGBA8 (at least `4 width height`), images have
    /// the picture's size and such a format. Without the effects that act in host memory (`jpeg`).
    pub to: Option<Shared>,
    /// What the device waits for: before it reads pictures from outside, else before it writes to `to`.
    pub wait: Option<SignalAt>,
    /// Signalled when all of it is done.
    pub signal: Option<SignalAt>,
    /// Whether the picture's values before they are rounded to 8 bits are read back too ([`super::Frame::values`]).
    pub values: bool,
    /// Whether what the converter delivers is read back too ([`super::Frame::raw`]); with `bayer_mosaic`.
    pub raw: bool,
}

impl Delivery {
    /// What of the pixel chain is wanted.
    pub(crate) fn wanted(&self) -> Wanted {
        Wanted { pixels: true, values: self.values, raw: self.raw }
    }

    /// Whether nothing is to be done behind the frame's own work.
    pub fn is_empty(&self) -> bool {
        self.to.is_none() && self.wait.is_none() && self.signal.is_none()
    }

    /// Records the copy of a picture that is there.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, picture: &Buffer) {
        match &self.to {
            None => return,
            Some(Shared::Buffer(to)) => recorder.copy_buffer(picture, to, picture.bytes()),
            Some(Shared::Image(to)) => recorder.copy_buffer_to_shared(picture, to),
        }
        recorder.barrier();
    }
}

/// A delivery as a separate submission after that of a frame.
pub(crate) struct After {
    pub(crate) gpu: Slot,
    /// What the work in flight uses.
    kept: Delivery,
}

impl After {
    pub(crate) fn new(context: &Arc<Context>) -> Result<Self> {
        Ok(Self { gpu: Slot::new(context, "delivery")?, kept: Delivery::default() })
    }

    /// Hands the copy to the device; nothing of this may be in flight.
    pub(crate) fn submit(&mut self, delivery: &Delivery, picture: &Buffer) -> Result<()> {
        let mut recorder = self.gpu.begin()?;
        delivery.record(&mut recorder, picture);
        recorder.finish();
        self.kept = delivery.clone();
        self.gpu.submit_between(delivery.wait.as_ref(), delivery.signal.as_ref())
    }

    /// The work is over: the host may have its things back.
    pub(crate) fn release(&mut self) {
        self.kept = Delivery::default();
    }
}
