//! Commands and options of the command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum as _};

use super::args_board::Board;
use super::args_calibrate::{CalibrateEdge, CalibrateFlat, CalibrateReadout};
use super::args_import::Import;
pub use super::args_names::{
    EncodingName, FormName, FormatName, GatherName, MethodName, MotionSourceName, PlaneName, ShiftName,
};
use super::args_values::{gather_kernel, in_steps, rate_hz, samples};
use shutterbug::engine::{
    AccumulationOptions, ExactOptions, FastOptions, Gather, GatherKernel, Method, MotionSource, PaperOptions,
    Shift,
};

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
    /// Find which camera effects a simulation lacks: compare real frames with simulated ones
    Diagnose(Diagnose),
    /// Blind trials of diagnose: hide effects, diagnose, score
    Withhold(Withhold),
    /// List the Vulkan devices, what each can do and what it lacks
    Devices(Devices),
    /// List the effects that camera.toml may hold, with parameters, units, ranges and neutral values
    Effects,
    /// List the presets of real cameras, search them, or print one as camera.toml
    Presets(Presets),
    /// Cameras in other tools' files
    #[command(subcommand)]
    Camera(Camera),
    /// Turn a recording (MCAP, ROS bag, EuRoC, TUM, KITTI, video) into frames with times, camera, poses and gyro; list
    /// it without --out
    Import(Import),
    /// Turn photographs or a recording of a calibration board into a capture
    Board(Board),
    /// Measure a camera from its pictures
    #[command(subcommand)]
    Calibrate(Calibrate),
}

/// `shutterbug presets`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Presets {
    /// What to do; without it, list what ships
    #[command(subcommand)]
    pub action: Option<PresetsAction>,
    /// The preset to print, as `show` does
    pub name: Option<String>,
}

/// What can be done with presets.
#[derive(Debug, Subcommand)]
pub enum PresetsAction {
    /// List the presets in whose description every word occurs
    Search {
        /// Words, such as `gopro hero9 wide`
        #[arg(required = true)]
        words: Vec<String>,
        /// Folder of lens profiles (Gyroflow's JSON, or tables of them) [default: the one that SHUTTERBUG_PROFILES
        /// names]
        #[arg(long)]
        profiles: Option<PathBuf>,
    },
    /// Print one as camera.toml, with source, error and licence
    Show {
        /// Its name, as `search` prints it
        name: String,
        /// Folder of lens profiles [default: the one that SHUTTERBUG_PROFILES names]
        #[arg(long)]
        profiles: Option<PathBuf>,
    },
}

/// What can be done with a camera.
#[derive(Debug, Subcommand)]
pub enum Camera {
    /// Convert between camera.toml, ROS camera_info, Kalibr camchain, EuRoC sensor.yaml, Gyroflow's lens profile and
    /// (to) Gazebo SDF
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
    /// Replace the file that is there
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Frame rate, where the input states none: camera.toml needs one
    #[arg(long, value_parser = rate_hz)]
    pub rate_hz: Option<f64>,
    /// Which camera of a camchain (else the first)
    #[arg(long)]
    pub name: Option<String>,
}

/// What `calibrate` measures.
#[derive(Debug, Subcommand)]
pub enum Calibrate {
    /// Noise, from two or more frames of one static scene
    Noise(CalibrateNoise),
    /// Fall-off, the sensor's pattern and noise, from pictures of an evenly lit surface and with the cap on
    Flat(CalibrateFlat),
    /// Sharpness, from a slanted edge (ISO 12233)
    Edge(CalibrateEdge),
    /// Readout, from the stripes that a blinking light makes
    Readout(CalibrateReadout),
}

