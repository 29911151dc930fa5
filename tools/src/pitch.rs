//! The lines of a football field, flat strips a little above the ground.

use std::f64::consts::TAU;

use glam::{DVec3, dvec3};

use crate::demo_capture::mesh::Mesh;

/// A field's sizes, m.
pub struct Lines {
    /// Half the field's length (along x) and width.
    pub half_m: [f64; 2],
    /// Width of every line.
    pub width_m: f64,
    /// Height of the strips and, clear of them, of the circle.
    pub heights_m: [f64; 2],
    /// Half the width of the penalty areas.
    pub area_half_width_m: f64,
    /// Radius of the centre circle.
    pub circle_radius_m: f64,
    /// Number of pieces of the centre circle.
    pub circle_sides: u32,
}

/// How far penalty areas reach into the field, m.
const AREA_DEPTH_M: f64 = 0.6;

impl Lines {
    /// Adds the object `field_lines` in the material `line`.
    pub fn add(&self, mesh: &mut Mesh) {
        mesh.object("field_lines");
        let ([length, width], area) = (self.half_m, self.area_half_width_m);
        // No two strips overlap: equal heights would fight for the same pixels.
        let inner = width - self.width_m;
        for y in [-width, width] {
            self.strip(mesh, [-length, length], [y, y]);
        }
        for x in [-length, 0.0, length] {
            self.strip(mesh, [x, x], [-inner, inner]);
        }
        for side in [-1.0, 1.0] {
            let (front, back) = (side * (length - AREA_DEPTH_M), side * (length - self.width_m));
            self.strip(mesh, [front, front], [-area, area]);
            let x = [front + side * self.width_m, back];
            for y in [-area, area] {
                self.strip(mesh, [x[0].min(x[1]), x[0].max(x[1])], [y, y]);
            }
        }
        self.circle(mesh);
    }

    /// A line between two points, given by its ranges along x and y.
    fn strip(&self, mesh: &mut Mesh, x: [f64; 2], y: [f64; 2]) {
        let half = 0.5 * self.width_m;
        let origin = dvec3(x[0] - half, y[0] - half, self.heights_m[0]);
        let (right, up) = (DVec3::X * (x[1] - x[0] + 2.0 * half), DVec3::Y * (y[1] - y[0] + 2.0 * half));
        mesh.rectangle("line", origin, right, up, [0.0; 2]);
    }

    fn circle(&self, mesh: &mut Mesh) {
        let (sides, half) = (self.circle_sides, 0.5 * self.width_m);
        let corner = |i: u32, radius_m: f64| {
            let (sin, cos) = (TAU * f64::from(i % sides) / f64::from(sides)).sin_cos();
            (dvec3(radius_m * cos, radius_m * sin, self.heights_m[1]), [0.0; 2], DVec3::Z)
        };
        let (inside, outside) = (self.circle_radius_m - half, self.circle_radius_m + half);
        for i in 0..sides {
            let corners =
                [corner(i, inside), corner(i, outside), corner(i + 1, outside), corner(i + 1, inside)];
            mesh.face("line", &corners);
        }
    }
}
