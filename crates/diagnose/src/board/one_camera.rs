//! Whether one camera took all pictures. Corners are found each for itself: of one camera, what they are off by is no
//! more alike between neighbours than between others, and no picture asks for a focal length of its own.

use super::bundle::{Bundle, Point};
use super::target::View;
use shutterbug::error::Result;

/// How often pictures of one camera are said to be of several.
const ALPHA: f64 = 0.01;
/// Focal lengths in the list of parameters.
const FOCAL: [usize; 2] = [0, 1];

/// What speaks against one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct OneCamera {
    /// Share of the squared errors that neighbouring points have in common: 0 where each is found for itself.
    pub shared: f64,
    /// Views that fit a focal length of their own beyond chance, and that length over the common one.
    pub own_focal: Vec<(usize, f64)>,
}

impl OneCamera {
    /// Whether most of what the points are off by is not theirs: the camera, the board or a point's number is another.
    pub fn is_misfit(&self) -> bool {
        self.shared > 0.5
    }

    /// Of stills; nothing of frames that follow each other, which are blurred and bent by motion.
    pub(super) fn judge(bundle: &Bundle, views: &[View]) -> Result<Option<Self>> {
        if bundle.starts_s.is_some() {
            return Ok(None);
        }
        let joint = bundle.residuals()?;
        let shared = neighbours(&joint, views);
        let alone = (0..views.len()).map(|v| with_own_focal(bundle, v)).collect::<Result<Vec<_>>>()?;
        let mut own_residuals = Vec::new();
        for own in &alone {
            own_residuals.extend(own.residuals()?);
        }
        // Neighbours that share what they are off by count as fewer.
        let alike = neighbours(&own_residuals, views).clamp(0.0, 0.9);
        let alike_points = ((1.0 + alike) / (1.0 - alike)).powi(2);
        let square = |r: &[glam::DVec2]| r.iter().map(|d| d.length_squared()).sum::<f64>();
        let mut own_focal = Vec::new();
        for (view, own) in alone.iter().enumerate() {
            let (with, without) = (square(&own_residuals[view]), square(&joint[view]));
            let points = bundle.points[view].len() as f64;
            let free = ((2.0 * points - 8.0) / alike_points).max(1.0);
            // Fisher's ratio with two degrees of freedom has this tail.
            let chance = (without / with.max(1e-300)).powf(-0.5 * free);
            if chance < ALPHA / views.len() as f64 {
                let [fx, fy] = FOCAL.map(|i| own.camera.values[i] / bundle.camera.values[i]);
                own_focal.push((view, (fx * fy).sqrt()));
            }
        }
        Ok(Some(Self { shared, own_focal }))
    }
}

/// The view alone, with pose and focal lengths of its own.
fn with_own_focal(bundle: &Bundle, view: usize) -> Result<Bundle> {
    let points: Vec<Vec<Point>> = vec![bundle.points[view].clone()];
    let mut own = Bundle { camera: bundle.camera, poses: vec![bundle.poses[view]], points, starts_s: None };
    for _ in 0..3 {
        own.fit(&FOCAL, own.spread_px()?)?;
    }
    Ok(own)
}

/// Correlation of the errors of points next to each other along rows and columns.
fn neighbours(residuals: &[Vec<glam::DVec2>], views: &[View]) -> f64 {
    let (mut product, mut squares) = (0.0, 0.0);
    for (view, errors) in views.iter().zip(residuals) {
        let at: std::collections::BTreeMap<[usize; 2], glam::DVec2> =
            view.seen.iter().map(|s| s.point).zip(errors.iter().copied()).collect();
        for ([c, r], a) in &at {
            for b in [[c + 1, *r], [*c, r + 1]].iter().filter_map(|p| at.get(p)) {
                product += a.dot(*b);
                squares += 0.5 * (a.length_squared() + b.length_squared());
            }
        }
    }
    product / f64::max(squares, 1e-300)
}
