//! The forward model of a pair: each pixel reads the simulated frame at the place whose content it shows at the time of
//! its line.
//!
//! For a pixel of a line at time t, the lens says which ray it sees. The place s in a simulated frame (at time t0) is
//! the one whose content lies on that ray at t: `to(s, t - t0) = ray`, solved by fixed-point steps. With depth and a
//! path `to` moves the point behind s by the camera's motion; with motion alone it is a parabola through where the
//! content is one period before, at, and one period after. An exposure is the mean over places between its begin,
//! middle and end. Of neighbouring frames the nearest in time that shows the place is read, so that what one does not
//! see another may.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3, Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::frames::Geometry;
use super::given::{Given, GivenValue};
use super::outside::Outside;
use super::sample::{depth_at, read, shifted};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::{Tone, mixed_noise};
use shutterbug::camera::{Pose, ScanOrder, ShutterTiming};
use shutterbug::plane::{Plane, three};

/// Most steps of the search for a place.
const STEPS: usize = 6;
/// A step of less than this is the last, px.
const NEAR_PX: f32 = 0.01;
/// A place is found if the last step was no longer than this, px.
const FOUND_PX: f32 = 0.3;
/// Frames this many periods away are not read.
const MOST_PERIODS: f64 = 1.6;
/// Most places that an exposure is the mean of.
const MOST_PARTS: f32 = 48.0;

/// Sides of an edge that part by less are one thing, px.
const SEEN_PX: f32 = 0.25;
/// Furthest from an edge that is looked at, px.
const MOST_EDGE_PX: f32 = 12.0;
/// Error of a value read half way between two pixels, over the slope there, px: root mean square of what the cubic
/// misses of a step that lies anywhere in a pixel (0.285; 0.205 a quarter of the way, 0 on a pixel).
const BETWEEN_PX: f32 = 0.285;

/// How content of one simulated frame lies at the time of a line.
enum Mover {
    /// Points in the frame's camera in the space of the camera at that time, and the time as a part of a period.
    Depth(Mat3, Vec3, f32),
    /// Periods from the frame.
    Motion(f32),
    Rest,
}

/// What every pixel of a picture is read with.
struct Reader<'a> {
    outside: &'a Outside,
    at: usize,
    shutter: ShutterTiming,
    /// Nominal focal lengths and centre.
    f: Vec2,
    c: Vec2,
    /// Rays without lens, by pixel.
    rays: &'a [[f32; 2]],
    /// By line: frames nearest first, and by begin, middle and end of the exposure how their content lies.
    lines: Vec<Vec<(usize, [Mover; 3])>>,
    quality: Quality,
}

impl Forward {
    /// Whether the content's motion is known by pictures alone, without poses.
    pub(crate) fn is_unposed(&self) -> bool {
        self.outside.as_ref().is_some_and(|o| o.sim.geometry != Geometry::Depth)
    }

    /// The speed of the content of given frames where poses say it, and with it that of what moves by itself.
    pub(crate) fn add_camera_velocity(&mut self) {
        if self.is_unposed() {
            return;
        }
        for at in 0..self.sharp.len() {
            let time_s = self.sharp_time_s(at);
            let mut velocity = self.camera_velocity(&self.sharp[at].depth, &Theta::neutral(), |_| time_s);
            if let Some(own) = &self.sharp[at].own {
                velocity.data.iter_mut().zip(&own.data).for_each(|(v, o)| *v += o);
            }
            self.sharp[at].velocity = velocity;
        }
    }

    /// Linear radiance as the sensor sees it, from the simulated frames, through a lens that magnifies by `scale`.
    pub(crate) fn warped(
        &self,
        outside: &Outside,
        places: &[usize],
        theta: &Theta,
        scale: f64,
        quality: Quality,
    ) -> Vec<Plane<f32>> {
        let rays = self.rays(theta, scale);
        let one = |&at: &usize| Reader::new(self, outside, at, theta, &rays, quality).picture();
        places.iter().map(one).collect()
    }

    /// Which pixels of a frame show what a simulated frame shows and is `open` there, over their whole exposure.
    pub(crate) fn shown_by_sim(
        &self,
        outside: &Outside,
        at: usize,
        theta: &Theta,
        open: &Plane<f32>,
    ) -> Plane<f32> {
        let rays = self.rays(theta, 1.0);
        Reader::new(self, outside, at, theta, &rays, Quality::Coarse).open(open)
    }

