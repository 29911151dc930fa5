//! The bill of materials: whole, without tests' dependencies, and the same each time.
#![allow(clippy::unwrap_used)]

use std::process::Command;

fn bill(of: &str) -> Option<serde_json::Value> {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("SKIPPED sbom: no python3");
        return None;
    }
    let made = Command::new("tools/sbom").args(["--crate", of]).current_dir("..").output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    Some(serde_json::from_slice(&made.stdout).unwrap())
}

#[test]
fn the_bill_names_what_is_built_in_with_licence_and_hash() {
    let (Some(library), Some(program)) = (bill("shutterbug"), bill("shutterbug-cli")) else { return };
    let of = |bill: &serde_json::Value, name: &str| {
        bill["components"].as_array().unwrap().iter().find(|c| c["name"] == name).cloned()
    };
    for (name, in_library) in [("ash", true), ("png", true), ("clap", false), ("nalgebra", false)] {
        assert_eq!(of(&library, name).is_some(), in_library, "{name}");
        let found = of(&program, name).unwrap();
        assert_eq!(found["hashes"][0]["content"].as_str().unwrap().len(), 64, "{name}");
        assert!(found["licenses"][0]["expression"].as_str().is_some_and(|l| !l.contains('/')), "{name}");
    }
    for tests_alone in ["proptest", "html5ever"] {
        assert!(of(&program, tests_alone).is_none(), "{tests_alone}");
    }
    let refs: Vec<_> = program["components"].as_array().unwrap().iter().map(|c| &c["bom-ref"]).collect();
    for edge in program["dependencies"].as_array().unwrap() {
        let known =
            |r: &serde_json::Value| refs.contains(&r) || *r == program["metadata"]["component"]["bom-ref"];
        assert!(known(&edge["ref"]) && edge["dependsOn"].as_array().unwrap().iter().all(known), "{edge}");
    }
    assert_eq!(bill("shutterbug-cli").unwrap(), program);
}

/// Whether a licence expression (SPDX) can be met with what is allowed.
fn is_allowed(expression: &str, allowed: &dyn Fn(&str) -> bool) -> bool {
    let text = expression.replace('(', " ( ").replace(')', " ) ");
    let mut words: Vec<&str> = text.split_whitespace().rev().collect();
    let met = either(&mut words, allowed);
    met && words.is_empty()
}

fn either(words: &mut Vec<&str>, allowed: &dyn Fn(&str) -> bool) -> bool {
    let mut met = both(words, allowed);
    while words.last() == Some(&"OR") {
        words.pop();
        met |= both(words, allowed);
    }
    met
}

fn both(words: &mut Vec<&str>, allowed: &dyn Fn(&str) -> bool) -> bool {
    let mut met = one(words, allowed);
    while words.last() == Some(&"AND") {
        words.pop();
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut Vec<&str>, allowed: &dyn Fn(&str) -> bool) -> bool {
    match words.pop() {
        Some("(") => either(words, allowed) & (words.pop() == Some(")")),
        Some(name) if words.last() == Some(&"WITH") => {
            words.pop();
            allowed(&format!("{name} WITH {}", words.pop().unwrap_or_default()))
        }
        Some(name) => allowed(name),
        None => false,
    }
}

/// What `cargo deny check licenses sources` asks of the same files, for machines without it.
#[test]
fn every_licence_is_one_that_deny_toml_allows() {
    let deny = std::fs::read_to_string("../deny.toml").unwrap();
    let list = deny.split_once("allow = [").unwrap().1.split_once(']').unwrap().0;
    let allow: Vec<&str> = list.split('"').skip(1).step_by(2).collect();
    let allowed = |name: &str| allow.contains(&name);
    for (expression, met) in [
        ("MIT OR Apache-2.0", true),
        ("Apache-2.0 WITH LLVM-exception OR GPL-3.0-only", true),
        ("(MIT OR GPL-3.0-only) AND Unicode-3.0", true),
        ("GPL-3.0-only", false),
        ("MIT AND GPL-3.0-only", false),
        ("(MIT", false),
        ("MIT Apache-2.0", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), met, "control: {expression}");
    }
    let mut looked_at = 0;
    for of in ["shutterbug", "shutterbug-diagnose", "shutterbug-cli"] {
        let Some(bill) = bill(of) else { return };
        for component in bill["components"].as_array().unwrap() {
            let (name, licence) = (&component["name"], &component["licenses"][0]["expression"]);
            let expression = licence.as_str().unwrap_or_else(|| panic!("{name} names no licence"));
            assert!(is_allowed(expression, &allowed), "{name}: {expression} is not in deny.toml");
            looked_at += 1;
        }
    }
    assert!(looked_at > 300, "{looked_at}");
    // From nowhere but the registry.
    let lock = std::fs::read_to_string("../Cargo.lock").unwrap();
    let registry = "source = \"registry+https://github.com/rust-lang/crates.io-index\"";
    let mut sources = lock.lines().filter(|l| l.starts_with("source = "));
    assert!(sources.all(|l| l == registry));
}
