//! Frames that lie otherwise than the simulation's: mirrored, turned, with bars, cut and enlarged.

use super::Pairs;
use super::thumbs::Thumb;
use shutterbug::plane::Plane;

/// Unlikeness from which on frames do not fit as they are, and below which they do when changed.
pub(super) const UNLIKE: f64 = 0.25;
/// What a change must leave of the unlikeness to be the reason for it.
pub(super) const LEFT: f64 = 0.3;

/// Mirrored, upside down, or turned by half a turn.
pub(super) fn turned(pairs: &Pairs) -> Option<String> {
    let as_is = pairs.unlike(Thumb::clone);
    let tried = [
        ("mirrored, left for right", [true, false]),
        ("upside down (mirrored, top for bottom)", [false, true]),
        ("turned by 180 degrees", [true, true]),
    ];
    let best = tried.map(|(name, flip)| (pairs.unlike(|s| s.with(flipped(&s.dn, flip))), name));
    let (left, name) = best.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    (as_is > UNLIKE && left < UNLIKE && left < LEFT * as_is).then(|| {
        format!(
            "the real frames look {name}: so changed they resemble the simulation, as they are they do not"
        )
    })
}

fn flipped(plane: &Plane<f32>, [across, down]: [bool; 2]) -> Plane<f32> {
    Plane::from_fn(plane.width, plane.height, |x, y| {
        let from = plane
            .pixel(if across { plane.width - 1 - x } else { x }, if down { plane.height - 1 - y } else { y });
        [from[0], from[1], from[2]]
    })
}

/// Cut and enlarged about the middle, or the other way round. What is less than a tenth is a focal length.
pub(super) fn zoomed(pairs: &Pairs) -> Option<String> {
    let as_is = pairs.unlike(Thumb::clone);
    let scales = (0..=24).map(|i| 0.6 * 1.04f64.powi(i)).filter(|s| !(0.9..1.1).contains(s));
    let tried = scales.map(|s| (pairs.unlike(|t| t.with(zoom(&t.dn, s))), s));
    let (left, scale) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if as_is < 0.02 || left > LEFT * as_is {
        return None;
    }
    let how = if scale > 1.0 { "cut and enlarged" } else { "scaled down" };
    Some(format!(
        "the real frames look {how}: the simulation resembles them when it is scaled by about {scale:.2} about its \
         middle, so the size, the focal length or the principal point of camera.toml may be those of another mode of \
         the camera"
    ))
}

fn zoom(plane: &Plane<f32>, scale: f64) -> Plane<f32> {
    let read = |at: usize, size: usize| {
        let middle = 0.5 * size as f64;
        (((at as f64 + 0.5 - middle) / scale + middle - 0.5).clamp(0.0, (size - 1) as f64)) as f32
    };
    Plane::from_fn(plane.width, plane.height, |x, y| {
        let (fx, fy) = (read(x, plane.width), read(y, plane.height));
        let (x0, y0) = (fx as usize, fy as usize);
        let (x1, y1) = ((x0 + 1).min(plane.width - 1), (y0 + 1).min(plane.height - 1));
        let (dx, dy) = (fx - x0 as f32, fy - y0 as f32);
        [0, 1, 2].map(|c| {
            let at = |x: usize, y: usize| plane.pixel(x, y)[c];
            let top = at(x0, y0) * (1.0 - dx) + at(x1, y0) * dx;
            top * (1.0 - dy) + (at(x0, y1) * (1.0 - dx) + at(x1, y1) * dx) * dy
        })
    })
}

/// Black bars at the edges of all real frames, where the simulation has something.
pub(super) fn bars(pairs: &Pairs) -> Option<String> {
    let first = &pairs.real.first()?.dn;
    let (width, height) = (first.width, first.height);
    let line = |of: &[Thumb], rows: bool, at: usize| {
        let brightest = |t: &Thumb| {
            let count = if rows { width } else { height };
            let value = |i: usize| {
                let pixel = if rows { t.dn.pixel(i, at) } else { t.dn.pixel(at, i) };
                pixel.iter().copied().fold(0.0, f32::max)
            };
            (0..count).map(value).fold(0.0, f32::max)
        };
        of.iter().map(brightest).fold(0.0, f32::max)
    };
    let black =
        |rows: bool, at: usize| line(&pairs.real, rows, at) < 6.0 && line(&pairs.simulated, rows, at) > 24.0;
    let from_start = |rows: bool, n: usize| (0..n).take_while(|&at| black(rows, at)).count();
    let from_end = |rows: bool, n: usize| (0..n).rev().take_while(|&at| black(rows, at)).count();
    let ends =
        [from_start(true, height), from_end(true, height), from_start(false, width), from_end(false, width)];
    let names = ["top", "bottom", "left", "right"];
    let found: Vec<_> = names.iter().zip(ends).filter(|(_, n)| *n > 0).map(|(name, _)| *name).collect();
    let all_black = ends[0] >= height || ends[2] >= width;
    (!found.is_empty() && !all_black).then(|| {
        format!(
            "the real frames have black bars ({}): the picture inside is smaller than camera.toml says",
            found.join(", ")
        )
    })
}
