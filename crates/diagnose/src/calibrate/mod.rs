//! Calibration from pictures: the noise of a camera from two or more frames of one static scene (section 3.4 and Fig. 5
//! of the paper; photon transfer as in EMVA 1288, release 4.0).
//!
//! The difference of two frames is noise alone where the scene rests. Its variance over intensity gives full well and
//! read noise of the delivered picture ([`ptc`]), means of rows and columns give row noise, neighbours their
//! correlation ([`spatial`]). An ISP mixes colours and smooths, so those are not yet the sensor's: [`fit`] finds
//! sensor, colour matrix and smoothing ([`model`]) whose simulated frames give the same measurements.
//!
//! `camera.toml` holds the same camera for the engine's chain, whose own simulation it was fitted to. `docs/sensor.md`
//! has what both reach on three pairs of photographs by a Nao robot in a canteen, and what they miss. Where an ISP
//! clips at black and takes colours towards luma behind that, vivid colours pile up at a share of luma: the factor of
//! `saturation` is read from there.
//!
//! What pictures cannot tell: the tone curve (sRGB is taken), the fixed pattern from two frames (it is in both), edge
//! noise from frames that are displaced.

//! Beside that, from charts: the sensor's pattern and the lens's fall-off from a flat field ([`flat`], [`dark`]),
//! sharpness from a slanted edge ([`edge`]), readout from the stripes of a blinking light ([`readout`]).

// A channel indexes several arrays at once here; an iterator over one of them hides that.
#![allow(clippy::needless_range_loop)]

pub mod analytic;
mod bent;
mod black;
mod blocks;
mod box_mean;
mod calibration;
pub mod cells;
pub mod chart;
pub mod chart_edge;
mod copied;
mod corners;
mod course;
mod curve;
pub mod dark;
#[cfg(test)]
mod dice;
mod drawn;
pub mod edge;
mod ends;
mod fall_off;
pub mod figure;
pub mod filter;
pub mod fit;
pub mod flat;
pub mod frames;
pub mod lines;
pub mod model;
mod noise;
mod odd;
mod own;
pub mod ptc;
pub mod readout;
pub mod rest;
mod rounding;
mod scene;
mod search;
pub mod second;
pub mod series;
mod shading;
mod slopes;
pub mod spatial;
mod spectrum;
pub mod statics;
mod tables;
mod unlike;
mod wave;

pub use calibration::calibrate_noise;
pub use frames::{Distinct, Encoding, Frame};
pub use noise::{Calibration, Comparison, Measured, NoiseOptions, Pictures, measure_noise};
pub use tables::{ChainCamera, chain_settings, paper_settings};
