//! A log and what is wanted of it: its topics by name and kind, the frames' times, the camera.

use std::path::PathBuf;

use super::Damage;
use super::camera::camera_of;
use super::frames::{Timed, timed};
use super::gather::Gathered;
use super::log::Log;
use super::prepared::{NONE, Request, is_tree};
use super::topic::{Encoding, Kind, Topic};
use crate::formats::CameraModel;
use shutterbug::error::{Error, Result, counted};

/// Most names that an error lists.
const MAX_NAMED: usize = 8;

/// A log with what its first pass found and what was asked for.
pub(super) struct Chosen<'a> {
    pub(super) log: &'a Log,
    pub(super) all: &'a Gathered,
    pub(super) request: &'a Request,
    /// Place of the pictures' topic.
    pub(super) pictures: usize,
    /// The camera's frame.
    pub(super) frame: String,
}

impl Chosen<'_> {
    pub(super) fn topic(&self, place: usize) -> &Topic {
        &self.all.pass.topics[place]
    }

    pub(super) fn named(&self, name: &str, is: impl Fn(&Topic) -> bool, expected: &str) -> Result<usize> {
        named(self.log, self.all, name, is, expected)
    }

    pub(super) fn places(&self, is: impl Fn(&Topic) -> bool) -> Vec<usize> {
        places(self.all, is)
    }

    pub(super) fn bad(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::input(&self.log.path, None, found, expected)
    }

    /// Says which messages of a topic cannot be read; an error where none can. What was asked for is damaged then:
    /// [`Self::broken`] says it.
    pub(super) fn note_faults(
        &self,
        place: usize,
        asked: Option<&str>,
        notes: &mut Vec<String>,
    ) -> Result<()> {
        let (about, name) = (&self.all.about[place], &self.topic(place).name);
        let Some((at, fault)) = &about.first_fault else { return Ok(()) };
        if about.faults == about.count {
            return Err(self.bad(
                format!("{} in a message of `{name}` at byte {at}", fault.found),
                fault.expected.clone(),
            ));
        }
        if asked != Some(name.as_str()) {
            notes.extend(self.faults(place).map(told));
        }
        Ok(())
    }

    /// That messages of a topic cannot be read: what was found, and what was expected.
    pub(super) fn faults(&self, place: usize) -> Option<Damage> {
        let (about, name) = (&self.all.about[place], &self.topic(place).name);
        let (at, fault) = about.first_fault.as_ref()?;
        let found = format!(
            "{} of {} of `{name}` that cannot be read, the first with {} at byte {at}",
            about.faults,
            counted(about.count, "message", "messages"),
            fault.found
        );
        Some((found, fault.expected.clone()))
    }

    /// The error with which the import ends although what is whole was written: damage of the file, else messages that
    /// cannot be read of the pictures, or of a topic that was asked for by name. `notes` has what is not told by it.
    pub(super) fn broken(&self, notes: &mut Vec<String>) -> Option<Error> {
        let request = self.request;
        let named = [&request.camera_info, &request.poses, &request.imu];
        let tree = request.poses.as_deref().is_some_and(is_tree);
        let asked = |t: &Topic| {
            named.into_iter().flatten().any(|name| *name == t.name) || (tree && t.kind == Kind::Tf)
        };
        let others = self.places(asked).into_iter().filter(|place| *place != self.pictures);
        let places = std::iter::once(self.pictures).chain(others);
        let end = "; what is whole was imported";
        let error = |(found, expected): Damage| self.bad(format!("{found}{end}"), expected);
        let mut broken = broken(self.all, end);
        for damage in places.filter_map(|place| self.faults(place)) {
            match broken {
                None => broken = Some(error(damage)),
                Some(_) => notes.push(told(damage)),
            }
        }
        broken
    }

    pub(super) fn times(&self, notes: &mut Vec<String>) -> Result<Timed> {
        let name = &self.topic(self.pictures).name;
        if self.all.about[self.pictures].count == 0 {
            return Err(
                self.bad(with_damage(self.all, format!("no message of `{name}`")), "at least one picture")
            );
        }
        self.note_faults(self.pictures, Some(name), notes)?;
        let shots = self.all.shots.get(&self.pictures).map_or(&[][..], Vec::as_slice);
        Ok(timed(shots, name, notes))
    }

    /// The camera, where there is one. One that was not asked for by name is only taken if it fits.
    pub(super) fn camera(&self, notes: &mut Vec<String>) -> Result<Option<CameraModel>> {
        let asked = self.request.camera_info.as_deref();
        let place = match asked {
            Some(NONE) => return Ok(None),
            Some(name) => {
                Some(self.named(name, |t| t.kind == Kind::CameraInfo, "a topic of sensor_msgs/CameraInfo")?)
            }
            None => self.camera_beside(),
        };
        let Some(place) = place else {
            let there = names(self.all, |t| t.kind == Kind::CameraInfo);
            let others = if there == "no topics" {
                String::new()
            } else {
                format!(" (--camera-info with one of {there})")
            };
            notes.push(format!("no CameraInfo beside the pictures: no camera.toml{others}"));
            return Ok(None);
        };
        match self.camera_at(place, notes) {
            Ok(camera) => Ok(Some(camera)),
            Err(error) if asked.is_some() => Err(error),
            Err(error) => {
                notes.push(format!("no camera.toml: {error}"));
                Ok(None)
            }
        }
    }

    fn camera_at(&self, place: usize, notes: &mut Vec<String>) -> Result<CameraModel> {
        let name = &self.topic(place).name;
        self.note_faults(place, self.request.camera_info.as_deref(), notes)?;
        let Some((info, differing)) = self.all.cameras.get(&place) else {
            return Err(self.bad(format!("no message of `{name}`"), "at least one"));
        };
        let label = PathBuf::from(format!("{}: {name}", self.log.path.display()));
        let rectified =
            base_name(&self.topic(self.pictures).name).rsplit('/').next().is_some_and(|n| n.contains("rect"));
        let (camera, more) = camera_of(info, rectified, &label)?;
        let k = camera.intrinsics;
        if let Some(Ok([width, height])) = self.all.first.get(&self.pictures).map(|f| &f.size)
            && [k.width, k.height] != [*width, *height]
        {
            let found =
                format!("a camera of {}x{} px beside pictures of {width}x{height} px", k.width, k.height);
            return Err(Error::input(&label, None, found, "the same size, or --camera-info none"));
        }
        notes.extend(more.into_iter().map(|n| format!("`{name}`: {n}")));
        if *differing > 0 {
            notes.push(format!(
                "{} of `{name}` unlike the first, which is taken",
                counted(*differing, "message is", "messages are")
            ));
        }
        Ok(camera)
    }

    /// `camera_info` in the pictures' namespace, as ROS has it; else the only one of the same frame.
    fn camera_beside(&self) -> Option<usize> {
        let base = base_name(&self.topic(self.pictures).name);
        let space = base.rsplit_once('/').map_or("", |(space, _)| space);
        let wanted = format!("{space}/camera_info");
        let is_info = |t: &Topic| t.kind == Kind::CameraInfo;
        let beside =
            self.places(|t| is_info(t) && t.name.trim_start_matches('/') == wanted.trim_start_matches('/'));
        if let Some(one) = beside.first() {
            return Some(*one);
        }
        let frame = self.all.first.get(&self.pictures).map_or("", |f| f.frame.as_str());
        let same = |place: &usize| self.all.cameras.get(place).is_some_and(|(info, _)| info.frame == frame);
        match self.places(is_info).into_iter().filter(same).collect::<Vec<_>>()[..] {
            [one] => Some(one),
            _ => None,
        }
    }
}

