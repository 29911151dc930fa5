//! The pixel chain on the CPU: the references of the effects, one after another, over a whole picture. Twin of
//! `glsl/pointwise.comp` and of the order in which `engine/finish.rs` dispatches.

use rayon::prelude::*;

use crate::chain::{At, Effect, Packed, Settings, View, Work, slot_of};
use crate::effects::BayerMosaic;
use crate::plane::Plane;

/// The delivered picture, shape `[height, width, 3]`.
///
/// `radiance`: linear, shape `[height, width, 4]` (the fourth channel is passed through).
///
/// # Panics
/// If the radiance has another shape than `view.intrinsics`.
pub fn picture(list: &[&dyn Effect], settings: &Settings, view: &View, radiance: &Plane<f32>) -> Plane<u8> {
    let encoded = values(list, settings, view, radiance);
    let pixels = encoded.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
    let data = pixels.map(quantize8).collect();
    let mut picture = Plane { width: encoded.width, height: encoded.height, channels: 3, data };
    develop_on_host(list, settings, &mut picture);
    picture
}

/// Encoded value, clipped to 0..1, to 8 bits; NaN becomes black.
pub fn quantize8(encoded: f32) -> u8 {
    let v = if encoded > 0.0 { encoded.min(1.0) } else { 0.0 };
    (255.0 * v + 0.5) as u8
}

/// The effects that act on the delivered picture, shape `[height, width, 3]`.
pub fn develop_on_host(list: &[&dyn Effect], settings: &Settings, picture: &mut Plane<u8>) {
    for effect in list.iter().filter(|e| e.variant(settings) != 0) {
        if let Work::Host(apply) = effect.work() {
            apply(picture, settings);
        }
    }
}

/// Encoded values before they are rounded to 8 bits, shape `[height, width, 4]`.
///
/// # Panics
/// As for [`picture`].
pub fn values(list: &[&dyn Effect], settings: &Settings, view: &View, radiance: &Plane<f32>) -> Plane<f32> {
    through(list, list.len(), (settings, view), radiance)
}

/// What the converter delivers of each pixel behind its filter, shape `[height, width, 1]`; `None` without a mosaic.
///
/// # Panics
/// As for [`picture`].
pub fn raw(
    list: &[&dyn Effect],
    settings: &Settings,
    view: &View,
    radiance: &Plane<f32>,
) -> Option<Plane<f32>> {
    let sensor = list.iter().position(|e| e.fills_mosaic())?;
    BayerMosaic::raw(settings, &through(list, sensor, (settings, view), radiance))
}

/// What the first effects of a list make.
fn through(
    list: &[&dyn Effect],
    first: usize,
    (settings, view): (&Settings, &View),
    radiance: &Plane<f32>,
) -> Plane<f32> {
    let size = (view.intrinsics.width as usize, view.intrinsics.height as usize);
    assert_eq!(((radiance.width, radiance.height), radiance.channels), (size, 4), "radiance");
    let packed = Packed::new(list, settings, view);
    let mut current = radiance.clone();
    for effect in &list[..first] {
        let variant = effect.variant(settings);
        let parameters = packed.parameters(slot_of(list, effect.id()));
        match effect.work() {
            _ if variant == 0 => {}
            Work::Pointwise(function) => {
                // The source is the picture before the fused kernel; only effects that read neighbours look at it, and
                // those are the first of their kernel.
                let source =
                    if effect.reads_neighbours(settings) { current.clone() } else { Plane::new(0, 0, 4) };
                let width = current.width;
                current.data.par_chunks_exact_mut(4).enumerate().for_each(|(i, rgba)| {
                    let pixel = [(i % width) as u32, (i / width) as u32];
                    let at = At { pixel, view, source: &source, variant };
                    let seen = function([rgba[0], rgba[1], rgba[2]], &at, &parameters);
                    rgba[..3].copy_from_slice(&seen);
                });
            }
            Work::Neighbourhood { reference, .. } => current = reference(&current, settings, &parameters),
            Work::Elsewhere | Work::Host(_) => {}
        }
    }
    current
}
