//! Paths of surface points: where what a texel of the reference picture shows stands at other instants of the frame.
//! Twin of `glsl/include/path.glsl`.

use glam::{IVec2, Vec2, Vec4};

use crate::plane::{Plane, three};

/// Most path images; each holds two knots.
pub const MAX_PATH_IMAGES: usize = 3;
/// Displacements of neighbouring texels further apart than this, px, belong to different surfaces.
pub const ONE_SURFACE_PX: f32 = 0.4;

/// An instant of the frame.
#[derive(Clone, Copy, Debug)]
pub struct PathWeights {
    /// Shares of the knots in the displacement, two a path image.
    images: [Vec2; MAX_PATH_IMAGES],
    /// Place on the time axis, in knots.
    at: f32,
}

/// The path images: one to three of four channels, `scale` texels a px; displacements (px, from the reference instant)
/// to two knots each, in order of time and without the reference instant's own, which is zero.
#[derive(Clone, Copy, Debug)]
pub struct Paths<'a> {
    /// The images, all of one size.
    pub images: &'a [Plane<f32>],
    /// Texels a px.
    pub scale: usize,
    /// Where all that is seen moves rigidly: what the displacements follow from. There are no images then.
    pub from_depth: Option<FromDepth<'a>>,
}

/// Displacements of what moves rigidly.
#[derive(Clone, Copy, Debug)]
pub struct FromDepth<'a> {
    /// Near distance over distance; a second channel says which body is seen.
    pub inverse_depth: &'a Plane<f32>,
    /// Rows x, y and w of the matrices that take (ndc, depth, 1) at the reference instant to clip space at knots 0 to
    /// `last_knot`, those of one body after the other.
    pub moved: &'a [[Vec4; 3]],
    /// Number of knots less one.
    pub last_knot: u32,
}

/// What is seen so near to the picture's plane at another instant, or behind it, moves as if it were so near.
const MIN_W: f32 = 0.02;

impl FromDepth<'_> {
    /// The matrix of a body at place `at` of the time axis: knots lie so close that what is between two is linear.
    fn matrix(&self, body: usize, at: f32) -> [Vec4; 3] {
        let before = at.floor().clamp(0.0, self.last_knot as f32 - 1.0);
        let share = (at - before).clamp(0.0, 1.0);
        let row = body * (self.last_knot as usize + 1) + before as usize;
        let (a, b) = (self.moved[row], self.moved[row + 1]);
        three(|i| a[i] + share * (b[i] - a[i]))
    }

    /// Displacement of what a texel shows at place `at` of the time axis, px.
    fn displacement(&self, texel: IVec2, at: f32, scale: usize) -> Vec2 {
        self.displacement_by(texel, scale, |body| self.matrix(body, at))
    }

    /// The same, and its change a knot: between two knots displacements, not matrices, are taken for linear, which is
    /// near enough to start a search.
    fn motion(&self, texel: IVec2, at: f32, scale: usize) -> [Vec2; 2] {
        let before = at.floor().clamp(0.0, self.last_knot as f32 - 1.0);
        let share = (at - before).clamp(0.0, 1.0);
        let row = |body: usize| body * (self.last_knot as usize + 1) + before as usize;
        let from_px = self.displacement_by(texel, scale, |body| self.moved[row(body)]);
        let rate_px = self.displacement_by(texel, scale, |body| self.moved[row(body) + 1]) - from_px;
        [from_px + share * rate_px, rate_px]
    }

    /// Displacement by a body's matrix.
    fn displacement_by(&self, texel: IVec2, scale: usize, matrix: impl Fn(usize) -> [Vec4; 3]) -> Vec2 {
        let size = Vec2::new(self.inverse_depth.width as f32, self.inverse_depth.height as f32);
        let ndc = (texel.as_vec2() + 0.5) / size * 2.0 - 1.0;
        let seen = self.inverse_depth.pixel(texel.x as usize, texel.y as usize);
        let (depth, body) = (seen[0], seen.get(1).map_or(0, |&body| body as usize));
        let [sx, sy, sw] = matrix(body).map(|r| r.x * ndc.x + r.y * ndc.y + r.z * depth + r.w);
        (Vec2::new(sx, sy) / sw.max(MIN_W) - ndc) * (0.5 / scale as f32) * size
    }
}

