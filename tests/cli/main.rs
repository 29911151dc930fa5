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
#[path = "../support/parsers/mod.rs"]
mod parsers_support;
