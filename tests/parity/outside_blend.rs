//! Pictures that are put together: kernels against their twins, and what the reading of several pictures at once is
//! worth.
#![allow(clippy::unwrap_used)]

use crate::fast_device::{Field, on_device};
use crate::gpu_support::bench::{Bench, Scatter};
use crate::gpu_support::device;
use glam::{Vec2, Vec3, Vec4};
use shutterbug::camera::ScanOrder;
use shutterbug::gpu::{Bound, Format, Sampler};
use shutterbug::kernels::kernel;
use shutterbug::plane::Plane;
use shutterbug::reference::fast_gather::fast_gather;
use shutterbug::reference::fast_push::Push as WarpPush;
use shutterbug::reference::fused::fused;
use shutterbug::reference::outside_blend::{Push, outside_blend};
use shutterbug::reference::timing::scan_order_code;

const KNOTS: u32 = 32;

fn warp_push(exposure_time_s: f32) -> WarpPush {
    WarpPush {
        size: [96, 64],
        margin_px: [12; 2],
        start_s: 0.0,
        readout_time_s: 0.03,
        exposure_time_s,
        knot_step_s: (0.03 + exposure_time_s) / KNOTS as f32,
        reference_knot: 0,
        last_knot: KNOTS,
        scan_order: scan_order_code(ScanOrder::TopToBottom),
        max_samples: 240,
        slots: if exposure_time_s > 0.0 { 3 } else { 1 },
        picture_s: 0.012,
        from_s: 0.004,
        to_s: 0.026,
        first: [0; 2],
    }
}

/// A near square before a texture, and a camera that passes both.
fn field(p: &WarpPush) -> Field {
    let inside = |x: f32, y: f32| (30.0..52.0).contains(&x) && (18.0..40.0).contains(&y);
    let color = move |x: f32, y: f32| {
        let texture = 0.5 + 0.5 * (0.9 * x).sin() * (0.7 * y).cos();
        if inside(x, y) { [texture, 0.2, 0.1] } else { [0.1, texture, 1.0 - texture] }
    };
    let mut field = Field::new(p, 1, 1, color, |x, y, _| ([0.0; 2], if inside(x, y) { 0.4 } else { 0.1 }));
    let row = |k: u32| {
        let t = (k as f32 - 0.5 * KNOTS as f32) * p.knot_step_s;
        [
            Vec4::new(1.0, 0.05 * t, 20.0 * t, 3.0 * t),
            Vec4::new(0.0, 1.0, -8.0 * t, 2.0 * t),
            Vec4::new(0.1 * t, 0.0, 0.0, 1.0),
        ]
    };
    field.paths.clear();
    field.moved = (0..=p.last_knot).map(row).collect();
    field.one_of_several = true;
    field
}

#[test]
fn one_of_several_pictures_says_what_it_is_worth_as_its_twin_does() {
    let Some(context) = device("one_of_several_pictures_says_what_it_is_worth_as_its_twin_does") else {
        return;
    };
    for exposure in [0.0, 0.012] {
        let p = warp_push(exposure);
        let field = field(&p);
        let (got, want) = (on_device(&context.0, &p, &field), fast_gather(&p, &field.inputs()));
        let far = |(a, b): &(&[f32], &[f32])| (0..4).any(|c| (a[c] - b[c]).abs() > 2e-3 * (1.0 + b[c].abs()));
        // What no line of its time sees is not even written.
        let pairs = || got.data.chunks(4).zip(want.data.chunks(4)).filter(|(_, want)| want[3] != 0.0);
        let off = pairs().filter(far).count();
        assert!(off <= 96 * 64 / 200, "exposure {exposure}: {off} pixels differ");
        // Lines far from its instant are other pictures'; places where one surface is seen; worth where several are.
        let kind =
            |least: f32, most: f32| want.data.chunks(4).filter(|v| v[3] > least && v[3] <= most).count();
        assert!(want.data.chunks(4).filter(|v| v[3] == 0.0).count() > 96 * 8, "exposure {exposure}");
        let places = kind(-2.0, -1e-9);
        assert_eq!(places > 96 * 16, exposure == 0.0, "exposure {exposure}: {places} places");
        assert!(kind(0.0, 1.0) > 96, "exposure {exposure}");
        let other = fast_gather(&WarpPush { picture_s: 0.02, ..p }, &field.inputs());
        let off = got.data.chunks(4).zip(other.data.chunks(4)).filter(far).count();
        assert!(off > 96 * 16, "control: exposure {exposure}: another instant of the picture passes");
    }
}

