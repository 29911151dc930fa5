//! What a search is asked: which frames, which candidates, and where frames are compared.

use super::shown::Shown;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::cover::Cover;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::judge::Judge;
use crate::diagnose::judge::hot::HotMap;
use crate::diagnose::search::{Search, Watch};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Share of the gap that a candidate must close for what it covers to be believed.
const PROMISING: f64 = 0.02;

/// The same for all searches of a diagnosis.
pub(crate) struct Question<'a> {
    pub evidence: &'a Evidence,
    /// The camera as given.
    pub base: Theta,
    pub seed: u64,
    /// Candidates that are considered.
    pub names: Vec<&'static str>,
    /// What of the description may be wrong.
    pub room: Vec<&'static str>,
    /// What the frames themselves show.
    pub shown: Shown,
}

/// What the simulation as given shows where frames are compared.
pub(crate) struct Seen {
    /// Where fits compare: where the judge does, less the stuck pixels.
    masks: Vec<Plane<f32>>,
    hot: HotMap,
}

impl<'a> Question<'a> {
    /// Simulates the frames as given.
    pub(crate) fn look(&self, forward: &mut Forward, masks: Option<&[Plane<f32>]>) -> Result<Seen> {
        let bare = self.base.with(P::Hot, 0.0).with(P::Quality, 0.0);
        let means = forward.simulate(&self.evidence.fit, &bare, Quality::Fit)?;
        let file = self.shown.put(&self.base).0.file();
        let hot = HotMap::find(self.evidence, &self.evidence.fit, &means, file);
        let open = || {
            let all =
                self.evidence.frames.iter().map(|f| Plane::from_fn(f.dn.width, f.dn.height, |_, _| [1.0]));
            all.collect()
        };
        let mut masks = masks.map_or_else(open, <[Plane<f32>]>::to_vec);
        hot.close(&mut masks);
        Ok(Seen { masks, hot })
    }

    /// A search that compares frames in `masks`.
    pub(crate) fn search<'b>(
        &self,
        forward: &'b mut Forward,
        seen: &'b Seen,
        masks: Option<&'b [Plane<f32>]>,
    ) -> Search<'b>
    where
        'a: 'b,
    {
        if let Some(reduced) = &mut forward.reduced {
            reduced.compare_in(&seen.masks);
        }
        forward.hold_stuck(seen.hot.places());
        Search {
            judge: Judge::new(self.evidence, masks, self.seed, seen.hot.clone()),
            forward,
            evidence: self.evidence,
            masks: &seen.masks,
            base: self.base.clone(),
            names: self.names.clone(),
            room: self.room.clone(),
            shown: self.shown.clone(),
            moved_alone: Vec::new(),
            idle: Vec::new(),
            outdone: Vec::new(),
            rivals: Vec::new(),
        }
    }

    /// Leaves out what the most promising candidates that move the picture do not cover; whether that is worth another
    /// round: their fits were drawn to borders that are left out now.
    pub(crate) fn narrow(
        &self,
        forward: &mut Forward,
        cover: &mut Cover,
        watch: &mut dyn Watch,
    ) -> Result<bool> {
        let seen = self.look(forward, Some(&cover.masks))?;
        let promising = self.search(forward, &seen, Some(&cover.masks)).promising(watch, PROMISING)?;
        forward.compared += 1;
        if forward.static_camera {
            let best = promising.first().unwrap_or(&self.base);
            forward.light =
                crate::diagnose::expect::light::lights(forward, self.evidence, best, Some(&cover.masks))?;
            tracing::info!("light of the photographs: {:.3?}", forward.light);
        }
        Ok(cover.narrow(forward, promising.iter()))
    }
}
