//! Two folders that show different moments: what the camera leaves in every picture, whatever it shows, is compared.
//!
//! ```text
//! real frames ─ marks ─────────────────────────────┐
//! simulated frames ─ effects put on them ─ marks ──┴─ distance ─ choice of effects ─ Report
//! ```
//!
//! Marks are noise by brightness, its correlation between neighbours, noise of rows and columns, the width of the
//! sharpest edges, and the places of red and blue. What compression, chroma subsampling or a converter of few bits does
//! can be read from the real frames alone. Brightness, colours, shading and vignetting may be content and are never
//! named; lens, pose, readout and exposure time cannot be known from frames that are not paired.

mod bounds;
mod choose;
mod clock;
mod drawn;
mod fingerprint;
mod marked;
mod marks;
mod outcome;
mod own;
mod simulated;
mod unnamed;

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::evidence::{Evidence, LEAST_SIDE_PX, useless};
use crate::diagnose::expect::model::{Theta, candidate_of};
use crate::diagnose::expect::options::{DiagnoseOptions, Progress, candidates};
use crate::diagnose::expect::pair::{
    Pair, copies, linear_of, notes_of_kind, of_other_formats, one_a_name, pictures,
};
use crate::diagnose::judge::{closed_fraction, quantile};
use crate::diagnose::report::Report;
use crate::diagnose::search::decide::NAMED;
use choose::{Chosen, choose};
use clock::Clock;
use fingerprint::{Fingerprint, apart, distance};
use marks::BINS;
use shutterbug::capture::CameraFile;
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::Limit;
use shutterbug::plane::{Plane, read_rgb8};
use simulated::Simulated;

/// Fewest frames a folder: three to fit and three to judge, or nobody knows how much frames differ.
const FEWEST_FRAMES: usize = 6;
/// Most frames of a folder that are looked at.
const MOST_FRAMES: usize = 24;
/// How long a distance of the user's own may take at the end, over what it took at the beginning.
const AGAIN: f64 = 1.5;
/// Most pixels of the frames of a folder that are looked at: marks are means, and memory is not endless.
const MOST_PX: usize = 60_000_000;

/// Frames of a folder: every other one to fit, the rest to judge.
struct Folder {
    names: Vec<String>,
    /// Columns and rows of the first, px.
    size: [u32; 2],
    fit: Vec<usize>,
    held: Vec<usize>,
    /// Pictures that are copies of others. They are left out where enough remain.
    copies: usize,
}

impl Folder {
    /// # Errors
    /// Too few pictures.
    fn list(path: &Path) -> Result<Self> {
        Self::of(path, pictures(path)?, 0)
    }

    /// Of real frames, without copies of others.
    ///
    /// # Errors
    /// Too few pictures.
    fn list_real(path: &Path) -> Result<Self> {
        let all = pictures(path)?;
        let mut seen = HashSet::new();
        let mut kept = Vec::new();
        for name in &all {
            let mut hasher = DefaultHasher::new();
            shutterbug::files::read(&path.join(name), Limit::PICTURE)?.hash(&mut hasher);
            if seen.insert(hasher.finish()) {
                kept.push(name.clone());
            }
        }
        let copies = all.len() - kept.len();
        Self::of(path, if kept.len() < FEWEST_FRAMES { all } else { kept }, copies)
    }

    /// In copies of one frame noise stays where it is, as a sensor's pattern does.
    ///
    /// # Errors
    /// Too few pictures that differ.
    fn check_copies(&self, path: &Path) -> Result<()> {
        let differ = self.names.len().saturating_sub(self.copies);
        if self.copies == 0 || differ >= FEWEST_FRAMES {
            return Ok(());
        }
        let differ = counted(differ, "picture that differs", "pictures that differ");
        let found = format!("{differ} from the others among {}", self.names.len());
        let expected = format!("at least {FEWEST_FRAMES}: in copies of a frame noise looks like a pattern");
        Err(Error::input(path, None, found, expected))
    }