/// Arguments of `calibrate noise`.
#[derive(Debug, clap::Args)]
pub struct CalibrateNoise {
    /// Frames of one static scene (PNG of 8 or 16 bits, JPEG)
    #[arg(required = true)]
    pub frames: Vec<PathBuf>,
    /// Folder for camera.toml, camera_paper.toml, report.json, noise.png and ptc.png; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
    /// The frames are pairs, each of its own scene: A B, C D, ...; written to DIR/pair_NN
    #[arg(long)]
    pub pairs: bool,
    /// Camera to which the tables are added; its [black_level] is taken off the values
    #[arg(long)]
    pub camera: Option<PathBuf>,
    /// What the values of the frames mean
    #[arg(long, value_enum, default_value_t)]
    pub encoding: EncodingName,
    /// Seed of the simulated frames
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// Arguments of `simulate`.
#[derive(Debug, clap::Args)]
pub struct Simulate {
    /// Folder with camera.toml, scene.obj, trajectory.tum and frames.csv
    pub capture: PathBuf,
    /// Folder for the frames (NNNNNN.png), instants.csv and simulate.json; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
    /// Use this camera instead of the capture's camera.toml; ROS, Kalibr and EuRoC YAML are read too
    #[arg(long)]
    pub camera: Option<PathBuf>,
    /// Folder of a diagnosis: use its corrected path and surface brightness
    #[arg(long)]
    pub description: Option<PathBuf>,
    /// Add the effects of a preset (see `shutterbug presets`); the camera's own tables win
    #[arg(long)]
    pub preset: Option<String>,
    /// Folder of lens profiles for --preset [default: the one that SHUTTERBUG_PROFILES names]
    #[arg(long, requires = "preset")]
    pub profiles: Option<PathBuf>,
    /// How shutter and blur are made
    #[arg(long, value_enum, default_value_t)]
    pub method: MethodName,
    /// Seed of all noise
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Samples per pixel
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
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub frames_in_flight: u32,
    /// Frames in flight; prints frames per second at the end
    #[arg(long, conflicts_with = "frames_in_flight", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub batch: Option<u32>,
    /// accumulation: renders per frame [default: nothing moves more than half a px between two]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub renders: Option<u32>,
    /// paper: motion images per frame, 1 (constant velocity) to 6 [default: 2]; fast: 2, 4 or 6 [default: 4]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=6))]
    pub motion_images: Option<u32>,
    /// paper: render the picture at the frame's start (f) or middle (f - 0.5) [default: middle]
    #[arg(long, value_enum)]
    pub shift: Option<ShiftName>,
    /// paper, fast: most samples of the blur; the count follows the length of the path [default: 240]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub max_blur_samples: Option<u32>,
    /// paper: motion rasterized, or reconstructed from depth (knows no moving objects) [default: rasterized]
    #[arg(long, value_enum)]
    pub motion_source: Option<MotionSourceName>,
    /// paper: accuracy of the gather [default: exact]
    #[arg(long, value_enum)]
    pub gather: Option<GatherName>,
    /// paper: the gather's kernel (see `devices --kernels`) instead of the fastest on the device
    #[arg(long, value_parser = gather_kernel)]
    pub gather_kernel: Option<GatherKernel>,
    /// paper: count the pixel's place in its line as time too (eq. 5 instead of eq. 6)
    #[arg(long)]
    pub pixel_time: bool,
}

/// Arguments of `devices`.
#[derive(Debug, clap::Args)]
pub struct Devices {
    /// Also list the chosen kernels and their times
    #[arg(long)]
    pub kernels: bool,
}

/// Arguments of `diagnose`.
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("described").args(["capture", "sim"])))]
pub struct Diagnose {
    /// Folder with camera.toml, scene.obj, trajectory.tum, frames.csv and real/
    #[arg(required_unless_present = "real", conflicts_with_all = ["sim", "real"])]
    pub capture: Option<PathBuf>,
    /// Frames of any simulator; optional in the folder: depth/, motion/, mask/ (NNNNNN.exr or .png), camera.toml,
    /// trajectory.tum, frames.csv
    #[arg(long, requires = "real")]
    pub sim: Option<PathBuf>,
    /// Real frames, matched by name, by --match or by frames.csv in both folders. Without --sim: footage of a far scene
    /// with frames.csv, camera.toml and imu.csv, as `import` writes it; a gyro tells readout, exposure and the offset
    /// of the clocks
    #[arg(long)]
    pub real: Option<PathBuf>,
    /// CSV file with lines `sim,real`
    #[arg(long = "match", requires = "sim", conflicts_with = "capture")]
    pub matches: Option<PathBuf>,
    /// The folders show different moments: compare camera traces only
    #[arg(long, requires = "sim", conflicts_with_all = ["matches", "capture"])]
    pub unpaired: bool,
    /// A distance of your own, before and after, as "fid {a} {b}": a command that is given two folders of pictures and
    /// prints a number in its last line. It is split into words as by a shell, and run without one
    #[arg(long, requires = "unpaired", conflicts_with_all = ["matches", "capture", "camera", "scene", "poses"])]
    pub distance: Option<String>,
    /// Folder for report.json, camera.toml and pictures; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
    /// Use this camera instead of the capture's camera.toml
    #[arg(long, requires = "described", conflicts_with = "unpaired")]
    pub camera: Option<PathBuf>,
    /// Seed of the bootstrap
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Candidates to leave out, separated by commas
    #[arg(long, value_delimiter = ',')]
    pub without: Vec<String>,
    /// Treat surface brightness as exact, or estimate its errors
    #[arg(long, requires = "described", conflicts_with = "unpaired", value_enum,
        default_value_t = Described::Estimated)]
    pub scene: Described,
    /// Treat poses as exact, or estimate their errors
    #[arg(long, requires = "described", conflicts_with = "unpaired", value_enum,
        default_value_t = Described::Estimated)]
    pub poses: Described,
    /// End after this many seconds; candidates not reached are undetermined
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    pub time_limit_s: u64,
    /// Device by index, UUID or (part of its) name; else $SHUTTERBUG_DEVICE, else the first. Folders of frames
    /// need none
    #[arg(long, conflicts_with_all = ["sim", "real"])]
    pub device: Option<String>,
}

