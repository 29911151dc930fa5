//! Each fault is named, and what a camera does is not taken for one.

use super::set_up;
use crate::diagnose::evidence::{Evidence, RealFrame};
use shutterbug::plane::{Plane, srgb_decode, srgb_encode};

const SIZE: [usize; 2] = [160, 120];

/// A view of coloured patches that moves on from frame to frame, DN.
fn frame(at: usize, scene: u32) -> Plane<f32> {
    Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
        let (u, v) = ((x + 5 * at) / 12, (y + 2 * at) / 10);
        // Neighbouring numbers must not give alike patches, or frames of other times resemble each other.
        let roll = |c: u64| {
            let mut z = (u as u64) << 40 | (v as u64) << 20 | u64::from(scene) << 4 | c;
            z = (z ^ (z >> 30)).wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / (1u32 << 24) as f32
        };
        // Warm colours: red and blue can be told apart.
        [30.0 + 190.0 * roll(0), 20.0 + 140.0 * roll(1), 10.0 + 90.0 * roll(2)]
    })
}

fn simulated(count: usize) -> Vec<Plane<f32>> {
    (0..count).map(|i| frame(i, 1)).collect()
}

fn said(real: Vec<Plane<f32>>) -> String {
    let simulated = simulated(real.len());
    said_beside(&simulated, real)
}

fn said_beside(simulated: &[Plane<f32>], real: Vec<Plane<f32>>) -> String {
    let frames = real.into_iter().enumerate();
    let evidence = Evidence {
        frames: frames.map(|(index, dn)| RealFrame { index, start_s: index as f64, dn: dn.into() }).collect(),
        ..Evidence::of_one(Plane::new(1, 1, 3))
    };
    set_up(&evidence, simulated, |_| Ok(None)).unwrap().join(" | ")
}

fn changed(f: impl Fn(&Plane<f32>, usize, usize) -> [f32; 3]) -> Vec<Plane<f32>> {
    simulated(12).iter().map(|p| Plane::from_fn(SIZE[0], SIZE[1], |x, y| f(p, x, y))).collect()
}

fn per_value(f: impl Fn(f32) -> f32) -> Vec<Plane<f32>> {
    changed(|p, x, y| [0, 1, 2].map(|c| 255.0 * f(p.pixel(x, y)[c] / 255.0)))
}

fn at(p: &Plane<f32>, x: usize, y: usize) -> [f32; 3] {
    [0, 1, 2].map(|c| p.pixel(x, y)[c])
}

#[test]
fn what_a_camera_does_is_no_fault_of_the_set_up() {
    let lin = |v: f32, gain: f32| srgb_encode((gain * srgb_decode(v)).min(1.0));
    let cameras = [
        ("nothing", simulated(12)),
        (
            // What is nearer changes with the camera's speed.
            "about one and a half frames late",
            (0..12)
                .map(|i| {
                    let near = frame(i + 1 + i % 2, 1);
                    let data = near.data.iter().map(|v| v + 0.02 * i as f32).collect();
                    Plane { data, ..near }
                })
                .collect(),
        ),
        ("a gain of 0.3", per_value(|v| lin(v, 0.3))),
        ("a gain of 2.5", per_value(|v| lin(v, 2.5))),
        ("a veil and a gain", per_value(|v| srgb_encode(0.86 * (0.97 * srgb_decode(v) + 0.006)))),
        ("a black level", per_value(|v| srgb_encode(0.01 + 0.99 * srgb_decode(v)))),
        ("an exponent of 1.42", per_value(|v| v.powf(1.42))),
        ("an exponent of 0.7", per_value(|v| v.powf(0.7))),
        (
            "white balance",
            changed(|p, x, y| {
                let [r, g, b] = at(p, x, y);
                [255.0 * lin(r / 255.0, 0.6), g, 255.0 * lin(b / 255.0, 1.8)]
            }),
        ),
        (
            "half a frame late",
            (0..12)
                .map(|i| {
                    let [a, b] = [frame(i, 1), frame(i + 1, 1)];
                    let data = a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect();
                    Plane { data, ..a }
                })
                .collect(),
        ),
        (
            "one and a half frames late",
            (0..12)
                .map(|i| {
                    let [a, b] = [frame(i + 1, 1), frame(i + 2, 1)];
                    let data = a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect();
                    Plane { data, ..a }
                })
                .collect(),
        ),
        ("noise", changed(|p, x, y| at(p, x, y).map(|v| v + ((x * 7919 + y * 104_729) % 61) as f32 - 30.0))),
    ];
    for (name, real) in cameras {
        assert_eq!(said(real), "", "{name}");
    }
}

