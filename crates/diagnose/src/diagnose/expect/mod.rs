//! What a camera is expected to deliver: from parameters to the mean and the spread of every value, and how far two
//! correct simulations may differ.

pub(super) mod bench;
pub(super) mod compared;
pub(super) mod cover;
pub(super) mod description;
pub(super) mod developed;
pub(super) mod discrepancy;
pub(super) mod fitted;
pub(super) mod flow;
pub(super) mod forward;
pub(super) mod journal;
pub(super) mod light;
pub(super) mod linear;
pub(super) mod model;
pub(super) mod options;
pub(super) mod pair;
pub(super) mod parts;
pub(super) mod reduced;
pub(super) mod room;
pub(super) mod rounding;
pub(super) mod settings;
pub(super) mod sharp;
pub(super) mod tone;
pub(super) mod undistort;
pub(super) mod vector;
pub(super) mod weighing;
pub(super) mod wide;
