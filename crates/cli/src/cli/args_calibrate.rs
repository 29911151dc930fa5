//! Arguments of `calibrate flat`, `calibrate edge` and `calibrate readout`.

use std::path::PathBuf;

use super::args_names::EncodingName;

/// What the three have in common.
#[derive(Debug, clap::Args)]
pub struct Common {
    /// Folder for camera.toml, report.json and figures; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
    /// Camera to which the tables are added
    #[arg(long)]
    pub camera: Option<PathBuf>,
    /// What the values of the pictures mean
    #[arg(long, value_enum, default_value_t)]
    pub encoding: EncodingName,
}

/// Arguments of `calibrate flat`.
#[derive(Debug, clap::Args)]
pub struct CalibrateFlat {
    /// Two or more pictures of an evenly lit surface by one camera, or a folder of them
    #[arg(required = true)]
    pub frames: Vec<PathBuf>,
    /// Pictures with the cap on, as often as wanted, or a folder of them: for offsets (DSNU) and hot pixels
    #[arg(long)]
    pub dark: Vec<PathBuf>,
    /// pattern.exr of another run, to ask whether it is the same sensor
    #[arg(long)]
    pub pattern: Option<PathBuf>,
    /// What the commands have in common.
    #[command(flatten)]
    pub common: Common,
}

/// Arguments of `calibrate edge`.
#[derive(Debug, clap::Args)]
pub struct CalibrateEdge {
    /// A picture with a straight edge, slanted by about five degrees
    pub photo: PathBuf,
    /// The part with the edge: left,top,width,height in px (else the best is looked for)
    #[arg(long, value_parser = region)]
    pub region: Option<[usize; 4]>,
    /// What the commands have in common.
    #[command(flatten)]
    pub common: Common,
}

/// Arguments of `calibrate readout`.
#[derive(Debug, clap::Args)]
pub struct CalibrateReadout {
    /// Pictures of an evenly lit surface under a blinking light, one or an even number of the same scene
    #[arg(required = true)]
    pub photos: Vec<PathBuf>,
    /// How often a second the light blinks
    #[arg(long, value_parser = blinks_hz)]
    pub led_hz: f64,
    /// What the commands have in common.
    #[command(flatten)]
    pub common: Common,
}

fn region(text: &str) -> Result<[usize; 4], String> {
    let all: Option<Vec<usize>> = text.split(',').map(|t| t.trim().parse().ok()).collect();
    let four = all.and_then(|all| <[usize; 4]>::try_from(all).ok());
    four.ok_or_else(|| "left,top,width,height in px, as in 100,80,64,64".to_owned())
}

fn blinks_hz(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(rate) if (1.0..=1e7).contains(&rate) => Ok(rate),
        _ => Err("a number of Hz, 1 to 1e7".to_owned()),
    }
}