    /// Which simulated frame each pixel reads, where at the middle of its exposure (px), and whether that place was
    /// found.
    pub(crate) fn sights(&self, outside: &Outside, at: usize, theta: &Theta) -> Vec<(usize, Vec2, bool)> {
        let rays = self.rays(theta, 1.0);
        let reader = Reader::new(self, outside, at, theta, &rays, Quality::Coarse);
        let one = |i: usize| {
            let (j, places, known) = reader.places(i);
            (j, places[1], known)
        };
        (0..reader.size()[0] * reader.size()[1]).into_par_iter().map(one).collect()
    }

    /// How well the values of some frames are known because pictures, not a scene, are read. Nothing for a scene.
    pub(crate) fn given(
        &self,
        frames: &[usize],
        theta: &Theta,
        tone: &Tone,
        means: &[Arc<Plane<f32>>],
    ) -> Option<Vec<Given>> {
        let outside = self.outside.as_ref()?;
        let (rays, lifted) = (self.rays(theta, 1.0), mixed_noise(theta).map(|by| (by - 1.0).max(0.0)));
        let one = |(&at, mean): (&usize, &Arc<Plane<f32>>)| {
            Reader::new(self, outside, at, theta, &rays, Quality::Coarse).given(mean, (tone, lifted))
        };
        Some(frames.par_iter().zip(means).map(one).collect())
    }

    /// The ray that each pixel sees, over the focal length, in the given camera's frame.
    fn rays(&self, theta: &Theta, scale: f64) -> Vec<[f32; 2]> {
        let k = &self.intrinsics;
        let f = theta.get(P::Focal) * scale * DVec2::new(k.fx, k.fy);
        let centre = DVec2::new(k.cx, k.cy);
        let w = k.width as usize;
        // Where there are poses they have the turn.
        let posed = self.outside.as_ref().is_some_and(|o| o.sim.geometry == Geometry::Depth);
        let turn = [P::RotX, P::RotY, P::RotZ].map(|p| if posed { 0.0 } else { theta.get(p) });
        let turn = DQuat::from_scaled_axis(DVec3::from(turn));
        let ray = |i: usize| {
            let px = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
            let n =
                turn * crate::diagnose::expect::undistort::undistort((px - centre) / f, theta).extend(1.0);
            (n.truncate() / n.z.max(0.05)).as_vec2().to_array()
        };
        (0..w * k.height as usize).into_par_iter().map(ray).collect()
    }
}

impl<'a> Reader<'a> {
    fn new(
        forward: &Forward,
        outside: &'a Outside,
        at: usize,
        theta: &Theta,
        rays: &'a [[f32; 2]],
        quality: Quality,
    ) -> Self {
        let k = &forward.intrinsics;
        let shutter = forward.shutter(at, theta);
        let path = forward.path(theta);
        let sim = &outside.sim;
        let own = outside.index[at];
        let near = own.saturating_sub(1)..(own + 2).min(sim.frames.len());
        let (first_s, last_s) = path.span_s();
        let pose = |t: f64| path.pose_at(t.clamp(first_s, last_s));
        let given: Vec<Pose> =
            near.clone().map(|j| forward.trajectory.pose_at(sim.times_s[j].clamp(first_s, last_s))).collect();
        let mover = |j: usize, time_s: f64| {
            let part = ((time_s - sim.times_s[j]) / sim.period_s) as f32;
            match sim.geometry {
                Geometry::None => Mover::Rest,
                Geometry::Motion => Mover::Motion(part),
                Geometry::Depth => {
                    let to = pose(time_s).inverse().then_from(&given[j - near.start]);
                    let turn = Mat3::from_quat(to.rotation.as_quat());
                    Mover::Depth(turn, to.translation_m.as_vec3(), part)
                }
            }
        };
        let line = |l: u32| {
            let begin_s = shutter.line_start_s(l);
            let times_s = [0.0, 0.5, 1.0].map(|p| begin_s + p * shutter.exposure_time_s);
            let away = |j: usize| (times_s[1] - sim.times_s[j]).abs();
            let readable = |j: &usize| *j == own || away(*j) < MOST_PERIODS * sim.period_s;
            let alone = sim.geometry == Geometry::None;
            let mut frames: Vec<usize> =
                near.clone().filter(|j| if alone { *j == own } else { readable(j) }).collect();
            frames.sort_by(|&a, &b| away(a).total_cmp(&away(b)));
            frames.into_iter().map(|j| (j, times_s.map(|t| mover(j, t)))).collect()
        };
        Self {
            outside,
            at,
            f: Vec2::new(k.fx as f32, k.fy as f32),
            c: Vec2::new(k.cx as f32, k.cy as f32),
            rays,
            lines: (0..shutter.line_count).map(line).collect(),
            shutter,
            quality,
        }
    }

    fn size(&self) -> [usize; 2] {
        let frame = self.outside.frame(self.at);
        [frame.radiance.width, frame.radiance.height]
    }

