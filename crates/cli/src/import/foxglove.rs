//! Foxglove's own messages, in protobuf and in JSON: pictures, cameras and frames. Numbers of fields as their schemas
//! state them (github.com/foxglove/foxglove-sdk, schemas).

use std::borrow::Cow;

use base64::Engine as _;
use serde_json::Value;

use super::contents::{Body, CameraInfo, Link, Picture, checked_pose};
use super::topic::{Kind, Topic};
use super::wire::{Fault, frame_name};
use shutterbug::capture::parse_json;

const SECOND_NS: i64 = 1_000_000_000;

/// A field of a protobuf message.
#[derive(Clone, Copy)]
enum Field<'a> {
    /// A whole number.
    Whole(u64),
    /// Eight bytes, four bytes.
    Eight([u8; 8]),
    Four([u8; 4]),
    /// Text, bytes, a message, or a list of numbers.
    Bytes(&'a [u8]),
}

impl<'a> Field<'a> {
    fn bytes(self) -> &'a [u8] {
        match self {
            Self::Bytes(bytes) => bytes,
            _ => &[],
        }
    }

    fn text(self) -> String {
        String::from_utf8_lossy(self.bytes()).into_owned()
    }

    fn whole(self) -> u64 {
        match self {
            Self::Whole(n) => n,
            Self::Four(bytes) => u64::from(u32::from_le_bytes(bytes)),
            _ => 0,
        }
    }

    fn number(self) -> f64 {
        match self {
            Self::Eight(bytes) => f64::from_le_bytes(bytes),
            _ => 0.0,
        }
    }

    /// Numbers of eight bytes each, or one that stands alone.
    fn numbers(self, into: &mut Vec<f64>) {
        match self {
            Self::Bytes(all) => into.extend(all.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b))),
            other => into.push(other.number()),
        }
    }
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn split<'a>(bytes: &mut &'a [u8], count: u64) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(usize::try_from(count).ok()?)?;
    *bytes = rest;
    Some(taken)
}

fn field<'a>(bytes: &mut &'a [u8]) -> Option<(u64, Field<'a>)> {
    let key = varint(bytes)?;
    let value = match key & 7 {
        0 => Field::Whole(varint(bytes)?),
        1 => Field::Eight(split(bytes, 8)?.try_into().ok()?),
        2 => {
            let length = varint(bytes)?;
            Field::Bytes(split(bytes, length)?)
        }
        5 => Field::Four(split(bytes, 4)?.try_into().ok()?),
        _ => return None,
    };
    Some((key >> 3, value))
}

/// Calls `with` for each field of a message.
fn fields<'a>(message: &'a [u8], mut with: impl FnMut(u64, Field<'a>)) -> Result<(), Fault> {
    let mut left = message;
    while !left.is_empty() {
        let at = message.len() - left.len();
        let Some((number, value)) = field(&mut left) else {
            let found = format!("a protobuf message of {} bytes with no whole field at {at}", message.len());
            return Err(Fault::new(found, "a whole message of its type"));
        };
        with(number, value);
    }
    Ok(())
}

fn time_of_protobuf(message: &[u8]) -> Result<i64, Fault> {
    let (mut seconds, mut ns) = (0i64, 0i64);
    fields(message, |number, value| match number {
        1 => seconds = value.whole() as i64,
        2 => ns = value.whole() as i64,
        _ => {}
    })?;
    Ok(seconds.saturating_mul(SECOND_NS).saturating_add(ns))
}

/// Numbers of a Vector3 or a Quaternion.
fn vector<const N: usize>(message: &[u8]) -> Result<[f64; N], Fault> {
    let mut values = [0.0; N];
    fields(message, |number, value| {
        if let Some(place) = values.get_mut((number as usize).wrapping_sub(1)) {
            *place = value.number();
        }
    })?;
    Ok(values)
}

pub(super) fn picture_of_protobuf<'a>(topic: &Topic, message: &'a [u8]) -> Result<Picture<'a>, Fault> {
    let (mut time, mut frame, mut text, mut data): (&[u8], String, String, &[u8]) = Default::default();
    let (mut width, mut height, mut step) = (0, 0, 0);
    let packed = topic.kind == Kind::CompressedImage;
    fields(message, |number, value| match (packed, number) {
        (_, 1) => time = value.bytes(),
        (true, 2) | (false, 6) => data = value.bytes(),
        (true, 3) | (false, 4) => text = value.text(),
        (true, 4) | (false, 7) => frame = value.text(),
        (false, 2) => width = value.whole() as u32,
        (false, 3) => height = value.whole() as u32,
        (false, 5) => step = value.whole() as u32,
        _ => {}
    })?;
    let data = Cow::Borrowed(data);
    let body = if packed {
        Body::Packed { format: text, data }
    } else {
        Body::Raw { width, height, encoding: text, big_endian: false, step, data }
    };
    Ok(Picture { stamp_ns: time_of_protobuf(time)?, frame: frame_name(&frame), body })
}

pub(super) fn camera_of_protobuf(message: &[u8]) -> Result<CameraInfo, Fault> {
    let mut info = CameraInfo::default();
    let (mut k, mut r, mut p) = (Vec::new(), Vec::new(), Vec::new());
    fields(message, |number, value| match number {
        2 => info.width = value.whole() as u32,
        3 => info.height = value.whole() as u32,
        4 => info.model = value.text(),
        5 => value.numbers(&mut info.d),
        6 => value.numbers(&mut k),
        7 => value.numbers(&mut r),
        8 => value.numbers(&mut p),
        9 => info.frame = frame_name(&value.text()),
        _ => {}
    })?;
    with_matrices(info, &k, &r, &p)
}

