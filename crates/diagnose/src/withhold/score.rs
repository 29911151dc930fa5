//! Opens an answer and compares it with what the diagnosis said.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::alike::is_alike;
use super::falsify::Falsified;
use super::hidden::Kind;
use crate::diagnose::{Report, Verdict};
use shutterbug::chain::{Domain, Effect, Stage, Work};

/// One diagnosed case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CaseScore {
    /// Its number.
    pub case: usize,
    /// What it asked.
    pub kind: Kind,
    /// How the camera moved.
    pub motion: String,
    /// The effects that were hidden, in light-path order.
    pub hidden: Vec<String>,
    /// The effects that were named, largest share first.
    pub found: Vec<String>,
    /// What was said to be wrong with the description.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub described: Vec<String>,
    /// What was, by the names of reports.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub falsified: Vec<String>,
    /// The verdict; "failed" where the diagnosis ended with an error.
    pub verdict: String,
    /// Its sentence, or the error.
    pub sentence: String,
    /// Whether the first name is one that was hidden (nothing hidden: nothing named; left out: `unknown_effect` said).
    pub first_right: bool,
    /// Whether the names are those that were hidden, no more and no less (left out: as `first_right`).
    pub exact: bool,
    /// The same, or the report says that what it names does what was hidden on these frames.
    #[serde(default)]
    pub exact_or_alike: bool,
    /// Gap before, after and floor, DN; zeros where the diagnosis failed.
    pub gap: [f64; 3],
    /// Part of the gap that the diagnosis closed.
    pub closed: f64,
    /// Part that the TRUE parameters close, by the same judge.
    pub closed_by_truth: Option<f64>,
    /// Parameters of effects that were hidden and found.
    pub parameters: Vec<ParameterScore>,
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// One number of an effect that was hidden and found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterScore {
    /// `rolling_shutter.readout_time_s`; components of vectors have their index.
    pub name: String,
    /// As hidden.
    pub truth: f64,
    /// As fitted.
    pub value: f64,
    /// |value - truth| / |truth|.
    pub relative_error: f64,
    /// Whether the 95 % interval holds the truth; nothing where none was given.
    pub covered: Option<bool>,
    /// Half the width of the interval.
    #[serde(default)]
    pub half_width: Option<f64>,
}

/// The effects of an opened answer.
fn hidden(answer: &Value) -> &[Value] {
    answer["effects"].as_array().map(Vec::as_slice).unwrap_or_default()
}

impl CaseScore {
    /// Of a trial that ended with nothing.
    fn blank(answer: &Value, kind: Kind, motion: &str) -> Self {
        let hidden = hidden(answer);
        let hidden: Vec<String> =
            hidden.iter().filter_map(|e| Some(e["name"].as_str()?.to_owned())).collect();
        let case = answer["case"].as_u64().unwrap_or(0) as usize;
        Self {
            case,
            kind,
            motion: motion.to_owned(),
            hidden,
            found: Vec::new(),
            described: Vec::new(),
            falsified: Vec::new(),
            verdict: "failed".to_owned(),
            sentence: String::new(),
            first_right: false,
            exact: false,
            exact_or_alike: false,
            gap: [0.0; 3],
            closed: 0.0,
            closed_by_truth: None,
            parameters: Vec::new(),
            seconds: 0.0,
        }
    }

    /// `answer` is the opened answer, `report` the diagnosis or the error that it ended with.
    pub(super) fn new(answer: &Value, kind: Kind, motion: &str, report: Result<&Report, &str>) -> Self {
        let blank = Self::blank(answer, kind, motion);
        let report = match report {
            Err(error) => return Self { sentence: error.to_owned(), ..blank },
            Ok(report) => report,
        };
        let unknown = report.verdict == Verdict::UnknownEffect;
        // What is said of the description is asked apart: the camera's effects are what is hidden.
        let (camera, description): (Vec<_>, Vec<_>) = report.effects.iter().partition(|e| e.camera);
        let names = |effects: &[&crate::diagnose::EffectFound]| -> Vec<String> {
            effects.iter().map(|e| e.name.clone()).collect()
        };
        let (found, described) = (names(&camera), names(&description));
        let imperfect: Vec<Falsified> =
            serde_json::from_value(answer["imperfect"].clone()).unwrap_or_default();
        let falsified: BTreeSet<String> = imperfect.iter().map(|f| f.said().to_owned()).collect();
        let same = found.iter().collect::<BTreeSet<_>>() == blank.hidden.iter().collect::<BTreeSet<_>>();
        let (first_right, exact) = match kind {
            Kind::None => {
                let calm = report.verdict == Verdict::NoGap || !falsified.is_empty();
                (found.is_empty() && calm, found.is_empty())
            }
            Kind::LeftOut => (unknown, unknown),
            Kind::Single | Kind::Several => (found.first().is_some_and(|f| blank.hidden.contains(f)), same),
        };
        let g = &report.gap;
        let parameters = hidden(answer).iter().flat_map(|truth| parameters(truth, report)).collect();
        Self {
            found,
            described,
            falsified: falsified.into_iter().collect(),
            verdict: verdict_name(report.verdict).to_owned(),
            sentence: report.sentence.clone(),
            first_right,
            exact,
            exact_or_alike: exact
                || (matches!(kind, Kind::Single | Kind::Several) && is_alike(&blank.hidden, &camera)),
            gap: [g.before, g.after, g.floor],
            closed: g.closed_fraction,
            parameters,
            seconds: report.input.seconds,
            ..blank
        }
    }

