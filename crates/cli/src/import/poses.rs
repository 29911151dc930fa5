//! The camera's poses, and samples of an inertial sensor, from a log's messages.

use std::fmt::Write as _;

use super::chosen::{Chosen, told};
use super::prepared::{NONE, is_tree};
use super::topic::{Kind, Topic};
use shutterbug::camera::Pose;
use shutterbug::error::{Result, counted};

/// World from camera at increasing times, ns.
type Poses = Vec<(i64, Pose)>;

/// The camera's poses; nothing where there are none or none are wanted. Those that were asked for must be there.
pub(super) fn poses_of(chosen: &Chosen<'_>, notes: &mut Vec<String>) -> Result<Option<Poses>> {
    let poses = match chosen.request.poses.as_deref() {
        Some(NONE) => return Ok(None),
        Some(way) if is_tree(way) => Some(of_tree(chosen, way, notes)?),
        Some(name) => {
            let expected = "a topic of Odometry, PoseStamped, TransformStamped, `tf` or `tf:PARENT->CHILD`";
            Some(of_topic(chosen, chosen.named(name, Topic::has_poses, expected)?, notes)?)
        }
        None => unasked(chosen, notes),
    };
    let Some(mut poses) = poses else { return Ok(None) };
    let late = poses.windows(2).filter(|w| w[1].0 < w[0].0).count();
    poses.sort_by_key(|(t, _)| *t);
    poses.dedup_by_key(|(t, _)| *t);
    if late > 0 {
        notes.push(format!("{} after a later one: sorted by time", counted(late, "pose", "poses")));
    }
    Ok(Some(poses))
}

/// What is there without being asked for: the only topic of poses, else the tree. What does not work is said and left
/// out.
fn unasked(chosen: &Chosen<'_>, notes: &mut Vec<String>) -> Option<Poses> {
    let tried = match chosen.places(Topic::has_poses)[..] {
        [one] if chosen.all.about[one].count > 0 => of_topic(chosen, one, notes),
        [] | [_] if chosen.all.tree.names().is_empty() => {
            notes.push("no poses: no trajectory.tum".to_owned());
            return None;
        }
        [] | [_] => of_tree(chosen, "tf", notes),
        _ => {
            notes.push("several topics of poses: no trajectory.tum without --poses".to_owned());
            return None;
        }
    };
    tried.map_err(|error| notes.push(format!("no trajectory.tum: {error}"))).ok()
}

/// Poses of a frame whose name does not say that it looks along z.
fn note_axes(frame: &str, notes: &mut Vec<String>) {
    if !frame.contains("optical") {
        notes.push(format!("the frame `{frame}` is taken as the camera's: x right, y down, z forward"));
    }
}

/// `tf`, `tf:PARENT` or `tf:PARENT->CHILD`.
fn of_tree(chosen: &Chosen<'_>, way: &str, notes: &mut Vec<String>) -> Result<Poses> {
    let tree = &chosen.all.tree;
    let named = way.strip_prefix("tf:").unwrap_or_default();
    let (parent, child) = named.split_once("->").unwrap_or((named, ""));
    let clean = |name: &str| name.trim().trim_start_matches('/').to_owned();
    let (mut parent, mut child) = (clean(parent), clean(child));
    if child.is_empty() {
        child.clone_from(&chosen.frame);
    }
    let there = || {
        let names = tree.names();
        if names.is_empty() { "a log with tf".to_owned() } else { format!("one of: {}", names.join(", ")) }
    };
    for name in [&parent, &child].into_iter().filter(|n| !n.is_empty()) {
        if !tree.names().contains(&name.as_str()) {
            return Err(chosen.bad(format!("no frame `{name}` in tf"), there()));
        }
    }
    if child.is_empty() {
        return Err(
            chosen.bad("pictures without a frame", "--camera-frame NAME, or --poses tf:PARENT->CHILD")
        );
    }
    if parent.is_empty() {
        tree.root(&child).clone_into(&mut parent);
    }
    if !tree.joins(&parent, &child) {
        return Err(chosen.bad(format!("no way from `{parent}` to `{child}` in tf"), "frames of one tree"));
    }
    let stamps = tree.stamps(&parent, &child);
    let poses: Poses = stamps.iter().filter_map(|t| Some((*t, tree.pose(&parent, &child, *t)?))).collect();
    if poses.len() < 2 {
        let found = format!("{} of `{child}` in `{parent}` over time", counted(poses.len(), "pose", "poses"));
        return Err(chosen.bad(found, "a way through tf that moves, known at two times or more"));
    }
    if tree.contradictions > 0 {
        let count = counted(tree.contradictions, "link hangs", "links hang");
        notes.push(format!("tf: {count} a frame on a second parent; the first counts"));
    }
    if chosen.request.poses.is_none() {
        let places = chosen.places(|t| t.kind == Kind::Tf);
        notes.extend(places.into_iter().filter_map(|p| chosen.faults(p)).map(told));
    }
    notes.push(format!("poses are of `{child}` in `{parent}`, by tf"));
    note_axes(&child, notes);
    Ok(poses)
}

