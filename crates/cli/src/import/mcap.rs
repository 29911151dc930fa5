//! MCAP, read from front to back (mcap.dev/spec). The reader is our own: the format's is a dozen kinds of records, the
//! crate `mcap` brings C libraries for its chunks, does not say where in the file something is wrong, and trusts the
//! length of a record inside a chunk that is not packed.

use std::collections::HashMap;

use super::cut::Cut;
use super::large::Large;
use super::sink::Sink;
use super::topic::{Encoding, Message};
use super::unpack::MAX_BYTES;
use super::wire::Wire;
use shutterbug::error::{Error, Result};

/// How a file begins and ends.
pub(super) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Largest description of a topic, bytes.
const MAX_DESCRIPTION_BYTES: u64 = 64 << 20;

mod op {
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const DATA_END: u8 = 0x0f;
}

/// What a file has said of its topics.
#[derive(Default)]
struct Known {
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, usize>,
}

/// Reads all messages. What is whole before the file breaks off is given; that it does is noted.
pub(super) fn read(file: &mut Large, sink: &mut Sink<'_, '_>) -> Result<()> {
    file.seek(MAGIC.len() as u64)?;
    let (mut known, mut body, mut chunk) = (Known::default(), Vec::new(), Vec::new());
    loop {
        let at = file.at();
        sink.progress(at)?;
        if !file.take(9, &mut body)? {
            let found = format!("the end of the file after {} bytes", file.bytes());
            sink.damaged(
                file.path(),
                at,
                found,
                "further records: the recording was not closed or was cut off",
            );
            return Ok(());
        }
        let code = body[0];
        let length = u64::from_le_bytes(body[1..9].try_into().expect("eight bytes"));
        if code == op::DATA_END {
            return Ok(());
        }
        let wanted = matches!(code, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK);
        let limit = if matches!(code, op::SCHEMA | op::CHANNEL) { MAX_DESCRIPTION_BYTES } else { MAX_BYTES };
        if wanted && length > limit && length <= file.left() {
            let found = format!("a record of kind {code} of {length} bytes at byte {at}");
            return Err(Error::input(file.path(), None, found, format!("{limit} bytes at most")));
        }
        let there = if wanted { file.take(length, &mut body)? } else { file.skip(length)? };
        if !there {
            let found = format!("a record of {length} bytes with {} bytes left", file.left());
            sink.damaged(
                file.path(),
                at,
                found,
                "whole records: the recording was not closed or was cut off",
            );
            return Ok(());
        }
        match code {
            op::CHUNK => read_chunk(&mut known, (file, at), &body, &mut chunk, sink)?,
            _ => record(&mut known, code, &body, (file, at), sink)?,
        }
    }
}

/// A record that is not a chunk.
fn record(
    known: &mut Known,
    code: u8,
    body: &[u8],
    (file, at): (&Large, u64),
    sink: &mut Sink<'_, '_>,
) -> Result<()> {
    let mut cut = Cut(body);
    let whole = match code {
        op::SCHEMA => schema(known, &mut cut),
        op::CHANNEL => channel(known, &mut cut, sink),
        op::MESSAGE => {
            return match message(known, &mut cut) {
                Some((topic, recorded_ns)) => sink.message(&Message { topic, recorded_ns, at, data: cut.0 }),
                None => {
                    sink.damaged(
                        file.path(),
                        at,
                        "a message of no channel that was described",
                        "its channel before it",
                    );
                    Ok(())
                }
            };
        }
        _ => Some(()),
    };
    if whole.is_none() {
        let found = format!("a record of kind {code} with {} bytes that it cannot have", body.len());
        sink.damaged(file.path(), at, found, "a whole schema or channel");
    }
    Ok(())
}

fn schema(known: &mut Known, cut: &mut Cut<'_>) -> Option<()> {
    let (id, name) = (cut.u16()?, cut.text()?);
    known.schemas.insert(id, name);
    Some(())
}

fn channel(known: &mut Known, cut: &mut Cut<'_>, sink: &mut Sink<'_, '_>) -> Option<()> {
    let (id, schema, name, written) = (cut.u16()?, cut.u16()?, cut.text()?, cut.text()?);
    let encoding = match written.as_str() {
        "cdr" => Encoding::Ros(Wire::Cdr),
        "ros1" => Encoding::Ros(Wire::Ros1),
        "protobuf" => Encoding::Protobuf,
        "json" => Encoding::Json,
        other => Encoding::Other(other.to_owned()),
    };
    let type_name = known.schemas.get(&schema).map_or("", String::as_str);
    known.channels.insert(id, sink.topic(&name, type_name, encoding)?);
    Some(())
}

fn message(known: &Known, cut: &mut Cut<'_>) -> Option<(usize, i64)> {
    let (channel, _, recorded_ns, _) = (cut.u16()?, cut.u32()?, cut.u64()?, cut.u64()?);
    let topic = *known.channels.get(&channel)?;
    Some((topic, i64::try_from(recorded_ns).unwrap_or(i64::MAX)))
}

/// Stated length, checksum, how it is packed, and the packed records.
fn chunk_parts(body: &[u8]) -> Option<(u64, u32, String, &[u8])> {
    let mut cut = Cut(body);
    let (_, _, length, sum) = (cut.u64()?, cut.u64()?, cut.u64()?, cut.u32()?);
    let how = cut.text()?;
    let packed = cut.u64()?;
    Some((length, sum, how, cut.bytes(usize::try_from(packed).ok()?)?))
}

/// A chunk that cannot be read is passed over: the records behind it stand where they stand.
fn read_chunk(
    known: &mut Known,
    (file, at): (&Large, u64),
    body: &[u8],
    unpacked: &mut Vec<u8>,
    sink: &mut Sink<'_, '_>,
) -> Result<()> {
    let Some((length, sum, how, packed)) = chunk_parts(body) else {
        sink.damaged(file.path(), at, "a chunk whose parts are longer than it is", "a whole chunk");
        return Ok(());
    };
    let records = if how.is_empty() {
        packed
    } else {
        if let Err(fault) = sink.unpack(&how, packed, Some(length), unpacked) {
            sink.damaged(file.path(), at, fault.found, fault.expected);
            return Ok(());
        }
        unpacked.as_slice()
    };
    // 0 says that there is none.
    let found = crc32fast::hash(records);
    if sum != 0 && sum != found {
        let found = format!("a chunk with the checksum {found:08x}");
        sink.damaged(file.path(), at, found, format!("{sum:08x}"));
        return Ok(());
    }
    let mut cut = Cut(records);
    while !cut.0.is_empty() {
        let parts = (|| {
            let (code, length) = (cut.u8()?, cut.u64()?);
            Some((code, cut.bytes(usize::try_from(length).ok()?)?))
        })();
        let Some((code, body)) = parts else {
            sink.damaged(file.path(), at, "a chunk that ends inside a record", "whole records");
            return Ok(());
        };
        record(known, code, body, (file, at), sink)?;
    }
    Ok(())
}
