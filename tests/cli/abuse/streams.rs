//! Streams that are closed, full or limited neither panic nor end a run that can go on.

use super::*;

/// P1: nobody listens to the messages, and the run ends well all the same.
#[test]
fn messages_that_nobody_reads_stop_nothing() {
    if !device_is_there("messages_that_nobody_reads_stop_nothing") {
        return;
    }
    let capture = Capture::new();
    for (i, script) in [
        "\"$0\" simulate \"$1\" --samples 1 --out \"$2\" 2>/dev/full",
        "\"$0\" simulate \"$1\" --samples 1 --out \"$2\" 2>&-",
        "{ \"$0\" simulate \"$1\" --samples 1 --out \"$2\" 2>&1; echo $? > \"$2.code\"; } | true; exit $(cat \
         \"$2.code\")",
    ]
    .iter()
    .enumerate()
    {
        let out = capture.beside(&format!("out{i}"));
        // A warning on top: the log has a writer of its own.
        capture.write("colours.mtl", "newmtl grey\n");
        let output = shell(script, &[&capture.root(), &out]);
        assert_eq!(output.status.code(), Some(0), "{script}: {}", said(&output));
        assert!(out.join("000003.png").exists(), "{script}");
    }
}

/// P2: a reader that has gone is no error, a full disk is one line.
#[test]
fn results_that_cannot_be_printed_are_an_error_or_nothing() {
    let camera = Capture::new();
    let file = camera.root().join("camera.toml");
    for command in ["effects", "presets", "presets phone", "camera convert \"$1\" --to kalibr"] {
        let gone = shell(&format!("{{ \"$0\" {command}; echo $? >&2; }} | true"), &[&file]);
        assert_eq!(said(&gone).lines().last(), Some("0"), "{command}: {}", said(&gone));
        let full = shell(&format!("\"$0\" {command} > /dev/full"), &[&file]);
        assert_refused(&full, 1, &["standard output: cannot write"]);
        let control = shell(&format!("\"$0\" {command}"), &[&file]);
        assert!(control.status.success() && !control.stdout.is_empty(), "{command}");
    }
}

/// P2: the times are on the disk before they are printed.
#[test]
fn timings_are_kept_though_nobody_reads_them() {
    if !device_is_there("timings_are_kept_though_nobody_reads_them") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    shell("\"$0\" simulate \"$1\" --samples 1 --out \"$2\" --timings | true", &[&capture.root(), &out]);
    assert!(out.join("timings.json").exists());
}

/// C1: a limit of file size is an error with the file's name.
#[test]
fn a_limit_of_file_size_is_an_error_and_no_signal() {
    if !device_is_there("a_limit_of_file_size_is_an_error_and_no_signal") {
        return;
    }
    let capture = Capture::new();
    // 32x24 px of noise are more than 1 KiB.
    capture.write(
        "camera.toml",
        format!("{CAMERA}\n[read_noise]\nsigma = 0.2\n\n[shot_noise]\nfull_well_e = 100.0\n"),
    );
    let out = capture.beside("out");
    let output = shell(
        "ulimit -f 1; XDG_CACHE_HOME=\"$2.cache\" MESA_SHADER_CACHE_DISABLE=1 \"$0\" simulate \"$1\" --samples 1 \
         --out \"$2\"",
        &[&capture.root(), &out],
    );
    assert_refused(&output, 1, &["cannot write", "too large"]);
    assert!(!out.join("000000.png").exists(), "no half frame");
}

/// P7: no thread left is an error.
#[test]
fn no_thread_left_is_an_error_and_no_panic() {
    let capture = Capture::new();
    let out = capture.beside("out");
    let limited = "ulimit -u 1; \"$0\" simulate \"$1\" --samples 1 --out \"$2\"";
    let output = shell(limited, &[&capture.root(), &out]);
    let message = said(&output);
    assert!(!message.contains("panicked"), "{message}");
    // Root is not limited.
    if output.status.code() != Some(0) {
        assert_refused(&output, 1, &["thread"]);
    }
}
