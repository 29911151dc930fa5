//! Which cell of the grid each pixel of a picture sees.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::grid::{Grid, NONE, PARTS, Part, Surface};
use super::rays::{Body, Hit};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta};
use shutterbug::camera::{Pose, ShutterTiming, Trajectory};
use shutterbug::reference::Shader;

/// Side of a cell as a part of the picture's width, at the middle of all distances: 8 px of 320. More than a blur or
/// sharpening reaches, so that a factor cannot do what these do; no more than the edge of a soft shadow is wide.
pub(crate) const CELL: f64 = 1.0 / 40.0;
/// Places of the parts of a pixel: those of eight rooks, each in a row and a column of its own.
const ROOKS: [f64; PARTS] = [0.0, 3.0, 6.0, 1.0, 4.0, 7.0, 2.0, 5.0];

/// A body, and a triangle of it.
type Place = (usize, u32);

fn place(hit: Option<(usize, Hit)>) -> Option<Place> {
    hit.map(|(body, hit)| (body, hit.triangle[0]))
}

/// A ray from the camera in the coordinates of a body, in which the camera has this pose: where it begins, and its
/// direction.
fn in_body(ray: DVec3, pose: &Pose) -> (Vec3, Vec3) {
    (pose.translation_m.as_vec3(), (pose.rotation * ray).as_vec3())
}

/// Rays of one frame.
struct Sight<'a> {
    forward: &'a Forward,
    bodies: &'a [Body],
    theta: &'a Theta,
    path: Arc<Trajectory>,
    shutter: ShutterTiming,
    /// By line, at the middle of its exposure: the camera in each body's coordinates.
    lines: Vec<Vec<Pose>>,
}

impl<'a> Sight<'a> {
    fn new(forward: &'a Forward, bodies: &'a [Body], at: usize, theta: &'a Theta) -> Self {
        let shutter = forward.shutter(at, theta);
        let mut sight =
            Self { forward, bodies, theta, path: forward.path(theta), shutter, lines: Vec::new() };
        sight.lines =
            (0..sight.shutter.line_count).map(|l| sight.poses(sight.shutter.line_middle_s(l))).collect();
        sight
    }

    /// The camera in each body's coordinates.
    fn poses(&self, time_s: f64) -> Vec<Pose> {
        let camera = self.path.pose_at(time_s);
        let pose = |b: &Body| match b.object {
            None => camera,
            Some(o) => self.forward.scene.objects[o].world_from_object(time_s).inverse().then_from(&camera),
        };
        self.bodies.iter().map(pose).collect()
    }

    /// The ray of a place of the picture, in the camera's coordinates.
    fn ray(&self, px: DVec2) -> DVec3 {
        let k = &self.forward.intrinsics;
        let f = self.theta.get(P::Focal) * DVec2::new(k.fx, k.fy);
        ((self.forward.without_lens(px, self.theta) - DVec2::new(k.cx, k.cy)) / f).extend(1.0)
    }

    /// What a ray sees first. `guess`: a body and its triangle.
    fn meet(&self, ray: DVec3, poses: &[Pose], guess: Option<Place>) -> Option<(usize, Hit)> {
        let mut best: Option<(usize, Hit)> = None;
        for (b, (body, pose)) in self.bodies.iter().zip(poses).enumerate() {
            let most = best.map_or(f32::INFINITY, |(_, hit)| hit.t);
            let (from, along) = in_body(ray, pose);
            let likely = guess.filter(|g| g.0 == b).map(|g| g.1);
            best = body.meet(from, along, most, likely).map(|hit| (b, hit)).or(best);
        }
        best
    }

    fn line_of(&self, i: usize) -> u32 {
        let k = &self.forward.intrinsics;
        self.theta.scan_order.line_of(i as u32 % k.width, i as u32 / k.width, k.width, k.height)
    }

    /// What a ray sees of a few triangles; of all where it meets none of them.
    fn meet_of(&self, ray: DVec3, poses: &[Pose], few: &[Place]) -> Option<(usize, Hit)> {
        let one = |&(b, triangle): &Place| {
            let (from, along) = in_body(ray, &poses[b]);
            self.bodies[b].meet_one(triangle, from, along).map(|hit| (b, hit))
        };
        let nearest = few.iter().filter_map(one).min_by(|a, b| a.1.t.total_cmp(&b.1.t));
        nearest.or_else(|| self.meet(ray, poses, None))
    }

    /// What the middle of each pixel sees. A pixel whose neighbours on every second row and column all see one triangle
    /// sees that: what is narrower than a pixel may be missed.
    fn middles(&self) -> Vec<Option<(usize, Hit)>> {
        let (w, h) = (self.forward.intrinsics.width as usize, self.forward.intrinsics.height as usize);
        let ray = |x: usize, y: usize| self.ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let poses = |x: usize, y: usize| &self.lines[self.line_of(y * w + x) as usize][..];
        let every_second = |y: usize| {
            let mut last = None;
            (0..w).step_by(2).map(move |x| {
                let hit = self.meet(ray(x, 2 * y), poses(x, 2 * y), last);
                last = place(hit);
                hit
            })
        };
        let known: Vec<_> = (0..h.div_ceil(2)).into_par_iter().flat_map_iter(every_second).collect();
        let across = w.div_ceil(2);
        let pixel = |x: usize, y: usize| {
            let (left, above) = (x / 2, y / 2);
            let near = known[above * across + left];
            if x.is_multiple_of(2) && y.is_multiple_of(2) {
                return near;
            }
            let (right, below) = (x.div_ceil(2), y.div_ceil(2));
            let guess = place(near);
            let inside = right < across && below < h.div_ceil(2);
            let same = |&(x, y): &(usize, usize)| place(known[y * across + x]) == guess;
            let corners = [(right, above), (left, below), (right, below)];
            match guess {
                Some(one) if inside && corners.iter().all(same) => {
                    self.meet_of(ray(x, y), poses(x, y), &[one])
                }
                _ => self.meet(ray(x, y), poses(x, y), guess),
            }
        };
        (0..h).into_par_iter().flat_map_iter(|y| (0..w).map(move |x| pixel(x, y))).collect()
    }

