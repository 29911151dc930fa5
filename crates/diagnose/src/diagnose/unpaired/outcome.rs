//! What a comparison of two folders says: distance of their marks before and after, effects with shares, and what such
//! frames cannot tell.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use super::bounds::ShowsFrom;
use super::choose::{NOISES, noise_is_seen};
use super::fingerprint::{Fingerprint, distance};
use super::marks::{BINS, bin_dn, name};
use super::simulated::packed_dn2;
use super::unnamed;
use super::{Chosen, Folder, Frames, Unpaired, Unseen};
use crate::diagnose::expect::model::{Theta, candidate_of};
use crate::diagnose::expect::options::changes_places;
use crate::diagnose::judge::quantile;
use crate::diagnose::report::*;
use crate::diagnose::search::decide::RESEMBLED;
use crate::diagnose::tell::describe::{listed, undetermined, without_time};
use crate::diagnose::tell::output::{make_folders, write_five};
use shutterbug::error::Result;
use shutterbug::plane::stats::luma;
use shutterbug::plane::{Plane, write_atomic};

/// What the marks of two folders of one camera are apart, standard errors, root mean square.
pub(super) const BY_CHANCE: f64 = 1.0;
/// How many times grain is shown enlarged in contrast.
const GRAIN: f32 = 8.0;
/// Most frames with pictures.
const MOST_SHOWN: usize = 8;
/// What cannot be known from frames that are not paired.
const NEEDS_PAIRS: &str = "cannot be known from frames that are not paired";
/// What may be content.
const MAY_BE_CONTENT: &str = "what it does to brightness or colours may be what the frames show";

/// What compression hides.
const HIDDEN_BY_COMPRESSION: [&str; 5] =
    ["shot_noise", "row_noise", "read_noise", "chroma_subsampling", "quantization"];

/// Why they are not told of.
const NO_FLAT_PLACES: &str = "the folders have no flat places of like brightness";

/// Why noise that was found is not named.
const OTHER_NOISE: &str = "something like it is there, but neither its growth with brightness nor its likeness from \
    neighbour to neighbour fits";

/// Why what was found is not named.
const DENIED: &str =
    "found, but it makes the traces of frames that no fit has seen no more alike, or others less";

/// What was compared, and what came of it.
pub(super) struct What<'a> {
    pub held: &'a Unseen,
    /// Effects that the real frames show by themselves.
    pub read_off: &'a [&'static str],
    pub chosen: &'a Chosen,
    pub names: &'a [&'static str],
}

/// A frame's pictures.
pub(super) struct Shown {
    index: usize,
    filename: String,
    pictures: [Plane<f32>; 5],
    apart: [f64; 2],
}

impl What<'_> {
    /// Whether both folders have flat places of like brightness, in which noise can be compared.
    fn noise_seen(&self) -> bool {
        noise_is_seen(&self.chosen.counted)
    }

    /// All effects that were found.
    fn set(&self) -> Vec<&'static str> {
        self.read_off.iter().chain(&self.chosen.set).copied().collect()
    }
}

/// The report, and pictures of the held-out frames.
pub(super) fn report(
    what: &What<'_>,
    folders: (&Folder, &Folder),
    notes: Vec<String>,
) -> (Report, Vec<Shown>) {
    let (before, plain) = what.held.beside(&Theta::neutral());
    let (after, made) = what.held.beside(&what.chosen.theta);
    let gap = gap(&before, &after, what.held.frames.real.len());
    let set = what.set();
    let mut left = left(&after);
    left.extend(unnamed::differences(&what.held.frames.real, &made));
    if set.is_empty() && folders.0.size != folders.1.size {
        left.push("the size of their pictures".to_owned());
    }
    let verdict = match (set.is_empty(), left.is_empty()) {
        _ if !what.chosen.late.is_empty() => Verdict::Undetermined,
        (true, true) if !what.noise_seen() => Verdict::Undetermined,
        (true, true) => Verdict::NoGap,
        (false, true) => Verdict::Explained,
        (false, false) if gap.closed_fraction >= RESEMBLED => Verdict::PartlyExplained,
        (_, false) => Verdict::UnknownEffect,
    };
    let effects = effects(what, &gap);
    let shown = shown(what, folders.1, plain, made, [gap.before, gap.after]);
    let mut notes = notes;
    if !what.noise_seen() {
        notes.push(format!("noise could not be compared: {NO_FLAT_PLACES}"));
    }
    let report = Report {
        verdict,
        sentence: sentence(verdict, &gap, &effects, &left, &what.chosen.late),
        waterfall: Vec::new(),
        candidates: candidates(what, &gap),
        places: places(&before, &after, &what.held.marks),
        measures: Vec::new(),
        percepts: Percepts::default(),
        frames: Vec::new(),
        maps: Maps::default(),
        description: DescriptionShown::default(),
        input: input(&what.held.frames, folders.1),
        bootstrap: Bootstrap::default(),
        warnings: notes,
        next: Vec::new(),
        effects,
        gap,
    };
    (report, shown)
}

