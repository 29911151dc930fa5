//! The picture of the paper's Fig. 5: frame, contrast-enhanced difference image and histograms per channel, real above
//! simulated; with a part of the difference at full resolution, where the grain can be seen.

use super::blocks::percentile;
use super::chart::{canvas, histograms, label};
use super::noise::Calibration;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

const PICTURE_WIDTH: usize = 460;
const CROP_PX: usize = 172;
/// The full-resolution part is shown this many times as large.
const CROP_ZOOM: usize = 2;
const CHART_WIDTH: usize = 430;
const GAP: usize = 14;
const TITLE_HEIGHT: usize = 30;

/// Grey of what was left out.
const LEFT_OUT: [u8; 3] = [70, 70, 78];

/// Draws the figure.
///
/// # Errors
/// A chart that cannot be drawn.
pub fn figure(c: &Calibration) -> Result<Plane<u8>> {
    let shown = &c.pictures;
    let picture_height = (PICTURE_WIDTH * shown.real.height).div_ceil(shown.real.width);
    let row = picture_height.max(CROP_PX * CROP_ZOOM).max(300) + TITLE_HEIGHT + GAP;
    let columns = [PICTURE_WIDTH, PICTURE_WIDTH, CROP_PX * CROP_ZOOM, CHART_WIDTH];
    let left: Vec<usize> =
        (0..4).map(|k| GAP + columns[..k].iter().map(|w| w + GAP).sum::<usize>()).collect();
    let width = GAP + columns.iter().map(|w| w + GAP).sum::<usize>();
    let sigma = spread(&shown.real_difference, &shown.usable);
    // Four sigma of the noisiest channel fill the contrast.
    let contrast = 0.5 / (4.0 * sigma.max(1e-4));
    let reach = (4.5 * 255.0 * sigma).max(2.0);
    let corner = fullest_corner(&shown.usable, shown.real.width, shown.real.height);
    let rows = [
        ("real", &shown.real, &shown.real_difference),
        ("simulated", &shown.simulated, &shown.simulated_difference),
    ];
    let mut out = canvas(width as u32, (2 * row) as u32, |area| {
        for (k, (name, _, difference)) in rows.iter().enumerate() {
            let top = (k * row) as i32 + 9;
            label(area, &format!("{name} frame"), (left[0] as i32, top), 17)?;
            label(area, &format!("difference x {contrast:.0} (dark: left out)"), (left[1] as i32, top), 17)?;
            label(area, &format!("the same, {CROP_ZOOM} : 1"), (left[2] as i32, top), 17)?;
            let size = (CHART_WIDTH as u32, (row - GAP) as u32);
            let panel = area.clone().shrink((left[3] as i32, (k * row) as i32), size);
            histograms(&panel, &format!("{name}: difference per channel"), difference, &shown.usable, reach)?;
        }
        Ok(())
    })?;
    for (k, (_, picture, difference)) in rows.into_iter().enumerate() {
        let top = k * row + TITLE_HEIGHT;
        let height = picture_height;
        let seen = |v: f32| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8;
        let scaled = |x: usize, y: usize| {
            (x * picture.width / PICTURE_WIDTH, (y * picture.height / height).min(picture.height - 1))
        };
        paste(&mut out, (left[0], top), (PICTURE_WIDTH, height), |x, y| {
            let (u, v) = scaled(x, y);
            [0, 1, 2].map(|c| seen(picture.pixel(u, v)[c]))
        });
        let enhanced = |u: usize, v: usize| {
            if !shown.usable[v * picture.width + u] {
                return LEFT_OUT;
            }
            [0, 1, 2].map(|c| seen(0.5 + contrast as f32 * difference.pixel(u, v)[c]))
        };
        paste(&mut out, (left[1], top), (PICTURE_WIDTH, height), |x, y| {
            let (u, v) = scaled(x, y);
            enhanced(u, v)
        });
        let side = (CROP_PX * CROP_ZOOM).min(CROP_ZOOM * picture.width.min(picture.height));
        paste(&mut out, (left[2], top), (side, side), |x, y| {
            enhanced(corner.0 + x / CROP_ZOOM, corner.1 + y / CROP_ZOOM)
        });
    }
    Ok(out)
}

/// Sigma of the noisiest channel, by its median, which a few edges do not move.
fn spread(d: &Plane<f32>, usable: &[bool]) -> f64 {
    let of = |c: usize| {
        let values: Vec<f64> = (0..usable.len())
            .step_by(7)
            .filter(|i| usable[*i])
            .map(|i| f64::from(d.data[i * 3 + c]).abs())
            .collect();
        1.4826 * percentile(&values, 0.5)
    };
    (0..3).map(of).fold(0.0, f64::max)
}

/// Upper left corner of the square of [`CROP_PX`] with the most usable pixels.
fn fullest_corner(usable: &[bool], width: usize, height: usize) -> (usize, usize) {
    let side = CROP_PX.min(width).min(height);
    let (mut best, mut most) = ((0, 0), 0);
    for y0 in (0..=height - side).step_by(16) {
        for x0 in (0..=width - side).step_by(16) {
            let count = (0..side).map(|y| (y0 + y) * width + x0);
            let count = count.map(|i| usable[i..i + side].iter().filter(|u| **u).count()).sum();
            if count > most {
                (best, most) = ((x0, y0), count);
            }
        }
    }
    best
}

fn paste(
    out: &mut Plane<u8>,
    (left, top): (usize, usize),
    (w, h): (usize, usize),
    f: impl Fn(usize, usize) -> [u8; 3],
) {
    for y in 0..h {
        for x in 0..w {
            out.pixel_mut(left + x, top + y).copy_from_slice(&f(x, y));
        }
    }
}
