//! What can be said on the command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

use crate::engine::{AccumulationOptions, Method, MotionSource, PaperOptions, Shift};
use crate::formats::Format;

/// What a real, cheap, moving camera does to a picture.
#[derive(Debug, Parser)]
#[command(name = "shutterbug", version, about)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render every frame of a capture as its camera would have delivered it
    Simulate(Simulate),
    /// List the Vulkan devices, what each can do and what it lacks
    Devices,
    /// List the presets of real cameras, or print one as camera.toml
    Presets {
        /// The preset to print
        name: Option<String>,
    },
    /// Cameras in other tools' files
    #[command(subcommand)]
    Camera(Camera),
    /// Make frames.csv, trajectory.tum and, where it can, camera.toml of a recording
    Import(Import),
}

/// What can be done with a camera.
#[derive(Debug, Subcommand)]
pub enum Camera {
    /// Convert between camera.toml, ROS camera_info, Kalibr camchain, EuRoC sensor.yaml and (to) Gazebo SDF
    Convert(Convert),
}

/// Arguments of `camera convert`.
#[derive(Debug, clap::Args)]
pub struct Convert {
    /// The camera's file
    pub input: PathBuf,
    /// File to write (standard output if not given)
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Format of the input (else its content decides)
    #[arg(long, value_enum)]
    pub from: Option<FormatName>,
    /// Format to write (else by the ending of --out: .toml or .sdf)
    #[arg(long, value_enum)]
    pub to: Option<FormatName>,
    /// Frame rate, where the input states none: camera.toml needs one
    #[arg(long, value_parser = rate_hz)]
    pub rate_hz: Option<f64>,
    /// Which camera of a camchain (else the first)
    #[arg(long)]
    pub name: Option<String>,
}

/// Arguments of `import`.
#[derive(Debug, clap::Args)]
pub struct Import {
    /// A EuRoC mav0 folder (or the one above it), or a file of KITTI poses
    pub input: PathBuf,
    /// Folder for the files; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// EuRoC: which camera's folder
    #[arg(long, default_value = "cam0")]
    pub name: String,
    /// KITTI: the poses' times (else times.txt beside them)
    #[arg(long)]
    pub times: Option<PathBuf>,
    /// Replace files that are there
    #[arg(long)]
    pub overwrite: bool,
}

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
    /// Gazebo SDF (to write only)
    Sdf,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Toml => Self::Toml,
            FormatName::Ros => Self::Ros,
            FormatName::Kalibr => Self::Kalibr,
            FormatName::Euroc => Self::Euroc,
            FormatName::Sdf => Self::Sdf,
        }
    }
}

/// Arguments of `simulate`.
#[derive(Debug, clap::Args)]
pub struct Simulate {
    /// Folder with camera.toml, scene.obj, trajectory.tum and frames.csv
    pub capture: PathBuf,
    /// Folder for the frames (NNNNNN.png), instants.csv and simulate.json; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Use this camera instead of the capture's camera.toml; ROS, Kalibr and EuRoC YAML are read too
    #[arg(long)]
    pub camera: Option<PathBuf>,
    /// Add the effects of a preset (see `shutterbug presets`); the camera's own tables win
    #[arg(long)]
    pub preset: Option<String>,
    /// How shutter and blur are made
    #[arg(long, value_enum, default_value_t)]
    pub method: MethodName,
    /// Seed of all noise
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Samples a pixel
    #[arg(long, default_value_t = 16, value_parser = samples)]
    pub samples: u32,
    /// Print the time of each pass and write timings.json
    #[arg(long)]
    pub timings: bool,
    /// Sharp planes of the same frames, as EXR in DIR/color, DIR/motion, DIR/depth
    #[arg(long, value_enum, value_delimiter = ',')]
    pub planes: Vec<PlaneName>,
    /// Go on with an interrupted run: frames that are there stay
    #[arg(long)]
    pub resume: bool,
    /// Device by index, UUID or (part of its) name; else $SHUTTERBUG_DEVICE, else the first
    #[arg(long)]
    pub device: Option<String>,
    /// Frames in flight
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub frames_in_flight: u32,
    /// accumulation: renders a frame (else so many that nothing moves more than half a px from one to the next)
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub renders: Option<u32>,
    /// paper: motion images a frame, 1 (constant velocity) to 6
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=6))]
    pub motion_images: u32,
    /// paper: render the picture at the frame's start (f) or middle (f - 0.5)
    #[arg(long, value_enum, default_value_t)]
    pub shift: ShiftName,
    /// paper: most samples of the blur; the count follows the length of the path
    #[arg(long, default_value_t = 240, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub max_blur_samples: u32,
    /// paper: motion rasterized, or reconstructed from depth (knows no moving objects)
    #[arg(long, value_enum, default_value_t)]
    pub motion_source: MotionSourceName,
    /// paper: count the pixel's place in its line as time too (eq. 5 instead of eq. 6)
    #[arg(long)]
    pub pixel_time: bool,
}

/// `--method`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Many renders over the frame, each weighed into the lines that see it: the reference
    #[default]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ShiftName {
    /// The frame's start
    Start,
    /// The frame's middle
    #[default]
    Middle,
}

/// `--motion-source`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MotionSourceName {
    /// From the projections of every surface point
    #[default]
    Rasterized,
    /// From depth and two camera matrices
    Depth,
}

impl Simulate {
    /// The engine's method.
    pub fn engine_method(&self) -> Method {
        match self.method {
            MethodName::Accumulation => {
                Method::Accumulation(AccumulationOptions { renders: self.renders, ..Default::default() })
            }
            MethodName::Paper => Method::Paper(PaperOptions {
                motion_images: self.motion_images,
                shift: match self.shift {
                    ShiftName::Start => Shift::Start,
                    ShiftName::Middle => Shift::Middle,
                },
                max_samples: self.max_blur_samples,
                pixel_time: self.pixel_time,
                motion_source: match self.motion_source {
                    MotionSourceName::Rasterized => MotionSource::Rasterized,
                    MotionSourceName::Depth => MotionSource::Depth,
                },
            }),
        }
    }

    /// The method's name on the command line.
    pub fn method_name(&self) -> String {
        self.method.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
    }
}

fn samples(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(n @ (1 | 4 | 16)) => Ok(n),
        _ => Err("samples a pixel are 1, 4 or 16".to_owned()),
    }
}

fn rate_hz(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(rate) if (1.0 / 86_400.0..=1e6).contains(&rate) => Ok(rate),
        _ => Err("a frame rate is a number of Hz, 1 a day to 1e6".to_owned()),
    }
}
