//! One parser a process, the one that `SHUTTERBUG_PARSER` names. With `SHUTTERBUG_SEEDS=FOLDER` it writes a whole file
//! of each kind to FOLDER/NAME/whole and ends.
#![no_main]

use std::path::Path;
use std::sync::OnceLock;

use libfuzzer_sys::{Corpus, fuzz_target};

#[path = "../../../tests/support/parsers/mod.rs"]
mod parsers_support;
use parsers_support::{Parser, parsers};

struct Chosen(Parser);

// SAFETY: the fuzzer calls its target in one thread.
unsafe impl Send for Chosen {}
// SAFETY: as above.
unsafe impl Sync for Chosen {}

fn chosen() -> &'static Parser {
    static CHOSEN: OnceLock<Chosen> = OnceLock::new();
    let begin = || {
        let folder = std::env::temp_dir().join(format!("shutterbug-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import");
        let all = parsers(&folder, &data);
        if let Some(seeds) = std::env::var_os("SHUTTERBUG_SEEDS") {
            for parser in &all {
                let of = Path::new(&seeds).join(parser.name);
                std::fs::create_dir_all(&of).expect("a folder");
                std::fs::write(of.join("whole"), &parser.whole).expect("written");
            }
            std::process::exit(0);
        }
        let name = std::env::var("SHUTTERBUG_PARSER").expect("SHUTTERBUG_PARSER: the name of a parser");
        let named = all.into_iter().find(|p| p.name == name);
        Chosen(named.unwrap_or_else(|| panic!("no parser `{name}`")))
    };
    &CHOSEN.get_or_init(begin).0
}

fuzz_target!(|bytes: &[u8]| -> Corpus {
    if let Err(error) = chosen().parse(bytes) {
        assert!(!shutterbug::error::one_line(&error).contains(['\n', '\u{1b}']), "{error:?}");
    }
    Corpus::Keep
});
