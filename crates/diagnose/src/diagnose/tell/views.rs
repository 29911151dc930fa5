//! What is wrong with the description, as pictures.

use std::fs;
use std::path::Path;

use super::entries::Parts;
use crate::diagnose::expect::compared::{Shown, bytes};
use crate::diagnose::expect::room::SURFACES;
use crate::diagnose::report::DescriptionShown;
use shutterbug::error::{Error, Result};
use shutterbug::plane::{Plane, write_png_atomic};

/// Frames that are drawn of each kind: what is wrong with a room is wrong in all of them.
const FEW: usize = 3;
/// Factors between one and this are drawn at least, so that rounding does not look like paint.
const LEAST_WHITE: f32 = 1.2;
/// What is left of the brightness of what is as described.
const DARK: f32 = 0.3;

impl Parts {
    /// Draws a few frames into a report's folder.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(crate) fn draw(&self, folder: &Path, frames: &[Shown]) -> Result<DescriptionShown> {
        let white = self.white();
        let mut shown = DescriptionShown {
            white_factor: f64::from(white),
            poses: self.poses.clone(),
            ..DescriptionShown::default()
        };
        for (index, factor) in few(&self.factors) {
            let picture = factor_picture(factor, white);
            shown.factors.push(write(folder, SURFACES, *index, &picture)?);
        }
        for (index, mask) in few(&self.objects) {
            let Some(frame) = frames.iter().find(|f| f.index == *index) else { continue };
            let picture = object_picture(&frame.real, mask);
            shown.objects.push(write(folder, "undescribed_object", *index, &picture)?);
        }
        Ok(shown)
    }

    /// The factor that is drawn white: nearly all are between its inverse and it.
    fn white(&self) -> f32 {
        let all = self.factors.iter().flat_map(|(_, f)| f.data.iter().step_by(31));
        let mut logs: Vec<f32> = all.map(|f| f.max(1e-6).ln().abs()).collect();
        if logs.is_empty() {
            return LEAST_WHITE;
        }
        let at = logs.len() * 98 / 100;
        logs.select_nth_unstable_by(at, f32::total_cmp).1.exp().max(LEAST_WHITE)
    }
}

/// Of many a few, evenly.
fn few<T>(all: &[T]) -> impl Iterator<Item = &T> {
    let count = all.len().min(FEW);
    (0..count).map(move |i| &all[(2 * i + 1) * all.len() / (2 * count)])
}

fn write(folder: &Path, kind: &str, index: usize, picture: &Plane<u8>) -> Result<String> {
    let to = folder.join(kind);
    fs::create_dir_all(&to).map_err(|e| Error::io(&to, "create the folder", e))?;
    let name = format!("{kind}/{index:06}.png");
    write_png_atomic(&folder.join(&name), picture)?;
    Ok(name)
}

/// Logarithms of factors from black (the inverse of `white`) over grey (1) to white.
fn factor_picture(factor: &Plane<f32>, white: f32) -> Plane<u8> {
    let shade = |f: &f32| 127.5 * (1.0 + f.max(1e-6).ln() / white.ln());
    bytes(&Plane { data: factor.data.iter().map(shade).collect(), ..*factor })
}

/// A frame with all that is as described darkened.
fn object_picture(real: &Plane<f32>, mask: &Plane<f32>) -> Plane<u8> {
    let lit = |(i, v): (usize, &f32)| if mask.data[i / 3] > 0.5 { DARK * v } else { *v };
    bytes(&Plane { data: real.data.iter().enumerate().map(lit).collect(), ..*real })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_is_grey_and_its_extremes_are_black_and_white() {
        let factor = Plane { width: 3, height: 1, channels: 1, data: vec![0.5, 1.0, 2.0] };
        assert_eq!(factor_picture(&factor, 2.0).data, [0, 128, 255]);
    }

    #[test]
    fn what_is_described_is_dark() {
        let real = Plane { width: 2, height: 1, channels: 3, data: vec![200.0; 6] };
        let mask = Plane { width: 2, height: 1, channels: 1, data: vec![1.0, 0.0] };
        assert_eq!(object_picture(&real, &mask).data, [60, 60, 60, 200, 200, 200]);
    }

    #[test]
    fn a_few_of_many_are_spread_over_all() {
        let all: Vec<usize> = (0..12).collect();
        assert_eq!(few(&all).copied().collect::<Vec<_>>(), [2, 6, 10]);
        assert_eq!(few(&all[..2]).count(), 2);
        assert_eq!(few(&all[..0]).count(), 0);
    }
}
