//! The oldest Rust that each crate says it builds with, held against what it is made of and what is told to users.
//! `tools/msrv` builds with that Rust; here is what needs no second toolchain.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

/// `1.91` or `1.88.0` as numbers that compare.
fn version(text: &str) -> (u32, u32) {
    let mut parts = text.split('.').map(|p| p.parse().unwrap());
    (parts.next().unwrap(), parts.next().unwrap())
}

fn metadata() -> serde_json::Value {
    let arguments = ["metadata", "--locked", "--format-version", "1"];
    let out = Command::new(env!("CARGO")).args(arguments).current_dir("..").output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// Packages that a package is built from, itself included: no dependencies of tests.
fn built_from<'a>(metadata: &'a serde_json::Value, name: &str) -> Vec<&'a serde_json::Value> {
    let packages = metadata["packages"].as_array().unwrap();
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap();
    let start = packages.iter().find(|p| p["name"] == name).unwrap();
    let (mut found, mut next) = (vec![], vec![&start["id"]]);
    while let Some(id) = next.pop() {
        if found.contains(&id) {
            continue;
        }
        found.push(id);
        let node = nodes.iter().find(|n| n["id"] == *id).unwrap();
        let is_built = |d: &&serde_json::Value| {
            d["dep_kinds"].as_array().unwrap().iter().any(|k| k["kind"].as_str() != Some("dev"))
        };
        next.extend(node["deps"].as_array().unwrap().iter().filter(is_built).map(|d| &d["pkg"]));
    }
    packages.iter().filter(|p| found.contains(&&p["id"])).collect()
}

/// Dependencies that ask for a newer Rust than a package itself.
fn newer(metadata: &serde_json::Value, name: &str, own: (u32, u32)) -> Vec<String> {
    let rust = |p: &serde_json::Value| p["rust_version"].as_str().map(version);
    let all = built_from(metadata, name).into_iter();
    all.filter(|p| rust(p).is_some_and(|v| v > own)).map(|p| p["name"].to_string()).collect()
}

#[test]
fn no_dependency_asks_for_a_newer_rust_than_its_crate() {
    let metadata = metadata();
    let mut newest = (0, 0);
    for name in
        ["shutterbug", "shutterbug-diagnose", "shutterbug-cli", "shutterbug-tools", "shutterbug-python"]
    {
        let of = |p: &&serde_json::Value| p["name"] == name;
        let package = metadata["packages"].as_array().unwrap().iter().find(of).unwrap();
        let own = version(package["rust_version"].as_str().unwrap_or_else(|| panic!("{name} names no Rust")));
        assert_eq!(newer(&metadata, name, own), [""; 0], "{name} says {own:?}");
        newest = own.max(newest);
    }
    // Control: an older Rust than that of its dependencies is found.
    assert!(!newer(&metadata, "shutterbug", (1, 40)).is_empty());
    // What users read, and what the set-up asks for, is the newest of all.
    let text = |path: &str| std::fs::read_to_string(Path::new("..").join(path)).unwrap();
    let (_, minor) = newest;
    assert!(text("README.md").contains(&format!("Rust toolchain (1.{minor} or newer)")));
    assert!(text("tools/setup").contains(&format!("shutterbug_rust_minor={minor}\n")));
}

/// Clippy knows since when each function of the standard library is there, and reads `rust-version` itself:
/// `tools/test` runs it on all crates with `-D warnings`. Here a function that is too new is planted, to see that it
/// would be found.
#[test]
fn clippy_finds_what_is_newer_than_the_rust_version() {
    if !Command::new(env!("CARGO")).args(["clippy", "--version"]).output().is_ok_and(|o| o.status.success()) {
        eprintln!("SKIPPED msrv: no clippy (rustup component add clippy)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("src")).unwrap();
    // `Duration::from_mins` came with 1.91.
    let source = "//! Planted.\n/// A minute.\npub fn minute() -> std::time::Duration {\n    \
                  std::time::Duration::from_mins(1)\n}\n";
    std::fs::write(folder.path().join("src/lib.rs"), source).unwrap();
    let found = |rust: &str| {
        let manifest = format!(
            "[package]\nname = \"planted\"\nedition = \"2024\"\nrust-version = \"{rust}\"\n[workspace]\n"
        );
        std::fs::write(folder.path().join("Cargo.toml"), manifest).unwrap();
        let mut clippy = Command::new(env!("CARGO"));
        clippy.args(["clippy", "--offline", "--", "-D", "warnings"]).current_dir(folder.path());
        let out = clippy.env("CARGO_TARGET_DIR", folder.path().join("target")).output().unwrap();
        (out.status.success(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let (passed, said) = found("1.88");
    assert!(!passed && said.contains("incompatible_msrv"), "{said}");
    let (passed, said) = found("1.91");
    assert!(passed, "control: {said}");
}
