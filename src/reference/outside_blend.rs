//! A frame from several pictures: every line from the three that are nearest to it in time. Twin of
//! `glsl/outside_blend.comp`.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::fused::fused;
use super::timing::readout_fraction;
use crate::plane::Plane;

/// The kernel's parameters.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Those of the pictures, margin included.
    pub texels: [i32; 2],
    /// Pictures that there are: 2 or 3.
    pub pictures: u32,
    /// A [`super::timing::scan_order_code`].
    pub scan_order: u32,
    /// Middle of the first line's exposure, s.
    pub middle_s: f32,
    /// N times the delay from line to line, s.
    pub readout_time_s: f32,
    /// The lines whose middle lies from here on are made of these pictures, s.
    pub from_s: f32,
    /// And before this.
    pub to_s: f32,
    /// The first pixel that the kernel looks at: none before it is of these lines.
    pub first: [u32; 2],
}

/// Writes the lines that these pictures make. `warped`: what each shows of a pixel, a colour and what it counts, or,
/// where the fourth number is below 0, the place in it; `colors`: the pictures. Planes of four channels.
///
/// # Panics
/// If a shape does not fit.
pub fn outside_blend(
    push: &Push,
    warped: [&Plane<f32>; 3],
    colors: [&Plane<f32>; 3],
    radiance: &mut Plane<f32>,
) {
    let [width, height] = push.size.map(|s| s as usize);
    assert_eq!((radiance.width, radiance.height), (width, height), "radiance");
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let fraction = readout_fraction([x as u32, y as u32], push.size, push.scan_order, false);
        let at_s = push.middle_s + push.readout_time_s * fraction;
        if at_s < push.from_s || at_s >= push.to_s {
            continue;
        }
        let shown = (0..push.pictures as usize).map(|k| (warped[k].pixel(x, y), colors[k]));
        let place = |(shown, color)| (color, Vec2::from_slice(shown));
        let places: Vec<(&Plane<f32>, Vec2)> =
            shown.clone().filter(|(shown, _)| shown[3] < 0.0).map(place).collect();
        let seen = match places.as_slice() {
            [] => {
                let weights: f32 = shown.clone().map(|(s, _)| s[3]).sum();
                shown.map(|(s, _)| s[3] * Vec3::from_slice(s)).sum::<Vec3>() / weights.max(1e-12)
            }
            several => fused(several),
        };
        radiance.pixel_mut(x, y).copy_from_slice(&seen.extend(1.0).to_array());
    }
}
