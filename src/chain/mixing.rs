//! What steps that mix pixels leave of noise.

/// What is left of the variance of white noise, by statistic: shares of what white noise would give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Of single pixels.
    pub pixel: f32,
    /// Of single pixels, of a pattern: what is the same in two frames of which the content moves. A file that rounds a
    /// pattern and a picture together makes another of it in every frame.
    pub steady: f32,
    /// Of differences to the mean of two others along the row, by their distance of 2 and 4 px.
    pub high_pass: [f32; 2],
    /// Of differences of means over blocks of 2, 4 and 8 px.
    pub bands: [f32; 3],
    /// Of means of rows, and of columns.
    pub lines: [f32; 2],
}

impl Left {
    /// All of the noise.
    pub const ALL: Self =
        Self { pixel: 1.0, steady: 1.0, high_pass: [1.0; 2], bands: [1.0; 3], lines: [1.0; 2] };

    fn each(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            pixel: f(self.pixel, other.pixel),
            steady: f(self.steady, other.steady),
            high_pass: [0, 1].map(|i| f(self.high_pass[i], other.high_pass[i])),
            bands: [0, 1, 2].map(|i| f(self.bands[i], other.bands[i])),
            lines: [0, 1].map(|i| f(self.lines[i], other.lines[i])),
        }
    }

    /// What two steps leave one after the other.
    pub fn times(&self, other: &Self) -> Self {
        self.each(other, |a, b| a * b)
    }

    /// Between the two.
    pub fn mix(&self, other: &Self, t: f32) -> Self {
        self.each(other, |a, b| a * (1.0 - t) + b * t)
    }

    /// Rounding of little noise makes more of it than there was; beyond a limit that is no share of anything.
    pub fn at_most(&self, most: f32) -> Self {
        self.each(self, |v, _| v.min(most))
    }
}

/// What steps that mix pixels, linearly, leave of noise that is white before them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixing {
    /// Share of the variance of a pixel, by channel.
    pub pixel: [f32; 3],
    /// Share of the variance of the noise of rows in a pixel, by channel.
    pub row: [f32; 3],
    /// The same in the mean of a row over its colours, beside the mean of the two rows that lie the second of
    /// [`DISTANCES`] away: neighbours share what a filter spreads.
    pub row_seen: f32,
    /// By channel: of means over blocks and lines, over what the pixels' own variance behind the step would give them.
    pub left: [Left; 3],
    /// Share of the variance of brightness: of pixels, and of differences along the row as in [`Left::high_pass`].
    pub luma: [f32; 3],
    /// Where colours are mixed with it: what of each colour's variance each colour has, `[of][from]`.
    pub shared: Option<[[f32; 3]; 3]>,
}

impl Mixing {
    /// None.
    pub const NONE: Self = Self {
        pixel: [1.0; 3],
        row: [1.0; 3],
        row_seen: 1.0,
        left: [Left::ALL; 3],
        luma: [1.0; 3],
        shared: None,
    };
}

/// Distances of [`Left::high_pass`], px.
pub const DISTANCES: [usize; 2] = [2, 4];
/// Sides of the blocks of [`Left::bands`], px.
pub const BANDS: [usize; 3] = [2, 4, 8];
