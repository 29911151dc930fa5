//! Options of `import`.

use std::path::PathBuf;

use crate::import::Request;

/// Arguments of `import`.
#[derive(Debug, clap::Args)]
pub struct Import {
    /// MCAP, a ROS 1 bag, a ROS 2 bag (.db3 or its folder), a folder of EuRoC (mav0), TUM RGB-D or KITTI odometry, a
    /// file of KITTI poses, or a video (read by the installed ffmpeg)
    pub input: PathBuf,
    /// Folder for the files; made if absent. Without it, what the recording holds is listed
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// The pictures' topic, where there are several
    #[arg(long, requires = "out")]
    pub topic: Option<String>,
    /// The camera's topic, or none (else camera_info beside the pictures)
    #[arg(long, requires = "out", value_name = "TOPIC|none")]
    pub camera_info: Option<String>,
    /// The poses: a topic, tf, tf:PARENT, tf:PARENT->CHILD (CHILD is the camera's optical frame) or none
    #[arg(long, requires = "out", value_name = "TOPIC|tf:PARENT->CHILD|none")]
    pub poses: Option<String>,
    /// The inertial sensor's topic, or none (else the only one)
    #[arg(long, requires = "out", value_name = "TOPIC|none")]
    pub imu: Option<String>,
    /// Whose poses the topic holds, where its messages do not say it
    #[arg(long, requires = "out", value_name = "FRAME")]
    pub body: Option<String>,
    /// The camera's optical frame (else that of the pictures' headers)
    #[arg(long, requires = "out", value_name = "FRAME")]
    pub camera_frame: Option<String>,
    /// Take every N-th picture
    #[arg(long, requires = "out", value_name = "N", default_value_t = 1,
        value_parser = clap::value_parser!(u32).range(1..))]
    pub every: u32,
    /// EuRoC and KITTI: which camera's folder (else cam0, image_2)
    #[arg(long, requires = "out")]
    pub name: Option<String>,
    /// KITTI: the poses' times (else times.txt beside them)
    #[arg(long, requires = "out")]
    pub times: Option<PathBuf>,
    /// Put the pictures into DIR/real, as in a capture: add scene.obj and diagnose it
    #[arg(long, requires = "out")]
    pub capture: bool,
    /// Keep the frames that an interrupted run has finished
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Write even if the folder holds files of other origin
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

impl Import {
    /// What of the recording is wanted.
    pub fn request(&self) -> Request {
        Request {
            topic: self.topic.clone(),
            camera_info: self.camera_info.clone(),
            poses: self.poses.clone(),
            imu: self.imu.clone(),
            body: self.body.clone(),
            camera_frame: self.camera_frame.clone(),
            every: self.every as usize,
            name: self.name.clone(),
            times: self.times.clone(),
        }
    }
}
