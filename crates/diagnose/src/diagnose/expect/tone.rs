//! Mean and spread of the camera of a point in the space of parameters (`reference::moments`).

use std::ops::Deref;

use super::discrepancy::{MIXED_ERROR, SPREAD_ERROR};
use super::model::{P, Theta};
use super::settings::settings_of;
pub(crate) use shutterbug::chain::Variances;
use shutterbug::chain::{self, Mixing};
use shutterbug::effects;
use shutterbug::plane::stats::LUMA;
use shutterbug::reference::moments;

/// Everything that happens to a value on its own.
pub(crate) struct Tone {
    tone: moments::Tone,
    uncertainty: f32,
}

impl Tone {
    pub(crate) fn new(theta: &Theta) -> Self {
        Self { tone: moments::Tone::new(&settings_of(theta)), uncertainty: uncertainty(theta) }
    }

    /// How well the variance of noise is known, as a part of it.
    pub(crate) fn uncertainty(&self) -> f32 {
        self.uncertainty
    }
}

/// See [`Tone::uncertainty`].
fn uncertainty(theta: &Theta) -> f32 {
    let mixes = theta.is_on(P::Quality) || mixing(theta) != Mixing::NONE;
    if mixes { MIXED_ERROR } else { SPREAD_ERROR }
}

impl Deref for Tone {
    type Target = moments::Tone;

    fn deref(&self) -> &moments::Tone {
        &self.tone
    }
}

/// What the steps of `theta` that mix pixels leave of noise.
fn mixing(theta: &Theta) -> Mixing {
    chain::mixing(effects::LIST, &settings_of(theta))
}

/// What is seen of white noise behind the steps that mix pixels, by differences along the row of a kind (see
/// [`chain::DISTANCES`]): of single colours on average, or of brightness.
pub(crate) fn noise_gain(theta: &Theta, kind: usize, luma: bool) -> f64 {
    let mixing = mixing(theta);
    if luma {
        return f64::from(mixing.luma[1 + kind]);
    }
    gains(&mixing, kind).iter().sum::<f64>() / 3.0
}

/// The same of each colour.
pub(crate) fn noise_gains(theta: &Theta, kind: usize) -> [f64; 3] {
    gains(&mixing(theta), kind)
}

fn gains(mixing: &Mixing, kind: usize) -> [f64; 3] {
    [0, 1, 2].map(|c| f64::from(mixing.pixel[c] * mixing.left[c].high_pass[kind]))
}

/// Whether the noise of two cameras looks alike behind the steps that mix pixels, to within how well a variance of
/// noise is known.
pub(crate) fn mixes_alike(a: &Theta, b: &Theta) -> bool {
    let [a, b] = [a, b].map(|t| {
        let mixing = mixing(t);
        let kinds = (0..chain::DISTANCES.len()).flat_map(|kind| gains(&mixing, kind));
        kinds.chain(mixing.pixel.map(f64::from)).collect::<Vec<f64>>()
    });
    a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= f64::from(SPREAD_ERROR) * a.max(*b))
}

/// What white noise of single values becomes behind the steps that mix pixels, by colour: a factor of its variance.
pub(crate) fn mixed_noise(theta: &Theta) -> [f32; 3] {
    mixing(theta).pixel
}

/// Variance that the noise of rows keeps in the mean of a row over its colours, beside rows that are not its
/// neighbours.
pub(crate) fn row_seen(theta: &Theta) -> f32 {
    mixing(theta).row_seen
}

/// Variance of a pixel's colour from that of each colour before, where pixels share their chroma: `[of][from]`.
pub(crate) fn shared(theta: &Theta) -> Option<[[f32; 3]; 3]> {
    mixing(theta).shared
}

/// What the mean of a row keeps of noise that is new in every value, over what as many independent values would: the
/// mean over its colours.
pub(crate) fn row_kept(theta: &Theta) -> f64 {
    mixing(theta).left.iter().map(|l| f64::from(l.lines[0])).sum::<f64>() / 3.0
}

/// What brightness keeps of white noise, and of the noise of rows, behind the steps that mix pixels.
pub(crate) fn kept_of_luma(theta: &Theta) -> [f64; 2] {
    let mixing = mixing(theta);
    let over = |power: i32, of: &dyn Fn(usize) -> f64| {
        let weight = |c: usize| f64::from(LUMA[c]).powi(power);
        (0..3).map(|c| weight(c) * of(c)).sum::<f64>() / (0..3).map(weight).sum::<f64>()
    };
    let own = over(2, &|c| f64::from(mixing.pixel[c]));
    [own, over(1, &|c| f64::from(mixing.row[c]).sqrt()).powi(2)]
}

/// Whether the steps of a coarse converter are seen one by one in delivered values: nothing mixes pixels or colours
/// behind it.
pub(crate) fn shows_steps(theta: &Theta) -> bool {
    // Noise has no part in it, and its tables take long.
    let tone = Tone::new(&noiseless(theta));
    tone.step_linear(1) > 0.0 && tone.keeps_steps()
}

/// The same, of steps that are coarse.
pub(crate) fn shows_coarse_steps(theta: &Theta) -> bool {
    let tone = Tone::new(&noiseless(theta));
    tone.is_coarse() && tone.keeps_steps()
}

/// DN a unit of linear light, at a delivered value.
pub(crate) fn dn_per_linear(tone: &Tone, dn: f32, channel: usize) -> f32 {
    2.0 / (tone.decode(dn + 1.0, channel) - tone.decode(dn - 1.0, channel)).max(1e-6)
}

/// A camera without noise.
pub(crate) fn noiseless(theta: &Theta) -> Theta {
    let noises = [P::Shot, P::Read, P::Row, P::Dsnu, P::Prnu];
    noises.into_iter().fold(theta.clone(), |theta, p| theta.with(p, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::vector::PLACES;

    #[test]
    fn a_filter_that_hardly_touches_noise_is_none() {
        let of = |name: &str| {
            let is = |p: &P| p.spec().effect == "noise_reduction" && p.spec().name == name;
            PLACES.iter().copied().find(is).expect("one")
        };
        let soft = |luma: f64, chroma: f64| {
            Theta::neutral().with(of("luma_sigma_px"), luma).with(of("chroma_sigma_px"), chroma)
        };
        assert!(mixes_alike(&Theta::neutral(), &soft(0.27, 0.28)));
        for (luma, chroma) in [(0.45, 0.0), (0.0, 0.6), (0.6, 0.6)] {
            assert!(!mixes_alike(&Theta::neutral(), &soft(luma, chroma)), "control: {luma}, {chroma}");
        }
        let both = soft(0.5, 0.5).with(P::Sharpen, 0.6).with(P::Radius, 0.6);
        assert!(!mixes_alike(&Theta::neutral(), &both), "what undo each other");
    }
}
