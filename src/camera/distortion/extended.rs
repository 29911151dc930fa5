//! A lens as a map of the whole plane, for drawing: triangles have corners far outside the picture and behind the
//! camera, where a polynomial folds back or means nothing.
//!
//! Up to an ideal radius R that holds all that the picture shows the map is the lens's. Beyond, along each direction n,
//! it goes on linearly: D(R n) + s (r - R) n, with a slope s that is at least that of the lens and at least D(r) / r.
//! The first makes it one-to-one, the second keeps a straight edge whose ends are mapped and which stays outside of R
//! from crossing the picture.

use glam::{DVec2, DVec3};

use super::lens::{bounds, normalised};
use super::{Distortion, Lens};
use crate::camera::Intrinsics;

/// How much more than the picture's furthest ray the model is followed, where it can be.
const REACH: (f64, f64) = (1.25, 0.1);
/// Share of the way to the fold that is used.
const BEFORE_FOLD: f64 = 0.9;
/// How much steeper than at the picture's furthest ray the model may become where it is followed. Before a pole it
/// grows without end, and what lies there, which nobody sees, would be cut without end.
const STEEPER: f64 = 2.0;
/// Rings in which the curvature is known, equally spaced in the angle from the axis, and directions looked at in each.
const RINGS: usize = 32;
const DIRECTIONS: usize = 16;

/// A lens, continued.
#[derive(Clone, Debug)]
pub struct ExtendedLens {
    lens: Lens,
    radius: f64,
    slope: f64,
    /// Outer radius of each ring, and the largest second derivative in it.
    rings: Vec<(f64, f64)>,
    stretch: f64,
}

/// Ideal radius of the furthest of some ideal points (px), focal lengths.
fn furthest(k: &Intrinsics, points_px: &[DVec2]) -> f64 {
    points_px.iter().map(|px| normalised(k, *px).length()).fold(0.0, f64::max)
}

/// How far from what is `seen` to `reach` a lens may be followed before it is [`STEEPER`].
fn before_steeper(distortion: &Distortion, seen: f64, reach: f64) -> f64 {
    let slope = |r: f64| {
        let along = (0..DIRECTIONS).map(|d| {
            let n = DVec2::from_angle(std::f64::consts::TAU * d as f64 / DIRECTIONS as f64);
            (distortion.distort_with_jacobian(n * r).1 * n).length()
        });
        along.fold(0.0, f64::max)
    };
    let most = STEEPER * slope(seen);
    let step = (reach - seen) / RINGS as f64;
    match (1..=RINGS).take_while(|k| slope(seen + step * *k as f64) <= most).count() {
        RINGS => reach,
        // One step at least: a pixel at the border is larger than its middle.
        within => seen + step * within.max(1) as f64,
    }
}

