//! The spread of the real values about the simulated ones: which noise the sensor has.
//!
//! Differences are high-passed over `APART` px along the row, so that a mean that is a little wrong counts little,
//! and a row's common value not at all; what a pixel keeps over the frames is told from what is new in each.

use std::collections::BTreeMap;

use crate::diagnose::expect::discrepancy::SPREAD_ERROR;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::fit::intervals::Way;
pub(crate) use measure::{ahead_of_steps, chance2, flat_map};

mod coefficients;
mod measure;
mod steps;
mod tables;

/// Relative error of a bin's variance beyond chance.
pub(crate) const BIN_ERROR: f64 = SPREAD_ERROR as f64;
/// The same behind compression: where it removes most of the noise the model was seen to be off by up to 13 %.
const PACKED_ERROR: f64 = 0.15;

/// Names of the candidates that change the spread.
pub(crate) const NOISES: [&str; 5] =
    ["shot_noise", "fixed_pattern_noise", "row_noise", "read_noise", "hot_pixels"];

/// Variances in linear values of the sensor before the black level. Per bin: linear value, variance, number.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseData {
    /// Of single values about what their neighbours say.
    pub(crate) total: Vec<[f64; 3]>,
    /// The part of it that is the same in every frame, and the variance that free noise gives that figure: what is seen
    /// of a pattern is a difference of two spreads, and may be negative by chance.
    pub(crate) fixed: Vec<[f64; 4]>,
    /// The part of it that is new in every frame, from differences between frames: a pattern, whose spread is known to
    /// a part of it, is not in them.
    pub(crate) fresh: Vec<[f64; 3]>,
    /// Of rows beyond that of their pixels.
    pub(crate) row2: f64,
    /// The variance of that figure.
    pub(crate) row_error2: f64,
}

impl NoiseData {
    /// Parameters of the given noise effects, by weighted least squares that keeps them from going negative; those of
    /// the others are as in `base`.
    pub(crate) fn fit(&self, theta: &Theta, base: &Theta, names: &[&str]) -> Theta {
        let on = |name: &str| names.contains(&name);
        let mut theta = theta.clone();
        for p in [P::Shot, P::Read, P::Row, P::Dsnu, P::Prnu, P::Hot] {
            theta.set(p, base.get(p));
        }
        if on("row_noise") {
            theta.set(P::Row, self.row2.sqrt());
        }
        if on("fixed_pattern_noise") {
            let [dsnu2, prnu2] = line_beside(&self.unclipped_fixed(), PATTERN).0;
            // A pattern is a part of the spread: where single frames have none, it is what renderers differ by at
            // places that stay in sight.
            if theta.is_on(P::Quality) || self.holds(|l| dsnu2 + prnu2 * l * l) {
                theta.set(P::Dsnu, dsnu2.sqrt());
                theta.set(P::Prnu, prnu2.sqrt());
            }
        }
        let known = |l: f64| {
            let read2 = if on("read_noise") { 0.0 } else { base.get(P::Read).powi(2) };
            let shot = if on("shot_noise") { 0.0 } else { l * base.get(P::Shot) };
            // A model without a pattern takes its spread for noise that is new in every frame.
            read2 + shot + theta.get(P::Dsnu).powi(2) + (theta.get(P::Prnu) * l).powi(2)
        };
        let rest = self.beside_pattern(&theta, known);
        let [read, shot] = [on("read_noise"), on("shot_noise")].map(|on| f64::from(u8::from(on)));
        let [read2, inverse] =
            if read + shot > 0.0 { line_beside(&rest, |l| [read, shot * l]).0 } else { [0.0; 2] };
        if on("read_noise") {
            theta.set(P::Read, read2.sqrt());
        }
        if on("shot_noise") {
            theta.set(P::Shot, inverse);
        }
        // Less than a few hundredths of a DN is no noise but the arithmetic of rounding.
        for (p, least) in [(P::Read, 2e-4), (P::Shot, 1e-6), (P::Row, 2e-4), (P::Dsnu, 2e-4), (P::Prnu, 5e-4)]
        {
            if theta.get(p) < least {
                theta.set(p, 0.0);
            }
        }
        theta
    }
}