/// Which of the real frames were compared.
fn input(held: &Frames, real: &Folder) -> Input {
    let [first, ..] = &held.real[..] else { unreachable!("three frames at least are held out") };
    Input {
        kind: "unpaired".to_owned(),
        width: first.width as u32,
        height: first.height as u32,
        frames_listed: real.names.len(),
        fit_frames: real.fit.clone(),
        held_out_frames: real.held.clone(),
        compared_share: 1.0,
        device: "none: frames are given".to_owned(),
        method: "marks of frames that are not paired".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        alignment: Some(Alignment { kind: "none".to_owned(), rms_px: None }),
        ..Input::default()
    }
}

fn gap(before: &[Option<f64>], after: &[Option<f64>], held_out_frames: usize) -> Gap {
    let [b, a] = [before, after].map(distance);
    let best = b - a.min(BY_CHANCE);
    let closed = if b > a { (1.0 - (a - BY_CHANCE) / best).clamp(0.0, 1.0) } else { 0.0 };
    // The square of each mark is one draw.
    let scatter = |z: &[Option<f64>], distance: f64| {
        let n = z.iter().flatten().count().max(2) as f64;
        let square: f64 = z.iter().flatten().map(|z| (z * z - distance * distance).powi(2)).sum();
        (square / (n - 1.0) / n).sqrt() / (2.0 * distance).max(1e-9)
    };
    let around = |v: f64, z: &[Option<f64>]| [-1.96, 1.96].map(|k| (v + k * scatter(z, v)).max(0.0));
    let half = 1.96 * scatter(after, a) / best.max(scatter(before, b)).max(1e-9);
    Gap {
        unit: "standard errors".to_owned(),
        before: b,
        after: a,
        floor: BY_CHANCE,
        closed_fraction: closed,
        closed_fraction_ci95: [(closed - half).max(0.0), (closed + half).min(1.0)],
        held_out_frames,
        before_ci95: around(b, before),
        after_ci95: around(a, after),
        renderer_difference: BY_CHANCE,
    }
}

/// Marks that are further apart than chance makes any of them.
pub(super) fn left(after: &[Option<f64>]) -> Vec<String> {
    let limit = quantile(2 * after.len());
    let beyond = |(k, z): (usize, &Option<f64>)| z.is_some_and(|z| z.abs() > limit).then(|| name(k));
    after.iter().enumerate().filter_map(beyond).collect()
}

fn effects(what: &What<'_>, gap: &Gap) -> Vec<EffectFound> {
    let set = what.set();
    let theta = &what.chosen.theta;
    let without: Vec<f64> = set.iter().map(|n| what.held.distance(&theta.without(candidate_of(n)))).collect();
    let gains: Vec<f64> = without.iter().map(|w| (w - gap.after).max(1e-3)).collect();
    let total: f64 = gains.iter().sum();
    let one = |(i, name): (usize, &&'static str)| {
        let others = set.iter().filter(|n| n != &name);
        let alone = others.fold(theta.clone(), |t, n| t.without(candidate_of(n)));
        EffectFound {
            name: (*name).to_owned(),
            share: gains[i] / total,
            parameters: theta.report(candidate_of(name), &what.chosen.half),
            camera: true,
            gap_without: without[i],
            gap_with: gap.after,
            gap_alone: what.held.distance(&alone),
            gain_ci95: [gains[i]; 2],
            alternatives: Vec::new(),
            same_together: Together::new(),
            footage: String::new(),
        }
    };
    let mut out: Vec<EffectFound> = set.iter().enumerate().map(one).collect();
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    out
}

