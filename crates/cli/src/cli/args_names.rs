//! Names that options of the command line take.

use clap::ValueEnum;

use crate::formats::Format;
use shutterbug::engine::Gather;
use shutterbug_diagnose::calibrate::Encoding;

/// `--from`, `--to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FormatName {
    /// camera.toml
    Toml,
    /// ROS camera_info YAML
    Ros,
    /// Kalibr camchain YAML
    Kalibr,
    /// EuRoC / ASL sensor.yaml
    Euroc,
    /// Gyroflow's lens profile (JSON)
    Gyroflow,
    /// Gazebo SDF (to write only)
    Sdf,
}

/// `--encoding`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EncodingName {
    /// Made for viewing
    #[default]
    Srgb,
    /// Raw: proportional to light
    Linear,
}

impl From<EncodingName> for Encoding {
    fn from(name: EncodingName) -> Self {
        match name {
            EncodingName::Srgb => Self::Srgb,
            EncodingName::Linear => Self::Linear,
        }
    }
}

/// `--gather`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum GatherName {
    /// The bits of the reference, a tap a px
    Exact,
    /// A tap every second px, weights of 8 bits
    Bilinear,
    /// The nearest texel, a tap a px
    Fast,
}

/// `--form`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FormName {
    /// A scene and a path
    #[default]
    Capture,
    /// Simulated frames of the same moments, with depth and the path
    Pairs,
    /// Simulated frames at poses that are a little off, and nothing else
    Rough,
    /// Simulated frames of the same room from another path
    Unpaired,
}

/// `--method`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// One render with every line at its own time, blurred along the paths of its samples
    #[default]
    Exact,
    /// One render and a warp along the paths of what it shows
    Fast,
    /// Many renders over the frame, each weighed into the lines that see it: the reference
    Accumulation,
    /// One render, motion images, remap and blur as published in 2008
    Paper,
}

/// `--planes`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PlaneName {
    /// Linear R, G, B and coverage A
    Color,
    /// forward.u, forward.v: px moved from this frame to the next
    Motion,
    /// Z: metres along the optical axis
    Depth,
}

/// `--shift`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShiftName {
    /// The frame's start
    Start,
    /// The frame's middle
    Middle,
}

/// `--motion-source`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MotionSourceName {
    /// From the projections of every surface point
    Rasterized,
    /// From depth and two camera matrices
    Depth,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Toml => Self::Toml,
            FormatName::Ros => Self::Ros,
            FormatName::Kalibr => Self::Kalibr,
            FormatName::Euroc => Self::Euroc,
            FormatName::Gyroflow => Self::Gyroflow,
            FormatName::Sdf => Self::Sdf,
        }
    }
}

impl From<GatherName> for Gather {
    fn from(name: GatherName) -> Self {
        match name {
            GatherName::Exact => Self::Exact,
            GatherName::Bilinear => Self::Bilinear,
            GatherName::Fast => Self::Fast,
        }
    }
}