impl NoiseData {
    /// Whether single frames spread by no less than half of that variance, by the linear value, on average.
    fn holds(&self, variance: impl Fn(f64) -> f64) -> bool {
        let bins = self.unclipped();
        let [seen, told] = bins.iter().fold([0.0; 2], |[s, t], &[l, v, n]| [s + n * v, t + n * variance(l)]);
        told <= 2.0 * seen
    }

    /// What bins tell of noise that is new in every frame, less what is `known` of single values: from single frames,
    /// to the error of the pattern of `theta` in them, and beside a pattern from differences between frames too.
    fn beside_pattern(&self, theta: &Theta, known: impl Fn(f64) -> f64) -> Vec<[f64; 4]> {
        let single = |&[l, v, n]: &[f64; 3]| [l, v - known(l), n, (BIN_ERROR * pattern_of(theta, l)).powi(2)];
        let fresh = |&[l, v, n]: &[f64; 3]| [l, v - known(l) + pattern_of(theta, l), n, 0.0];
        let mut all: Vec<[f64; 4]> = self.unclipped().iter().map(single).collect();
        if all.iter().all(|bin| bin[3] == 0.0) {
            all.iter_mut().for_each(|bin| bin[1] = bin[1].max(0.0));
        }
        all.extend(self.fresh_beside(&[theta]).iter().map(fresh));
        all
    }

    /// Bins of what is new in every frame, where one of several models has a pattern: without one single frames tell
    /// the same.
    fn fresh_beside(&self, models: &[&Theta]) -> Vec<[f64; 3]> {
        let has_pattern = models.iter().any(|t| t.is_on(P::Dsnu) || t.is_on(P::Prnu));
        let [from, to] = self.span();
        let inside = |b: &&[f64; 3]| has_pattern && (from..=to).contains(&b[0]);
        self.fresh.iter().filter(inside).copied().collect()
    }

    /// Bins whose spread the darkest value does not cut off; the brightest ones where that leaves too few.
    pub(crate) fn unclipped(&self) -> Vec<[f64; 3]> {
        let inside = |[l, v, _]: &&[f64; 3]| {
            let reach = 2.5 * (v + self.row2).sqrt();
            *l > reach && *l < 1.0 - reach
        };
        let free = self.total.iter().filter(inside);
        let free: Vec<_> = free.copied().collect();
        if free.len() >= 4 { free } else { self.total[self.total.len().saturating_sub(4)..].to_vec() }
    }

    /// The same bins of the fixed pattern.
    fn unclipped_fixed(&self) -> Vec<[f64; 4]> {
        let [from, to] = self.span();
        let inside: Vec<_> = self.fixed.iter().filter(|b| (from..=to).contains(&b[0])).copied().collect();
        if inside.len() >= 2 { inside } else { self.fixed.clone() }
    }

    /// Linear values between which nothing is cut off.
    fn span(&self) -> [f64; 2] {
        let free = self.unclipped();
        [free.first().map_or(0.0, |b| 0.98 * b[0]), free.last().map_or(1.02, |b| 1.02 * b[0])]
    }

    /// Standard errors of the parameters of `names` from those of the bins.
    pub(crate) fn errors(&self, theta: &Theta, names: &[&str]) -> BTreeMap<P, f64> {
        let on = |name: &str| names.contains(&name);
        let mut out = BTreeMap::new();
        // A parameter is the root of its coefficient.
        let root = |p: P, variance: f64| (p, variance.sqrt() / (2.0 * theta.get(p)).max(1e-6));
        if on("fixed_pattern_noise") {
            let variances = line_beside(&self.unclipped_fixed(), PATTERN).1;
            out.extend([root(P::Dsnu, variances[0]), root(P::Prnu, variances[1])]);
        }
        let (read, shot) = (f64::from(u8::from(on("read_noise"))), f64::from(u8::from(on("shot_noise"))));
        if read + shot > 0.0 {
            let variances =
                line_beside(&self.beside_pattern(theta, |l| pattern_of(theta, l)), |l| [read, shot * l]).1;
            if read > 0.0 {
                out.extend([root(P::Read, variances[0])]);
            }
            if shot > 0.0 {
                out.insert(P::Shot, variances[1].sqrt());
            }
        }
        out
    }

