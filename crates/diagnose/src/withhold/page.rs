//! `withhold.html`: the table, the confusion matrix and every case with a picture, one offline file.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde::Serialize;

use super::{CaseScore, WithholdResult};
use crate::report::{PictureBudget, data_uri, environment};
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};
use shutterbug::plane::write_atomic;

/// A frame of each case, kept for the page.
const PICTURE: &str = "frame.png";

#[derive(Serialize)]
struct Page<'a> {
    result: &'a WithholdResult,
    columns: Vec<String>,
    rows: Vec<Row>,
    cases: Vec<CaseView<'a>>,
}

#[derive(Serialize)]
struct Row {
    asked: String,
    cells: Vec<Cell>,
}

#[derive(Serialize)]
struct Cell {
    count: usize,
    right: bool,
}

#[derive(Serialize)]
struct CaseView<'a> {
    score: &'a CaseScore,
    picture: String,
}

/// Keeps the middle frame of a capture.
///
/// # Errors
/// Files that cannot be read or written.
pub(super) fn keep_picture(capture: &Path, folder: &Path) -> Result<()> {
    let real = capture.join("real");
    let entries = fs::read_dir(&real).map_err(|e| Error::io(&real, "list", e))?;
    let mut names: Vec<_> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    names.sort();
    if let Some(middle) = names.get(names.len() / 2) {
        write_atomic(&folder.join(PICTURE), &read(middle, Limit::PICTURE)?)?;
    }
    Ok(())
}

/// Writes the page.
///
/// # Errors
/// Pictures that cannot be read, a page that cannot be written.
pub(super) fn write(result: &WithholdResult, out: &Path) -> Result<()> {
    let names = result.summary.confusion.values().flat_map(|row| row.keys().cloned());
    let columns: Vec<String> = names.collect::<BTreeSet<_>>().into_iter().collect();
    let rows = result.summary.confusion.iter().map(|(asked, row)| {
        let cell =
            |said: &String| Cell { count: row.get(said).copied().unwrap_or(0), right: is_right(asked, said) };
        Row { asked: asked.clone(), cells: columns.iter().map(cell).collect() }
    });
    let total = 100_000 * result.cases.len() as u64;
    let case = |score| -> Result<CaseView<'_>> {
        let score: &CaseScore = score;
        let folder = out.join(format!("case-{:03}", score.case));
        let name = if folder.join(PICTURE).is_file() { PICTURE } else { "" };
        Ok(CaseView { score, picture: data_uri(&folder, name, PictureBudget::for_total(total))? })
    };
    let cases = result.cases.iter().map(case).collect::<Result<Vec<_>>>()?;
    let page = Page { result, rows: rows.collect(), columns, cases };
    let mut environment = environment();
    environment.add_template("withhold.html", include_str!("page.html")).expect("a constant template");
    let template = environment.get_template("withhold.html").expect("just added");
    let data = minijinja::Value::from(minijinja::value::Serde(&page));
    let html = template.render(data).expect("the template fits its data: see the tests");
    write_atomic(&out.join("withhold.html"), html.as_bytes())
}

fn is_right(asked: &str, said: &str) -> bool {
    match (asked, asked.ends_with("(left out)")) {
        (_, true) => said == "unknown_effect",
        ("none", _) => said == "no_gap",
        _ => asked == said,
    }
}
