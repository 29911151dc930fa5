//! Synthetic input of the fast warp, on the CPU and on the device.
#![allow(dead_code, clippy::unwrap_used)]

use std::sync::Arc;
use std::time::Duration;

use glam::Vec4;
use shutterbug::camera::{ScanOrder, ShutterTiming};
use shutterbug::engine::{FastGather, FastImages, FastKind, FastTiming};
use shutterbug::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Slot, Usage};
use shutterbug::plane::Plane;
use shutterbug::reference::fast_push::{FastLens, Inputs, Push};
use shutterbug::reference::path::{FromDepth, Paths};

/// A picture, the paths of what it shows, its depth.
#[derive(Clone)]
pub struct Field {
    pub color: Plane<f32>,
    pub color_scale: usize,
    pub paths: Vec<Plane<f32>>,
    pub path_scale: usize,
    pub inverse_depth: Plane<f32>,
    pub one_surface: bool,
    pub one_of_several: bool,
    /// Matrices to the knots, body by body, where displacements follow from depth; else empty.
    pub moved: Vec<[Vec4; 3]>,
    pub last_knot: u32,
    /// Where each pixel looks, and where the lens shows each pixel of the picture.
    pub lens: Option<[Plane<f32>; 2]>,
}

impl Field {
    /// `color` gives RGB, `path` the displacement at a time after the reference instant, px, and the inverse depth,
    /// both of a place in px of the delivered picture.
    pub fn new(
        p: &Push,
        color_scale: usize,
        path_scale: usize,
        color: impl Fn(f32, f32) -> [f32; 3],
        path: impl Fn(f32, f32, f32) -> ([f32; 2], f32),
    ) -> Self {
        let full = [0, 1].map(|i| p.size[i] as usize + 2 * p.margin_px[i] as usize);
        let place =
            |i: usize, scale: usize, axis: usize| (i as f32 + 0.5) / scale as f32 - p.margin_px[axis] as f32;
        let knots: Vec<f32> = (0..=p.last_knot)
            .filter(|&k| k != p.reference_knot)
            .map(|k| (k as f32 - p.reference_knot as f32) * p.knot_step_s)
            .collect();
        let image = |pair: &[f32]| {
            Plane::from_fn(full[0] * path_scale, full[1] * path_scale, |x, y| {
                let at = (place(x, path_scale, 0), place(y, path_scale, 1));
                let [a, b] = [pair[0], pair[1]].map(|t| path(at.0, at.1, t).0);
                [a[0], a[1], b[0], b[1]]
            })
        };
        Self {
            color: Plane::from_fn(full[0] * color_scale, full[1] * color_scale, |x, y| {
                let [r, g, b] = color(place(x, color_scale, 0), place(y, color_scale, 1));
                [r, g, b, 1.0]
            }),
            color_scale,
            paths: knots.chunks_exact(2).map(image).collect(),
            path_scale,
            inverse_depth: Plane::from_fn(full[0] * path_scale, full[1] * path_scale, |x, y| {
                [path(place(x, path_scale, 0), place(y, path_scale, 1), 0.0).1]
            }),
            one_surface: false,
            one_of_several: false,
            moved: Vec::new(),
            last_knot: p.last_knot,
            lens: None,
        }
    }

    pub fn inputs(&self) -> Inputs<'_> {
        let (inverse_depth, last_knot) = (&self.inverse_depth, self.last_knot);
        let depth = FromDepth { inverse_depth, moved: &self.moved, last_knot };
        let from_depth = (!self.moved.is_empty()).then_some(depth);
        Inputs {
            color: &self.color,
            color_scale: self.color_scale,
            paths: Paths { images: &self.paths, scale: self.path_scale, from_depth },
            inverse_depth: &self.inverse_depth,
            one_surface: self.one_surface,
            one_of_several: self.one_of_several,
            lens: self.lens.as_ref().map(|[ideal, sensed]| FastLens { ideal, sensed }),
        }
    }

    /// Mean of the texels of a px, added row by row.
    pub fn still(&self, x: usize, y: usize) -> [f32; 3] {
        let s = self.color_scale;
        let texel = |i: usize, j: usize, c: usize| self.color.pixel(s * x + i, s * y + j)[c];
        [0, 1, 2].map(|c| match s {
            1 => texel(0, 0, c),
            _ => ((texel(0, 0, c) + texel(1, 0, c)) + (texel(0, 1, c) + texel(1, 1, c))) / 4.0,
        })
    }

    /// Seen in a mirror: left and right exchanged, or up and down.
    pub fn mirrored(&self, horizontal: bool) -> Self {
        let flip = |plane: &Plane<f32>| {
            let mut out = plane.clone();
            for (x, y) in (0..plane.height).flat_map(|y| (0..plane.width).map(move |x| (x, y))) {
                let from = if horizontal { (plane.width - 1 - x, y) } else { (x, plane.height - 1 - y) };
                out.pixel_mut(x, y).copy_from_slice(plane.pixel(from.0, from.1));
            }
            out
        };
        let mut out = Self {
            color: flip(&self.color),
            paths: self.paths.iter().map(flip).collect(),
            inverse_depth: flip(&self.inverse_depth),
            moved: Vec::new(),
            lens: None,
            ..*self
        };
        let first = usize::from(!horizontal);
        for v in out.paths.iter_mut().flat_map(|image| image.data.chunks_exact_mut(2)) {
            v[first] = -v[first];
        }
        out
    }
}

