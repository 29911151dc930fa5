//! The first pass over a log: everything but the pictures' values.

use std::collections::HashMap;

use super::contents::{Body, CameraInfo, Inertial, Link};
use super::log::{Log, Pass};
use super::messages;
use super::pixels;
use super::sink::Progress;
use super::topic::{Kind, Message, Topic};
use super::tree::Tree;
use super::wire::Fault;
use shutterbug::error::{Error, Result};

/// Most poses, samples and pictures that are kept: an hour of ten sensors at 1000 Hz.
const MAX_SAMPLES: usize = 1 << 25;

/// What is known of a topic.
#[derive(Clone, Debug, Default)]
pub(super) struct About {
    pub(super) count: usize,
    /// When its first and last message were recorded, ns.
    pub(super) span_ns: Option<[i64; 2]>,
    /// Messages that cannot be read, and the first of them with its place in the file.
    pub(super) faults: usize,
    pub(super) first_fault: Option<(u64, Fault)>,
}

/// When a picture was taken, and recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shot {
    pub(super) stamp_ns: i64,
    pub(super) recorded_ns: i64,
}

/// What the first picture of a topic is like.
#[derive(Clone, Debug)]
pub(super) struct First {
    pub(super) frame: String,
    pub(super) size: std::result::Result<[u32; 2], Fault>,
    pub(super) encoding: String,
}

/// What the first pass found.
#[derive(Clone, Debug, Default)]
pub(super) struct Gathered {
    pub(super) pass: Pass,
    /// One a topic.
    pub(super) about: Vec<About>,
    /// Of topics of pictures: each message's, nothing where it cannot be read.
    pub(super) shots: HashMap<usize, Vec<Option<Shot>>>,
    pub(super) first: HashMap<usize, First>,
    /// The first of a topic, and how many differ from it.
    pub(super) cameras: HashMap<usize, (CameraInfo, usize)>,
    pub(super) poses: HashMap<usize, Vec<Link>>,
    pub(super) tree: Tree,
    pub(super) inertial: HashMap<usize, Vec<Inertial>>,
    kept: usize,
}

/// Reads all of a log once.
pub(super) fn gather(log: &Log, progress: &mut Progress<'_>) -> Result<Gathered> {
    let mut all = Gathered::default();
    let pass = log.each(progress, &mut |topics, message| {
        all.add(&topics[message.topic], message);
        if all.kept > MAX_SAMPLES {
            let found = format!("more than {MAX_SAMPLES} poses, samples and pictures");
            return Err(Error::input(&log.path, None, found, "a shorter part of the recording"));
        }
        Ok(())
    })?;
    all.about.resize_with(pass.topics.len(), About::default);
    all.pass = pass;
    all.tree.finish();
    Ok(all)
}

impl Gathered {
    fn add(&mut self, topic: &Topic, message: &Message<'_>) {
        let (place, t) = (message.topic, message.recorded_ns);
        if self.about.len() <= place {
            self.about.resize_with(place + 1, About::default);
        }
        let about = &mut self.about[place];
        about.count += 1;
        let [from, to] = about.span_ns.unwrap_or([t, t]);
        about.span_ns = Some([from.min(t), to.max(t)]);
        if let Err(fault) = self.content(topic, message) {
            let about = &mut self.about[place];
            about.faults += 1;
            about.first_fault.get_or_insert((message.at, fault));
        }
    }

    fn content(&mut self, topic: &Topic, message: &Message<'_>) -> std::result::Result<(), Fault> {
        let (place, data) = (message.topic, message.data);
        match topic.kind {
            Kind::Image | Kind::CompressedImage => {
                self.kept += 1;
                let shots = self.shots.entry(place).or_default();
                shots.push(None);
                let picture = messages::picture(topic, data)?;
                self.first.entry(place).or_insert_with(|| first(picture.frame.clone(), &picture.body));
                pixels::check(&picture.body)?;
                let shot = Shot { stamp_ns: picture.stamp_ns, recorded_ns: message.recorded_ns };
                *shots.last_mut().expect("one was pushed") = Some(shot);
            }
            Kind::CameraInfo => {
                let info = messages::camera_info(topic, data)?;
                let (first, differing) = self.cameras.entry(place).or_insert_with(|| (info.clone(), 0));
                *differing += usize::from(*first != info);
            }
            Kind::Odometry | Kind::Pose | Kind::PoseWithCovariance | Kind::Transform => {
                let links = messages::links(topic, data)?;
                self.kept += links.len();
                self.poses.entry(place).or_default().extend(links);
            }
            Kind::Tf => {
                let rests = topic.name.ends_with("tf_static");
                let links = messages::links(topic, data)?;
                self.kept += links.len();
                links.into_iter().for_each(|link| self.tree.add(link, rests));
            }
            Kind::Imu => {
                self.kept += 1;
                self.inertial.entry(place).or_default().push(messages::inertial(topic, data)?);
            }
            Kind::Other => {}
        }
        Ok(())
    }
}

fn first(frame: String, body: &Body<'_>) -> First {
    let encoding = match body {
        Body::Raw { encoding, .. } => encoding.clone(),
        Body::Packed { format, .. } => format.clone(),
    };
    First { frame, size: pixels::size_px(body), encoding }
}
