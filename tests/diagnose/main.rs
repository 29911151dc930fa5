//! From frames to the effects that explain a gap: hidden effects are found, others are not, and the page says what was
//! found.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod constants;
mod description;
mod percepts;
mod photographs;
mod recovery;
mod report_axe;
mod report_page;
mod resume;
mod withhold;

#[path = "../support/diagnose/mod.rs"]
mod diagnose_support;
#[path = "../support/dice/mod.rs"]
mod dice_support;
#[path = "../support/gpu/mod.rs"]
mod gpu_support;
#[path = "../support/long/mod.rs"]
mod long_support;
#[path = "../support/report/mod.rs"]
mod report_support;
