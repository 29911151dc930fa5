//! Shutterbug: what one real, cheap, moving camera would have delivered of a rendered scene.
#![warn(missing_docs)]

pub mod board;
pub mod calibrate;
pub mod camera;
pub mod capi;
pub mod capture;
pub mod chain;
pub mod cli;
pub mod diagnose;
pub mod effects;
pub mod engine;
pub mod error;
pub mod files;
pub mod formats;
pub mod gpu;
pub mod import;
pub mod kernels;
pub mod plane;
pub mod raster;
pub mod reference;
pub mod report;
pub mod scene;
pub mod withhold;

pub use error::{Error, Result};