    /// A column of the confusion matrix: the first name, or the verdict where nothing is named.
    pub fn said(&self) -> &str {
        self.found.first().unwrap_or(&self.verdict)
    }

    /// A row of the confusion matrix; cases with several hidden effects have none.
    pub fn asked(&self) -> Option<String> {
        match self.kind {
            Kind::None => Some("none".to_owned()),
            Kind::Single => self.hidden.first().cloned(),
            Kind::LeftOut => self.hidden.first().map(|h| format!("{h} (left out)")),
            Kind::Several => None,
        }
    }
}

fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "no_gap",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly_explained",
        Verdict::UnknownEffect => "unknown_effect",
        Verdict::Undetermined => "undetermined",
    }
}

/// Every number of one hidden effect that was found.
fn parameters(truth: &Value, report: &Report) -> Vec<ParameterScore> {
    let name = truth["name"].as_str().unwrap_or_default();
    let Some(found) = report.effects.iter().find(|e| e.name == name) else { return Vec::new() };
    let mut scores = Vec::new();
    for (parameter, true_value) in truth.as_object().into_iter().flatten() {
        let Some(fitted) = found.parameters.get(parameter) else { continue };
        let full_name = format!("{name}.{parameter}");
        let interval = fitted.ci95.clone().unwrap_or(Value::Null);
        if let (Some(truths), Some(values)) = (true_value.as_array(), fitted.value.as_array()) {
            for (i, (t, v)) in truths.iter().zip(values).enumerate() {
                scores.extend(number(format!("{full_name}[{i}]"), t, v, &interval[i]));
            }
        } else {
            scores.extend(number(full_name, true_value, &fitted.value, &interval));
        }
    }
    scores
}

fn number(name: String, truth: &Value, value: &Value, interval: &Value) -> Option<ParameterScore> {
    let (truth, value) = (truth.as_f64()?, value.as_f64()?);
    let ends = interval[0].as_f64().zip(interval[1].as_f64());
    Some(ParameterScore {
        name,
        truth,
        value,
        relative_error: (value - truth).abs() / truth.abs().max(1e-12),
        covered: ends.map(|(from, to)| from <= truth && truth <= to),
        half_width: ends.map(|(from, to)| 0.5 * (to - from)),
    })
}

/// Right answers among those asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// Right ones.
    pub right: usize,
    /// All.
    pub of: usize,
}

impl Tally {
    fn add(&mut self, right: bool) {
        self.right += usize::from(right);
        self.of += 1;
    }
}

/// Cases of one group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Group {
    /// Exact sets.
    pub exact_set: Tally,
    /// Intervals that hold the truth.
    pub coverage: Tally,
}

impl Group {
    fn add(&mut self, score: &CaseScore) {
        self.exact_set.add(score.exact);
        score.parameters.iter().filter_map(|p| p.covered).for_each(|covered| self.coverage.add(covered));
    }
}

/// The groups that a set of hidden effects belongs to, told by what the effects do.
fn groups(hidden: &[String]) -> Vec<&'static str> {
    let all: Vec<_> = hidden.iter().filter_map(|name| shutterbug::effects::by_id(name)).collect();
    let any = |of: fn(&dyn Effect) -> bool| all.iter().any(|e| of(*e));
    let is_noise = |e: &&&dyn Effect| e.moments().is_noise();
    let behind_encoding: fn(&dyn Effect) -> bool = |e| {
        matches!(e.stage(), Stage::Pixel(Domain::EncodedRgb, _)) && !matches!(e.work(), Work::Pointwise(_))
    };
    let colours: fn(&dyn Effect) -> bool = |e| {
        matches!(e.stage(), Stage::Pixel(..))
            && matches!(e.work(), Work::Pointwise(_))
            && !e.moments().is_noise()
    };
    let groups = [
        ("noise alone", !all.is_empty() && all.iter().filter(is_noise).count() == all.len()),
        ("compression and filters", any(behind_encoding)),
        ("geometry", any(|e| !matches!(e.stage(), Stage::Pixel(..)))),
        ("colours", any(colours)),
        ("sets of four and five", all.len() >= 4),
    ];
    groups.into_iter().filter(|g| g.1).map(|g| g.0).collect()
}

