//! The warp of `--method fast` along paths that follow from depth: bodies that move by themselves, a lens that the
//! picture was rendered without, and what unpacks a host's pictures for it. Kernels against their twins; every
//! comparison has a control.
#![allow(clippy::unwrap_used)]

use crate::fast_device::{Field, on_device};
use crate::gpu_support::bench::{Bench, Scatter};
use crate::gpu_support::device;
use glam::Vec4;
use shutterbug::camera::ScanOrder;
use shutterbug::gpu::{Bound, Buffer, Format, Location, Usage};
use shutterbug::kernels::kernel;
use shutterbug::plane::{PixelFormat, Plane};
use shutterbug::reference::fast_gather::fast_gather;
use shutterbug::reference::fast_push::Push;
use shutterbug::reference::timing::scan_order_code;
use shutterbug::reference::unpack::{
    BodyPush, ColorPush, InverseDepthPush, decode_table, unpack_body, unpack_color, unpack_inverse_depth,
};

const W: usize = 96;
const H: usize = 64;
const MARGIN: usize = 40;
/// Not a number by which lines fall on knots: there the path bends, and rounding decides which side is followed.
const KNOTS: u32 = 31;

fn push(order: ScanOrder, exposure_time_s: f32) -> Push {
    Push {
        size: [W as u32, H as u32],
        margin_px: [MARGIN as i32; 2],
        start_s: 0.0,
        readout_time_s: 0.03,
        exposure_time_s,
        knot_step_s: (0.03 + exposure_time_s) / KNOTS as f32,
        reference_knot: 0,
        last_knot: KNOTS,
        scan_order: scan_order_code(order),
        max_samples: 240,
        slots: if exposure_time_s > 0.0 { 3 } else { 1 },
        picture_s: 0.0,
        from_s: 0.0,
        to_s: 0.0,
        first: [0; 2],
    }
}

/// Matrices over the frame, from its middle on: a turn that shakes, and a way that bends.
fn matrices(p: &Push, shake: f32, way: f32) -> Vec<[Vec4; 3]> {
    let middle_s = 0.5 * p.knot_step_s * p.last_knot as f32;
    let row = |k: u32| {
        let t = k as f32 * p.knot_step_s - middle_s;
        let turn = shake * ((150.0 * t).sin());
        [
            Vec4::new(1.0 + 0.2 * turn, -turn, way * t, -0.6 * turn),
            Vec4::new(turn, 1.0 + 0.2 * turn, -0.4 * way * t, 0.3 * turn + way * t * t),
            Vec4::new(0.3 * turn, 0.1 * turn, 0.1 * way * t, 1.0),
        ]
    };
    (0..=p.last_knot).map(row).collect()
}

/// Texture, and a square before it that is body 1.
fn field(p: &Push) -> Field {
    let inside = |x: f32, y: f32| (30.0..52.0).contains(&x) && (18.0..40.0).contains(&y);
    let color = move |x: f32, y: f32| {
        let texture = 0.5 + 0.5 * (0.9 * x).sin() * (0.7 * y).cos();
        if inside(x, y) { [texture, 0.2, 0.1] } else { [0.1, texture, 1.0 - texture] }
    };
    let mut field = Field::new(p, 1, 1, color, |x, y, _| ([0.0; 2], if inside(x, y) { 0.4 } else { 0.1 }));
    let depth = &field.inverse_depth;
    field.inverse_depth = Plane::from_fn(depth.width, depth.height, |x, y| {
        let near = depth.pixel(x, y)[0];
        [near, f32::from(u8::from(near > 0.2))]
    });
    field.paths.clear();
    field.moved = [matrices(p, 0.2, 2.0), matrices(p, -0.1, -8.0)].concat();
    field
}

/// A lens that bends outwards, as tables; `k` is how much.
fn lens(p: &Push, k: f32) -> [Plane<f32>; 2] {
    let (cx, cy) = (W as f32 / 2.0, H as f32 / 2.0);
    let bent = |x: f32, y: f32, k: f32| {
        let (dx, dy) = (x - cx, y - cy);
        let scale = 1.0 + k * (dx * dx + dy * dy) / (cx * cx);
        [cx + dx * scale, cy + dy * scale]
    };
    let m = MARGIN as f32;
    let ideal = Plane::from_fn(W, H, |x, y| {
        let [u, v] = bent(x as f32 + 0.5, y as f32 + 0.5, k);
        [u + m, v + m]
    });
    let full = [p.size[0] as usize + 2 * MARGIN, p.size[1] as usize + 2 * MARGIN];
    let sensed = Plane::from_fn(full[0], full[1], |x, y| bent(x as f32 + 0.5 - m, y as f32 + 0.5 - m, -k));
    [ideal, sensed]
}

