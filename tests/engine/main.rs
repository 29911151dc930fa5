//! The engine on a device: each method against the others and against formulas, what must hold to the bit, what goes
//! wrong.
#![allow(clippy::unwrap_used)]

mod effects;
mod exact;
mod exact_stress;
mod failures;
mod fast_ladder;
mod lens;
mod neutral;
mod noise;
mod outside_steady;
mod paper;
mod shutter;
mod steady;
mod validation;

#[path = "../support/checkers/mod.rs"]
mod checkers;
#[path = "../support/effects/mod.rs"]
mod effects_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/long/mod.rs"]
mod long_support;
#[path = "../support/forms/mod.rs"]
mod oracle_forms;
#[path = "../../benches/ladder/room.rs"]
#[allow(dead_code)]
mod room;
#[path = "../../benches/ladder/takes.rs"]
#[allow(dead_code)]
mod takes;