    /// Where what is measured lies between the noise of two models; nothing where they have the same.
    ///
    /// `given`: variance of single simulated values by the linear value, where they were rounded themselves. Where
    /// neighbours are of different values of the scene it looks like noise of the camera.
    pub(crate) fn way(&self, from: &Theta, to: &Theta, given: impl Fn(f64) -> f64) -> Option<Way> {
        let share = if to.is_on(P::Quality) { PACKED_ERROR } else { BIN_ERROR };
        let fresh = |t: &Theta, l: f64| t.get(P::Read).powi(2) + l * t.get(P::Shot);
        let single = |t: &Theta, l: f64| fresh(t, l) + pattern_of(t, l);
        // What is seen, what either model says, and the variance of what is seen.
        let of = |[l, v, n, free2]: [f64; 4], model: &dyn Fn(&Theta, f64) -> f64| {
            let [a, b] = [from, to].map(|t| model(t, l));
            let level = v.max(a).max(b);
            [v - given(l), a, b, level * level * (share * share + chance2(n)) + free2]
        };
        let alone = |[l, v, n]: [f64; 3]| [l, v, n, 0.0];
        let mut seen: Vec<[f64; 4]> = Vec::new();
        seen.extend(self.unclipped().into_iter().map(|bin| of(alone(bin), &single)));
        seen.extend(self.fresh_beside(&[from, to]).into_iter().map(|bin| of(alone(bin), &fresh)));
        seen.extend(self.unclipped_fixed().into_iter().map(|bin| of(bin, &pattern_of)));
        let [a, b] = [from, to].map(|t| t.get(P::Row).powi(2));
        let level = self.row2.max(a).max(b);
        seen.push([self.row2, a, b, (level * share).powi(2) + self.row_error2]);
        let (mut slope, mut weight) = (0.0, 0.0);
        for [v, a, b, error2] in seen {
            slope += (v - a) * (b - a) / error2.max(1e-24);
            weight += (b - a).powi(2) / error2.max(1e-24);
        }
        (weight > 0.0).then(|| Way { share: slope / weight, half: 2.0 / weight.sqrt() })
    }
}

/// Variance of the pattern of a model, of a linear value.
fn pattern_of(theta: &Theta, linear: f64) -> f64 {
    theta.get(P::Dsnu).powi(2) + (theta.get(P::Prnu) * linear).powi(2)
}

/// How the variance of a fixed pattern grows with brightness.
const PATTERN: fn(f64) -> [f64; 2] = |l| [1.0, l * l];

