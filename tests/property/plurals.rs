//! Messages count in words by one function (`error::counted`), or one of a thing is "1 frames".

use std::fs;
use std::path::Path;

use super::layering::files;

/// What messages count.
const THINGS: [&str; 12] = [
    "frames", "pairs", "pictures", "poses", "points", "values", "messages", "entries", "views", "results",
    "warnings", "faces",
];

/// Lines of a source that put a number before a plural, or make a plural themselves. Fractions ("2 of 5 frames",
/// "2/5 frames") are of all, named things (`{FEWEST}`, `{name} values`) no count.
fn made_by_hand(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let is_message = |l: &&str| !l.trim_start().starts_with("//") && !l.contains("panic!(");
    code.lines()
        .filter(is_message)
        .filter(|l| counts(l) || l.contains("{ \"s\" }"))
        .map(str::to_owned)
        .collect()
}

fn counts(line: &str) -> bool {
    THINGS.iter().any(|thing| {
        let plural = format!("}} {thing}");
        line.match_indices(&plural).map(|(at, _)| &line[..at]).any(|before| {
            let Some(open) = before.rfind('{') else { return false };
            let name = &before[open + 1..];
            let of_all = before[..open].ends_with("of ") || before[..open].ends_with('/');
            !of_all && name != "name" && !name.contains(char::is_uppercase) && !name.contains(':')
        })
    })
}

#[test]
fn plurals_are_made_in_one_place() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    ["src", "crates"].iter().for_each(|f| files(&root.join(f), &mut paths));
    let mut wrong = Vec::new();
    for path in paths.iter().filter(|p| p.extension().is_some_and(|e| e == "rs")) {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        // Modules of tests have their own files in places.
        if !path.components().any(|c| c.as_os_str() == "tests") {
            wrong.extend(made_by_hand(&text).into_iter().map(|line| format!("{}: {line}", path.display())));
        }
    }
    assert!(paths.len() > 100, "only {} files", paths.len());
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Controls.
#[test]
fn a_plural_by_hand_is_found() {
    for line in [
        "say(\"{n} pairs of frames\")",
        "format!(\"cover {} frames\", n)",
        "if n == 1 { \"\" } else { \"s\" }",
    ] {
        assert_eq!(made_by_hand(line), [line]);
    }
    for line in
        ["// {n} frames", "\"{k} of {n} frames\"", "\"{FEWEST} frames\"", "\"{rate:.2} frames a second\""]
    {
        assert_eq!(made_by_hand(line), [""; 0]);
    }
}
