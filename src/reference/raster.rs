//! One instant of a scene as seen by a pinhole: radiance, depth and motion.
//!
//! A ray `d = ((u - cx)/fx, (v - cy)/fy, 1)` meets the triangle with camera-space corners a, b, c in the point `z d`
//! whose barycentric coordinates are in the ratio `d.(b x c) : d.(c x a) : d.(a x b)`; it lies inside, and in front of
//! the camera, where all three have the sign of `a.(b x c)`, and `1/z` is their sum over that determinant. All of
//! these are linear in (u, v), so no triangle is ever clipped or divided by w, and as the functions of a shared edge
//! are each other's exact negatives, no sample falls between two triangles. Faces are drawn from both sides; nothing
//! is drawn nearer than [`NEAR_M`]. Of surfaces at the same depth the first in the scene's order is seen.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::lens::{LensGrid, Places};
use super::shade::{self, Shader};
pub use super::window::Window;
use crate::camera::{Intrinsics, NEAR_M, Pose, Trajectory};
use crate::plane::{Plane, three};
use crate::scene::Scene;

/// Where from and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Size and pinhole.
    pub intrinsics: Intrinsics,
    /// Pose of the camera.
    pub world_from_camera: Pose,
    /// When: decides where moving objects stand, s.
    pub time_s: f64,
}

/// The interval over which motion is taken: `(projection at to_s - projection at from_s) * scale`, of the surface point
/// that is seen at [`View::time_s`]. With a scale of T / (`to_s` - `from_s`) it is px per frame interval T.
#[derive(Clone, Copy, Debug)]
pub struct MotionSpan<'a> {
    /// Pose of the camera over time; covers `from_s` and `to_s`, as do those of moving objects.
    pub trajectory: &'a Trajectory,
    /// Begin, s.
    pub from_s: f64,
    /// End, s.
    pub to_s: f64,
    /// Factor on the displacement.
    pub scale: f64,
}

/// What is seen, each of shape `[window height, window width, channels]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Linear RGB, the mean over the samples with uncovered ones black, and the share of covered samples, 0..1.
    pub color: Plane<f32>,
    /// Distance along the optical axis of the pixel's nearest sample, m; infinite where nothing is.
    pub depth_m: Plane<f32>,
    /// Motion (x, y) of that sample, never averaged; zero where nothing is or no span was given.
    pub motion_px: Plane<f32>,
}

/// Renders the whole picture. `samples` are places inside a pixel ([`crate::camera::samples`]).
///
/// # Panics
/// If there is no sample, or a trajectory does not cover a time that is needed (callers check that once).
pub fn render(scene: &Scene, view: &View, samples: &[[f32; 2]], motion: Option<&MotionSpan<'_>>) -> Rendered {
    render_window(scene, view, samples, motion, Window::whole(&view.intrinsics))
}

/// Renders a part of the picture: the same values as [`render`] there.
///
/// # Panics
/// As [`render`], or if the window leaves the picture.
pub fn render_window(
    scene: &Scene,
    view: &View,
    samples: &[[f32; 2]],
    motion: Option<&MotionSpan<'_>>,
    window: Window,
) -> Rendered {
    let place = |s: &[f32; 2]| DVec2::new(f64::from(s[0]), f64::from(s[1]));
    render_places(scene, view, Places::Pinhole(samples.iter().map(place).collect()), motion, window)
}

/// Renders a part of the picture behind a lens, without motion.
///
/// # Panics
/// As [`render_window`].
pub fn render_through(scene: &Scene, view: &View, grid: &LensGrid, window: Window) -> Rendered {
    render_places(scene, view, Places::Lens(grid), None, window)
}

