//! Frames through a lens, for fits: a larger picture without the lens, at twice the resolution, is read where the lens looks.
//! The engine draws through lenses itself, but cuts its triangles anew for each; a fit changes the lens at every step.

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

use super::forward::{Forward, Quality};
use super::model::{P, Theta};
use crate::camera::{Intrinsics, ScanOrder, ShutterTiming};
use crate::engine::{Engine, EngineOptions, FrameRequest};
use crate::error::Result;
use crate::plane::Plane;

/// Rendered px a px: bicubic reading at this size blurs by less than 0.1 px.
const SCALE: u32 = 2;

/// Where every pixel of the delivered picture is read in the wider one, px.
type Places = Arc<Vec<[f32; 2]>>;

/// What is kept of the larger picture.
#[derive(Default)]
pub(super) struct Wide {
    /// By quality: what triangles are cut to differs too.
    engines: [Option<Engine>; 4],
    /// Px beyond each side.
    pub(super) margin_px: u32,
    map: Option<(Vec<u64>, Places)>,
}

impl Wide {
    /// As if nothing had been rendered, with a margin.
    pub(super) fn begin(&mut self, margin_px: u32) -> Result<()> {
        self.map = None;
        if self.margin_px != margin_px {
            (self.engines, self.margin_px) = (Default::default(), margin_px);
        }
        self.engines.iter_mut().flatten().try_for_each(Engine::forget)
    }
}

impl Forward {
    /// Where each of the 2x2 parts of each pixel looks, px of the picture without the lens; makes the margin wide enough.
    pub(super) fn lens_map(&mut self, theta: &Theta) -> Arc<Vec<[f32; 2]>> {
        let key: Vec<u64> =
            [P::K1, P::K2, P::P1, P::P2, P::K3, P::Focal].iter().map(|&p| theta.get(p).to_bits()).collect();
        if let Some((known, map)) = &self.bench.wide.map
            && *known == key
        {
            return map.clone();
        }
        let k = self.intrinsics;
        let (w, h) = (k.width as usize * 2, k.height as usize * 2);
        let map: Vec<[f32; 2]> = (0..w * h)
            .into_par_iter()
            .map(|i| {
                let px = DVec2::new(0.5 * ((i % w) as f64 + 0.5), 0.5 * ((i / w) as f64 + 0.5));
                self.without_lens(px, theta).as_vec2().to_array()
            })
            .collect();
        let (right, below) = (k.width as f32, k.height as f32);
        let beyond =
            map.iter().fold(0.0f32, |m, p| m.max(-p[0]).max(-p[1]).max(p[0] - right).max(p[1] - below));
        // No further than the picture is large: what lies beyond that is not worth its memory.
        let needed = (beyond.ceil() as u32 + 6).min(k.width.max(k.height) / 2);
        if needed > self.bench.wide.margin_px {
            self.bench.wide.engines = Default::default();
            self.bench.wide.margin_px = needed.max(24).next_multiple_of(8);
            self.forget_wide();
        }
        let map = Arc::new(map);
        self.bench.wide.map = Some((key, map.clone()));
        map
    }

    /// The camera of the larger picture, px of that.
    pub(super) fn wide_intrinsics(&self, k: &Intrinsics) -> Intrinsics {
        let k = k.with_margin([self.bench.wide.margin_px; 2]);
        let s = f64::from(SCALE);
        Intrinsics {
            width: k.width * SCALE,
            height: k.height * SCALE,
            fx: k.fx * s,
            fy: k.fy * s,
            cx: k.cx * s,
            cy: k.cy * s,
        }
    }

    /// The engine of the larger picture.
    pub(super) fn wide_engine(&mut self, quality: Quality) -> Result<&mut Engine> {
        let place = quality as usize;
        if self.bench.wide.engines[place].is_none() {
            let (scene, path) = (self.scene.clone(), self.trajectory.clone());
            // Four pixels are one: a sample in each is four.
            let options = EngineOptions { samples: [1, 1, 4, 16][place], ..super::forward::options(quality) };
            let k = self.wide_intrinsics(&self.intrinsics);
            self.bench.wide.engines[place] = Some(Engine::new(&self.context, scene, path, k, options, &[])?);
        }
        Ok(self.bench.wide.engines[place].as_mut().expect("just made"))
    }

    /// A request for the larger picture: lines beyond the picture keep the sensor's pace.
    pub(super) fn widened(&self, mut request: FrameRequest) -> FrameRequest {
        let k = &self.intrinsics;
        let margin_px = self.bench.wide.margin_px;
        let shutter = &mut request.shutter;
        let inner = f64::from(shutter.scan_order.line_count(k.width, k.height));
        let count = shutter.scan_order.line_count(k.width + 2 * margin_px, k.height + 2 * margin_px);
        let before_s = shutter.readout_time_s * f64::from(margin_px) / inner;
        // Half lines: the first half of a line of the sensor starts a quarter of its delay early.
        let early_s = 0.25 * shutter.readout_time_s / inner;
        shutter.start_s -= before_s + early_s;
        shutter.readout_time_s *= f64::from(count) / inner;
        shutter.line_count = count * SCALE;
        request.settings = crate::chain::Settings::default();
        request
    }

    /// Reads the larger picture where the lens looks. A line of the sensor that is not the line of the place it reads has
    /// another time: the place follows the content over the difference.
    pub(super) fn through_lens(
        &self,
        wide: &Plane<f32>,
        map: &[[f32; 2]],
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
        let (scale, margin) = (SCALE as f32, self.bench.wide.margin_px as f32);
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
                    let v = bicubic(wide, place(map[at], px));
                    (0..3).for_each(|c| sum[c] += 0.25 * v[c]);
                }
                out.pixel_mut(x, y).copy_from_slice(&sum.map(|v| v.max(0.0)));
            }
        }
        out
    }
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
    fn bicubic_reads_back_what_stands_there() {
        let plane = Plane::from_fn(9, 7, |x, y| [x as f32, y as f32, (x * y) as f32]);
        assert_eq!(bicubic(&plane, [4.0, 3.0]), [4.0, 3.0, 12.0]);
        let between = bicubic(&plane, [4.25, 3.5]);
        assert!((between[0] - 4.25).abs() < 1e-5 && (between[1] - 3.5).abs() < 1e-5, "{between:?}");
    }
}
