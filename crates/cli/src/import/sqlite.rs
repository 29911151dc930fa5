//! The tables of an SQLite file, read only (sqlite.org/fileformat.html): as much as ROS 2 bags (`.db3`) need. Every
//! page is visited once at most, so a file that leads in circles ends.

use super::large::Large;
use shutterbug::error::{Error, Result};

/// How a file begins.
pub(super) const MAGIC: &[u8; 16] = b"SQLite format 3\0";
/// Deepest tree: with two children a page, 2^40 pages.
const MAX_LEVELS: usize = 40;
/// Largest row, bytes.
const MAX_ROW_BYTES: u64 = super::unpack::MAX_BYTES;

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Null,
    Whole(i64),
    Real(f64),
    /// Text or bytes.
    Bytes(&'a [u8]),
}

impl Value<'_> {
    pub(super) fn whole(&self) -> Option<i64> {
        match self {
            Self::Whole(n) => Some(*n),
            _ => None,
        }
    }

    pub(super) fn text(&self) -> Option<String> {
        match self {
            Self::Bytes(b) => Some(String::from_utf8_lossy(b).into_owned()),
            _ => None,
        }
    }
}

/// An open database.
pub(super) struct Database {
    file: Large,
    page_bytes: u64,
    usable: u64,
    /// Pages that may still be visited.
    budget: u64,
    /// What could not be read.
    pub(super) damage: Vec<Bad>,
}

/// A place that could not be read: byte, found, expected.
pub(super) type Bad = (u64, String, &'static str);

/// Most places that are kept.
const MAX_BAD_PLACES: usize = 64;

/// What is called with each row: the place of its page, its number, its values.
type Row<'a> = dyn FnMut(u64, i64, &[Value<'_>]) -> Result<()> + 'a;

impl Database {
    pub(super) fn open(mut file: Large) -> Result<Self> {
        let mut head = Vec::new();
        file.seek(0)?;
        if !file.take(100, &mut head)? {
            return Err(Error::input(
                file.path(),
                None,
                "a file of less than 100 bytes",
                "an SQLite database",
            ));
        }
        let page_bytes = match u64::from(u16::from_be_bytes([head[16], head[17]])) {
            1 => 65_536,
            n => n,
        };
        let usable = page_bytes.saturating_sub(u64::from(head[20]));
        if !page_bytes.is_power_of_two() || page_bytes < 512 || usable < 480 {
            let found = format!("pages of {page_bytes} bytes");
            return Err(Error::input(file.path(), None, found, "a power of two from 512 to 65536"));
        }
        let budget = file.bytes().div_ceil(page_bytes);
        Ok(Self { file, page_bytes, usable, budget, damage: Vec::new() })
    }

    pub(super) fn file(&self) -> &Large {
        &self.file
    }

    /// First page of a table; nothing if there is none of that name.
    pub(super) fn table(&mut self, name: &str) -> Result<Option<u64>> {
        let mut root = None;
        self.rows(1, &mut |_, _, row| {
            let is = |at: usize, text: &str| row.get(at).and_then(Value::text).is_some_and(|t| t == text);
            if is(0, "table") && is(1, name) {
                root = row.get(3).and_then(Value::whole).and_then(|n| u64::try_from(n).ok());
            }
            Ok(())
        })?;
        Ok(root)
    }

    /// Calls `with` for each row of the table that begins at that page, in their order, with the place of the row's
    /// page.
    pub(super) fn rows(&mut self, root: u64, with: &mut Row<'_>) -> Result<()> {
        self.budget = self.file.bytes().div_ceil(self.page_bytes);
        self.walk(root, 0, with)
    }

    /// Notes a place that cannot be read; the rest is read all the same.
    fn bad(&mut self, at: u64, found: impl Into<String>, expected: &'static str) {
        if self.damage.len() < MAX_BAD_PLACES {
            self.damage.push((at, found.into(), expected));
        }
    }

    /// Reads a page: its place in the file; nothing where it is not there.
    fn page(&mut self, number: u64, into: &mut Vec<u8>) -> Result<Option<u64>> {
        let at = number.saturating_sub(1).saturating_mul(self.page_bytes);
        if number == 0 || self.budget == 0 {
            self.bad(at, format!("a way to page {number} again"), "a tree of pages");
            return Ok(None);
        }
        self.budget -= 1;
        self.file.seek(at.min(self.file.bytes()))?;
        if at >= self.file.bytes() || !self.file.take(self.page_bytes, into)? {
            let found = format!("page {number} behind the end of {} bytes", self.file.bytes());
            self.bad(at, found, "a whole database: was it cut off, or copied while it was recorded?");
            return Ok(None);
        }
        Ok(Some(at))
    }

