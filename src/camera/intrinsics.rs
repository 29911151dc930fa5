//! The ideal pinhole: where a camera point falls on the picture.

use glam::{DMat4, DVec2, DVec3, DVec4};

/// Nearest distance along the optical axis at which geometry is drawn, m. Depth is reversed and infinite, so nothing
/// is lost in precision far away, and no far limit exists.
pub const NEAR_M: f64 = 0.01;

/// Size and pinhole parameters of a picture. Pixel (0, 0) is top left with its centre at (0.5, 0.5); a camera point
/// (x right, y down, z forward) falls on `(fx x / z + cx, fy y / z + cy)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Columns, px.
    pub width: u32,
    /// Rows, px.
    pub height: u32,
    /// Focal length over pixel width, px.
    pub fx: f64,
    /// Focal length over pixel height, px.
    pub fy: f64,
    /// Principal point from the left edge, px.
    pub cx: f64,
    /// Principal point from the top edge, px.
    pub cy: f64,
}

/// Shortest focal length over the longer side that a lens with a picture has: fisheyes have about a quarter. What is
/// shorter is in mm, or over the width.
const SHORTEST_FOCAL: f64 = 0.05;
/// Logarithm of the ratio of focal lengths across and down beyond which pixels are not square.
const SQUARE: f64 = 0.05;
/// How far from the middle the optical axis may lie, in sides: further off are cut pictures, and other sizes' numbers.
const AXIS_OFF: f64 = 0.25;
/// How many times nearer the middle the optical axis lies with width and height exchanged, if they are exchanged.
const NEARER: f64 = 4.0;

impl Intrinsics {
    /// That focal lengths are hardly px.
    fn doubt_of_unit(&self) -> Option<String> {
        let longer = f64::from(self.width.max(self.height));
        (self.fx.max(self.fy) < SHORTEST_FOCAL * longer).then(|| {
            format!(
                "focal lengths of {} and {} px and a picture of {}x{} px are a pinhole that sees {:.0} degrees; \
                 expected px: are they in mm, or over the width?",
                self.fx,
                self.fy,
                self.width,
                self.height,
                2.0 * (0.5 * longer / self.fx.max(self.fy)).atan().to_degrees()
            )
        })
    }

    /// How far the optical axis lies from the middle of a picture, px.
    fn axis_off_px(&self, size: [u32; 2]) -> f64 {
        let [w, h] = size.map(f64::from);
        (self.cx - 0.5 * w).hypot(self.cy - 0.5 * h)
    }

    /// What ordinary cameras are not, a sentence each: cameras have square pixels, and look along the middle of their
    /// picture.
    pub fn doubts(&self) -> Vec<String> {
        let mut all: Vec<String> = self.doubt_of_unit().into_iter().collect();
        if (self.fx / self.fy).ln().abs() > SQUARE {
            all.push(format!(
                "focal lengths of {:.1} and {:.1} px across and down, and pixels of cameras are square: pictures that \
                 were stretched, or lengths that were not square",
                self.fx, self.fy
            ));
        }
        let off = |at: f64, side: u32| (at / f64::from(side) - 0.5).abs() >= AXIS_OFF;
        let is_exchanged = self.axis_off_px([self.height, self.width]) * NEARER
            < self.axis_off_px([self.width, self.height]);
        if is_exchanged {
            all.push(format!(
                "the optical axis at ({:.0}, {:.0}) px is the middle of a picture of {}x{} px, not of {}x{} px: are \
                 width and height exchanged?",
                self.cx, self.cy, self.height, self.width, self.width, self.height
            ));
        } else if off(self.cx, self.width) || off(self.cy, self.height) {
            all.push(format!(
                "the optical axis at ({:.0}, {:.0}) px of a picture of {}x{} px, expected within the middle half: \
                 pictures that were cut or shifted, or numbers of another size",
                self.cx, self.cy, self.width, self.height
            ));
        }
        all
    }

    /// Where a camera point falls, px; `None` at or behind the camera.
    pub fn project(&self, point_m: DVec3) -> Option<DVec2> {
        (point_m.z > 0.0).then(|| {
            DVec2::new(self.fx * point_m.x / point_m.z + self.cx, self.fy * point_m.y / point_m.z + self.cy)
        })
    }

