//! The lens as the vertex stage wants it.

use bytemuck::{Pod, Zeroable};

use crate::camera::{Distortion, ExtendedLens};

/// `Lens` of `lens.glsl`, explained there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LensPush {
    scale: [f32; 2],
    centre: [f32; 2],
    k12: [f32; 2],
    k34: [f32; 2],
    k56: [f32; 2],
    p: [f32; 2],
    radius: f32,
    slope: f32,
    magnification: f32,
    model: u32,
}

impl LensPush {
    /// The pinhole.
    pub const NONE: Self = Self {
        scale: [1.0; 2],
        centre: [0.0; 2],
        k12: [0.0; 2],
        k34: [0.0; 2],
        k56: [0.0; 2],
        p: [0.0; 2],
        radius: 0.0,
        slope: 1.0,
        magnification: 1.0,
        model: 0,
    };

    /// Whether there is a lens: its place in pairs of kernels that are compiled without and with one.
    pub fn index(&self) -> usize {
        usize::from(self.model != 0)
    }

    /// A lens on a picture of `size`, which has as much margin on the left as on the right and above as below, drawn
    /// `magnification` times larger about (cx, cy).
    pub fn new(lens: &ExtendedLens, size: [u32; 2], magnification: f64) -> Self {
        let camera = lens.lens().intrinsics();
        let margin_px = [(size[0] - camera.width) / 2, (size[1] - camera.height) / 2];
        let k = camera.with_margin(margin_px);
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let single = |pair: [f64; 2]| pair.map(|v| v as f32);
        // The values of `LENS_...` in `lens.glsl`; k1 to k6.
        let (model, coefficients, p) = match *lens.lens().distortion() {
            Distortion::None => (1, [0.0; 6], [0.0; 2]),
            Distortion::BrownConrady { k: [k1, k2, k3], p } => (1, [k1, k2, k3, 0.0, 0.0, 0.0], p),
            Distortion::Equidistant { k: [k1, k2, k3, k4] } => (2, [k1, k2, k3, k4, 0.0, 0.0], [0.0; 2]),
            Distortion::Rational { k, p } => (3, k, p),
            Distortion::Division { k1 } => (4, [k1, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
        };
        let [k1, k2, k3, k4, k5, k6] = coefficients;
        Self {
            scale: single([2.0 * k.fx / w, 2.0 * k.fy / h]),
            centre: single([2.0 * k.cx / w - 1.0, 2.0 * k.cy / h - 1.0]),
            k12: single([k1, k2]),
            k34: single([k3, k4]),
            k56: single([k5, k6]),
            p: single(p),
            radius: lens.radius() as f32,
            slope: lens.slope() as f32,
            magnification: magnification as f32,
            model,
        }
    }
}