/// What became of the candidates that were not found.
fn candidates(what: &What<'_>, gap: &Gap) -> Vec<Candidate> {
    let (set, packed) = (what.set(), packed_dn2(&what.chosen.theta) > 0.0);
    let left_out = what.names.iter().filter(|n| !set.contains(n));
    let one = |n: &&'static str| {
        if packed && HIDDEN_BY_COMPRESSION.contains(n) {
            return undetermined(n, "compression hides it in the real frames", "frames without compression");
        }
        if !what.noise_seen() && NOISES.contains(n) {
            return undetermined(n, NO_FLAT_PLACES, "flat surfaces of like brightness in both folders");
        }
        if what.chosen.late.contains(n) {
            return without_time(n);
        }
        if what.chosen.denied.contains(n) {
            return rejected(n, DENIED, gap.after);
        }
        if what.chosen.withdrawn.contains(n) {
            return undetermined(n, OTHER_NOISE, "simulated frames of the same moments as the real ones");
        }
        if let Some(from) = what.chosen.shows_from.get(n) {
            return not_found(n, *from, gap);
        }
        if ["jpeg", "chroma_subsampling", "quantization"].contains(n) {
            return rejected(n, "the real frames do not show it", gap.after);
        }
        if changes_places(n) || candidate_of(n).needs_motion {
            return undetermined(
                n,
                NEEDS_PAIRS,
                "frames of both at the same moments, with depth/ and trajectory.tum or motion/",
            );
        }
        undetermined(n, MAY_BE_CONTENT, "simulated frames of the same moments as the real ones")
    };
    left_out.map(one).collect()
}

/// An effect that the marks could show, and did not.
fn not_found(name: &str, from: ShowsFrom, gap: &Gap) -> Candidate {
    let more = "more frames, or simulated frames of the same moments";
    match from {
        ShowsFrom::Visible => rejected(
            name,
            "put on the simulated frames it does not bring their traces nearer to the real ones",
            gap.after,
        ),
        ShowsFrom::Value(p, value) => {
            let (key, unit) = (p.spec().name, p.spec().unit);
            let why = format!("it would show from a {key} of {value:.4} {unit}").trim_end().to_owned();
            let why = why + " on, and does not";
            undetermined(name, &why, more)
        }
        ShowsFrom::Nowhere => undetermined(name, "these frames could not show it", more),
    }
}

fn rejected(name: &str, why: &str, gap_with: f64) -> Candidate {
    Candidate {
        name: name.to_owned(),
        state: CandidateState::Rejected,
        why: why.to_owned(),
        gap_with: Some(gap_with),
        parameters: BTreeMap::new(),
        footage: String::new(),
    }
}

/// By brightness: how far the noise of both folders is apart.
fn places(before: &[Option<f64>], after: &[Option<f64>], real: &Fingerprint) -> Where {
    let bin = |k: usize| {
        let (b, a, known) = (before[k]?, after[k]?, real.0[k]?);
        let [from, to] = bin_dn(k);
        let label = format!(
            "{from:.0} to {to:.0} DN: the real frames' noise is {:.2} DN",
            known.value.max(0.0).sqrt()
        );
        let (bias_before, bias_after) = (b, a);
        Some(Bin {
            from,
            to,
            label,
            before: b.abs(),
            after: a.abs(),
            bias_before,
            bias_after,
            weight: 1.0 / BINS as f64,
        })
    };
    let mut far: Vec<(f64, usize)> =
        before.iter().enumerate().filter_map(|(k, z)| Some((z.as_ref()?.abs(), k))).collect();
    far.sort_by(|a, b| b.0.total_cmp(&a.0));
    let limit = quantile(2 * before.len());
    let said =
        |&(z, k): &(f64, usize)| format!("The folders are {z:.1} standard errors apart in {}.", name(k));
    Where {
        summary: far.iter().filter(|f| f.0 > limit).take(3).map(said).collect(),
        by_intensity: (0..BINS).filter_map(bin).collect(),
        ..Where::default()
    }
}

