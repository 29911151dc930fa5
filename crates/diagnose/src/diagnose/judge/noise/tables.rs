//! Values by brightness.

use crate::diagnose::expect::tone::Tone;

/// Bins of brightness.
pub(super) const BINS: usize = 32;

/// The bin of brightness of a value, DN.
pub(super) fn bin_of(dn: f32) -> usize {
    ((dn / 8.0) as usize).min(BINS - 1)
}

/// Linear values, and their slope by DN, by whole DN and channel.
pub(super) struct Tables {
    linear: Vec<[f32; 3]>,
    pub(super) slopes: Vec<[f32; 3]>,
}

impl Tables {
    pub(super) fn of(tone: &Tone) -> Self {
        let linear = (0..257).map(|dn| [0, 1, 2].map(|c| tone.decode(dn as f32, c))).collect();
        let slopes = (0..256).map(|dn| [0, 1, 2].map(|c| tone.slope_at(dn as f32, c))).collect();
        Self { linear, slopes }
    }

    pub(super) fn decode(&self, dn: f32, c: usize) -> f32 {
        let i = dn as usize;
        self.linear[i][c] + (self.linear[i + 1][c] - self.linear[i][c]) * (dn - i as f32)
    }
}
