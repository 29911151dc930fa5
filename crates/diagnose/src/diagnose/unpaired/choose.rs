//! Which effects make the simulator's frames show the marks of the real ones: each is put on the simulated frames, and
//! their marks are measured again, so that whatever an effect does to a mark is in the comparison (rounding, encoding,
//! compression).

use std::collections::BTreeMap;
use std::time::Instant;

use super::bounds::{ShowsFrom, shows_from};
use super::clock::Clock;
use super::fingerprint::{Fingerprint, Known, apart, common, squares};
use super::marks::{BINS, EDGES, LINEAR, NEIGHBOURS, bin_dn};
use super::simulated::{EDGES_TELL, NAMES, Simulated, parameters};
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta, candidate_of, combinations};
use crate::diagnose::judge::quantile_of_length;
use shutterbug::error::Result;
use shutterbug::plane::srgb_decode;

/// Effects that are measured in flat places.
pub(super) const NOISES: [&str; 4] = ["shot_noise", "row_noise", "fixed_pattern_noise", "read_noise"];
/// Noise of single pixels: it shows at each brightness, and from neighbour to neighbour.
const OF_PIXELS: [&str; 3] = ["shot_noise", "fixed_pattern_noise", "read_noise"];
/// Steps of a fit.
const STEPS: usize = 6;
/// Part of a parameter by which its slope is measured.
const PART: f64 = 0.25;

/// What explains the marks.
pub(super) struct Chosen {
    pub theta: Theta,
    pub set: Vec<&'static str>,
    /// Half widths of 95 % intervals.
    pub half: BTreeMap<P, f64>,
    /// By mark: whether both folders have it.
    pub counted: Vec<bool>,
    /// Noise that was found, and is not like that of the real frames.
    pub withdrawn: Vec<&'static str>,
    /// What was found, and makes traces of frames that no fit has seen no more alike.
    pub denied: Vec<&'static str>,
    /// Of what was not found: from which strength on it would show.
    pub shows_from: BTreeMap<&'static str, ShowsFrom>,
    /// Candidates for which there was no time.
    pub late: Vec<&'static str>,
}

/// Nothing is chosen yet.
fn none() -> Chosen {
    Chosen {
        theta: Theta::neutral(),
        set: Vec::new(),
        half: BTreeMap::new(),
        counted: Vec::new(),
        withdrawn: Vec::new(),
        denied: Vec::new(),
        shows_from: BTreeMap::new(),
        late: Vec::new(),
    }
}

