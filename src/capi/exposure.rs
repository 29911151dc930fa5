//! Automatic exposure over an engine's frames, in the order of their submission. The control itself is
//! [`ExposureControl`], the one that `simulate` uses.

use super::status::{self, Fault, Outcome};
use crate::chain::Settings;
use crate::effects::ExposureControl;
use crate::engine::{Frame, FrameRequest};

/// The control, if the camera has one.
#[derive(Default)]
pub struct Exposure {
    /// As it was before the first frame.
    fresh: Option<ExposureControl>,
    control: Option<ExposureControl>,
    /// Frames since it began.
    next: usize,
    /// Which beginning this is: frames of an earlier one are not metered.
    run: u64,
}

/// A frame's place in a run.
#[derive(Clone, Copy)]
pub struct Place {
    run: u64,
    frame: usize,
}

impl Exposure {
    /// Takes a camera's values. If they differ from the current ones, exposure restarts.
    pub fn set(&mut self, settings: &Settings) {
        let fresh = ExposureControl::new(settings);
        if fresh != self.fresh {
            self.fresh = fresh;
            self.reset();
        }
    }

    /// Restarts: the next frame has `initial_gain`.
    pub fn reset(&mut self) {
        self.control = self.fresh.clone();
        self.next = 0;
        self.run += 1;
    }

    /// Gives the next frame its gain.
    pub fn apply(&mut self, request: &mut FrameRequest) -> Outcome<()> {
        let Some(control) = &mut self.control else { return Ok(()) };
        if let Some(frame) = control.missing(self.next).next() {
            let back = self.next - frame;
            return Err(Fault::new(
                status::STATE,
                format!(
                    "auto_exposure: this frame answers to the one submitted {back} before it, which has not been \
                     waited for (or failed: then shutterbug_engine_reset_exposure); delay_frames says how many may \
                     be in flight"
                ),
            ));
        }
        request.settings = control.settings(self.next, &request.settings)?;
        control.forget_before(self.next);
        Ok(())
    }

    /// The frame that [`Self::apply`] was for is on its way.
    pub fn submitted(&mut self) -> Place {
        let place = Place { run: self.run, frame: self.next };
        self.next += 1;
        place
    }

    /// A frame is there.
    pub fn meter(&mut self, place: Place, frame: &Frame) {
        if let Some(control) = self.control.as_mut().filter(|_| place.run == self.run) {
            control.meter(place.frame, &frame.picture);
        }
    }
}
