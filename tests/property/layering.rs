//! The layers, as data: which module may name which. Fails on any other `crate::` path, on Vulkan and `unsafe` where
//! they do not belong.

use std::fs;
use std::path::{Path, PathBuf};

/// What a module may name of its own crate. It may always name itself.
enum Uses {
    /// These modules.
    Only(&'static [&'static str]),
    /// Every module.
    All,
}

/// One line of the table: the module, what it may name, whether it may name `ash` and hold `unsafe`.
struct Layer {
    module: &'static str,
    uses: Uses,
    ash: bool,
    unsafe_code: bool,
}

const fn pure(module: &'static str, uses: &'static [&'static str]) -> Layer {
    Layer { module, uses: Uses::Only(uses), ash: false, unsafe_code: false }
}

/// One crate of the workspace: the name by which others call it, where its sources are, and its modules.
struct Crate {
    name: &'static str,
    sources: &'static str,
    layers: &'static [Layer],
}

/// The table of ARCHITECTURE.md. A new module needs a line here and one there. That a crate names none above it the
/// compiler sees to.
const CRATES: &[Crate] = &[
    Crate {
        name: "shutterbug",
        sources: "src",
        layers: &[
            pure("error", &[]),
            pure("files", &["error"]),
            pure("kernels", &["error"]),
            pure("plane", &["files", "error"]),
            pure("camera", &["error"]),
            pure("scene", &["camera", "plane", "files", "error"]),
            pure("chain", &["kernels", "camera", "plane", "error"]),
            pure("effects", &["chain", "camera", "plane", "error"]),
            pure("capture", &["scene", "camera", "chain", "effects", "plane", "files", "error"]),
            pure("reference", &["effects", "chain", "scene", "camera", "plane", "error"]),
            Layer { module: "gpu", uses: Uses::Only(&["kernels", "error"]), ash: true, unsafe_code: true },
            pure("raster", &["gpu", "kernels", "scene", "camera", "plane", "error"]),
            Layer { module: "engine", uses: Uses::All, ash: false, unsafe_code: false },
            Layer { module: "capi", uses: Uses::All, ash: false, unsafe_code: true },
            Layer { module: "lib", uses: Uses::All, ash: false, unsafe_code: false },
        ],
    },
    Crate {
        name: "shutterbug_diagnose",
        sources: "crates/diagnose/src",
        layers: &[
            pure("out", &["files", "error"]),
            pure("child", &["error"]),
            pure("listing", &["error"]),
            pure("calibrate", &["reference", "effects", "chain", "camera", "plane", "files", "error"]),
            pure("board", &["listing", "capture", "camera", "chain", "plane", "files", "error"]),
            Layer { module: "diagnose", uses: Uses::All, ash: false, unsafe_code: false },
            pure("report", &["diagnose", "plane", "files", "error"]),
            Layer { module: "withhold", uses: Uses::All, ash: false, unsafe_code: false },
            Layer { module: "lib", uses: Uses::All, ash: false, unsafe_code: false },
        ],
    },
    Crate {
        name: "shutterbug_cli",
        sources: "crates/cli/src",
        layers: &[
            pure("formats", &["capture", "camera", "chain", "effects", "scene", "plane", "files", "error"]),
            pure("import", &["formats", "capture", "camera", "plane", "files", "out", "error"]),
            Layer { module: "cli", uses: Uses::All, ash: false, unsafe_code: false },
            Layer { module: "main", uses: Uses::All, ash: false, unsafe_code: false },
            Layer { module: "lib", uses: Uses::All, ash: false, unsafe_code: false },
        ],
    },
];

/// All lines, those of lower crates first.
fn layers() -> impl Iterator<Item = &'static Layer> {
    CRATES.iter().flat_map(|c| c.layers)
}

/// Re-exports at the crate's root and the module that they stand for.
const ROOT_NAMES: &[(&str, &str)] = &[("Error", "error"), ("Result", "error")];

/// The one thing that may call what is above it: nothing may name these but `cli`, `main` and `lib`.
const TOP: &[&str] = &["cli", "main", "capi"];