    fn of(path: &Path, all: Vec<String>, copies: usize) -> Result<Self> {
        one_a_name(path, &all)?;
        if all.len() < FEWEST_FRAMES {
            let found = counted(all.len(), "picture", "pictures");
            let expected = format!("at least {FEWEST_FRAMES}: half of them are kept to judge by");
            return Err(Error::input(path, None, found, expected));
        }
        let first = read_rgb8(&path.join(&all[0]))?;
        if first.width.min(first.height) < LEAST_SIDE_PX as usize {
            let found = format!("a picture of {}x{} px", first.width, first.height);
            let expected = format!("at least {LEAST_SIDE_PX} px a side, or nothing can be told apart");
            return Err(Error::input(&path.join(&all[0]), None, found, expected));
        }
        let most = (MOST_PX / (first.width * first.height).max(1)).clamp(FEWEST_FRAMES, MOST_FRAMES);
        let count = all.len().min(most);
        let names: Vec<String> = (0..count).map(|i| all[i * all.len() / count].clone()).collect();
        let (fit, held) = (0..count).partition(|i| i % 2 == 0);
        Ok(Self { names, size: [first.width as u32, first.height as u32], fit, held, copies })
    }
}

/// What a reader should know of the files of two folders.
fn notes_of((sim, sims): (&Path, &Folder), (real, reals): (&Path, &Folder)) -> Result<Vec<String>> {
    let mut notes = notes_of_kind(sim, &sims.names[0])?;
    notes.extend(notes_of_kind(real, &reals.names[0])?);
    notes.extend(other_size(sims, reals));
    notes.extend(of_other_formats(sim)?.into_iter().chain(of_other_formats(real)?));
    let both = |name: &&String| reals.names.binary_search(*name).is_ok();
    let both: Vec<[&str; 2]> = sims.names.iter().filter(both).map(|n| [&n[..]; 2]).collect();
    notes.extend(copies(sim, real, &both)?);
    if reals.copies > 0 {
        let were =
            counted(reals.copies, "real picture is a copy of another", "real pictures are copies of others");
        notes.push(format!("{were}, byte for byte, and left out"));
    }
    Ok(notes)
}

/// A finished comparison.
pub struct Unpaired {
    /// What was found.
    pub report: Report,
    /// The simulator's camera with the effects found.
    pub camera: CameraFile,
    shown: Vec<outcome::Shown>,
}

/// All frames that are compared.
struct Frames {
    real: Vec<Arc<Plane<f32>>>,
    simulated: Simulated,
}

/// Frames that no fit has seen, with the marks of the real ones.
struct Unseen {
    frames: Frames,
    marks: Fingerprint,
    /// Variance that the compression found may leave or take, DN^2.
    packed_dn2: f64,
}

impl Unseen {
    fn new(frames: Frames, found: &Theta) -> Self {
        let packed_dn2 = simulated::packed_dn2(found);
        Self { marks: Fingerprint::of(&frames.real, packed_dn2), frames, packed_dn2 }
    }

    /// By mark, how far the simulated frames with some effects lie from the real ones; and these frames, DN.
    fn beside(&self, theta: &Theta) -> (Vec<Option<f64>>, Vec<Plane<f32>>) {
        let frames = self.frames.simulated.delivered(theta, 2);
        (apart(&self.marks, &Fingerprint::of(&frames, self.packed_dn2)), frames)
    }

    /// The same over all marks, standard errors.
    fn distance(&self, theta: &Theta) -> f64 {
        distance(&self.beside(theta).0)
    }

    /// Gives up effects that these frames speak against. Without time the verdict is open, and what is named all the
    /// same must bring these frames nearer.
    fn deny(&self, chosen: &mut Chosen, clock: &Clock) {
        if clock.is_late() {
            chosen.deny_at_once(|theta| self.distance(theta));
        } else {
            chosen.deny(|theta| self.distance(theta));
            while let Some(name) = self.spoils(chosen) {
                chosen.give_up(name);
            }
            if !chosen.set.is_empty() && self.resembles(chosen) {
                chosen.give_up_all();
            }
        }
    }

    /// Whether effects explain so little of what the traces differ by that they only resemble what is missing.
    fn resembles(&self, chosen: &Chosen) -> bool {
        let without = chosen.without_all();
        let after = self.beside(&chosen.theta).0;
        let closed = closed_fraction(self.distance(&without), distance(&after), outcome::BY_CHANCE);
        !outcome::left(&after).is_empty() && closed < NAMED[1]
    }

