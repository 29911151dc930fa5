//! Values that mean something else: linear, encoded twice, in limited range, colours in another order, no colours, a
//! negative.

use super::Pairs;
use super::thumbs::{Thumb, apart};
use shutterbug::plane::stats::median;
use shutterbug::plane::{Plane, srgb_decode, srgb_encode};

/// Difference from which on the question is asked, DN.
const LEAST_DN: f64 = 5.0;
/// What another meaning must leave of the difference.
const LEFT: f64 = 0.35;
/// What it must leave of what one gain a colour leaves, and of what a contrast does: brightness, white balance and
/// contrast are a camera's.
const LEFT_OF_CAMERA: f64 = 0.5;

/// Frames without colours of a scene that has some.
pub(super) fn grey(pairs: &Pairs) -> Option<String> {
    let colour = |t: &Thumb| {
        let spread = |p: &[f32]| f64::from(p[0].max(p[1]).max(p[2]) - p[0].min(p[1]).min(p[2]));
        t.dn.data.chunks_exact(3).map(spread).sum::<f64>() / (t.dn.data.len() / 3).max(1) as f64
    };
    let of = |all: &[Thumb]| median(all.iter().map(colour));
    (of(&pairs.real) < 0.75 && of(&pairs.simulated) > 6.0).then(|| {
        "the real frames are grey, the simulation has colours: the camera, or what read it, drops them"
            .to_owned()
    })
}

/// How values may have been meant.
type Reading<'a> = &'a dyn Fn(&Thumb) -> Plane<f32>;

/// Values under which the frames fit, if they do not as they are.
pub(super) fn coded(pairs: &Pairs) -> Option<String> {
    let as_is = pairs.median(|r, s| apart(&r.dn, &s.dn));
    if as_is < LEAST_DN {
        return None;
    }
    let tried: [(&str, Reading<'_>); 10] = [
        (
            "linear (raw) values, not sRGB: encode them, or they are taken for dark frames of high contrast",
            &|s| s.decoded.clone(),
        ),
        ("encoded twice: decode them once", &|s| s.encoded.clone()),
        ("read with red and blue swapped (BGR for RGB)", &|s| each(&s.dn, |p| [p[2], p[1], p[0]])),
        ("read with red and green swapped (GRB for RGB)", &|s| each(&s.dn, |p| [p[1], p[0], p[2]])),
        ("read with green and blue swapped (RBG for RGB)", &|s| each(&s.dn, |p| [p[0], p[2], p[1]])),
        ("read with their colours in turn (GBR for RGB)", &|s| each(&s.dn, |p| [p[1], p[2], p[0]])),
        ("read with their colours in turn (BRG for RGB)", &|s| each(&s.dn, |p| [p[2], p[0], p[1]])),
        ("like video in limited range (16 to 235) whose values were not stretched: stretch them", &|s| {
            each(&s.dn, |p| [0, 1, 2].map(|c| 16.0 + p[c] * 219.0 / 255.0))
        }),
        (
            "as if stretched from limited range (16 to 235) without having been in it: leave them as they are",
            &|s| each(&s.dn, |p| [0, 1, 2].map(|c| ((p[c] - 16.0) * 255.0 / 219.0).clamp(0.0, 255.0))),
        ),
        ("negatives", &|s| each(&s.dn, |p| [255.0 - p[0], 255.0 - p[1], 255.0 - p[2]])),
    ];
    let best = tried.map(|(name, change)| (pairs.median(|r, s| apart(&r.dn, &change(s))), name));
    let (left, name) = best.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let gains = pairs.median(|r, s| apart(&r.dn, &with_gains(&s.dn, &r.dn)));
    let contrast = pairs.median(|r, s| apart(&r.dn, &with_contrast(&s.dn, &r.dn)));
    (left < LEFT * as_is && left < LEFT_OF_CAMERA * gains.min(contrast)).then(|| {
        format!(
            "the real frames look {name} ({as_is:.1} DN from the simulation as they are, {left:.1} DN so)"
        )
    })
}

fn each(plane: &Plane<f32>, f: impl Fn(&[f32]) -> [f32; 3]) -> Plane<f32> {
    Plane::from_fn(plane.width, plane.height, |x, y| f(plane.pixel(x, y)))
}

/// With the gain of each colour, in linear light, that brings its mean to that of the other picture.
fn with_gains(plane: &Plane<f32>, to: &Plane<f32>) -> Plane<f32> {
    let linear = |p: &Plane<f32>, c: usize| {
        p.data.iter().skip(c).step_by(3).map(|v| srgb_decode((v / 255.0).clamp(0.0, 1.0))).sum::<f32>()
    };
    let gains = [0, 1, 2].map(|c| linear(to, c) / linear(plane, c).max(1e-6));
    each(plane, |p| {
        [0, 1, 2].map(|c| {
            255.0 * srgb_encode((gains[c] * srgb_decode((p[c] / 255.0).clamp(0.0, 1.0))).clamp(0.0, 1.0))
        })
    })
}

/// With the contrast (`tone_curve`) that brings it nearest to the other picture.
fn with_contrast(plane: &Plane<f32>, to: &Plane<f32>) -> Plane<f32> {
    let bend = |v: f32| 255.0 * (v / 255.0) * (1.0 - v / 255.0) * (2.0 * v / 255.0 - 1.0);
    let sum = |f: &dyn Fn(f32, f32) -> f32| {
        plane.data.iter().zip(&to.data).map(|(v, t)| f64::from(f(*v, *t))).sum::<f64>()
    };
    let contrast = sum(&|v, t| bend(v) * (t - v)) / sum(&|v, _| bend(v).powi(2)).max(1e-9);
    let data = plane.data.iter().map(|v| v + contrast as f32 * bend(*v)).collect();
    Plane { data, ..*plane }
}