/// Displacements of 2x2 texels as a linear function.
#[derive(Clone, Copy, Debug)]
pub struct PathBlock {
    centre_px: Vec2,
    at_centre_px: Vec2,
    along_x_px: Vec2,
    along_y_px: Vec2,
    /// Whether the four can be of one surface.
    pub one_surface: bool,
}

/// Weight of the point `offset` knots away (-1, 0, 1) in the parabola through three, at `at` knots from its middle.
fn parabola_weight(at: f32, offset: f32) -> f32 {
    if offset == 0.0 {
        1.0 - at * at
    } else if offset.abs() == 1.0 {
        0.5 * at * (at + offset)
    } else {
        0.0
    }
}

/// Weight of `knot` at place `at` of the time axis with knots 0..last: between two knots the parabolas through either
/// and its neighbours are blended (a cubic with continuous slope, Catmull-Rom); constant acceleration is met exactly.
/// At a knot: 1 for itself, 0 for all others, to the bit.
pub fn knot_weight(at: f32, knot: f32, last: f32) -> f32 {
    if last < 2.0 {
        return 1.0 - (at - knot).abs();
    }
    let before = at.floor().clamp(0.0, last - 1.0);
    let f = at - before;
    let left = before.clamp(1.0, last - 1.0);
    let right = (before + 1.0).clamp(1.0, last - 1.0);
    (1.0 - f) * parabola_weight(at - left, knot - left) + f * parabola_weight(at - right, knot - right)
}

impl Paths<'_> {
    /// Shares at place `at` of the time axis.
    pub fn weights(&self, at: f32, reference_knot: u32, last_knot: u32) -> PathWeights {
        let layer = |layer: u32| {
            let knot = if layer < reference_knot { layer } else { layer + 1 };
            if knot <= last_knot { knot_weight(at, knot as f32, last_knot as f32) } else { 0.0 }
        };
        let images = std::array::from_fn(|image| match image < self.images.len() {
            true => Vec2::new(layer(2 * image as u32), layer(2 * image as u32 + 1)),
            false => Vec2::ZERO,
        });
        PathWeights { images, at }
    }

    fn last(&self) -> IVec2 {
        let image = self.from_depth.map_or_else(|| &self.images[0], |d| d.inverse_depth);
        IVec2::new(image.width as i32 - 1, image.height as i32 - 1)
    }

    /// Where all that is seen moves rigidly: displacement of what one texel shows at place `at` of the time axis, px.
    pub fn depth_displacement(&self, texel: IVec2, at: f32) -> Option<Vec2> {
        Some(self.from_depth?.displacement(texel, at, self.scale))
    }

    /// The same, and its change a knot, as claims follow it.
    pub fn depth_motion(&self, texel: IVec2, at: f32) -> Option<[Vec2; 2]> {
        Some(self.from_depth?.motion(texel, at, self.scale))
    }

    /// The two knots of one texel of an image.
    pub fn knots(&self, image: usize, texel: IVec2) -> [Vec2; 2] {
        let v = self.images[image].pixel(texel.x as usize, texel.y as usize);
        [Vec2::new(v[0], v[1]), Vec2::new(v[2], v[3])]
    }

    /// Displacement of what one texel shows, px.
    pub fn texel_displacement(&self, texel: IVec2, w: &PathWeights) -> Vec2 {
        if let Some(moved_px) = self.depth_displacement(texel, w.at) {
            return moved_px;
        }
        let part = |image: usize| {
            let [a, b] = self.knots(image, texel);
            w.images[image].x * a + w.images[image].y * b
        };
        (1..self.images.len()).fold(part(0), |sum, image| sum + part(image))
    }

    /// The texel that holds a position, px.
    pub fn texel(&self, position_px: Vec2) -> IVec2 {
        (position_px * self.scale as f32).floor().clamp(Vec2::ZERO, self.last().as_vec2()).as_ivec2()
    }

    /// Displacement of the texel that holds a position.
    pub fn nearest_displacement(&self, position_px: Vec2, w: &PathWeights) -> Vec2 {
        self.texel_displacement(self.texel(position_px), w)
    }

    /// First texel of the block around a position.
    pub fn block(&self, position_px: Vec2) -> IVec2 {
        let last = (self.last() - 1).max(IVec2::ZERO).as_vec2();
        (position_px * self.scale as f32 - 0.5).clamp(Vec2::ZERO, last).floor().as_ivec2()
    }

    /// The block's displacements at one instant.
    pub fn block_displacement(&self, block: IVec2, w: &PathWeights) -> PathBlock {
        let far = (block + 1).min(self.last());
        let at = |x: i32, y: i32| self.texel_displacement(IVec2::new(x, y), w);
        let (a, b, c, d) = (at(block.x, block.y), at(far.x, block.y), at(block.x, far.y), at(far.x, far.y));
        let spread = a.max(b).max(c.max(d)) - a.min(b).min(c.min(d));
        let scale = self.scale as f32;
        PathBlock {
            centre_px: (block.as_vec2() + 1.0) / scale,
            at_centre_px: 0.25 * (a + b + (c + d)),
            along_x_px: 0.5 * scale * (b - a + (d - c)),
            along_y_px: 0.5 * scale * (c - a + (d - b)),
            one_surface: spread.x.max(spread.y) <= ONE_SURFACE_PX,
        }
    }
}

