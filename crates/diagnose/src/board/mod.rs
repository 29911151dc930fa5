//! A recording of a calibration target as a capture: the target is found in each picture, a camera and a pose for each
//! are fitted to its points, and the board is written as a scene whose camera is a pinhole. `diagnose` then finds what
//! the pinhole lacks.
//!
//! ```text
//! pictures ─ detect | corners.csv ─ points ─ start (closed form) ─ bundle (pinhole, then with lens, then with readout)
//!          ─ tone (how dark, how bright, how far the print reaches) ─ write
//! ```
//!
//! Poses that are fitted with a pinhole alone bend so as to hide the lens, and the diagnosis then finds a remainder
//! that no effect explains. So the lens (and, of a moving board, the readout) is fitted with them, and left out of what
//! is written.

mod april;
mod bundle;
mod charuco;
mod corners;
mod crop;
mod crossings;
mod detect;
mod homography;
mod input;
mod instead;
mod motion;
mod observe;
mod one_camera;
mod orient;
mod refine;
mod select;
mod sheet;
mod solve;
mod target;
mod tone;
mod write;

pub use bundle::{Camera, PARAMETERS};
pub use corners::{read_corners, write_corners};
pub use input::{Picture, pictures, times_of};
pub use observe::{LeftOut, Observed, Source, observe};
pub use one_camera::OneCamera;
pub use select::{BoardFit, Timing, fit_board};
pub use target::{Marker, Pattern, Seen, Target, View};
pub use tone::{Tone, measure_tone};
pub use write::{Real, Written, write_capture};