    fn line_of(&self, i: usize) -> usize {
        let [w, h] = self.size();
        let order: ScanOrder = self.shutter.scan_order;
        order.line_of((i % w) as u32, (i / w) as u32, w as u32, h as u32) as usize
    }

    fn picture(&self) -> Plane<f32> {
        let [width, height] = self.size();
        let mut data = vec![0.0f32; width * height * 3];
        data.par_chunks_mut(3 * width).enumerate().for_each(|(y, row)| {
            for (x, to) in row.chunks_exact_mut(3).enumerate() {
                to.copy_from_slice(&self.value(y * width + x));
            }
        });
        Plane { width, height, channels: 3, data }
    }

    /// See [`Forward::given`]. `lifted`: what filters add to the variance of single values, by colour.
    fn given(&self, mean: &Plane<f32>, (tone, lifted): (&Tone, [f32; 3])) -> Given {
        let off_px = self.outside.left_px[self.at];
        let (w, h) = (mean.width, mean.height);
        let one = |i: usize| {
            let (j, [a, b, c], _) = self.places(i);
            // Along an exposure errors of many places are averaged.
            let many = ((c - b).length() + (b - a).length()).max(1.0);
            let between = |v: f32| {
                let f = (v - 0.5).rem_euclid(1.0);
                (BETWEEN_PX * 4.0 * f * (1.0 - f)).powi(2) / many
            };
            let (x, y) = (i % w, i / w);
            let at = |x: usize, y: usize, c: usize| mean.data[3 * (y * w + x) + c];
            let (column, row) = (b.x.clamp(0.0, w as f32 - 1.0), b.y.clamp(0.0, h as f32 - 1.0));
            let picture = self.outside.sim.frames[j].radiance.pixel(column as usize, row as usize);
            three(|c| {
                let gx = 0.5 * (at((x + 1).min(w - 1), y, c) - at(x.saturating_sub(1), y, c));
                let gy = 0.5 * (at(x, (y + 1).min(h - 1), c) - at(x, y.saturating_sub(1), c));
                let lies = off_px * off_px;
                let of = GivenValue::of(picture[c], self.outside.sim.linear, at(x, y, c), tone, c);
                // A filter that sharpens lifts what neighbours of other values were rounded by.
                let rounded = lifted[c] * of.step * of.step / 12.0;
                let single = gx * gx * (between(b.x) + lies) + gy * gy * (between(b.y) + lies) + rounded;
                GivenValue { single, ..of }
            })
        };
        (0..w * h).into_par_iter().flat_map_iter(one).collect()
    }

    fn value(&self, i: usize) -> [f32; 3] {
        let (j, [a, b, c], _) = self.places(i);
        let plane = &self.outside.sim.frames[j].radiance;
        if self.shutter.exposure_time_s <= 0.0 {
            return read(plane, b, self.quality);
        }
        let long = (b - a).length() + (c - b).length();
        let density = if self.quality <= Quality::Coarse { 0.7 } else { 2.0 };
        let parts = (density * long).ceil().clamp(1.0, MOST_PARTS);
        let mut sum = [0.0f32; 3];
        for k in 0..parts as usize {
            // The parabola through begin, middle and end.
            let p = (k as f32 + 0.5) / parts;
            let s = a * ((1.0 - p) * (1.0 - 2.0 * p)) + b * (4.0 * p * (1.0 - p)) + c * (p * (2.0 * p - 1.0));
            let v = read(plane, s, self.quality);
            (0..3).for_each(|k| sum[k] += v[k]);
        }
        sum.map(|v| v / parts)
    }

    /// The frame that a pixel reads, where at begin, middle and end of its exposure, and whether all of that was found.
    fn places(&self, i: usize) -> (usize, [Vec2; 3], bool) {
        let ray = Vec2::from(self.rays[i]);
        let mut first = None;
        let exposed = self.shutter.exposure_time_s > 0.0;
        for (j, movers) in &self.lines[self.line_of(i)] {
            let (middle, mut known) = self.solve(*j, ray, &movers[1], self.c + self.f * ray);
            let mut places = [middle; 3];
            if exposed {
                for k in [0, 2] {
                    let (place, found) = self.solve(*j, ray, &movers[k], middle);
                    places[k] = place;
                    known &= found;
                }
            }
            if let Some(shift) = self.outside.shift[self.at].as_ref() {
                let by = shifted(shift, middle);
                places.iter_mut().for_each(|p| *p += by);
                known &= places.iter().all(|p| self.is_inside(*p));
            }
            if known {
                return (*j, places, true);
            }
            first.get_or_insert((*j, places, false));
        }
        first.expect("a frame always reads its own")
    }

