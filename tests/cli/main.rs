//! The program as users call it: what it writes, what it refuses, what hostile input does to it.
#![allow(clippy::unwrap_used)]

mod abuse;
mod auto_exposure;
mod board;
mod board_april;
mod calibrate_noise;
mod diagnose_after;
mod distance;
mod exposure;
mod formats;
mod gather_kernels;
mod gyro;
mod import;
mod import_folders;
mod import_hostile;
mod import_video;
mod pairs;
mod reference;
mod simulate;
mod withhold;

#[path = "../support/board/mod.rs"]
mod board_support;
#[path = "../support/capi/mod.rs"]
mod capi_support;
#[path = "../support/diagnose/mod.rs"]
mod diagnose_support;
#[path = "../support/dice/mod.rs"]
mod dice_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/import/mod.rs"]
mod import_support;
#[path = "../support/long/mod.rs"]
mod long_support;
#[path = "../support/parsers/mod.rs"]
mod parsers_support;

/// Whether there is a device; without one the test is skipped by name, or fails where a device is required.
fn device_is_there(test: &str) -> bool {
    let output =
        std::process::Command::new(env!("CARGO_BIN_EXE_shutterbug")).arg("devices").output().unwrap();
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{test}: {said}");
        eprintln!("SKIPPED {test}: {said}");
    }
    output.status.success()
}
