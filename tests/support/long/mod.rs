//! An ordinary run asks some cases of a long loop; `SHUTTERBUG_LONG=1` asks all. What was left out is printed at the
//! end of `tools/test`: it names a file for that in `SHUTTERBUG_LEFT_OUT`.

#![allow(dead_code)] // A test program uses a part of it.

use std::io::Write;

/// Whether everything is asked, however long it takes.
pub fn long() -> bool {
    std::env::var_os("SHUTTERBUG_LONG").is_some()
}

/// Every `every`-th case of a loop, the first among them; all of them in a long run.
pub fn some_of<T>(test: &str, every: usize, cases: impl IntoIterator<Item = T>) -> Vec<T> {
    let cases: Vec<T> = cases.into_iter().collect();
    let all = cases.len();
    let asked: Vec<T> = cases.into_iter().step_by(if long() { 1 } else { every }).collect();
    if asked.len() < all {
        left_out(test, &format!("{} of {all} cases", all - asked.len()));
    }
    asked
}

/// Says what of a test was not asked.
pub fn left_out(test: &str, what: &str) {
    eprintln!("{test}: left out, SHUTTERBUG_LONG=1 asks it: {what}");
    let Some(file) = std::env::var_os("SHUTTERBUG_LEFT_OUT") else { return };
    // Two test programs write at a time: a line is one write.
    let line = format!("{test}: {what}\n");
    let file = std::fs::File::options().append(true).create(true).open(file);
    file.and_then(|mut f| f.write_all(line.as_bytes())).expect("what is left out is written");
}
