//! Frames through a lens, for fits: a larger picture without the lens, at twice the resolution, is read where the lens
//! looks. The engine draws through lenses itself, but cuts its triangles anew for each; a fit changes the lens at every
//! step, and as long as it changes nothing else the larger picture is the same.

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

use super::bench::{KEPT_BYTES, Key, Places, in_flight};
use super::forward::{Forward, mean_of_quarters, quarters};
use super::model::{P, Theta};
use crate::diagnose::evidence::quality::Quality;
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::engine::{Engine, EngineOptions, FrameRequest};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Rendered px a px along each axis. Bicubic reading at twice the size blurs by less than 0.1 px; where a valley is
/// looked for in means over blocks of 4 px and more, what reading at the same size blurs is nothing.
fn finer(quality: Quality) -> u32 {
    if quality == Quality::Coarse { 1 } else { 2 }
}

impl Forward {
    /// Frames through a lens, read from larger ones without it.
    pub(super) fn read(
        &mut self,
        places: &[usize],
        requests: &[FrameRequest],
        theta: &Theta,
        scale: f64,
        quality: Quality,
    ) -> Result<Vec<Plane<f32>>> {
        if quality == Quality::Finest && theta.is_on(P::Exposure) {
            return mean_of_quarters(|i| {
                self.read(places, &quarters(requests, i), theta, scale, Quality::Fine)
            });
        }
        let map = self.lens_map(theta, quality);
        let k = self.magnified(theta, scale);
        let few = self.wide_at_a_time(quality);
        let mut seen = Vec::with_capacity(places.len());
        for (places, requests) in places.chunks(few).zip(requests.chunks(few)) {
            let planes = self.wider(places, requests, theta, &k, quality)?;
            for ((plane, &at), request) in planes.iter().zip(places).zip(requests) {
                let shutter = &request.shutter;
                let velocity = (shutter.readout_time_s > 0.0).then(|| self.velocity(at, theta));
                seen.push(self.through_lens(plane, &map, shutter, velocity.as_ref()));
            }
        }
        Ok(seen)
    }

    /// The larger pictures without the lens: those that are kept, the others rendered.
    fn wider(
        &mut self,
        places: &[usize],
        requests: &[FrameRequest],
        theta: &Theta,
        k: &Intrinsics,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let keys: Vec<Key> = places
            .iter()
            .zip(requests)
            .map(|(&at, r)| self.wide_key(at, &r.shutter, theta, k, quality))
            .collect();
        let mut planes: Vec<_> = keys.iter().map(|key| self.bench.wide.recall(key)).collect();
        let missing: Vec<usize> = (0..places.len()).filter(|&i| planes[i].is_none()).collect();
        if !missing.is_empty() {
            let path = self.path(theta);
            let k = self.wide_intrinsics(k, quality);
            let wider: Vec<_> = missing.iter().map(|&i| self.widened(requests[i].clone(), quality)).collect();
            let engine = self.wide_engine(quality)?;
            engine.aim(k, path);
            for (&i, plane) in missing.iter().zip(in_flight(engine, &wider)?) {
                let plane = Arc::new(plane);
                self.bench.wide.keep(keys[i].clone(), plane.clone());
                planes[i] = Some(plane);
            }
        }
        Ok(planes.into_iter().map(|plane| plane.expect("kept, or just rendered")).collect())
    }

    /// All that a larger picture depends on: not the lens.
    fn wide_key(&self, at: usize, s: &ShutterTiming, theta: &Theta, k: &Intrinsics, quality: Quality) -> Key {
        let times = [s.start_s, s.exposure_time_s, s.readout_time_s].map(f64::to_bits);
        let turn = [P::RotX, P::RotY, P::RotZ].map(|p| theta.get(p).to_bits());
        let pose = theta.room.poses.get(at).into_iter().flatten().map(|v| v.to_bits());
        let geometry = turn.into_iter().chain([k.fx, k.fy].map(f64::to_bits)).chain(pose).collect();
        (at, quality, times, s.scan_order, geometry)
    }