/// How a part of a capture's description is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Described {
    /// As it stands.
    Exact,
    /// Its errors are a candidate.
    Estimated,
}

/// What does not go with `--curve`. Options that require it name these too: clap asks for no option that conflicts with
/// one that is there, and what requires it would be ignored.
const NOT_OF_A_CURVE: [&str; 4] = ["count", "imperfect", "form", "only"];

/// Arguments of `withhold`.
#[derive(Debug, clap::Args)]
pub struct Withhold {
    /// Folder for captures, answers, scores, withhold.json and withhold.html; an interrupted run goes on
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
    /// Number of captures
    #[arg(long, default_value_t = 20, value_parser = in_steps(1, 1_000_000))]
    pub count: usize,
    /// Seed of everything
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Columns of the frames, px
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u32).range(64..=4096))]
    pub width: u32,
    /// Rows of the frames, px
    #[arg(long, default_value_t = 240, value_parser = clap::value_parser!(u32).range(48..=4096))]
    pub height: u32,
    /// Frames per capture [default: 10 to 16]
    #[arg(long, value_parser = in_steps(4, 10_000))]
    pub frames: Option<usize>,
    /// Recorded motion: a TUM file or a folder of them; half of the captures then move like that
    #[arg(long)]
    pub trajectories: Option<PathBuf>,
    /// Measure detection against strength: these effects (or all), each alone; writes curves.json,
    /// curves.png, curves.html
    #[arg(long, value_delimiter = ',', conflicts_with = "count")]
    pub curve: Vec<String>,
    /// --curve: strengths per effect
    #[arg(long, requires = "curve", conflicts_with_all = NOT_OF_A_CURVE, default_value_t = 6,
        value_parser = in_steps(2, 40))]
    pub points: usize,
    /// --curve: captures per strength
    #[arg(long, requires = "curve", conflicts_with_all = NOT_OF_A_CURVE, default_value_t = 3,
        value_parser = in_steps(1, 1000))]
    pub repeats: usize,
    /// Falsify the descriptions of the captures: reflectance, lamps, poses, object, or all
    #[arg(long, value_delimiter = ',', conflicts_with = "curve")]
    pub imperfect: Vec<String>,
    /// What the diagnosis is given
    #[arg(long, value_enum, default_value_t = FormName::Capture, conflicts_with = "curve")]
    pub form: FormName,
    /// Keep the real frames of cases that are done
    #[arg(long)]
    pub keep_frames: bool,
    /// Run only these cases (numbers from 0)
    #[arg(long, value_delimiter = ',', conflicts_with = "curve")]
    pub only: Vec<usize>,
    /// Device of the diagnosis, by index, UUID or (part of its) name
    #[arg(long)]
    pub device: Option<String>,
}