fn differing(a: &Plane<f32>, b: &Plane<f32>) -> usize {
    let pixel = |(a, b): (&[f32], &[f32])| (0..4).any(|c| (a[c] - b[c]).abs() > 1e-3);
    a.data.chunks(4).zip(b.data.chunks(4)).filter(|&p| pixel(p)).count()
}

#[test]
fn bodies_and_lenses_agree_with_their_twins() {
    let Some(context) = device("bodies_and_lenses_agree_with_their_twins") else { return };
    for (i, order) in [ScanOrder::TopToBottom, ScanOrder::RightToLeft].into_iter().enumerate() {
        for exposure in [0.0, 0.012] {
            for with_lens in [false, true] {
                let p = push(order, exposure);
                let field = Field { lens: with_lens.then(|| lens(&p, 0.08)), ..field(&p) };
                let got = on_device(&context.0, &p, &field);
                let want = fast_gather(&p, &field.inputs());
                let label = format!("{order}, exposure {exposure}, lens: {with_lens}");
                let count = differing(&got, &want);
                assert!(count <= W * H / 500, "{label}: {count} pixels differ");
                // Controls: all of it one body; another lens; other lines.
                let one = Field {
                    moved: [matrices(&p, 0.2, 2.0), matrices(&p, 0.2, 2.0)].concat(),
                    ..field.clone()
                };
                assert!(
                    differing(&got, &fast_gather(&p, &one.inputs())) > W * H / 20,
                    "control: {label}: one body"
                );
                let other = Field { lens: Some(lens(&p, 0.02)), ..field.clone() };
                assert!(
                    differing(&got, &fast_gather(&p, &other.inputs())) > W * H / 4,
                    "control: {label}: lens"
                );
                let turned = push(ScanOrder::ALL[2 * (1 - i)], exposure);
                assert!(
                    differing(&got, &fast_gather(&turned, &field.inputs())) > W * H / 4,
                    "control: {label}"
                );
            }
        }
    }
}

/// Bytes as a host may have them, with rows that have room behind them.
fn source(bench: &Bench, bytes: &[u8]) -> Buffer {
    let length = bytes.len().next_multiple_of(4) as u64;
    let mut buffer =
        Buffer::new(&bench.watched.0, "source", length, Usage::Storage, Location::Upload).unwrap();
    buffer.write(0, bytes);
    buffer
}

#[test]
fn unpack_inverse_depth_is_its_twin() {
    let Some(mut bench) = Bench::new("unpack_inverse_depth_is_its_twin") else { return };
    let mut scatter = Scatter(3);
    let edges = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e-30, 1e30, 1.0];
    for (size, forms) in
        [([37, 23], [0.02, 0.0, 0.0]), ([64, 9], [0.0, 0.0, 1.0]), ([5, 41], [0.0, 0.2, -0.19])]
    {
        let (stride, first) = (4 * size[0] + 12, 8);
        let mut bytes = vec![0xaa; first + stride * size[1]];
        for (x, y) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))) {
            let value = if (x + 5 * y) % 7 == 0 { edges[(x + y) % 8] } else { scatter.between(0.01, 9.0) };
            bytes[first + y * stride + 4 * x..][..4].copy_from_slice(&value.to_le_bytes());
        }
        let [numerator, constant, slope] = forms;
        let push = InverseDepthPush {
            size: size.map(|s| s as u32),
            first_byte: first as u32,
            stride_bytes: stride as u32,
            numerator,
            constant,
            slope,
        };
        let (from, to) = (source(&bench, &bytes), bench.empty(size, Format::Rg32f, 1, false));
        let resources = [("Source", Bound::Buffer(&from)), ("inverse_depth", Bound::Storage(&to))];
        bench.run(const { kernel("unpack_inverse_depth.comp") }, &[], &resources, &push, push.size);
        let got = bench.read(&to).remove(0);
        let off = |want: &Plane<f32>| {
            let depth = got.data.iter().step_by(2);
            depth.zip(&want.data).filter(|(a, b)| (**a - **b).abs() > 1e-6 * b.abs()).count()
        };
        assert_eq!(off(&unpack_inverse_depth(&push, &bytes)), 0, "{size:?}");
        assert!(got.data.iter().all(|v| v.is_finite() && *v >= 0.0), "{size:?}");
        let other = InverseDepthPush { first_byte: 4, ..push };
        assert!(off(&unpack_inverse_depth(&other, &bytes)) > size[0], "control: {size:?}: other values pass");
    }
}

