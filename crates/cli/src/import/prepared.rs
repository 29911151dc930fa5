//! An import that is planned but not yet written.

use std::path::PathBuf;

use super::large::Large;
use super::log::Log;
use super::video::Video;
use crate::formats::Motion;
use shutterbug::camera::{Pose, Stamp};
use shutterbug::capture::FrameEntry;
use shutterbug::error::{Error, Result};
use shutterbug_diagnose::out::MANIFEST_FILE;

/// What says that something is not wanted.
pub(super) const NONE: &str = "none";

/// Whether a way to the poses is one through tf.
pub(super) fn is_tree(way: &str) -> bool {
    way == "tf" || way.starts_with("tf:")
}

/// What of a recording is wanted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// The topic of pictures, where there are several.
    pub topic: Option<String>,
    /// The camera's topic, or `none`; without it, the one beside the pictures.
    pub camera_info: Option<String>,
    /// A topic of poses, `tf`, `tf:PARENT`, `tf:PARENT->CHILD` or `none`.
    pub poses: Option<String>,
    /// The inertial sensor's topic, or `none`.
    pub imu: Option<String>,
    /// The frame whose poses the topic holds, where its messages do not say it.
    pub body: Option<String>,
    /// The camera's frame, where pictures do not say it.
    pub camera_frame: Option<String>,
    /// Every so many-th picture; 0 and 1: all.
    pub every: usize,
    /// EuRoC and KITTI: which camera's folder.
    pub name: Option<String>,
    /// KITTI: the poses' times.
    pub times: Option<PathBuf>,
}

impl Request {
    /// The options that were given, and the recordings that have a use for them.
    fn given(&self) -> [(&'static str, Option<&str>, &'static str); 8] {
        const LOG: &str = "MCAP or a bag";
        let times = self.times.as_ref().map(|_| "");
        [
            ("--topic", self.topic.as_deref(), LOG),
            ("--camera-info", self.camera_info.as_deref(), LOG),
            ("--poses", self.poses.as_deref(), "MCAP, a bag or a data set's folder"),
            ("--imu", self.imu.as_deref(), "MCAP, a bag or EuRoC"),
            ("--body", self.body.as_deref(), LOG),
            ("--camera-frame", self.camera_frame.as_deref(), LOG),
            ("--name", self.name.as_deref(), "EuRoC or KITTI"),
            ("--times", times, "KITTI"),
        ]
    }

    /// Refuses options that a recording of a kind has no use for. `by_name`: its parts have names to choose from.
    pub(super) fn refuse_idle(&self, kind: &str, takes: &[&str], by_name: bool) -> Result<()> {
        let refuse = |option: &str, found: &str, expected: &str| {
            Err(Error::input(std::path::Path::new(option), None, found, expected))
        };
        for (option, value, of) in self.given() {
            let Some(value) = value else { continue };
            if !takes.contains(&option) {
                return refuse(option, kind, of);
            }
            if !by_name && matches!(option, "--poses" | "--imu") && value != NONE {
                let found = format!("`{}` and {kind}, which has no topics", super::shortened(value));
                return refuse(option, &found, NONE);
            }
        }
        match self.poses.as_deref() {
            Some(way) if self.body.is_some() && (way == NONE || is_tree(way)) => {
                let found = format!("--poses {}, which needs no body", super::shortened(way));
                refuse("--body", &found, "--poses with a topic")
            }
            _ => Ok(()),
        }
    }
}

/// What will be written, but for the pictures' values.
#[derive(Debug)]
pub struct Prepared {
    /// The recording.
    pub(super) path: PathBuf,
    /// Of the frames, increasing.
    pub(super) times_ns: Vec<i64>,
    /// The frames' file names, where they have some already; else numbers.
    pub(super) names: Option<Vec<String>>,
    /// World from camera at increasing times, ns; empty where they are not known.
    pub(super) poses: Vec<(i64, Pose)>,
    /// Columns and rows of the camera's pictures, px, where it is known.
    pub(super) camera_px: Option<[u32; 2]>,
    /// Further files: name and text.
    pub(super) texts: Vec<(&'static str, String)>,
    /// What was left out or assumed.
    pub notes: Vec<String>,
    pub(super) pictures: Pictures,
    /// What is wrong with the recording although a part of it can be imported.
    pub(super) broken: Option<Error>,
}

/// Where the pictures come from.
#[derive(Clone, Debug)]
pub(super) enum Pictures {
    /// Messages of a topic; which frame each is.
    Log { log: Log, topic: usize, frame_of: Vec<Option<usize>> },
    /// Files, one a frame.
    Files(Vec<PathBuf>),
    /// Frames of a video; which of its pictures each is.
    Video { video: Video, frame_of: Vec<Option<usize>> },
    /// They are not there.
    Missing,
}

/// Files that an import or a diagnosis has beside the pictures.
const OWN: [&str; 8] = [
    MANIFEST_FILE,
    super::RUN_FILE,
    "frames.csv",
    "camera.toml",
    "trajectory.tum",
    "imu.csv",
    "scene.obj",
    "lights.toml",
];

impl Prepared {
    /// Notes the pictures that are files among what was read: a run that goes on must be of the same ones.
    ///
    /// # Errors
    /// A file that cannot be read; one that is not there is a frame that is left out.
    pub(crate) fn note_pictures(&self) -> Result<()> {
        let Pictures::Files(paths) = &self.pictures else { return Ok(()) };
        paths.iter().filter(|p| p.is_file()).try_for_each(|path| Large::open(path).map(drop))
    }

    /// Refuses pictures under the names of files that are something else; on some disks capitals make no difference.
    pub(super) fn check_names(&self) -> Result<()> {
        let is_own = |name: &&String| {
            let small = name.to_lowercase();
            OWN.contains(&small.as_str()) || small.starts_with(".shutterbug")
        };
        match self.names.iter().flatten().find(is_own) {
            Some(name) => {
                let found = format!("a picture called `{name}`, as one of the files beside the pictures is");
                Err(Error::input(&self.path, None, found, "names such as 000000.png"))
            }
            None => Ok(()),
        }
    }

    /// How many frames there will be, if all can be read.
    pub fn frames(&self) -> usize {
        self.times_ns.len()
    }

    /// How many poses there are.
    pub fn poses(&self) -> usize {
        self.poses.len()
    }

    /// What is wrong with the recording although a part of it was imported.
    pub fn broken(self) -> Option<Error> {
        self.broken
    }

    /// The texts of `frames.csv` and `trajectory.tum`, with the frames that got a name.
    pub(super) fn motion(&self, names: &[Option<String>]) -> Motion {
        let epoch_ns = shutterbug::capture::clock_epoch_ns(self.times_ns.first().copied().unwrap_or(0));
        let entry = |(&timestamp_ns, name): (&i64, &Option<String>)| {
            let start_s = Stamp::from_ns(timestamp_ns).seconds_since(epoch_ns);
            Some(FrameEntry { timestamp_ns, start_s, filename: name.clone()? })
        };
        let frames = self.times_ns.iter().zip(names).filter_map(entry).collect();
        Motion { camera: None, frames, poses: self.poses.clone(), notes: Vec::new() }
    }
}
