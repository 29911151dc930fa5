//! Simulated frames in the place of a scene.

use std::sync::Arc;

use super::frames::{SimFrame, SimFrames};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::sharp::Sharp;
use shutterbug::plane::Plane;

/// The simulator's frames as a forward model reads them.
pub(crate) struct Outside {
    pub sim: Arc<SimFrames>,
    /// By place in the evidence: the frame's number.
    pub index: Vec<usize>,
    /// By place: how far from each pixel its content is, px, shape `[height, width, 2]`; of frames that were aligned.
    pub shift: Vec<Option<Arc<Plane<f32>>>>,
    /// By place: how far a warped frame still lies off, px.
    pub left_px: Vec<f32>,
}

impl Outside {
    pub(crate) fn new(sim: &Arc<SimFrames>, evidence: &Evidence) -> Self {
        let index: Vec<usize> = evidence.frames.iter().map(|f| f.index).collect();
        let shift = index.iter().map(|_| None).collect();
        let left_px = vec![0.0; index.len()];
        Self { sim: sim.clone(), index, shift, left_px }
    }

    pub(crate) fn frame(&self, at: usize) -> &SimFrame {
        &self.sim.frames[self.index[at]]
    }

    /// What a frame is like, see [`Sharp`].
    pub(crate) fn sharp(&self, at: usize) -> Sharp {
        let frame = self.frame(at);
        let (w, h) = (frame.radiance.width, frame.radiance.height);
        let per_s = (1.0 / self.sim.period_s) as f32;
        let velocity = Plane::from_fn(w, h, |x, y| frame.speed(y * w + x).map(|v| v * per_s));
        let depth = frame.depth.clone().unwrap_or_else(|| Plane::from_fn(w, h, |_, _| [f32::INFINITY]));
        let own = frame
            .own
            .as_ref()
            .map(|own| Plane { data: own.data.iter().map(|v| v * per_s).collect(), ..*own });
        Sharp { velocity, own, depth, coverage: frame.open.clone() }
    }
}