/// Chooses effects one by one for as long as the next makes marks agree better beyond chance.
///
/// # Errors
/// Those of `step`, which is told of every candidate.
pub(super) fn choose(
    real: &Fingerprint,
    simulated: &Simulated,
    base: &Theta,
    names: &[&'static str],
    clock: &mut Clock,
    mut step: impl FnMut(&'static str) -> Result<()>,
) -> Result<Chosen> {
    let mut chosen = Chosen { theta: base.clone(), ..none() };
    let begun = Instant::now();
    let plain = simulated.fingerprint(base);
    clock.has_measured(begun.elapsed())?;
    let clock = &*clock;
    let counted = common(real, &plain);
    // Without flat places in both, other traces would have to tell of noise alone, and content does.
    let seen = |n: &&'static str| noise_is_seen(&counted) || !NOISES.contains(n);
    let names: Vec<&'static str> = names.iter().copied().filter(seen).collect();
    let names = &names[..];
    let mut left = squares(&apart(real, &plain), &counted);
    let mut began = BTreeMap::new();
    let seen = Seen { real, simulated, counted: &counted, clock };
    while let Some((cost, name, theta)) = seen.next(&mut chosen, left, names, &mut began, &mut step)? {
        (left, chosen.theta) = (cost, theta);
        chosen.set.push(name);
        if !chosen.late.is_empty() {
            break;
        }
    }
    let mut made = simulated.fingerprint(&chosen.theta);
    if !noise_agrees(real, &made) {
        // Texture that is softer in one folder, in places that pass for flat, or noise of another kind.
        chosen.withdrawn = chosen.set.iter().copied().filter(|n| OF_PIXELS.contains(n)).collect();
        chosen.set.retain(|n| !OF_PIXELS.contains(n));
        chosen.theta = OF_PIXELS.into_iter().fold(chosen.theta, |theta, n| theta.without(candidate_of(n)));
        made = simulated.fingerprint(&chosen.theta);
    }
    tell(real, &plain, &made);
    let tried = || NAMES.iter().map(|(n, _)| *n).filter(|n| names.contains(n));
    let found = |n: &&'static str| chosen.set.contains(n) || chosen.withdrawn.contains(n);
    let not_found: Vec<&'static str> = tried().filter(|n| !found(n)).collect();
    let looked = (real, (simulated, &made), clock);
    chosen.shows_from = shows_from(looked, &chosen.theta, &counted, &not_found);
    // How strong it would have to be is part of what is said of it.
    let unseen =
        not_found.into_iter().filter(|n| !chosen.shows_from.contains_key(n) && !chosen.late.contains(n));
    let unseen: Vec<_> = unseen.collect();
    chosen.late.extend(unseen);
    chosen.late.retain(|n| !chosen.set.contains(n));
    chosen.counted = counted;
    if !clock.is_late() {
        chosen.half = half_widths(real, simulated, &chosen);
    }
    Ok(chosen)
}

/// Whether both folders have flat places of like brightness, in which noise can be compared.
pub(super) fn noise_is_seen(counted: &[bool]) -> bool {
    counted[..BINS].iter().any(|c| *c)
}

impl Chosen {
    /// Gives up effects that make the traces of frames which no fit has seen no more alike, the worst first.
    /// `distance`: what these traces are apart.
    pub(super) fn deny(&mut self, mut distance: impl FnMut(&Theta) -> f64) {
        while !self.set.is_empty() {
            let now = distance(&self.theta);
            let without = |n: &&'static str| (distance(&self.theta.without(candidate_of(n))), *n);
            let worst = self.set.iter().map(without).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, name)) = worst.filter(|w| w.0 <= now) else { break };
            self.give_up(name);
        }
    }

    /// The same where there is no time to go on after each: all effects that are useless beside the others, and the
    /// rest too if they bring nothing together.
    pub(super) fn deny_at_once(&mut self, mut distance: impl FnMut(&Theta) -> f64) {
        let now = distance(&self.theta);
        let is_useless = |n: &&'static str| distance(&self.theta.without(candidate_of(n))) <= now;
        let useless: Vec<&'static str> = self.set.iter().copied().filter(is_useless).collect();
        let mut left = now;
        if !useless.is_empty() {
            useless.into_iter().for_each(|name| self.give_up(name));
            left = distance(&self.theta);
        }
        if !self.set.is_empty() && distance(&self.without_all()) <= left {
            self.give_up_all();
        }
    }

    /// The camera without all effects.
    pub(super) fn without_all(&self) -> Theta {
        self.set.iter().fold(self.theta.clone(), |theta, n| theta.without(candidate_of(n)))
    }

    /// Gives up all effects.
    pub(super) fn give_up_all(&mut self) {
        self.set.clone().into_iter().for_each(|name| self.give_up(name));
    }

    /// Gives up an effect that frames which no fit has seen speak against.
    pub(super) fn give_up(&mut self, name: &'static str) {
        self.theta = self.theta.without(candidate_of(name));
        self.set.retain(|n| *n != name);
        self.denied.push(name);
    }
}

/// What a choice is made by.
struct Seen<'a> {
    real: &'a Fingerprint,
    simulated: &'a Simulated,
    counted: &'a [bool],
    clock: &'a Clock,
}

