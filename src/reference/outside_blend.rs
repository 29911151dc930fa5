//! A frame from several pictures: the mean of what each of them shows, by what it is worth. Twin of `glsl/outside_blend.comp`.

use bytemuck::{Pod, Zeroable};

use crate::plane::Plane;

/// The kernel's parameters.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Bit 0: nothing was summed before; bit 1: nothing will be after.
    pub place: u32,
}

/// Adds what one picture shows (linear RGB, and what it counts) to the sums; with bit 1 of `place` they become the mean, and 1.
/// All of shape `[height, width, 4]`.
///
/// # Panics
/// If the shapes differ.
pub fn outside_blend(push: &Push, warped: &Plane<f32>, radiance: &mut Plane<f32>) {
    assert_eq!(warped.data.len(), radiance.data.len(), "pictures of different sizes");
    for (own, sum) in warped.data.chunks_exact(4).zip(radiance.data.chunks_exact_mut(4)) {
        let before = if push.place & 1 == 0 { [sum[0], sum[1], sum[2], sum[3]] } else { [0.0; 4] };
        for c in 0..4 {
            sum[c] = before[c] + if c < 3 { own[c] * own[3] } else { own[3] };
        }
        if push.place & 2 != 0 {
            let weight = sum[3].max(1e-12);
            sum[..3].iter_mut().for_each(|c| *c /= weight);
            sum[3] = 1.0;
        }
    }
}