/// Two coefficients, neither negative, of `variance = x . f(linear)`, weighted by number over squared variance, and the
/// variances of the coefficients. The last number of a bin is the variance that its figure has besides.
fn line_beside(bins: &[[f64; 4]], f: impl Fn(f64) -> [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let equations = |previous: [f64; 2]| {
        let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
        for &[l, v, n, free2] in bins {
            let g = f(l);
            let model = (previous[0] * g[0] + previous[1] * g[1]).max(0.1 * v).max(1e-9);
            let weight = 1.0 / (model * model * (BIN_ERROR * BIN_ERROR + chance2(n)) + free2);
            for i in 0..2 {
                b[i] += weight * g[i] * v;
                (0..2).for_each(|j| a[i][j] += weight * g[i] * g[j]);
            }
        }
        (a, b)
    };
    let solve = |use_: [bool; 2], previous: [f64; 2]| -> [f64; 2] {
        let (a, b) = equations(previous);
        let one = |i: usize| if a[i][i] > 0.0 { b[i] / a[i][i] } else { 0.0 };
        match use_ {
            [true, true] => {
                let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
                if det.abs() <= 1e-12 * a[0][0] * a[1][1] {
                    return [one(0), 0.0];
                }
                [(b[0] * a[1][1] - b[1] * a[0][1]) / det, (b[1] * a[0][0] - b[0] * a[1][0]) / det]
            }
            [true, false] => [one(0), 0.0],
            _ => [0.0, one(1)],
        }
    };
    let probe = f(0.5);
    let both = [probe[0] > 0.0, probe[1] > 0.0];
    let mut x = [0.0; 2];
    for _ in 0..6 {
        x = solve(both, x);
        if x[0] < 0.0 {
            x = solve([false, true], [0.0, x[1].max(0.0)]);
        } else if x[1] < 0.0 {
            x = solve([true, false], [x[0], 0.0]);
        }
        x = x.map(|v| v.max(0.0));
    }
    let (a, _) = equations(x);
    let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let variances = [0, 1].map(|i| {
        let j = 1 - i;
        if x[j] > 0.0 && det > 1e-12 * a[0][0] * a[1][1] { a[j][j] / det } else { 1.0 / a[i][i].max(1e-30) }
    });
    (x, variances)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::diagnose::evidence::Evidence;
    use crate::diagnose::expect::model::candidate_of;
    use crate::diagnose::expect::pair::given::GivenValue;
    use crate::diagnose::expect::settings::settings_of;
    use crate::diagnose::expect::tone::Tone;
    use shutterbug::plane::{Plane, srgb_decode, srgb_encode};

    /// What is measured of normal noise of `sigma_dn` on a solid colour that is `fraction` above a whole DN.
    fn measured_dn2(sigma_dn: f32, fraction: f32) -> f64 {
        let theta = Theta::neutral();
        let mean = Plane::from_fn(160, 120, |_, _| [120.0 + fraction; 3]);
        let real = Plane::from_fn(160, 120, |x, y| {
            [0u32, 1, 2].map(|c| {
                let uniform =
                    |k: u32| shutterbug::chain::rng::random_uniform([x as u32, y as u32], c, k, [5, 6]);
                let sum: f32 = (0..3).flat_map(uniform).map(|u| u - 0.5).sum();
                (120.0 + fraction + sigma_dn * sum).round()
            })
        });
        let data = NoiseData::measure(&Evidence::of_one(real), &[0], &[mean], None, &theta, None);
        data.total[0][1] * f64::from(Tone::new(&theta).slope_at(120.0, 1)).powi(2)
    }

    #[test]
    fn the_spread_of_solid_colours_does_not_depend_on_their_fraction_of_a_dn() {
        for sigma_dn in [0.8f32, 1.2, 2.4] {
            let truth = f64::from(sigma_dn).powi(2);
            for fraction in [0.0, 0.2, 0.35, 0.5] {
                let seen = measured_dn2(sigma_dn, fraction);
                assert!((seen / truth - 1.0).abs() < 0.07, "{sigma_dn} {fraction}: {seen} DN^2 for {truth}");
            }
        }
        assert!(measured_dn2(0.0, 0.3) < 0.03, "rounding alone is no noise: {}", measured_dn2(0.0, 0.3));
    }

    /// Full-well capacity, in electrons, and read noise as measured of 800 and 0.008 behind a saturation of that
    /// `factor`, where `told` is what the model says of it.
    fn measured_behind_saturation(factor: f64, told: f64) -> [f64; 2] {
        let saturation = candidate_of("saturation").parameters[0];
        let camera = |factor: f64| Theta::neutral().with(saturation, factor).with(P::Read, 1e-3);
        let tone = Tone::new(&camera(factor));
        let weights = *tone.colours_behind().expect("it mixes")[0];
        let colour = |x: usize| [0.1 + 0.05 * (x / 20) as f32, 0.08, 0.5 - 0.04 * (x / 20) as f32];
        let dn = |linear: [f32; 3]| -> [f32; 3] {
            let encoded = linear.map(|v| 255.0 * (1.055 * v.max(1e-4).powf(1.0 / 2.4) - 0.055));
            weights.map(|row| (0..3).map(|k| row[k] * encoded[k]).sum())
        };
        let mean = Plane::from_fn(160, 240, |x, _| dn(colour(x)));
        let real = Plane::from_fn(160, 240, |x, y| {
            let bits = |k: u32| shutterbug::chain::rng::random_normal([x as u32, y as u32], 0, k, [5, 6]);
            let (normal, linear) = (bits(3), colour(x));
            let noisy = |c: usize| linear[c] + normal[c] * (linear[c] / 800.0 + 0.008f32.powi(2)).sqrt();
            dn([0, 1, 2].map(noisy)).map(f32::round)
        });
        let theta = camera(told).with(P::Read, 0.0);
        let data = NoiseData::measure(&Evidence::of_one(real), &[0], &[mean], None, &theta, None);
        let fitted = data.fit(&theta, &theta, &["shot_noise", "read_noise"]);
        [1.0 / fitted.get(P::Shot), fitted.get(P::Read)]
    }

    #[test]
    fn noise_is_measured_ahead_of_what_makes_colours_of_each_other() {
        for factor in [0.6, 0.77, 1.3] {
            let [full_well_e, read] = measured_behind_saturation(factor, factor);
            assert!((full_well_e / 800.0 - 1.0).abs() < 0.1, "{factor}: {full_well_e} e");
            assert!((read / 0.008 - 1.0).abs() < 0.1, "{factor}: {read}");
        }
        let [full_well_e, read] = measured_behind_saturation(0.6, 1.0 - 1e-6);
        assert!(full_well_e > 1100.0 || read < 0.006, "control: not taken back, {full_well_e} e, {read}");
    }

    /// Full-well capacity, in electrons, and read noise as measured of 544 and 0.0026 on colours behind a mosaic whose
    /// demosaicking corrects one colour by another; `told`: what the model says of it.
    fn measured_behind_mosaic(told: f64) -> [f64; 2] {
        let [pattern, demosaic] = [0, 1].map(|i| candidate_of("bayer_mosaic").parameters[i]);
        let camera = |d: f64| Theta::neutral().with(pattern, 3.0).with(demosaic, d);
        let colour = |x: usize, y: usize| match (x / 20 + y / 40) % 4 {
            0 => [0.6, 0.15, 0.6],
            1 => [0.35, 0.006, 0.4],
            2 => [0.1, 0.06, 0.01],
            _ => [0.1 + 0.04 * (x / 20) as f32; 3],
        };
        let seen = |raw: &Plane<f32>| {
            let mut seen = shutterbug::reference::moments::mixed(raw, &settings_of(&camera(1.0)));
            seen.data.iter_mut().for_each(|v| *v = 255.0 * srgb_encode(v.clamp(0.0, 1.0)));
            seen
        };
        let raw = Plane::from_fn(160, 240, |x, y| {
            let normal = shutterbug::chain::rng::random_normal([x as u32, y as u32], 0, 3, [5, 6]);
            let linear = colour(x, y);
            [0, 1, 2].map(|c| linear[c] + normal[c] * (linear[c] / 544.0 + 0.0026f32.powi(2)).sqrt())
        });
        let mean = seen(&Plane::from_fn(160, 240, colour));
        let mut real = seen(&raw);
        real.data.iter_mut().for_each(|v| *v = v.round());
        let data = NoiseData::measure(&Evidence::of_one(real), &[0], &[mean], None, &camera(told), None);
        let fitted = data.fit(&camera(told), &camera(told), &["shot_noise", "read_noise"]);
        [1.0 / fitted.get(P::Shot), fitted.get(P::Read)]
    }

    #[test]
    fn noise_is_told_of_the_colours_that_a_demosaicking_takes_it_from() {
        let [full_well_e, read] = measured_behind_mosaic(1.0);
        assert!((full_well_e / 544.0 - 1.0).abs() < 0.1, "{full_well_e} e");
        assert!(read < 0.005, "{read}");
        // Control: what each colour is made of itself alone.
        let [other_e, other] = measured_behind_mosaic(0.0);
        assert!((other_e / 544.0 - 1.0).abs() > 0.2 || other > 0.006, "{other_e} e, {other}");
    }

    /// What is measured of six frames with a pattern and noise of `read` that is new in each.
    fn measured_of_six(dsnu: f32, read: f32) -> NoiseData {
        let theta = Theta::neutral();
        let linear = |x: usize| 0.1 + 0.05 * (x / 20) as f32;
        let dn = |l: f32| 255.0 * (1.055 * l.max(1e-4).powf(1.0 / 2.4) - 0.055);
        let mean = Plane::from_fn(160, 120, |x, _| [dn(linear(x)); 3]);
        let frame = |f: u32| {
            let normal = |x, y, c, k| shutterbug::chain::rng::random_normal([x, y], c, k, [5, 6])[0];
            Arc::new(Plane::from_fn(160, 120, |x, y| {
                [0u32, 1, 2].map(|c| {
                    let (column, row) = (x as u32, y as u32);
                    let noise = dsnu * normal(column, row, c, 99) + read * normal(column, row, c, f);
                    dn(linear(x) + noise).round()
                })
            }))
        };
        let frames: Vec<usize> = (0..6).collect();
        let evidence = Evidence::of_frames((0..6).map(frame));
        NoiseData::measure(&evidence, &frames, &vec![mean; 6], None, &theta, None)
    }

    /// The camera with a pattern and noise as measured, and how many standard errors it is told from the one with
    /// `alone` of the two by.
    fn told_beside(data: &NoiseData, alone: &'static str) -> (Theta, f64) {
        let none = Theta::neutral();
        let fit = |names: &[&str]| data.fit(&none, &none, names);
        let (without, with) = (fit(&[alone]), fit(&["fixed_pattern_noise", "read_noise"]));
        let errors = data.way(&without, &with, |_| 0.0).map_or(0.0, |way| 2.0 * way.share / way.half);
        (with, errors)
    }

    #[test]
    fn what_rounding_makes_of_given_pictures_is_no_noise() {
        // Every pixel of another value: what was rounded away, seen by a camera that is darker, is like noise.
        let darker = |v: f32| 255.0 * srgb_encode(0.77 * srgb_decode(v / 255.0));
        let at = |x: u32, y: u32| shutterbug::chain::rng::random_uniform([x, y], 0, 7, [5, 6])[0];
        let exact =
            Plane::from_fn(160, 120, |x, y| [100.0 + (y / 3) as f32 + 3.0 * at(x as u32, y as u32); 3]);
        let given = Plane { data: exact.data.iter().map(|v| darker(v.round())).collect(), ..exact };
        let none = Theta::neutral();
        let told = |sigma: f32, rounding: bool| {
            let noisy = |(i, v): (usize, &f32)| {
                let at = [i as u32 % 480, i as u32 / 480];
                (darker(*v) + sigma * shutterbug::chain::rng::random_normal(at, 0, 1, [5, 6])[0]).round()
            };
            let real = Plane { data: exact.data.iter().enumerate().map(noisy).collect(), ..exact };
            let data = NoiseData::measure(
                &Evidence::of_one(real),
                &[0],
                std::slice::from_ref(&given),
                None,
                &none,
                None,
            );
            let with = data.fit(&none, &none, &["read_noise"]);
            let variance = |l: f64| if rounding { GivenValue::rounding(l, false) } else { 0.0 };
            data.way(&none, &with, variance).map_or(0.0, |way| 2.0 * way.share / way.half)
        };
        assert!(told(0.0, true) < 3.0, "{}", told(0.0, true));
        assert!(told(0.0, false) > 5.0, "control: {}", told(0.0, false));
        assert!(told(1.0, true) > 5.0, "{}", told(1.0, true));
    }

    fn pattern_beside_noise(dsnu: f32, read: f32) -> f64 {
        told_beside(&measured_of_six(dsnu, read), "read_noise").1
    }

    /// Read noise, and standard errors.
    fn noise_beside_pattern(dsnu: f32, read: f32) -> [f64; 2] {
        let (with, errors) = told_beside(&measured_of_six(dsnu, read), "fixed_pattern_noise");
        [with.get(P::Read), errors]
    }

    #[test]
    fn a_pattern_is_told_beside_six_times_as_much_noise_and_none_is_not() {
        let told = pattern_beside_noise(0.003, 0.018);
        assert!(told > 3.5, "{told} standard errors");
        let told = pattern_beside_noise(0.0, 0.018);
        assert!(told < 3.0, "control: {told} standard errors");
    }

    #[test]
    fn noise_is_told_beside_five_times_as_much_of_a_pattern_and_none_is_not() {
        let told = noise_beside_pattern(0.02, 0.0044);
        assert!((told[0] / 0.0044 - 1.0).abs() < 0.1 && told[1] > 5.0, "{told:?}");
        let told = noise_beside_pattern(0.02, 0.0);
        assert!(told[1] < 3.0, "control: {told:?}");
    }

    #[test]
    fn a_pattern_that_the_model_lacks_does_not_pass_for_noise() {
        let misfit = |seen: [f32; 2], model: [f64; 2]| {
            let theta = Theta::neutral().with(P::Dsnu, model[0]).with(P::Read, model[1]);
            measured_of_six(seen[0], seen[1]).misfit(&theta)[2]
        };
        let most = crate::diagnose::judge::quantile(3);
        let whole = 0.006_f64.hypot(0.012);
        let lacking = misfit([0.006, 0.012], [0.0, whole]);
        assert!(lacking > most, "{lacking} of {most}");
        let told = misfit([0.006, 0.012], [0.006, 0.012]);
        let none = misfit([0.0, whole as f32], [0.0, whole]);
        assert!(told < 0.6 * most && none < 0.6 * most, "control: {told}, {none}");
    }

    #[test]
    fn a_pattern_is_a_part_of_the_spread_of_single_frames() {
        let dsnu = |seen: f64| {
            let bins = |v: f64| (1..20).map(|i| [f64::from(i) / 20.0, v, 1000.0]).collect::<Vec<_>>();
            let data = NoiseData {
                fresh: Vec::new(),
                total: bins(seen),
                fixed: bins(4e-6).iter().map(|&[l, v, n]| [l, v, n, 0.0]).collect(),
                row2: 0.0,
                row_error2: 0.0,
            };
            data.fit(&Theta::neutral(), &Theta::neutral(), &["fixed_pattern_noise"]).get(P::Dsnu)
        };
        assert_eq!(dsnu(0.0), 0.0);
        assert!((dsnu(5e-6) / 2e-3 - 1.0).abs() < 1e-3, "control: {}", dsnu(5e-6));
    }

    fn line(bins: &[[f64; 3]], f: impl Fn(f64) -> [f64; 2]) -> ([f64; 2], [f64; 2]) {
        line_beside(&bins.iter().map(|&[l, v, n]| [l, v, n, 0.0]).collect::<Vec<_>>(), f)
    }

    #[test]
    fn coefficients_are_recovered_and_never_negative() {
        let bins: Vec<[f64; 3]> =
            (1..20).map(|i| f64::from(i) / 20.0).map(|l| [l, 3e-5 + l / 800.0, 1000.0]).collect();
        let ([read2, inverse], errors) = line(&bins, |l| [1.0, l]);
        assert!(errors[0] > 0.0 && errors[0] < read2.powi(2) && errors[1] < inverse.powi(2), "{errors:?}");
        assert!((read2 - 3e-5).abs() < 1e-8 && (inverse - 1.0 / 800.0).abs() < 1e-8, "{read2} {inverse}");
        let falling: Vec<[f64; 3]> =
            (1..20).map(|i| [f64::from(i) / 20.0, 1e-3 - 4e-5 * f64::from(i), 1e3]).collect();
        let ([read2, inverse], _) = line(&falling, |l| [1.0, l]);
        assert!(read2 > 0.0 && inverse == 0.0);
    }
}
