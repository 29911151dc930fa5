//! The paper's method on synthetic pictures, against closed forms. Every comparison has a control: the same check on a
//! wrong sign, a wrong order or a wrong model must fail.

use shutterbug::camera::ScanOrder;
use shutterbug::plane::Plane;
use shutterbug::reference::paper_gather::{Push, paper_gather};
use shutterbug::reference::timing::scan_order_code;

const W: usize = 96;
const H: usize = 64;
const MARGIN: usize = 40;
/// Frame interval, s.
const T: f32 = 0.04;
/// Largest place error that f32 explains, px: a few units in the last place of a coordinate near 200.
const TOLERANCE_PX: f32 = 1e-3;

fn push(order: ScanOrder) -> Push {
    Push {
        size: [W as u32, H as u32],
        margin_px: [MARGIN as i32; 2],
        start_s: 0.0,
        readout_time_s: 0.0,
        exposure_time_s: 0.0,
        frame_interval_s: T,
        first_motion_s: 0.0,
        motion_step_s: T,
        motion_count: 1,
        scan_order: scan_order_code(order),
        max_samples: 240,
        pixel_time: 0,
    }
}

/// A picture with margin; `f` takes pixel centres in px of the picture without margin.
fn picture(f: impl Fn(f32, f32) -> [f32; 4]) -> Plane<f32> {
    let centre = |i: usize| i as f32 + 0.5 - MARGIN as f32;
    Plane::from_fn(W + 2 * MARGIN, H + 2 * MARGIN, |x, y| f(centre(x), centre(y)))
}

fn constant_motion(v: [f32; 2]) -> Plane<f32> {
    Plane::from_fn(W + 2 * MARGIN, H + 2 * MARGIN, |_, _| v)
}

/// Bar edges: red rises through 1/2 at x = 40, green at y = 30, both over 8 px (linear, so bilinear reading is exact).
const EDGE_X: f32 = 40.0;
const EDGE_Y: f32 = 30.0;
fn bars() -> Plane<f32> {
    let ramp = |d: f32| (d / 8.0 + 0.5).clamp(0.0, 1.0);
    picture(|x, y| [ramp(x - EDGE_X), ramp(y - EDGE_Y), 0.25, 1.0])
}

/// Where a line of values rises through 1/2, px.
fn crossing(values: impl Iterator<Item = f32>) -> f32 {
    let values: Vec<f32> = values.collect();
    let i = values.windows(2).position(|w| w[0] < 0.5 && w[1] >= 0.5).expect("an edge");
    i as f32 + 0.5 + (0.5 - values[i]) / (values[i + 1] - values[i])
}

fn red_edge(radiance: &Plane<f32>, y: usize) -> f32 {
    crossing((0..radiance.width).map(|x| radiance.pixel(x, y)[0]))
}

fn green_edge(radiance: &Plane<f32>, x: usize) -> f32 {
    crossing((0..radiance.height).map(|y| radiance.pixel(x, y)[1]))
}

/// Farthest that any edge lies from its closed form for constant motion `v` px a frame, read in `order`.
///
/// Across the lines the bar slants: line i's edge lies at e + v (start + readout i/N) / T. Along them it is displaced
/// by what its own line sees, x = e + v (start + readout i(x)/N) / T solved for x.
fn worst_edge_px(radiance: &Plane<f32>, p: &Push, order: ScanOrder, v: [f32; 2]) -> f32 {
    let [vx, vy] = v.map(|v| v / T);
    let lines = if order.lines_are_rows() { H } else { W } as f32;
    let slope = p.readout_time_s / lines;
    let backwards = matches!(order, ScanOrder::BottomToTop | ScanOrder::RightToLeft);
    let start = |i: usize| p.start_s + slope * if backwards { lines - 1.0 - i as f32 } else { i as f32 };
    let own = |edge: f32, v: f32| {
        // Line start at coordinate x: start(0) + sign slope (x - 1/2).
        let sign = if backwards { -1.0 } else { 1.0 };
        (edge + v * (start(0) - 0.5 * sign * slope)) / (1.0 - sign * v * slope)
    };
    let rows = (0..H).map(|y| {
        let want = if order.lines_are_rows() { EDGE_X + vx * start(y) } else { own(EDGE_X, vx) };
        (red_edge(radiance, y) - want).abs()
    });
    let columns = (0..W).map(|x| {
        let want = if order.lines_are_rows() { own(EDGE_Y, vy) } else { EDGE_Y + vy * start(x) };
        (green_edge(radiance, x) - want).abs()
    });
    rows.chain(columns).fold(0.0, f32::max)
}

