//! Rasterizes a scene on the device: samples of colour, motion and depth.

mod exact_place;
mod geometry;
mod instants;
mod kind;
mod knots;
mod lens;
mod raster_place;
mod scene_buffers;
mod target;
mod tessellate;

pub use exact_place::{Place, PlaceInput, PlacePush};
pub use geometry::Geometry;
pub use instants::{CameraRow, Instant, ObjectRow, instant_rows};
pub use kind::RasterKind;
pub use knots::{KnotRow, MotionGroups, RelativeRow, View, moved_row, moved_rows, relative_rows, spaced};
pub use lens::LensPush;
pub use scene_buffers::SceneBuffers;
pub use target::{Drawn, RasterInput, RasterTarget};
pub use tessellate::Mesh;

use crate::error::{Error, Result};

/// How the samples of a pixel come about: `grid` supersampling, each texel of it multisampled `msaa` times.
///
/// 16 samples are a 2x2 grid of the standard 4x pattern wherever 4x exists, also on devices that offer more: the
/// pattern, and with it the picture, is then the same everywhere, textures are shaded four times a pixel, and on
/// lavapipe it costs 1.4 to 1.6 times less than jittered passes that are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplePlan {
    /// Columns and rows of the supersampling grid.
    pub grid: u32,
    /// Samples a texel.
    pub msaa: u32,
}

impl SamplePlan {
    /// The plan for 1, 4 or 16 samples on a device with these sample counts.
    ///
    /// # Errors
    /// Another number of samples.
    pub fn new(samples: u32, supported: &[u32]) -> Result<Self> {
        if ![1, 4, 16].contains(&samples) {
            let why = "samples a pixel are 1, 4 or 16".to_owned();
            return Err(Error::Limit { what: "samples a pixel", value: samples.into(), limit: 16, why });
        }
        let msaa = if samples >= 4 && supported.contains(&4) { 4 } else { 1 };
        Ok(Self { grid: (samples / msaa).isqrt(), msaa })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_is_made_up_on_every_device() {
        for supported in [&[1][..], &[1, 4], &[1, 2, 4, 8], &[1, 2]] {
            for samples in [1, 4, 16] {
                let plan = SamplePlan::new(samples, supported).expect("a valid count");
                assert_eq!(plan.grid * plan.grid * plan.msaa, samples, "{supported:?}");
                assert!(supported.contains(&plan.msaa));
            }
        }
        assert!(SamplePlan::new(8, &[1, 4, 8]).is_err());
    }
}
