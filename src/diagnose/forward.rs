//! From parameters to simulated frames. What costs a render (the instants that each line sees) is kept; what only moves
//! pixels (lens, pose, focal length) is a resampling of a larger render at twice the resolution; the rest is pointwise.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::evidence::Evidence;
use super::model::{P, Theta};
use super::photometric::{LineTimes, develop};
use crate::camera::{Intrinsics, ScanOrder, ShutterTiming};
use crate::capture::Capture;
use crate::chain::Settings;
use crate::engine::{Engine, EngineOptions, ExactOptions, FrameRequest, Method};
use crate::error::Result;
use crate::gpu::Context;
use crate::plane::Plane;
use crate::reference::raster::{View, render};
use crate::scene::{Material, Shading};

/// Rendered px a px where the picture is resampled: bicubic reading at this size blurs by less than 0.1 px.
const SCALE: u32 = 2;
/// Samples a pixel of the renders that fits see.
const FIT_SAMPLES: u32 = 4;
/// Most bytes of renders that are kept.
const CACHE_BYTES: usize = 1 << 30;
/// Half of the interval over which speeds are measured, s.
const SPEED_STEP_S: f64 = 2e-3;

/// What a frame is like, whatever the effects: from the sharp planes at the middle of the frame's likely exposure.
#[derive(Clone, Debug)]
pub(super) struct Sharp {
    /// Speed of the content, px/s, shape `[height, width, 2]`.
    pub velocity: Plane<f32>,
    /// 1 where geometry covers the pixel.
    pub coverage: Plane<f32>,
}

/// Renders the frames of a capture for any parameters.
pub(super) struct Forward {
    /// For fits (few samples), and for judging.
    plain: [Engine; 2],
    wide: [Option<Engine>; 2],
    /// Whether frames are for judging.
    pub(super) fine: bool,
    margin_px: u32,
    context: Arc<Context>,
    scene: Arc<crate::scene::Scene>,
    trajectory: Arc<crate::camera::Trajectory>,
    static_camera: bool,
    /// The camera as given.
    pub(super) intrinsics: Intrinsics,
    /// From one frame to the next, s.
    pub(super) period_s: f64,
    /// By place in [`Evidence::frames`].
    starts_s: Vec<f64>,
    reach_s: [f64; 2],
    /// Sharp planes by place.
    pub(super) sharp: Vec<Sharp>,
    cache: HashMap<Key, (u64, Arc<Plane<f32>>)>,
    clock: u64,
    map: Option<(Vec<u64>, Arc<Map>)>,
    /// Renders made so far.
    pub(super) renders: usize,
}

/// Place, whether wide and whether fine, times, order of lines.
type Key = (usize, [bool; 2], [u64; 3], ScanOrder);

/// Where each of the 2x2 parts of each pixel reads the wide render, by channel: px of the wide render. One entry where
/// the channels agree.
pub(super) struct Map {
    channels: Vec<Vec<[f32; 2]>>,
}

impl Forward {
    pub(super) fn new(context: &Arc<Context>, capture: &Capture, evidence: &Evidence) -> Result<Self> {
        let (scene, trajectory) = (Arc::new(capture.scene.clone()), Arc::new(capture.trajectory.clone()));
        let intrinsics = capture.camera.intrinsics;
        let engine = |samples: u32, planes: bool| {
            let options = EngineOptions { planes, ..options(samples) };
            Engine::new(context, scene.clone(), trajectory.clone(), intrinsics, options, &[])
        };
        let plain = [engine(FIT_SAMPLES, false)?, engine(16, true)?];
        let mut forward = Self {
            plain,
            wide: [None, None],
            fine: false,
            margin_px: 0,
            context: context.clone(),
            scene: scene.clone(),
            trajectory: trajectory.clone(),
            static_camera: capture.camera.static_camera,
            intrinsics,
            period_s: capture.camera.frame_period_s,
            starts_s: evidence.frames.iter().map(|f| f.start_s).collect(),
            reach_s: evidence.reach_s,
            sharp: Vec::new(),
            cache: HashMap::new(),
            clock: 0,
            map: None,
            renders: 0,
        };
        forward.sharp = (0..evidence.frames.len()).map(|at| forward.measure(at)).collect::<Result<_>>()?;
        Ok(forward)
    }

