//! From radiance to delivered pictures, and the last of these, kept: a search asks for the picture of one point again
//! and again (as the end of a step, the beginning of the next, the model to be compared with).

use std::sync::Arc;

use rayon::prelude::*;

use super::bench::{Flipped, PictureKey};
use super::discrepancy::{DRAWS, off_by};
use super::forward::Forward;
use super::model::{P, Theta};
use super::settings::settings_of;
use super::tone::{Tone, noiseless, shows_coarse_steps};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::flips::Flips;
use crate::diagnose::grain::Grain;
use shutterbug::chain::{Settings, View};
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::reference::moments::{Lattice, expected_on, through_converter, through_file};

/// Sets of draws that are kept, see [`Forward::flipped`].
const KEPT_DRAWS: usize = 4;

/// What rounds coarsely at the end of a camera: a converter whose steps are seen, a file's coefficients, or both.
struct Rounder {
    /// The camera ahead of it.
    ahead: Theta,
    settings: Settings,
    tone: Tone,
    converts: bool,
}

impl Rounder {
    /// Nothing where values and coefficients are not rounded, or more finely than to be seen.
    fn of(theta: &Theta) -> Option<Self> {
        let open = theta.with(P::Quality, 0.0);
        let converts = shows_coarse_steps(&open);
        let ahead = if converts { noiseless(&open).with(P::Bits, 0.0) } else { open };
        let (settings, tone) = (settings_of(theta), Tone::new(theta));
        (converts || theta.is_on(P::Quality)).then_some(Self { ahead, settings, tone, converts })
    }

    /// A picture of the camera ahead as it is delivered.
    fn rounded(&self, picture: &Plane<f32>) -> Plane<f32> {
        if !self.converts {
            return through_file(picture, &self.settings, &self.tone);
        }
        through_file(&through_converter(picture, &self.tone), &self.settings, &self.tone)
    }
}

/// Whether draws of other correct simulations say what edges may be off by, see [`Forward::drawn`].
pub(crate) fn draws_edges(theta: &Theta) -> bool {
    theta.is_on(P::Quality) || shows_coarse_steps(theta)
}

impl Forward {
    /// Values as delivered, DN, without noise; by place.
    pub(crate) fn simulate(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
    ) -> Result<Vec<Plane<f32>>> {
        Ok(self.pictures(frames, theta, quality)?.iter().map(|p| (**p).clone()).collect())
    }

    /// The same, shared with whoever asks next.
    pub(crate) fn pictures(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let point = theta.bits();
        let key = |at: usize| (at, quality, self.native, self.light[at].to_bits(), point.clone());
        let keys: Vec<PictureKey> = frames.iter().map(|&at| key(at)).collect();
        let mut found: Vec<Option<Arc<Plane<f32>>>> = keys.iter().map(|key| self.recall(key)).collect();
        let missing: Vec<usize> = (0..frames.len()).filter(|&i| found[i].is_none()).collect();
        if !missing.is_empty() {
            let places: Vec<usize> = missing.iter().map(|&i| frames[i]).collect();
            let radiance = self.radiance(&places, theta, quality)?;
            self.budget.go_on()?;
            let tone = Tone::new(theta);
            let develop = |(&at, r): (&usize, &Arc<Plane<f32>>)| Arc::new(self.develop(at, r, theta, &tone));
            let done: Vec<_> = places.par_iter().zip(&radiance).map(develop).collect();
            for (i, plane) in missing.into_iter().zip(done) {
                self.bench.developed.keep(keys[i].clone(), plane.clone());
                found[i] = Some(plane);
            }
        }
        Ok(found.into_iter().map(|f| f.expect("just developed")).collect())
    }

    fn recall(&mut self, key: &PictureKey) -> Option<Arc<Plane<f32>>> {
        let kept = self.bench.developed.recall(key);
        if kept.is_some() || !self.trying { kept } else { self.aside.developed.recall(key) }
    }

    /// What compression leaves of the noise in the frames of `theta`; nothing where there is no noise or no
    /// compression.
    pub(crate) fn flips(&mut self, frames: &[usize], theta: &Theta, quality: Quality) -> Result<Vec<Flips>> {
        let tone = Tone::new(theta);
        if !theta.is_on(P::Quality) || !tone.is_noisy() {
            return Ok(Vec::new());
        }
        let before = self.pictures(frames, &theta.with(P::Quality, 0.0), quality)?;
        self.budget.go_on()?;
        let grain = Grain::of(&settings_of(theta));
        let of = |dn: &Arc<Plane<f32>>| {
            let spread = |i: usize| tone.spread_of(&dn.data[i - i % 3..i - i % 3 + 3], i % 3);
            let (own, rows): (Vec<f32>, Vec<f32>) =
                (0..dn.data.len()).map(spread).map(|v| (v.free + v.fixed, v.row)).unzip();
            Flips::of(dn, &own, &rows, theta.get(P::Quality) as u8, &grain)
        };
        Ok(before.par_iter().map(of).collect())
    }