    /// Direction of the ray through a picture point, with z = 1.
    pub fn ray(&self, px: DVec2) -> DVec3 {
        DVec3::new((px.x - self.cx) / self.fx, (px.y - self.cy) / self.fy, 1.0)
    }

    /// The same camera with `margin_px` more pixels on every side (the paper's extended field of view, Fig. 3).
    pub fn with_margin(&self, margin_px: [u32; 2]) -> Self {
        Self {
            width: self.width + 2 * margin_px[0],
            height: self.height + 2 * margin_px[1],
            cx: self.cx + f64::from(margin_px[0]),
            cy: self.cy + f64::from(margin_px[1]),
            ..*self
        }
    }

    /// The camera whose pixels are squares of this one's, `side` px wide; what fills no square is left out.
    pub fn divided(&self, side: u32) -> Self {
        let [fx, fy, cx, cy] = [self.fx, self.fy, self.cx, self.cy].map(|v| v / f64::from(side));
        let [width, height] = [self.width, self.height].map(|v| v / side);
        Self { width, height, fx, fy, cx, cy }
    }

    /// Vulkan clip space from camera space: y down, depth 1 at [`NEAR_M`] and 0 at infinity.
    pub fn clip_from_camera(&self) -> DMat4 {
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        DMat4::from_cols(
            DVec4::new(2.0 * self.fx / w, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 * self.fy / h, 0.0, 0.0),
            DVec4::new(2.0 * self.cx / w - 1.0, 2.0 * self.cy / h - 1.0, 0.0, 1.0),
            DVec4::new(0.0, 0.0, NEAR_M, 0.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_camera_is_gets_a_sentence() {
        let usual = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 505.0, cx: 330.0, cy: 230.0 };
        assert!(usual.doubts().is_empty());
        let says = |k: Intrinsics, words: &[&str]| {
            let doubts = k.doubts();
            assert!(doubts.len() == words.len(), "{doubts:?}");
            doubts.iter().zip(words).for_each(|(d, w)| assert!(d.contains(w), "{d}"));
        };
        says(Intrinsics { fx: 4.2, fy: 4.2, ..usual }, &["are they in mm"]);
        says(
            Intrinsics { fx: 0.8, fy: 1.05, cx: 0.5, cy: 0.5, ..usual },
            &["in mm", "square", "optical axis"],
        );
        // Those of a picture twice as large.
        says(Intrinsics { fx: 1000.0, fy: 1010.0, cx: 660.0, cy: 460.0, ..usual }, &["optical axis"]);
        says(Intrinsics { fy: 600.0, ..usual }, &["square"]);
        // EuRoC's camera, 752x480, with its sides exchanged, and this one.
        let turned = Intrinsics { width: 480, height: 752, fx: 458.7, fy: 457.3, cx: 367.7, cy: 248.9 };
        says(turned, &["exchanged"]);
        says(Intrinsics { width: 480, height: 640, ..usual }, &["exchanged"]);
        let square = Intrinsics { width: 500, height: 501, cx: 230.0, cy: 270.0, ..usual };
        assert!(square.doubts().is_empty(), "control: {:?}", square.doubts());
    }

    #[test]
    fn clip_space_agrees_with_the_projection() {
        let k = Intrinsics { width: 320, height: 240, fx: 280.0, fy: 270.0, cx: 158.7, cy: 120.8 };
        let p = DVec3::new(0.3, -0.2, 1.7);
        let clip = k.clip_from_camera() * p.extend(1.0);
        let px = DVec2::new((clip.x / clip.w + 1.0) * 160.0, (clip.y / clip.w + 1.0) * 120.0);
        assert!((px - k.project(p).expect("in front")).length() < 1e-9);
        assert!((clip.z / clip.w - NEAR_M / 1.7).abs() < 1e-12);
        let wider = k.with_margin([7, 5]);
        let shift = wider.project(p).expect("in front") - k.project(p).expect("in front");
        assert!((shift - DVec2::new(7.0, 5.0)).length() < 1e-9);
    }
}
