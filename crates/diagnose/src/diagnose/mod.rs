//! Compares real with simulated frames, names the effects that the simulation lacks, fits them, and reports how far the
//! gap shrinks on frames that no fit has seen.
//!
//! ```text
//! capture ─ evidence (fit | choose | report) ─ search: forward model, fit, judge ─ shares ─ places
//!         ─ Report, camera.toml
//! ```

mod advice;
mod apart;
mod asked;
mod bench;
mod blocks;
mod budget;
mod choices;
mod comb;
mod compared;
mod cost;
mod cover;
mod decide;
mod describe;
mod description;
mod developed;
mod discrepancy;
mod ending;
mod evidence;
mod exchange;
mod fit;
mod fitted;
mod flicker;
mod flow;
mod forward;
mod found;
mod gyro;
mod hot;
mod intervals;
mod journal;
mod judge;
mod levels;
mod light;
mod linear;
mod model;
mod noise;
mod normal;
mod options;
mod output;
mod pair;
mod pairs;
mod parts;
pub mod percepts;
mod placed;
mod places;
mod quality;
mod question;
mod report;
mod residue;
mod room;
mod run;
mod score;
mod search;
mod searches;
mod sentences;
mod settings;
mod setup_checks;
mod sharp;
mod shown;
mod smear;
mod starts;
mod support;
mod task;
mod tone;
mod undistort;
mod unpaired;
mod vector;
mod weighing;
mod wide;

// What compression does to blocks belongs to the effect; files here name it as neighbours.
use shutterbug::effects::jpeg::{dct, flips, packing};

pub use asked::{Asked, Settles};
pub use gyro::{Gyroed, diagnose_gyro};
#[doc(hidden)]
pub use journal::{example_of_a_journal, read_journal};
pub use options::{DiagnoseOptions, Progress, changes_places, effect_names};
pub use output::Diagnosis;
pub use pair::Pair;
pub use report::{
    Alignment, Bin, Bootstrap, Candidate, CandidateState, DescriptionShown, EffectFound, FrameEntry,
    FramePictures, Gap, Input, LeftOut, Maps, Measure, NextStep, Parameter, PerceptGap, Percepts, PoseOff,
    REPORT_FILE, Report, Verdict, WaterfallStep, Where,
};
pub use run::{diagnose, diagnose_pair};
pub use unpaired::{Unpaired, diagnose_unpaired};
