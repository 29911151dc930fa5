//! What a log holds, as a table.

use super::gather::Gathered;
use super::log::Log;
use shutterbug::error::{counted, one_line};

/// Topics with type, count, rate and span.
pub(super) fn listing(log: &Log, all: &Gathered) -> String {
    let spans = all.about.iter().filter_map(|a| a.span_ns);
    let whole = spans.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
    let [start, end] = whole.unwrap_or([0, 0]);
    let megabytes = log.bytes as f64 / 1e6;
    let seconds = |ns: i64| ns as f64 * 1e-9;
    let mut text = format!(
        "{}: {}, {megabytes:.1} MB, {:.3} s from {:.3} s on\n",
        one_line(&log.path.display().to_string()),
        log.kind(),
        seconds(end.saturating_sub(start)),
        seconds(start)
    );
    let mut rows = vec![["topic", "type", "count", "rate", "from", "to", ""].map(str::to_owned)];
    let mut order: Vec<usize> = (0..all.pass.topics.len()).collect();
    order.sort_by_key(|i| &all.pass.topics[*i].name);
    for place in order {
        let (topic, about) = (&all.pass.topics[place], &all.about[place]);
        let [from, to] = about.span_ns.unwrap_or([start, start]);
        let span = to.saturating_sub(from);
        let rate = if about.count > 1 && span > 0 {
            format!("{:.2} Hz", (about.count - 1) as f64 / seconds(span))
        } else {
            "-".to_owned()
        };
        let at = |ns: i64| format!("{:.3} s", seconds(ns.saturating_sub(start)));
        let (name, type_name) = (one_line(&topic.name), one_line(&topic.type_name));
        rows.push([name, type_name, about.count.to_string(), rate, at(from), at(to), remarks(all, place)]);
    }
    text += &table(&rows);
    text
}

/// Size and encoding of a topic of pictures.
fn picture(all: &Gathered, place: usize) -> String {
    let Some(first) = all.first.get(&place) else { return String::new() };
    let size = first.size.as_ref().map_or_else(|_| "?".to_owned(), |[w, h]| format!("{w}x{h}"));
    format!("{size} {}", one_line(&super::shortened(&first.encoding)))
}

/// What there is to say of a topic's messages.
fn remarks(all: &Gathered, place: usize) -> String {
    let faults = all.about[place].faults;
    let unread = if faults > 0 { format!("{faults} cannot be read") } else { String::new() };
    let both = [picture(all, place), unread];
    both.into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join(", ")
}

/// Most letters that a column is widened for: a name may have any length, and pushes only its own line.
const MOST_WIDE: usize = 60;

/// Columns side by side; numbers stand at the right of theirs.
fn table(rows: &[[String; 7]]) -> String {
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0).min(MOST_WIDE);
    let widths: Vec<usize> = (0..7).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let cells = row.iter().enumerate().map(|(c, cell)| match c {
            2..=5 => padding(cell, widths[c]) + cell,
            _ => cell.clone() + &padding(cell, widths[c]),
        });
        let line = cells.collect::<Vec<_>>().join("  ");
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// Blanks that are missing to a width. Not by a format's own width, which ends at 65535 with a panic.
fn padding(cell: &str, width: usize) -> String {
    " ".repeat(width.saturating_sub(cell.chars().count()))
}

/// What a data set holds.
pub(super) fn of_folder(prepared: &super::Prepared) -> String {
    let (first, last) = (prepared.times_ns.first(), prepared.times_ns.last());
    let [first, last] = [first, last].map(|t| t.copied().unwrap_or(0));
    let files: Vec<&str> = prepared.texts.iter().map(|(name, _)| *name).collect();
    let span_s = last.saturating_sub(first) as f64 * 1e-9;
    format!(
        "{} over {span_s:.3} s from {first} ns on, {}; also {}\n",
        counted(prepared.times_ns.len(), "frame", "frames"),
        counted(prepared.poses.len(), "pose", "poses"),
        if files.is_empty() { "nothing".to_owned() } else { files.join(", ") }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_any_length_is_a_cell() {
        let row =
            |name: String| [name, "b".into(), "1".into(), "-".into(), "0".into(), "0".into(), String::new()];
        let text = table(&[row("a".to_owned()), row("x".repeat(70_000))]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], format!("a{}  b  1  -  0  0", " ".repeat(MOST_WIDE - 1)));
        assert!(lines[1].starts_with("xxx") && lines[1].ends_with("x  b  1  -  0  0"));
    }
}
