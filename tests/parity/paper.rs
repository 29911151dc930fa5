//! Kernels of the paper's method against their CPU twins, on random and edge input and odd sizes. On lavapipe bit for
//! bit (it computes with the CPU's own operations in the twin's order); elsewhere a stated share of outliers is
//! allowed, because divisions and square roots may be rounded differently there and a sample count may tip over.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::bench::{Bench, Scatter, differing};
use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder};
use shutterbug::gpu::{Bound, Format, Sampler};
use shutterbug::kernels::{Kernel, kernel};
use shutterbug::plane::Plane;
use shutterbug::reference::motion_from_depth::{self, motion_from_depth};
use shutterbug::reference::outside_gather::outside_gather;
use shutterbug::reference::paper_gather::{self, paper_gather};

/// Share of outlying pixels on devices that round in their own way, over many pictures; in one their number scatters
/// like any count. Most lie where a texel as bright as half floats can be has a weight near zero.
const OUTLIERS: f64 = 5e-3;
const TOLERANCE: f32 = 1e-4;

fn check(bench: &Bench, what: &str, got: &Plane<f32>, want: &Plane<f32>) {
    let (bits, outliers) = differing(got, want, TOLERANCE);
    let pixels = got.width * got.height;
    if bench.exact() {
        assert_eq!(bits, 0, "{what}: pixels that differ in a bit, of {pixels}");
    } else {
        let mean = OUTLIERS * pixels as f64;
        let allowed = (mean + 5.0 * mean.sqrt()).ceil() as usize;
        assert!(outliers <= allowed, "{what}: {outliers} outliers of {pixels} px, {bits} differ in a bit");
    }
}

struct GatherCase {
    push: paper_gather::Push,
    color: Plane<f32>,
    motion: Vec<Plane<f32>>,
}

/// Random picture and motion with values at the edges of what occurs.
fn gather_case(size: [usize; 2], margin: usize, count: u32, scatter: &mut Scatter) -> GatherCase {
    const EDGES: [f32; 8] = [0.0, -0.0, 1.0, 65504.0, -3.0, 1e-6, 1e6, 0.5];
    let (width, height) = (size[0] + 2 * margin, size[1] + 2 * margin);
    let color = Plane::from_fn(width, height, |x, y| {
        let edge = EDGES[(x * 31 + y * 17) % 8];
        let rare = (x + 3 * y) % 11 == 0;
        [
            scatter.number(),
            if rare { edge } else { scatter.between(-5.0, 5.0) },
            scatter.number().powi(4),
            1.0,
        ]
    });
    let reach = margin as f32;
    let motion = (0..count).map(|k| {
        let (vx, vy) = (scatter.between(-reach, reach), scatter.between(-reach, reach));
        Plane::from_fn(width, height, |x, y| match (x * 7 + y * 3 + k as usize) % 53 {
            0 => [0.0, 0.0],
            1 => [-0.0, 900.0],
            _ => [vx + scatter.between(-2.0, 2.0), vy + scatter.between(-2.0, 2.0)],
        })
    });
    let motion = motion.collect();
    // Every third case is a global shutter, every fourth exposes for an instant.
    let rolls = scatter.number() > 0.33;
    let exposes = scatter.number() > 0.25;
    let push = paper_gather::Push {
        size: size.map(|s| s as u32),
        margin_px: [margin as i32; 2],
        start_s: -0.01,
        readout_time_s: if rolls { 0.03 } else { 0.0 },
        exposure_time_s: if exposes { 0.017 } else { 0.0 },
        frame_interval_s: 1.0 / 30.0,
        first_motion_s: -0.005,
        motion_step_s: 0.011,
        motion_count: count,
        scan_order: 0,
        max_samples: if count == 4 { 7 } else { 240 },
        pixel_time: count % 2,
    };
    GatherCase { push, color, motion }
}

fn run_gather(bench: &mut Bench, case: &GatherCase) -> Plane<f32> {
    run_gather_by(bench, const { kernel("paper_gather.comp") }, case)
}

fn run_gather_by(bench: &mut Bench, by: &'static Kernel, case: &GatherCase) -> Plane<f32> {
    let color = bench.upload(std::slice::from_ref(&case.color), Format::Rgba32f, false);
    let motion = bench.upload(&case.motion, Format::Rg32f, true);
    let radiance = bench.empty(case.push.size.map(|s| s as usize), Format::Rgba32f, 1, false);
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let resources = [
        ("color", Bound::Sampled(&color, &sampler)),
        ("motion", Bound::Storage(&motion)),
        ("radiance", Bound::Storage(&radiance)),
    ];
    bench.run(by, &[], &resources, &case.push, case.push.size);
    bench.read(&radiance).remove(0)
}

#[test]
fn outside_gather_is_its_twin() {
    let Some(mut bench) = Bench::new("outside_gather_is_its_twin") else { return };
    let mut scatter = Scatter(17);
    for count in 1..=6u32 {
        let mut case = gather_case([61, 33], 12, count, &mut scatter);
        case.push.scan_order = count % 4;
        let got = run_gather_by(&mut bench, const { kernel("outside_gather.comp") }, &case);
        let want = outside_gather(&case.push, &case.color, &case.motion);
        check(&bench, &format!("{count} images"), &got, &want);
        // One image's motion is all of the way: what the paper says is the same then, and not with several.
        let (_, outliers) = differing(&got, &paper_gather(&case.push, &case.color, &case.motion), 1e-3);
        assert!(if count == 1 { outliers < 20 } else { outliers > 200 }, "{count} images: {outliers}");
    }
}