#[test]
fn the_slant_of_a_bar_is_the_closed_form_in_all_scan_orders() {
    for order in ScanOrder::ALL {
        for (start_s, v) in [(0.0, [17.0, -9.0]), (-0.5 * T, [-23.5, 11.25]), (0.3 * T, [8.0, 8.0])] {
            let p = Push { start_s, readout_time_s: 0.7 * T, ..push(order) };
            let radiance = paper_gather(&p, &bars(), &[constant_motion(v)]);
            let worst = worst_edge_px(&radiance, &p, order, v);
            assert!(worst < TOLERANCE_PX, "{order} {v:?}: off by {worst} px");
            assert!(radiance.data.chunks(4).all(|p| p[3] == 1.0), "one sample, none outside the margin");
            for wrong in ScanOrder::ALL.into_iter().filter(|o| *o != order) {
                let worst = worst_edge_px(&radiance, &p, wrong, v);
                assert!(worst > 1.0, "control: {order} passes for {wrong}, {worst} px");
            }
            let wrong = worst_edge_px(&radiance, &p, order, v.map(|v| -v));
            assert!(wrong > 1.0, "control: the wrong sign passes, {wrong} px");
        }
    }
}

#[test]
fn the_place_within_the_line_adds_its_share_of_the_readout() {
    let (v, readout_time_s) = (30.0, 0.9 * T);
    let p = Push { readout_time_s, pixel_time: 1, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &bars(), &[constant_motion([v, 0.0])]);
    let without = paper_gather(&Push { pixel_time: 0, ..p }, &bars(), &[constant_motion([v, 0.0])]);
    let (mut worst, mut control) = (0.0_f32, 0.0_f32);
    for y in 0..H {
        // x = e + v R / T (y/H + (x - 1/2) / (W H)), solved for x.
        let (rate, (w, h)) = (v * readout_time_s / T, (W as f32, H as f32));
        let want = (EDGE_X + rate * (y as f32 / h - 0.5 / (w * h))) / (1.0 - rate / (w * h));
        worst = worst.max((red_edge(&radiance, y) - want).abs());
        control = control.max((red_edge(&without, y) - want).abs());
    }
    assert!(worst < TOLERANCE_PX, "off by {worst} px");
    assert!(control > 100.0 * TOLERANCE_PX, "control: time by line alone passes, {control} px");
}

#[test]
fn half_a_frame_earlier_leaves_the_middle_line_where_it_is() {
    let p = Push { start_s: -0.5 * T, readout_time_s: T, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &bars(), &[constant_motion([20.0, 0.0])]);
    assert_eq!(red_edge(&radiance, H / 2), EDGE_X, "f - 1/2 is 0 in the middle");
    assert!((red_edge(&radiance, 0) - (EDGE_X - 10.0)).abs() < TOLERANCE_PX);
    let published = paper_gather(&Push { start_s: 0.0, ..p }, &bars(), &[constant_motion([20.0, 0.0])]);
    assert!((red_edge(&published, H / 2) - EDGE_X).abs() > 9.0, "control: f itself is 1/2 there");
}

/// Numbers without pattern, -1 to 1.
fn scattered(x: usize, y: usize, k: usize) -> f32 {
    let h = (x * 374_761_393 + y * 668_265_263 + k * 2_147_483_647) % 1_000_003;
    (h * h % 1_000_003) as f32 / 500_001.5 - 1.0
}

