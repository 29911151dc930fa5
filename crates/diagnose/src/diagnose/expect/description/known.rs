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
pub(crate) struct Known {
    /// The real frames, by place.
    pub(crate) real: Vec<Arc<Plane<f32>>>,
    /// Places of the frames that factors are learnt from: those that fits see.
    pub(crate) sources: Vec<usize>,
    pub(crate) bodies: Option<Arc<Vec<Body>>>,
    pub(crate) grid: Grid,
    pub(crate) surfaces: HashMap<String, Arc<Surface>>,
    /// Bytes of them.
    pub(crate) kept: usize,
    pub(crate) maps: HashMap<String, Arc<Map>>,
    pub(crate) settled: HashMap<String, [f64; 6]>,
    /// Whether factors have been found to do more than a curve.
    pub(crate) no_curve: bool,
    /// By place: 1 where other frames say how bright a surface is.
    pub(crate) covered: HashMap<usize, Arc<Plane<f32>>>,
}

impl Known {
    pub(crate) fn new(evidence: &Evidence) -> Self {
        Self {
            real: evidence.frames.iter().map(|f| f.dn.clone()).collect(),
            sources: evidence.fit.clone(),
            ..Self::default()
        }
    }
}
