//! Against renderers that are not this one: the CPU oracle against formulas and an independent path tracer, the device
//! against both, frames from outside against a ray caster.
#![allow(clippy::unwrap_used)]

mod closed_forms;
mod cycles;
mod cycles_effects;
mod cycles_engine;
mod cycles_fast;
mod cycles_ladder;
mod cycles_lens;
mod lens;
mod outside;
mod outside_hidden;
mod outside_motion;
mod outside_pictures;
mod requests;
mod shutter;

#[path = "../support/capi/mod.rs"]
mod capi_support;
#[path = "../support/effects/mod.rs"]
mod effects_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/long/mod.rs"]
mod long_support;
#[path = "../support/forms/mod.rs"]
mod oracle_forms;
#[path = "../support/oracle/mod.rs"]
mod oracle_support;
#[path = "../support/outside/mod.rs"]
mod outside_support;