/// A topic's poses, and the way from its body to the camera.
fn of_topic(chosen: &Chosen<'_>, place: usize, notes: &mut Vec<String>) -> Result<Poses> {
    chosen.note_faults(place, chosen.request.poses.as_deref(), notes)?;
    let name = &chosen.topic(place).name;
    let links = chosen.all.poses.get(&place).map_or(&[][..], Vec::as_slice);
    let Some(first) = links.first() else {
        return Err(chosen.bad(format!("no pose of `{name}`"), "at least one"));
    };
    let (tree, camera) = (&chosen.all.tree, &chosen.frame);
    let body = chosen.request.body.clone().unwrap_or_else(|| first.child.clone());
    let own = |notes: &mut Vec<String>, why: &str| {
        notes.push(format!("`{name}`: {why}"));
        Ok(links.iter().map(|l| (l.stamp_ns, l.pose)).collect())
    };
    if body.is_empty() {
        let note = "the messages do not name the body of these poses: they are taken as the camera's (else give \
            --body FRAME)";
        return own(notes, note);
    }
    if body == *camera {
        return own(notes, "poses are the camera's own");
    }
    if !tree.joins(&body, camera) {
        let found = format!(
            "`{name}` with poses of `{body}`, and no way from there to the camera's `{camera}` in tf"
        );
        return Err(
            chosen.bad(found, format!("tf, --body {camera} (they are the camera's own) or --poses none"))
        );
    }
    let known = links.iter().filter_map(|l| {
        let to_camera = tree.pose(&body, camera, l.stamp_ns)?;
        let mut pose = l.pose.then_from(&to_camera);
        pose.rotation = pose.rotation.normalize();
        Some((l.stamp_ns, pose))
    });
    let poses: Poses = known.collect();
    if poses.is_empty() {
        let found = format!("`{name}`, whose times tf does not cover between `{body}` and `{camera}`");
        return Err(chosen.bad(found, "tf of the same time"));
    }
    note_axes(camera, notes);
    notes.push(format!("poses are those of `{name}`, of `{body}`, and on to `{camera}` by tf"));
    Ok(poses)
}

/// The text of imu.csv, in EuRoC's columns; in the camera's axes where tf knows how the sensor is turned.
pub(super) fn written_imu(chosen: &Chosen<'_>, notes: &mut Vec<String>) -> Result<Option<String>> {
    let is_imu = |t: &Topic| t.kind == Kind::Imu;
    let place = match chosen.request.imu.as_deref() {
        Some(NONE) => return Ok(None),
        Some(name) => chosen.named(name, is_imu, "a topic of sensor_msgs/Imu")?,
        None => match chosen.places(is_imu)[..] {
            [] => return Ok(None),
            [one] => one,
            _ => {
                notes.push("several topics of inertial sensors: no imu.csv without --imu".to_owned());
                return Ok(None);
            }
        },
    };
    chosen.note_faults(place, chosen.request.imu.as_deref(), notes)?;
    let mut samples = chosen.all.inertial.get(&place).cloned().unwrap_or_default();
    let Some(first) = samples.first().cloned() else { return Ok(None) };
    samples.sort_by_key(|s| s.stamp_ns);
    samples.dedup_by_key(|s| s.stamp_ns);
    let named = !chosen.frame.is_empty() && !first.frame.is_empty();
    let pose = chosen.all.tree.pose(&chosen.frame, &first.frame, first.stamp_ns);
    let turn = pose.filter(|_| named).map(|p| p.rotation);
    let axes = match turn {
        Some(_) => format!("of the camera `{}` (x right, y down, z forward)", chosen.frame),
        None => format!("of the sensor `{}`: how it sits on the camera is not known", first.frame),
    };
    notes.push(format!("imu.csv: axes {axes}"));
    let mut text = format!("# axes {}\n{IMU_HEADER}\n", shutterbug::error::one_line(&axes));
    let turn = turn.unwrap_or_default();
    for s in &samples {
        let (w, a) = (turn * s.turn_rad_s, turn * s.acceleration_m_s2);
        writeln!(text, "{},{:?},{:?},{:?},{:?},{:?},{:?}", s.stamp_ns, w.x, w.y, w.z, a.x, a.y, a.z)
            .expect("writing to a String cannot fail");
    }
    Ok(Some(text))
}

/// As in EuRoC's `imu0/data.csv`.
pub(super) const IMU_HEADER: &str = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],\
                                     a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]";