    /// What the parts of a pixel see over its exposure, and how bright that is; `few`: what it and its neighbours see.
    fn parts(&self, i: usize, few: &[Place], shader: &Shader<'_>) -> [Option<(Hit, [f32; 3])>; PARTS] {
        let w = self.forward.intrinsics.width as usize;
        let line = self.line_of(i);
        std::array::from_fn(|s| {
            let part = |v: f64| (v + 0.5) / PARTS as f64;
            let px = DVec2::new((i % w) as f64 + part(s as f64), (i / w) as f64 + part(ROOKS[s]));
            let hit = if self.shutter.exposure_time_s > 0.0 {
                let when = part(ROOKS[(s + 3) % PARTS]) * self.shutter.exposure_time_s;
                self.meet_of(self.ray(px), &self.poses(self.shutter.line_start_s(line) + when), few)
            } else {
                self.meet_of(self.ray(px), &self.lines[line as usize], few)
            };
            hit.map(|(_, h)| (h, shader.radiance(h.triangle[1] as usize, h.corners.map(f64::from))))
        })
    }
}

impl Forward {
    /// Cells that the pixels of a frame see.
    pub(crate) fn surface_of(&self, bodies: &[Body], grid: &mut Grid, at: usize, theta: &Theta) -> Surface {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let sight = Sight::new(self, bodies, at, theta);
        let hits = sight.middles();
        let groups: Vec<u32> = hits
            .iter()
            .map(|h| h.as_ref().map_or(NONE, |(_, h)| grid.group_of(h.surface, h.normal)))
            .collect();
        let kinds: Vec<u32> = hits.iter().map(|h| h.as_ref().map_or(NONE, |(_, h)| h.surface)).collect();
        let (mut cell, mut local) = (vec![NONE; w * h], vec![[0.0; 3]; w * h]);
        for (i, hit) in hits.iter().enumerate() {
            let Some((_, hit)) = hit else { continue };
            (cell[i], local[i]) = grid.place(groups[i], hit.at);
        }
        let inside = |i: usize| {
            let (x, y) = (i % w, i / w);
            groups[i] != NONE && x >= 2 && y >= 2 && x + 2 < w && y + 2 < h
        };
        let is_border = |i: usize| {
            let near = [i - 1, i + 1, i - w, i + w, i - w - 1, i - w + 1, i + w - 1, i + w + 1];
            near.iter().any(|&n| groups[n] != groups[i])
        };
        let is_clean = |i: usize| {
            inside(i)
                && !is_border(i)
                && [i - 2, i + 2, i - 2 * w, i + 2 * w].iter().all(|&n| kinds[n] == kinds[i])
        };
        let all = || (0..w * h).into_par_iter().with_min_len(1024);
        let clean: Vec<bool> = all().map(is_clean).collect();
        let border: Vec<usize> = all().filter(|&i| inside(i) && is_border(i)).collect();
        let shader = Shader::new(&self.scene, sight.shutter.middle_s(), DVec3::ZERO);
        let around = |i: usize| {
            let rows = [i - w, i, i + w];
            let mut few: Vec<Place> =
                rows.iter().flat_map(|&m| m - 1..=m + 1).filter_map(|n| place(hits[n])).collect();
            few.sort_unstable();
            few.dedup();
            few
        };
        let parts: Vec<_> =
            border.par_iter().map(|&i| (i as u32, sight.parts(i, &around(i), &shader))).collect();
        let mixed = parts.into_iter().filter_map(|(i, parts)| Some((i, shared(grid, &parts)?))).collect();
        Surface { cell, local, clean, mixed }
    }
}

/// Parts of a pixel by their shares of its light; nothing where there is none.
fn shared(grid: &mut Grid, parts: &[Option<(Hit, [f32; 3])>; PARTS]) -> Option<[Part; PARTS]> {
    let sums = [0, 1, 2].map(|c| parts.iter().flatten().map(|p| p.1[c]).sum::<f32>());
    let nothing = Part { cell: NONE, local: [0.0; 3], share: [0.0; 3] };
    let mut out = [nothing; PARTS];
    for (to, (hit, light)) in out.iter_mut().zip(parts.iter().flatten()) {
        let group = grid.group_of(hit.surface, hit.normal);
        let (cell, local) = grid.place(group, hit.at);
        *to = Part { cell, local, share: [0, 1, 2].map(|c| light[c] / sums[c].max(1e-9)) };
    }
    sums.iter().all(|s| *s > 0.0).then_some(out)
}
