//! The paper's gather for speed: its kernels are their twin, its pictures are close to the exact gather's, the fused
//! kernel is the two kernels that it stands for.
#![allow(clippy::unwrap_used)]

use crate::gpu_support::bench::{Bench, Scatter};
use crate::gpu_support::device;
use crate::gpu_support::frames::{engine, options, request};
use crate::gpu_support::scenes::{rich, walk};
use shutterbug::camera::{Intrinsics, ScanOrder};
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::PaperNoise;
use shutterbug::engine::{Frame, FrameRequest, GATHER_KERNELS, Gather, Method, PaperOptions};
use shutterbug::gpu::{Bound, Format, Location, Sampler, Usage};
use shutterbug::kernels::{POINTWISE, TABLE};
use shutterbug::plane::Plane;
use shutterbug::plane::metrics::psnr_db;
use shutterbug::reference::paper_fast::{Tap, Way, paper_fast};
use shutterbug::reference::paper_gather::Push;

const K: Intrinsics = Intrinsics { width: 97, height: 73, fx: 80.0, fy: 82.0, cx: 47.2, cy: 37.1 };

/// The sampler's weights have 8 bits, half floats 11: of values up to 1.
const TOLERANCE: f32 = 2.5 / 256.0;
/// Pixels whose number of taps, or whose nearest texel, rounding decides.
const OUTLIERS: f64 = 4e-3;

fn case(
    size: [usize; 2],
    margin: usize,
    count: u32,
    scatter: &mut Scatter,
) -> (Push, Plane<f32>, Vec<Plane<f32>>) {
    let (width, height) = (size[0] + 2 * margin, size[1] + 2 * margin);
    // Smooth where bilinear weights matter, and what half floats hold exactly.
    let color = Plane::from_fn(width, height, |x, y| {
        let level = |v: usize| (v % 64) as f32 / 64.0;
        [level(x + y), level(3 * x), level(2 * y), 1.0]
    });
    let reach = margin as f32;
    let motion = (0..count).map(|_| {
        let (vx, vy) = (scatter.between(-reach, reach), scatter.between(-reach, reach));
        Plane::from_fn(width, height, |x, y| if (x / 9 + y / 7) % 5 == 0 { [0.0; 2] } else { [vx, vy] })
    });
    let motion = motion.collect();
    let push = Push {
        size: size.map(|s| s as u32),
        margin_px: [margin as i32; 2],
        start_s: -0.01,
        readout_time_s: 0.02,
        exposure_time_s: 0.017,
        frame_interval_s: 1.0 / 30.0,
        first_motion_s: -0.005,
        motion_step_s: 0.011,
        motion_count: count,
        scan_order: count % 4,
        max_samples: 240,
        pixel_time: count % 2,
    };
    (push, color, motion)
}

fn run(bench: &mut Bench, name: &str, push: &Push, color: &Plane<f32>, motion: &[Plane<f32>]) -> Plane<f32> {
    let kernel = GATHER_KERNELS.iter().find(|k| k.name == name).unwrap();
    let (file, way) = described(name);
    let half = half_image(bench, color);
    let motions = bench.upload(motion, Format::Rg32f, true);
    let radiance = bench.empty(push.size.map(|s| s as usize), Format::Rgba32f, 1, false);
    let context = bench.watched.0.clone();
    let sampler =
        if file.contains("sampler") { Sampler::in_texels(&context) } else { Sampler::new(&context, false) };
    let sampler = sampler.unwrap();
    let bytes = shutterbug::chain::PARAMETER_BYTES;
    let parameters =
        shutterbug::gpu::Buffer::new(&context, "parameters", bytes, Usage::Uniform, Location::Device)
            .unwrap();
    let tables = bench.filled(Usage::Texels, &[0.0f32; 16]);
    let pixels = bench.buffer(4 * (push.size[0] * push.size[1]) as usize);
    let mut constants = vec![0u32; 45];
    assert!(POINTWISE.len() < 40 && kernel.name == name);
    (constants[40], constants[41], constants[44]) =
        (way.taps_per_px.to_bits(), way.unroll, push.motion_count);
    let resources = [
        ("color", Bound::Sampled(&half, &sampler)),
        ("motion", Bound::Storage(&motions)),
        ("radiance", Bound::Storage(&radiance)),
        ("source", Bound::Storage(&radiance)),
        ("original", Bound::Storage(&radiance)),
        ("target", Bound::Storage(&radiance)),
        ("Parameters", Bound::Buffer(&parameters)),
        ("tables", Bound::Buffer(&tables)),
        ("Pixels", Bound::Buffer(&pixels)),
    ];
    // The chain's part of the block is not used here.
    let mut words = [0u32; 20];
    words[..14].copy_from_slice(bytemuck::cast_slice(bytemuck::bytes_of(push)));
    let shader = TABLE.iter().find(|k| k.file == file).unwrap();
    bench.run(shader, &constants, &resources, &words, push.size);
    bench.read(&radiance).remove(0)
}

