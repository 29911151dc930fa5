//! The header and the Rust that implements it: sizes, offsets and values as the C compiler sees them, C11 and C++17 on
//! their own, every function declared and exported, one version everywhere.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use shutterbug::capi::{HEADER, LAYOUT, STATUSES};

fn compiler(name: &str) -> bool {
    let there = Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    if !there {
        eprintln!("SKIPPED capi_layout: {name} is absent");
    }
    there
}

/// Output of a C program that includes the header.
fn run_c(folder: &Path, body: &str) -> String {
    let (source, program) = (folder.join("layout.c"), folder.join("layout"));
    let text =
        format!("#include <stdio.h>\n#include <shutterbug.h>\nint main(void) {{\n{body}return 0; }}\n");
    std::fs::write(&source, text).unwrap();
    let flags = ["-std=c11", "-Wall", "-Werror", "-Iinclude", "-o"];
    let built = Command::new("cc").args(flags).arg(&program).arg(&source).output().unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    String::from_utf8(Command::new(&program).output().unwrap().stdout).unwrap()
}

#[test]
fn sizes_offsets_and_values_are_those_of_the_header() {
    if !compiler("cc") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (mut body, mut want) = (String::new(), String::new());
    for (name, size, fields) in LAYOUT {
        writeln!(body, "printf(\"{name} %zu\\n\", sizeof({name}));").unwrap();
        writeln!(want, "{name} {size}").unwrap();
        for (field, offset, bytes) in *fields {
            let of = format!("offsetof({name}, {field}), sizeof((({name} *)0)->{field})");
            writeln!(body, "printf(\"{name}.{field} %zu %zu\\n\", {of});").unwrap();
            writeln!(want, "{name}.{field} {offset} {bytes}").unwrap();
        }
    }
    for (number, name, _) in STATUSES {
        writeln!(body, "printf(\"SHUTTERBUG_{name} %d\\n\", (int)SHUTTERBUG_{name});").unwrap();
        writeln!(want, "SHUTTERBUG_{name} {number}").unwrap();
    }
    assert_eq!(run_c(folder.path(), &body), want);
    // Control: a field of another size is found.
    assert_ne!(
        run_c(folder.path(), &body.replace("sizeof(shutterbug_pose)", "sizeof(shutterbug_frame_info)")),
        want
    );
    // As many fields as the header's struct has, or a forgotten one could hide at the end of padding.
    for (name, _, fields) in LAYOUT {
        let end = HEADER.find(&format!("}} {name};")).unwrap_or_else(|| panic!("no {name} in the header"));
        let start = HEADER[..end].rfind('{').unwrap();
        let declared: usize = without_comments(&HEADER[start..end])
            .split(';')
            .map(|d| if d.trim_matches(['{', ' ', '\n']).is_empty() { 0 } else { 1 + d.matches(',').count() })
            .sum();
        assert_eq!(declared, fields.len(), "{name}");
    }
}

fn without_comments(text: &str) -> String {
    let mut rest = text;
    let mut out = String::new();
    while let Some(at) = rest.find("/*") {
        out.push_str(&rest[..at]);
        rest = rest[at..].find("*/").map_or("", |end| &rest[at + end + 2..]);
    }
    out + rest
}

