//! What is wrong with a capture rather than with its camera: frames that are mirrored, in another order, linear, of
//! another scene. None of these is a camera effect, yet a search finds effects that do a part of it. So these are
//! looked for before, on small pictures of every real frame and of its simulation, and said first.

mod geometry;
pub(super) mod noise;
mod order;
mod poses;
mod thumbs;
mod values;

use super::describe::listed;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::options::DiagnoseOptions;
use crate::diagnose::expect::pair::{Geometry, Pair, encoded};
use crate::diagnose::report::{Report, Verdict};
use crate::diagnose::search::found::Found;
use crate::diagnose::search::odd::Odd;
use shutterbug::capture::Capture;
use shutterbug::error::Result;
use shutterbug::plane::stats::median;
use shutterbug::plane::{Plane, read_rgb8};
use thumbs::Thumb;

/// Real and simulated frames, small, by place in the evidence.
struct Pairs {
    real: Vec<Thumb>,
    simulated: Vec<Thumb>,
    /// Place in `frames.csv` of each.
    indices: Vec<usize>,
}

impl Pairs {
    /// Median over the frames of what a real and a simulated one give.
    fn median(&self, of: impl Fn(&Thumb, &Thumb) -> f64) -> f64 {
        median(self.real.iter().zip(&self.simulated).map(|(r, s)| of(r, s)))
    }

    /// How unlike the frames are, whatever their brightness: 0 alike, 1 nothing in common, 2 negatives.
    fn unlike(&self, change: impl Fn(&Thumb) -> Thumb) -> f64 {
        self.median(|r, s| r.unlike(&change(s)))
    }
}

/// Looks at every frame of the evidence; `simulated` are the same frames as the given camera makes them, DN. A sentence
/// for each thing that is wrong.
///
/// `poses`: asked of how unlike the frames are, where nothing else explains that.
fn set_up(
    evidence: &Evidence,
    simulated: &[Plane<f32>],
    poses: impl FnOnce(f64) -> Result<Option<String>>,
) -> Result<Vec<String>> {
    let small = |planes: Vec<&Plane<f32>>| planes.into_iter().map(Thumb::of).collect();
    let pairs = Pairs {
        real: small(evidence.frames.iter().map(|f| &*f.dn).collect()),
        simulated: small(simulated.iter().collect()),
        indices: evidence.frames.iter().map(|f| f.index).collect(),
    };
    let mut said = Vec::new();
    said.extend(geometry::bars(&pairs));
    said.extend(values::grey(&pairs));
    // Each of these explains the same difference in its own way: the first that does.
    let place =
        geometry::turned(&pairs).or_else(|| order::order(&pairs)).or_else(|| geometry::zoomed(&pairs));
    said.extend(match place {
        Some(place) => Some(place),
        None => poses(pairs.unlike(Thumb::clone))?,
    });
    said.extend(values::coded(&pairs));
    said.extend(order::strangers(&pairs));
    said.extend(order::repeated(&pairs, evidence));
    Ok(said)
}

/// Renders every frame of the evidence as the given camera makes it, and looks.
///
/// # Errors
/// Those of rendering.
pub(crate) fn look(
    forward: &mut Forward,
    capture: &Capture,
    evidence: &Evidence,
    given: &Theta,
) -> Result<Vec<String>> {
    let all: Vec<usize> = (0..evidence.frames.len()).collect();
    let simulated = forward.simulate(&all, given, Quality::Coarse)?;
    set_up(evidence, &simulated, |as_is| poses::convention(forward, capture, evidence, (given, as_is)))
}

/// Said of pairs that are compared as folders of one camera each.
const NO_ONE_PLACE: &str =
    "the frames that go together do not show the same place: the folders are compared as with --unpaired";
/// Pairs of frames that are looked at where no place of one was found in the other.
const PAIRS: usize = 8;