fn render_places(
    scene: &Scene,
    view: &View,
    places: Places<'_>,
    motion: Option<&MotionSpan<'_>>,
    window: Window,
) -> Rendered {
    /// Rows that one task renders.
    const BAND: usize = 8;
    assert!(places.count() > 0, "a pixel needs at least one sample");
    let k = &view.intrinsics;
    assert!(
        window.x + window.width <= k.width && window.y + window.height <= k.height,
        "{window:?} leaves a picture of {}x{}",
        k.width,
        k.height
    );
    let (width, height) = (window.width as usize, window.height as usize);
    let task = Task {
        scene,
        window,
        triangles: set_up(scene, view, &places, window),
        places,
        shader: Shader::new(scene, view.time_s, view.world_from_camera.translation_m),
        motion: motion.map(|span| Motion::new(scene, k, span)),
    };
    let mut out = Rendered {
        color: Plane::new(width, height, 4),
        depth_m: Plane::new(width, height, 1),
        motion_px: Plane::new(width, height, 2),
    };
    if width > 0 {
        let band = BAND * width;
        let colors = out.color.data.par_chunks_mut(4 * band);
        let depths = out.depth_m.data.par_chunks_mut(band);
        let motions = out.motion_px.data.par_chunks_mut(2 * band);
        colors.zip(depths).zip(motions).enumerate().for_each(|(i, ((color, depth), motion))| {
            task.band(window.y + (i * BAND) as u32, color, depth, motion);
        });
    }
    out
}

/// A function linear in picture coordinates: `a u + b v + c`.
#[derive(Clone, Copy)]
struct Linear {
    a: f64,
    b: f64,
    c: f64,
}

impl Linear {
    /// `d.n` of the ray through (u, v).
    fn of_ray(n: DVec3, k: &Intrinsics) -> Self {
        let (a, b) = (n.x / k.fx, n.y / k.fy);
        Self { a, b, c: n.z - k.cx * a - k.cy * b }
    }

    fn at(self, px: DVec2) -> f64 {
        self.a * px.x + self.b * px.y + self.c
    }
}

/// A triangle that may be seen.
struct Triangle {
    index: usize,
    /// Not negative inside; each corner's barycentric coordinate but for their sum.
    edges: [Linear; 3],
    /// 1/z, 1/m.
    inverse_depth: Linear,
    /// Between those of the corners, so that rounding on a face seen edge-on cannot move it.
    inverse_depth_range: [f64; 2],
    /// Pixels that it may touch.
    columns: Range<u32>,
    rows: Range<u32>,
}

impl Triangle {
    fn inverse_depth_at(&self, px: DVec2) -> f64 {
        self.inverse_depth.at(px).clamp(self.inverse_depth_range[0], self.inverse_depth_range[1])
    }

    fn barycentric(&self, px: DVec2) -> [f64; 3] {
        let e = three(|i| self.edges[i].at(px).max(0.0));
        let sum = e[0] + e[1] + e[2];
        // All three vanish only where the triangle is a point or a line; any of its points will do.
        if sum > 0.0 { three(|i| e[i] / sum) } else { [1.0, 0.0, 0.0] }
    }
}

fn set_up(scene: &Scene, view: &View, places: &Places<'_>, window: Window) -> Vec<Triangle> {
    let camera_from_world = view.world_from_camera.inverse();
    let camera_from_object: Vec<Pose> = scene
        .objects
        .iter()
        .map(|o| camera_from_world.then_from(&o.world_from_object(view.time_s)))
        .collect();
    let points_m: Vec<DVec3> = scene
        .vertices
        .iter()
        .map(|v| camera_from_object[v.object as usize].transform(DVec3::from(v.position_m.map(f64::from))))
        .collect();
    let corners = scene.indices.chunks_exact(3).map(|i| [0, 1, 2].map(|c| points_m[i[c] as usize]));
    corners
        .enumerate()
        .filter_map(|(index, corners)| triangle(index, corners, (&view.intrinsics, places), window))
        .collect()
}

