//! Random sequences of calls of the C ABI under the address sanitizer (`fuzz/calls.c`), for a short time, each run with
//! other seeds. `fuzz/run` does it for as long as one likes; `SHUTTERBUG_LONG=1` for ten minutes.
#![allow(clippy::unwrap_used)]

use std::time::{SystemTime, UNIX_EPOCH};

use crate::installed::{NO_DEVICE, build, program};

#[test]
fn random_sequences_of_calls_break_nothing() {
    let extra = ["-fsanitize=address", "fuzz/random.c"];
    let Some(fuzz) = build("cc", "-std=c11", "fuzz/calls.c", &extra) else { return };
    // A program of 4096 bytes takes up to a minute. Shorter ones reach the same calls, and more of them fit.
    let long = crate::long_support::long();
    let (seconds, most) = if long { ("600", "4096") } else { ("4", "256") };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs().to_string();
    let fuzz = |arguments: &[&str]| {
        // Leaks are capi_install's: here the loader unloads drivers.
        let out = program(&fuzz, arguments).env("ASAN_OPTIONS", "detect_leaks=0").output().unwrap();
        let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
        (out.status.code(), text)
    };
    // The same programs each time, then others.
    let mut reached = String::new();
    // 24 was a frame given up between its parts, whose slot was recorded again. In one of the others each call gets
    // through.
    let again = [("24", "0", "4096"), ("14", "0", "256"), ("18", "0", "256"), ("25", "0", "256")];
    for (seed, seconds, most) in again.into_iter().chain([(now.as_str(), seconds, most)]) {
        let (code, text) = fuzz(&[seed, seconds, "", "", most]);
        if code == Some(NO_DEVICE) {
            assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{text}");
            eprintln!("SKIPPED random_sequences_of_calls_break_nothing: no device");
            return;
        }
        assert_eq!(code, Some(0), "from seed {seed} on: {text}");
        eprintln!("from seed {seed} on:\n{text}");
        reached += &text;
    }
    // Control: calls get through, they are not all refused at the door.
    for call in [
        "engine_create",
        "engine_submit_outside",
        "engine_submit",
        "frame_read",
        "engine_destroy",
        "motion_convert",
        "pose_convert",
        "check_conventions",
        "engine_margin",
        // Reads of more than 8 bits.
        "finer",
    ] {
        let mut lines = reached.lines().filter(|l| l.split(' ').next() == Some(call));
        assert!(
            lines.any(|l| l.contains(" 0:") && !l.ends_with(" 0:0")),
            "control: no {call} got through:\n{reached}"
        );
    }
    // No call was answered with anything that the header does not say of it. (destroy is that of any kind.)
    let documented = crate::header::documented();
    for line in reached.lines() {
        let mut words = line.split(' ');
        let Some((call, may_give)) = words.next().and_then(|call| Some((call, documented.get(call)?))) else {
            continue;
        };
        for answer in words.filter_map(|w| w.split(':').next()?.parse::<usize>().ok()) {
            let name = shutterbug::capi::STATUSES[answer].1;
            assert!(may_give.contains(name), "the header does not say that {call} may give {name}");
        }
    }
    assert!(!documented["engine_get_info"].contains("FULL"), "control");
    // Control: a library that takes dead handles, and one that writes too far, would be found.
    for (wrong, says) in [("double", "took a dead handle"), ("overflow", "AddressSanitizer: SEGV")] {
        let (code, text) = fuzz(&["1", "0", "", wrong, "64"]);
        assert!(code != Some(0) && text.contains(says), "control {wrong}: {code:?} {text}");
    }
}
