//! What an effect is: its name, its parameters with units and ranges, its place in the light path, and how it computes.
//!
//! `docs/add-an-effect.md` walks through a real one.

mod filter;
mod fit;
mod handle;
mod mixed;
mod mixing;
mod moments;
mod pack;
mod params;
mod plan;
pub mod rng;
mod spread;

pub use filter::Filter;
pub use fit::{Fit, Held, Law, Trial};
pub use handle::{Choice, Number};
pub use mixed::{Mixed, mixing};
pub use mixing::{BANDS, DISTANCES, Left, Mixing};
pub use moments::{Moments, Noise, Variances};
pub use pack::{PARAMETER_BYTES, Packed, Packer, Parameters, SLOT_ROWS, slot_of};
pub use params::{ParamKind, ParamSpec, Settings, Value, neutral};
pub use plan::{PASS_CONSTANTS, Plan, Step, Wanted, check_order};
pub use spread::{Origins, Spread};

use crate::camera::{Intrinsics, ShutterTiming};
use crate::error::Result;
use crate::plane::Plane;

/// What the numbers of a picture mean at a place of the chain, in the order in which light becomes a file. Values are
/// fractions of full scale throughout, so the way from one to a later one changes no bit; there is no way back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Domain {
    /// Linear radiance, 1 = white.
    LinearRgb,
    /// Electrons in the pixel's well, in units of those at white.
    Electrons,
    /// Digital numbers before the ISP, in units of the largest; linear in the electrons.
    RawDn,
    /// Values after the tone curve, 0 to 1.
    EncodedRgb,
}

/// Where in the chain an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Another camera, pose or time than the files say: acts where a frame is requested.
    SetUp,
    /// Decides where on the sensor light falls; acts while the frame is rendered.
    Geometry,
    /// Decides which instants a line sees; acts while the frame is rendered.
    Time,
    /// Changes pixel values, from the first domain to the second.
    Pixel(Domain, Domain),
}

/// What a frame has besides its pixels, for effects that depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Size and pinhole.
    pub intrinsics: Intrinsics,
    /// When its lines are exposed.
    pub shutter: ShutterTiming,
    /// Number of the frame.
    pub frame: u32,
    /// Seed of the noise that changes from frame to frame.
    pub seed: u64,
}

/// A pixel, for the references of effects.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Column and row.
    pub pixel: [u32; 2],
    /// The frame.
    pub view: &'a View,
    /// The picture before the kernel that holds the effect, shape `[height, width, 4]`.
    pub source: &'a Plane<f32>,
    /// [`Effect::variant`] of the effect.
    pub variant: u32,
}

/// One dispatch of an effect that reads its neighbours. `source` is what the pass before it made, `original` the
/// picture before the effect, `target` a third one (`glsl/include/chain.glsl`).
#[derive(Clone, Copy, Debug)]
pub struct Pass {
    /// File name of its kernel.
    pub file: &'static str,
    /// Specialization constants [`PASS_CONSTANTS`] and the next.
    pub constants: [u32; 2],
    /// Columns and rows that one invocation makes.
    pub run: [u32; 2],
}

/// How an effect computes.
#[derive(Clone, Copy)]
pub enum Work {
    /// Not on pixels: it acts where frames are requested or rendered.
    Elsewhere,
    /// One pixel alone: the function of its name in `glsl/include/effects/<stem>.glsl`, fused with others, and its
    /// twin.
    Pointwise(fn([f32; 3], &At<'_>, &Parameters<'_>) -> [f32; 3]),
    /// Kernels of its own, and the twin of all of them: both pictures have the shape `[height, width, 4]`.
    Neighbourhood {
        /// The dispatches.
        passes: fn(&Settings) -> Vec<Pass>,
        /// The same on the CPU.
        reference: fn(&Plane<f32>, &Settings, &Parameters<'_>) -> Plane<f32>,
    },
    /// On the delivered picture, shape `[height, width, 3]`, on the CPU.
    Host(fn(&mut Plane<u8>, &Settings)),
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
    /// All that is worth saying of its settings: what changes nothing beside the others, and what [`Self::check`] says.
    ///
    /// # Errors
    /// Those of [`Self::check`].
    fn warnings(&self, settings: &Settings, frame_period_s: f64) -> Result<Vec<String>> {
        let said = self.check(settings, frame_period_s)?;
        Ok(settings.idle(self.id(), self.specs()).into_iter().chain(said).collect())
    }
    /// Which of its parts change anything with these settings, one bit a part: kernels are made without the others. 0:
    /// none, the effect is left out, so that neutral parameters return the input bit for bit.
    fn variant(&self, settings: &Settings) -> u32 {
        u32::from(!settings.is_neutral(self.id(), self.specs()))
    }
    /// What it does to the mean and the spread of values.
    fn moments(&self) -> Moments {
        Moments::Twin
    }
    /// Footage in which it shows best, so that what resembles it elsewhere does not.
    fn shown_by(&self) -> &'static str {
        match (self.stage(), self.moments()) {
            (Stage::SetUp | Stage::Geometry, _) => {
                "straight edges in the middle of the picture and out to its corners, camera at rest"
            }
            (Stage::Time, _) => "upright edges in a fast pan, and level ones in a fast tilt",
            (_, Moments::Noise(_) | Moments::Stuck) => {
                "twenty frames of evenly lit cards from nearly black to nearly white, camera at rest"
            }
            (_, moments) if moments.mixes() => "fine coloured detail and a slanted edge, camera at rest",
            (_, Moments::File(_)) => "smooth gradients beside fine texture",
            (_, Moments::Light(_)) => "an evenly lit wall that fills the picture",
            (_, Moments::Colors(_)) => "a chart of saturated colours and greys",
            _ => "a grey scale from black to white",
        }
    }
    /// Why a diagnosis does not look for it; nothing where it does.
    fn undiagnosed(&self) -> Option<&'static str> {
        None
    }
    /// How it computes.
    fn work(&self) -> Work {
        Work::Elsewhere
    }
    /// Whether it reads neighbours of the picture before it, though it changes one pixel at a time: it is then the
    /// first of its kernel.
    fn reads_neighbours(&self, _settings: &Settings) -> bool {
        false
    }
    /// Whether it fills in the colours that a mosaic of filters leaves out: raw pictures are what there was before it.
    fn fills_mosaic(&self) -> bool {
        false
    }
    /// Writes what its kernels need for a frame, in the order in which they read it.
    fn pack(&self, _settings: &Settings, _view: &View, _packer: &mut Packer<'_>) {}
}
