//! Recordings as folders that can be diagnosed: logs of messages (MCAP, ROS 1 and ROS 2 bags), data sets (EuRoC, TUM,
//! KITTI) and videos become frames, `frames.csv`, `camera.toml`, `trajectory.tum` and `imu.csv` (docs/import.md).
//!
//! A recording comes from a stranger: no length is believed before it is held against the file, and what is damaged is
//! said with its place while the rest is read.

mod bag;
mod camera;
mod choose;
mod chosen;
mod contents;
mod cut;
mod db3;
mod deliver;
mod folders;
mod foxglove;
mod frames;
mod gather;
mod large;
mod listing;
mod log;
mod mcap;
mod messages;
mod pixels;
mod poses;
mod prepared;
mod program;
mod sink;
mod sqlite;
mod tables;
mod topic;
mod tree;
mod unpack;
mod video;
mod video_plan;
mod wire;

use std::path::{Path, PathBuf};

pub use deliver::{Delivered, Watch, deliver};
pub use prepared::{Prepared, Request};

use shutterbug::error::{Error, Result};

/// What an import writes beside the pictures' tables: everything that decides what is written.
pub const RUN_FILE: &str = "import.json";

/// What is wrong with a recording of which a part can be imported: what was found, and what was expected.
pub type Damage = (String, String);

/// A recording of some kind.
#[derive(Debug)]
pub struct Recording(Kind);

#[derive(Debug)]
enum Kind {
    Log(log::Log),
    Folder(folders::Kind, PathBuf),
    KittiPoses(PathBuf),
    Video(video::Video),
}

/// Called with bytes read and wanted.
pub type Progress<'a> = dyn FnMut(u64, u64) -> Result<()> + 'a;

impl Recording {
    /// Finds out what a file or folder is.
    ///
    /// # Errors
    /// What is missing, or is no recording that is read.
    pub fn open(path: &Path) -> Result<Self> {
        if path.is_dir() {
            if let Some(kind) = folders::kind_of(path) {
                return Ok(Self(Kind::Folder(kind, path.to_owned())));
            }
            return match log::Log::open(path)? {
                Some(log) => Ok(Self(Kind::Log(log))),
                None => {
                    let expected = "mav0 (EuRoC), rgb.txt (TUM), calib.txt and times.txt (KITTI), or .mcap or .db3 \
                        files";
                    Err(Error::input(path, None, "a folder of no known kind", expected))
                }
            };
        }
        if let Some(log) = log::Log::open(path)? {
            return Ok(Self(Kind::Log(log)));
        }
        let text = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("txt"));
        Ok(Self(if text {
            Kind::KittiPoses(path.to_owned())
        } else {
            Kind::Video(video::Video::open(path)?)
        }))
    }

    /// What it holds, for a reader.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub fn listing(&self, progress: &mut Progress<'_>) -> Result<(String, Option<Error>)> {
        match &self.0 {
            Kind::Log(log) => {
                let all = gather::gather(log, &mut |at| progress(at, log.bytes))?;
                Ok((listing::listing(log, &all), chosen::broken(&all, "")))
            }
            Kind::Video(video) => Ok((video.listing(), None)),
            Kind::Folder(..) | Kind::KittiPoses(_) => {
                let prepared = self.prepare(&Request::default(), progress)?;
                Ok((listing::of_folder(&prepared), None))
            }
        }
    }

    /// Decides what is imported, and reads everything but the pictures' values.
    ///
    /// # Errors
    /// A topic, frame or file that is not there or is of another kind; content that cannot be used.
    pub fn prepare(&self, request: &Request, progress: &mut Progress<'_>) -> Result<Prepared> {
        self.refuse_idle(request)?;
        let prepared = match &self.0 {
            Kind::Log(log) => {
                let all = gather::gather(log, &mut |at| progress(at, log.bytes))?;
                choose::choose(log, &all, request)?
            }
            Kind::Folder(kind, path) => folders::prepare(*kind, path, request)?,
            Kind::KittiPoses(path) => folders::prepare_poses(path, request)?,
            Kind::Video(video) => video_plan::prepare(video.clone(), request),
        };
        prepared.check_names()?;
        Ok(prepared)
    }

    /// What is asked for and has no meaning for a recording of this kind would be ignored in silence.
    fn refuse_idle(&self, request: &Request) -> Result<()> {
        let (kind, takes): (&str, &[&str]) = match &self.0 {
            Kind::Log(log) => {
                (log.kind(), &["--topic", "--camera-info", "--poses", "--imu", "--body", "--camera-frame"])
            }
            Kind::Folder(folders::Kind::Euroc, _) => ("EuRoC's folder", &["--poses", "--imu", "--name"]),
            Kind::Folder(folders::Kind::Tum, _) => ("TUM's folder", &["--poses"]),
            Kind::Folder(folders::Kind::Kitti, _) => ("KITTI's folder", &["--poses", "--name", "--times"]),
            Kind::KittiPoses(_) => ("KITTI's poses", &["--times"]),
            Kind::Video(_) => ("a video", &[]),
        };
        request.refuse_idle(kind, takes, matches!(self.0, Kind::Log(_)))
    }
}

/// The start of what was found, so that an error stays one line.
fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}
