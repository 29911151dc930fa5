//! How well frames are rendered.

/// How well frames are rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Quality {
    /// One sample a pixel, edges of a rolling shutter to 0.4 px: to find a valley.
    Coarse,
    /// Four samples.
    Fit,
    /// Sixteen samples: what is reported.
    Fine,
    /// Sixty-four, and an exposure in four parts: what samples miss of a pixel is noise in what a fit of a filter takes
    /// for exact, and weakens it.
    Finest,
}
