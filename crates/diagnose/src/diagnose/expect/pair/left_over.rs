//! Pictures of two folders that are not compared, or not with another one: nothing that is there is passed over without
//! a word.

use std::collections::BTreeSet;
use std::path::Path;

use super::matched::{Matched, ending_with, pictures};
use shutterbug::error::{Result, counted};
use shutterbug::files::{Limit, read};

/// Endings of pictures in formats that are not read.
const OTHER_FORMATS: [&str; 9] = ["bmp", "tif", "tiff", "webp", "gif", "ppm", "pgm", "exr", "raw"];

/// What a reader should know of pictures that belong to no pair.
///
/// # Errors
/// A folder that cannot be listed.
pub(super) fn notes(sim: &Path, real: &Path, matched: &[Matched]) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    for (folder, other, is_real) in [(sim, real, false), (real, sim, true)] {
        let own = |m: &Matched| if is_real { m.real.clone() } else { m.sim.clone() };
        let paired: BTreeSet<String> = matched.iter().map(own).collect();
        let all = pictures(folder)?;
        let alone: Vec<&String> = all.iter().filter(|n| !paired.contains(*n)).collect();
        if let Some(first) = alone.first() {
            notes.push(format!(
                "{} of {} in {} have no partner in {} and were not looked at, {first} the first",
                alone.len(),
                counted(all.len(), "picture", "pictures"),
                folder.display(),
                other.display()
            ));
        }
        notes.extend(of_other_formats(folder)?);
    }
    Ok(notes)
}

/// What of a folder looks like a picture and is not read.
///
/// # Errors
/// A folder that cannot be listed.
pub(crate) fn of_other_formats(folder: &Path) -> Result<Option<String>> {
    let names = ending_with(folder, &OTHER_FORMATS)?;
    Ok(names.first().map(|first| {
        let count = counted(names.len(), "file", "files");
        format!(
            "{count} in {} are neither PNG nor JPEG and were not read, {first} the first",
            folder.display()
        )
    }))
}

/// What a reader should know of real pictures that are simulated ones, byte for byte. `pairs`: names of both.
///
/// # Errors
/// A file that cannot be read.
pub(crate) fn copies(sim: &Path, real: &Path, pairs: &[[&str; 2]]) -> Result<Option<String>> {
    let mut copies = 0;
    for [a, b] in pairs {
        let (a, b) = (sim.join(a), real.join(b));
        let size = |path: &Path| path.metadata().map(|m| m.len()).ok();
        let same = size(&a) == size(&b) && read(&a, Limit::PICTURE)? == read(&b, Limit::PICTURE)?;
        copies += usize::from(same);
    }
    Ok((copies > 0).then(|| {
        format!(
            "{copies} of {} are, byte for byte, the simulated ones: there a folder is compared with itself",
            counted(pairs.len(), "real picture", "real pictures")
        )
    }))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pictures_without_a_partner_and_copies_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let [sim, real] = ["sim", "real"].map(|n| folder.path().join(n));
        for (at, name, text) in [
            (&sim, "a.png", "1"),
            (&sim, "b.png", "2"),
            (&real, "a.png", "1"),
            (&real, "b.png", "3"),
            (&real, "c.png", "4"),
            (&real, "d.BMP", "5"),
        ] {
            fs::create_dir_all(at).expect("made");
            fs::write(at.join(name), text).expect("written");
        }
        let pair = |n: &str| Matched { sim: n.to_owned(), real: n.to_owned() };
        let said = notes(&sim, &real, &[pair("a.png"), pair("b.png")]).expect("listed");
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].starts_with("1 of 3 pictures in") && said[0].contains("c.png the first"), "{said:?}");
        assert!(said[1].contains("d.BMP"), "{said:?}");
        let said = copies(&sim, &real, &[["a.png", "a.png"], ["b.png", "b.png"]]).expect("read");
        assert!(said.as_deref().is_some_and(|s| s.starts_with("1 of 2 real pictures")), "{said:?}");
        assert_eq!(copies(&sim, &real, &[["b.png", "b.png"]]).expect("read"), None, "control");
    }
}
