//! From frames of a simulator and of a real camera to the effects that explain the gap between them.
//!
//! [`diagnose`] compares the two and fits; [`report`] writes the page; [`withhold`] tries it blind on captures whose
//! effects are hidden. [`calibrate`] measures a camera from charts and static scenes, [`board`] makes a capture of
//! photographs of a calibration board. [`out`] is the folder that a command writes to. The pictures themselves come
//! from [`shutterbug`].

pub mod board;
pub mod calibrate;
mod child;
pub mod diagnose;
mod listing;
pub mod out;
pub mod report;
pub mod withhold;
