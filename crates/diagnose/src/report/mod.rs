//! `report.html`: the page about a diagnosis, one file that works offline by double click.
//!
//! It only formats: every figure on it is one of [`crate::diagnose::Report`], the struct that `report.json` is written
//! from. Pictures are embedded; text is escaped by the template engine, as names of files and objects come from
//! strangers.
//!
//! Charts are SVG written by the template from the coordinates of `chart.rs`. A plotting library was weighed and left
//! out: its SVG carries fixed colours and positions without names. The page's style sheet could not adapt it to print
//! or dark mode, and it could not be read aloud. What is needed is two lines and some bars.

mod chart;
mod embed;
mod format;
mod glossary;
mod page;
mod percepts;

use std::path::Path;

use crate::diagnose::Report;
use shutterbug::error::Result;
use shutterbug::files::{self, Limit};
use shutterbug::plane::write_atomic;

pub use chart::{Chart, Series, line_chart};
pub use embed::{PictureBudget, data_uri};
pub use format::{environment, number, percent, plain_name};

/// Name of the page in its folder.
pub const PAGE_FILE: &str = "report.html";

/// Writes `report.html` into the folder that holds the report's pictures.
///
/// # Errors
/// A picture that the report names and that cannot be read, or a page that cannot be written.
pub fn write_html(report: &Report, folder: &Path) -> Result<()> {
    let html = render_html(report, folder)?;
    write_atomic(&folder.join(PAGE_FILE), html.as_bytes())
}

/// The text of `report.html`; `folder` holds the report's pictures and, if it is there, its `camera.toml`.
///
/// # Errors
/// A picture that the report names and that cannot be read.
pub fn render_html(report: &Report, folder: &Path) -> Result<String> {
    let camera = read_if_there(&folder.join("camera.toml"))?;
    let page = page::Page::new(report, folder, camera)?;
    Ok(format::render(
        "report.html",
        include_str!("template.html"),
        minijinja::Value::from(minijinja::value::Serde(&page)),
    ))
}

/// The text of a file, or nothing where there is no such file. Bytes that are not UTF-8 are replaced: they are shown
/// only.
fn read_if_there(path: &Path) -> Result<String> {
    let bytes = files::read_if_there(path, Limit::SETTINGS)?.unwrap_or_default();
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