    fn measure(&mut self, at: usize) -> Result<Sharp> {
        // Speed over a short time in the middle of where exposures lie; forward from there.
        let after_s = (0.4 * self.period_s).min((self.reach_s[1] - 2.0 * SPEED_STEP_S).max(0.0));
        let mut request = self.request(at, &Theta::neutral());
        request.shutter.start_s = self.starts_s[at] + after_s;
        request.frame_interval_s = 2.0 * SPEED_STEP_S;
        request.planes = true;
        let ticket = self.plain[1].submit(&request)?;
        let planes = self.plain[1].collect(ticket)?.planes.expect("planes were asked for");
        let rests = self.static_camera;
        let per_s = if rests { 0.0 } else { (0.5 / SPEED_STEP_S) as f32 };
        let mut velocity = planes.motion_px;
        velocity.data.iter_mut().for_each(|v| *v = if v.is_finite() { *v * per_s } else { 0.0 });
        let (w, h) = (planes.color.width, planes.color.height);
        let coverage = Plane::from_fn(w, h, |x, y| [planes.color.pixel(x, y)[3]]);
        Ok(Sharp { velocity, coverage })
    }

    /// The shutter for `theta`, kept inside the time for which there are poses.
    fn shutter(&self, at: usize, theta: &Theta) -> ShutterTiming {
        let k = &self.intrinsics;
        let offset_s = theta.get(P::Offset).clamp(-self.reach_s[0], self.reach_s[1]);
        let room_s = (self.reach_s[1] - offset_s).max(0.0);
        let exposure_time_s = theta.get(P::Exposure).min(room_s);
        ShutterTiming {
            start_s: self.starts_s[at] + offset_s,
            exposure_time_s,
            readout_time_s: theta.get(P::Readout).min(room_s - exposure_time_s),
            scan_order: theta.scan_order,
            line_count: theta.scan_order.line_count(k.width, k.height),
        }
    }

    /// Longest readout or exposure that every frame has poses for, s.
    pub(super) fn longest_s(&self) -> f64 {
        self.reach_s[1].min(2.0 * self.period_s)
    }

    /// Earliest and latest offset, s.
    pub(super) fn offsets_s(&self) -> [f64; 2] {
        [-self.reach_s[0].min(self.period_s), self.reach_s[1].min(self.period_s)]
    }

    fn request(&self, at: usize, theta: &Theta) -> FrameRequest {
        FrameRequest {
            index: at as u32,
            shutter: self.shutter(at, theta),
            frame_interval_s: self.period_s,
            seed: 0,
            settings: Settings::default(),
            static_camera: self.static_camera,
            planes: false,
            statistics: true,
        }
    }

    /// Linear radiance as the sensor sees it, shape `[height, width, 3]`, of several frames (by place).
    pub(super) fn radiance(&mut self, frames: &[usize], theta: &Theta) -> Result<Vec<Arc<Plane<f32>>>> {
        let remaps = super::model::ALL.iter().any(|&p| p.is_remap() && theta.is_on(p));
        if !remaps {
            return self.render(frames, theta, false);
        }
        let map = self.map_for(theta)?;
        let wide = self.render(frames, theta, true)?;
        let rolls = theta.get(P::Readout) > 0.0;
        let out = frames
            .par_iter()
            .zip(&wide)
            .map(|(&at, wide)| {
                let shutter = self.shutter(at, theta);
                let velocity = rolls.then_some(&self.sharp[at].velocity);
                Arc::new(self.resample(wide, &map, &shutter, velocity))
            })
            .collect();
        Ok(out)
    }

