//! Detection over strength: captures with one hidden effect at graded strengths, and how often it is named. The scene,
//! the motion and the noise of a repetition are the same for every effect and every strength, so a curve shows the
//! strength alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Instant;

use super::curve_result::{Curve, CurveCase, CurvePoint, CurveResult};
use super::hidden::{Grade, grade, graded};
use super::make::Case;
use super::{WithholdOptions, begin, diagnose, unless_stopped};
use shutterbug::capture::CameraFile;
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read_if_there};
use shutterbug::plane::{write_atomic, write_png_atomic};

/// Which strengths are tried, and how often.
#[derive(Clone, Debug)]
pub struct CurveOptions {
    /// Effects by name.
    pub effects: Vec<String>,
    /// Strengths an effect, in equal ratios from hardly visible to clear.
    pub points: usize,
    /// Captures a strength.
    pub repeats: usize,
}

impl CurveOptions {
    /// Of effects by name; `all` is all that have grades.
    ///
    /// # Errors
    /// An effect without grades.
    pub fn new(effects: &[String], points: usize, repeats: usize) -> Result<Self> {
        let names = match effects {
            [all] if all == "all" => graded_effects(),
            _ => effects.iter().map(|e| named(e).map(|(name, _)| name)).collect::<Result<_>>()?,
        };
        Ok(Self { effects: names.into_iter().map(str::to_owned).collect(), points, repeats })
    }
}

/// Makes, diagnoses and counts; writes `curves.json` and `curves.png` after each capture, `curves.html` at the end. A
/// run that was stopped goes on: what has a `score.json` is done. More effects, points or repetitions may be asked for
/// later.
///
/// # Errors
/// Names of no effect that has grades; a folder of a run with other options; files that cannot be read or written;
/// [`Error::CasesInterrupted`].
pub fn curves(
    options: &WithholdOptions,
    curve: &CurveOptions,
    say: &mut dyn FnMut(&str),
    stop: &dyn Fn() -> bool,
) -> Result<CurveResult> {
    let effects: Vec<(&str, Grade)> = curve.effects.iter().map(|n| named(n)).collect::<Result<_>>()?;
    fs::create_dir_all(&options.out).map_err(|e| Error::io(&options.out, "create the folder", e))?;
    let manifest = begin(options)?;
    let total = effects.len() * curve.points * curve.repeats;
    let (clock, mut fresh) = (Instant::now(), 0usize);
    let mut result = CurveResult { options: manifest, curves: Vec::new(), cases: Vec::new() };
    // All effects at one scene, then at the next: what is there after an interruption says something of each.
    for repeat in 0..curve.repeats {
        for (name, grade) in &effects {
            for point in 0..curve.points {
                let strength = grade.strength(point, curve.points);
                let folder = options.out.join(format!("{name}-{strength:.3e}-{repeat:02}"));
                let case = match read_case(&folder)? {
                    Some(case) => case,
                    None => {
                        let case = unless_stopped([result.cases.len(), total], stop, || {
                            one_case(options, name, strength, repeat, &folder, stop)
                        })?;
                        fresh += 1;
                        let each_s = clock.elapsed().as_secs_f64() / fresh as f64;
                        let left_min = (total - result.cases.len() - 1) as f64 * each_s / 60.0;
                        let found = case.found.join(", ");
                        say(&format!(
                            "{}/{total}: {name} {strength:.3e} ({:.2} DN): {} [{found}]; {each_s:.0} s each, at most \
                             {left_min:.0} min left",
                            result.cases.len() + 1,
                            case.gap_dn,
                            case.verdict,
                        ));
                        case
                    }
                };
                result.cases.push(case);
                result.curves = summary(&effects, &result.cases);
                write(&result, &options.out)?;
            }
        }
    }
    super::curve_page::write(&result, &options.out)?;
    Ok(result)
}

fn named(name: &str) -> Result<(&'static str, Grade)> {
    let graded = graded_effects();
    let found = graded.iter().find(|n| **n == name).and_then(|n| Some((*n, grade(n)?)));
    found.ok_or_else(|| Error::unknown_name(Path::new("--curve"), None, "effect with grades", name, graded))
}

/// Names of the effects that have grades.
fn graded_effects() -> Vec<&'static str> {
    crate::diagnose::effect_names().into_iter().filter(|n| grade(n).is_some()).collect()
}

