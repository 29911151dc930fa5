//! A distortion on a picture: pixels instead of normalised coordinates, and the proof that every pixel has a ray.

use glam::DVec2;
use rayon::prelude::*;

use super::{Distortion, invertible_radius};
use crate::camera::Intrinsics;
use crate::error::{Error, LensFold, Result};

/// Ideal radius to which a mapping is followed at least: 89.9 degrees from the axis. Rays further out never meet the
/// plane that a pinhole draws on.
const MAX_TANGENT: f64 = 1e3;

/// Border points whose fold is looked for when a lens is refused.
const FOLD_SAMPLES: usize = 256;

/// A camera's pinhole and distortion. Each pixel of the picture is known to have exactly one ray.
#[derive(Clone, Debug)]
pub struct Lens {
    intrinsics: Intrinsics,
    distortion: Distortion,
    /// The mapping is one-to-one on the disc of this ideal radius, which holds the picture.
    max_radius: f64,
}

impl Lens {
    /// Checks that every pixel of the picture (to its edges) has one ray.
    ///
    /// # Errors
    /// [`Error::LensFolds`] with the first pixel that has none.
    pub fn new(intrinsics: Intrinsics, distortion: Distortion) -> Result<Self> {
        let corners = border(&intrinsics, 1);
        let furthest = corners.iter().map(|&c| normalised(&intrinsics, c).length()).fold(0.0, f64::max);
        let limit = MAX_TANGENT.max(10.0 * furthest);
        let max_radius = invertible_radius(&distortion, limit);
        let lens = Self { intrinsics, distortion, max_radius };
        if distortion.is_identity() {
            return Ok(lens);
        }
        // The preimage of the picture is bounded by that of its border: if all of the border has rays, so has the rest.
        let steps = intrinsics.width.max(intrinsics.height) as usize;
        let reachable = |lens: &Self, px: &DVec2| lens.ideal_of(normalised(&intrinsics, *px)).is_some();
        if border(&intrinsics, steps).iter().all(|px| reachable(&lens, px)) && lens.holds_centre() {
            return Ok(lens);
        }
        let radius = if max_radius < limit { max_radius } else { f64::INFINITY };
        Err(Error::LensFolds(Box::new(lens.first_fold(radius))))
    }

    /// Size and pinhole.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The model and its coefficients.
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Where the lens puts what the pinhole would put at `ideal_px`; px. Meaningful to the fold, see
    /// [`Self::max_ideal_radius`].
    pub fn distort_px(&self, ideal_px: DVec2) -> DVec2 {
        self.to_px(self.distortion.distort(normalised(&self.intrinsics, ideal_px)))
    }

    /// Where the pinhole would put what the lens puts at `distorted_px`; px. `None` only outside the picture, for
    /// points that no ray reaches. Exact to 1e-10 focal lengths away from the fold.
    pub fn undistort_px(&self, distorted_px: DVec2) -> Option<DVec2> {
        self.ideal_of(normalised(&self.intrinsics, distorted_px)).map(|ideal| self.to_px(ideal))
    }

    /// The ideal radius, in focal lengths, up to which the mapping is one-to-one.
    pub fn max_ideal_radius(&self) -> f64 {
        self.max_radius
    }

    /// For every pixel centre of the picture, row by row, where the pinhole would put its ray; px, length
    /// `width * height`.
    pub fn undistortion_table_px(&self) -> Vec<[f32; 2]> {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let mut table = vec![[0.0; 2]; w * h];
        table.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
            for (x, entry) in row.iter_mut().enumerate() {
                let px = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let ideal = self.undistort_px(px).expect("every pixel has a ray, `new` has checked");
                *entry = [ideal.x as f32, ideal.y as f32];
            }
        });
        table
    }

    /// The rectangle of ideal points that the picture shows: smallest and largest x and y, px. What a pinhole render
    /// must cover.
    pub fn ideal_bounds_px(&self) -> (DVec2, DVec2) {
        bounds(&self.ideal_border_px())
    }

    /// Ideal points of the picture's border, px.
    pub(super) fn ideal_border_px(&self) -> Vec<DVec2> {
        let steps = self.intrinsics.width.max(self.intrinsics.height) as usize;
        let ideal = |px: &DVec2| self.undistort_px(*px).expect("every pixel has a ray, `new` has checked");
        border(&self.intrinsics, steps).iter().map(ideal).collect()
    }

    fn ideal_of(&self, distorted: DVec2) -> Option<DVec2> {
        self.distortion.undistort_within(distorted, self.max_radius)
    }

    /// Whether the picture's centre has a ray: with the border, this leaves no hole.
    fn holds_centre(&self) -> bool {
        let centre = 0.5 * DVec2::new(f64::from(self.intrinsics.width), f64::from(self.intrinsics.height));
        self.ideal_of(normalised(&self.intrinsics, centre)).is_some()
    }

    fn to_px(&self, point: DVec2) -> DVec2 {
        let k = &self.intrinsics;
        DVec2::new(k.fx * point.x + k.cx, k.fy * point.y + k.cy)
    }

    /// The unreachable point of the picture nearest to the principal point, over rays to its border.
    fn first_fold(&self, ideal_radius: f64) -> LensFold {
        let k = &self.intrinsics;
        let axis = DVec2::new(k.cx, k.cy);
        let size = DVec2::new(f64::from(k.width), f64::from(k.height));
        let mut nearest = (f64::INFINITY, axis);
        for px in border(k, FOLD_SAMPLES / 4) {
            // The axis always has a ray; between it and an unreachable point lies the fold.
            let (mut reached, mut missed) = (0.0, 1.0);
            let has_ray = |at: f64| self.ideal_of(normalised(k, axis.lerp(px, at))).is_some();
            if has_ray(1.0) {
                continue;
            }
            for _ in 0..40 {
                let middle = 0.5 * (reached + missed);
                if has_ray(middle) { reached = middle } else { missed = middle }
            }
            let fold = axis.lerp(px, missed);
            let distance = fold.distance(axis);
            let inside = fold.cmpge(DVec2::ZERO).all() && fold.cmple(size).all();
            let (distance, point) = if inside { (distance, fold) } else { (px.distance(axis), px) };
            if distance < nearest.0 {
                nearest = (distance, point);
            }
        }
        let pixel = nearest.1.floor().min(size - 1.0).max(DVec2::ZERO);
        LensFold {
            pixel: [pixel.x as i64, pixel.y as i64],
            radius_px: nearest.0,
            ideal_radius,
            coefficients: self.distortion.coefficients(),
        }
    }
}

/// Smallest and largest x and y of some points.
pub(super) fn bounds(points: &[DVec2]) -> (DVec2, DVec2) {
    let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    points.iter().fold(start, |(low, high), point| (low.min(*point), high.max(*point)))
}

pub(super) fn normalised(k: &Intrinsics, px: DVec2) -> DVec2 {
    DVec2::new((px.x - k.cx) / k.fx, (px.y - k.cy) / k.fy)
}

/// Points on the picture's outline, `steps` a side.
fn border(k: &Intrinsics, steps: usize) -> Vec<DVec2> {
    let (w, h) = (f64::from(k.width), f64::from(k.height));
    let corners = [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(w, h), DVec2::new(0.0, h)];
    let side =
        |i: usize| (0..steps).map(move |s| corners[i].lerp(corners[(i + 1) % 4], s as f64 / steps as f64));
    (0..4).flat_map(side).collect()
}
