//! Photographs of a checkerboard by a camera that is known exactly: every pixel is the mean over rays, each undistorted
//! by iteration and met with the board's plane at the time of its line. Nothing of the program is used.

use glam::{DQuat, DVec2, DVec3};
use shutterbug::plane::Plane;

/// A camera and its board.
#[derive(Clone, Copy)]
pub struct Oracle {
    pub size: [usize; 2],
    pub focal_px: f64,
    pub centre_px: DVec2,
    pub k: [f64; 2],
    /// From the first line to the last, s; negative: from the bottom.
    pub readout_s: f64,
    /// Inner corners, and side of a square, m.
    pub corners: [usize; 2],
    pub square_m: f64,
}

/// Rays a pixel along each axis.
const RAYS: usize = 3;

impl Oracle {
    /// A wide camera of 320x240 px and a board of 7x5 squares' inner corners.
    pub fn new() -> Self {
        Self {
            size: [320, 240],
            focal_px: 250.0,
            centre_px: DVec2::new(163.0, 118.5),
            k: [-0.25, 0.08],
            readout_s: 0.0,
            corners: [7, 4],
            square_m: 0.03,
        }
    }

    fn ray(&self, px: DVec2) -> DVec3 {
        let distorted = (px - self.centre_px) / self.focal_px;
        let mut at = distorted;
        for _ in 0..30 {
            let s = at.length_squared();
            at = distorted / (1.0 + s * (self.k[0] + s * self.k[1]));
        }
        at.extend(1.0)
    }

    /// The picture of a camera whose pose (board from camera) at a time is given; the frame begins at `start_s`.
    pub fn photograph(&self, pose: impl Fn(f64) -> (DQuat, DVec3), start_s: f64) -> Plane<u8> {
        let [w, h] = self.size;
        let mut out = Plane::new(w, h, 3);
        for y in 0..h {
            let line = if self.readout_s < 0.0 { h - 1 - y } else { y };
            let (turn, place) = pose(start_s + self.readout_s.abs() * line as f64 / h as f64);
            for x in 0..w {
                let seen = |i: usize, j: usize| {
                    let part = |i: usize| (i as f64 + 0.5) / RAYS as f64;
                    let d = turn * self.ray(DVec2::new(x as f64 + part(i), y as f64 + part(j)));
                    let hit = place - d * (place.z / d.z);
                    self.radiance(hit.truncate() / self.square_m)
                };
                // Squares are many px wide: where the outermost rays see one of them, so do all.
                let last = RAYS - 1;
                let outermost = [seen(0, 0), seen(last, 0), seen(0, last), seen(last, last)];
                let linear = if outermost.iter().all(|v| *v == outermost[0]) {
                    outermost[0]
                } else {
                    let sum: f64 = (0..RAYS * RAYS).map(|ray| seen(ray % RAYS, ray / RAYS)).sum();
                    sum / (RAYS * RAYS) as f64
                } as f32;
                out.pixel_mut(x, y).fill(shutterbug::plane::srgb8(linear));
            }
        }
        out
    }

    /// Of a place counted in squares from the first inner corner.
    fn radiance(&self, at: DVec2) -> f64 {
        let [columns, rows] = self.corners.map(|c| c as f64);
        let (i, j) = (at.x.floor(), at.y.floor());
        if !(-1.0..columns).contains(&i) || !(-1.0..rows).contains(&j) {
            // A sheet around it, and a room around that.
            let near = (-1.6..columns + 0.6).contains(&at.x) && (-1.6..rows + 0.6).contains(&at.y);
            return if near { 0.6 } else { 0.2 };
        }
        if (i + j).rem_euclid(2.0) == 0.0 { 0.03 } else { 0.6 }
    }

    /// A pose that looks at the board's middle from `distance_m`, turned by these angles, shifted sideways.
    pub fn looking(&self, angles: [f64; 3], shift_m: [f64; 2], distance_m: f64) -> (DQuat, DVec3) {
        let [x, y, z] = angles;
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, x, y, z);
        let middle = DVec3::new(
            0.5 * (self.corners[0] - 1) as f64 * self.square_m,
            0.5 * (self.corners[1] - 1) as f64 * self.square_m,
            0.0,
        );
        (turn, middle - turn * DVec3::new(shift_m[0], shift_m[1], distance_m))
    }
}
