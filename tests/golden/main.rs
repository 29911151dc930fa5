//! Small pictures that are kept beside these files. A change of one is a decision:
//! `SHUTTERBUG_BLESS=1 cargo test --release --test golden` writes those that are missing or differ; look at them, then
//! commit.
#![allow(clippy::unwrap_used)]

mod effects;
mod frames;

#[path = "../support/effects/mod.rs"]
mod effects_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