#[test]
fn paper_gather_is_its_twin() {
    let Some(mut bench) = Bench::new("paper_gather_is_its_twin") else { return };
    let mut scatter = Scatter(7);
    let (mut cases, mut caught) = (0, 0);
    let sizes = [([1, 1], 0), ([37, 23], 5), ([129, 71], 20), ([63, 9], 0), ([640, 480], 40)];
    for (at, (size, margin)) in sizes.into_iter().enumerate() {
        for count in 1..=6u32 {
            if at == 4 && count % 5 != 2 {
                continue;
            }
            let mut case = gather_case(size, margin, count, &mut scatter);
            for order in ScanOrder::ALL {
                // Large pictures in one order each.
                if at == 4 && order as u32 != count % 4 {
                    continue;
                }
                case.push.scan_order = order as u32;
                let got = run_gather(&mut bench, &case);
                let want = paper_gather(&case.push, &case.color, &case.motion);
                check(&bench, &format!("{size:?}, {count} images, {order}"), &got, &want);
                let start_s = case.push.start_s + 1e-4;
                let wrong =
                    paper_gather(&paper_gather::Push { start_s, ..case.push }, &case.color, &case.motion);
                let (_, outliers) = differing(&got, &wrong, TOLERANCE);
                cases += 1;
                caught += usize::from(outliers as f64 > OUTLIERS * (size[0] * size[1]) as f64 + 1.0);
            }
        }
    }
    // A single pixel cannot tell a tenth of a millisecond where nothing can move; every other case must.
    assert!(caught >= cases - 4 * 6, "control: a start 0.1 ms late is seen in {caught} of {cases} cases");
    eprintln!("paper_gather: {cases} cases, 0.1 ms late seen in {caught}");
}

#[test]
fn paper_gather_without_time_is_the_identity() {
    let Some(mut bench) = Bench::new("paper_gather_without_time_is_the_identity") else { return };
    let mut scatter = Scatter(8);
    for (size, margin) in [([1, 1], 0), ([37, 23], 5), ([129, 71], 3)] {
        let mut case = gather_case(size, margin, 2, &mut scatter);
        case.push = paper_gather::Push {
            start_s: 0.0,
            readout_time_s: 0.0,
            exposure_time_s: 0.0,
            pixel_time: 1,
            ..case.push
        };
        let same = |got: &Plane<f32>| {
            (0..size[0] * size[1]).all(|i| {
                let (x, y) = (i % size[0], i / size[0]);
                let (got, want) = (got.pixel(x, y), case.color.pixel(x + margin, y + margin));
                (0..3).all(|c| got[c].to_bits() == want[c].to_bits()) && got[3] == 1.0
            })
        };
        // On every device: no arithmetic is left, so nothing can be rounded.
        assert!(same(&run_gather(&mut bench, &case)), "{size:?}");
        let late = GatherCase {
            push: paper_gather::Push { start_s: 0.004, ..case.push },
            color: case.color.clone(),
            motion: case.motion.clone(),
        };
        assert!(size == [1, 1] || !same(&run_gather(&mut bench, &late)), "control: {size:?}");
    }
}

#[test]
fn motion_from_depth_is_its_twin() {
    let Some(mut bench) = Bench::new("motion_from_depth_is_its_twin") else { return };
    let mut scatter = Scatter(9);
    let pose = |s: f64| Pose {
        rotation: DQuat::from_scaled_axis(DVec3::new(0.3 * s, s, 0.2 * s)),
        translation_m: DVec3::new(s, 0.3 * s, -8.0 * s),
    };
    for (layer, [w, h]) in [[1usize, 1usize], [37, 23], [129, 71], [640, 480]].into_iter().enumerate() {
        let (wide, high) = (w as f64, h as f64);
        let k = Intrinsics {
            width: w as u32,
            height: h as u32,
            fx: wide,
            fy: 1.1 * wide,
            cx: 0.48 * wide,
            cy: 0.53 * high,
        };
        let push = motion_from_depth::Push::new(&k, layer as u32, 0.5, &pose(-0.1), &pose(0.12));
        // The twin of NaN is excluded: GLSL leaves comparisons with it open.
        let depth = Plane::from_fn(w, h, |x, y| match (x + y) % 19 {
            0 => [f32::INFINITY],
            1 => [0.0],
            2 => [-1.0],
            3 => [1e-3],
            4 => [1e9],
            _ => [scatter.between(0.2, 6.0)],
        });
        let input = bench.upload(std::slice::from_ref(&depth), Format::R32f, false);
        let output = bench.empty([w, h], Format::Rg32f, 4, true);
        let resources = [("depth", Bound::Storage(&input)), ("motion", Bound::Storage(&output))];
        bench.run(const { kernel("motion_from_depth.comp") }, &[], &resources, &push, push.size);
        let layers = bench.read(&output);
        check(&bench, &format!("{w}x{h}"), &layers[layer], &motion_from_depth(&push, &depth));
        for (other, plane) in layers.iter().enumerate().filter(|(i, _)| *i != layer) {
            assert!(plane.data.iter().all(|&v| v == 0.0), "layer {other} was written instead of {layer}");
        }
        let wrong = motion_from_depth::Push { scale: 1.001 * push.scale, ..push };
        let (_, outliers) = differing(&layers[layer], &motion_from_depth(&wrong, &depth), TOLERANCE);
        assert!(2 * outliers > w * h, "control: a scale off by a thousandth is seen in {outliers} px");
    }
}
