//! The places of a scene that may be brighter or darker than described: a grid of cells on every surface, and which cell each
//! pixel of a picture sees.
//!
//! A cell belongs to one object, one material and one of six directions that a surface may face: paint ends where a material
//! does, and light where a surface turns. Within these a factor is linear between the corners of its cells.

use std::collections::HashMap;

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::rays::{Body, Hit};
use crate::camera::{Pose, ShutterTiming};
use crate::diagnose::forward::Forward;
use crate::diagnose::model::Theta;

/// Side of a cell as a part of the picture's width, at the middle of all distances: 13 px of 320. Much more than any blur or
/// sharpening reaches, so that a factor cannot do what these do; no more than the light of a lamp changes over.
pub(super) const CELL: f64 = 1.0 / 24.0;
/// What stands for no surface.
pub(super) const NONE: u32 = u32::MAX;

/// Corners and cells that have been seen, by number.
#[derive(Default)]
pub(super) struct Grid {
    /// Side of a cell, m.
    side_m: f32,
    corners: HashMap<(u32, [i32; 3]), u32>,
    cells: HashMap<(u32, [i32; 3]), u32>,
    /// By cell: its corners.
    pub of_cell: Vec<[u32; 8]>,
    /// By corner: the group (object, material, direction) that it belongs to.
    pub group: Vec<u32>,
}

/// What the pixels of one picture see, shape `[height, width]`.
pub(super) struct Surface {
    /// Cell, or [`NONE`].
    pub cell: Vec<u32>,
    /// Place within it, 0 to 1 along each axis.
    pub local: Vec<[f32; 3]>,
    /// Whether all pixels around it see the same group: no edge lies near.
    pub clean: Vec<bool>,
}

impl Grid {
    pub(super) fn new(side_m: f32) -> Self {
        Self { side_m, ..Self::default() }
    }

    /// Number of corners.
    pub(super) fn count(&self) -> usize {
        self.group.len()
    }

    /// The cell of a place of a group, and the place within it.
    fn place(&mut self, group: u32, at: Vec3) -> (u32, [f32; 3]) {
        let scaled = at / self.side_m;
        let low = scaled.floor();
        let key = low.as_ivec3().to_array();
        let local = (scaled - low).to_array();
        if let Some(&cell) = self.cells.get(&(group, key)) {
            return (cell, local);
        }
        let corners = std::array::from_fn(|i| {
            let corner = [0, 1, 2].map(|a| key[a] + (i >> a & 1) as i32);
            let next = self.group.len() as u32;
            let number = *self.corners.entry((group, corner)).or_insert(next);
            if number == next {
                self.group.push(group);
            }
            number
        });
        let cell = self.of_cell.len() as u32;
        self.of_cell.push(corners);
        self.cells.insert((group, key), cell);
        (cell, local)
    }
}

/// Weights of the corners of a cell for a place in it.
pub(super) fn weights([x, y, z]: [f32; 3]) -> [f32; 8] {
    std::array::from_fn(|i| {
        let part = |bit: usize, v: f32| if i >> bit & 1 == 1 { v } else { 1.0 - v };
        part(0, x) * part(1, y) * part(2, z)
    })
}

/// One of six directions.
fn direction(normal: Vec3) -> u32 {
    let size = normal.abs();
    let axis = if size.x >= size.y.max(size.z) {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis as u32 + u32::from(normal[axis] > 0.0)
}

/// Poses of the camera and of all bodies at the time of one line, from the camera: body from camera.
struct Line {
    bodies: Vec<Pose>,
}

impl Forward {
    fn lines(&self, bodies: &[Body], shutter: &ShutterTiming, theta: &Theta) -> Vec<Line> {
        let path = self.path(theta);
        let at = |line: u32| {
            let time_s = shutter.line_middle_s(line);
            let camera = path.pose_at(time_s);
            let pose = |b: &Body| match b.object {
                None => camera,
                Some(o) => self.scene.objects[o].world_from_object(time_s).inverse().then_from(&camera),
            };
            Line { bodies: bodies.iter().map(pose).collect() }
        };
        (0..shutter.line_count).map(at).collect()
    }

    /// What each pixel of a frame sees, in lengths of its ray.
    pub(super) fn hits(&self, bodies: &[Body], at: usize, theta: &Theta) -> Vec<Option<(usize, Hit)>> {
        let k = self.intrinsics;
        let (w, h) = (k.width, k.height);
        let shutter = self.shutter(at, theta);
        let lines = self.lines(bodies, &shutter, theta);
        let f = theta.get(crate::diagnose::model::P::Focal) * DVec2::new(k.fx, k.fy);
        let centre = DVec2::new(k.cx, k.cy);
        let seen = |i: u32| {
            let (x, y) = (i % w, i / w);
            let px = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let ray = ((self.without_lens(px, theta) - centre) / f).extend(1.0);
            let line = &lines[theta.scan_order.line_of(x, y, w, h) as usize];
            let mut best: Option<(usize, Hit)> = None;
            for (b, (body, pose)) in bodies.iter().zip(&line.bodies).enumerate() {
                let most = best.map_or(f32::INFINITY, |(_, hit)| hit.t);
                let (from, along) = (pose.translation_m.as_vec3(), (pose.rotation * ray).as_vec3());
                best = body.meet(from, along, most).map(|hit| (b, hit)).or(best);
            }
            best
        };
        (0..w * h).into_par_iter().map(seen).collect()
    }

    /// Cells that the pixels of a frame see.
    pub(super) fn surface_of(&self, bodies: &[Body], grid: &mut Grid, at: usize, theta: &Theta) -> Surface {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let hits = self.hits(bodies, at, theta);
        let group = |hit: &Option<(usize, Hit)>| {
            hit.as_ref().map_or(NONE, |(_, hit)| hit.surface * 6 + direction(hit.normal))
        };
        let groups: Vec<u32> = hits.iter().map(group).collect();
        let mut surface =
            Surface { cell: vec![NONE; w * h], local: vec![[0.0; 3]; w * h], clean: vec![false; w * h] };
        for (i, hit) in hits.iter().enumerate() {
            if let Some((_, hit)) = hit {
                (surface.cell[i], surface.local[i]) = grid.place(groups[i], hit.at);
                let (x, y) = (i % w, i / w);
                let inside = x > 1 && y > 1 && x + 2 < w && y + 2 < h;
                surface.clean[i] = inside
                    && [i - 2, i + 2, i - 2 * w, i + 2 * w, i - 1, i + 1, i - w, i + w]
                        .iter()
                        .all(|&n| groups[n] == groups[i]);
            }
        }
        surface
    }
}