impl Simulate {
    /// The engine's method.
    pub fn engine_method(&self) -> Method {
        match self.method {
            MethodName::Exact => Method::Exact(ExactOptions::default()),
            MethodName::Fast => {
                let usual = FastOptions::default();
                Method::Fast(FastOptions {
                    motion_images: self.motion_images.unwrap_or(usual.motion_images),
                    max_samples: self.max_blur_samples.unwrap_or(usual.max_samples),
                    ..usual
                })
            }
            MethodName::Accumulation => {
                Method::Accumulation(AccumulationOptions { renders: self.renders, ..Default::default() })
            }
            MethodName::Paper => Method::Paper(self.paper_options()),
        }
    }

    fn paper_options(&self) -> PaperOptions {
        let usual = PaperOptions::default();
        PaperOptions {
            motion_images: self.motion_images.unwrap_or(usual.motion_images),
            shift: match self.shift {
                Some(ShiftName::Start) => Shift::Start,
                Some(ShiftName::Middle) => Shift::Middle,
                None => usual.shift,
            },
            max_samples: self.max_blur_samples.unwrap_or(usual.max_samples),
            pixel_time: self.pixel_time,
            motion_source: match self.motion_source {
                Some(MotionSourceName::Rasterized) => MotionSource::Rasterized,
                Some(MotionSourceName::Depth) => MotionSource::Depth,
                None => usual.motion_source,
            },
            gather: self.gather.map_or(usual.gather, Gather::from),
            gather_kernel: self.gather_kernel,
        }
    }

    /// No option is accepted and ignored: those of another method are refused.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self) -> Result<(), String> {
        use MethodName::{Accumulation, Fast, Paper};
        let given: [(&str, bool, &[MethodName]); 8] = [
            ("--gather", self.gather.is_some(), &[Paper]),
            ("--gather-kernel", self.gather_kernel.is_some(), &[Paper]),
            ("--renders", self.renders.is_some(), &[Accumulation]),
            ("--motion-images", self.motion_images.is_some(), &[Paper, Fast]),
            ("--shift", self.shift.is_some(), &[Paper]),
            ("--max-blur-samples", self.max_blur_samples.is_some(), &[Paper, Fast]),
            ("--motion-source", self.motion_source.is_some(), &[Paper]),
            ("--pixel-time", self.pixel_time, &[Paper]),
        ];
        for (option, is_given, methods) in given {
            if is_given && !methods.contains(&self.method) {
                return Err(format!("{option} has no meaning with --method {}", self.method_name()));
            }
        }
        let gather = self.paper_options().gather;
        if let Some(kernel) = self.gather_kernel.filter(|k| k.gather != gather) {
            return Err(format!("--gather-kernel {} is one of --gather {:?}", kernel.name, kernel.gather)
                .to_lowercase());
        }
        if self.method == Fast && !matches!(self.motion_images, None | Some(2 | 4 | 6)) {
            return Err("--motion-images is 2, 4 or 6 with --method fast".to_owned());
        }
        Ok(())
    }

    /// The method's name on the command line.
    pub fn method_name(&self) -> String {
        self.method.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
    }
}
