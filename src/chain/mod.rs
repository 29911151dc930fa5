//! What an effect is: its name, its parameters with units and ranges, its place in the light path.

mod params;
pub mod rng;

pub use params::{ParamKind, ParamSpec, Settings, Value};

use crate::error::Result;

/// What the numbers of a picture mean at a place of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// Linear radiance, 1 = white.
    LinearRgb,
    /// Electrons in the pixel's well.
    Electrons,
    /// Digital numbers before the ISP.
    RawDn,
    /// Values after the tone curve, 0 to 1.
    EncodedRgb,
}

/// Where in the chain an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Decides which instants a line sees; acts while the frame is rendered.
    Time,
    /// Changes pixel values, from the first domain to the second.
    Pixel(Domain, Domain),
}

/// One physical cause. Its id is the stem of its files, the table in `camera.toml` and the name in reports.
pub trait Effect: Sync {
    /// The stem.
    fn id(&self) -> &'static str;
    /// Parameters with unit, range and neutral value.
    fn specs(&self) -> &'static [ParamSpec];
    /// Where it acts.
    fn stage(&self) -> Stage;
    /// Things that are allowed but worth saying, given the whole camera ("readout longer than the frame period").
    ///
    /// # Errors
    /// Values that contradict each other.
    fn check(&self, _settings: &Settings, _frame_period_s: f64) -> Result<Vec<String>> {
        Ok(Vec::new())
    }
}
