//! `--method exact` with an exposure: what the gather reads of the samples. Twin of `glsl/exact_paths.comp`; its
//! multisampled variant differs in nothing but how a sample is fetched.

use glam::{Vec2, Vec4};

use crate::plane::Plane;

/// Farthest path, px.
const MOST_PX: f32 = 4096.0;
/// A point that is nearer to the picture's plane than this, or behind it, moves as if it were so near, m.
const LEAST_W: f32 = 0.02;

/// Rows x, y and w of the matrices that take (ndc, depth, 1) at the middle of a line's exposure to clip space at its begin
/// and at its end.
#[derive(Clone, Copy, Debug)]
pub struct Relative {
    /// At the begin.
    pub begin: [Vec4; 3],
    /// At the end.
    pub end: [Vec4; 3],
}

/// What the kernel is told.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Linear radiance; alpha is the number of the motion group, from 1, and 0 where nothing is. `[grid h, grid w, 4]`.
    pub color: &'a Plane<f32>,
    /// Near distance over distance, 0 where nothing is. `[grid h, grid w, 1]`.
    pub depth: &'a Plane<f32>,
    /// Line by line in the picture's order, and in a line group by group.
    pub relatives: &'a [Relative],
    /// Lines that the relatives are for: all, or one for all.
    pub line_count: usize,
    /// Lines are columns.
    pub columns: bool,
    /// Texels of a pixel's side.
    pub grid: usize,
    /// Nearest distance that is drawn, m.
    pub near_m: f32,
    /// Ideal normalised device coordinates of a point of the sensor.
    pub ideal: &'a dyn Fn(Vec2) -> Vec2,
    /// Clip space of the sensor from that of the ideal picture.
    pub sensor: &'a dyn Fn(Vec4) -> Vec4,
}

/// Radiance and inverse distance (1/m) of every texel, and the path of every pixel (px from the middle of its line's
/// exposure to the begin and to the end), before they are rounded to half floats.
///
/// # Panics
/// If shapes do not fit.
pub fn exact_paths(inputs: &Inputs<'_>) -> (Plane<f32>, Plane<f32>) {
    let (color, depth) = (inputs.color, inputs.depth);
    let texels = Plane::from_fn(color.width, color.height, |x, y| {
        let c = color.pixel(x, y);
        [c[0], c[1], c[2], depth.pixel(x, y)[0].max(0.0) / inputs.near_m]
    });
    let size = [color.width / inputs.grid, color.height / inputs.grid];
    (texels, Plane::from_fn(size[0], size[1], |x, y| path(inputs, size, [x, y])))
}

fn path(inputs: &Inputs<'_>, size: [usize; 2], [x, y]: [usize; 2]) -> [f32; 4] {
    let (mut depth, mut group) = (0.0_f32, 0.0);
    for row in y * inputs.grid..(y + 1) * inputs.grid {
        for column in x * inputs.grid..(x + 1) * inputs.grid {
            let d = inputs.depth.pixel(column, row)[0];
            if d > depth {
                (depth, group) = (d, inputs.color.pixel(column, row)[3]);
            }
        }
    }
    let pixels = Vec2::new(size[0] as f32, size[1] as f32);
    let ndc = (Vec2::new(x as f32, y as f32) + 0.5) / pixels * 2.0 - 1.0;
    let ideal = (inputs.ideal)(ndc);
    let point = Vec4::new(ideal.x, ideal.y, depth, 1.0);
    let line = (if inputs.columns { x } else { y }).min(inputs.line_count - 1);
    let groups = inputs.relatives.len() / inputs.line_count;
    // Where nothing is, what rests: the first group.
    let own = (group as usize).max(1) - 1;
    let relative = &inputs.relatives[line * groups + own];
    let moved = |rows: &[Vec4; 3]| {
        let w = rows[2].dot(point).max(LEAST_W);
        let seen = (inputs.sensor)(Vec4::new(rows[0].dot(point), rows[1].dot(point), 0.0, w));
        (Vec2::new(seen.x, seen.y) / w - ndc) * 0.5 * pixels
    };
    let (begin, end) = (moved(&relative.begin), moved(&relative.end));
    [begin.x, begin.y, end.x, end.y].map(|v| v.clamp(-MOST_PX, MOST_PX))
}