    /// By frame (place): differences between another correct simulation of `theta` and this one, DN, one a draw: what
    /// is compressed otherwise, and what a path does that wanders within a frame. `pictures` are this one's.
    pub(crate) fn drawn(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
        pictures: &[Arc<Plane<f32>>],
    ) -> Result<Flipped> {
        let mut drawn = self.flipped(frames, theta, quality)?;
        let wandered = self.wandered(frames, theta, pictures);
        for (to, more) in drawn.iter_mut().zip(wandered) {
            if to.is_empty() {
                *to = more;
                continue;
            }
            for (to, more) in to.iter_mut().zip(more) {
                let to = Arc::make_mut(to);
                to.data.iter_mut().zip(&more.data).for_each(|(a, b)| *a += b);
            }
        }
        Ok(drawn)
    }

    /// By frame (place): differences between another correct simulation of `theta` and this one, behind what rounds its
    /// values or coefficients coarsely, DN, one a draw. What lies near a threshold goes the other way, in every place
    /// of that colour. Nothing without such, which spreads nothing.
    fn flipped(&mut self, frames: &[usize], theta: &Theta, quality: Quality) -> Result<Flipped> {
        let Some(rounder) = Rounder::of(theta) else {
            return Ok(vec![Vec::new(); frames.len()]);
        };
        let key = format!("{frames:?} {quality:?} {} {:?} {theta:?}", self.native, self.light);
        if let Some((_, known)) = self.bench.developed.flipped.iter().find(|(k, _)| *k == key) {
            return Ok(known.clone());
        }
        let before = self.pictures(frames, &rounder.ahead, quality)?;
        let after = self.pictures(frames, theta, quality)?;
        let less = |mut a: Plane<f32>, b: &Plane<f32>| {
            a.data.iter_mut().zip(&b.data).for_each(|(a, b)| *a -= b);
            a
        };
        let paths = self.paths(frames, theta);
        let one = |i: usize| -> Vec<Arc<Plane<f32>>> {
            if self.budget.is_over() {
                return Vec::new();
            }
            let off = |draw| off_by(&before[i], paths.get(i), draw, frames[i]);
            let drawn = |draw| rounder.rounded(&off(draw));
            (0..DRAWS).into_par_iter().map(|draw| Arc::new(less(drawn(draw), &after[i]))).collect()
        };
        let flipped: Flipped = (0..frames.len()).into_par_iter().map(one).collect();
        self.budget.go_on()?;
        let kept = &mut self.bench.developed.flipped;
        kept.truncate(KEPT_DRAWS - 1);
        kept.insert(0, (key, flipped.clone()));
        Ok(flipped)
    }

    /// Develops the radiance of a frame.
    pub(crate) fn develop(&self, at: usize, radiance: &Plane<f32>, theta: &Theta, tone: &Tone) -> Plane<f32> {
        self.develop_on(at, radiance, Lattice::WHOLE, theta, tone)
    }

    /// Develops the radiance of some pixels of a frame.
    pub(crate) fn develop_on(
        &self,
        at: usize,
        radiance: &Plane<f32>,
        on: Lattice,
        theta: &Theta,
        tone: &Tone,
    ) -> Plane<f32> {
        let view = View { intrinsics: self.intrinsics, shutter: self.shutter(at, theta), frame: 0, seed: 0 };
        let settings = settings_of(theta);
        if self.light[at] == 1.0 {
            return expected_on(radiance, on, &settings, &view, tone, &self.stuck);
        }
        let light = self.light[at] as f32;
        let lit = Plane { data: radiance.data.iter().map(|l| l * light).collect(), ..*radiance };
        expected_on(&lit, on, &settings, &view, tone, &self.stuck)
    }

    /// From here on these pixels, by number row by row, are stuck where a camera has such: filters behind the sensor
    /// spread them over their neighbours.
    pub(crate) fn hold_stuck(&mut self, places: Vec<usize>) {
        if *self.stuck != places {
            self.stuck = Arc::new(places);
            self.bench.developed.clear();
            self.aside.developed.clear();
        }
    }
}