fn half_image(bench: &mut Bench, color: &Plane<f32>) -> shutterbug::gpu::Image {
    let wide = bench.upload(std::slice::from_ref(color), Format::Rgba32f, false);
    let half = bench.empty([color.width, color.height], Format::Rgba16f, 1, false);
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let size = [color.width as u32, color.height as u32];
    let resources = [("color_samples", Bound::Sampled(&wide, &sampler)), ("color", Bound::Storage(&half))];
    let push: [u32; 4] = [size[0], size[1], 1, 1];
    let shader = TABLE.iter().find(|k| k.file == "resolve_color_half.comp").unwrap();
    bench.run(shader, &[], &resources, &push, size);
    half
}

/// File and constants of a kernel, by its name.
fn described(name: &str) -> (&'static str, Way) {
    let (stem, unroll) = name.split_once('_').unwrap();
    let (file, tap, taps_per_px) = match stem {
        "sampler" => ("paper_fast_sampler.comp", Tap::Bilinear, 0.5),
        "texels" => ("paper_fast_texels.comp", Tap::Bilinear, 0.5),
        "nearest" => ("paper_fast_nearest.comp", Tap::Nearest, 1.0),
        other => panic!("{other}"),
    };
    (file, Way { tap, taps_per_px, unroll: unroll.parse().unwrap() })
}

/// Share of pixels that are off, in colour or in the number of taps.
fn off(got: &Plane<f32>, want: &Plane<f32>) -> f64 {
    let wrong =
        |(g, w): &(&[f32], &[f32])| (0..3).any(|c| !((g[c] - w[c]).abs() <= TOLERANCE)) || g[3] != w[3];
    let pixels = got.data.chunks_exact(4).zip(want.data.chunks_exact(4));
    let all = got.width * got.height;
    pixels.filter(wrong).count() as f64 / all as f64
}

#[test]
fn every_kernel_is_its_twin() {
    let Some(mut bench) = Bench::new("every_kernel_is_its_twin") else { return };
    let mut scatter = Scatter(11);
    for kernel in &GATHER_KERNELS {
        let (_, way) = described(kernel.name);
        for (size, margin, count) in [([1, 1], 1, 1), ([37, 23], 9, 2), ([131, 71], 24, 2), ([64, 33], 12, 5)]
        {
            let (push, color, motion) = case(size, margin, count, &mut scatter);
            let got = run(&mut bench, kernel.name, &push, &color, &motion);
            let want = paper_fast(&push, way, &color, &motion);
            let share = off(&got, &want);
            assert!(
                share <= OUTLIERS,
                "{}, {size:?}, {count} images: {share} of the pixels are off",
                kernel.name
            );
            if size[0] > 100 {
                let late = Push { start_s: push.start_s + 2e-3, ..push };
                let control = off(&got, &paper_fast(&late, way, &color, &motion));
                assert!(control > 0.1, "control: 2 ms later {control}");
            }
        }
    }
}

/// Frame with shutter, blur and white noise.
fn frame_request() -> FrameRequest {
    let mut settings = Settings::default();
    settings.set(&PaperNoise, "color_variance_g", Value::Number(1e-4)).unwrap();
    FrameRequest { settings, seed: 3, ..request(&K, 0.012, 0.02, ScanOrder::TopToBottom) }
}

fn frame(watched: &crate::gpu_support::Watched, gather: Gather, request: &FrameRequest) -> Frame {
    let method = Method::Paper(PaperOptions { gather, ..PaperOptions::default() });
    let mut engine = engine(watched, &rich(5), &walk(), K, options(method, 4), std::slice::from_ref(request));
    engine.render(request).unwrap()
}

#[test]
fn pictures_are_close_to_the_exact_ones_and_one_kernel_is_two() {
    let Some(watched) = device("pictures_are_close_to_the_exact_ones_and_one_kernel_is_two") else { return };
    let noisy = frame_request();
    let exact = frame(&watched, Gather::Exact, &noisy);
    for (gather, least_db) in [(Gather::Bilinear, 42.0), (Gather::Fast, 30.0)] {
        let fused = frame(&watched, gather, &noisy);
        let names: Vec<_> = fused.times.iter().map(|t| t.name).collect();
        assert!(names.is_empty() || !names.contains(&"pointwise"), "one kernel: {names:?}");
        let db = psnr_db(&fused.picture, &exact.picture);
        eprintln!("{gather:?}: {db:.1} dB from the exact gather");
        assert!(db > least_db, "{gather:?}: {db} dB");
        // Statistics need the radiance, so two kernels run.
        let apart = frame(&watched, gather, &FrameRequest { statistics: true, ..noisy.clone() });
        let differ = fused.picture.data.iter().zip(&apart.picture.data).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{gather:?}: bytes that differ between one kernel and two");
        let other = frame(&watched, gather, &FrameRequest { seed: 4, ..noisy.clone() });
        assert!(other.picture.data != fused.picture.data, "control: another seed");
    }
}
