//! What has been worked out about the description, kept.

use std::collections::HashMap;
use std::sync::Arc;

use super::grid::{Grid, Surface};
use super::radiance::Map;
use super::rays::Body;
use crate::diagnose::evidence::Evidence;
use shutterbug::plane::Plane;

/// What has been worked out about the description.
#[derive(Default)]
pub(in crate::diagnose) struct Known {
    /// The real frames, by place.
    pub(super) real: Vec<Arc<Plane<f32>>>,
    /// Places of the frames that factors are learnt from: those that fits see.
    pub(super) sources: Vec<usize>,
    pub(super) bodies: Option<Arc<Vec<Body>>>,
    pub(super) grid: Grid,
    pub(super) surfaces: HashMap<String, Arc<Surface>>,
    /// Bytes of them.
    pub(super) kept: usize,
    pub(super) maps: HashMap<String, Arc<Map>>,
    pub(super) settled: HashMap<String, [f64; 6]>,
    /// Whether factors have been found to do more than a curve.
    pub(super) no_curve: bool,
    /// By place: 1 where other frames say how bright a surface is.
    pub(super) covered: HashMap<usize, Arc<Plane<f32>>>,
}

impl Known {
    pub(in crate::diagnose) fn new(evidence: &Evidence) -> Self {
        Self {
            real: evidence.frames.iter().map(|f| f.dn.clone()).collect(),
            sources: evidence.fit.clone(),
            ..Self::default()
        }
    }
}
