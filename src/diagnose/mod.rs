//! Compares real with simulated frames, names the effects that the simulation lacks, fits them, and reports how far the
//! gap shrinks on frames that no fit has seen.

mod report;

pub use report::{
    Bin, Bootstrap, Candidate, CandidateState, EffectFound, FrameEntry, FramePictures, Gap, Input, LeftOut,
    Maps, Measure, NextStep, Parameter, REPORT_FILE, Report, Verdict, WaterfallStep, Where,
};