impl Seen<'_> {
    /// The candidate that explains most of what is `left`, if any does beyond chance: the sum of squares then, its
    /// name, and all parameters. `began` keeps where the fit of each began best at first: beside other effects it
    /// begins there again.
    fn next(
        &self,
        chosen: &mut Chosen,
        left: f64,
        names: &[&'static str],
        began: &mut BTreeMap<&'static str, f64>,
        step: &mut impl FnMut(&'static str) -> Result<()>,
    ) -> Result<Option<(f64, &'static str, Theta)>> {
        let mut best: Option<(f64, &'static str, Theta)> = None;
        let set = chosen.set.clone();
        let untried = |name: &&'static str| names.contains(name) && !set.contains(name);
        for (name, starts) in NAMES.into_iter().filter(|(n, _)| untried(n)) {
            step(name)?;
            if self.clock.is_late() {
                chosen.late.push(name);
                continue;
            }
            let mut free = smooth(&chosen.set);
            free.extend(smooth(&[name]));
            let starts = began.get(name).map_or(starts, std::slice::from_ref);
            let (theta, cost, start) = fit(
                self.real,
                (self.simulated, self.counted, self.clock),
                &chosen.theta,
                &free,
                (name, starts),
            );
            if self.clock.is_late() {
                // It may have ended where it was.
                chosen.late.push(name);
            }
            began.extend(start.map(|start| (name, start)));
            tracing::info!(
                "{name} beside {:?}: {left:.1} to {cost:.1}, {:?}",
                chosen.set,
                values(&theta, name)
            );
            let fewest = candidate_of(name).size();
            let beyond = left - cost > quantile_of_length(NAMES.len(), fewest).powi(2);
            // Marks are measured for this: only where all else speaks for it.
            let shows = || {
                !EDGES_TELL.contains(&name)
                    || shows_in_edges(self.real, self.simulated, [&chosen.theta, &theta])
            };
            if beyond && best.as_ref().is_none_or(|b| cost < b.0) && shows() {
                best = Some((cost, name, theta));
            }
        }
        Ok(best)
    }
}

/// Whether noise grows with brightness, and is alike from neighbour to neighbour, as in the real frames: else what is
/// there is not the noise that was found.
fn noise_agrees(real: &Fingerprint, made: &Fingerprint) -> bool {
    let all = apart(real, made);
    let seen: Vec<f64> = (0..BINS).chain(NEIGHBOURS).filter_map(|k| all[k]).collect();
    seen.iter().all(|z| z.abs() < quantile_of_length(seen.len(), 1))
}

/// Whether edges themselves show a sharpness: they are explained by it, beyond chance, and those across and down alike.
fn shows_in_edges(real: &Fingerprint, simulated: &Simulated, [without, with]: [&Theta; 2]) -> bool {
    let off = |theta: &Theta| {
        let all = apart(real, &simulated.fingerprint(theta));
        EDGES.map(|k| all[k].unwrap_or(0.0))
    };
    let (before, after) = (off(without), off(with));
    let most = quantile_of_length(EDGES.len(), 1);
    let square = |z: [f64; 2]| z[0] * z[0] + z[1] * z[1];
    let told = square(before) - square(after) > quantile_of_length(EDGES_TELL.len(), 1).powi(2);
    told && after.iter().all(|z| z.abs() < most)
}

/// Puts all marks into the log: of the real frames, of the simulated ones, and with what was chosen.
fn tell(real: &Fingerprint, before: &Fingerprint, after: &Fingerprint) {
    let figure = |k: Option<Known>| k.map_or("-".to_owned(), |k| format!("{:.4} +- {:.4}", k.value, k.error));
    let one = |mark: usize| {
        let [r, b, a] = [real, before, after].map(|f| figure(f.0[mark]));
        format!("{}: real {r}, simulated {b}, with effects {a}", super::marks::name(mark))
    };
    tracing::info!("marks: {}", (0..real.0.len()).map(one).collect::<Vec<_>>().join("; "));
}

fn values(theta: &Theta, name: &'static str) -> Vec<f64> {
    parameters(&[name]).into_iter().map(|p| theta.get(p)).collect()
}

/// Parameters of a set that have a slope.
fn smooth(set: &[&'static str]) -> Vec<P> {
    parameters(set).into_iter().filter(|p| !p.is_discrete()).collect()
}

/// Fits `free` from the best of some values of a candidate; parameters, the sum of squares that is left, and that
/// value.
fn fit(
    real: &Fingerprint,
    (simulated, counted, clock): (&Simulated, &[bool], &Clock),
    base: &Theta,
    free: &[P],
    (name, starts): (&'static str, &[f64]),
) -> (Theta, f64, Option<f64>) {
    let cost = |theta: &Theta| squares(&apart(real, &simulated.fingerprint(theta)), counted);
    let own = parameters(&[name]);
    let begin = |(v, mut theta): (f64, Theta)| {
        theta.set(own[0], v);
        // What goes with it begins at a middling value: 0 has no slope.
        for &p in own[1..].iter().filter(|p| !p.is_discrete()) {
            theta.set(p, if candidate_of(name).noise { v } else { p.spec().neutral.max(1.0) });
        }
        let cost = cost(&theta);
        (cost, theta, Some(v))
    };
    let choices: Vec<P> = own[1..].iter().copied().filter(|p| p.is_discrete()).collect();
    let starts = starts.iter().flat_map(|&v| combinations(&choices, base).into_iter().map(move |t| (v, t)));
    let (mut best, mut theta, start) = starts
        .enumerate()
        .filter(|(i, _)| *i == 0 || !clock.is_late())
        .map(|(_, start)| begin(start))
        .chain(by_brightness(real, base, free).map(|theta| (cost(&theta), theta, None)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .expect("every candidate has a value to begin with");
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        if clock.is_late_for(free.len() + 2) {
            break;
        }
        let Some((a, b)) = equations(real, simulated, &theta, free) else { break };
        let Some(step) = solve(&a, &b, damping) else { break };
        let mut moved = theta.clone();
        for (&p, s) in free.iter().zip(&step) {
            moved.set(p, theta.get(p) + s);
        }
        let now = cost(&moved);
        let gain = best - now;
        if gain > 0.0 {
            (best, theta) = (now, moved);
            damping *= 0.3;
        } else {
            damping = (damping * 30.0).min(10.0);
        }
        if gain.abs() < 0.01 {
            break;
        }
    }
    (theta, best, start)
}

/// Shot noise and read noise as the line through the variances of the real frames over brightness: where a fit of both
/// begins.
fn by_brightness(real: &Fingerprint, base: &Theta, free: &[P]) -> Option<Theta> {
    if !free.contains(&P::Shot) || !free.contains(&P::Read) {
        return None;
    }
    let (mut a, mut b) = (vec![vec![0.0; 2]; 2], vec![0.0; 2]);
    for (bin, known) in real.0.iter().take(BINS).enumerate() {
        let Some(known) = known else { continue };
        let [from, to] = bin_dn(bin);
        let level = f64::from(srgb_decode((0.5 * (from + to) / 255.0) as f32));
        let (weight, g) = (1.0 / (known.error * known.error), [LINEAR, LINEAR * level]);
        for i in 0..2 {
            b[i] += weight * g[i] * known.value;
            (0..2).for_each(|j| a[i][j] += weight * g[i] * g[j]);
        }
    }
    let line = solve(&a, &b, 0.0)?;
    let theta = base.with(P::Read, line[0].max(1e-8).sqrt()).with(P::Shot, line[1].max(1e-6));
    Some(theta)
}

/// Normal equations of a step of `free`.
fn equations(
    real: &Fingerprint,
    simulated: &Simulated,
    theta: &Theta,
    free: &[P],
) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
    let now = simulated.fingerprint(theta);
    let off = apart(real, &now);
    let slopes: Vec<Vec<Option<f64>>> = free
        .iter()
        .map(|&p| {
            let by = (PART * (theta.get(p) - p.spec().neutral).abs()).max(0.02 * p.spec().step);
            let there = apart(real, &simulated.fingerprint(&theta.with(p, theta.get(p) + by)));
            off.iter().zip(&there).map(|(a, b)| Some(((*a)? - (*b)?) / by)).collect()
        })
        .collect();
    let product = |a: &[Option<f64>], b: &[Option<f64>]| -> f64 {
        a.iter().zip(b).filter_map(|(a, b)| Some((*a)? * (*b)?)).sum()
    };
    let a: Vec<Vec<f64>> = slopes.iter().map(|i| slopes.iter().map(|j| product(i, j)).collect()).collect();
    let b: Vec<f64> = slopes.iter().map(|j| product(j, &off)).collect();
    (!free.is_empty() && (0..free.len()).all(|i| a[i][i] > 0.0)).then_some((a, b))
}

/// Half widths of 95 % intervals: from the curvature, wider where marks disagree.
fn half_widths(real: &Fingerprint, simulated: &Simulated, chosen: &Chosen) -> BTreeMap<P, f64> {
    let free = smooth(&chosen.set);
    let Some((a, _)) = equations(real, simulated, &chosen.theta, &free) else { return BTreeMap::new() };
    let off = apart(real, &simulated.fingerprint(&chosen.theta));
    let count = off.iter().flatten().count().saturating_sub(free.len()).max(1) as f64;
    let there: Vec<bool> = off.iter().map(Option::is_some).collect();
    let wider = (squares(&off, &there) / count).max(1.0).sqrt();
    let unit = |i: usize| (0..free.len()).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    let half = |i: usize| Some(1.96 * wider * solve(&a, &unit(i), 1e-9)?[i].max(0.0).sqrt());
    free.iter().enumerate().filter_map(|(i, &p)| Some((p, half(i)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::plane::Plane;

    /// Boxes before a wall, others in each frame and room.
    fn room(seed: u32, frames: u32) -> Simulated {
        let frame = |f: u32| {
            Plane::from_fn(176, 132, |x, y| {
                let at = |side: u32| {
                    let cell = ((x as u32 + 3 * f) / side) * 7919
                        + ((y as u32 + 2 * f) / side) * 104_729
                        + seed * 31;
                    cell.wrapping_mul(2_654_435_761) >> 16
                };
                let level = |c: u32| 0.05 + 0.4 * (((at(40) >> (3 * c)) & 7) as f32 / 7.0);
                [level(0), level(1), level(2), 1.0]
            })
        };
        Simulated((0..frames).map(frame).collect())
    }

    /// What a sensor leaves: with all that can be named, a search takes half a minute, a third of it over mosaics.
    const FEW: [&str; 4] = ["read_noise", "fixed_pattern_noise", "row_noise", "hot_pixels"];

    fn all() -> Vec<&'static str> {
        NAMES.iter().map(|(n, _)| *n).collect()
    }

    fn found(hidden: &Theta, names: &[&'static str]) -> Chosen {
        let base = Theta::neutral();
        let real = Fingerprint::of(&room(5, 4).delivered(hidden, 77), 0.0);
        choose(&real, &room(9, 4), &base, names, &mut Clock::default(), |_| Ok(())).expect("nothing stops it")
    }

    #[test]
    fn what_frames_unseen_by_a_fit_speak_against_is_not_named() {
        let theta = Theta::neutral().with(P::Row, 0.02).with(P::Hot, 1e-3).with(P::Read, 0.01);
        let set = vec!["row_noise", "hot_pixels", "read_noise"];
        let mut chosen = Chosen { theta, set, ..none() };
        // The rows make traces less alike, the read noise as much as nothing: neither is supported.
        chosen.deny(|t| 1.0 + 9.0 * t.get(P::Row) - 100.0 * t.get(P::Hot));
        assert_eq!((chosen.set, chosen.denied), (vec!["hot_pixels"], vec!["row_noise", "read_noise"]));
        assert!(chosen.theta.get(P::Row) == 0.0 && chosen.theta.get(P::Hot) == 1e-3);
    }

    #[test]
    fn what_there_is_no_time_to_take_out_one_by_one_goes_at_once() {
        let theta = Theta::neutral().with(P::Row, 0.02).with(P::Hot, 1e-3).with(P::Read, 0.01);
        let set = vec!["row_noise", "hot_pixels", "read_noise"];
        let denied = |distance: fn(&Theta) -> f64| {
            let mut chosen = Chosen { theta: theta.clone(), set: set.clone(), ..none() };
            chosen.deny_at_once(distance);
            chosen.set
        };
        assert_eq!(denied(|t| 1.0 + 9.0 * t.get(P::Row) - 100.0 * t.get(P::Hot)), ["hot_pixels"]);
        // Each looks needed beside the others, and all are worse than none.
        assert!(
            denied(|t| {
                let on = [P::Row, P::Hot, P::Read].iter().filter(|p| t.get(**p) > 0.0).count();
                [1.0, 5.0, 4.0, 3.0][on]
            })
            .is_empty()
        );
    }

    #[test]
    fn without_flat_places_no_noise_is_looked_for() {
        let hidden = Theta::neutral().with(P::Row, 0.02);
        let mut real = Fingerprint::of(&room(5, 5).delivered(&hidden, 77), 0.0);
        real.0[..BINS].fill(None);
        let mut asked = Vec::new();
        let step = |name: &'static str| {
            asked.push(name);
            Ok(())
        };
        let chosen = choose(&real, &room(9, 5), &Theta::neutral(), &FEW, &mut Clock::default(), step);
        assert!(chosen.expect("nothing stops it").set.iter().all(|n| !NOISES.contains(n)));
        assert!(asked.contains(&"hot_pixels") && !asked.iter().any(|n| NOISES.contains(n)), "{asked:?}");
    }

    #[test]
    fn without_time_what_was_not_tried_is_late_and_not_denied() {
        let hidden = Theta::neutral().with(P::Row, 0.02);
        let real = Fingerprint::of(&room(5, 5).delivered(&hidden, 77), 0.0);
        // The time of the end begins when so many candidates have been told of.
        let mut clock = Clock::default();
        let over = clock.over();
        let mut told = 0;
        let step = |_: &'static str| {
            told += 1;
            over.store(told > 3, std::sync::atomic::Ordering::Relaxed);
            Ok(())
        };
        let chosen =
            choose(&real, &room(9, 5), &Theta::neutral(), &all(), &mut clock, step).expect("something");
        assert_eq!(chosen.late.len() + chosen.set.len(), NAMES.len(), "{:?} {:?}", chosen.late, chosen.set);
        assert!(chosen.late.contains(&"row_noise") && chosen.shows_from.is_empty());
        // The control, that with time nothing is late, is in `tells_what_a_sensor_leaves`: a search takes ten seconds.
    }

    fn tells_what_a_sensor_leaves(names: &[&'static str]) {
        let nothing = found(&Theta::neutral(), names);
        assert!(nothing.set.is_empty());
        let pattern = found(&Theta::neutral().with(P::Dsnu, 0.01).with(P::Row, 0.008), names);
        assert!(
            pattern.set.len() == 2
                && ["fixed_pattern_noise", "row_noise"].iter().all(|n| pattern.set.contains(n))
        );
        assert!(nothing.late.is_empty() && pattern.late.is_empty());
        assert!((pattern.theta.get(P::Dsnu) / 0.01 - 1.0).abs() < 0.15, "{}", pattern.theta.get(P::Dsnu));
        assert!((pattern.theta.get(P::Row) / 0.008 - 1.0).abs() < 0.2, "{}", pattern.theta.get(P::Row));
    }

    #[test]
    fn what_a_sensor_leaves_in_other_pictures_is_found_and_nothing_where_there_is_nothing() {
        tells_what_a_sensor_leaves(&FEW);
    }

    #[test]
    #[ignore = "long: more than a minute"]
    fn what_a_sensor_leaves_is_found_among_all_that_can_be_named() {
        tells_what_a_sensor_leaves(&all());
        let mosaic = found(&Theta::neutral().with(P::Mosaic, 3.0).with(P::Hot, 2e-3), &all());
        assert!(
            mosaic.set.contains(&"bayer_mosaic") && mosaic.theta.get(P::Mosaic) == 3.0,
            "{:?}",
            mosaic.set
        );
        assert!(mosaic.set.contains(&"hot_pixels"), "{:?}", mosaic.set);
    }
}