/// `None` for a triangle that no ray of the window can meet.
fn triangle(
    index: usize,
    [a, b, c]: [DVec3; 3],
    (k, places): (&Intrinsics, &Places<'_>),
    window: Window,
) -> Option<Triangle> {
    let (columns, rows) = touched_pixels([a, b, c], (k, places), window)?;
    let normals = [b.cross(c), c.cross(a), a.cross(b)];
    let determinant = a.dot(normals[0]);
    if determinant == 0.0 {
        return None;
    }
    let sign = determinant.signum();
    let edges = normals.map(|n| Linear::of_ray(sign * n, k));
    let sum = |f: fn(&Linear) -> f64| edges.iter().map(f).sum::<f64>() / determinant.abs();
    let inverse_depth = Linear { a: sum(|e| e.a), b: sum(|e| e.b), c: sum(|e| e.c) };
    let nearest_m = a.z.min(b.z).min(c.z);
    let inverse_depth_range =
        [1.0 / a.z.max(b.z).max(c.z), if nearest_m > 0.0 { 1.0 / nearest_m } else { f64::INFINITY }];
    Some(Triangle { index, edges, inverse_depth, inverse_depth_range, columns, rows })
}

/// Columns and rows of the window that the part of a triangle beyond [`NEAR_M`] may touch.
fn touched_pixels(
    corners: [DVec3; 3],
    (k, places): (&Intrinsics, &Places<'_>),
    window: Window,
) -> Option<(Range<u32>, Range<u32>)> {
    let mut low = DVec2::INFINITY;
    let mut high = DVec2::NEG_INFINITY;
    let mut include = |p: DVec3| {
        if let Some(px) = k.project(p) {
            low = low.min(px);
            high = high.max(px);
        }
    };
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        if p.z >= NEAR_M {
            include(p);
        }
        if (p.z >= NEAR_M) != (q.z >= NEAR_M) {
            include(p.lerp(q, (NEAR_M - p.z) / (q.z - p.z)));
        }
    }
    if let Places::Lens(grid) = places {
        return grid.touched(low, high, window);
    }
    // The margin covers rounding, so that a sample on the very edge is tested; casts saturate.
    let span = |low: f64, high: f64, first: u32, count: u32| {
        let from = ((low - 1e-3).floor().max(0.0) as u32).max(first);
        let to = (((high + 1e-3).floor() + 1.0).max(0.0) as u32).min(first + count);
        (from < to).then_some(from..to)
    };
    Some((span(low.x, high.x, window.x, window.width)?, span(low.y, high.y, window.y, window.height)?))
}

/// Camera from object at both ends of a [`MotionSpan`].
struct Motion {
    intrinsics: Intrinsics,
    from: Vec<Pose>,
    to: Vec<Pose>,
    scale: f64,
}

impl Motion {
    fn new(scene: &Scene, intrinsics: &Intrinsics, span: &MotionSpan<'_>) -> Self {
        let poses = |time_s: f64| {
            let camera_from_world = span.trajectory.pose_at(time_s).inverse();
            scene.objects.iter().map(|o| camera_from_world.then_from(&o.world_from_object(time_s))).collect()
        };
        Self { intrinsics: *intrinsics, from: poses(span.from_s), to: poses(span.to_s), scale: span.scale }
    }

    /// Motion of a point given in the coordinates of its object, px times scale. A point that is behind the camera
    /// at one end is taken to be just in front of it: its motion is large and finite.
    fn of(&self, object: usize, point_m: DVec3) -> DVec2 {
        let project = |pose: &Pose| {
            let p = pose.transform(point_m);
            self.intrinsics.project(p.with_z(p.z.max(NEAR_M))).expect("in front of the camera")
        };
        (project(&self.to[object]) - project(&self.from[object])) * self.scale
    }
}

/// Everything that a band of rows needs.
struct Task<'a> {
    scene: &'a Scene,
    window: Window,
    places: Places<'a>,
    triangles: Vec<Triangle>,
    shader: Shader<'a>,
    motion: Option<Motion>,
}

/// What a sample sees.
#[derive(Clone, Copy)]
struct Hit {
    /// 1/z, 1/m; 0 = nothing, infinitely far away.
    inverse_depth: f64,
    /// Place in [`Task::triangles`].
    triangle: u32,
}