/// The text with comments, strings and character literals turned into spaces; lines stay where they are.
pub(crate) fn code_only(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = bytes.to_vec();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text.as_bytes()[at..];
        let length = if rest.starts_with(b"//") {
            rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len())
        } else if rest.starts_with(b"/*") {
            block_comment(rest)
        } else if rest[0] == b'"' {
            string(rest)
        } else if let Some(length) = raw_string(bytes, at) {
            length
        } else if rest[0] == b'\'' {
            character(rest)
        } else {
            at += 1;
            continue;
        };
        out[at..at + length].iter_mut().filter(|b| **b != b'\n').for_each(|b| *b = b' ');
        at += length.max(1);
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn block_comment(rest: &[u8]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match &rest[at..] {
            [b'/', b'*', ..] => (depth, at) = (depth + 1, at + 2),
            [b'*', b'/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at.min(rest.len())
}

fn string(rest: &[u8]) -> usize {
    let mut at = 1;
    while at < rest.len() && rest[at] != b'"' {
        at += if rest[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(rest.len())
}

/// Length of a raw string that starts here, if one does.
fn raw_string(bytes: &[u8], at: usize) -> Option<usize> {
    if bytes[at] != b'r' || (at > 0 && is_word(bytes[at - 1]) && bytes[at - 1] != b'b') {
        return None;
    }
    let hashes = bytes[at + 1..].iter().take_while(|&&b| b == b'#').count();
    if bytes.get(at + 1 + hashes) != Some(&b'"') {
        return None;
    }
    let end = [b"\"".as_slice(), &vec![b'#'; hashes]].concat();
    let body = &bytes[at + 2 + hashes..];
    let close = body.windows(end.len()).position(|w| w == end).unwrap_or(body.len() - end.len());
    Some(2 + hashes + close + end.len())
}

/// Length of a character literal; 1 for the quote of a lifetime.
fn character(rest: &[u8]) -> usize {
    match rest {
        [_, b'\\', _, ..] => rest[3..].iter().position(|&b| b == b'\'').map_or(1, |p| p + 4),
        [_, first, tail @ ..] => {
            let more = tail.iter().take(3).take_while(|b| **b & 0xc0 == 0x80).count();
            if *first != b'\'' && tail.get(more) == Some(&b'\'') { more + 3 } else { 1 }
        }
        _ => 1,
    }
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

/// Places where `word` stands by itself.
pub(crate) fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let free = |b: Option<&u8>| b.is_none_or(|b| !is_word(*b));
    let bytes = code.as_bytes();
    code.match_indices(word)
        .map(|(at, _)| at)
        .filter(move |&at| free(at.checked_sub(1).map(|i| &bytes[i])) && free(bytes.get(at + word.len())))
}

pub(crate) fn line_of(code: &str, at: usize) -> usize {
    code[..at].matches('\n').count() + 1
}

fn leading_name(text: &str) -> &str {
    let text = text.trim_start();
    &text[..text.bytes().take_while(|b| is_word(*b)).count()]
}

/// First names after the path prefix that ends at the start of `text`: one, or those of a brace group.
fn named(text: &str) -> Vec<&str> {
    let Some(group) = text.trim_start().strip_prefix('{') else { return vec![leading_name(text)] };
    let (mut depth, mut start, mut names) = (0, 0, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                names.push(leading_name(&group[start..i]));
                start = i + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    names.retain(|n| !n.is_empty());
    names
}

/// Modules of the workspace's crates named in `code`, with the place. `depth` is how many `super` lead from the file to
/// the crate's root; inline modules inside the file add to it.
fn edges(code: &str, depth: usize) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    for root in CRATES.iter().map(|c| c.name).chain(["crate"]) {
        for at in words(code, root) {
            if let Some(path) = code[at + root.len()..].trim_start().strip_prefix("::") {
                found.extend(named(path).into_iter().map(|name| (at, name)));
            }
        }
    }
    for at in words(code, "super") {
        if code[..at].ends_with("super::") {
            continue;
        }
        let (mut rest, mut supers) = (&code[at..], 0);
        while let Some(next) = rest.strip_prefix("super::") {
            (rest, supers) = (next, supers + 1);
        }
        // `super` alone at the root's level reaches the siblings of the file's own module.
        if supers == depth + inline_modules(code, at) {
            found.extend(named(rest).into_iter().map(|name| (at, name)));
        }
    }
    found
}

/// Number of `mod name {` around a place.
fn inline_modules(code: &str, at: usize) -> usize {
    let mut open = Vec::new();
    let mut since = 0;
    for (i, c) in code[..at].char_indices() {
        match c {
            '{' => open.push(words(&code[since..i], "mod").next().is_some()),
            '}' => drop(open.pop()),
            ';' => {}
            _ => continue,
        }
        since = i + 1;
    }
    open.into_iter().filter(|m| *m).count()
}

/// The first folder or the file's stem, and how many `super` lead from the file to the crate's root.
fn module_of(relative: &Path) -> (String, usize) {
    let parts: Vec<_> =
        relative.with_extension("").iter().map(|p| p.to_string_lossy().into_owned()).collect();
    let is_root = parts.len() == 1 && ["lib", "main"].contains(&parts[0].as_str());
    let folder_module = parts.last().is_some_and(|p| p == "mod");
    (parts[0].clone(), if is_root { 0 } else { parts.len() - usize::from(folder_module) })
}

/// What is wrong with one source file of a crate; `relative` is its path below the crate's sources.
fn violations(home: &Crate, relative: &Path, text: &str) -> Vec<String> {
    let (module, depth) = module_of(relative);
    let place = |line: usize| format!("{}/{}:{line}", home.sources, relative.display());
    let Some(layer) = home.layers.iter().find(|l| l.module == module) else {
        return vec![format!("{}: module `{module}` stands in no layer of {}", place(1), home.name)];
    };
    let code = code_only(text);
    let mut found = Vec::new();
    for (at, name) in edges(&code, depth) {
        let target = ROOT_NAMES.iter().find(|(n, _)| *n == name).map_or(name, |(_, m)| m);
        let known = layers().any(|l| l.module == target);
        let allowed = match layer.uses {
            Uses::Only(list) => list.contains(&target),
            Uses::All => !TOP.contains(&target) || TOP.contains(&module.as_str()) || module == "lib",
        };
        // Names that are no module at the root (a macro, a re-export) are the compiler's business, except for `*`.
        if target != module && (known || name.is_empty()) && !allowed {
            found.push(format!("{}: `{module}` may not name `{target}`", place(line_of(&code, at))));
        }
    }
    for (word, allowed) in [("ash", layer.ash), ("unsafe", layer.unsafe_code)] {
        if !allowed {
            let places =
                words(&code, word).map(|at| format!("{}: `{word}` in `{module}`", place(line_of(&code, at))));
            found.extend(places);
        }
    }
    found
}

/// Sources below a folder.
pub(crate) fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    files_ending(&["rs", "comp", "vert", "frag", "glsl", "h", "c", "cpp"], folder, found);
}

/// Adds the files below a folder whose names end so.
pub(crate) fn files_ending(endings: &[&str], folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.expect("a folder that can be opened can be read").path();
        if path.is_dir() {
            files_ending(endings, &path, found);
        } else if endings.iter().any(|e| path.extension().is_some_and(|x| x == *e)) {
            found.push(path);
        }
    }
}

#[test]
fn every_file_keeps_to_its_layer() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    ["src", "crates"].iter().for_each(|f| files(&root.join(f), &mut paths));
    let mut wrong = Vec::new();
    let mut sources = 0;
    for path in &paths {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let name = path.strip_prefix(root).expect("found below the root");
        let at_home = |c: &'static Crate| Some((c, name.strip_prefix(c.sources).ok()?));
        if let Some((home, relative)) = CRATES.iter().find_map(at_home) {
            sources += 1;
            wrong.extend(violations(home, relative, &text));
        }
    }
    assert!(sources > 10, "only {sources} source files found: the walk is broken");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Names in the table exist only once, and the pure layers have no cycle: each names only lines above its own.
#[test]
fn the_table_has_no_cycle() {
    for (i, layer) in layers().enumerate() {
        let Uses::Only(list) = layer.uses else { continue };
        for name in list {
            assert!(
                layers().take(i).any(|l| l.module == *name),
                "{} names {name}, not above it",
                layer.module
            );
        }
    }
}

/// Controls: each planted line is found, each lookalike is not.
#[test]
fn planted_lines_are_found() {
    let found = |path: &str, text: &str| {
        let (sources, path) = path.split_once(':').unwrap_or(("src", path));
        let home = CRATES.iter().find(|c| c.sources == sources).expect("a crate of the table");
        violations(home, Path::new(path), text)
    };
    for (path, text) in [
        ("plane/mod.rs", "use crate::camera::Pose;"),
        ("camera/pose.rs", "use crate::{error::{Error, Result}, scene::Scene};"),
        ("scene/load.rs", "fn f() { let _ = crate::engine::run(); }"),
        ("scene/load.rs", "use super::super::engine::run;"),
        ("scene/mod.rs", "use super::gpu::Buffer;"),
        ("scene/mod.rs", "mod tests { use super::super::gpu; }"),
        ("chain/mod.rs", "/* // */ use crate::effects::LIST;"),
        ("effects/motion_blur.rs", "use ash::vk;"),
        ("engine/mod.rs", "use crate::cli::Args;"),
        ("raster/mod.rs", "fn f() { unsafe { g() } }"),
        ("camera/mod.rs", "const C: char = '\"'; unsafe fn f() {}"),
        ("camera/mod.rs", "use crate::*;"),
        ("surprise/mod.rs", ""),
        ("formats/mod.rs", ""),
        ("crates/diagnose/src:board/mod.rs", "use shutterbug::engine::Engine;"),
        ("crates/diagnose/src:board/mod.rs", "use crate::calibrate::Camera;"),
        ("crates/cli/src:formats/mod.rs", "use shutterbug_diagnose::{board::Board};"),
        ("crates/cli/src:cli/mod.rs", "fn f() { unsafe { g() } }"),
    ] {
        assert_eq!(found(path, text).len(), 1, "{path}: {text}");
    }
    for (path, text) in [
        ("plane/mod.rs", "use crate::error::Error; use crate::{Result};"),
        ("plane/mod.rs", "//! see crate::engine\nconst S: &str = \"crate::engine unsafe\";"),
        ("plane/mod.rs", "const S: &str = r#\"unsafe \" ash\"#; /* unsafe /* ash */ unsafe */"),
        ("scene/load.rs", "use super::Scene; mod tests { use super::super::Mesh; }"),
        ("scene/mod.rs", "mod tests { use super::*; }"),
        ("gpu/context.rs", "use ash::vk; fn f() { unsafe { g() } }"),
        ("camera/mod.rs", "#![forbid(unsafe_code)] fn hash<'a>(wash: &'a str) {}"),
        ("engine/mod.rs", "use crate::{raster, gpu, effects};"),
        ("crates/diagnose/src:board/mod.rs", "use shutterbug::{camera::Pose, Result};"),
        ("crates/cli/src:cli/mod.rs", "use shutterbug_diagnose::{board, diagnose};"),
    ] {
        assert_eq!(found(path, text), [""; 0], "{path}: {text}");
    }
}

/// Direct dependencies, by a crate's manifest.
fn dependencies(manifest: &str) -> Vec<&str> {
    let section = manifest.split("\n[").find_map(|s| s.strip_prefix("dependencies]\n")).expect("a section");
    let named = section.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_alphabetic()));
    named.filter_map(|l| l.split(['.', ' ', '=']).next()).collect()
}

/// Whoever embeds the library builds what it asks for. More than this is a decision.
#[test]
fn the_library_asks_for_few_crates() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = |path: &str| fs::read_to_string(root.join(path)).expect("a manifest");
    let library = manifest("Cargo.toml");
    let asked = dependencies(&library);
    assert!(asked.contains(&"ash") && asked.len() <= 12, "{}: {asked:?}", asked.len());
    // Control: the command line's are counted, and would be too many.
    let program = manifest("crates/cli/Cargo.toml");
    assert!(dependencies(&program).contains(&"clap") && dependencies(&program).len() > 12);
}
