//! Kernels that turn samples into pixels against their CPU twins, on uploaded samples: supersampling grids, odd sizes,
//! all scan orders. The variants for several samples a texel are held to the rasterizer's reference in `raster_parity`.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::bench::{Bench, Scatter, differing};
use bytemuck::{Pod, Zeroable};
use shutterbug::assert_push_layout;
use shutterbug::camera::ScanOrder;
use shutterbug::gpu::{Bound, Format, Sampler, Usage};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::reference::resolve;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ColorPush {
    size: [u32; 2],
    grid: [i32; 2],
}
assert_push_layout!("resolve_color.comp", ColorPush { size, grid });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MotionPush {
    size: [u32; 2],
    grid: [i32; 2],
    layer: u32,
    near_m: f32,
}
assert_push_layout!("resolve_motion.comp", MotionPush { size, grid, layer, near_m });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AccumulatePush {
    origin: [u32; 2],
    size: [u32; 2],
    picture: [u32; 2],
    grid: [i32; 2],
    scan_order: u32,
    first_line: u32,
    first_weight: u32,
}
assert_push_layout!(
    "accumulate.comp",
    AccumulatePush { origin, size, picture, grid, scan_order, first_line, first_weight }
);

const SIZES: [[usize; 2]; 5] = [[1, 1], [17, 9], [37, 23], [129, 71], [640, 480]];

fn u32s(size: [usize; 2]) -> [u32; 2] {
    size.map(|s| s as u32)
}

/// Radiance of samples: bright ones, black ones, covered or not.
fn samples([w, h]: [usize; 2], grid: usize, scatter: &mut Scatter) -> Plane<f32> {
    Plane::from_fn(w * grid, h * grid, |x, y| match (x * 5 + y * 3) % 7 {
        0 => [0.0; 4],
        1 => [6e4 * scatter.number(), 1e-4, scatter.number(), 1.0],
        _ => [scatter.number(), scatter.number(), scatter.number(), 1.0],
    })
}

/// Sums of up to 16 floats in another order, or a division that is rounded otherwise, differ by a few units in the last
/// place.
const FLOAT: f32 = 2e-6;

#[test]
fn resolve_color_is_its_twin() {
    let Some(mut bench) = Bench::new("resolve_color_is_its_twin") else { return };
    let (mut scatter, sampler) = (Scatter(11), Sampler::new(&bench.watched.0, false).unwrap());
    for size in SIZES {
        for grid in [1, 2, 4] {
            let samples = samples(size, grid, &mut scatter);
            let image = bench.upload(std::slice::from_ref(&samples), Format::Rgba32f, false);
            let color = bench.empty(size, Format::Rgba32f, 1, false);
            let resources =
                [("color_samples", Bound::Sampled(&image, &sampler)), ("color", Bound::Storage(&color))];
            let push = ColorPush { size: u32s(size), grid: [grid as i32; 2] };
            bench.run(const { kernel("resolve_color.comp") }, &[], &resources, &push, push.size);
            let got = bench.read(&color).remove(0);
            let want = resolve::resolve_color(&samples, grid);
            let label = format!("{size:?}, grid {grid}");
            assert_eq!(differing(&got, &want, FLOAT).1, 0, "{label}");
            let dimmer = Plane { data: want.data.iter().map(|v| (1.0 - 1e-5) * v).collect(), ..want };
            let wrong = differing(&got, &dimmer, FLOAT).1;
            // The brightest of the seven kinds of texels are the ones that are off by more than 2e-6 of 1.
            let seen = 10 * wrong > size[0] * size[1];
            assert!(size == [1, 1] || seen, "control: {label}: 1 in 100 000 dimmer is seen in {wrong} px");
        }
    }
}

#[test]
fn resolve_motion_is_its_twin() {
    let Some(mut bench) = Bench::new("resolve_motion_is_its_twin") else { return };
    let (mut scatter, sampler) = (Scatter(12), Sampler::new(&bench.watched.0, false).unwrap());
    for size in SIZES {
        for (layer, grid) in [(0, 1), (1, 2), (2, 4)] {
            let [w, h] = size.map(|s| s * grid);
            let motion =
                Plane::from_fn(w, h, |_, _| [scatter.between(-900.0, 900.0), scatter.between(-9.0, 9.0)]);
            // Whole pixels and single samples without geometry; samples at the very same distance.
            let inverse = Plane::from_fn(w, h, |x, y| match (x / grid + y / grid) % 5 {
                0 => [0.0],
                1 if (x + y) % 2 == 0 => [0.0],
                2 => [0.25],
                _ => [scatter.between(1e-6, 1.0)],
            });
            let motion_image = bench.upload(std::slice::from_ref(&motion), Format::Rg32f, false);
            let depth_image = bench.upload(std::slice::from_ref(&inverse), Format::R32f, false);
            let to_motion = bench.empty(size, Format::Rg32f, 3, true);
            let to_depth = bench.empty(size, Format::R32f, 1, false);
            let resources = [
                ("motion_samples", Bound::Sampled(&motion_image, &sampler)),
                ("depth_samples", Bound::Sampled(&depth_image, &sampler)),
                ("motion", Bound::Storage(&to_motion)),
                ("depth", Bound::Storage(&to_depth)),
            ];
            let push = MotionPush { size: u32s(size), grid: [grid as i32; 2], layer, near_m: 0.01 };
            bench.run(const { kernel("resolve_motion.comp") }, &[], &resources, &push, push.size);
            let (motions, depth) = (bench.read(&to_motion), bench.read(&to_depth).remove(0));
            let (want_motion, want_depth) = resolve::resolve_motion(&motion, &inverse, grid, 0.01);
            let label = format!("{size:?}, grid {grid}");
            // A choice, not a sum: the same bits on every device.
            assert_eq!(differing(&motions[layer as usize], &want_motion, 0.0).0, 0, "{label}: motion");
            let others = motions.iter().enumerate().filter(|(i, _)| *i != layer as usize);
            assert!(others.flat_map(|(_, p)| &p.data).all(|&v| v == 0.0), "{label}: another layer");
            assert_eq!(differing(&depth, &want_depth, FLOAT).1, 0, "{label}: depth");
            assert!(depth.data.contains(&f32::INFINITY), "{label}: nothing is infinitely far");
            let farthest = Plane { data: inverse.data.iter().map(|d| (1.0 - d) % 1.0).collect(), ..inverse };
            let wrong = resolve::resolve_motion(&motion, &farthest, grid, 0.01).0;
            let seen = differing(&motions[layer as usize], &wrong, 0.0).0;
            assert!(
                grid == 1 || size == [1, 1] || 4 * seen > size[0] * size[1],
                "control: {label}: {seen} px"
            );
        }
    }
}

