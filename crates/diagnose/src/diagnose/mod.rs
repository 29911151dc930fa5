//! Compares real with simulated frames, names the effects that the simulation lacks, fits them, and reports how far the
//! gap shrinks on frames that no fit has seen.
//!
//! ```text
//! capture ─ evidence ─ expect ─ fit ─ judge ─ search ─ tell ─ report.json, camera.toml, pictures
//! ```
//!
//! The folders form layers in this order, and a file names only layers before its own (`tests/property/circles.rs`):
//! `report` is the plain data that is told, `evidence` the frames and their three parts, `expect` what a camera is
//! expected to deliver, `fit` the parameters that do it best, `judge` what is scored and what is left, `search` which
//! effects are taken. `gyro` and `unpaired` are diagnoses of other footage.

mod evidence;
mod expect;
mod fit;
mod gyro;
mod judge;
mod report;
mod search;
mod tell;
mod unpaired;

// What compression does to blocks belongs to the effect; files here name it as neighbours.
use shutterbug::effects::jpeg::{dct, flips, grain, packing};

#[doc(hidden)]
pub use expect::journal::{example_of_a_journal, read_journal};
pub use expect::options::{DiagnoseOptions, Progress, changes_places, effect_names};
pub use expect::pair::Pair;
pub(crate) use expect::room::{POSES, SURFACES, is_constant_factor};
pub use gyro::{Gyroed, diagnose_gyro};
pub use report::{
    Alignment, Bin, Bootstrap, Candidate, CandidateState, DescriptionShown, EffectFound, FrameEntry,
    FramePictures, Gap, Input, LeftOut, Maps, Measure, NextStep, Parameter, PerceptGap, Percepts, PoseOff,
    REPORT_FILE, Report, Verdict, WaterfallStep, Where,
};
pub use tell::asked::{Asked, Settles};
pub use tell::output::Diagnosis;
pub use tell::percepts;
pub use tell::run::{diagnose, diagnose_pair};
pub use tell::setup_checks::no_one_place;
pub use unpaired::{Unpaired, diagnose_unpaired};