    /// Renders what is not kept yet.
    fn render(&mut self, frames: &[usize], theta: &Theta, wide: bool) -> Result<Vec<Arc<Plane<f32>>>> {
        let keys: Vec<_> = frames
            .iter()
            .map(|&at| {
                let s = self.shutter(at, theta);
                (
                    at,
                    [wide, self.fine],
                    [s.start_s, s.exposure_time_s, s.readout_time_s].map(f64::to_bits),
                    s.scan_order,
                )
            })
            .collect();
        let missing: Vec<_> = (0..frames.len()).filter(|&i| !self.cache.contains_key(&keys[i])).collect();
        let requests: Vec<_> = missing.iter().map(|&i| self.request(frames[i], theta)).collect();
        let scale = if wide { SCALE } else { 1 };
        let requests: Vec<_> = requests.into_iter().map(|r| self.scaled(r, scale)).collect();
        self.renders += requests.len();
        let quality = usize::from(self.fine);
        if wide && self.wide[quality].is_none() {
            self.wide[quality] = Some(self.wide_engine(if self.fine { 4 } else { 1 })?);
        }
        let engine = match &mut self.wide[quality] {
            Some(engine) if wide => engine,
            _ => &mut self.plain[quality],
        };
        let mut tickets = std::collections::VecDeque::new();
        let mut done = Vec::new();
        for request in &requests {
            if tickets.len() == engine.frames_in_flight() {
                done.push(engine.collect(tickets.pop_front().expect("not empty"))?);
            }
            tickets.push_back(engine.submit(request)?);
        }
        for ticket in tickets {
            done.push(engine.collect(ticket)?);
        }
        for (&i, frame) in missing.iter().zip(done) {
            let radiance = frame.radiance.expect("radiance was asked for");
            let rgb = radiance.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
            let plane = Plane { width: radiance.width, height: radiance.height, channels: 3, data: rgb };
            self.cache.insert(keys[i], (0, Arc::new(plane)));
        }
        self.clock += 1;
        let mut out = Vec::with_capacity(frames.len());
        for key in &keys {
            let entry = self.cache.get_mut(key).expect("just rendered");
            entry.0 = self.clock;
            out.push(entry.1.clone());
        }
        self.forget();
        Ok(out)
    }

    /// The same request for a picture with margin at another scale: lines beyond the picture keep the sensor's pace.
    fn scaled(&self, mut request: FrameRequest, scale: u32) -> FrameRequest {
        if scale == 1 {
            return request;
        }
        let k = &self.intrinsics;
        let shutter = &mut request.shutter;
        let inner = f64::from(shutter.scan_order.line_count(k.width, k.height));
        let margin = f64::from(self.margin_px);
        let count =
            shutter.scan_order.line_count(k.width + 2 * self.margin_px, k.height + 2 * self.margin_px);
        let before_s = shutter.readout_time_s * margin / inner;
        // Half lines: the first half of a line of the sensor starts a quarter of its delay early.
        let early_s = 0.25 * shutter.readout_time_s / inner;
        shutter.start_s -= before_s + if shutter.readout_time_s > 0.0 { early_s } else { 0.0 };
        shutter.readout_time_s *= f64::from(count) / inner;
        shutter.line_count = count * scale;
        request
    }

    fn forget(&mut self) {
        let bytes = |p: &Plane<f32>| p.data.len() * 4;
        let mut total: usize = self.cache.values().map(|(_, p)| bytes(p)).sum();
        if total <= CACHE_BYTES {
            return;
        }
        let mut ages: Vec<_> = self.cache.iter().map(|(k, (age, p))| (*age, *k, bytes(p))).collect();
        ages.sort_by_key(|(age, k, _)| (*age, k.0, k.2));
        for (_, key, size) in ages {
            if total <= CACHE_BYTES / 2 {
                break;
            }
            self.cache.remove(&key);
            total -= size;
        }
    }

    /// What the scene's parts are called: its objects, or its materials where there is one object only.
    pub(super) fn object_names(&self) -> Vec<String> {
        if self.scene.objects.len() > 1 {
            self.scene.objects.iter().map(|o| o.name.clone()).collect()
        } else {
            self.scene.materials.iter().map(|m| m.name.clone()).collect()
        }
    }

