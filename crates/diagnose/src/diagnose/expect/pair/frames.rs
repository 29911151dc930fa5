//! The frames of a simulator, and what they tell of geometry.

use std::sync::Arc;

use glam::Vec2;

use shutterbug::plane::Plane;

/// What the simulated frames tell of geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Geometry {
    /// Nothing: pictures only.
    None,
    /// How the content moves from frame to frame.
    Motion,
    /// Distances and the camera's path.
    Depth,
}

/// One frame of the simulator.
#[derive(Clone)]
pub(crate) struct SimFrame {
    /// Linear radiance, shape `[height, width, 3]`.
    pub radiance: Arc<Plane<f32>>,
    /// Distance along the optical axis, m, shape `[height, width, 1]`; infinite where nothing is.
    pub depth: Option<Plane<f32>>,
    /// Where the content is one frame period later and one earlier, px from here, shape `[height, width, 2]`.
    pub motion: [Option<Plane<f32>>; 2],
    /// What moves by itself: px a period beside the camera's, shape `[height, width, 2]`.
    pub own: Option<Plane<f32>>,
    /// 1 where it may be compared, shape `[height, width, 1]`.
    pub open: Plane<f32>,
    /// Where one thing ends before another; nothing without geometry.
    pub jumps: Option<Jumps>,
}

/// All frames of the simulator, in the order of the capture that stands for the pair.
pub(crate) struct SimFrames {
    pub frames: Vec<SimFrame>,
    pub times_s: Vec<f64>,
    pub period_s: f64,
    pub geometry: Geometry,
    /// Whether the pictures' values are linear.
    pub linear: bool,
}

impl SimFrame {
    /// Speed of the content at its instant, px a period.
    pub(super) fn speed(&self, i: usize) -> [f32; 2] {
        let of = |p: &Option<Plane<f32>>| p.as_ref().map(|m| [m.data[2 * i], m.data[2 * i + 1]]);
        match (of(&self.motion[0]), of(&self.motion[1])) {
            (Some(f), Some(b)) => [0, 1].map(|k| 0.5 * (f[k] - b[k])),
            (Some(f), None) => f,
            (None, Some(b)) => b.map(|v| -v),
            (None, None) => [0.0; 2],
        }
    }

    /// Where content is `part` of a period later, px from here.
    pub(super) fn moved(&self, i: usize, part: f32) -> Vec2 {
        let of = |p: &Option<Plane<f32>>| p.as_ref().map(|m| Vec2::new(m.data[2 * i], m.data[2 * i + 1]));
        match (of(&self.motion[0]), of(&self.motion[1])) {
            (Some(f), Some(b)) => 0.5 * part * (f - b) + 0.5 * part * part * (f + b),
            (Some(f), None) => part * f,
            (None, Some(b)) => -part * b,
            (None, None) => Vec2::ZERO,
        }
    }
}

/// How much nearer one side of an edge is, or how much further it goes, pixel by pixel.
#[derive(Clone)]
pub(crate) struct Jumps {
    /// Jump of the inverse distance, 1/m, or of the motion, px a period, to the next pixels.
    pub(super) plane: Plane<f32>,
    pub(super) most: f32,
}

impl Jumps {
    pub(super) fn of(frame: &SimFrame, geometry: Geometry) -> Option<Self> {
        let (w, h) = (frame.radiance.width, frame.radiance.height);
        let value = |i: usize| -> Option<Vec2> {
            match geometry {
                Geometry::Depth => Some(Vec2::new(1.0 / frame.depth.as_ref()?.data[i], 0.0)),
                Geometry::Motion => Some(Vec2::from(frame.speed(i))),
                Geometry::None => None,
            }
        };
        value(0)?;
        let jump = |x: usize, y: usize| {
            let here = value(y * w + x).unwrap_or_default();
            let there = [(x + 1).min(w - 1) + y * w, (y + 1).min(h - 1) * w + x];
            there.iter().filter_map(|&i| value(i)).map(|v| (v - here).length()).fold(0.0, f32::max)
        };
        let plane = Plane::from_fn(w, h, |x, y| [jump(x, y)]);
        let most = plane.data.iter().copied().fold(0.0, f32::max);
        Some(Self { plane, most })
    }
}