    fn is_inside(&self, s: Vec2) -> bool {
        let [w, h] = self.size();
        s.x >= 0.5 && s.y >= 0.5 && s.x <= w as f32 - 0.5 && s.y <= h as f32 - 0.5
    }

    /// The place of a frame whose content lies on a ray, and whether it was found inside the picture.
    fn solve(&self, j: usize, ray: Vec2, mover: &Mover, from: Vec2) -> (Vec2, bool) {
        let frame = &self.outside.sim.frames[j];
        if matches!(mover, Mover::Rest) {
            let s = self.c + self.f * ray;
            return (s, self.is_inside(s));
        }
        let (w, h) = (frame.radiance.width, frame.radiance.height);
        let target = self.c + self.f * ray;
        let (mut s, mut last) = (from, f32::INFINITY);
        for _ in 0..STEPS {
            let (x, y) = (s.x.clamp(0.0, w as f32 - 1.0) as usize, s.y.clamp(0.0, h as f32 - 1.0) as usize);
            let i = y * w + x;
            let to = match mover {
                Mover::Depth(turn, step, part) => {
                    let z = frame.depth.as_ref().map_or(f32::INFINITY, |d| depth_at(d, s));
                    let n = (s - self.c) / self.f;
                    let p =
                        *turn * Vec3::new(n.x, n.y, 1.0) + if z.is_finite() { *step / z } else { Vec3::ZERO };
                    let own = frame
                        .own
                        .as_ref()
                        .map_or(Vec2::ZERO, |o| *part * Vec2::new(o.data[2 * i], o.data[2 * i + 1]));
                    self.c + self.f * p.truncate() / p.z.max(0.05) + own
                }
                Mover::Motion(part) => s + frame.moved(i, *part),
                Mover::Rest => s,
            };
            let off = target - to;
            s += off;
            last = off.length();
            if last < NEAR_PX {
                break;
            }
        }
        (s, last < FOUND_PX && self.is_inside(s))
    }

    fn open(&self, open: &Plane<f32>) -> Plane<f32> {
        let [width, height] = self.size();
        let own = self.outside.index[self.at];
        let is_open = |i: usize| {
            let (j, places, known) = self.places(i);
            let at = |s: &Vec2| {
                let plane = if j == own { open } else { &self.outside.sim.frames[j].open };
                let (x, y) = (s.x.clamp(0.0, width as f32 - 1.0), s.y.clamp(0.0, height as f32 - 1.0));
                plane.pixel(x as usize, y as usize)[0] > 0.5
            };
            let line = &self.lines[self.line_of(i)];
            let movers = line.iter().find(|l| l.0 == j).map(|l| &l.1);
            let whole = |movers: &[Mover; 3]| {
                movers.iter().zip(&places).all(|(mover, s)| !self.is_uncovered(j, mover, *s))
            };
            f32::from(u8::from(known && places.iter().all(at) && movers.is_none_or(whole)))
        };
        let data = (0..width * height).into_par_iter().map(is_open).collect();
        Plane { width, height, channels: 1, data }
    }

    /// Whether a place lies so near the edge of something that what is behind it may have come into sight, or gone out
    /// of it.
    fn is_uncovered(&self, j: usize, mover: &Mover, s: Vec2) -> bool {
        let frame = &self.outside.sim.frames[j];
        // Px by which a jump of one unit parts the two sides of an edge.
        let (per_jump, jumps) = match (mover, &frame.jumps) {
            (Mover::Depth(_, step, _), Some(jumps)) => (self.f.x.max(self.f.y) * step.length(), jumps),
            (Mover::Motion(part), Some(jumps)) => (part.abs(), jumps),
            _ => return false,
        };
        let reach = (per_jump * jumps.most + 1.0).min(MOST_EDGE_PX);
        if per_jump * jumps.most < SEEN_PX {
            return false;
        }
        let (w, h) = (jumps.plane.width as isize, jumps.plane.height as isize);
        let (x, y, n) = (s.x as isize, s.y as isize, reach.ceil() as isize);
        let parted = |(u, v): (isize, isize)| {
            let part = per_jump * jumps.plane.data[(v * w + u) as usize];
            let (dx, dy) = (u as f32 + 0.5 - s.x, v as f32 + 0.5 - s.y);
            part > SEEN_PX && dx * dx + dy * dy < (part + 1.0).powi(2)
        };
        let rows = (y - n).max(0)..=(y + n).min(h - 1);
        let mut around = rows.flat_map(|v| ((x - n).max(0)..=(x + n).min(w - 1)).map(move |u| (u, v)));
        around.any(parted)
    }
}