impl Task<'_> {
    /// Fills the rows from `first_row` on; the slices say how many.
    fn band(&self, first_row: u32, color: &mut [f32], depth_m: &mut [f32], motion_px: &mut [f32]) {
        let width = self.window.width as usize;
        let rows = first_row..first_row + (depth_m.len() / width) as u32;
        let hits = self.visible(rows.clone());
        for (i, hits) in hits.chunks_exact(self.places.count()).enumerate() {
            let pixel =
                self.resolve(self.window.x + (i % width) as u32, first_row + (i / width) as u32, hits);
            color[4 * i..4 * i + 4].copy_from_slice(&pixel.color);
            depth_m[i] = pixel.depth_m;
            motion_px[2 * i..2 * i + 2].copy_from_slice(&pixel.motion_px);
        }
    }

    /// The nearest surface of every sample of these rows, `[rows, window width, samples]`.
    fn visible(&self, rows: Range<u32>) -> Vec<Hit> {
        let (width, count) = (self.window.width as usize, self.places.count());
        let pinhole = matches!(self.places, Places::Pinhole(_));
        let mut hits = vec![Hit { inverse_depth: 0.0, triangle: 0 }; rows.len() * width * count];
        for (place, triangle) in self.triangles.iter().enumerate() {
            // Each edge's largest value in a pixel, over its value in the pixel's corner.
            let reach = triangle.edges.map(|e| e.a.max(0.0) + e.b.max(0.0));
            for y in triangle.rows.start.max(rows.start)..triangle.rows.end.min(rows.end) {
                for x in triangle.columns.clone() {
                    let corner = DVec2::new(f64::from(x), f64::from(y));
                    let outside = |i: usize| triangle.edges[i].at(corner) + reach[i] < 0.0;
                    if pinhole && (outside(0) || outside(1) || outside(2)) {
                        continue;
                    }
                    let at = ((y - rows.start) as usize * width + (x - self.window.x) as usize) * count;
                    for (i, hit) in hits[at..at + count].iter_mut().enumerate() {
                        let px = self.places.at(x, y, i);
                        if px.is_nan() || triangle.edges.iter().any(|e| e.at(px) < 0.0) {
                            continue;
                        }
                        let inverse_depth = triangle.inverse_depth_at(px);
                        if inverse_depth > hit.inverse_depth && inverse_depth <= 1.0 / NEAR_M {
                            *hit = Hit { inverse_depth, triangle: place as u32 };
                        }
                    }
                }
            }
        }
        hits
    }

    /// Box mean of the samples' radiance; depth and motion of the nearest sample.
    fn resolve(&self, x: u32, y: u32, hits: &[Hit]) -> Pixel {
        let mut pixel = Pixel { color: [0.0; 4], depth_m: f32::INFINITY, motion_px: [0.0; 2] };
        let mut nearest: Option<(Hit, DVec2)> = None;
        for (i, hit) in hits.iter().enumerate().filter(|(_, hit)| hit.inverse_depth > 0.0) {
            let px = self.places.at(x, y, i);
            let triangle = &self.triangles[hit.triangle as usize];
            let [r, g, b] = self.shader.radiance(triangle.index, triangle.barycentric(px));
            for (sum, value) in pixel.color.iter_mut().zip([r, g, b, 1.0]) {
                *sum += value;
            }
            if nearest.is_none_or(|(n, _)| hit.inverse_depth > n.inverse_depth) {
                nearest = Some((*hit, px));
            }
        }
        pixel.color.iter_mut().for_each(|sum| *sum /= hits.len() as f32);
        if let Some((hit, px)) = nearest {
            pixel.depth_m = (1.0 / hit.inverse_depth) as f32;
            if let Some(motion) = &self.motion {
                let triangle = &self.triangles[hit.triangle as usize];
                let corners = shade::corners(self.scene, triangle.index);
                let point_m = shade::weigh(corners, triangle.barycentric(px), |v| v.position_m);
                pixel.motion_px = motion.of(corners[0].object as usize, point_m).as_vec2().to_array();
            }
        }
        pixel
    }
}

/// One pixel of [`Rendered`].
struct Pixel {
    color: [f32; 4],
    depth_m: f32,
    motion_px: [f32; 2],
}
