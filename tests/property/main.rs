//! Without a device: what must hold of scenes, captures, effects, random numbers and the sources themselves, on random
//! and on hostile input.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod captures;
mod circles;
mod effects_closed_forms;
mod effects_noise;
mod effects_registry;
mod layering;
mod noise_statistics;
mod paper_closed_form;
mod plurals;
mod scenes;
mod scenes_hostile;
mod sizes;

#[path = "../support/effects/mod.rs"]
mod effects_support;