    /// Row, column and part of the scene (see [`Self::object_names`]) of every `step`th pixel of a frame.
    pub(super) fn objects(&self, at: usize, step: usize) -> Vec<(usize, usize, usize)> {
        let mut scene = (*self.scene).clone();
        let several = scene.objects.len() > 1;
        let count = self.object_names().len();
        for v in &mut scene.vertices {
            v.material = if several { v.object } else { v.material };
        }
        // Unlit, so that the number of the part comes through as its radiance.
        scene.shading = Shading::Unlit;
        let part = |i: usize| Material { kd: [i as f32 + 1.0, 0.0, 0.0], ..Material::default() };
        scene.materials = (0..count.max(1)).map(part).collect();
        let k = &self.intrinsics;
        let s = step as f64;
        let small = Intrinsics {
            width: (k.width as usize / step).max(1) as u32,
            height: (k.height as usize / step).max(1) as u32,
            fx: k.fx / s,
            fy: k.fy / s,
            cx: k.cx / s,
            cy: k.cy / s,
        };
        let time_s = self.starts_s[at];
        let world_from_camera = self.trajectory.pose_at(time_s);
        let view = View { intrinsics: small, world_from_camera, time_s };
        let seen = render(&scene, &view, &[[0.5, 0.5]], None).color;
        let mut out = Vec::new();
        for y in 0..seen.height {
            for x in 0..seen.width {
                let id = seen.pixel(x, y)[0].round() as usize;
                if id > 0 {
                    out.push((y * step + step / 2, x * step + step / 2, id - 1));
                }
            }
        }
        out
    }

    /// Values as delivered, DN, without noise; by place.
    pub(super) fn simulate(&mut self, frames: &[usize], theta: &Theta) -> Result<Vec<Plane<f32>>> {
        let radiance = self.radiance(frames, theta)?;
        Ok(frames.par_iter().zip(&radiance).map(|(&at, r)| self.develop(at, r, theta)).collect())
    }

    /// Develops the radiance of a frame.
    pub(super) fn develop(&self, at: usize, radiance: &Plane<f32>, theta: &Theta) -> Plane<f32> {
        let shutter = self.shutter(at, theta);
        let lines = LineTimes {
            start_s: shutter.start_s,
            readout_s: shutter.readout_time_s,
            scan_order: theta.scan_order,
        };
        develop(radiance, theta, &self.intrinsics, lines).dn
    }

    /// Where a point of the picture lies in the picture of the given camera at the given pose, px.
    pub(super) fn source(&self, px: DVec2, theta: &Theta, channel: usize) -> DVec2 {
        let k = &self.intrinsics;
        let centre = DVec2::new(k.cx, k.cy);
        let scale = [theta.get(P::ScaleR), 1.0, theta.get(P::ScaleB)][channel];
        let ratio = theta.get(P::Focal);
        let distorted = (px - centre) / scale / (ratio * DVec2::new(k.fx, k.fy));
        let undistorted = undistort(distorted, theta);
        let turn = DVec3::new(theta.get(P::RotX), theta.get(P::RotY), theta.get(P::RotZ));
        let ray = DQuat::from_scaled_axis(turn) * undistorted.extend(1.0);
        centre + DVec2::new(k.fx, k.fy) * ray.truncate() / ray.z.max(0.05)
    }

