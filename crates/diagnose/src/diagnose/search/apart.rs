//! Whether one model explains the frames better than another by more than chance and the discrepancy can make.
//!
//! The pictures of two models differ by some picture. The real frames lie somewhere on the way from one to the other:
//! at 0 if the first is right, at 1 if the second is. How well that place is known follows from the noise and from what
//! two correct simulations may differ by. Two models whose difference is no larger than that are not told apart,
//! whatever they score.

use std::sync::Arc;

use rayon::prelude::*;

use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::discrepancy::FILTER_PX2;
use crate::diagnose::expect::model::{P, Theta, candidate_of, is_discrete, mixes_pixels};
use crate::diagnose::expect::pair::given::GivenValue;
use crate::diagnose::expect::room::Room;
use crate::diagnose::expect::tone::{Tone, mixes_alike};
use crate::diagnose::expect::weighing::FrameValues;
use crate::diagnose::expect::weighing::Weighing;
use crate::diagnose::fit::cost::{Target, hide, residual};
use crate::diagnose::fit::intervals::{Shown, Way, way};
use crate::diagnose::fit::normal::assemble;
use crate::diagnose::judge::noise::{NOISES, NoiseData};
use crate::diagnose::judge::score::FAMILIES;
use crate::diagnose::judge::{Scores, family_gain, gain, gain_beyond_bounds, quantile, quantile_of_length};
use crate::diagnose::search::Search;
use shutterbug::chain::Moments;
use shutterbug::effects;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// What moves the whole of a frame, as its pose does.
const WHOLE_FRAMES: [&str; 2] = ["time_offset", "pose_offset"];
/// Px a block over which pictures are averaged where they are compared.
const BLOCK: usize = 2;

/// The same for two models. What makes one of a few neighbours leaves their mean as it is: it shows in single pixels.
fn block_of(a: &Theta, b: &Theta) -> usize {
    let joins = |p: P| {
        let effect = effects::by_id(p.spec().effect);
        effect.is_some_and(|e| matches!(e.moments(), Moments::Mosaic(_) | Moments::Shares(_)))
    };
    if a.differing(b).any(joins) { 1 } else { BLOCK }
}

/// Whether one of two models has nothing that the other lacks but a delay or an offset of the poses, where each frame's
/// pose is free: it lies where its own six numbers put it in both, and only how large these are tells.
fn moves_whole_frames(a: &Theta, b: &Theta) -> bool {
    let mut switched =
        a.differing(b).filter(|&p| a.is_on(p) != b.is_on(p)).map(|p| p.spec().effect).peekable();
    let are_free = [a, b].iter().all(|t| !t.room.poses.is_empty());
    are_free && switched.peek().is_some() && switched.all(|effect| WHOLE_FRAMES.contains(&effect))
}

/// `theta` with the noise of another model.
fn with_noise_of(theta: &Theta, other: &Theta) -> Theta {
    let noise = NOISES.iter().flat_map(|n| candidate_of(n).parameters);
    noise.fold(theta.clone(), |t, &p| t.with(p, other.get(p)))
}