    fn walk(&mut self, number: u64, level: usize, with: &mut Row<'_>) -> Result<()> {
        let mut page = Vec::new();
        let Some(at) = self.page(number, &mut page)? else { return Ok(()) };
        let head = if number == 1 { 100 } else { 0 };
        let count = usize::from(be16(&page, head + 3));
        match page[head] {
            // An inner page: children, and one more behind the last.
            0x05 if level < MAX_LEVELS => {
                let child = |place: usize| u64::from(be32(&page, place));
                let mut children: Vec<u64> =
                    (0..count).map(|i| child(usize::from(be16(&page, head + 12 + 2 * i)))).collect();
                children.push(child(head + 8));
                children.into_iter().try_for_each(|next| self.walk(next, level + 1, with))
            }
            0x0d => (0..count).try_for_each(|i| {
                let place = usize::from(be16(&page, head + 8 + 2 * i));
                self.row(&page, (at, place), with)
            }),
            kind => {
                self.bad(at, format!("a page of kind {kind:#04x}"), "a page of a table");
                Ok(())
            }
        }
    }

    fn row(&mut self, page: &[u8], (at, place): (u64, usize), with: &mut Row<'_>) -> Result<()> {
        let Some((number, payload)) = self.payload(page, (at, place))? else { return Ok(()) };
        match values(&payload) {
            Some(row) => with(at, number, &row),
            None => {
                self.bad(at, "a row whose values are longer than it is", "a whole row");
                Ok(())
            }
        }
    }

    /// A row's number and its bytes, of this page and of those that it goes on in.
    fn payload(&mut self, page: &[u8], (at, place): (u64, usize)) -> Result<Option<(i64, Vec<u8>)>> {
        let mut cell = page.get(place..).unwrap_or_default();
        let parts = varint(&mut cell).zip(varint(&mut cell));
        let Some((bytes, number)) = parts.and_then(|(b, n)| Some((u64::try_from(b).ok()?, n))) else {
            self.bad(at, "a row without a length", "a whole page");
            return Ok(None);
        };
        if bytes > MAX_ROW_BYTES.min(self.file.bytes()) {
            self.bad(at, format!("a row of {bytes} bytes"), "no more than the file, or 512 MiB");
            return Ok(None);
        }
        let local = self.local(bytes);
        let Some(mut payload) = cell.get(..local as usize).map(<[u8]>::to_vec) else {
            self.bad(at, "a row that leaves its page", "a whole page");
            return Ok(None);
        };
        let mut next = if local < bytes { u64::from(be32(cell, local as usize)) } else { 0 };
        let mut more = Vec::new();
        while (payload.len() as u64) < bytes {
            if self.page(next, &mut more)?.is_none() {
                return Ok(None);
            }
            let part = (bytes - payload.len() as u64).min(self.usable - 4);
            payload.extend(&more[4..4 + part as usize]);
            next = u64::from(be32(&more, 0));
        }
        Ok(Some((number, payload)))
    }

    /// How much of a row lies on its page.
    fn local(&self, bytes: u64) -> u64 {
        let most = self.usable - 35;
        if bytes <= most {
            return bytes;
        }
        let least = (self.usable - 12) * 32 / 255 - 23;
        let kept = least + (bytes - least) % (self.usable - 4);
        if kept <= most { kept } else { least }
    }
}

/// Big-endian numbers; 0 beyond the end, which no page is.
fn be16(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).map_or(0, |b| u16::from_be_bytes([b[0], b[1]]))
}

fn be32(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).map_or(0, |b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]))
}

fn varint(bytes: &mut &[u8]) -> Option<i64> {
    let mut value = 0u64;
    for place in 0..9 {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        if place == 8 {
            return Some((value << 8 | u64::from(*first)) as i64);
        }
        value = value << 7 | u64::from(first & 0x7f);
        if first & 0x80 == 0 {
            break;
        }
    }
    Some(value as i64)
}

/// The values of a row.
fn values(payload: &[u8]) -> Option<Vec<Value<'_>>> {
    let mut kinds = payload;
    let head = usize::try_from(varint(&mut kinds)?).ok()?;
    let used = payload.len() - kinds.len();
    let mut kinds = payload.get(used..head)?;
    let mut body = payload.get(head..)?;
    let mut row = Vec::new();
    while !kinds.is_empty() {
        let kind = u64::try_from(varint(&mut kinds)?).ok()?;
        let bytes = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((kind - 12) / 2).ok()?,
        };
        let (taken, rest) = body.split_at_checked(bytes)?;
        body = rest;
        let whole = || {
            let sign = taken.first().map_or(0, |b| if b & 0x80 == 0 { 0 } else { -1 });
            taken.iter().fold(sign, |n: i64, b| n << 8 | i64::from(*b))
        };
        row.push(match kind {
            0 => Value::Null,
            8 => Value::Whole(0),
            9 => Value::Whole(1),
            7 => Value::Real(f64::from_bits(whole() as u64)),
            1..=6 => Value::Whole(whole()),
            _ => Value::Bytes(taken),
        });
    }
    Some(row)
}
