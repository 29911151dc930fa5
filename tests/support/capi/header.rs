//! What the header says of each function.
#![allow(dead_code, clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};

use shutterbug::capi::{HEADER, STATUSES};

/// What any call can give, by the header's first comment.
const COMMON: [&str; 8] = ["OK", "ARGUMENT", "STRUCT_SIZE", "PANIC", "HANDLE", "BUSY", "POISONED", "FORKED"];
const DEVICE: [&str; 4] = ["DEVICE_LOST", "OUT_OF_MEMORY", "VULKAN", "TIMEOUT"];

/// The functions that return a status, without prefix, each with the comment right before it; empty where there is
/// none.
pub fn comments() -> BTreeMap<&'static str, &'static str> {
    let mut found = BTreeMap::new();
    for (at, _) in HEADER.match_indices("\nshutterbug_status shutterbug_") {
        let name = HEADER[at..].trim_start().strip_prefix("shutterbug_status shutterbug_").unwrap();
        let before = HEADER[..at].trim_end();
        let comment = match before.strip_suffix("*/") {
            Some(body) => &body[body.rfind("/*").unwrap()..],
            None => "",
        };
        found.insert(name.split('(').next().unwrap(), comment);
    }
    found
}

/// The statuses that each of these functions may give: the common ones, and those behind "Errors:".
pub fn documented() -> BTreeMap<&'static str, BTreeSet<&'static str>> {
    let of_section =
        HEADER.split_once("Errors of all that make them:").unwrap().1.split("*/").next().unwrap();
    let mut all = BTreeMap::new();
    for (name, comment) in comments() {
        let errors = comment.split_once("Errors:").map_or("", |c| c.1);
        let errors = if errors.contains("see") { of_section } else { errors };
        let words: BTreeSet<_> = errors.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
        let mut statuses = BTreeSet::from(COMMON);
        statuses.extend(STATUSES.iter().map(|(_, name, _)| *name).filter(|name| words.contains(name)));
        if words.contains("device") || words.contains("failure") {
            statuses.extend(DEVICE);
        }
        all.insert(name, statuses);
    }
    all
}
