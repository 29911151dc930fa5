//! How dark and how bright a print is, and how far the squares around its inner corners reach: sheets are cut, and a
//! square that the scene has and the sheet has not would be blamed on the camera.

use glam::{DVec2, DVec3};

use super::input::Picture;
use super::select::BoardFit;
use super::target::{Pattern, Target, View};
use shutterbug::error::Result;
use shutterbug::files::{Limit, read};
use shutterbug::plane::stats::median;
use shutterbug::plane::{decode_picture, srgb_decode};

/// Steps in which the print's end is looked for, of a square.
const STEPS: usize = 20;
/// Steps beside the inner corners, where the squares' blurred edges tell nothing.
const BESIDE: usize = 4;
/// What is left of the contrast where the print ends: a blurred edge is half of it.
const HALF: f64 = 0.5;
/// Places inside a square where it is sampled, from its middle, of its side: away from its edges.
const INSIDE: [[f64; 2]; 5] = [[0.0, 0.0], [-0.2, -0.2], [0.2, -0.2], [-0.2, 0.2], [0.2, 0.2]];

/// Middle of a tag's dark frame, of its side.
const FRAME_MIDDLE: f64 = 0.1;

/// Radiance and reach of a print.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Linear radiance of dark and bright places: red, green, blue; 1 = white.
    pub dark: [f64; 3],
    /// See `dark`.
    pub bright: [f64; 3],
    /// How much of the squares around the inner corners there is, in squares: left, right, above, below; 0 of an
    /// AprilGrid.
    pub reach: [f64; 4],
}

/// Squares of a checkerboard in a picture.
struct Look<'a> {
    picture: image::RgbImage,
    target: &'a Target,
    project: Box<dyn Fn(DVec3) -> Option<DVec2> + 'a>,
    even_is_dark: bool,
}

impl Look<'_> {
    /// Linear radiance at a place of the board, counted in squares from the first inner corner.
    fn at(&self, x: f64, y: f64) -> Option<[f64; 3]> {
        let [side_x, side_y] = self.target.square_m;
        self.at_m(x * side_x, y * side_y)
    }

    /// The same of a place in m.
    fn at_m(&self, x_m: f64, y_m: f64) -> Option<[f64; 3]> {
        let px = (self.project)(DVec3::new(x_m, y_m, 0.0))?;
        let (w, h) = self.picture.dimensions();
        let inside = px.x >= 0.0 && px.y >= 0.0 && px.x < f64::from(w) && px.y < f64::from(h);
        inside.then(|| {
            let rgb = self.picture.get_pixel(px.x as u32, px.y as u32).0;
            rgb.map(|v| f64::from(srgb_decode(f32::from(v) / 255.0)))
        })
    }

    fn is_dark(&self, column: i64, row: i64) -> bool {
        ((column + row).rem_euclid(2) == 0) == self.even_is_dark
    }

    /// Middle radiance of the frames of tags, and of the paper between tags, half way along their sides.
    fn tag_tones(&self) -> Option<[[f64; 3]; 2]> {
        let spacing = self.target.tag_spacing?;
        let [columns, rows] = self.target.size.map(|s| s / 2);
        let [side_x, side_y] = self.target.square_m;
        let mut all: [[Vec<f64>; 3]; 2] = Default::default();
        for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            let from = self.target.point_m([2 * i, 2 * j]);
            let within = [(0, 0.5, FRAME_MIDDLE), (0, FRAME_MIDDLE, 0.5), (0, 0.5, 1.0 - FRAME_MIDDLE)];
            let between = [(1, 0.5, -0.5 * spacing), (1, -0.5 * spacing, 0.5)];
            for (kind, x, y) in within.into_iter().chain(between) {
                if let Some(rgb) = self.at_m(from.x + x * side_x, from.y + y * side_y) {
                    (0..3).for_each(|c| all[kind][c].push(rgb[c]));
                }
            }
        }
        all.iter().all(|k| !k[0].is_empty()).then(|| all.map(|kind| kind.map(median)))
    }

    /// Middle radiance of the dark and the bright squares between inner corners.
    fn tones(&self) -> Option<[[f64; 3]; 2]> {
        if self.target.pattern == Pattern::Aprilgrid {
            return self.tag_tones();
        }
        let [columns, rows] = self.target.size;
        let mut all: [[Vec<f64>; 3]; 2] = Default::default();
        for (i, j) in (0..columns as i64 - 1).flat_map(|i| (0..rows as i64 - 1).map(move |j| (i, j))) {
            let kind = usize::from(!self.is_dark(i, j));
            let bright = kind == 1;
            // Beside a marker, half way to the square's edge.
            let beside = self.target.marker.as_ref().filter(|_| bright).map(|m| 0.25 * (1.0 + m.share));
            let margin = |away: f64| [[away, 0.0], [-away, 0.0], [0.0, away], [0.0, -away], [away, away]];
            for [dx, dy] in beside.map_or(INSIDE, margin) {
                if let Some(rgb) = self.at(i as f64 + 0.5 + dx, j as f64 + 0.5 + dy) {
                    (0..3).for_each(|c| all[kind][c].push(rgb[c]));
                }
            }
        }
        all.iter().all(|k| !k[0].is_empty()).then(|| all.map(|kind| kind.map(median)))
    }

    /// Contrast of the squares beyond one side of the inner corners, at `beyond` squares from these, over `contrast`.
    fn beyond(&self, side: usize, beyond: f64, contrast: f64) -> Option<f64> {
        let (axis, far) = (side / 2, side % 2 == 1);
        let last = self.target.size[axis] as f64 - 1.0;
        let (across, square) =
            if far { (last + beyond, self.target.size[axis] as i64 - 1) } else { (-beyond, -1) };
        let mut sums = [(0.0, 0usize); 2];
        for k in 0..self.target.size[1 - axis] as i64 - 1 {
            let along = k as f64 + 0.5;
            let (at, dark) = if axis == 0 {
                (self.at(across, along), self.is_dark(square, k))
            } else {
                (self.at(along, across), self.is_dark(k, square))
            };
            let Some(rgb) = at else { continue };
            let sum = &mut sums[usize::from(!dark)];
            (sum.0, sum.1) = (sum.0 + rgb.iter().sum::<f64>() / 3.0, sum.1 + 1);
        }
        let [dark, bright] = sums.map(|(sum, n)| (n > 0).then(|| sum / n as f64));
        Some((bright? - dark?) / contrast)
    }
}

