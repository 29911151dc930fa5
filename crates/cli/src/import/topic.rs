//! What a topic carries, and how its messages are written.

use super::wire::Wire;

/// What is made of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// Pictures, their values as they are.
    Image,
    /// Pictures as JPEG or PNG.
    CompressedImage,
    /// The camera.
    CameraInfo,
    /// A body's pose: nav_msgs/Odometry.
    Odometry,
    /// A pose: geometry_msgs/PoseStamped.
    Pose,
    /// The same with a covariance behind it.
    PoseWithCovariance,
    /// A body's pose: geometry_msgs/TransformStamped, of motion capture.
    Transform,
    /// The tree of frames.
    Tf,
    /// Rates of turn and accelerations.
    Imu,
    /// Nothing.
    Other,
}

/// How messages are written.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    /// By ROS.
    Ros(Wire),
    /// By Foxglove's schemas, in protobuf.
    Protobuf,
    /// The same, in JSON.
    Json,
    /// In a way that is not read.
    Other(String),
}

/// A stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Topic {
    pub(super) name: String,
    /// As ROS 1 writes it: `sensor_msgs/Image`.
    pub(super) type_name: String,
    pub(super) encoding: Encoding,
    pub(super) kind: Kind,
}

impl Topic {
    pub(super) fn new(name: &str, type_name: &str, encoding: Encoding) -> Self {
        let type_name = type_name.replace("/msg/", "/");
        let read = match encoding {
            Encoding::Ros(_) => !type_name.starts_with("foxglove."),
            Encoding::Protobuf | Encoding::Json => type_name.starts_with("foxglove."),
            Encoding::Other(_) => false,
        };
        let kind = if read { kind_of(&type_name) } else { Kind::Other };
        Self { name: name.to_owned(), type_name, encoding, kind }
    }

    /// Whether it carries pictures.
    pub(super) fn has_pictures(&self) -> bool {
        matches!(self.kind, Kind::Image | Kind::CompressedImage)
    }

    /// Whether each message is a pose of one body.
    pub(super) fn has_poses(&self) -> bool {
        matches!(self.kind, Kind::Odometry | Kind::Pose | Kind::PoseWithCovariance | Kind::Transform)
    }
}

fn kind_of(type_name: &str) -> Kind {
    match type_name {
        "sensor_msgs/Image" | "foxglove.RawImage" => Kind::Image,
        "sensor_msgs/CompressedImage" | "foxglove.CompressedImage" => Kind::CompressedImage,
        "sensor_msgs/CameraInfo" | "foxglove.CameraCalibration" => Kind::CameraInfo,
        "nav_msgs/Odometry" => Kind::Odometry,
        "geometry_msgs/PoseStamped" | "foxglove.PoseInFrame" => Kind::Pose,
        "geometry_msgs/PoseWithCovarianceStamped" => Kind::PoseWithCovariance,
        "geometry_msgs/TransformStamped" => Kind::Transform,
        "tf2_msgs/TFMessage" | "tf/tfMessage" | "foxglove.FrameTransform" | "foxglove.FrameTransforms" => {
            Kind::Tf
        }
        "sensor_msgs/Imu" => Kind::Imu,
        _ => Kind::Other,
    }
}

/// A message as it was recorded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Message<'a> {
    /// Place of its topic.
    pub(super) topic: usize,
    /// When it was recorded, ns.
    pub(super) recorded_ns: i64,
    /// Where its record, or the chunk that holds it, begins in the file.
    pub(super) at: u64,
    pub(super) data: &'a [u8],
}