#[test]
fn the_header_stands_on_its_own_in_c11_and_cpp17() {
    let folder = tempfile::tempdir().unwrap();
    for (cc, std, name) in [("cc", "-std=c11", "alone.c"), ("c++", "-std=c++17", "alone.cpp")] {
        if !compiler(cc) {
            continue;
        }
        let source = folder.path().join(name);
        let check = |text: &str| {
            std::fs::write(&source, text).unwrap();
            let flags = [std, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-Iinclude"];
            Command::new(cc).args(flags).arg(&source).output().unwrap()
        };
        let alone = check("#include <shutterbug.h>\n#include <shutterbug.h>\n");
        assert!(alone.status.success(), "{cc}: {}", String::from_utf8_lossy(&alone.stderr));
        assert!(!check("#include <shutterbug.h>\nshutterbug_nothing x;\n").status.success(), "control");
    }
}

#[test]
fn every_function_is_declared_and_defined_and_the_versions_agree() {
    let header = without_comments(HEADER);
    let declared: BTreeSet<String> = header
        .split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '('))
        .filter_map(|word| word.strip_suffix('(').or_else(|| word.split_once('(').map(|w| w.0)))
        .filter(|name| name.starts_with("shutterbug_"))
        .map(str::to_owned)
        .collect();
    let mut defined = BTreeSet::new();
    for file in std::fs::read_dir("src/capi").unwrap() {
        let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
        let names = text.split("extern \"C\" fn ").skip(1).filter_map(|rest| rest.split('(').next());
        defined.extend(names.filter(|n| n.starts_with("shutterbug_")).map(str::to_owned));
    }
    assert!(defined.len() > 20, "{defined:?}");
    assert_eq!(declared, defined);
    let version = env!("CARGO_PKG_VERSION");
    let number = |part: &str| {
        let at = HEADER.find(&format!("SHUTTERBUG_VERSION_{part} ")).unwrap();
        HEADER[at..].split_whitespace().nth(1).unwrap().to_owned()
    };
    assert_eq!(["MAJOR", "MINOR", "PATCH"].map(number).join("."), version);
    let numbers: Vec<u32> = version.split('.').map(|n| n.parse().unwrap()).collect();
    let packed = numbers[0] * 1_000_000 + numbers[1] * 1_000 + numbers[2];
    assert_eq!(shutterbug::capi::shutterbug_version(), packed);
    let cmake = std::fs::read_to_string("cmake/shutterbug-config-version.cmake").unwrap();
    assert!(cmake.contains(&format!("set(PACKAGE_VERSION \"{version}\")")));
    let minor = version.rsplit_once('.').unwrap().0;
    assert!(cmake.contains(&format!("set(_shutterbug_minor \"{minor}\")")));
}

#[test]
fn every_function_says_what_it_may_answer() {
    let comments = crate::header::comments();
    assert!(comments.len() > 25, "control: {}", comments.len());
    for (name, comment) in &comments {
        assert!(
            comment.contains("Errors:"),
            "shutterbug_{name} has no \"Errors:\" in the comment before it: {comment}"
        );
    }
    // `tests/abi/fuzz.rs` compares with what random calls were answered.
    let documented = crate::header::documented();
    assert!(documented["engine_submit"].contains("FULL") && !documented["frame_destroy"].contains("FULL"));
    assert!(documented["semaphore_export_fd"].contains("UNSUPPORTED"), "of the section");
    // The rest return no status: they cannot fail.
    let rest: Vec<_> = without_comments(HEADER)
        .lines()
        .filter(|l| !l.starts_with([' ', '#', '}']) && l.contains('(') && !l.starts_with("shutterbug_status"))
        .filter_map(|l| l.split('(').next()?.rsplit([' ', '*']).next().map(str::to_owned))
        .filter(|name| name.starts_with("shutterbug_"))
        .collect();
    let want =
        ["shutterbug_version", "shutterbug_version_text", "shutterbug_status_text", "shutterbug_last_error"];
    assert_eq!(rest, want);
}

/// What of the header needs no preprocessor.
fn plain() -> &'static str {
    let from = HEADER.find("\"END OF PLAIN C\"").unwrap();
    let from = from + HEADER[from..].find('\n').unwrap();
    &HEADER[from..HEADER.find("/* END OF PLAIN C */").unwrap()]
}

#[test]
fn pythons_cffi_parses_the_plain_part_as_it_is() {
    let text = without_comments(plain());
    assert!(text.contains("shutterbug_engine_create(") && text.contains("shutterbug_semaphore_destroy("));
    assert!(!text.lines().any(|l| l.trim_start().starts_with('#')), "a line for the preprocessor");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plain.h");
    let parse = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let program = "import sys, cffi\nf = cffi.FFI()\nf.cdef(open(sys.argv[1]).read())\n\
                       print(f.sizeof('shutterbug_outside'))";
        Command::new("python3").args(["-c", program]).arg(&file).output()
    };
    let there = Command::new("python3").args(["-c", "import cffi"]).output();
    if !there.is_ok_and(|o| o.status.success()) {
        eprintln!("SKIPPED pythons_cffi_parses_the_plain_part_as_it_is: python3 with cffi is absent");
        return;
    }
    let parsed = parse(plain()).unwrap();
    assert!(parsed.status.success(), "{}", String::from_utf8_lossy(&parsed.stderr));
    let size = LAYOUT.iter().find(|(name, ..)| *name == "shutterbug_outside").unwrap().1;
    assert_eq!(String::from_utf8_lossy(&parsed.stdout).trim(), size.to_string());
    assert!(!parse(HEADER).unwrap().status.success(), "control: all of the header parses");
}