/// Why two folders of pictures alone are not compared as pairs: they do not show the same place, and how they lie
/// then, a sentence for each. Nothing where they can be compared.
///
/// # Errors
/// Real frames that cannot be read. [`shutterbug::error::Error::OutOfTime`].
pub fn no_one_place(pair: &Pair, options: &DiagnoseOptions) -> Result<Vec<String>> {
    if pair.sim.geometry != Geometry::None {
        return Ok(Vec::new());
    }
    let (mut real, mut simulated) = (Vec::new(), Vec::new());
    let count = pair.sim.frames.len();
    let places: Vec<usize> = (0..count.min(PAIRS)).map(|k| k * count / count.min(PAIRS)).collect();
    for &i in &places {
        real.push(Thumb::of(&read_rgb8(&pair.real.join(&pair.capture.frames[i].filename))?.to_f32()));
        simulated.push(Thumb::of(&encoded(&pair.sim.frames[i].radiance)));
    }
    let pairs = Pairs { real, simulated, indices: places };
    let negative = (pairs.unlike(Thumb::clone) > 2.0 - geometry::UNLIKE)
        .then(|| "the real frames look like negatives of the simulated ones".to_owned());
    // A pattern that repeats lies on itself in many ways.
    let otherwise = negative.or_else(|| geometry::turned(&pairs));
    if otherwise.is_none() && pair.shows_one_place(options)? {
        return Ok(Vec::new());
    }
    let lies = otherwise.or_else(|| geometry::zoomed(&pairs));
    Ok(std::iter::once(NO_ONE_PLACE.to_owned()).chain(lies).chain(geometry::bars(&pairs)).collect())
}

/// Puts what was found first in the report, and says what was not looked at: frames in neither half, and effects for
/// which no time was left. `odd`: the frames that stand apart, if there was time to look.
pub(crate) fn begin(
    report: &mut Report,
    said: &[String],
    evidence: &Evidence,
    (found, odd): (&Found, Option<Option<Odd>>),
) {
    if !found.is_whole() && (report.verdict != Verdict::NoGap || !found.is_checked()) {
        (report.verdict, report.sentence) = (Verdict::Undetermined, cut_short(report, found));
    }
    let is_compared = odd.is_some();
    let apart = odd.flatten().map(|odd| order::apart(&odd, evidence));
    let said: Vec<String> = said.iter().cloned().chain(apart).collect();
    if let Some(first) = said.first() {
        if report.verdict == Verdict::NoGap {
            report.verdict = Verdict::Undetermined;
        }
        let lead = "Look at the set-up before anything else";
        report.sentence =
            format!("{lead}: {first}. What follows takes the frames as they are. {}", report.sentence);
    }
    let unseen = unseen(evidence, is_compared);
    report.warnings.splice(0..0, said.into_iter().chain(unseen));
}

/// What is said where the time limit came before the search had ended.
fn cut_short(report: &Report, found: &Found) -> String {
    let late = &found.late[..];
    let named: Vec<_> = report.effects.iter().map(|e| e.name.replace('_', " ")).collect();
    let so_far = match named.as_slice() {
        [] => String::new(),
        _ => format!(
            " So far {} would close {:.0} % of that.",
            listed(&named),
            100.0 * report.gap.closed_fraction
        ),
    };
    let names = listed(&late.iter().map(|n| n.replace('_', " ")).collect::<Vec<_>>());
    let unseen = match late {
        [] => String::new(),
        _ => format!(" {names} were not looked at, and nothing is said of them."),
    };
    let rendered = if found.is_coarse() { " in a coarse comparison, which is off by itself" } else { "" };
    format!(
        "The frames differ by {:.2} DN{rendered}, and the time limit came before the search had ended.{so_far}{unseen} \
         Run again with a longer --time-limit-s.",
        report.gap.before
    )
}

/// Frames that neither a fit nor a judgement has seen. `is_compared`: each was compared with what was found, though.
fn unseen(evidence: &Evidence, is_compared: bool) -> Option<String> {
    let seen =
        |at: &usize| [&evidence.fit, &evidence.choose, &evidence.report].iter().any(|set| set.contains(at));
    let places: Vec<usize> = (0..evidence.frames.len()).filter(|at| !seen(at)).collect();
    if places.is_empty() {
        return None;
    }
    let names = order::listed(places.iter().map(|&at| evidence.frames[at].index));
    let how = match is_compared {
        true => "with what was found, to see whether they are like the others",
        false => "at a small size, to see whether they show this scene at their time",
    };
    Some(format!(
        "frames {names} were only compared {how}: fits and figures are of {} others",
        evidence.frames.len() - places.len()
    ))
}

#[cfg(test)]
mod tests;