fn sentence(
    verdict: Verdict,
    gap: &Gap,
    effects: &[EffectFound],
    left: &[String],
    late: &[&'static str],
) -> String {
    let names: Vec<String> = effects.iter().map(|e| e.name.replace('_', " ")).collect();
    let names = listed(&names);
    let rest = listed(left);
    match verdict {
        Verdict::NoGap => {
            "The traces that the camera leaves in every picture are alike in both folders; what needs \
            pairs is not known."
                .to_owned()
        }
        Verdict::Explained => format!(
            "The simulation lacks {names}: with that the traces in both folders are {:.1} standard errors apart, \
             before {:.1}.",
            gap.after, gap.before
        ),
        Verdict::PartlyExplained => format!(
            "The simulation lacks {names} (traces {:.1} standard errors apart, before {:.1}); they still differ in \
             {rest}.",
            gap.after, gap.before
        ),
        Verdict::UnknownEffect if !effects.is_empty() => format!(
            "The simulation lacks {names} (traces {:.1} standard errors apart, before {:.1}), which is not all: they \
             still differ in {rest}, and no known effect explains that.",
            gap.after, gap.before
        ),
        Verdict::UnknownEffect => format!("The folders differ in {rest}, and no known effect explains it."),
        Verdict::Undetermined if late.is_empty() => format!(
            "The traces that could be compared are alike in both folders; noise could not be, for {NO_FLAT_PLACES}."
        ),
        Verdict::Undetermined => {
            let so_far = match names.as_str() {
                "" => format!("The traces in both folders are {:.1} standard errors apart", gap.before),
                _ => format!(
                    "With {names} the traces in both folders are {:.1} standard errors apart, before {:.1}",
                    gap.after, gap.before
                ),
            };
            let late = listed(&late.iter().map(|n| n.replace('_', " ")).collect::<Vec<_>>());
            format!(
                "{so_far}, and the time limit came before the search had ended: {late} were not looked at, and \
                 nothing is said of them. Run again with a longer --time-limit-s."
            )
        }
    }
}

/// Pictures of the held-out frames; `plain` and `made` are the simulated ones without and with what was found.
fn shown(
    what: &What<'_>,
    reals: &Folder,
    plain: Vec<Plane<f32>>,
    made: Vec<Plane<f32>>,
    apart: [f64; 2],
) -> Vec<Shown> {
    let mut out = Vec::new();
    let held = reals.held.iter().zip(&what.held.frames.real).take(MOST_SHOWN);
    for (((&index, real), plain), made) in held.zip(plain).zip(made) {
        let (of_real, of_made) = (grain(real), grain(&made));
        let filename = reals.names[index].clone();
        out.push(Shown {
            index,
            filename,
            pictures: [(**real).clone(), plain, made, of_real, of_made],
            apart,
        });
    }
    out
}

/// What single values differ by from their neighbours, on middle grey.
fn grain(dn: &Plane<f32>) -> Plane<f32> {
    let (w, h) = (dn.width, dn.height);
    let at = |x: usize, y: usize| luma(dn.pixel(x.min(w - 1), y.min(h - 1)));
    Plane::from_fn(w, h, |x, y| {
        let around = at(x.saturating_sub(2), y) + at(x + 2, y) + at(x, y.saturating_sub(2)) + at(x, y + 2);
        [(128.0 + GRAIN * (at(x, y) - 0.25 * around)).clamp(0.0, 255.0); 3]
    })
}

impl Unpaired {
    /// Says why pairs were not compared as such, and, behind that, what is wrong with how they lie; nothing else is.
    pub fn instead_of_pairs(&mut self, said: &[String]) {
        let Some(why) = said.first() else { return };
        let report = &mut self.report;
        let wrong = said.get(1).map(|wrong| format!(" ({wrong})")).unwrap_or_default();
        report.sentence = format!("As pairs nothing is known: {why}{wrong}. {}", report.sentence);
        report.warnings.splice(0..0, said.iter().cloned());
        // Whether frames that were meant to show the same differ was not answered by their traces.
        if report.verdict == Verdict::NoGap {
            report.verdict = Verdict::Undetermined;
        }
    }

    /// Writes `camera.toml`, pictures and, last, `report.json` into a folder; returns the report with the pictures'
    /// paths.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(mut self, folder: &Path) -> Result<Report> {
        const KINDS: [&str; 5] = ["real", "simulated", "diagnosed", "grain_real", "grain_diagnosed"];
        make_folders(folder, KINDS)?;
        write_atomic(&folder.join("camera.toml"), self.camera.to_toml().as_bytes())?;
        let one = |f: &Shown| -> Result<FrameEntry> {
            let pictures = write_five(folder, KINDS, f.index, &f.pictures)?;
            let (filename, [before, after]) = (f.filename.clone(), f.apart);
            Ok(FrameEntry { index: f.index, filename, time_s: 0.0, held_out: true, before, after, pictures })
        };
        self.report.frames = self.shown.par_iter().map(one).collect::<Result<_>>()?;
        self.report.write(folder)?;
        Ok(self.report)
    }
}