    /// Where each part of each pixel looks, px of the picture without the lens; makes the margin wide enough.
    pub(crate) fn lens_map(&mut self, theta: &Theta, quality: Quality) -> Places {
        let parts = finer(quality) as usize;
        let mut key: Vec<u64> =
            [P::K1, P::K2, P::P1, P::P2, P::K3, P::Focal].iter().map(|&p| theta.get(p).to_bits()).collect();
        key.push(parts as u64);
        if let Some((known, map)) = &self.bench.wide.map
            && *known == key
        {
            return map.clone();
        }
        let k = self.intrinsics;
        let (w, h) = (k.width as usize * parts, k.height as usize * parts);
        let part = 1.0 / parts as f64;
        let map: Vec<[f32; 2]> = (0..w * h)
            .into_par_iter()
            .map(|i| {
                let px = DVec2::new(part * ((i % w) as f64 + 0.5), part * ((i / w) as f64 + 0.5));
                self.without_lens(px, theta).as_vec2().to_array()
            })
            .collect();
        let (right, below) = (k.width as f32, k.height as f32);
        let beyond =
            map.iter().fold(0.0f32, |m, p| m.max(-p[0]).max(-p[1]).max(p[0] - right).max(p[1] - below));
        // No further than the picture is large: what lies beyond that is not worth its memory.
        // A lens that folds has places without end.
        let needed = (beyond.ceil() as u32).saturating_add(6).min(k.width.max(k.height) / 2);
        if needed > self.bench.wide.margin_px {
            self.engines.wide = Default::default();
            self.bench.wide.kept.clear();
            self.bench.wide.margin_px = needed.max(24).next_multiple_of(8);
            self.forget_wide();
        }
        let map = Places { parts, at: Arc::new(map) };
        self.bench.wide.map = Some((key, map.clone()));
        map
    }

    /// The camera of the larger picture, px of that.
    pub(crate) fn wide_intrinsics(&self, k: &Intrinsics, quality: Quality) -> Intrinsics {
        let k = k.with_margin([self.bench.wide.margin_px; 2]);
        let scale = finer(quality);
        let s = f64::from(scale);
        Intrinsics {
            width: k.width * scale,
            height: k.height * scale,
            fx: k.fx * s,
            fy: k.fy * s,
            cx: k.cx * s,
            cy: k.cy * s,
        }
    }

    /// Of how many frames the larger pictures are held at a time: as many as are kept, for these may be others.
    pub(crate) fn wide_at_a_time(&self, quality: Quality) -> usize {
        let k = self.wide_intrinsics(&self.intrinsics, quality);
        (KEPT_BYTES / (12 * k.width as usize * k.height as usize)).max(1)
    }

    /// The engine of the larger picture.
    pub(crate) fn wide_engine(&mut self, quality: Quality) -> Result<&mut Engine> {
        let (place, margin_px) = (quality as usize, self.bench.wide.margin_px);
        if self.engines.wide[place].as_ref().is_none_or(|(of, _)| *of != margin_px) {
            // The earlier one's room first.
            self.engines.wide[place] = None;
            let (scene, path) = (self.scene.clone(), self.trajectory.clone());
            // Four pixels are one, but for the coarse: a sample in each is four.
            let options = EngineOptions { samples: [1, 1, 4, 16][place], ..super::bench::options(quality) };
            let k = self.wide_intrinsics(&self.intrinsics, quality);
            let engine = Engine::new(self.device(), scene, path, k, options, &[])?;
            self.engines.wide[place] = Some((margin_px, engine));
        }
        Ok(&mut self.engines.wide[place].as_mut().expect("just made").1)
    }

    /// A request for the larger picture: lines beyond the picture keep the sensor's pace.
    pub(crate) fn widened(&self, mut request: FrameRequest, quality: Quality) -> FrameRequest {
        let k = &self.intrinsics;
        let margin_px = self.bench.wide.margin_px;
        let shutter = &mut request.shutter;
        let inner = f64::from(shutter.scan_order.line_count(k.width, k.height));
        let count = shutter.scan_order.line_count(k.width + 2 * margin_px, k.height + 2 * margin_px);
        let before_s = shutter.readout_time_s * f64::from(margin_px) / inner;
        // Half lines: the first half of a line of the sensor starts a quarter of its delay early.
        let scale = finer(quality);
        let early_s = 0.5 * (1.0 - 1.0 / f64::from(scale)) * shutter.readout_time_s / inner;
        shutter.start_s -= before_s + early_s;
        shutter.readout_time_s *= f64::from(count) / inner;
        shutter.line_count = count * scale;
        request.settings = shutterbug::chain::Settings::default();
        request
    }

