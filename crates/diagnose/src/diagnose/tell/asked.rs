//! What frames can tell and what they cannot, which is said before any answer, and what to film or supply to settle
//! the rest.

use serde::Serialize;

use crate::diagnose::report::{CandidateState, Report};

/// What a report answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Asked {
    /// Candidates that were told of: found, or rejected.
    pub can_tell: Vec<String>,
    /// Those that these frames cannot tell of.
    pub cannot_tell: Vec<String>,
    /// What to film or supply, that which settles most first.
    pub to_settle: Vec<Settles>,
}

/// What settles some of the rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settles {
    /// "ten seconds of panning past a pole".
    pub film: String,
    /// Candidates that it tells of.
    pub candidates: Vec<String>,
}

impl Report {
    /// The text of `report.json`, which begins with what these frames can tell ([`Report::asked`]). Figures that are
    /// not finite become `null`.
    ///
    /// # Panics
    /// Never: all maps have string keys.
    pub fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct Written<'a> {
            asked: Asked,
            #[serde(flatten)]
            report: &'a Report,
        }
        let written = Written { asked: self.asked(), report: self };
        serde_json::to_string_pretty(&written).expect("all keys are strings")
    }

    /// What these frames can tell and what they cannot.
    pub fn asked(&self) -> Asked {
        let mut asked =
            Asked { can_tell: self.effects.iter().map(|e| e.name.clone()).collect(), ..Asked::default() };
        for candidate in &self.candidates {
            let name = candidate.name.clone();
            if candidate.state == CandidateState::Rejected {
                asked.can_tell.push(name);
                continue;
            }
            asked.cannot_tell.push(name.clone());
            if candidate.footage.is_empty() {
                continue;
            }
            match asked.to_settle.iter_mut().find(|s| s.film == candidate.footage) {
                Some(known) => known.candidates.push(name),
                None => {
                    asked.to_settle.push(Settles { film: candidate.footage.clone(), candidates: vec![name] })
                }
            }
        }
        asked.to_settle.sort_by_key(|s| std::cmp::Reverse(s.candidates.len()));
        asked
    }
}

impl Asked {
    /// One line for a terminal: what is not told, and what would settle most of it; nothing where all is told.
    pub fn line(&self) -> Option<String> {
        let plain =
            |names: &[String]| names.iter().map(|n| n.replace('_', " ")).collect::<Vec<_>>().join(", ");
        if self.cannot_tell.is_empty() {
            return None;
        }
        let film = self.to_settle.first().map_or_else(String::new, |s| format!("; most needs: {}", s.film));
        Some(format!("these frames cannot tell of {}{film}", plain(&self.cannot_tell)))
    }
}