/// The warp by the kernels.
pub fn on_device(context: &Arc<Context>, p: &Push, field: &Field) -> Plane<f32> {
    let mut slot = Slot::new(context, "fast test").unwrap();
    let image = |plane: &Plane<f32>, format: Format| {
        let size = [plane.width as u32, plane.height as u32];
        let image = Image::new(context, "input", ImageSpec::storage(size, format)).unwrap();
        let bytes = 4 * plane.data.len() as u64;
        let mut buffer = Buffer::new(context, "input", bytes, Usage::Transfer, Location::Upload).unwrap();
        buffer.write(0, &plane.data);
        (image, buffer)
    };
    let paths: Vec<_> = field.paths.iter().map(|path| image(path, Format::Rgba32f)).collect();
    let bodies = field.inverse_depth.channels == 2;
    let of_depth = if bodies { Format::Rg32f } else { Format::R32f };
    let (color, depth) = (image(&field.color, Format::Rgba32f), image(&field.inverse_depth, of_depth));
    let lens = field.lens.as_ref().map(|l| l.each_ref().map(|plane| image(plane, Format::Rg32f)));
    let rows: Vec<f32> = field.moved.iter().flatten().flat_map(|row| row.to_array()).collect();
    let moved = (!rows.is_empty()).then(|| {
        let mut buffer =
            Buffer::new(context, "moved", 4 * rows.len() as u64, Usage::Texels, Location::Upload).unwrap();
        buffer.write(0, &rows);
        buffer
    });
    let radiance = Image::new(context, "radiance", ImageSpec::storage(p.size, Format::Rgba32f)).unwrap();
    let bytes = 16 * u64::from(p.size[0]) * u64::from(p.size[1]);
    let readback = Buffer::new(context, "radiance", bytes, Usage::Transfer, Location::Readback).unwrap();

    let from_depth = !field.moved.is_empty();
    let kind = FastKind {
        one_surface: field.one_surface,
        from_depth,
        bodies,
        lens: lens.is_some(),
        one_of_several: field.one_of_several,
    };
    let shape = (field.paths.len().max(1), field.path_scale as u32);
    let warp = FastGather::new(context, p.size, shape, field.color_scale as u32, kind).unwrap();
    let binding = warp
        .bind(&FastImages {
            color: &color.0,
            filtered: &color.0,
            paths: paths.iter().map(|(image, _)| image).collect(),
            moved: moved.as_ref(),
            inverse_depth: &depth.0,
            lens: lens.as_ref().map(|l| l.each_ref().map(|(image, _)| image)),
            radiance: &radiance,
        })
        .unwrap();
    let scan_order = ScanOrder::ALL[p.scan_order as usize];
    let shutter = ShutterTiming {
        start_s: f64::from(p.start_s),
        exposure_time_s: f64::from(p.exposure_time_s),
        readout_time_s: f64::from(p.readout_time_s),
        scan_order,
        line_count: scan_order.line_count(p.size[0], p.size[1]),
    };
    let timing = FastTiming {
        shutter,
        reference_s: 0.0,
        knot_step_s: f64::from(p.knot_step_s),
        reference_knot: p.reference_knot,
        last_knot: p.last_knot,
        pictures_s: [p.picture_s, p.from_s, p.to_s].map(f64::from),
    };
    let margin_px = p.margin_px.map(|m| m as u32);
    assert_eq!(timing.push(p.size, margin_px, p.max_samples), *p);
    let inputs: Vec<_> = paths.iter().chain([&color, &depth]).chain(lens.iter().flatten()).collect();
    // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
    #[allow(unsafe_code)]
    let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
    recorder.prepare(inputs.iter().map(|(image, _)| image).chain([&radiance]));
    for (image, buffer) in inputs {
        recorder.copy_buffer_to_image(buffer, image);
    }
    warp.record(&mut recorder, &binding, margin_px, &timing, p.max_samples);
    recorder.copy_image_to_buffer(&radiance, [0, 0], p.size, &readback);
    recorder.barrier();
    recorder.finish();
    slot.submit().unwrap();
    slot.wait(Duration::from_secs(60)).unwrap();
    let data = bytemuck::cast_slice(readback.mapped()).to_vec();
    Plane { width: p.size[0] as usize, height: p.size[1] as usize, channels: 4, data }
}
