//! Where frames are compared once the description may be wrong: where other frames say how bright a surface is, and, of
//! a frame whose pose was estimated from half of its tiles, in the other half.

use std::borrow::Cow;
use std::sync::Arc;

use super::grid::NONE;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::room::Room;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Side of a tile, px: whole blocks of every band of the score.
const TILE_PX: usize = 32;

/// What must be left out for models to be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Kind {
    /// What no other frame saw.
    pub unseen: bool,
    /// Tiles that poses were estimated from.
    pub tiles: bool,
}

impl Kind {
    /// What two models need.
    pub(crate) fn and(self, other: Self) -> Self {
        Self { unseen: self.unseen || other.unseen, tiles: self.tiles || other.tiles }
    }
}

impl Room {
    /// What a model with this room needs.
    pub(crate) fn kind(&self) -> Kind {
        Kind { unseen: self.radiance, tiles: !self.poses.is_empty() }
    }
}

/// Whether the pose of a judged frame is estimated from a pixel, and not scored there.
pub(crate) fn is_paid(x: usize, y: usize) -> bool {
    (x / TILE_PX + y / TILE_PX).is_multiple_of(2)
}

impl Forward {
    /// `masks` (by place; open everywhere without) with what `kind` says left out.
    pub(crate) fn masked<'a>(
        &self,
        masks: Option<&'a [Plane<f32>]>,
        kind: Kind,
    ) -> Option<Cow<'a, [Plane<f32>]>> {
        if kind == Kind::default() {
            return masks.map(Cow::Borrowed);
        }
        let size = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let one = |at: usize| {
            let mut mask = match masks {
                Some(m) => m[at].clone(),
                None => Plane::from_fn(size.0, size.1, |_, _| [1.0]),
            };
            let judged = !self.description.sources.contains(&at);
            if let (true, true, Some(covered)) = (kind.unseen, judged, self.description.covered.get(&at)) {
                mask.data.iter_mut().zip(&covered.data).for_each(|(m, c)| *m *= c);
            }
            if kind.tiles && judged {
                let paid = |i: usize| is_paid(i % size.0, i / size.0);
                mask.data.iter_mut().enumerate().filter(|(i, _)| paid(*i)).for_each(|(_, m)| *m = 0.0);
            }
            mask
        };
        Some(Cow::Owned((0..self.description.real.len()).map(one).collect()))
    }

    /// Finds what of each judged frame the other frames say the brightness of, for a camera like that of `theta`.
    pub(crate) fn find_covered(&mut self, theta: &Theta) -> Result<()> {
        let map = self.map_of(theta, Quality::Fit)?;
        for at in 0..self.description.real.len() {
            if self.description.sources.contains(&at) {
                continue;
            }
            let surface = self.surface(at, theta);
            let grid = &self.description.grid;
            let seen = |(&cell, &local): (&u32, &[f32; 3])| {
                f32::from(u8::from(cell == NONE || map.covers(grid, cell, local)))
            };
            let mut data: Vec<f32> = surface.cell.iter().zip(&surface.local).map(seen).collect();
            for (i, parts) in &surface.mixed {
                let all = parts.iter().all(|p| seen((&p.cell, &p.local)) > 0.5);
                data[*i as usize] *= f32::from(u8::from(all));
            }
            let (width, height) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
            self.description.covered.insert(at, Arc::new(Plane { width, height, channels: 1, data }));
        }
        Ok(())
    }

    /// Share of the judged frames' pixels that other frames say the brightness of.
    pub(crate) fn covered_share(&self) -> f64 {
        let all = self.description.covered.values();
        let (sum, count) = all.fold((0.0, 0usize), |(s, n), p| {
            (s + p.data.iter().map(|v| f64::from(*v)).sum::<f64>(), n + p.data.len())
        });
        if count == 0 { 1.0 } else { sum / count as f64 }
    }
}
