//! `contact-sheet`: frames of several folders side by side, with captions, to be judged by eye.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, bail, ensure};
use image::{Rgb, RgbImage, imageops};

use crate::font;

const GAP_PX: u32 = 6;
/// Captions are drawn at twice the font's size.
const TEXT_SCALE: u32 = 2;
const BAND_PX: u32 = font::GLYPH_PX * TEXT_SCALE + 2 * GAP_PX;
const PAPER: Rgb<u8> = Rgb([24, 24, 28]);
const INK: Rgb<u8> = Rgb([240, 240, 240]);

/// What to put where.
#[derive(clap::Args)]
pub struct Args {
    /// The PNG to write.
    #[arg(long)]
    out: PathBuf,
    /// Names of the frames, one row each; default: every PNG of the first folder, in order of name.
    #[arg(long, value_delimiter = ',')]
    frames: Vec<String>,
    /// Columns from left to right: LABEL=DIR.
    #[arg(required = true)]
    columns: Vec<Column>,
}

/// One column: a folder of frames and what to write above it.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    label: String,
    folder: PathBuf,
}

impl FromStr for Column {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (label, folder) = text.split_once('=').ok_or_else(|| format!("`{text}` is not LABEL=DIR"))?;
        Ok(Self { label: label.to_owned(), folder: folder.into() })
    }
}

/// Writes the sheet.
///
/// # Errors
/// A frame that is missing, cannot be decoded or has another size than the first; a sheet that cannot be written.
pub fn write(args: &Args) -> Result<()> {
    let frames =
        if args.frames.is_empty() { png_names(&args.columns[0].folder)? } else { args.frames.clone() };
    let labels: Vec<&str> = args.columns.iter().map(|c| c.label.as_str()).collect();
    let mut rows = Vec::new();
    for frame in &frames {
        rows.push(args.columns.iter().map(|c| read(&c.folder.join(frame))).collect::<Result<Vec<_>>>()?);
    }
    let sheet = sheet(&labels, &frames, &rows)?;
    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    }
    sheet.save(&args.out).with_context(|| format!("cannot write {}", args.out.display()))
}

fn png_names(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut names = Vec::new();
    for entry in entries {
        let name = entry.with_context(|| format!("cannot read {}", folder.display()))?.file_name();
        let name = name.to_string_lossy().into_owned();
        if name.ends_with(".png") {
            names.push(name);
        }
    }
    if names.is_empty() {
        bail!("{}: no PNG to show", folder.display());
    }
    names.sort();
    Ok(names)
}

fn read(path: &Path) -> Result<RgbImage> {
    Ok(image::open(path).with_context(|| format!("cannot read {}", path.display()))?.to_rgb8())
}

/// Lays out `rows[row][column]`, all of one size, under a band of labels, each row above its frame's name.
fn sheet(labels: &[&str], frames: &[String], rows: &[Vec<RgbImage>]) -> Result<RgbImage> {
    let (width, height) = rows[0][0].dimensions();
    let (cell_w, cell_h) = (width + GAP_PX, height + BAND_PX);
    let size = [labels.len() as u32 * cell_w + GAP_PX, rows.len() as u32 * cell_h + BAND_PX];
    ensure!(
        size[0] <= 32768 && size[1] <= 32768,
        "a sheet of {}x{} px is too large: name fewer frames",
        size[0],
        size[1]
    );
    let mut sheet = RgbImage::from_pixel(size[0], size[1], PAPER);
    for (x, label) in (0u32..).map(|i| GAP_PX + i * cell_w).zip(labels) {
        caption(&mut sheet, label, [x, GAP_PX], width);
    }
    for (y, (frame, row)) in (0u32..).map(|i| BAND_PX + i * cell_h).zip(frames.iter().zip(rows)) {
        for (x, (label, picture)) in (0u32..).map(|i| GAP_PX + i * cell_w).zip(labels.iter().zip(row)) {
            let (w, h) = picture.dimensions();
            ensure!(
                (w, h) == (width, height),
                "{label}, {frame}: {w}x{h} px, the first picture has {width}x{height}"
            );
            imageops::replace(&mut sheet, picture, i64::from(x), i64::from(y));
        }
        caption(&mut sheet, frame, [GAP_PX, y + height + GAP_PX], width);
    }
    Ok(sheet)
}

/// Writes a text, cut off at `width_px`.
fn caption(sheet: &mut RgbImage, text: &str, at: [u32; 2], width_px: u32) {
    let fits = (width_px / (font::GLYPH_PX * TEXT_SCALE)) as usize;
    let text: String = text.chars().take(fits).collect();
    font::draw(&text, |x, y| {
        for (dx, dy) in (0..TEXT_SCALE * TEXT_SCALE).map(|i| (i % TEXT_SCALE, i / TEXT_SCALE)) {
            sheet.put_pixel(at[0] + TEXT_SCALE * x + dx, at[1] + TEXT_SCALE * y + dy, INK);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: u8) -> RgbImage {
        RgbImage::from_pixel(64, 48, Rgb([value; 3]))
    }

    #[test]
    fn pictures_lie_where_their_captions_say() {
        let rows = vec![vec![flat(10), flat(20)], vec![flat(30), flat(40)]];
        let frames = ["a.png".to_owned(), "b.png".to_owned()];
        let sheet = sheet(&["x", ""], &frames, &rows).expect("equal sizes");
        assert_eq!(sheet.dimensions(), (2 * (64 + GAP_PX) + GAP_PX, 2 * (48 + BAND_PX) + BAND_PX));
        for (row, column, value) in [(0, 0, 10), (0, 1, 20), (1, 0, 30), (1, 1, 40)] {
            let (x, y) = (GAP_PX + column * (64 + GAP_PX), BAND_PX + row * (48 + BAND_PX));
            assert_eq!(sheet.get_pixel(x, y)[0], value);
            assert_eq!(sheet.get_pixel(x + 63, y + 47)[0], value);
            assert_eq!(*sheet.get_pixel(x + 64, y), PAPER);
        }
        let ink = |from: u32, to: u32| {
            (from..to)
                .flat_map(|x| (0..BAND_PX).map(move |y| (x, y)))
                .filter(|&(x, y)| *sheet.get_pixel(x, y) == INK)
                .count()
        };
        assert!(ink(0, 64) > 20 && ink(70, 140) == 0, "a label is drawn over its own column only");
    }

    #[test]
    fn other_sizes_and_malformed_columns_are_refused() {
        let rows = vec![vec![flat(1), RgbImage::new(63, 48)]];
        let error = sheet(&["x", "y"], &["a.png".to_owned()], &rows).expect_err("sizes differ").to_string();
        assert!(error.contains("63x48"), "{error}");
        assert!("nolabel".parse::<Column>().is_err());
        let column = Column { label: "a b".into(), folder: "d=e".into() };
        assert_eq!("a b=d=e".parse::<Column>(), Ok(column));
    }
}
