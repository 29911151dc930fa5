//! `--method exact` with an exposure: what the gather reads of the samples. Twin of `glsl/exact_paths.comp`; its
//! multisampled variant differs in nothing but how a sample is fetched.

use glam::{Vec2, Vec3, Vec4};

use super::rgb9e5::rgb9e5;
use crate::plane::Plane;

/// Farthest path, px.
const MAX_PATH_PX: f32 = 4096.0;
/// A point that is nearer to the picture's plane than this, or behind it, moves as if it were so near, m.
const MIN_W: f32 = 0.02;

/// Rows x, y and w of the matrices that take (ndc, depth, 1) at the middle of a line's exposure to clip space at its
/// begin and at its end.
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

/// What the kernel writes.
pub struct Outputs {
    /// Words of the radiance of a texel and of the one to its right (the last one has itself there), row by row.
    pub words: Vec<[u32; 2]>,
    /// Inverse distance of the nearest sample of every pixel, 1/m.
    pub inverses: Plane<f32>,
    /// Of every pixel, px from the middle of its line's exposure to the begin and to the end, before they are rounded
    /// to half floats.
    pub paths: Plane<f32>,
}

/// All of a picture.
///
/// # Panics
/// If shapes do not fit.
pub fn exact_paths(inputs: &Inputs<'_>) -> Outputs {
    let color = inputs.color;
    let texels = (0..color.height).flat_map(|y| (0..color.width).map(move |x| [x, y]));
    let word = |x: usize, y: usize| rgb9e5(Vec3::from_slice(color.pixel(x, y)), round_up(x, y));
    let pair = |[x, y]: [usize; 2]| [word(x, y), word((x + 1).min(color.width - 1), y)];
    let size = [color.width / inputs.grid, color.height / inputs.grid];
    Outputs {
        words: texels.map(pair).collect(),
        inverses: Plane::from_fn(size[0], size[1], |x, y| [nearest(inputs, [x, y]).0 / inputs.near_m]),
        paths: Plane::from_fn(size[0], size[1], |x, y| path(inputs, size, [x, y])),
    }
}

/// Texels take turns in how they are rounded.
fn round_up(x: usize, y: usize) -> f32 {
    [[0.125, 0.625], [0.875, 0.375]][y % 2][x % 2]
}

/// Depth and group of the nearest sample of a pixel.
fn nearest(inputs: &Inputs<'_>, [x, y]: [usize; 2]) -> (f32, f32) {
    let (mut depth, mut group) = (0.0_f32, 0.0);
    for row in y * inputs.grid..(y + 1) * inputs.grid {
        for column in x * inputs.grid..(x + 1) * inputs.grid {
            let d = inputs.depth.pixel(column, row)[0];
            if d > depth {
                (depth, group) = (d, inputs.color.pixel(column, row)[3]);
            }
        }
    }
    (depth, group)
}

fn path(inputs: &Inputs<'_>, size: [usize; 2], [x, y]: [usize; 2]) -> [f32; 4] {
    let (depth, group) = nearest(inputs, [x, y]);
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
        let w = rows[2].dot(point).max(MIN_W);
        let seen = (inputs.sensor)(Vec4::new(rows[0].dot(point), rows[1].dot(point), 0.0, w));
        (Vec2::new(seen.x, seen.y) / w - ndc) * 0.5 * pixels
    };
    let (begin, end) = (moved(&relative.begin), moved(&relative.end));
    [begin.x, begin.y, end.x, end.y].map(|v| v.clamp(-MAX_PATH_PX, MAX_PATH_PX))
}
