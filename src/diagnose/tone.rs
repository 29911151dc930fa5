//! Mean and spread of the camera of a point in the space of parameters (`reference::moments`).

use std::ops::Deref;

use super::model::Theta;
use super::settings::settings_of;
pub(super) use crate::chain::Variances;
use crate::chain::{Mixing, Moments};
use crate::effects;
use crate::reference::moments;

/// Everything that happens to a value on its own.
pub(super) struct Tone(moments::Tone);

impl Tone {
    pub(super) fn new(theta: &Theta) -> Self {
        Self(moments::Tone::new(&settings_of(theta)))
    }
}

impl Deref for Tone {
    type Target = moments::Tone;

    fn deref(&self) -> &moments::Tone {
        &self.0
    }
}

/// What the steps of `theta` that mix pixels leave of noise.
fn mixing(theta: &Theta) -> Mixing {
    let settings = settings_of(theta);
    let on = effects::LIST.iter().filter(|e| e.variant(&settings) != 0);
    on.fold(Mixing::NONE, |mixing, effect| match effect.moments() {
        Moments::Pixels(of) => mixing.then(&of(&settings)),
        _ => mixing,
    })
}

/// Variance that white noise keeps behind the steps that mix pixels, by channel.
pub(super) fn noise_gain(theta: &Theta) -> [f32; 3] {
    mixing(theta).pixel
}

/// Variance that the noise of rows keeps in the mean of a row over its colours, about rows that are not its neighbours.
pub(super) fn row_seen(theta: &Theta) -> f32 {
    mixing(theta).row_seen
}

/// Variance of a pixel's colour from that of each colour before, where pixels share their chroma: `[of][from]`.
pub(super) fn shared(theta: &Theta) -> Option<[[f32; 3]; 3]> {
    mixing(theta).shared
}
