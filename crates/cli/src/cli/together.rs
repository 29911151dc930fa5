//! Pictures of one measurement.

use std::path::{Path, PathBuf};

use shutterbug::error::{Error, Result};
use shutterbug_diagnose::calibrate::{Distinct, Frame};

/// What pictures of one measurement have in common, and must not have.
#[derive(Default)]
pub(super) struct Together {
    pub(super) size: Option<[usize; 2]>,
    first: PathBuf,
    is_grey: bool,
    distinct: Distinct,
}

impl Together {
    /// Takes the kind of a picture for that of all.
    pub(super) fn begin(&mut self, path: &Path) -> Result<()> {
        let frame = Frame::read(path)?;
        self.size = Some([frame.encoded.width, frame.encoded.height]);
        (self.first, self.is_grey) = (path.to_owned(), frame.is_grey());
        Ok(())
    }

    /// Reads pictures one after another; all must be of the first one's size, and none a copy of another.
    pub(super) fn each(&mut self, paths: &[PathBuf], mut take: impl FnMut(&Frame)) -> Result<()> {
        for path in paths {
            let frame = Frame::read(path)?;
            let found = [frame.encoded.width, frame.encoded.height];
            if self.size.is_none() {
                (self.first, self.is_grey) = (path.clone(), frame.is_grey());
            }
            let wanted = *self.size.get_or_insert(found);
            if found != wanted {
                let expected = format!("{}x{} px as in {}", wanted[0], wanted[1], self.first.display());
                return Err(Error::input(path, None, format!("{}x{} px", found[0], found[1]), expected));
            }
            frame.check_colours(self.is_grey, &self.first)?;
            take(&frame);
            self.distinct.add(frame)?;
        }
        Ok(())
    }
}