/// A band of lines with random weights: the push constants, the weights, and the weight of a pixel by the contract's
/// definition of a line, written out here.
struct Band {
    push: AccumulatePush,
    weights: Vec<f32>,
    order: ScanOrder,
}

impl Band {
    fn new(size: [usize; 2], grid: usize, order: ScanOrder, scatter: &mut Scatter) -> Self {
        let [w, h] = u32s(size);
        let (along, lines) =
            if matches!(order, ScanOrder::TopToBottom | ScanOrder::BottomToTop) { (1, h) } else { (0, w) };
        let (first, count) = (lines / 3, (lines / 2).max(1));
        let backwards = matches!(order, ScanOrder::BottomToTop | ScanOrder::RightToLeft);
        let (mut origin, mut band) = ([0, 0], [w, h]);
        origin[along] = if backwards { lines - first - count } else { first };
        band[along] = count;
        let first_weight = 5;
        let weights = (0..first_weight + count).map(|_| scatter.number()).collect();
        let push = AccumulatePush {
            origin,
            size: band,
            picture: [w, h],
            grid: [grid as i32; 2],
            scan_order: order as u32,
            first_line: first,
            first_weight,
        };
        Self { push, weights, order }
    }

    fn weight(&self, x: usize, y: usize) -> Option<f32> {
        let [w, h] = self.push.picture.map(|s| s as usize);
        let line = match self.order {
            ScanOrder::TopToBottom => y,
            ScanOrder::BottomToTop => h - 1 - y,
            ScanOrder::LeftToRight => x,
            ScanOrder::RightToLeft => w - 1 - x,
        };
        let place = line.checked_sub(self.push.first_line as usize)?;
        self.weights.get(self.push.first_weight as usize + place).copied()
    }
}

#[test]
fn accumulate_is_its_twin() {
    let Some(mut bench) = Bench::new("accumulate_is_its_twin") else { return };
    let (mut scatter, sampler) = (Scatter(13), Sampler::new(&bench.watched.0, false).unwrap());
    for size in SIZES {
        for (grid, order) in [1, 2, 4].into_iter().flat_map(|g| ScanOrder::ALL.map(|o| (g, o))) {
            if size == [640, 480] && grid != 2 {
                continue;
            }
            let samples = samples(size, grid, &mut scatter);
            let before = Plane::from_fn(size[0], size[1], |_, _| [scatter.number(); 4]);
            let band = Band::new(size, grid, order, &mut scatter);
            let image = bench.upload(std::slice::from_ref(&samples), Format::Rgba32f, false);
            let sum = bench.upload(std::slice::from_ref(&before), Format::Rgba32f, false);
            let weights = bench.filled(Usage::Storage, &band.weights);
            let resources = [
                ("color_samples", Bound::Sampled(&image, &sampler)),
                ("radiance", Bound::Storage(&sum)),
                ("Weights", Bound::Buffer(&weights)),
            ];
            bench.run(const { kernel("accumulate.comp") }, &[], &resources, &band.push, band.push.size);
            let got = bench.read(&sum).remove(0);
            let twin = |order: ScanOrder| {
                let mut want = before.clone();
                let band = Band { order, weights: band.weights.clone(), ..band };
                resolve::accumulate(&mut want, &samples, grid, |x, y| band.weight(x, y));
                want
            };
            let label = format!("{size:?}, grid {grid}, {order}");
            assert_eq!(differing(&got, &twin(order), FLOAT).1, 0, "{label}");
            for wrong in ScanOrder::ALL.into_iter().filter(|o| *o != order && size != [1, 1]) {
                let seen = differing(&got, &twin(wrong), FLOAT).1;
                assert!(5 * seen > size[0] * size[1], "control: {label} passes for {wrong}: {seen} px");
            }
        }
    }
}
