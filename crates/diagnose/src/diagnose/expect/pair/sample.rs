//! Pictures and planes between their pixels.

use glam::Vec2;
use rayon::prelude::*;

use crate::diagnose::evidence::quality::Quality;
use shutterbug::plane::{Plane, three};

/// Most steps by which a motion is turned round.
const STEPS: usize = 6;

/// Distance at a place: between pixels by its inverse, which is linear on planes, but never across an edge.
pub(crate) fn depth_at(depth: &Plane<f32>, s: Vec2) -> f32 {
    let (w, h) = (depth.width, depth.height);
    let ([x0, y0], [fx, fy]) = corner(depth, s);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let z = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| 1.0 / depth.data[y * w + x]);
    let (least, most) = z.iter().fold((f32::INFINITY, 0.0f32), |(a, b), v| (a.min(*v), b.max(*v)));
    let inverse = if most - least > 0.05 * most {
        z[usize::from(fx >= 0.5) + 2 * usize::from(fy >= 0.5)]
    } else {
        (z[0] * (1.0 - fx) + z[1] * fx) * (1.0 - fy) + (z[2] * (1.0 - fx) + z[3] * fx) * fy
    };
    1.0 / inverse
}

/// The pixel whose centre lies left of and above a place inside the picture, and how far beyond it the place is.
fn corner(plane: &Plane<f32>, s: Vec2) -> ([usize; 2], [f32; 2]) {
    let along = |v: f32, side: usize| (v - 0.5).clamp(0.0, side as f32 - 1.001);
    let (x, y) = (along(s.x, plane.width), along(s.y, plane.height));
    let (x0, y0) = (x as usize, y as usize);
    ([x0, y0], [x - x0 as f32, y - y0 as f32])
}

/// A field of displacements at a place, px.
pub(super) fn shifted(field: &Plane<f32>, s: Vec2) -> Vec2 {
    let (w, h) = (field.width, field.height);
    let ([x0, y0], [fx, fy]) = corner(field, s);
    let at = |x: usize, y: usize| {
        let p = field.pixel(x.min(w - 1), y.min(h - 1));
        Vec2::new(p[0], p[1])
    };
    (at(x0, y0) * (1.0 - fx) + at(x0 + 1, y0) * fx) * (1.0 - fy)
        + (at(x0, y0 + 1) * (1.0 - fx) + at(x0 + 1, y0 + 1) * fx) * fy
}

/// Weights of Catmull and Rom's cubic for the four values around a place.
fn cubic(f: f32) -> [f32; 4] {
    let (g, ff) = (1.0 - f, f * f);
    [-0.5 * f * g * g, 1.0 + ff * (1.5 * f - 2.5), f * (0.5 + f * (2.0 - 1.5 * f)), -0.5 * ff * g]
}

/// The sixteen values of a channel around a place (px; a pixel's centre at +0.5), by their places in the data, and
/// weights of columns and rows in the cubic. Beyond the border a picture goes on as on it.
struct Around {
    columns: [usize; 4],
    rows: [usize; 4],
    weights: [[f32; 4]; 2],
}

impl Around {
    fn of(plane: &Plane<f32>, [x, y]: [f32; 2]) -> Self {
        let (x0, y0) = (x.floor(), y.floor());
        // Places in the data of the four values around a place.
        let near = |at: f32, side: usize, step: usize| {
            let one = |k: isize| (at as isize + k).clamp(0, side as isize - 1) as usize * step;
            [one(-1), one(0), one(1), one(2)]
        };
        Self {
            columns: near(x0, plane.width, plane.channels),
            rows: near(y0, plane.height, plane.channels * plane.width),
            weights: [cubic(x - x0), cubic(y - y0)],
        }
    }

    fn read(&self, data: &[f32], channel: usize) -> f32 {
        let [across, down] = self.weights;
        let row = |at: usize| {
            let one = |k: usize| across[k] * data[at + self.columns[k] + channel];
            one(0) + one(1) + one(2) + one(3)
        };
        let one = |k: usize| down[k] * row(self.rows[k]);
        (one(0) + one(1) + one(2) + one(3)).max(0.0)
    }
}

/// A picture at a place (px; a pixel's centre at +0.5), never negative; beyond the border as on it.
pub(super) fn read(plane: &Plane<f32>, s: Vec2, quality: Quality) -> [f32; 3] {
    let (w, h) = (plane.width as isize, plane.height as isize);
    let (x, y) = ((s.x - 0.5).clamp(-1.0, w as f32), (s.y - 0.5).clamp(-1.0, h as f32));
    if quality != Quality::Coarse {
        let around = Around::of(plane, [x, y]);
        return three(|c| around.read(&plane.data, c));
    }
    let (x0, y0) = (x.floor() as isize, y.floor() as isize);
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let at = |x: isize, y: isize| 3 * (y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize;
    let mut out = [0.0f32; 3];
    for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
        for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
            let i = at(x0 + dx, y0 + dy);
            (0..3).for_each(|c| out[c] += wx * wy * plane.data[i + c]);
        }
    }
    three(|c| out[c].max(0.0))
}

/// One channel of a picture at a place, px.
pub(crate) fn channel_at(plane: &Plane<f32>, [x, y]: [f32; 2], channel: usize) -> f32 {
    let inside = |v: f32, side: usize| (v - 0.5).clamp(0.0, side as f32 - 1.0);
    Around::of(plane, [inside(x, plane.width), inside(y, plane.height)]).read(&plane.data, channel)
}

/// Where the content of the next frame was in this one, px from there; from where this one's content goes.
pub(super) fn backward(forward: &Plane<f32>) -> Plane<f32> {
    let (w, h) = (forward.width, forward.height);
    let data = (0..w * h).into_par_iter().flat_map_iter(|i| {
        let target = Vec2::new((i % w) as f32 + 0.5, (i / w) as f32 + 0.5);
        let mut s = target;
        for _ in 0..STEPS {
            s = target - shifted(forward, s);
        }
        (s - target).to_array()
    });
    Plane { width: w, height: h, channels: 2, data: data.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_between_pixels_reads_what_a_parabola_has_there_and_a_centre_its_own_value() {
        let of = |x: f32, y: f32| 0.3 + 0.02 * x + 0.01 * y + 0.001 * x * x;
        let plane = Plane::from_fn(16, 12, |x, y| [of(x as f32 + 0.5, y as f32 + 0.5); 3]);
        for s in [Vec2::new(7.5, 5.5), Vec2::new(7.9, 5.1), Vec2::new(4.2, 6.75)] {
            let off = read(&plane, s, Quality::Fit)[0] - of(s.x, s.y);
            assert!(off.abs() < 1e-5, "{s}: {off}");
        }
        let linear = read(&plane, Vec2::new(8.0, 5.5), Quality::Coarse)[0] - of(8.0, 5.5);
        assert!(linear.abs() > 1e-5, "control: two values know nothing of a curve");
    }

    #[test]
    fn backward_motion_undoes_forward_motion() {
        let forward = Plane::from_fn(40, 30, |x, y| [2.0 + 0.05 * x as f32, -1.0 + 0.03 * y as f32]);
        let back = backward(&forward);
        let (s, b) = (Vec2::new(20.5, 15.5), back.pixel(20, 15));
        let from = s + Vec2::new(b[0], b[1]);
        assert!((from + shifted(&forward, from) - s).length() < 1e-3, "{from}");
        assert!(b[0] < -1.0 && b[1] > 0.3, "control: {b:?}");
    }
}