    /// The map for `theta`; makes the wide engine wide enough.
    fn map_for(&mut self, theta: &Theta) -> Result<Arc<Map>> {
        let key: Vec<u64> =
            super::model::ALL.iter().filter(|p| p.is_remap()).map(|&p| theta.get(p).to_bits()).collect();
        if let Some((known, map)) = &self.map
            && *known == key
        {
            return Ok(map.clone());
        }
        let k = self.intrinsics;
        let (w, h) = (k.width as usize * 2, k.height as usize * 2);
        let colored = theta.is_on(P::ScaleR) || theta.is_on(P::ScaleB);
        let of_channel = |channel: usize| -> Vec<[f32; 2]> {
            (0..w * h)
                .into_par_iter()
                .map(|i| {
                    let px = DVec2::new(0.5 * ((i % w) as f64 + 0.5), 0.5 * ((i / w) as f64 + 0.5));
                    self.source(px, theta, channel).as_vec2().to_array()
                })
                .collect()
        };
        let channels: Vec<_> = if colored { (0..3).map(of_channel).collect() } else { vec![of_channel(1)] };
        let (right, below) = (k.width as f32, k.height as f32);
        let beyond = channels
            .iter()
            .flatten()
            .fold(0.0f32, |m, p| m.max(-p[0]).max(-p[1]).max(p[0] - right).max(p[1] - below));
        // No further than the picture is large: what lies beyond that is not worth its memory.
        let needed = (beyond.ceil() as u32 + 6).min(k.width.max(k.height) / 2);
        if needed > self.margin_px {
            self.widen(needed.max(24).next_multiple_of(8));
        }
        let map = Arc::new(Map { channels });
        self.map = Some((key, map.clone()));
        Ok(map)
    }

    /// Engines with a wider margin are made when they are next needed.
    fn widen(&mut self, margin_px: u32) {
        tracing::info!("the resampled pictures are rendered with {margin_px} px of margin");
        self.cache.retain(|key, _| !key.1[0]);
        self.wide = [None, None];
        self.margin_px = margin_px;
    }

    fn wide_engine(&self, samples: u32) -> Result<Engine> {
        let k = self.intrinsics.with_margin([self.margin_px; 2]);
        let s = f64::from(SCALE);
        let k = Intrinsics {
            width: k.width * SCALE,
            height: k.height * SCALE,
            fx: k.fx * s,
            fy: k.fy * s,
            cx: k.cx * s,
            cy: k.cy * s,
        };
        let (scene, path) = (self.scene.clone(), self.trajectory.clone());
        Engine::new(&self.context, scene, path, k, options(samples), &[])
    }

    /// Reads the wide render at the places of the map. A line of the sensor that is not the line of the place it reads
    /// has another time: the place follows the content over the difference.
    fn resample(
        &self,
        wide: &Plane<f32>,
        map: &Map,
        shutter: &ShutterTiming,
        velocity: Option<&Plane<f32>>,
    ) -> Plane<f32> {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let (delay_s, order) = (shutter.line_delay_s(), shutter.scan_order);
        let (axis, sign) = match order {
            ScanOrder::TopToBottom => (1, 1.0),
            ScanOrder::BottomToTop => (1, -1.0),
            ScanOrder::LeftToRight => (0, 1.0),
            ScanOrder::RightToLeft => (0, -1.0),
        };
        let (scale, margin) = (SCALE as f32, self.margin_px as f32);
        let place = |mut p: [f32; 2], px: [f32; 2]| {
            if let Some(v) = velocity {
                let at = |i: usize, n: usize| (p[i].max(0.0) as usize).min(n - 1);
                let v = v.pixel(at(0, w), at(1, h));
                let late_s = (sign * delay_s * f64::from(px[axis] - p[axis])) as f32;
                p = [p[0] - v[0] * late_s, p[1] - v[1] * late_s];
            }
            [(p[0] + margin) * scale - 0.5, (p[1] + margin) * scale - 0.5]
        };
        let mut out = Plane::new(w, h, 3);
        for y in 0..h {
            for x in 0..w {
                let mut sum = [0.0f32; 3];
                for (sx, sy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let at = (2 * y + sy) * 2 * w + 2 * x + sx;
                    let px = [(2 * x + sx) as f32 * 0.5 + 0.25, (2 * y + sy) as f32 * 0.5 + 0.25];
                    if let [all] = &map.channels[..] {
                        let v = bicubic(wide, place(all[at], px));
                        (0..3).for_each(|c| sum[c] += 0.25 * v[c]);
                    } else {
                        for c in 0..3 {
                            sum[c] += 0.25 * bicubic(wide, place(map.channels[c][at], px))[c];
                        }
                    }
                }
                out.pixel_mut(x, y).copy_from_slice(&sum.map(|v| v.max(0.0)));
            }
        }
        out
    }
}