impl Search<'_> {
    /// How many candidates are looked at.
    pub(crate) fn tests(&self) -> usize {
        self.names.len()
    }

    /// Whether `better` explains the frames to choose by better than `worse`: it scores better beyond chance, and the
    /// pictures lie on its side by more than the discrepancy.
    pub(crate) fn prefers(&mut self, worse: &Theta, better: &Theta) -> Result<bool> {
        let shrink = self.poses_shrink(worse, better);
        if moves_whole_frames(worse, better) {
            return Ok(shrink);
        }
        // Both where both can be scored.
        let kind = self.judge.kind;
        self.judge.kind = kind.and(worse.room.kind()).and(better.room.kind());
        let scores = [worse, better].map(|t| self.judge.scores(self.forward, t));
        self.judge.kind = kind;
        let [a, b] = scores;
        let (a, b) = (a?, b?);
        if shrink && !self.gains(&b, &a) {
            return Ok(true);
        }
        // A description that is free can follow anything in a few places.
        let exact = self.holds_to_description() && [worse, better].iter().all(|t| t.room == Room::default());
        let gains = self.gains(&a, &b) || (exact && self.gains_somewhere(&a, &b));
        Ok(gains && self.is_on_its_side(worse, better)?)
    }

    /// Whether scene and poses are taken as they are described.
    pub(crate) fn holds_to_description(&self) -> bool {
        self.room.is_empty()
    }

    /// Whether a gain is beyond chance in the places where it shows, be they few: walls may show no more than an edge.
    fn gains_somewhere(&self, worse: &Scores, better: &Scores) -> bool {
        gain_beyond_bounds(worse, better).is_above(self.tests())
    }

    /// Whether a gain is beyond chance: in the whole score, or in a family of statistics that the rest says nothing of.
    pub(crate) fn gains(&self, worse: &Scores, better: &Scores) -> bool {
        let whole = gain(worse, better);
        let family = |f: usize| family_gain(worse, better, f).is_above(self.tests() * FAMILIES.len());
        whole.is_above(self.tests()) || (whole.value > 0.0 && (0..FAMILIES.len()).any(family))
    }

    /// Whether `better`'s noise explains the frames better than `worse`'s, of models that differ in nothing else.
    /// `data`: what the frames to choose by show of noise.
    pub(crate) fn prefers_noise(&mut self, data: &NoiseData, worse: &Theta, better: &Theta) -> Result<bool> {
        let [a, b] = [worse, better].map(|t| self.judge.scores(self.forward, t));
        let needed = 0.5 * quantile(self.tests());
        let linear = self.forward.outside.as_ref().map(|outside| outside.sim.linear);
        let given = |l: f64| linear.map_or(0.0, |linear| GivenValue::rounding(l, linear));
        let told = data.way(worse, better, given).is_none_or(|way| {
            tracing::info!("noise: {:.3} of the way, half width {:.3}", way.share, way.half);
            way.share > needed * way.half
        });
        Ok(told && self.gains(&a?, &b?))
    }

    fn is_on_its_side(&mut self, worse: &Theta, better: &Theta) -> Result<bool> {
        if self.shows_otherwise(worse, better) || self.places_better(worse, better)? {
            return Ok(true);
        }
        let Some(way) = self.way(worse, better)? else { return Ok(true) };
        // Half widths are two standard errors. An effect may have followed what is none in as many directions as it has
        // parameters.
        let added = |p: &P| !p.is_discrete() && better.is_on(*p) && !worse.is_on(*p);
        let fitted = worse.differing(better).filter(added).count().max(1);
        let needed = 0.5 * quantile_of_length(self.tests(), fitted);
        tracing::debug!("{:.3} of the way, half width {:.3}", way.share, way.half);
        Ok(way.share > needed * way.half || self.spreads_better(worse, better)?)
    }

    /// Whether an effect that only one of two models has shows otherwise than in the mean: in how it spreads noise over
    /// neighbours, or in the values themselves.
    fn shows_otherwise(&self, a: &Theta, b: &Theta) -> bool {
        let noisy = [a, b].iter().any(|t| Tone::new(t).is_noisy());
        let shows = |name: &str| {
            self.is_known(name) || (noisy && is_discrete(candidate_of(name)) && mixes_pixels(name))
        };
        a.differing(b).filter(|&p| a.is_on(p) != b.is_on(p)).any(|p| shows(p.spec().effect))
    }

    /// Whether a filter behind the noise, which only one of two models has, shows in how the noise spreads over
    /// neighbours, whichever model's pictures the frames are held against. Filters that undo each other leave pictures
    /// nearly as they were, and noise not. One of 0.28 px takes a hundredth of its variance away, which nobody sees. A
    /// filter that does nothing may come with a little more noise or less: what that explains without the filter is not
    /// the filter's.
    fn spreads_better(&mut self, worse: &Theta, better: &Theta) -> Result<bool> {
        let filters = |p: P| matches!(p.spec().effect, "noise_reduction" | "sharpening");
        let one_has = worse.differing(better).any(|p| filters(p) && worse.is_on(p) != better.is_on(p));
        let are_noisy = [worse, better].iter().all(|t| Tone::new(t).is_noisy());
        if !one_has || !are_noisy || mixes_alike(worse, better) {
            return Ok(false);
        }
        let as_noisy = with_noise_of(worse, better);
        for shown in [worse, better] {
            let filtered = self.judge.scores_about(self.forward, better, shown)?;
            for plain in [worse, &as_noisy] {
                let plain = self.judge.scores_about(self.forward, plain, shown)?;
                tracing::debug!("spread over neighbours: {:?}", gain(&plain, &filtered));
                if !self.gains(&plain, &filtered) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Where the real frames lie between the pictures of two models; nothing where these differ by noise alone.
    fn way(&mut self, from: &Theta, to: &Theta) -> Result<Option<Way>> {
        let shown = from.differing(to).any(|p| !candidate_of(p.spec().effect).noise);
        if !shown && from.scan_order == to.scan_order && from.room.is_like(&to.room) {
            return Ok(None);
        }
        let (frames, block) = (&self.evidence.choose, block_of(from, to));
        let masks = self.forward.masked(Some(self.masks), from.room.kind().and(to.room.kind()));
        let target = Target { evidence: self.evidence, masks: masks.as_deref() };
        let pictures = [from, to].map(|t| self.forward.pictures(frames, t, self.judge.quality));
        let [from_dn, to_dn] = pictures;
        let (from_dn, to_dn) = (from_dn?, to_dn?);
        // What few samples a pixel miss of its area looks like a filter too.
        let filter_px2 = if self.judge.quality <= Quality::Fit { 2.0 * FILTER_PX2 } else { FILTER_PX2 };
        let wider = from.with(P::Defocus, (from.get(P::Defocus).powi(2) + filter_px2).sqrt());
        let wider = self.forward.pictures(frames, &wider, self.judge.quality)?;
        let drawn = self.forward.drawn(frames, from, self.judge.quality, &from_dn)?;
        let one = |(i, &at): (usize, &usize)| -> FrameValues {
            let (a, b) = (&from_dn[i], &to_dn[i]);
            let pooled = |mut d: Vec<f32>| {
                hide(target, at, &mut d);
                pooled(&d, a.width, a.height, block)
            };
            let less = |b: &Plane<f32>| b.data.iter().zip(&a.data).map(|(b, a)| b - a).collect();
            let mut columns = vec![pooled(less(b)), pooled(less(&wider[i]))];
            columns.extend(drawn[i].iter().map(|draw| pooled(draw.data.clone())));
            (residual(target, at, a, block), columns)
        };
        let values: Vec<FrameValues> = frames.par_iter().enumerate().map(one).collect();
        let residuals: Vec<&[f32]> = values.iter().map(|v| &v.0[..]).collect();
        let draws = drawn.first().map_or(0, Vec::len);
        // What other correct simulations show otherwise tells little.
        let drawn = |(_, columns): &FrameValues| -> Vec<f32> {
            let draws = &columns[2..];
            let square = |i: usize| draws.iter().map(|d| d[i] * d[i]).sum::<f32>() / draws.len() as f32;
            if draws.is_empty() { Vec::new() } else { (0..columns[0].len()).map(square).collect() }
        };
        let drawn = values.iter().map(drawn).collect();
        let weighing =
            Weighing::new(&from_dn, &Tone::new(from), block, 1.0).widened(drawn).chosen(&residuals);
        let e = assemble(values, 2 + draws, Arc::new(weighing));
        let columns_px = self.forward.intrinsics.width as usize / block;
        let moves = from.differing(to).any(|p| p.is_time() || p.is_remap());
        Ok(way(e, &Shown::of(&from_dn, block), columns_px, block, moves))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_moves_whole_frames_and_a_readout_does_not() {
        let mut plain = Theta::neutral();
        plain.room.poses = vec![[1e-3; 6]; 3];
        let late = plain.with(P::Offset, 0.01);
        assert!(moves_whole_frames(&plain, &late) && moves_whole_frames(&late, &plain));
        assert!(
            moves_whole_frames(&plain.with(P::K1, -0.2), &late.with(P::K1, -0.1).with(P::RotX, 0.01)),
            "other values may differ"
        );
        assert!(!moves_whole_frames(&plain, &late.with(P::Readout, 0.01)));
        assert!(!moves_whole_frames(&plain, &plain.with(P::Readout, 0.01)));
        assert!(!moves_whole_frames(&plain, &plain), "nothing is added");
        let described = Theta::neutral();
        assert!(
            !moves_whole_frames(&described, &described.with(P::Offset, 0.01)),
            "control: poses as described"
        );
    }
}
