//! `docs/constants.md` is the table of the numbers that decide a diagnosis, made from the code: name, value, what it
//! is, what measured it. `SHUTTERBUG_BLESS=1 cargo test --test diagnose constants::` writes it anew.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::path::Path;

/// Files whose constants decide: what simulations may differ by, chance, the decision, and the checks that it reads.
const FILES: [&str; 11] = [
    "expect/discrepancy",
    "judge/mod",
    "search/decide",
    "judge/residue",
    "judge/smear",
    "search/exchange",
    "search/candidates",
    "expect/description/surface",
    "expect/description/radiance",
    "expect/description/masks",
    "expect/description/settle",
];
/// Constants that say how something is worked out, and decide nothing.
const ARITHMETIC: [&str; 23] = [
    "NONE",
    "PARTS",
    "ROOKS",
    "STEP",
    "STEPS",
    "PASSES",
    "ACROSS",
    "BLOCKS",
    "DRAWS",
    "STREAM_COLOURS",
    "STREAM_EDGES",
    "TABLE",
    "WIDE_DN",
    "RESAMPLES",
    "STREAM_BOOTSTRAP",
    "BLOCK_PX",
    "LIKENESS_PX",
    "LOOK",
    "MOST",
    "MIDDLE",
    "FEWEST",
    "FAST",
    "ROUNDING_DN2",
];

struct Constant {
    name: String,
    value: String,
    meaning: String,
    measured: String,
}

/// The constants of a file with their documentation.
fn constants(text: &str) -> Vec<Constant> {
    let text = text.split("#[cfg(test)]").next().unwrap();
    let mut out = Vec::new();
    let mut docs: Vec<&str> = Vec::new();
    for line in text.lines() {
        if let Some(doc) = line.strip_prefix("///") {
            docs.push(doc.trim());
        } else if let Some((head, value)) = line.split_once(" = ").filter(|(h, _)| h.contains("const ")) {
            let name = head.split("const ").nth(1).unwrap().split(':').next().unwrap();
            let all = docs.join(" ");
            let (meaning, measured) = all.split_once("Measured: ").unwrap_or((&all, "words alone"));
            out.push(Constant {
                name: name.to_owned(),
                value: value.trim_end_matches(';').to_owned(),
                meaning: meaning.trim().to_owned(),
                measured: measured.trim().to_owned(),
            });
            docs.clear();
        } else {
            docs.clear();
        }
    }
    out
}

fn table() -> String {
    let mut out = String::from(
        "# Numbers that decide a diagnosis\n\n\
         Generated from `crates/diagnose/src/diagnose` by `tests/diagnose/constants.rs`. Captures are those of\n\
         `../shared/data/cycles-dev`.\n\n| number | value | what it is | measured |\n|---|---|---|---|\n",
    );
    for file in FILES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/diagnose/{file}.rs"));
        let text = std::fs::read_to_string(&path).unwrap();
        for c in constants(&text).iter().filter(|c| !ARITHMETIC.contains(&c.name.as_str())) {
            let cell = |s: &str| s.replace('|', "\\|");
            writeln!(
                out,
                "| `{}::{}` | {} | {} | {} |",
                file.trim_end_matches("/mod"),
                c.name,
                cell(&c.value),
                cell(&c.meaning),
                cell(&c.measured)
            )
            .unwrap();
        }
    }
    out
}

#[test]
fn the_table_of_constants_is_the_code_s() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/constants.md");
    let table = table();
    if std::env::var_os("SHUTTERBUG_BLESS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert_eq!(written, table, "run: SHUTTERBUG_BLESS=1 cargo test --test diagnose constants::");
    // Control: the parser sees a number that changes.
    let changed = constants("/// A bound.\n///\n/// Measured: here.\nconst BOUND: f64 = 0.2;\n");
    assert_eq!((changed[0].value.as_str(), changed[0].measured.as_str()), ("0.2", "here."));
}