fn options(samples: u32) -> EngineOptions {
    EngineOptions {
        method: Method::Exact(ExactOptions::default()),
        samples,
        frames_in_flight: 2,
        ..EngineOptions::default()
    }
}

/// Undistorted point of a distorted one (both over the focal length), by Newton's method on the radius and the
/// tangential part.
fn undistort(distorted: DVec2, theta: &Theta) -> DVec2 {
    let [k1, k2, p1, p2] = [P::K1, P::K2, P::P1, P::P2].map(|p| theta.get(p));
    if k1 == 0.0 && k2 == 0.0 && p1 == 0.0 && p2 == 0.0 {
        return distorted;
    }
    let mut at = distorted;
    for _ in 0..12 {
        let r2 = at.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * k2);
        let tangential = DVec2::new(
            2.0 * p1 * at.x * at.y + p2 * (r2 + 2.0 * at.x * at.x),
            p1 * (r2 + 2.0 * at.y * at.y) + 2.0 * p2 * at.x * at.y,
        );
        let error = at * radial + tangential - distorted;
        // The radial slope alone suffices: tangential terms are small. Never steps over a fold.
        let slope = (1.0 + r2 * (3.0 * k1 + 5.0 * r2 * k2)).max(0.3);
        let along = if r2 > 0.0 { at * (error.dot(at) / r2) } else { DVec2::ZERO };
        at -= along / slope + (error - along) / radial.max(0.3);
        if error.length_squared() < 1e-20 {
            break;
        }
    }
    at
}

/// Catmull-Rom; the border repeats outwards. `at`: px, centres at whole numbers.
fn bicubic(plane: &Plane<f32>, at: [f32; 2]) -> [f32; 3] {
    let (w, h) = (plane.width as i64, plane.height as i64);
    let (x, y) = (at[0].clamp(-2.0, w as f32 + 1.0), at[1].clamp(-2.0, h as f32 + 1.0));
    let (x0, y0) = (x.floor(), y.floor());
    let (wx, wy) = (weights(x - x0), weights(y - y0));
    let (x0, y0) = (x0 as i64 - 1, y0 as i64 - 1);
    let mut sum = [0.0f32; 3];
    for (j, wy) in wy.into_iter().enumerate() {
        let row = (y0 + j as i64).clamp(0, h - 1) * w;
        for (i, wx) in wx.into_iter().enumerate() {
            let p = (3 * (row + (x0 + i as i64).clamp(0, w - 1))) as usize;
            let weight = wx * wy;
            for c in 0..3 {
                sum[c] += weight * plane.data[p + c];
            }
        }
    }
    sum
}

fn weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undistortion_inverts_the_contract_s_formula() {
        let mut theta = Theta::neutral();
        for (k1, k2, p1, p2) in
            [(0.19, -0.015, 0.0, 0.0), (-0.1, -0.02, 0.003, -0.002), (-0.3, 0.1, 0.0, 0.01)]
        {
            for (p, v) in [(P::K1, k1), (P::K2, k2), (P::P1, p1), (P::P2, p2)] {
                theta.set(p, v);
            }
            for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-0.55, 0.4), (0.02, 0.5)] {
                let r2: f64 = x * x + y * y;
                let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
                let distorted = DVec2::new(
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                );
                let back = undistort(distorted, &theta);
                assert!((back - DVec2::new(x, y)).length() < 1e-6, "{k1} {k2}: {back} for {x} {y}");
            }
        }
    }

    #[test]
    fn bicubic_reads_back_what_stands_there() {
        let plane = Plane::from_fn(9, 7, |x, y| [x as f32, y as f32, (x * y) as f32]);
        assert_eq!(bicubic(&plane, [4.0, 3.0]), [4.0, 3.0, 12.0]);
        let between = bicubic(&plane, [4.25, 3.5]);
        assert!((between[0] - 4.25).abs() < 1e-5 && (between[1] - 3.5).abs() < 1e-5, "{between:?}");
    }
}
