//! Arguments of `board`.

use std::path::PathBuf;

use clap::ValueEnum;

/// Arguments of `board`.
#[derive(Debug, clap::Args)]
pub struct Board {
    /// A folder with photographs or frames of the target, or the files themselves (PNG, JPEG)
    #[arg(required = true)]
    pub frames: Vec<PathBuf>,
    /// What is printed on the board
    #[arg(long, value_enum, default_value_t)]
    pub pattern: PatternName,
    /// Its columns and rows: inner corners of a checkerboard, squares of a ChArUco board (as OpenCV counts them), tags
    /// of an AprilGrid
    #[arg(long, value_parser = size)]
    pub size: Option<[usize; 2]>,
    /// Side of a square, of an AprilGrid of a tag (Kalibr's tagSize), m (1: squares are the unit of length)
    #[arg(long, default_value_t = 1.0, value_parser = side_m)]
    pub square_m: f64,
    /// ChArUco: side of a marker over that of a square [default: 0.75]
    #[arg(long, value_parser = share)]
    pub marker_share: Option<f64>,
    /// AprilGrid: gap between two tags over the side of one (Kalibr's tagSpacing) [default: 0.3]
    #[arg(long, value_parser = spacing)]
    pub tag_spacing: Option<f64>,
    /// ChArUco: OpenCV's name of the dictionary [default: DICT_5X5_100]
    #[arg(long)]
    pub dictionary: Option<String>,
    /// Kalibr's target.yaml of a checkerboard or an AprilGrid, in place of --pattern, --size, --square-m and
    /// --tag-spacing
    #[arg(long, conflicts_with_all = ["size", "square_m", "pattern", "tag_spacing", "marker_share", "dictionary"])]
    pub target: Option<PathBuf>,
    /// Corners that another tool has found, lines of file,col,row,u_px,v_px, instead of looking for them
    #[arg(long)]
    pub corners: Option<PathBuf>,
    /// The frames follow each other at this rate, Hz (a frames.csv beside them says it too); without both they are
    /// stills
    #[arg(long, value_parser = super::args_values::rate_hz)]
    pub fps: Option<f64>,
    /// Write frames of means over so many px by so many: large stills are more than a diagnosis can hold. Corners are
    /// found in the pictures as they are
    #[arg(long, default_value_t = 1, value_parser = times)]
    pub shrink: usize,
    /// Folder for the capture; made if absent
    #[arg(long)]
    pub out: PathBuf,
    /// Write even if the folder holds files of other origin
    #[arg(long)]
    pub overwrite: bool,
}

impl Board {
    /// No option is accepted and ignored: those of another pattern are refused.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self) -> Result<(), String> {
        let given = [
            ("--marker-share", self.marker_share.is_some(), PatternName::Charuco),
            ("--dictionary", self.dictionary.is_some(), PatternName::Charuco),
            ("--tag-spacing", self.tag_spacing.is_some(), PatternName::Aprilgrid),
        ];
        let name =
            |p: PatternName| p.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
        match given.into_iter().find(|(_, is_given, of)| *is_given && *of != self.pattern) {
            Some((option, ..)) => {
                Err(format!("{option} has no meaning with --pattern {}", name(self.pattern)))
            }
            None => Ok(()),
        }
    }
}

/// `--pattern`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PatternName {
    /// Squares, dark and bright in turns
    #[default]
    Checkerboard,
    /// A checkerboard with ArUco markers in its bright squares, laid out as by OpenCV since 4.6
    Charuco,
    /// AprilTags of the family t36h11 with squares between them, laid out and numbered as by Kalibr
    Aprilgrid,
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let number = |t: &str| t.trim().parse().ok().filter(|n| (2..1000).contains(n));
    let both = text.split_once(['x', 'X', '\u{d7}']).and_then(|(a, b)| Some([number(a)?, number(b)?]));
    both.ok_or_else(|| "columns and rows as in 9x6, each 2 to 999".to_owned())
}

fn side_m(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(side) if (1e-6..=1e3).contains(&side) => Ok(side),
        _ => Err("a length in m, 1e-6 to 1000".to_owned()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if (0.2..=0.95).contains(&share) => Ok(share),
        _ => Err("a share of a square's side, 0.2 to 0.95".to_owned()),
    }
}

fn spacing(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(spacing) if (0.05..=1.0).contains(&spacing) => Ok(spacing),
        _ => Err("a share of a tag's side, 0.05 to 1".to_owned()),
    }
}

fn times(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(times @ 1..=64) => Ok(times),
        _ => Err("a whole number, 1 to 64".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::size;

    #[test]
    fn a_size_has_any_sign_of_times() {
        for text in ["9x6", "9X6", "9\u{d7}6", " 9 \u{d7} 6 "] {
            assert_eq!(size(text), Ok([9, 6]), "{text}");
        }
        for text in ["9", "9*6", "9\u{d7}", "1x6", "9xx6"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
