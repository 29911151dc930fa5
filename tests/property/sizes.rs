//! How long a file, a function and a line may be. What is longer is hard to read, and is cut into parts with names.

use std::fs;
use std::path::Path;

use super::layering::{code_only, files, files_ending, line_of, words};

const FILE_LINES: usize = 600;
/// In src and crates: from the line of `fn` to that of the last brace.
const FUNCTION_LINES: usize = 60;
const COLUMNS: usize = 120;

/// Files of the diagnosis that are being rewritten and still have longer lines.
/// An entry that is no longer needed fails the test.
const WIDE_FOLDERS: &[&str] = &[];

/// Name, first line and number of lines of each function with a body. `code` is without comments and strings.
fn functions(code: &str) -> Vec<(&str, usize, usize)> {
    let mut found = Vec::new();
    for at in words(code, "fn") {
        let rest = code[at + 2..].trim_start();
        let name = &rest[..rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count()];
        let Some(body) = (!name.is_empty()).then(|| body(&code[at..])).flatten() else { continue };
        found.push((name, line_of(code, at), code[at..at + body].matches('\n').count() + 1));
    }
    found
}

/// Where the body of the function that begins here ends; nothing for one without a body.
fn body(code: &str) -> Option<usize> {
    let (mut round, mut curly) = (0, 0);
    for (at, c) in code.char_indices() {
        match c {
            '(' | '[' => round += 1,
            ')' | ']' => round -= 1,
            ';' if round == 0 && curly == 0 => return None,
            '{' => curly += 1,
            '}' => {
                curly -= 1;
                if curly == 0 {
                    return Some(at);
                }
            }
            _ => {}
        }
    }
    None
}

fn long_functions(name: &str, text: &str) -> Vec<String> {
    let code = code_only(text);
    let long = functions(&code).into_iter().filter(|(_, _, lines)| *lines > FUNCTION_LINES);
    long.map(|(function, line, lines)| {
        format!("{name}:{line}: `{function}` has {lines} lines, at most {FUNCTION_LINES}")
    })
    .collect()
}

fn wide_lines(name: &str, text: &str) -> Vec<String> {
    let columns = text.lines().map(|l| l.chars().count()).enumerate().filter(|(_, c)| *c > COLUMNS);
    columns.map(|(i, c)| format!("{name}:{}: {c} columns, at most {COLUMNS}", i + 1)).collect()
}

fn too_long(name: &str, text: &str) -> Option<String> {
    let lines = text.lines().count();
    (lines > FILE_LINES).then(|| format!("{name}: {lines} lines, at most {FILE_LINES}"))
}

#[test]
fn files_functions_and_lines_are_short() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = vec![root.join("build.rs")];
    ["src", "crates", "tests", "benches", "glsl", "include", "examples", "tools", "fuzz/parsers/src"]
        .iter()
        .for_each(|f| files(&root.join(f), &mut paths));
    let mut wrong = Vec::new();
    let (mut count, mut wide_folders) = (0, Vec::new());
    for path in &paths {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let name = path.strip_prefix(root).expect("found below the root").display().to_string();
        // The C header is a manual in one piece.
        wrong.extend(too_long(&name, &text).filter(|_| !name.ends_with(".h")));
        if name.ends_with(".rs") && (name.starts_with("src/") || name.contains("/src/")) {
            let all = functions(&code_only(&text)).len();
            count += all;
            wrong.extend(long_functions(&name, &text));
        }
        let wide = wide_lines(&name, &text);
        match WIDE_FOLDERS.iter().find(|f| name.starts_with(**f)) {
            Some(folder) if !wide.is_empty() => wide_folders.push(*folder),
            Some(_) => {}
            None => wrong.extend(wide),
        }
    }
    let stale = WIDE_FOLDERS.iter().filter(|f| !wide_folders.contains(f));
    wrong.extend(stale.map(|f| format!("{f}: no line is too wide any more, take it off WIDE_FOLDERS")));
    assert!(count > 1000, "only {count} functions found: they are not parsed");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Lines of text. Rows of tables and code cannot be wrapped: they become empty lines.
fn prose(page: &str) -> String {
    let mut code = false;
    let line = |line: &str| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        let kept = !(code || fence || line.trim_start().starts_with('|'));
        format!("{}\n", if kept { line } else { "" })
    };
    page.lines().map(line).collect()
}

#[test]
fn pages_are_no_wider_than_code() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<_> = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|f| root.join(f)).into();
    ["docs", "python"].iter().for_each(|f| files_ending(&["md"], &root.join(f), &mut paths));
    let mut wrong = Vec::new();
    let mut count = 0;
    for path in &paths {
        let name = path.strip_prefix(root).expect("found below the root").display().to_string();
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{name}: {e}"));
        count += 1;
        wrong.extend(wide_lines(&name, &prose(&text)));
    }
    assert!(count > 30, "only {count} pages found");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Controls: what is one line or one column too long is found, what just fits is not.
#[test]
fn what_is_too_long_is_found() {
    let with = |lines: usize| {
        format!(
            "fn a() {{ f(\"}}\"); }}\nimpl B {{\n    fn c(\n        d: [u8; 2],\n    ) {{\n{}    }}\n}}\n",
            "        // {\n".repeat(lines)
        )
    };
    assert_eq!(long_functions("x", &with(56)), [""; 0]);
    assert_eq!(long_functions("x", &with(57)), ["x:3: `c` has 61 lines, at most 60"]);
    let declared = format!("trait T {{\n    fn a();\n{}    fn b() {{}}\n}}\n", "\n".repeat(80));
    assert_eq!(long_functions("x", &declared), [""; 0]);
    assert_eq!(functions(&code_only(&declared)), [("b", 83, 1)]);
    let line = "é".repeat(COLUMNS);
    assert!(wide_lines("x", &line).is_empty());
    assert_eq!(wide_lines("x", &format!("\n{line}x")), ["x:2: 121 columns, at most 120"]);
    let page = format!("{line}x\n| {line} |\n```\n{line}x\n```\n{line}x\n");
    assert_eq!(wide_lines("x", &prose(&page)), [1, 6].map(|n| format!("x:{n}: 121 columns, at most 120")));
    assert!(too_long("x", &"\n".repeat(601)).is_some() && too_long("x", &"\n".repeat(600)).is_none());
}
