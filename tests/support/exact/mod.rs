//! A camera and its lenses, for kernels of `--method exact` and for their twins.
#![allow(dead_code, clippy::unwrap_used)]

use glam::{DVec2, Vec2, Vec4};
use shutterbug::camera::{Distortion, ExtendedLens, Intrinsics, Lens};
use shutterbug::raster::LensPush;

pub const CAMERA: Intrinsics = Intrinsics { width: 37, height: 23, fx: 40.0, fy: 40.0, cx: 18.5, cy: 11.5 };

/// A lens for kernel and twin: the push constants, and the map in double precision.
pub struct TestLens {
    pub push: LensPush,
    pub extended: Option<ExtendedLens>,
    size: Vec2,
}

impl TestLens {
    pub fn all(size: [u32; 2]) -> [Self; 5] {
        let pixels = Vec2::new(size[0] as f32, size[1] as f32);
        let k = Intrinsics {
            width: size[0],
            height: size[1],
            cx: 0.5 * f64::from(size[0]),
            cy: 0.5 * f64::from(size[1]),
            ..CAMERA
        };
        // A fisheye shows less than 90 degrees: longer where pictures are larger.
        let long = Intrinsics { fx: 1.5 * k.fx, fy: 1.5 * k.fy, ..k };
        let through = |k: Intrinsics, distortion: Distortion| {
            let extended = ExtendedLens::new(Lens::new(k, distortion).unwrap());
            Self { push: LensPush::new(&extended, size, 1.0), extended: Some(extended), size: pixels }
        };
        [
            Self { push: LensPush::NONE, extended: None, size: pixels },
            through(k, Distortion::BrownConrady { k: [-0.12, 0.02, 0.0], p: [1e-3, -2e-3] }),
            through(long, Distortion::Equidistant { k: [0.03, -0.01, 0.004, -0.001] }),
            through(long, Distortion::Rational { k: [0.3, 0.0, 0.0, 0.4, 0.02, 0.0], p: [1e-3, -2e-3] }),
            through(long, Distortion::Division { k1: -0.1 }),
        ]
    }

    fn camera(&self) -> Option<(&ExtendedLens, DVec2, DVec2)> {
        let lens = self.extended.as_ref()?;
        let k = lens.lens().intrinsics();
        let size = self.size.as_dvec2();
        let scale = 2.0 * DVec2::new(k.fx, k.fy) / size;
        Some((lens, scale, 2.0 * DVec2::new(k.cx, k.cy) / size - 1.0))
    }

    pub fn sensor(&self, clip: Vec4) -> Vec4 {
        let Some((lens, scale, centre)) = self.camera() else { return clip };
        let (xy, w) = (DVec2::new(clip.x.into(), clip.y.into()), f64::from(clip.w));
        let at = (xy - centre * w) / scale;
        // Behind the camera the map goes on in straight lines.
        let seen = match w > 0.0 {
            true => lens.sensor(at / w) * w,
            false => {
                let edge = at * (lens.radius() / at.length());
                (lens.sensor(edge) - lens.slope() * edge) * w + lens.slope() * at
            }
        };
        let ndc = (centre * w + scale * seen).as_vec2();
        Vec4::new(ndc.x, ndc.y, clip.z, clip.w)
    }

    pub fn ideal(&self, ndc: Vec2) -> Vec2 {
        let Some((lens, scale, centre)) = self.camera() else { return ndc };
        let seen = (ndc.as_dvec2() - centre) / scale;
        let mut at = seen;
        for _ in 0..200 {
            at += seen - lens.sensor(at);
        }
        (centre + scale * at).as_vec2()
    }
}