/// The error with which the reading of a damaged log ends.
pub(super) fn broken(all: &Gathered, end: &str) -> Option<Error> {
    let first = all.pass.damage.first()?;
    let more = match all.pass.damages {
        1 => String::new(),
        n => format!(" and at {} more places", n - 1),
    };
    let found = format!("{} at byte {}{more}{end}", first.found, first.at);
    Some(Error::input(&first.path, None, found, first.expected.clone()))
}

/// Damage as a note.
pub(super) fn told((found, expected): Damage) -> String {
    format!("found {found}; expected {expected}")
}

/// A log without what is looked for may just be broken.
pub(super) fn with_damage(all: &Gathered, found: String) -> String {
    match all.pass.damage.first() {
        Some(d) => format!("{found}, and {} at byte {}", d.found, d.at),
        None => found,
    }
}

pub(super) fn places(all: &Gathered, is: impl Fn(&Topic) -> bool) -> Vec<usize> {
    all.pass.topics.iter().enumerate().filter(|(_, t)| is(t)).map(|(i, _)| i).collect()
}

pub(super) fn names(all: &Gathered, is: impl Fn(&Topic) -> bool) -> String {
    let mut names: Vec<&str> = all.pass.topics.iter().filter(|t| is(t)).map(|t| t.name.as_str()).collect();
    names.sort_unstable();
    let more = names.len().saturating_sub(MAX_NAMED);
    names.truncate(MAX_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    if names.is_empty() { "no topics".to_owned() } else { names.join(", ") + &more }
}

/// The topic of that name, if it is of the right kind and has messages.
pub(super) fn named(
    log: &Log,
    all: &Gathered,
    name: &str,
    is: impl Fn(&Topic) -> bool,
    expected: &str,
) -> Result<usize> {
    let bad = |found: String, expected: &str| Err(Error::input(&log.path, None, found, expected));
    let of_name = places(all, |t| t.name == name);
    let Some(place) = of_name.iter().copied().find(|p| is(&all.pass.topics[*p])) else {
        let Some(other) = of_name.first() else {
            let there = names(all, &is);
            return bad(with_damage(all, format!("no topic `{name}`")), &format!("one of: {there}"));
        };
        let topic = &all.pass.topics[*other];
        let found = match &topic.encoding {
            Encoding::Other(encoding) => format!("`{name}` written in `{encoding}`"),
            _ => format!("`{name}` of type {}", topic.type_name),
        };
        return bad(found, expected);
    };
    if all.about[place].count == 0 {
        return bad(with_damage(all, format!("no message of `{name}`")), "at least one");
    }
    Ok(place)
}

/// The topic without what image_transport puts behind it.
fn base_name(name: &str) -> &str {
    ["/compressed", "/compressedDepth"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name)
}
