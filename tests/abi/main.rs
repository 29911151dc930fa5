//! The C library as its hosts meet it: the header, every call, careless hands, GPU images, the installed files.
#![allow(clippy::unwrap_used)]

mod abuse;
mod conventions;
mod finer;
mod fuzz;
mod gpu_image;
mod install;
mod layout;
mod outside;
mod outside_path;
mod planes;
mod robust;
mod sharing;

#[path = "../support/capi/host.rs"]
mod capi_host;
#[path = "../support/capi/mod.rs"]
mod capi_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/capi/header.rs"]
mod header;
#[path = "../support/capi/installed.rs"]
mod installed;
#[path = "../support/long/mod.rs"]
mod long_support;
#[path = "../support/outside/mod.rs"]
mod outside_support;
