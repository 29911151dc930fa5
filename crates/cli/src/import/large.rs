//! Files that are too large to hold in memory: recordings. They are read from front to back, or at offsets that the
//! file itself names.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use shutterbug::error::{Error, Result};
use shutterbug::files;
use shutterbug_diagnose::out::{note_read, sha256_hex};

/// Of a large file, so much of its beginning and of its end tell it from others.
const EDGE_BYTES: u64 = 1 << 20;

/// An open regular file. Nothing is allocated for what a file claims to hold and does not.
#[derive(Debug)]
pub struct Large {
    path: PathBuf,
    file: BufReader<File>,
    bytes: u64,
    at: u64,
}

impl Large {
    /// Opens a file and notes it as read: by its length and its first and last MiB, as hashing all of a recording takes
    /// as long as reading it.
    ///
    /// # Errors
    /// A missing or unreadable file; a pipe, a device or a folder.
    pub fn open(path: &Path) -> Result<Self> {
        let (file, bytes) = files::open_regular(path, path)?;
        let file = BufReader::with_capacity(1 << 16, file);
        let mut large = Self { path: path.to_owned(), file, bytes, at: 0 };
        let mark = large.mark()?;
        note_read(path, mark);
        large.seek(0)?;
        Ok(large)
    }

    fn mark(&mut self) -> Result<String> {
        let mut bytes = self.bytes.to_le_bytes().to_vec();
        let edge = EDGE_BYTES.min(self.bytes);
        for from in [0, self.bytes - edge] {
            self.seek(from)?;
            let mut part = Vec::new();
            self.take(edge, &mut part)?;
            bytes.append(&mut part);
        }
        Ok(format!("{} bytes, length and edges {}", self.bytes, sha256_hex(&bytes)))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its length when it was opened, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Where the next byte is read, counted from the beginning.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Bytes from here to the end.
    pub fn left(&self) -> u64 {
        self.bytes.saturating_sub(self.at)
    }

    /// Reads so many bytes in place of what `into` holds; `false`, and nothing read, where the file ends before.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn take(&mut self, count: u64, into: &mut Vec<u8>) -> Result<bool> {
        into.clear();
        if count > self.left() {
            return Ok(false);
        }
        // No more than the file holds.
        into.resize(count as usize, 0);
        let done = self.file.read_exact(into);
        if matches!(&done, Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof) {
            // It was cut while it was read.
            self.bytes = self.at;
            into.clear();
            return Ok(false);
        }
        done.map_err(|e| Error::io(&self.path, "read", e))?;
        self.at += count;
        Ok(true)
    }

    /// Passes over so many bytes; `false`, and no step, where the file ends before.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn skip(&mut self, count: u64) -> Result<bool> {
        let Some(step) = i64::try_from(count).ok().filter(|_| count <= self.left()) else { return Ok(false) };
        self.file.seek_relative(step).map_err(|e| Error::io(&self.path, "read", e))?;
        self.at += count;
        Ok(true)
    }

    /// Goes to a place, counted from the beginning.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn seek(&mut self, to: u64) -> Result<()> {
        self.file.seek(SeekFrom::Start(to)).map_err(|e| Error::io(&self.path, "read", e))?;
        self.at = to;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_taken_of_what_is_not_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123456789").expect("written");
        let mut file = Large::open(&path).expect("opened");
        let mut bytes = Vec::new();
        assert!(file.take(4, &mut bytes).expect("read") && bytes == b"0123");
        assert!(!file.take(7, &mut bytes).expect("read") && bytes.is_empty());
        assert!(!file.take(u64::MAX, &mut bytes).expect("read") && !file.skip(u64::MAX).expect("read"));
        assert_eq!((file.at(), file.left(), file.bytes()), (4, 6, 10));
        assert!(file.skip(3).expect("read"));
        assert!(file.take(3, &mut bytes).expect("read") && bytes == b"789");
        file.seek(1).expect("sought");
        assert!(file.take(2, &mut bytes).expect("read") && bytes == b"12");
        assert!(Large::open(folder.path()).expect_err("a folder").to_string().contains("a regular file"));
    }
}
