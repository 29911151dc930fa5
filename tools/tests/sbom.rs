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
