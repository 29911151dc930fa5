//! Messages of all supported encodings, read into one form.

use std::borrow::Cow;

use glam::DVec3;

use super::contents::{Body, CameraInfo, Inertial, Link, Picture, checked_pose};
use super::foxglove;
use super::topic::{Encoding, Kind, Topic};
use super::wire::{Fault, Fields, Wire, frame_name};
use shutterbug::camera::Pose;

fn pose(fields: &mut Fields<'_>) -> Result<Pose, Fault> {
    checked_pose(fields.f64s()?, fields.f64s()?)
}

fn wire(topic: &Topic) -> Result<Wire, Fault> {
    match &topic.encoding {
        Encoding::Ros(wire) => Ok(*wire),
        other => Err(Fault::new(format!("{} in {other:?}", topic.type_name), "a message that is read")),
    }
}

/// Reads a picture; its values are not looked at.
pub(super) fn picture<'a>(topic: &Topic, data: &'a [u8]) -> Result<Picture<'a>, Fault> {
    match topic.encoding {
        Encoding::Protobuf => return foxglove::picture_of_protobuf(topic, data),
        Encoding::Json => return foxglove::picture_of_json(topic, data),
        _ => {}
    }
    let mut fields = Fields::new(data, wire(topic)?)?;
    let (stamp_ns, frame) = fields.header()?;
    if topic.kind == Kind::CompressedImage {
        let format = fields.text()?;
        let data = Cow::Borrowed(fields.blob()?);
        return Ok(Picture { stamp_ns, frame, body: Body::Packed { format, data } });
    }
    let (height, width, encoding) = (fields.u32()?, fields.u32()?, fields.text()?);
    let (big_endian, step) = (fields.u8()? != 0, fields.u32()?);
    let data = Cow::Borrowed(fields.blob()?);
    Ok(Picture { stamp_ns, frame, body: Body::Raw { width, height, encoding, big_endian, step, data } })
}

/// Reads a camera.
pub(super) fn camera_info(topic: &Topic, data: &[u8]) -> Result<CameraInfo, Fault> {
    match topic.encoding {
        Encoding::Protobuf => return foxglove::camera_of_protobuf(data),
        Encoding::Json => return foxglove::camera_of_json(data),
        _ => {}
    }
    let mut fields = Fields::new(data, wire(topic)?)?;
    let (_, frame) = fields.header()?;
    let (height, width, model) = (fields.u32()?, fields.u32()?, fields.text()?);
    let d = fields.f64_list()?;
    let (k, r, p) = (fields.f64s()?, fields.f64s()?, fields.f64s()?);
    let binning = [fields.u32()?, fields.u32()?];
    let [x, y, roi_height, roi_width] = [fields.u32()?, fields.u32()?, fields.u32()?, fields.u32()?];
    let roi = [x, y, roi_width, roi_height];
    Ok(CameraInfo { frame, width, height, model, d, k, r, p, binning, roi })
}

/// Reads poses of bodies: one, or of a tree as many as there are.
pub(super) fn links(topic: &Topic, data: &[u8]) -> Result<Vec<Link>, Fault> {
    match topic.encoding {
        Encoding::Protobuf => return foxglove::links_of_protobuf(topic, data),
        Encoding::Json => return foxglove::links_of_json(topic, data),
        _ => {}
    }
    let mut fields = Fields::new(data, wire(topic)?)?;
    // A header, a name and seven numbers.
    let count = if topic.kind == Kind::Tf { fields.count(72)? } else { 1 };
    let named = matches!(topic.kind, Kind::Odometry | Kind::Transform | Kind::Tf);
    let mut links = Vec::with_capacity(count);
    for _ in 0..count {
        let (stamp_ns, parent) = fields.header()?;
        let child = if named { frame_name(&fields.text()?) } else { String::new() };
        links.push(Link { stamp_ns, parent, child, pose: pose(&mut fields)? });
    }
    Ok(links)
}

/// Reads a sample of an inertial sensor.
pub(super) fn inertial(topic: &Topic, data: &[u8]) -> Result<Inertial, Fault> {
    let mut fields = Fields::new(data, wire(topic)?)?;
    let (stamp_ns, frame) = fields.header()?;
    let _: ([f64; 4], [f64; 9]) = (fields.f64s()?, fields.f64s()?);
    let turn: [f64; 3] = fields.f64s()?;
    let _: [f64; 9] = fields.f64s()?;
    let acceleration: [f64; 3] = fields.f64s()?;
    if let Some(bad) = turn.iter().chain(&acceleration).find(|v| !v.is_finite()) {
        return Err(Fault::new(format!("a rate or acceleration of {bad}"), "finite numbers"));
    }
    let (turn_rad_s, acceleration_m_s2) = (DVec3::from_array(turn), DVec3::from_array(acceleration));
    Ok(Inertial { stamp_ns, frame, turn_rad_s, acceleration_m_s2 })
}