impl PathBlock {
    /// The place p in the reference picture of what stands at `x_px`: p + displacement(p) = x, solved for a
    /// displacement that is linear around the block (a Newton step). The error is the displacement's curvature over
    /// half the squared distance from the block.
    pub fn source(&self, x_px: Vec2) -> Vec2 {
        let rest = x_px - self.centre_px - self.at_centre_px;
        let (xx, yy) = (1.0 + self.along_x_px.x, 1.0 + self.along_y_px.y);
        let determinant = xx * yy - self.along_y_px.x * self.along_x_px.y;
        let moved =
            Vec2::new(yy * rest.x - self.along_y_px.x * rest.y, xx * rest.y - self.along_x_px.y * rest.x);
        self.centre_px + moved / determinant
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_are_met_and_constant_acceleration_is_exact() {
        for last in [1u32, 2, 3, 4, 6] {
            let curve = |t: f32| if last == 1 { 3.0 * t - 1.0 } else { 0.7 * t * t - 2.0 * t + 0.3 };
            for i in 0..=60 {
                let at = i as f32 / 60.0 * last as f32;
                let weight = |k: u32| knot_weight(at, k as f32, last as f32);
                let got: f32 = (0..=last).map(|k| weight(k) * curve(k as f32)).sum();
                assert!((got - curve(at)).abs() < 1e-4, "{last} at {at}: {got} for {}", curve(at));
                let sum: f32 = (0..=last).map(weight).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{last} at {at}: {sum}");
            }
            for k in 0..=last {
                let weights = (0..=last).map(|j| knot_weight(k as f32, j as f32, last as f32));
                assert!(
                    weights.enumerate().all(|(j, w)| w == f32::from(u8::from(j as u32 == k))),
                    "{last} {k}"
                );
            }
        }
        // Control: straight lines between knots miss the curve.
        let straight = 0.5 * (0.7 - 2.0 + 0.3) + 0.5 * 0.3;
        assert!((straight - (0.7 * 0.25 - 1.0 + 0.3_f32)).abs() > 0.1);
    }

    #[test]
    fn a_linear_field_is_inverted_exactly() {
        let field = |p: Vec2| Vec2::new(3.0 + 0.1 * p.x - 0.2 * p.y, -2.0 + 0.15 * p.x + 0.05 * p.y);
        for scale in [1usize, 2] {
            let image = Plane::from_fn(40 * scale, 30 * scale, |x, y| {
                let d = field((Vec2::new(x as f32, y as f32) + 0.5) / scale as f32);
                [0.0, 0.0, d.x, d.y]
            });
            let images = [image];
            let paths = Paths { images: &images, scale, from_depth: None };
            let w = paths.weights(2.0, 1, 2);
            for (x, y) in [(17.3, 11.9), (20.0, 8.25), (25.5, 15.5)] {
                let x_px = Vec2::new(x, y);
                let guess = x_px - paths.nearest_displacement(x_px, &w);
                let p = paths.block_displacement(paths.block(guess), &w).source(x_px);
                let off = (p + field(p) - x_px).length();
                assert!(off < 1e-4, "scale {scale}, {x_px}: {off}");
                // Control: the displacement at the destination does not lead there.
                let chord = x_px - field(x_px);
                assert!((chord + field(chord) - x_px).length() > 0.1);
            }
        }
    }
}