fn mirrored(plane: &Plane<f32>, axis: usize, motion: bool) -> Plane<f32> {
    let (w, h) = (plane.width, plane.height);
    let mut out = plane.clone();
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        let (sx, sy) = if axis == 0 { (w - 1 - x, y) } else { (x, h - 1 - y) };
        out.pixel_mut(x, y).copy_from_slice(plane.pixel(sx, sy));
        if motion {
            out.pixel_mut(x, y)[axis] *= -1.0;
        }
    }
    out
}

fn worst_difference(a: &Plane<f32>, b: &Plane<f32>) -> f32 {
    a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_frame() {
    let color =
        picture(|x, y| [0.1, 0.13, 0.17, 0.0].map(|f| 0.5 + 0.4 * (f * x).sin() * (f * y + 1.0).cos()));
    let motion: Vec<Plane<f32>> = (0..3)
        .map(|k| {
            picture(|x, y| [0.11, 0.07, 0.0, 0.0].map(|f| 9.0 * (f * (x + 2.0 * y)).sin() + 4.0 * k as f32))
        })
        .map(|p| Plane::from_fn(p.width, p.height, |x, y| [p.pixel(x, y)[0], p.pixel(x, y)[1]]))
        .collect();
    use ScanOrder::{BottomToTop, LeftToRight, RightToLeft, TopToBottom};
    for order in ScanOrder::ALL {
        let p = |order| Push {
            readout_time_s: 0.8 * T,
            exposure_time_s: 0.5 * T,
            first_motion_s: -0.2 * T,
            motion_step_s: 0.6 * T,
            motion_count: 3,
            ..push(order)
        };
        let plain = paper_gather(&p(order), &color, &motion);
        for axis in 0..2 {
            let opposite = match (order, axis) {
                (TopToBottom, 1) => BottomToTop,
                (BottomToTop, 1) => TopToBottom,
                (LeftToRight, 0) => RightToLeft,
                (RightToLeft, 0) => LeftToRight,
                _ => order,
            };
            let turned: Vec<_> = motion.iter().map(|m| mirrored(m, axis, true)).collect();
            let color = mirrored(&color, axis, false);
            let got = paper_gather(&p(opposite), &color, &turned);
            let worst = worst_difference(&got, &mirrored(&plain, axis, false));
            assert!(worst < 1e-4, "{order}, axis {axis}: {worst}");
            let unturned: Vec<_> = motion.iter().map(|m| mirrored(m, axis, false)).collect();
            let wrong = worst_difference(
                &paper_gather(&p(opposite), &color, &unturned),
                &mirrored(&plain, axis, false),
            );
            assert!(wrong > 0.05, "control: motion that was not turned passes, {wrong}");
        }
    }
}

/// A step from 0 to 1 at x = 40.
fn step() -> Plane<f32> {
    picture(|x, y| [f32::from(x > EDGE_X), 0.0, f32::from(y > EDGE_Y), 1.0])
}

/// Farthest that the values of red lie from the ramp that an edge leaves while it moves from e + v s/T to
/// e + v (s + exposure)/T, s = start of the row.
fn worst_ramp(radiance: &Plane<f32>, p: &Push, v: f32, exposure_time_s: f32) -> f32 {
    let mut worst = 0.0_f32;
    for y in 0..H {
        let s = p.start_s + p.readout_time_s * y as f32 / H as f32;
        let (from, length) = (EDGE_X + v * s / T, v * exposure_time_s / T);
        for x in 0..W {
            let want = ((x as f32 + 0.5 - from) / length).clamp(0.0, 1.0);
            let want = if length < 0.0 { 1.0 - want } else { want };
            worst = worst.max((radiance.pixel(x, y)[0] - want).abs());
        }
    }
    worst
}

#[test]
fn a_blurred_edge_is_the_ramp_of_its_path() {
    for (v, exposure_time_s, readout_time_s) in
        [(24.0, 0.5 * T, 0.0), (24.0, 0.5 * T, 0.75 * T), (-16.0, T, 0.5 * T), (240.0, 0.125 * T, 0.03 * T)]
    {
        let p = Push { exposure_time_s, readout_time_s, ..push(ScanOrder::TopToBottom) };
        let radiance = paper_gather(&p, &step(), &[constant_motion([v, 0.0])]);
        // Every sample shows the edge as a bilinear ramp of 1 px; on a path of whole px they lie 1 px apart, so the
        // ramps join without steps and the closed form is exact.
        let worst = worst_ramp(&radiance, &p, v, exposure_time_s);
        assert!(worst < 1e-3, "{v} px a frame: {worst}");
        let count = (v * exposure_time_s / T).abs().round();
        assert!(radiance.data.chunks(4).all(|p| p[3] == count), "{count} samples, none outside the margin");
        for (name, wrong) in [
            ("half the length", worst_ramp(&radiance, &p, v, 0.5 * exposure_time_s)),
            ("the wrong sign", worst_ramp(&radiance, &p, -v, exposure_time_s)),
            (
                "centred",
                worst_ramp(&radiance, &Push { start_s: -0.5 * exposure_time_s, ..p }, v, exposure_time_s),
            ),
        ] {
            assert!(wrong > 0.1, "control: {name} passes, {wrong}");
        }
    }
}

#[test]
fn energy_is_kept() {
    let blob = picture(|x, y| {
        let r2 = (x - 47.3).powi(2) + (y - 31.8).powi(2);
        [50.0 * (-r2 / 8.0).exp(), (-r2 / 2.0).exp(), 1.0, 1.0]
    });
    let energy = |plane: &Plane<f32>, c: usize| plane.data.chunks(4).map(|p| f64::from(p[c])).sum::<f64>();
    // Rows are sheared against each other, which keeps every row's sum; a vertical motion alone would stretch.
    let p = Push { readout_time_s: 0.6 * T, exposure_time_s: 0.45 * T, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &blob, &[constant_motion([31.0, 0.0])]);
    let global = Push { readout_time_s: 0.0, ..p };
    let diagonal = paper_gather(&global, &blob, &[constant_motion([-21.0, 17.0])]);
    for c in 0..2 {
        for frame in [&radiance, &diagonal] {
            let ratio = energy(frame, c) / energy(&blob, c);
            assert!((ratio - 1.0).abs() < 1e-4, "channel {c}: {ratio}");
        }
    }
    let stretched = paper_gather(&p, &blob, &[constant_motion([0.0, 31.0])]);
    let ratio = energy(&stretched, 0) / energy(&blob, 0);
    assert!((ratio - 1.0).abs() > 0.1, "control: the rolling shutter stretches along the readout, {ratio}");
}

#[test]
fn a_change_of_speed_bends_the_bar_as_the_quadratic_predicts() {
    let (v0, v1) = (4.0, 30.0);
    let motion = [constant_motion([v0, 0.0]), constant_motion([v1, 0.0])];
    let p = Push { readout_time_s: T, motion_count: 2, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &bars(), &motion);
    let (mut worst, mut linear) = (0.0_f32, 0.0_f32);
    for y in 0..H {
        let f = y as f32 / H as f32;
        // Eq. 4 in eq. 7: f (f curr + (1 - f) prev).
        worst = worst.max((red_edge(&radiance, y) - (EDGE_X + f * (f * v1 + (1.0 - f) * v0))).abs());
        linear = linear.max((red_edge(&radiance, y) - (EDGE_X + f * v1)).abs());
    }
    assert!(worst < TOLERANCE_PX, "off by {worst} px");
    assert!(linear > 5.0, "control: a straight bar passes, {linear} px");
}

#[test]
fn blur_under_acceleration_has_the_profile_of_the_time_spent() {
    // Global shutter, from rest to 40 px a frame: at time u the edge is at e + 20 (u/T)^2, so the share of time before
    // it reached e + d is sqrt(d / 20).
    let motion = [constant_motion([0.0, 0.0]), constant_motion([40.0, 0.0])];
    let p = Push { exposure_time_s: T, motion_count: 2, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &step(), &motion);
    assert_eq!(radiance.pixel(10, 10)[3], 20.0, "a path of 20 px");
    let (mut worst, mut linear) = (0.0_f32, 0.0_f32);
    for x in 0..W {
        let share = ((x as f32 + 0.5 - EDGE_X) / 20.0).clamp(0.0, 1.0);
        let got = radiance.pixel(x, 7)[0];
        worst = worst.max((got - share.sqrt()).abs());
        linear = linear.max((got - share).abs());
    }
    // Twenty samples are half a step, 1/40, apart from the continuous share; the edge's own px adds as much at the
    // start.
    assert!(worst < 0.06, "off by {worst}");
    assert!(linear > 0.2, "control: constant speed passes, {linear}");
}

#[test]
fn blur_follows_the_motion_at_the_remapped_place() {
    // Left of x = 48 content moves by 12 px a frame, from there on by 32.
    let motion = picture(|x, _| [if x < 48.0 { 12.0 } else { 32.0 }, 0.0, 0.0, 0.0]);
    let motion = Plane::from_fn(motion.width, motion.height, |x, y| [motion.pixel(x, y)[0], 0.0]);
    let p = Push { start_s: 0.5 * T, exposure_time_s: 0.5 * T, ..push(ScanOrder::TopToBottom) };
    let radiance = paper_gather(&p, &step(), &[motion]);
    for x in 0..W {
        let centre = x as f32 + 0.5;
        let remapped = centre - 0.5 * if centre < 48.0 { 12.0 } else { 32.0 };
        let want = if remapped < 48.0 { 6.0 } else { 16.0 };
        assert_eq!(radiance.pixel(x, 3)[3], want, "samples at {x}");
    }
    // Control: the motion at the pixel itself would be another one for x in 48..64.
    assert_eq!(radiance.pixel(50, 3)[3], 6.0);
}

#[test]
fn neutral_parameters_return_the_input_bit_for_bit() {
    for (w, h, margin) in [(1, 1, 0), (7, 5, 0), (33, 19, 3)] {
        let (iw, ih) = (w + 2 * margin, h + 2 * margin);
        let color = Plane::from_fn(iw, ih, |x, y| {
            [scattered(x, y, 0) * 1e6, scattered(x, y, 1), -0.0, scattered(x, y, 2) * 1e-20]
        });
        let motion: Vec<_> = (0..2)
            .map(|k| Plane::from_fn(iw, ih, |x, y| [90.0 * scattered(x, y, k), 90.0 * scattered(y, x, k)]))
            .collect();
        for order in ScanOrder::ALL {
            let p = Push {
                size: [w as u32, h as u32],
                margin_px: [margin as i32; 2],
                motion_count: 2,
                pixel_time: 1,
                ..push(order)
            };
            let bits = |v: &[f32]| [0, 1, 2].map(|c| v[c].to_bits());
            let same = |p: &Push| {
                let radiance = paper_gather(p, &color, &motion);
                let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
                pixels.clone().all(|(x, y)| {
                    let got = radiance.pixel(x, y);
                    bits(got) == bits(color.pixel(x + margin, y + margin)) && got[3] == 1.0
                })
            };
            assert!(same(&p), "{w}x{h} {order}");
            assert!(!same(&Push { start_s: 1e-4, ..p }), "control: {w}x{h} {order} shifted");
            assert!(!same(&Push { exposure_time_s: 1e-3, ..p }), "control: {w}x{h} {order} exposed");
        }
    }
}

#[test]
fn a_margin_that_is_too_small_shows_in_the_sign_of_alpha() {
    let p = Push { exposure_time_s: T, ..push(ScanOrder::TopToBottom) };
    let reach = MARGIN as f32;
    let inside = paper_gather(&p, &step(), &[constant_motion([reach, 0.0])]);
    assert!(inside.data.chunks(4).all(|p| p[3] == reach));
    let outside = paper_gather(&p, &step(), &[constant_motion([reach + 8.0, 0.0])]);
    // The path's farthest sample lies half a sample before its end.
    for x in 0..W {
        let left = x as f32 + 0.5 - (reach + 7.5) < 0.5 - MARGIN as f32;
        assert_eq!(outside.pixel(x, 5)[3], if left { -(reach + 8.0) } else { reach + 8.0 }, "column {x}");
    }
}
