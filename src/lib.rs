//! Shutterbug: what one real, cheap, moving camera would have delivered of a rendered scene.

pub mod camera;
pub mod capi;
pub mod capture;
pub mod chain;
pub mod effects;
pub mod engine;
pub mod error;
pub mod files;
pub mod gpu;
pub mod kernels;
pub mod plane;
pub mod raster;
pub mod reference;
pub mod scene;

pub use error::{Error, Result};