    /// Reads the larger picture where the lens looks. A line of the sensor that is not the line of the place it reads
    /// has another time: the place follows the content over the difference.
    pub(crate) fn through_lens(
        &self,
        wide: &Plane<f32>,
        map: &Places,
        shutter: &ShutterTiming,
        velocity: Option<&Plane<f32>>,
    ) -> Plane<f32> {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let delay_s = shutter.line_delay_s();
        let (axis, sign) = match shutter.scan_order {
            ScanOrder::TopToBottom => (1, 1.0),
            ScanOrder::BottomToTop => (1, -1.0),
            ScanOrder::LeftToRight => (0, 1.0),
            ScanOrder::RightToLeft => (0, -1.0),
        };
        let (parts, margin) = (map.parts, self.bench.wide.margin_px as f32);
        let (scale, share) = (parts as f32, 1.0 / (parts * parts) as f32);
        let place = |mut p: [f32; 2], px: [f32; 2]| {
            if let Some(v) = velocity {
                let at = |i: usize, n: usize| (p[i].max(0.0) as usize).min(n - 1);
                let v = v.pixel(at(0, w), at(1, h));
                let late_s = (sign * delay_s * f64::from(px[axis] - p[axis])) as f32;
                p = [p[0] - v[0] * late_s, p[1] - v[1] * late_s];
            }
            [(p[0] + margin) * scale - 0.5, (p[1] + margin) * scale - 0.5]
        };
        let mut out: Plane<f32> = Plane::new(w, h, 3);
        out.data.par_chunks_exact_mut(3 * w).enumerate().for_each(|(y, row)| {
            for sy in 0..parts {
                let line = y * parts + sy;
                let looks = &map.at[line * parts * w..(line + 1) * parts * w];
                for (x, (to, looks)) in row.chunks_exact_mut(3).zip(looks.chunks_exact(parts)).enumerate() {
                    for (sx, at) in looks.iter().enumerate() {
                        let px = [((x * parts + sx) as f32 + 0.5) / scale, (line as f32 + 0.5) / scale];
                        let v = bicubic(wide, place(*at, px));
                        (0..3).for_each(|c| to[c] += share * v[c]);
                    }
                }
            }
            row.iter_mut().for_each(|v| *v = v.max(0.0));
        });
        out
    }
}

/// Catmull-Rom; the border repeats outwards. `at`: px, centres at whole numbers.
fn bicubic(plane: &Plane<f32>, at: [f32; 2]) -> [f32; 3] {
    let (w, h) = (plane.width as i32, plane.height as i32);
    let (x, y) = (at[0].clamp(-2.0, w as f32 + 1.0), at[1].clamp(-2.0, h as f32 + 1.0));
    // Whole numbers by way of what is positive: baseline processors have no instruction for `floor`.
    let (x0, y0) = ((x + 2.0) as i32 - 2, (y + 2.0) as i32 - 2);
    let (wx, wy) = (weights(x - x0 as f32), weights(y - y0 as f32));
    let (x0, y0) = (x0 - 1, y0 - 1);
    let mut sum = [0.0f32; 3];
    let within = x0 >= 0 && x0 + 3 < w;
    for (j, wy) in wy.into_iter().enumerate() {
        let row = (y0 + j as i32).clamp(0, h - 1) * w;
        if within {
            let from = 3 * (row + x0) as usize;
            let values: &[f32; 12] = plane.data[from..from + 12].try_into().expect("twelve");
            for (i, wx) in wx.into_iter().enumerate() {
                (0..3).for_each(|c| sum[c] += wx * wy * values[3 * i + c]);
            }
        } else {
            for (i, wx) in wx.into_iter().enumerate() {
                let from = 3 * (row + (x0 + i as i32).clamp(0, w - 1)) as usize;
                (0..3).for_each(|c| sum[c] += wx * wy * plane.data[from + c]);
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
    fn bicubic_reads_back_what_stands_there() {
        let plane = Plane::from_fn(9, 7, |x, y| [x as f32, y as f32, (x * y) as f32]);
        assert_eq!(bicubic(&plane, [4.0, 3.0]), [4.0, 3.0, 12.0]);
        let between = bicubic(&plane, [4.25, 3.5]);
        assert!((between[0] - 4.25).abs() < 1e-5 && (between[1] - 3.5).abs() < 1e-5, "{between:?}");
    }
}