    /// An effect that makes the folders differ in something that they do not differ in without it: what is missing is
    /// something else then, which it only resembles in other marks.
    fn spoils(&self, chosen: &Chosen) -> Option<&'static str> {
        let seen = |theta: &Theta| {
            let (marks, frames) = self.beside(theta);
            (worst(&marks), unnamed::differences(&self.frames.real, &frames).len())
        };
        let limit = quantile(2 * self.marks.0.len());
        // With no effect there is nothing to measure for.
        chosen.set.first()?;
        let with = seen(&chosen.theta);
        chosen.set.iter().copied().find(|name| {
            let without = seen(&chosen.theta.without(candidate_of(name)));
            let differ = |(with, without): (&f64, &f64)| *with > limit && *without <= limit;
            with.0.iter().zip(&without.0).any(differ) || with.1 > without.1
        })
    }
}

/// How far apart folders are at most by kind of mark, standard errors: noise by brightness is of one kind.
fn worst(marks: &[Option<f64>]) -> Vec<f64> {
    let size = |z: &Option<f64>| z.map_or(0.0, f64::abs);
    let by_brightness = marks[..BINS].iter().map(size).fold(0.0, f64::max);
    std::iter::once(by_brightness).chain(marks[BINS..].iter().map(size)).collect()
}

/// Compares two folders that show different moments. No device is needed.
///
/// # Errors
/// Folders without enough pictures, pictures that cannot be read, names in `without` that are no candidate's.
pub fn diagnose_unpaired(
    sim: &Path,
    real: &Path,
    options: &DiagnoseOptions,
    progress: &mut dyn Progress,
) -> Result<Unpaired> {
    let begun = options.begun.unwrap_or_else(Instant::now);
    let budget = Budget::new(begun, options.time_limit);
    let names = candidates(options)?;
    let own = options.distance.as_deref().map(own::Own::parse).transpose()?;
    let (sims, reals) = (Folder::list(sim)?, Folder::list_real(real)?);
    let mut notes = notes_of((sim, &sims), (real, &reals))?;
    let mut camera = Pair::camera_of(sim, None, sims.size, &mut notes)?;
    progress.step("reading", "both folders", 1, 1);
    let fit = read(sim, (&sims, &sims.fit), real, (&reals, &reals.fit), camera.linear, &budget)?;
    let held = read(sim, (&sims, &sims.held), real, (&reals, &reals.held), camera.linear, &budget)?;
    reals.check_copies(real)?;
    let limits = own::Limits { budget: &budget, stop: options.stop.as_ref() };
    let begin = |own: own::Own| {
        progress.step("distance", "of the user's own", 1, 1);
        own.begin((sim, &sims), (real, &reals), camera.linear, &limits)
    };
    let own = own.map(begin).transpose()?;
    budget.go_on()?;
    let evidence = Evidence::of_frames(fit.real.iter().chain(&held.real).cloned());
    let shown = crate::diagnose::search::shown::Shown::in_frames(&evidence, &names, &Theta::neutral());
    budget.go_on()?;
    let (base, read_off) = shown.put(&Theta::neutral());
    let (marks, marks_took) = measured(&fit.real, simulated::packed_dn2(&base), &budget)?;
    let steps = simulated::NAMES.len();
    let mut step = 0;
    // As long again as the user's command took is left for it.
    let took = own.as_ref().map_or(Duration::ZERO, |o| o.took.mul_f64(AGAIN));
    let mut clock = Clock::new(Budget::new(begun, options.time_limit.map(|l| l.saturating_sub(took))));
    // The same of simulated frames takes longer, as effects are put on them.
    clock.has_measured(marks_took)?;
    let mut chosen = choose(&marks, &fit.simulated, &base, &names, &mut clock, |name| {
        if options.stop.as_ref().is_some_and(|s| s.load(Ordering::Relaxed)) {
            let at = format!("effects that leave marks, {name}");
            return Err(Error::DiagnosisInterrupted { at, kept: None });
        }
        progress.step("effects that leave marks", name, step % steps + 1, steps);
        step += 1;
        Ok(())
    })?;
    let held = Unseen::new(held, &chosen.theta);
    held.deny(&mut chosen, &clock);
    let what = outcome::What { held: &held, read_off: &read_off, chosen: &chosen, names: &names };
    let (mut report, shown) = outcome::report(&what, (&sims, &reals), notes);
    report.input.capture = format!("{} beside {}", sim.display(), real.display());
    report.input.seed = options.seed;
    report.input.seconds = begun.elapsed().as_secs_f64();
    if let Some(own) = own {
        own.tell((sim, &sims), camera.linear, &chosen, &limits, &mut report)?;
    }
    let set: Vec<&'static str> = read_off.iter().chain(&chosen.set).copied().collect();
    crate::diagnose::expect::settings::apply(&mut camera.settings, &chosen.theta, &set)?;
    Ok(Unpaired { report, camera, shown })
}