#[test]
fn outside_blend_is_its_twin() {
    let Some(mut bench) = Bench::new("outside_blend_is_its_twin") else { return };
    let sampler = Sampler::new(&bench.watched.0, false).unwrap();
    let mut scatter = Scatter(11);
    let (size, texels) = ([61usize, 37], [81usize, 49]);
    let colors: Vec<Plane<f32>> = (0..3)
        .map(|_| Plane::from_fn(texels[0], texels[1], |_, _| [(); 4].map(|()| scatter.number())))
        .collect();
    // Places beside each other, or colours with what they are worth, or nothing.
    let mut shown = |x: usize, y: usize| match scatter.number() {
        n if n < 0.6 => {
            let place = [x, y].map(|v| v as f32 + 10.0 * scatter.number());
            [place[0], place[1], 0.0, -scatter.number() - 0.01]
        }
        n if n < 0.9 => [(); 4].map(|()| scatter.number()),
        _ => [0.0; 4],
    };
    let warped: Vec<Plane<f32>> = (0..3).map(|_| Plane::from_fn(size[0], size[1], &mut shown)).collect();
    for pictures in [2, 3] {
        let push = Push {
            size: size.map(|s| s as u32),
            texels: texels.map(|s| s as i32),
            pictures,
            scan_order: scan_order_code(ScanOrder::BottomToTop),
            middle_s: 0.0,
            readout_time_s: 1.0,
            from_s: 0.2,
            to_s: 0.9,
            first: [0; 2],
        };
        let upload = |bench: &mut Bench, plane: &Plane<f32>| {
            bench.upload(std::slice::from_ref(plane), Format::Rgba32f, false)
        };
        let before = Plane::from_fn(size[0], size[1], |_, _| [7.0; 4]);
        let to = upload(&mut bench, &before);
        let [a, b, c] = [0, 1, 2].map(|i| upload(&mut bench, &warped[i]));
        let [d, e, f] = [0, 1, 2].map(|i| upload(&mut bench, &colors[i]));
        let bound = |image| Bound::Sampled(image, &sampler);
        let resources = [
            ("warped_0", bound(&a)),
            ("warped_1", bound(&b)),
            ("warped_2", bound(&c)),
            ("color_0", bound(&d)),
            ("color_1", bound(&e)),
            ("color_2", bound(&f)),
            ("radiance", Bound::Storage(&to)),
        ];
        bench.run(const { kernel("outside_blend.comp") }, &[], &resources, &push, push.size);
        let got = bench.read(&to).remove(0);
        let off = |push: &Push| {
            let mut want = before.clone();
            outside_blend(push, [0, 1, 2].map(|i| &warped[i]), [0, 1, 2].map(|i| &colors[i]), &mut want);
            got.data.iter().zip(&want.data).filter(|(a, b)| (**a - **b).abs() > 3e-3).count()
        };
        assert_eq!(off(&push), 0, "{pictures} pictures");
        assert!(off(&Push { from_s: 0.3, ..push }) > 61, "control: {pictures}: other lines pass");
        assert!(off(&Push { pictures: 5 - pictures, ..push }) > 500, "control: {pictures}: another number");
    }
}

/// A wave at a place.
fn wave(x: f32, y: f32) -> f32 {
    0.5 + 0.2 * (1.7 * x + 0.3 * y).sin() + 0.2 * (2.1 * y - 0.4 * x).cos()
}

#[test]
fn pictures_read_together_show_more_than_the_mean_of_them() {
    let offs = [Vec2::new(0.1, 0.6), Vec2::new(0.45, 0.15), Vec2::new(0.8, 0.4)];
    let pictures = offs.map(|off| {
        Plane::from_fn(24, 24, |x, y| [wave(x as f32 + 0.5 - off.x, y as f32 + 0.5 - off.y), 0.0, 0.0])
    });
    let (mut together, mut alone) = (0.0, 0.0);
    for (x, y) in (4..20).flat_map(|y| (4..20).map(move |x| (x as f32 + 0.5, y as f32 + 0.5))) {
        let places: Vec<(&Plane<f32>, Vec2)> =
            pictures.iter().zip(offs).map(|(p, off)| (p, Vec2::new(x, y) + off)).collect();
        let mean = places.iter().map(|p| fused(&[*p])).sum::<Vec3>() / 3.0;
        together += (fused(&places).x - wave(x, y)).powi(2);
        alone += (mean.x - wave(x, y)).powi(2);
    }
    assert!(together < 0.25 * alone, "squares {together} of {alone} apart");
    // Alike at a texel's centre: the picture itself.
    let centre = fused(&[(&pictures[0], Vec2::new(5.5, 6.5)); 3]);
    assert!((centre.x - pictures[0].pixel(5, 6)[0]).abs() < 2e-2, "{centre}");
}