/// Of few frames, one resembles no other time by far better than its own.
#[test]
fn a_delay_of_nearly_two_frames_drops_none() {
    let late = |i: usize| {
        let [a, b] = [frame(i + 1 + usize::from(i > 0), 1), frame(i + 2, 1)];
        let data = a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect();
        Plane { data, ..a }
    };
    assert_eq!(said((0..8).map(late).collect()), "");
    let dropped = said((0..8).map(|i| frame(if i == 0 { 0 } else { i + 2 }, 1)).collect());
    assert!(dropped.contains("from frame 1 on"), "control: {dropped}");
}

/// A contrast does to some scenes nearly what a stretch from 16 to 235, or none, does.
#[test]
fn a_strong_contrast_is_no_limited_range() {
    for (from, to, contrast) in
        [(110.0, 200.0, -0.45), (110.0, 210.0, -0.6), (60.0, 100.0, 0.3), (10.0, 220.0, 0.6)]
    {
        let scene = changed(|p, x, y| [from + (at(p, x, y)[0] - 30.0) / 190.0 * (to - from); 3]);
        let bend = |v: f32| v + contrast * v * (1.0 - v / 255.0) * (2.0 * v / 255.0 - 1.0);
        let bent =
            scene.iter().map(|p| Plane { data: p.data.iter().map(|v| bend(*v)).collect(), ..*p }).collect();
        assert_eq!(said_beside(&scene, bent), "", "{from} to {to}, {contrast}");
    }
}

#[test]
fn frames_that_lie_otherwise_are_told() {
    let [w, h] = SIZE;
    for (real, word) in [
        (changed(|p, x, y| at(p, w - 1 - x, y)), "mirrored, left for right"),
        (changed(|p, x, y| at(p, x, h - 1 - y)), "upside down"),
        (changed(|p, x, y| at(p, w - 1 - x, h - 1 - y)), "turned by 180 degrees"),
        (
            changed(|p, x, y| if (12..108).contains(&y) { at(p, x, y) } else { [0.0; 3] }),
            "black bars (top, bottom)",
        ),
        (changed(|p, x, y| at(p, 16 + x * 8 / 10, 12 + y * 8 / 10)), "cut and enlarged"),
    ] {
        let said = said(real);
        assert!(said.contains(word), "{word}: {said}");
    }
}

fn in_order(pixel: [f32; 3], order: [usize; 3]) -> [f32; 3] {
    order.map(|c| pixel[c])
}

#[test]
fn values_that_mean_something_else_are_told() {
    let grey = |p: &Plane<f32>, x: usize, y: usize| [(at(p, x, y).iter().sum::<f32>() / 3.0).round(); 3];
    for (real, word) in [
        (per_value(srgb_decode), "linear (raw)"),
        (per_value(srgb_encode), "encoded twice"),
        (per_value(|v| (16.0 + 219.0 * v) / 255.0), "in limited range"),
        (per_value(|v| (255.0 * v - 16.0).max(0.0) / 219.0), "stretched from limited range"),
        (per_value(|v| 1.0 - v), "negatives"),
        (changed(|p, x, y| in_order(at(p, x, y), [2, 1, 0])), "(BGR for RGB)"),
        (changed(|p, x, y| in_order(at(p, x, y), [1, 0, 2])), "(GRB for RGB)"),
        (changed(|p, x, y| in_order(at(p, x, y), [0, 2, 1])), "(RBG for RGB)"),
        (changed(|p, x, y| in_order(at(p, x, y), [1, 2, 0])), "(GBR for RGB)"),
        (changed(|p, x, y| in_order(at(p, x, y), [2, 0, 1])), "(BRG for RGB)"),
        (changed(grey), "grey"),
    ] {
        let said = said(real);
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn frames_of_other_times_are_told() {
    let real = |of: &dyn Fn(usize) -> usize| (0..12).map(|i| frame(of(i), 1)).collect::<Vec<_>>();
    for (real, word) in [
        (real(&|i| i + 1), "shows 1 frame later"),
        (real(&|i| i + 3), "shows 3 frames later"),
        (real(&|i| i.saturating_sub(2)), "shows 2 frames earlier"),
        (real(&|i| 11 - i), "reverse order"),
        (real(&|i| i / 2), "twice"),
        (real(&|i| if i < 6 { i } else { i + 1 }), "from frame 6 on"),
        (real(&|i| if i == 5 { 4 } else { i }), "real frame 5 is a copy"),
        (real(&|_| 4), "one and the same"),
        (real(&|i| (i * 5 + 3) % 12), "out of order"),
        (real(&|i| (i * 4 / 3).min(11)), "in order"),
    ] {
        let said = said(real);
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn a_frame_of_another_scene_is_told_by_its_number() {
    for place in [0, 7, 11] {
        let mut real = simulated(12);
        real[place] = frame(40, 9);
        let said = said(real);
        assert!(said.contains(&format!("real frame {place} shows another scene")), "{said}");
    }
}
