//! ROS 1 bags, version 2.0, read from front to back (wiki.ros.org/Bags/Format/2.0): records of a header of fields
//! `name=value` and data; chunks hold further records. The index at the end is not needed, so bags that were never
//! closed are read too.

use std::collections::HashMap;

use super::cut::Cut;
use super::large::Large;
use super::sink::Sink;
use super::topic::{Encoding, Message};
use super::unpack::MAX_BYTES;
use super::wire::Wire;
use shutterbug::error::{Error, Result};

/// How a file begins.
pub(super) const MAGIC: &[u8; 13] = b"#ROSBAG V2.0\n";
/// Largest header of a record, bytes.
const MAX_HEADER_BYTES: u64 = 16 << 20;

mod op {
    pub(super) const MESSAGE: u8 = 0x02;
    pub(super) const BAG: u8 = 0x03;
    pub(super) const INDEX: u8 = 0x04;
    pub(super) const CHUNK: u8 = 0x05;
    pub(super) const CHUNK_INFO: u8 = 0x06;
    pub(super) const CONNECTION: u8 = 0x07;
}

/// The fields of a header.
struct Header<'a>(&'a [u8]);

impl<'a> Header<'a> {
    /// The value of a field.
    fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut cut = Cut(self.0);
        while !cut.0.is_empty() {
            let field = cut.counted()?;
            let split = field.iter().position(|b| *b == b'=')?;
            if &field[..split] == name.as_bytes() {
                return Some(&field[split + 1..]);
            }
        }
        None
    }

    fn op(&self) -> Option<u8> {
        self.get("op")?.first().copied()
    }

    fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    fn text(&self, name: &str) -> Option<String> {
        self.get(name).map(|b| String::from_utf8_lossy(b).into_owned())
    }

    fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    /// Seconds and nanoseconds, as ns.
    fn time_ns(&self) -> Option<i64> {
        let mut cut = Cut(self.get("time")?);
        Some(i64::from(cut.u32()?) * 1_000_000_000 + i64::from(cut.u32()?))
    }
}

/// Place of each connection's topic, by its number in this file.
type Known = HashMap<u32, usize>;

/// Reads all messages. What is whole before the file breaks off is given; that it does is noted.
pub(super) fn read(file: &mut Large, sink: &mut Sink<'_, '_>) -> Result<()> {
    file.seek(MAGIC.len() as u64)?;
    let mut known = Known::new();
    // Where a bag that was closed has its index, behind all chunks.
    let mut index_at = None;
    let (mut header, mut data, mut unpacked) = (Vec::new(), Vec::new(), Vec::new());
    while file.left() > 0 {
        let at = file.at();
        sink.progress(at)?;
        let Some((length, wanted)) = begin(file, &mut header, &mut data)? else {
            let found = format!("a record with {} bytes left", file.left());
            sink.damaged(file.path(), at, found, "whole records: the bag was not closed or was cut off");
            return Ok(());
        };
        if wanted && length > MAX_BYTES && length <= file.left() {
            let found = format!("a record of {length} bytes at byte {at}");
            return Err(Error::input(file.path(), None, found, format!("{MAX_BYTES} bytes at most")));
        }
        let there = if wanted { file.take(length, &mut data)? } else { file.skip(length)? };
        if !there {
            let found = format!("a record of {length} bytes with {} bytes left", file.left());
            sink.damaged(file.path(), at, found, "whole records: the bag was not closed or was cut off");
            return Ok(());
        }
        let header = Header(&header);
        match header.op() {
            Some(op::CHUNK) => read_chunk(&mut known, (file, at), &header, (&data, &mut unpacked), sink)?,
            Some(op::BAG) => index_at = header.u64("index_pos"),
            _ => record(&mut known, (file, at), &header, &data, sink)?,
        }
    }
    // A bag that was cut off between two records is whole as far as it goes.
    let found = match index_at {
        None | Some(0) => "no index".to_owned(),
        Some(at) if at > file.bytes() => format!("an index at byte {at}, beyond the end of the file"),
        Some(_) => return Ok(()),
    };
    sink.damaged(
        file.path(),
        file.bytes(),
        found,
        "the index of a bag that was closed: its end may be missing",
    );
    Ok(())
}

