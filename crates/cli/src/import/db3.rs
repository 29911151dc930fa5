//! ROS 2 bags in SQLite (`.db3`): the tables `topics` and `messages`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::large::Large;
use super::sink::Sink;
use super::sqlite::{Database, Value};
use super::topic::{Encoding, Message};
use super::wire::Wire;
use shutterbug::error::{Error, Result};

/// How zstd's frames begin: bags may have each message packed.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Reads all messages.
pub(super) fn read(file: Large, sink: &mut Sink<'_, '_>) -> Result<()> {
    let path = file.path().to_owned();
    note_unfinished(&file, sink);
    let mut database = Database::open(file)?;
    let mut known = HashMap::new();
    let topics = root(&mut database, "topics")?;
    database.rows(topics, &mut |at, number, row| {
        let text = |place: usize| row.get(place).and_then(Value::text);
        let (Some(name), Some(type_name)) = (text(1), text(2)) else {
            sink.damaged(&path, at, "a topic without name and type", "both");
            return Ok(());
        };
        let encoding = match text(3).unwrap_or_default().as_str() {
            "cdr" => Encoding::Ros(Wire::Cdr),
            other => Encoding::Other(other.to_owned()),
        };
        known.extend(sink.topic(&name, &type_name, encoding).map(|place| (number, place)));
        Ok(())
    })?;
    let messages = root(&mut database, "messages")?;
    let (mut unpacked, mut seen) = (Vec::new(), 0);
    database.rows(messages, &mut |at, _, row| {
        let topic = row.get(1).and_then(Value::whole).and_then(|t| known.get(&t).copied());
        let (Some(topic), Some(recorded_ns), Some(Value::Bytes(data))) =
            (topic, row.get(2).and_then(Value::whole), row.get(3))
        else {
            sink.damaged(&path, at, "a message without topic, time or data", "all three");
            return Ok(());
        };
        seen += data.len() as u64;
        sink.progress(seen)?;
        let mut data = *data;
        if data.starts_with(&ZSTD) {
            if let Err(fault) = sink.unpack("zstd", data, None, &mut unpacked) {
                sink.damaged(&path, at, fault.found, fault.expected);
                return Ok(());
            }
            data = &unpacked;
        }
        sink.message(&Message { topic, recorded_ns, at, data })
    })?;
    for (at, found, expected) in database.damage {
        sink.damaged(&path, at, found, expected);
    }
    Ok(())
}

fn root(database: &mut Database, name: &str) -> Result<u64> {
    let expected = "the tables `topics` and `messages` of a ROS 2 bag";
    match database.table(name)? {
        Some(root) => Ok(root),
        None => {
            let damage = database.damage.first();
            let why = damage.map_or(String::new(), |(at, found, _)| format!(", and {found} at byte {at}"));
            let path = database.file().path();
            let Some(beside) = unfinished(path) else {
                return Err(Error::input(path, None, format!("no table `{name}`{why}"), expected));
            };
            let found = format!("no table `{name}`{why}, and messages in {} beside it", beside.display());
            Err(Error::input(path, None, found, CLOSED))
        }
    }
}

/// What is expected where it is there.
const CLOSED: &str = "a bag that was closed (`sqlite3 FILE 'pragma wal_checkpoint(truncate)'` closes it)";

/// The second file beside a bag, in which what was recorded last may stand: only SQLite itself can fold it in.
fn unfinished(path: &Path) -> Option<PathBuf> {
    let mut beside = path.as_os_str().to_owned();
    beside.push("-wal");
    std::fs::metadata(&beside).is_ok_and(|m| m.len() > 0).then(|| beside.into())
}

fn note_unfinished(file: &Large, sink: &mut Sink<'_, '_>) {
    if let Some(beside) = unfinished(file.path()) {
        sink.damaged(file.path(), 0, format!("messages in {} beside it", beside.display()), CLOSED);
    }
}