impl ExtendedLens {
    /// Continues a lens beyond the picture's rays.
    pub fn new(lens: Lens) -> Self {
        let k = *lens.intrinsics();
        let seen = lens.ideal_border_px();
        let (low, high) = bounds(&seen);
        let needed = furthest(&k, &[low, high, DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)]);
        let fold = lens.max_ideal_radius();
        let wanted = REACH.0 * needed + REACH.1;
        // The bounds' corners may lie beyond what the picture shows, and beyond the fold.
        let radius = if needed < fold {
            let reach = wanted.min(needed + BEFORE_FOLD * (fold - needed));
            before_steeper(lens.distortion(), furthest(&k, &seen), reach)
        } else {
            fold
        };
        let mut extended = Self { lens, radius, slope: 1.0, rings: Vec::new(), stretch: 1.0 };
        extended.measure();
        extended
    }

    /// Slope, curvature and stretch.
    fn measure(&mut self) {
        let distortion = *self.lens.distortion();
        let (mut slope, mut stretch) = (0.1_f64, 0.0_f64);
        for ring in 0..RINGS {
            let r = self.ring_radius(ring as f64 + 0.5);
            let h = 1e-4 * (1.0 + r);
            let mut bend = 0.0_f64;
            for d in 0..DIRECTIONS {
                let n = DVec2::from_angle(std::f64::consts::TAU * d as f64 / DIRECTIONS as f64);
                let (at, jacobian) = distortion.distort_with_jacobian(n * r);
                slope = slope.max(at.dot(n) / r);
                stretch = stretch.max((jacobian * n).length()).max((jacobian * n.perp()).length());
                for along in [n, n.perp(), (n + n.perp()).normalize(), (n - n.perp()).normalize()] {
                    let step = |sign: f64| distortion.distort_with_jacobian(n * r + along * (sign * h)).1;
                    let change = (step(1.0) * along - step(-1.0) * along) / (2.0 * h);
                    bend = bend.max(change.length());
                }
                if ring == RINGS - 1 {
                    let (edge, at_edge) = distortion.distort_with_jacobian(n * self.radius);
                    slope = slope.max((at_edge * n).dot(n)).max(edge.dot(n) / self.radius);
                }
            }
            self.rings.push((self.ring_radius(ring as f64 + 1.0), bend));
        }
        (self.slope, self.stretch) = (slope, stretch.max(slope));
    }

    fn ring_radius(&self, ring: f64) -> f64 {
        (self.radius.atan() * ring / RINGS as f64).tan()
    }

    /// The lens that is continued.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Ideal radius up to which the map is the lens's, focal lengths.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Slope beyond.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// How much longer the map makes things, at most.
    pub fn stretch(&self) -> f64 {
        self.stretch
    }

    /// Largest second derivative between two ideal radii; beyond [`Self::radius`] the map is taken for straight.
    pub fn bend(&self, low: f64, high: f64) -> f64 {
        let ring = |r: f64| self.rings.partition_point(|ring| ring.0 < r).min(RINGS - 1);
        self.rings[ring(low)..=ring(high)].iter().fold(0.0, |most, ring| most.max(ring.1))
    }

    /// Where the map puts an ideal point; both normalised.
    pub fn sensor(&self, ideal: DVec2) -> DVec2 {
        let r = ideal.length();
        let distortion: &Distortion = self.lens.distortion();
        if r <= self.radius {
            return distortion.distort(ideal);
        }
        let n = ideal / r;
        distortion.distort(n * self.radius) + n * (self.slope * (r - self.radius))
    }

    /// Where a camera point falls on the sensor, px; `None` at or behind the camera.
    pub fn project(&self, point_m: DVec3) -> Option<DVec2> {
        let k = self.lens.intrinsics();
        (point_m.z > 0.0).then(|| {
            let at = self.sensor(DVec2::new(point_m.x / point_m.z, point_m.y / point_m.z));
            DVec2::new(k.fx * at.x + k.cx, k.fy * at.y + k.cy)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: Intrinsics = Intrinsics { width: 320, height: 240, fx: 280.0, fy: 276.0, cx: 161.0, cy: 118.0 };

    /// Its pole is at 0.577; what the picture shows ends at 0.40.
    const POLE: Distortion = Distortion::Rational { k: [0.0, 0.0, 0.0, -3.0, 0.0, 0.0], p: [0.0; 2] };

    fn lenses() -> Vec<ExtendedLens> {
        let brown = |k, p| Distortion::BrownConrady { k, p };
        let all = [
            brown([0.19449, -0.01467, 0.0], [0.0; 2]),
            brown([-0.3, 0.09, 0.0], [0.001, -0.002]),
            brown([-0.25, 0.0, 0.0], [0.0; 2]),
            Distortion::Equidistant { k: [0.05, -0.01, 0.002, 0.0] },
            Distortion::Rational { k: [0.52, -0.03, 0.002, 0.9, 0.1, 0.01], p: [0.001, -0.002] },
            POLE,
            Distortion::Division { k1: -0.2 },
            Distortion::Division { k1: 0.15 },
        ];
        all.map(|d| ExtendedLens::new(Lens::new(K, d).expect("invertible"))).to_vec()
    }

    #[test]
    fn nothing_far_away_is_folded_into_the_picture() {
        for extended in lenses() {
            let lens = extended.lens().clone();
            let mut inside = 0;
            for i in 0..400 {
                let n = DVec2::from_angle(f64::from(i) * 0.1);
                let mut last = 0.0;
                for step in 0..200 {
                    let r = 0.01 * 1.06_f64.powi(step);
                    let at = extended.sensor(n * r);
                    assert!(at.dot(n) > last, "{:?} at {r}", lens.distortion());
                    last = at.dot(n);
                    let px = DVec2::new(K.fx * at.x + K.cx, K.fy * at.y + K.cy);
                    if px.cmpge(DVec2::ZERO).all() && px.cmple(DVec2::new(320.0, 240.0)).all() {
                        inside += 1;
                        let ideal = lens.undistort_px(px).expect("the picture has rays");
                        let want = DVec2::new(K.fx * n.x * r + K.cx, K.fy * n.y * r + K.cy);
                        assert!((ideal - want).length() < 1e-6, "{:?} at {r}", lens.distortion());
                    }
                }
            }
            assert!(inside > 1000);
        }
        // Control: the bare polynomial does fold far points into the picture.
        let bare = Distortion::BrownConrady { k: [-0.25, 0.0, 0.0], p: [0.0; 2] };
        assert!(bare.distort(DVec2::new(2.0, 0.0)).length() < 0.1);
    }

    #[test]
    fn a_lens_is_not_followed_towards_its_pole() {
        let extended = ExtendedLens::new(Lens::new(K, POLE).expect("invertible"));
        let slope = |r: f64| (POLE.distort_with_jacobian(DVec2::X * r).1 * DVec2::X).length();
        let (seen, followed) = (furthest(&K, &extended.lens().ideal_border_px()), extended.radius());
        assert!((0.39..0.41).contains(&seen) && followed > seen, "{seen} {followed}");
        assert!(slope(followed) <= 1.2 * STEEPER * slope(seen), "{followed}: {}", slope(followed));
        let towards = seen + BEFORE_FOLD * (0.577 - seen);
        assert!(slope(towards) > 20.0 * slope(followed), "control: {}", slope(towards));
    }

    #[test]
    fn the_bend_bounds_the_distance_of_chords_from_curves() {
        for extended in lenses() {
            let mut nearest = f64::INFINITY;
            for i in 0..500 {
                let at = DVec2::from_angle(f64::from(i)) * (extended.radius() * 0.9 * f64::from(i) / 500.0);
                let along = DVec2::from_angle(f64::from(i) * 2.3) * 0.03;
                let (a, b) = (at - along, at + along);
                let off =
                    (0.5 * (extended.sensor(a) + extended.sensor(b)) - extended.sensor(at)).length() * K.fx;
                let bend = extended.bend(at.length() - 0.03, at.length() + 0.03);
                let allowed = K.fx * bend * (2.0 * 0.03_f64).powi(2) / 8.0;
                assert!(off <= 1.02 * allowed + 1e-6, "{off} px, {allowed} px allowed");
                nearest = nearest.min(allowed - off);
            }
            assert!(nearest < 0.1, "the bound is not a guess: {nearest} px");
        }
    }
}
