//! Detection over strength: the cases, the points and the curves.

use serde::{Deserialize, Serialize};

/// One diagnosed capture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CurveCase {
    /// The effect that was hidden.
    pub effect: String,
    /// How strong it was, in the unit of its curve.
    pub strength: f64,
    /// Number of the scene.
    pub repeat: usize,
    /// What was named.
    pub found: Vec<String>,
    /// The verdict.
    pub verdict: String,
    /// Gap that it makes, DN.
    pub gap_dn: f64,
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// One strength of a curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// In the unit of the curve.
    pub strength: f64,
    /// Captures.
    pub cases: usize,
    /// In so many the effect was among those named.
    pub detected: usize,
    /// In so many it was the only one.
    pub alone: usize,
    /// Share that was detected.
    pub rate: f64,
    /// 95 % interval of the share (Wilson's).
    pub rate_ci95: [f64; 2],
    /// Median gap that the effect makes, DN.
    pub gap_dn: f64,
}

/// One effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Its name.
    pub effect: String,
    /// What is graded: "readout_time_s".
    pub measure: String,
    /// Weakest first.
    pub points: Vec<CurvePoint>,
    /// Strength at which half are detected, between the points on either side; nothing where the curve does not cross
    /// it.
    pub half_detected: Option<f64>,
}

/// All curves, as in `curves.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CurveResult {
    /// Everything that the captures depend on.
    pub options: serde_json::Value,
    /// By effect.
    pub curves: Vec<Curve>,
    /// Every capture.
    pub cases: Vec<CurveCase>,
}
