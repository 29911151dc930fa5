//! Pictures inside a page, as `data:` URIs.

use std::io::Cursor;
use std::path::{Component, Path};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::FilterType;

use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};

/// Most pixels along a side of a picture that was encoded anew for the page.
const MAX_SHOWN_PX: u32 = 960;
/// Quality of pictures that were encoded anew: nothing of a blinked pair moves or fades by more than a level or two.
const JPEG_QUALITY: u8 = 92;

/// How a page's pictures are kept within bounds: exact while there is room, then as JPEG of at most 960 px a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureBudget {
    /// Whether the files' own bytes are embedded.
    pub exact: bool,
}

impl PictureBudget {
    /// Bytes of picture files that a page may carry unchanged: 24 MB opens at once on a laptop.
    pub const EXACT_BYTES: u64 = 24 << 20;

    /// Decides by the total size of the files, in bytes.
    pub fn for_total(bytes: u64) -> Self {
        Self { exact: bytes <= Self::EXACT_BYTES }
    }
}

/// A picture of the folder as a `data:` URI; an empty name gives an empty text.
///
/// # Errors
/// A name that leads out of the folder, a file that cannot be read or is no PNG or JPEG.
pub fn data_uri(folder: &Path, name: &str, budget: PictureBudget) -> Result<String> {
    if name.is_empty() {
        return Ok(String::new());
    }
    let path = folder.join(name);
    if Path::new(name).components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir)) {
        return Err(Error::input(&path, None, format!("the picture `{name}`"), "a name inside the folder"));
    }
    let bytes = read(&path, Limit::PICTURE)?;
    let kind = match image::guess_format(&bytes) {
        Ok(image::ImageFormat::Png) => "image/png",
        Ok(image::ImageFormat::Jpeg) => "image/jpeg",
        _ => return Err(Error::input(&path, None, "a file of another kind", "a PNG or JPEG picture")),
    };
    let (kind, bytes) = if budget.exact { (kind, bytes) } else { ("image/jpeg", smaller(&path, &bytes)?) };
    Ok(format!("data:{kind};base64,{}", STANDARD.encode(bytes)))
}

/// The picture as JPEG, shrunk if it is large.
fn smaller(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let failed = |action, e: image::ImageError| Error::Picture {
        path: path.to_owned(),
        action,
        reason: e.to_string(),
    };
    let picture = shutterbug::plane::decode_picture(path, bytes)?;
    let picture = if picture.width().max(picture.height()) > MAX_SHOWN_PX {
        picture.resize(MAX_SHOWN_PX, MAX_SHOWN_PX, FilterType::Triangle)
    } else {
        picture
    };
    let mut out = Cursor::new(Vec::new());
    let encoder = JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY);
    picture.into_rgb8().write_with_encoder(encoder).map_err(|e| failed("encode", e))?;
    Ok(out.into_inner())
}

/// Size of a file, bytes; 0 for an empty name or a file that is not there (reading it will say so).
pub(super) fn size_of_picture(folder: &Path, name: &str) -> u64 {
    if name.is_empty() { 0 } else { std::fs::metadata(folder.join(name)).map_or(0, |m| m.len()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::plane::{Plane, write_png_atomic};

    #[test]
    fn exact_pictures_come_back_bit_for_bit_and_large_totals_shrink() {
        let folder = tempfile::tempdir().expect("a folder");
        let plane = Plane::from_fn(1200, 30, |x, y| [(x % 256) as u8, y as u8, (x * y % 256) as u8]);
        write_png_atomic(&folder.path().join("a.png"), &plane).expect("written");
        let exact = data_uri(folder.path(), "a.png", PictureBudget::for_total(1)).expect("there");
        let bytes =
            STANDARD.decode(exact.strip_prefix("data:image/png;base64,").expect("PNG")).expect("base64");
        assert_eq!(bytes, std::fs::read(folder.path().join("a.png")).expect("there"));
        let shrunk = data_uri(folder.path(), "a.png", PictureBudget::for_total(u64::MAX)).expect("there");
        let bytes =
            STANDARD.decode(shrunk.strip_prefix("data:image/jpeg;base64,").expect("JPEG")).expect("base64");
        let small = image::load_from_memory(&bytes).expect("a JPEG");
        assert_eq!((small.width(), small.height()), (960, 24));
    }

    #[test]
    fn only_pictures_of_the_folder_are_embedded() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("in")).expect("made");
        std::fs::write(folder.path().join("secret.txt"), "secret").expect("written");
        let budget = PictureBudget::for_total(0);
        for (root, name) in
            [("in", "../secret.txt"), ("in", "/etc/hostname"), (".", "secret.txt"), (".", "none.png")]
        {
            let error = data_uri(&folder.path().join(root), name, budget);
            assert!(error.is_err(), "{name} must not be embedded");
        }
        assert_eq!(data_uri(folder.path(), "", budget).expect("nothing"), "");
    }
}
