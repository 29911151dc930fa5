//! What a fit leaves.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::model::{P, Theta};

/// A finished fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Fit {
    pub theta: Theta,
    /// Half widths of 95 % intervals; empty where they were not asked for.
    pub half: BTreeMap<P, f64>,
}
