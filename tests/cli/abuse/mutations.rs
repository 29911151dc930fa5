//! Every parser on files that were spoiled at random: an answer or an error of one line, never a panic.
//! `SHUTTERBUG_FUZZ=N` tries N of each (seconds in a test, hours when left alone); what is tried depends on the number
//! alone, so a finding comes back.

use std::panic::{AssertUnwindSafe, catch_unwind};

use shutterbug::error::one_line;

use super::*;
use crate::parsers_support::parsers;

/// Tried of each parser where nobody asks for more.
const USUAL: u64 = 400;

/// A generator with a fixed start (SplitMix64).
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn roll(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below.max(1) as u64) as usize
    }
}

/// What is put in: ends of ranges, quotes, brackets, escapes, marks.
const PIECES: [&[u8]; 20] = [
    b"-1",
    b"1e400",
    b"nan",
    b"inf",
    b"18446744073709551616",
    b"0x",
    b"\"",
    b"[[",
    b"]]",
    b"{",
    b"\n",
    b"\r",
    b"\0",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"#",
    b"\\",
    b"../",
    b"  ",
];

fn spoiled(whole: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..1 + dice.roll(6) {
        let at = dice.roll(bytes.len() + 1);
        let end = (at + dice.roll(24)).min(bytes.len());
        match dice.roll(6) {
            0 => drop(bytes.drain(at..end)),
            1 => drop(bytes.splice(at..at, PIECES[dice.roll(PIECES.len())].iter().copied())),
            2 => drop(bytes.splice(at..end, PIECES[dice.roll(PIECES.len())].iter().copied())),
            3 => bytes.truncate(at),
            4 => {
                let again = bytes[at..end].repeat(1 + dice.roll(30));
                drop(bytes.splice(at..at, again));
            }
            _ => bytes.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << dice.roll(8)),
        }
    }
    bytes
}

#[test]
fn parsers_answer_spoiled_files_and_never_panic() {
    let asked = std::env::var("SHUTTERBUG_FUZZ").ok().and_then(|n| n.parse().ok());
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import");
    for parser in parsers(folder.path(), &data) {
        // A recording is long, and so is what is done with it.
        let count = asked.unwrap_or(if parser.whole.len() > 5000 { USUAL / 10 } else { USUAL });
        let (name, mut accepted, mut refused) = (parser.name, 0, 0);
        for number in 0..count {
            let bytes = spoiled(&parser.whole, &mut Dice(number.wrapping_mul(0x1_0001)));
            match catch_unwind(AssertUnwindSafe(|| parser.parse(&bytes))) {
                Ok(Ok(())) => accepted += 1,
                Ok(Err(error)) => {
                    refused += 1;
                    assert!(!one_line(&error).contains(['\n', '\u{1b}']), "{name} {number}: {error:?}");
                }
                Err(_) => panic!("{name}, number {number}: {}", String::from_utf8_lossy(&bytes)),
            }
        }
        // Control: the spoiling does spoil, and the whole file of most is one that is read.
        assert!(refused > 0 && accepted + refused == count, "{name}: {accepted} accepted, {refused} refused");
        if !["report.json", "manifest.jsonl"].contains(&name) {
            parser.parse(&parser.whole).unwrap_or_else(|e| panic!("{name}: {e}"));
        }
    }
}

/// What a run that goes on reads of an earlier one: any manifest or simulate.json is refused or gone on with.
#[test]
fn a_spoiled_state_is_refused_or_gone_on_with() {
    if !device_is_there("a_spoiled_state_is_refused_or_gone_on_with") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    let frame = fs::read(out.join("000000.png")).unwrap();
    for name in ["manifest.jsonl", "simulate.json"] {
        let whole = fs::read(out.join(name)).unwrap();
        for number in 0..12 {
            fs::write(out.join(name), spoiled(&whole, &mut Dice(number))).unwrap();
            let output = capture.simulate(&out, &["--resume"]);
            let code = output.status.code();
            assert!(matches!(code, Some(0 | 1)), "{name} {number}: {}", said(&output));
            assert!(!said(&output).contains("panicked"), "{name} {number}: {}", said(&output));
            assert_eq!(fs::read(out.join("000000.png")).unwrap(), frame, "{name} {number}");
            // As it was before the next.
            fs::remove_dir_all(&out).unwrap();
            assert_done(&capture.simulate(&out, &[]));
        }
    }
}
