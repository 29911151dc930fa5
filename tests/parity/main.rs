//! Every kernel against its twin on the CPU, on random and edge input, with controls.
#![allow(clippy::unwrap_used)]

mod effects;
mod exact;
mod exact_blur;
mod exact_place;
mod fast;
mod fast_rigid;
mod outside_blend;
mod paper;
mod paper_fast;
mod raster;
mod resolve;

#[path = "../support/effects/mod.rs"]
mod effects_support;
#[path = "../support/exact/mod.rs"]
mod exact_support;
#[path = "../support/fast_device/mod.rs"]
mod fast_device;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/long/mod.rs"]
mod long_support;