/// Reads a record's header: the length of its data, and whether that is wanted. Nothing where the file ends before.
fn begin(file: &mut Large, header: &mut Vec<u8>, scratch: &mut Vec<u8>) -> Result<Option<(u64, bool)>> {
    let at = file.at();
    let length = |bytes: &[u8]| u64::from(u32::from_le_bytes(bytes.try_into().expect("four bytes")));
    if !file.take(4, scratch)? {
        return Ok(None);
    }
    let bytes = length(scratch);
    if bytes > MAX_HEADER_BYTES && bytes <= file.left() {
        let found = format!("a record's header of {bytes} bytes at byte {at}");
        return Err(Error::input(file.path(), None, found, format!("{MAX_HEADER_BYTES} bytes at most")));
    }
    if !file.take(bytes, header)? || !file.take(4, scratch)? {
        return Ok(None);
    }
    let code = Header(header).op();
    let wanted = matches!(code, Some(op::MESSAGE | op::CHUNK | op::CONNECTION));
    Ok(Some((length(scratch), wanted)))
}

/// A connection or a message.
fn record(
    known: &mut Known,
    (file, at): (&Large, u64),
    header: &Header<'_>,
    data: &[u8],
    sink: &mut Sink<'_, '_>,
) -> Result<()> {
    let whole = match header.op() {
        Some(op::CONNECTION) => connection(known, header, data, sink),
        Some(op::MESSAGE) => {
            let parts = header.u32("conn").and_then(|c| known.get(&c).copied()).zip(header.time_ns());
            if let Some((topic, recorded_ns)) = parts {
                return sink.message(&Message { topic, recorded_ns, at, data });
            }
            None
        }
        Some(op::INDEX | op::CHUNK_INFO) => Some(()),
        code => {
            let code = code.map_or_else(|| "no kind".to_owned(), |c| format!("the kind {c:#04x}"));
            let found = format!("a record of {code} in this place");
            sink.damaged(
                file.path(),
                at,
                found,
                "a message, a connection, an index or, outside of chunks, a chunk",
            );
            return Ok(());
        }
    };
    if whole.is_none() {
        let found = "a connection or message without its fields";
        sink.damaged(file.path(), at, found, "`conn`, `topic`, `type` and `time`");
    }
    Ok(())
}

fn connection(known: &mut Known, header: &Header<'_>, data: &[u8], sink: &mut Sink<'_, '_>) -> Option<()> {
    let (number, about) = (header.u32("conn")?, Header(data));
    // The name under which it was recorded, which remapping may have changed.
    let (name, type_name) = (header.text("topic")?, about.text("type")?);
    known.insert(number, sink.topic(&name, &type_name, Encoding::Ros(Wire::Ros1))?);
    Some(())
}

/// A chunk that cannot be read is passed over.
fn read_chunk(
    known: &mut Known,
    (file, at): (&Large, u64),
    header: &Header<'_>,
    (packed, unpacked): (&[u8], &mut Vec<u8>),
    sink: &mut Sink<'_, '_>,
) -> Result<()> {
    let how = header.text("compression").unwrap_or_default();
    let records = if how == "none" {
        packed
    } else {
        let stated = header.u32("size").map(u64::from);
        if let Err(fault) = sink.unpack(&how, packed, stated, unpacked) {
            sink.damaged(file.path(), at, fault.found, fault.expected);
            return Ok(());
        }
        unpacked.as_slice()
    };
    let mut cut = Cut(records);
    while !cut.0.is_empty() {
        let Some((header, data)) = cut.counted().and_then(|h| Some((Header(h), cut.counted()?))) else {
            sink.damaged(file.path(), at, "a chunk that ends inside a record", "whole records");
            return Ok(());
        };
        record(known, (file, at), &header, data, sink)?;
    }
    Ok(())
}