/// Measures the print in all views (of a checkerboard), with the fitted camera; one picture in memory at a time.
///
/// # Errors
/// A picture that cannot be read any more.
pub fn measure_tone(
    pictures: &[Picture],
    target: &Target,
    views: &[View],
    fit: &BoardFit,
    even_is_dark: bool,
) -> Result<Tone> {
    let mut tones: [[Vec<f64>; 3]; 2] = Default::default();
    let mut beyond: Vec<Vec<Vec<f64>>> = vec![vec![Vec::new(); STEPS]; 4];
    for (view, pose) in views.iter().zip(&fit.poses) {
        let path = &pictures[view.picture].path;
        let picture = decode_picture(path, &read(path, Limit::PICTURE)?)?.into_rgb8();
        let project = Box::new(move |p: DVec3| fit.camera.project(pose.transform(p)));
        let look = Look { picture, target, project, even_is_dark };
        let Some([dark, bright]) = look.tones() else { continue };
        for c in 0..3 {
            tones[0][c].push(dark[c]);
            tones[1][c].push(bright[c]);
        }
        if target.pattern == Pattern::Aprilgrid {
            continue;
        }
        let contrast = (0..3).map(|c| bright[c] - dark[c]).sum::<f64>() / 3.0;
        for (side, steps) in beyond.iter_mut().enumerate() {
            for (k, found) in steps.iter_mut().enumerate() {
                let at = (k as f64 + 0.5) / STEPS as f64;
                found.extend(look.beyond(side, at, contrast));
            }
        }
    }
    let [dark, bright] = tones.map(|kind| kind.map(median));
    let reach = |steps: &Vec<Vec<f64>>| {
        let is_there = |s: &&Vec<f64>| !s.is_empty() && median(s.iter().copied()) > HALF;
        let there = steps[BESIDE..].iter().take_while(is_there).count();
        if there == 0 { 0.0 } else { (BESIDE + there) as f64 / STEPS as f64 }
    };
    let reach = [0, 1, 2, 3].map(|side| reach(&beyond[side]));
    Ok(Tone { dark, bright, reach })
}