fn with_matrices(info: CameraInfo, k: &[f64], r: &[f64], p: &[f64]) -> Result<CameraInfo, Fault> {
    let k = k.try_into().map_err(|_| Fault::new(format!("K of {} numbers", k.len()), "nine"))?;
    // Those of cameras that are not rectified may be left out.
    let (r, p) = (r.try_into().unwrap_or_default(), p.try_into().unwrap_or_default());
    Ok(CameraInfo { k, r, p, ..info })
}

pub(super) fn links_of_protobuf(topic: &Topic, message: &[u8]) -> Result<Vec<Link>, Fault> {
    if topic.type_name != "foxglove.FrameTransforms" {
        return Ok(vec![link_of_protobuf(topic.kind == Kind::Tf, message)?]);
    }
    let mut links = Vec::new();
    fields(message, |number, value| {
        if number == 1 {
            links.push(link_of_protobuf(true, value.bytes()));
        }
    })?;
    links.into_iter().collect()
}

fn link_of_protobuf(tree: bool, message: &[u8]) -> Result<Link, Fault> {
    let (mut time, mut p, mut q): (&[u8], &[u8], &[u8]) = Default::default();
    let (mut parent, mut child, mut inner) = (String::new(), String::new(), Ok(()));
    fields(message, |number, value| match (tree, number) {
        (_, 1) => time = value.bytes(),
        (_, 2) => parent = frame_name(&value.text()),
        (true, 3) => child = frame_name(&value.text()),
        (true, 4) => p = value.bytes(),
        (true, 5) => q = value.bytes(),
        (false, 3) => {
            inner = fields(value.bytes(), |number, part| match number {
                1 => p = part.bytes(),
                2 => q = part.bytes(),
                _ => {}
            });
        }
        _ => {}
    })?;
    inner?;
    Ok(Link { stamp_ns: time_of_protobuf(time)?, parent, child, pose: checked_pose(vector(p)?, vector(q)?)? })
}

fn json(message: &[u8]) -> Result<Value, Fault> {
    parse_json(message).map_err(|e| Fault::new(format!("no JSON ({e})"), "a message in JSON"))
}

fn text(value: &Value, key: &str) -> String {
    value[key].as_str().unwrap_or_default().to_owned()
}

fn time_of_json(value: &Value) -> i64 {
    let part = |long: &str, short: &str| value[long].as_i64().or_else(|| value[short].as_i64()).unwrap_or(0);
    part("sec", "seconds").saturating_mul(SECOND_NS).saturating_add(part("nsec", "nanos"))
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

pub(super) fn picture_of_json(topic: &Topic, message: &[u8]) -> Result<Picture<'static>, Fault> {
    let value = json(message)?;
    let data = base64::engine::general_purpose::STANDARD
        .decode(value["data"].as_str().unwrap_or_default())
        .map_err(|e| Fault::new(format!("pixels that are no base64 ({e})"), "base64"))?;
    let data = Cow::Owned(data);
    let whole = |key: &str| value[key].as_u64().and_then(|n| u32::try_from(n).ok()).unwrap_or(0);
    let body = if topic.kind == Kind::CompressedImage {
        Body::Packed { format: text(&value, "format"), data }
    } else {
        let (width, height, step) = (whole("width"), whole("height"), whole("step"));
        Body::Raw { width, height, encoding: text(&value, "encoding"), big_endian: false, step, data }
    };
    let frame = frame_name(&text(&value, "frame_id"));
    Ok(Picture { stamp_ns: time_of_json(&value["timestamp"]), frame, body })
}

pub(super) fn camera_of_json(message: &[u8]) -> Result<CameraInfo, Fault> {
    let value = json(message)?;
    let whole = |key: &str| value[key].as_u64().and_then(|n| u32::try_from(n).ok()).unwrap_or(0);
    let info = CameraInfo {
        frame: frame_name(&text(&value, "frame_id")),
        width: whole("width"),
        height: whole("height"),
        model: text(&value, "distortion_model"),
        d: list(&value["D"]),
        ..CameraInfo::default()
    };
    with_matrices(info, &list(&value["K"]), &list(&value["R"]), &list(&value["P"]))
}

pub(super) fn links_of_json(topic: &Topic, message: &[u8]) -> Result<Vec<Link>, Fault> {
    let value = json(message)?;
    let single = std::slice::from_ref(&value);
    let all = if topic.type_name == "foxglove.FrameTransforms" {
        value["transforms"].as_array().map_or(&[][..], Vec::as_slice)
    } else {
        single
    };
    let tree = topic.kind == Kind::Tf;
    let numbers = |v: &Value, keys: &[&str]| -> Vec<f64> {
        keys.iter().map(|k| v[*k].as_f64().unwrap_or(f64::NAN)).collect()
    };
    let link = |v: &Value| {
        let (p, q) = if tree {
            (&v["translation"], &v["rotation"])
        } else {
            (&v["pose"]["position"], &v["pose"]["orientation"])
        };
        let (p, q) = (numbers(p, &["x", "y", "z"]), numbers(q, &["x", "y", "z", "w"]));
        let pose = checked_pose([p[0], p[1], p[2]], [q[0], q[1], q[2], q[3]])?;
        let parent = frame_name(&text(v, if tree { "parent_frame_id" } else { "frame_id" }));
        let child = frame_name(&text(v, "child_frame_id"));
        Ok(Link { stamp_ns: time_of_json(&v["timestamp"]), parent, child, pose })
    };
    all.iter().map(link).collect()
}
