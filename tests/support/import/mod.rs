//! A small writer of recordings, apart from the readers: MCAP with ROS 1 messages, whose fields lie one behind the
//! other.

use std::path::Path;
use std::process::Command;

/// Nanoseconds of the first picture.
pub const START_NS: u64 = 1_700_000_000_000_000_000;

/// Runs `shutterbug import`: exit code, stdout, stderr.
pub fn import(arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    let output = command.arg("import").args(arguments).output().expect("runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// The last line of what was said: the error.
pub fn last_line(said: &str) -> &str {
    said.trim_end().lines().next_back().unwrap_or_default()
}

/// A path as an argument.
pub fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Length and bytes.
fn counted(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

/// A ROS 1 header.
pub fn header(ns: u64, frame: &str) -> Vec<u8> {
    let (seconds, rest) = ((ns / 1_000_000_000) as u32, (ns % 1_000_000_000) as u32);
    [&[0; 4][..], &seconds.to_le_bytes(), &rest.to_le_bytes(), &counted(frame.as_bytes())].concat()
}

/// A sensor_msgs/Image.
pub fn image(ns: u64, [width, height]: [u32; 2], encoding: &str, step: u32, data: &[u8]) -> Vec<u8> {
    let size = [height.to_le_bytes(), width.to_le_bytes()].concat();
    let rest = [&counted(encoding.as_bytes())[..], &[0], &step.to_le_bytes(), &counted(data)].concat();
    [header(ns, "optical"), size, rest].concat()
}

/// A sensor_msgs/CompressedImage.
pub fn compressed(ns: u64, format: &str, data: &[u8]) -> Vec<u8> {
    [header(ns, "optical"), counted(format.as_bytes()), counted(data)].concat()
}

/// A record of MCAP.
pub fn record(code: u8, body: &[u8]) -> Vec<u8> {
    [&[code][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// Schema and channel of a topic, both numbered so.
pub fn topic(number: u16, name: &str, type_name: &str) -> Vec<u8> {
    topic_in(number, name, type_name, "ros1")
}

/// The same, with messages in an encoding.
pub fn topic_in(number: u16, name: &str, type_name: &str, encoding: &str) -> Vec<u8> {
    let id = number.to_le_bytes();
    let schema = [&id[..], &counted(type_name.as_bytes()), &counted(b"ros1msg"), &counted(b"")].concat();
    let channel = [&id[..], &id, &counted(name.as_bytes()), &counted(encoding.as_bytes()), &[0; 4]].concat();
    [record(3, &schema), record(4, &channel)].concat()
}

/// A message of a topic.
pub fn message(number: u16, ns: u64, data: &[u8]) -> Vec<u8> {
    let ns = ns.to_le_bytes();
    record(5, &[&number.to_le_bytes()[..], &[0; 4], &ns, &ns, data].concat())
}

/// A chunk: how it is packed, the length that it states, its checksum, its packed records.
pub fn chunk(how: &str, stated: u64, sum: u32, packed: &[u8]) -> Vec<u8> {
    let head = [&[0; 16][..], &stated.to_le_bytes(), &sum.to_le_bytes(), &counted(how.as_bytes())].concat();
    record(6, &[&head[..], &(packed.len() as u64).to_le_bytes(), packed].concat())
}

/// A whole file of these records.
pub fn mcap(records: &[Vec<u8>]) -> Vec<u8> {
    let magic = b"\x89MCAP0\r\n";
    let end = record(15, &[0; 4]);
    let footer = record(2, &[0; 20]);
    [&magic[..], &record(1, &[0; 8]), &records.concat(), &end, &footer, magic].concat()
}

/// Grey pictures of 4x2 px on `/cam`, 40 ms apart: value 10 k + place.
pub fn pictures(count: u64) -> Vec<Vec<u8>> {
    let picture = |k: u64| {
        let values: Vec<u8> = (0..8).map(|i| (10 * k + i) as u8).collect();
        let ns = START_NS + 40_000_000 * k;
        message(1, ns, &image(ns, [4, 2], "mono8", 4, &values))
    };
    [topic(1, "/cam", "sensor_msgs/Image")].into_iter().chain((0..count).map(picture)).collect()
}