#[test]
fn unpack_color_half_rounds_what_its_twin_unpacks() {
    let Some(mut bench) = Bench::new("unpack_color_half_rounds_what_its_twin_unpacks") else { return };
    let (mut scatter, table, size) = (Scatter(8), decode_table(), [33, 21]);
    let mut decode = Buffer::new(
        &bench.watched.0,
        "decode",
        size_of_val(table.as_slice()) as u64,
        Usage::Texels,
        Location::Upload,
    )
    .unwrap();
    decode.write(0, &table);
    // Kernels that are made for a format, and the one of all of them.
    let own = |format: PixelFormat| (format, format as u32);
    let cases =
        [own(PixelFormat::Rgb8), own(PixelFormat::Bgra8), own(PixelFormat::Rgba32f), (PixelFormat::Rgba8, 0)];
    for (format, made_for) in cases {
        let stride = (size[0] * format.bytes()).next_multiple_of(4);
        let mut bytes: Vec<u8> = (0..stride * size[1]).map(|_| (scatter.number() * 255.0) as u8).collect();
        if format == PixelFormat::Rgba32f {
            for value in bytes.chunks_exact_mut(4) {
                let number = if scatter.number() < 0.1 { 1e6 } else { scatter.between(-0.5, 3.0) };
                value.copy_from_slice(&number.to_le_bytes());
            }
        }
        let push = ColorPush {
            size: size.map(|s| s as u32),
            first_byte: 0,
            stride_bytes: stride as u32,
            format: format as u32,
            codes_from: 0,
        };
        let (from, to) = (source(&bench, &bytes), bench.empty(size, Format::Rgba16f, 1, false));
        let resources = [
            ("Source", Bound::Buffer(&from)),
            ("decode", Bound::Buffer(&decode)),
            ("color", Bound::Storage(&to)),
        ];
        bench.run(const { kernel("unpack_color_half.comp") }, &[made_for], &resources, &push, push.size);
        let got = bench.read(&to).remove(0);
        let want = unpack_color(&push, &bytes, &table);
        let half = |v: f32| exr::prelude::f16::from_f32(v.clamp(-65504.0, 65504.0)).to_f32();
        let off = |round: &dyn Fn(f32) -> f32| {
            let rgb = got.data.iter().zip(&want.data).enumerate().filter(|(i, _)| i % 4 != 3);
            rgb.filter(|(_, (a, b))| **a != round(**b)).count()
        };
        assert_eq!(off(&half), 0, "{format:?}");
        assert!(off(&|v| v) > size[0], "control: {format:?}: what is not rounded passes");
    }
}

#[test]
fn unpack_body_is_its_twin_and_leaves_the_depth() {
    let Some(mut bench) = Bench::new("unpack_body_is_its_twin_and_leaves_the_depth") else { return };
    let (mut scatter, size) = (Scatter(4), [41, 19]);
    // Ids that are known, between known ones, before and behind them.
    let ids = [3u32, 7, 200, 255, 300, 65535, 70_000];
    let numbers: Vec<u32> = ids.iter().copied().chain(1..=ids.len() as u32).collect();
    for id_bytes in [1usize, 2, 4] {
        let stride = (size[0] * id_bytes).next_multiple_of(4) + 8;
        let mut bytes = vec![0xaa; stride * size[1]];
        for (x, y) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))) {
            let id = ids[(scatter.number() * 6.99) as usize] + u32::from(scatter.number() < 0.3);
            bytes[y * stride + x * id_bytes..][..id_bytes].copy_from_slice(&id.to_le_bytes()[..id_bytes]);
        }
        let depth = Plane::from_fn(size[0], size[1], |_, _| [scatter.number(), -1.0]);
        let push = BodyPush {
            size: size.map(|s| s as u32),
            first_byte: 0,
            stride_bytes: stride as u32,
            id_bytes: id_bytes as u32,
            count: ids.len() as u32,
        };
        let to = bench.upload(std::slice::from_ref(&depth), Format::Rg32f, false);
        let known: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let (from, known) = (source(&bench, &bytes), source(&bench, &known));
        let resources = [
            ("Source", Bound::Buffer(&from)),
            ("BodyIds", Bound::Buffer(&known)),
            ("inverse_depth", Bound::Storage(&to)),
        ];
        bench.run(const { kernel("unpack_body.comp") }, &[], &resources, &push, push.size);
        let got = bench.read(&to).remove(0);
        let off = |want: &Plane<f32>| {
            got.data.chunks(2).zip(&want.data).filter(|(got, want)| got[1] != **want).count()
        };
        let want = unpack_body(&push, &bytes, &numbers);
        assert_eq!(off(&want), 0, "{id_bytes} bytes");
        assert!(got.data.chunks(2).zip(depth.data.chunks(2)).all(|(a, b)| a[0] == b[0]), "the depth stays");
        let found = |n: f32| want.data.contains(&n);
        assert!(found(0.0) && found(1.0) && found(3.0), "{id_bytes} bytes: known and unknown ids");
        let fewer: Vec<u32> = ids[1..].iter().copied().chain(2..=ids.len() as u32).collect();
        let other = unpack_body(&BodyPush { count: push.count - 1, ..push }, &bytes, &fewer);
        assert!(off(&other) > size[0], "control: {id_bytes} bytes: without the first body");
    }
}
