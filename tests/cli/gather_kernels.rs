//! The kernel of the paper's gather is chosen as documented.

use std::process::Command;

use crate::gpu_support::device;

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../demo/capture");

#[test]
fn the_choice_is_measured_once_kept_and_can_be_forced() {
    if device("the_choice_is_measured_once_kept_and_can_be_forced").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let devices = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
        let output =
            command.args(["devices", "--kernels"]).env("XDG_CACHE_HOME", folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let (first, second) = (devices(), devices());
    assert!(first.contains("by Measurement") && !first.contains("by Cache"), "{first}");
    assert!(second.contains("by Cache") && !second.contains("by Measurement"), "{second}");
    // What was measured stands there both times.
    let line = |text: &str| {
        text.lines().find(|l| l.contains("--gather Fast")).unwrap().replace("Measurement", "Cache")
    };
    assert_eq!(line(&first), line(&second));
    // A cache that is no cache is measured over.
    std::fs::write(folder.path().join("shutterbug/kernels.json"), "{ broken").unwrap();
    assert!(devices().contains("by Measurement"));
    let out = folder.path().join("out");
    let forced = |gather: &str, kernel: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
        command.arg("simulate").arg(DEMO).arg("--out").arg(&out);
        command.args(["--method", "paper", "--gather", gather, "--gather-kernel", kernel, "--samples", "1"]);
        command.env("XDG_CACHE_HOME", folder.path()).output().unwrap().status.success()
    };
    assert!(forced("bilinear", "texels_2"));
    let manifest = std::fs::read_to_string(out.join("simulate.json")).unwrap();
    assert!(manifest.contains("texels_2"), "{manifest}");
    assert!(!forced("fast", "texels_2") && !forced("bilinear", "unheard_of"));
}