/// Said where the folders' pictures are of different sizes.
fn other_size(sims: &Folder, reals: &Folder) -> Option<String> {
    let ([w, h], [of_w, of_h]) = (reals.size, sims.size);
    (reals.size != sims.size).then(|| {
        format!(
            "the real frames are of {w}x{h} px, the simulated ones of {of_w}x{of_h} px: what is measured in px is \
            compared as it is"
        )
    })
}

/// The marks of frames, and what measuring them took. That of one frame tells whether there is time for all.
///
/// # Errors
/// No time is left.
fn measured(frames: &[Arc<Plane<f32>>], packed_dn2: f64, budget: &Budget) -> Result<(Fingerprint, Duration)> {
    if budget.is_limited() {
        let begun = Instant::now();
        Fingerprint::of(&frames[..1], packed_dn2);
        let rounds = frames.len().div_ceil(rayon::current_num_threads());
        budget.go_on_for(rounds as f64 * begun.elapsed().as_secs_f64())?;
    }
    let begun = Instant::now();
    let marks = Fingerprint::of(frames, packed_dn2);
    Ok((marks, begun.elapsed()))
}

fn read(
    sim: &Path,
    (sims, of_sim): (&Folder, &[usize]),
    real: &Path,
    (reals, of_real): (&Folder, &[usize]),
    linear: bool,
    budget: &Budget,
) -> Result<Frames> {
    let dn = |i: &usize| -> Result<Arc<Plane<f32>>> {
        budget.go_on()?;
        let path = real.join(&reals.names[*i]);
        let picture = read_rgb8(&path)?;
        if let Some(why) = useless(&picture) {
            let expected = "pictures that show what a camera leaves in them; take this one away";
            return Err(Error::input(&path, None, format!("a picture that is {why}"), expected));
        }
        Ok(Arc::new(picture.to_f32()))
    };
    let radiance = |i: &usize| -> Result<Plane<f32>> {
        budget.go_on()?;
        radiance_of(&sim.join(&sims.names[*i]), linear)
    };
    let simulated = Simulated(of_sim.iter().map(radiance).collect::<Result<_>>()?);
    Ok(Frames { real: of_real.iter().map(dn).collect::<Result<_>>()?, simulated })
}

/// Linear radiance of a simulated frame, covered all over, shape `[height, width, 4]`.
fn radiance_of(path: &Path, linear: bool) -> Result<Plane<f32>> {
    let plane = linear_of(path, linear)?;
    let data = plane.data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 1.0]).collect();
    Ok(Plane { channels: 4, data, ..plane })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_not_begun_without_time_for_them() {
        let frames: Vec<_> = (0..4)
            .map(|k| Arc::new(Plane::from_fn(64, 48, |x, y| [((x * y + k) % 200) as f32; 3])))
            .collect();
        let begun =
            Instant::now().checked_sub(Duration::from_secs(30)).expect("the clock has run for so long");
        let late = Budget::new(begun, Some(Duration::from_secs(20)));
        assert!(matches!(measured(&frames, 0.0, &late), Err(Error::OutOfTime { .. })));
        let early = Budget::new(Instant::now(), Some(Duration::from_secs(600)));
        measured(&frames, 0.0, &early).expect("control");
    }
}
