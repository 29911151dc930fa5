//! Writes what a diagnosis says: the report with its sentences, places, percepts and pictures.

pub(super) mod advice;
pub(super) mod asked;
pub(super) mod describe;
pub(super) mod entries;
pub(super) mod output;
pub mod percepts;
pub(super) mod places;
pub(super) mod run;
mod same_together;
pub(super) mod sentences;
pub(super) mod setup_checks;
mod stamps;
pub(super) mod task;
pub(super) mod views;