/// The table over all cases.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Diagnosed cases, and those that ended with an error.
    pub cases: usize,
    /// See `cases`.
    pub failed: usize,
    /// First name right, by what was asked: "single", "several".
    pub first_named: BTreeMap<String, Tally>,
    /// Exact set right, likewise.
    pub exact_set: BTreeMap<String, Tally>,
    /// The same, with sets that the report itself says these frames do not tell from the hidden one.
    #[serde(default)]
    pub exact_or_alike: BTreeMap<String, Tally>,
    /// Captures with nothing hidden in which something was named.
    pub false_alarms: Tally,
    /// `unknown_effect` said where the hidden effect was taken out of the candidates.
    pub unknown_said: Tally,
    /// Rows: what was hidden; columns: what was said; numbers of cases.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// By effect: how often it was found where it was hidden and could be named.
    pub found: BTreeMap<String, Tally>,
    /// How often an effect was named that was not hidden (cases with nothing left out).
    pub named_wrongly: BTreeMap<String, usize>,
    /// By what was hidden (a set may be of several groups).
    #[serde(default)]
    pub groups: BTreeMap<String, Group>,
    /// By gap before (DN, upper edges 0.5, 1, 2, 4, 8, 16 and all above): single effects found.
    pub found_by_gap: BTreeMap<String, Tally>,
    /// By parameter: median relative error and number of values.
    pub median_error: BTreeMap<String, (f64, usize)>,
    /// Intervals that hold the truth.
    pub coverage: Tally,
    /// By name: how often an error of the description was named where it was made.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub description_found: BTreeMap<String, Tally>,
    /// How often one was named that was not made.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub description_wrongly: BTreeMap<String, usize>,
    /// Median, over single and several, of the closed fraction over that of the true parameters.
    pub closed_to_truth_median: Option<f64>,
    /// Median time of a diagnosis, s.
    pub seconds_median: Option<f64>,
}

impl Summary {
    /// Over these cases. An error counts as a wrong answer.
    pub fn of(scores: &[CaseScore]) -> Self {
        let mut s = Self { cases: scores.len(), ..Self::default() };
        let mut errors: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let mut ratios = Vec::new();
        for score in scores {
            s.failed += usize::from(score.verdict == "failed");
            match score.kind {
                Kind::None => s.false_alarms.add(!score.found.is_empty()),
                Kind::LeftOut => s.unknown_said.add(score.exact),
                Kind::Single | Kind::Several => {
                    let kind = if score.kind == Kind::Single { "single" } else { "several" };
                    s.first_named.entry(kind.to_owned()).or_default().add(score.first_right);
                    s.exact_set.entry(kind.to_owned()).or_default().add(score.exact);
                    s.exact_or_alike.entry(kind.to_owned()).or_default().add(score.exact_or_alike);
                    for name in groups(&score.hidden) {
                        s.groups.entry(name.to_owned()).or_default().add(score);
                    }
                    for name in &score.hidden {
                        s.found.entry(name.clone()).or_default().add(score.found.contains(name));
                    }
                    ratios.extend(score.closed_by_truth.filter(|t| *t > 0.05).map(|t| score.closed / t));
                }
            }
            if score.kind == Kind::Single {
                let found = score.found.contains(&score.hidden[0]);
                s.found_by_gap.entry(gap_bin(score.gap[0])).or_default().add(found);
            }
            if score.kind != Kind::LeftOut {
                for name in score.found.iter().filter(|f| !score.hidden.contains(f)) {
                    *s.named_wrongly.entry(name.clone()).or_default() += 1;
                }
            }
            for name in &score.falsified {
                let right = score.described.contains(name);
                s.description_found.entry(name.clone()).or_default().add(right);
            }
            for name in score.described.iter().filter(|d| !score.falsified.contains(d)) {
                *s.description_wrongly.entry(name.clone()).or_default() += 1;
            }
            if let Some(asked) = score.asked() {
                *s.confusion.entry(asked).or_default().entry(score.said().to_owned()).or_default() += 1;
            }
            for p in &score.parameters {
                errors.entry(p.name.clone()).or_default().push(p.relative_error);
                if let Some(covered) = p.covered {
                    s.coverage.add(covered);
                }
            }
        }
        s.median_error =
            errors.into_iter().map(|(k, v)| (k, (median(&v).unwrap_or(f64::NAN), v.len()))).collect();
        s.closed_to_truth_median = median(&ratios);
        s.seconds_median = median(&scores.iter().map(|c| c.seconds).filter(|t| *t > 0.0).collect::<Vec<_>>());
        s
    }
}

/// Sorted by text as by size.
fn gap_bin(gap_dn: f64) -> String {
    let edges = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
    let from = edges.iter().rev().find(|e| gap_dn >= **e);
    match (from, from.and_then(|f| edges.iter().find(|e| *e > f))) {
        (Some(from), Some(to)) => format!("{from:04.1} to {to:04.1} DN"),
        (Some(from), None) => format!("{from:04.1} DN and more"),
        (None, _) => "unknown".to_owned(),
    }
}

fn median(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]))
}
