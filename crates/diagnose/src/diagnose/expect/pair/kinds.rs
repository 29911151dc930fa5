//! What pictures of a folder are, where they are read as something else: 8 bits a channel, in colour.

use std::path::Path;

use shutterbug::error::Result;
use shutterbug::files::{Limit, read};
use shutterbug::plane::decode_picture;

/// What a reader should know of a folder's pictures, by the first one.
///
/// # Errors
/// A file that is no picture.
pub(crate) fn notes(folder: &Path, first: &str) -> Result<Vec<String>> {
    let path = folder.join(first);
    let color = decode_picture(&path, &read(&path, Limit::PICTURE)?)?.color();
    let mut notes = Vec::new();
    let bits = color.bits_per_pixel() / u16::from(color.channel_count());
    if bits > 8 {
        notes.push(format!(
            "the pictures in {} have {bits} bits a channel and are read as 8: what is finer is not seen",
            folder.display()
        ));
    }
    if !color.has_color() {
        notes.push(format!(
            "the pictures in {} are grey: what changes colours alone does not show in them, whatever is said of it",
            folder.display()
        ));
    }
    if color.has_alpha() {
        notes.push(format!(
            "the pictures in {} have an alpha channel, which is not looked at: what it hides is compared too",
            folder.display()
        ));
    }
    Ok(notes)
}