fn one_case(
    options: &WithholdOptions,
    name: &'static str,
    strength: f64,
    repeat: usize,
    folder: &Path,
    stop: &dyn Fn() -> bool,
) -> Result<CurveCase> {
    let capture = folder.join("capture");
    let hide = |camera: &CameraFile| graded(options.seed, repeat, name, strength, &camera.settings);
    let case = Case::make(options, repeat, &capture, true, &hide)?;
    case.render(stop)?;
    let report = diagnose(options, &capture, &folder.join("diagnosis"), None, &[], stop)?;
    let verdict = serde_json::to_value(report.verdict).ok();
    let score = CurveCase {
        effect: name.to_owned(),
        strength,
        repeat,
        found: report.effects.iter().map(|e| e.name.clone()).collect(),
        verdict: verdict.and_then(|v| Some(v.as_str()?.to_owned())).unwrap_or_default(),
        gap_dn: report.gap.before,
        seconds: report.input.seconds,
    };
    if !options.keep_frames {
        // Hundreds of captures: what they are made from is their seed.
        for part in [capture, folder.join("diagnosis")] {
            fs::remove_dir_all(&part).map_err(|e| Error::io(&part, "remove", e))?;
        }
    }
    let json = serde_json::to_string_pretty(&score).expect("all keys are strings");
    write_atomic(&folder.join("score.json"), json.as_bytes())?;
    Ok(score)
}

fn read_case(folder: &Path) -> Result<Option<CurveCase>> {
    let path = folder.join("score.json");
    let Some(text) = read_if_there(&path, Limit::OWN)? else { return Ok(None) };
    let case = serde_json::from_slice(&text);
    case.map(Some)
        .map_err(|e| Error::input(&path, e.line(), e.to_string(), "a score as this program writes it"))
}

fn write(result: &CurveResult, out: &Path) -> Result<()> {
    let json = serde_json::to_string_pretty(result).expect("all keys are strings");
    write_atomic(&out.join("curves.json"), json.as_bytes())?;
    write_png_atomic(&out.join("curves.png"), &super::curve_page::chart(&result.curves)?)
}

fn summary(effects: &[(&str, Grade)], cases: &[CurveCase]) -> Vec<Curve> {
    let curve = |(name, grade): &(&str, Grade)| {
        let mut by: BTreeMap<u64, Vec<&CurveCase>> = BTreeMap::new();
        for case in cases.iter().filter(|c| c.effect == *name) {
            // Positive numbers are in the order of their bits.
            by.entry(case.strength.to_bits()).or_default().push(case);
        }
        let points: Vec<CurvePoint> = by.values().map(|cases| point(name, cases)).collect();
        let half_detected = half_detected(&points);
        Curve { effect: (*name).to_owned(), measure: grade.measure.clone(), points, half_detected }
    };
    effects.iter().map(curve).filter(|c| !c.points.is_empty()).collect()
}

fn point(name: &str, cases: &[&CurveCase]) -> CurvePoint {
    let detected = cases.iter().filter(|c| c.found.iter().any(|f| f == name)).count();
    let alone = cases.iter().filter(|c| c.found == [name]).count();
    let mut gaps: Vec<f64> = cases.iter().map(|c| c.gap_dn).collect();
    gaps.sort_by(f64::total_cmp);
    CurvePoint {
        strength: cases[0].strength,
        cases: cases.len(),
        detected,
        alone,
        rate: detected as f64 / cases.len() as f64,
        rate_ci95: wilson(detected, cases.len()),
        gap_dn: 0.5 * (gaps[(gaps.len() - 1) / 2] + gaps[gaps.len() / 2]),
    }
}

/// Wilson's 95 % interval of a share.
fn wilson(right: usize, of: usize) -> [f64; 2] {
    const Z: f64 = 1.96;
    let (n, p) = (of as f64, right as f64 / of.max(1) as f64);
    let middle = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

/// Where the rate last rises through one half, linear in the logarithm of the strength.
fn half_detected(points: &[CurvePoint]) -> Option<f64> {
    let rising = points.windows(2).rev().find(|w| w[0].rate < 0.5 && w[1].rate >= 0.5)?;
    let part = (0.5 - rising[0].rate) / (rising[1].rate - rising[0].rate);
    Some((rising[0].strength.ln() * (1.0 - part) + rising[1].strength.ln() * part).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_intervals_and_the_half_way_strength_are_counted() {
        let case = |strength: f64, found: &[&str]| CurveCase {
            effect: "defocus".to_owned(),
            strength,
            repeat: 0,
            found: found.iter().map(|f| (*f).to_owned()).collect(),
            verdict: "explained".to_owned(),
            gap_dn: strength,
            seconds: 1.0,
        };
        let cases = [
            case(0.1, &[]),
            case(0.1, &["gamma"]),
            case(1.0, &["defocus"]),
            case(1.0, &["gamma", "defocus"]),
        ];
        let curves = summary(
            &[("defocus", grade("defocus").expect("graded")), ("gamma", grade("gamma").expect("graded"))],
            &cases,
        );
        assert_eq!(curves.len(), 1, "an effect without captures has no curve");
        let points = &curves[0].points;
        assert_eq!((points[0].detected, points[0].cases, points[1].detected, points[1].alone), (0, 2, 2, 1));
        assert!((curves[0].half_detected.expect("crossed") - 0.1f64.sqrt()).abs() < 1e-12);
        assert_eq!(half_detected(&points[1..]), None);
        let [low, high] = wilson(8, 10);
        assert!((low - 0.490).abs() < 1e-3 && (high - 0.943).abs() < 1e-3, "{low} {high}");
        assert_eq!(wilson(0, 3)[0], 0.0);
    }
}
