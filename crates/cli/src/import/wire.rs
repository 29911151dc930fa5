//! Fields of a message as ROS puts them on the wire: ROS 1's own serialization, and the CDR of ROS 2 (plain CDR, either
//! byte order). Lengths are held against what is there before anything is allocated.

use std::result::Result;

/// What is wrong with a message: found, expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) found: String,
    pub(super) expected: String,
}

impl Fault {
    pub(super) fn new(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { found: found.into(), expected: expected.into() }
    }
}

/// How the fields lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Wire {
    /// ROS 1: little endian, packed.
    Ros1,
    /// ROS 2: four bytes that name the encoding, then fields at multiples of their size.
    Cdr,
}

/// Reads fields one after another.
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    wire: Wire,
    big_endian: bool,
}

impl<'a> Fields<'a> {
    pub(super) fn new(bytes: &'a [u8], wire: Wire) -> Result<Self, Fault> {
        if wire == Wire::Ros1 {
            return Ok(Self { bytes, at: 0, wire, big_endian: false });
        }
        match bytes {
            [0, kind @ (0 | 1), _, _, body @ ..] => {
                Ok(Self { bytes: body, at: 0, wire, big_endian: *kind == 0 })
            }
            [a, b, _, _, ..] => {
                let found = format!("a message in the encoding {a:#04x} {b:#04x}");
                Err(Fault::new(found, "plain CDR (0x00 0x00 or 0x00 0x01)"))
            }
            _ => Err(Fault::new(format!("a message of {} bytes", bytes.len()), "a CDR message")),
        }
    }

    /// Whether this is ROS 1, whose headers hold a number more.
    fn is_ros1(&self) -> bool {
        self.wire == Wire::Ros1
    }

    fn take(&mut self, count: usize, align: usize) -> Result<&'a [u8], Fault> {
        if self.wire == Wire::Cdr {
            self.at = self.at.next_multiple_of(align);
        }
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let Some(end) = end else {
            let found =
                format!("a message of {} bytes whose field at {} needs {count}", self.bytes.len(), self.at);
            return Err(Fault::new(found, "a whole message of its type"));
        };
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut bytes: [u8; N] = self.take(N, N)?.try_into().expect("as many as asked for");
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Fault> {
        Ok(u8::from_le_bytes(self.number()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, Fault> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    pub(super) fn f64(&mut self) -> Result<f64, Fault> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Fault> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// A list of any length.
    pub(super) fn f64_list(&mut self) -> Result<Vec<f64>, Fault> {
        let count = self.count(8)?;
        (0..count).map(|_| self.f64()).collect()
    }

    /// The length of a list whose items take at least `least` bytes each.
    pub(super) fn count(&mut self, least: usize) -> Result<usize, Fault> {
        let count = self.u32()? as usize;
        let left = self.bytes.len() - self.at;
        if count.checked_mul(least).is_none_or(|bytes| bytes > left) {
            let found = format!("a list of {count} items with {left} bytes left");
            return Err(Fault::new(found, "a whole message of its type"));
        }
        Ok(count)
    }

    /// A list of bytes.
    pub(super) fn blob(&mut self) -> Result<&'a [u8], Fault> {
        let count = self.count(1)?;
        self.take(count, 1)
    }

    pub(super) fn text(&mut self) -> Result<String, Fault> {
        let bytes = self.blob()?;
        // CDR counts the zero at the end.
        let bytes = bytes.strip_suffix(b"\0").unwrap_or(bytes);
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    /// Seconds and nanoseconds, as ns.
    pub(super) fn stamp_ns(&mut self) -> Result<i64, Fault> {
        let (seconds, ns) = (self.u32()?, self.u32()?);
        // ROS 2 has signed seconds, ROS 1 has not: it stops in 2106 and not in 2038.
        let seconds = if self.is_ros1() { i64::from(seconds) } else { i64::from(seconds as i32) };
        Ok(seconds * 1_000_000_000 + i64::from(ns))
    }

    /// std_msgs/Header: stamp and frame.
    pub(super) fn header(&mut self) -> Result<(i64, String), Fault> {
        if self.is_ros1() {
            self.u32()?;
        }
        Ok((self.stamp_ns()?, frame_name(&self.text()?)))
    }
}

/// Names of frames without the slash that ROS 1 allowed before them.
pub(super) fn frame_name(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_aligns_and_ros1_packs() {
        let cdr = [&[0, 1, 0, 0][..], &[7, 0, 0, 0], &[0; 4], &2.5f64.to_le_bytes()].concat();
        let mut fields = Fields::new(&cdr, Wire::Cdr).expect("CDR");
        assert_eq!((fields.u8(), fields.f64()), (Ok(7), Ok(2.5)));
        let big = [&[0, 0, 0, 0][..], &3u32.to_be_bytes()].concat();
        assert_eq!(Fields::new(&big, Wire::Cdr).expect("CDR").u32(), Ok(3));
        let packed = [&[7][..], &2.5f64.to_le_bytes()].concat();
        let mut fields = Fields::new(&packed, Wire::Ros1).expect("ROS 1");
        assert_eq!((fields.u8(), fields.f64()), (Ok(7), Ok(2.5)));
        assert!(fields.u8().expect_err("over").found.contains("needs 1"));
    }

    #[test]
    fn a_length_is_held_against_what_is_there() {
        let claims = [&[0, 1, 0, 0][..], &u32::MAX.to_le_bytes(), b"abc"].concat();
        let fields = || Fields::new(&claims, Wire::Cdr).expect("CDR");
        let all = [fields().blob().map(drop), fields().text().map(drop), fields().f64_list().map(drop)];
        for fault in all {
            assert!(fault.expect_err("too long").found.contains("a list of 4294967295 items"));
        }
        assert!(Fields::new(&[0, 6, 0, 0], Wire::Cdr).is_err() && Fields::new(&[0], Wire::Cdr).is_err());
    }
}
