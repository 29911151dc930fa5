//! Which instants of a frame are rendered, and how each is weighed into the lines that integrate over it.
//!
//! A line with start s and exposure e delivers the mean of L(t) over `[s, s + e]` (docs/reference/camera.md,
//! `rolling_shutter` and `motion_blur`). The plan renders N pictures at equally spaced instants `t_k`, the first at the
//! first line's start and the last at the last line's end, takes L to be linear in time between neighbours and
//! integrates that exactly: the weight of instant k in a line is the mean, over the line's exposure, of the hat
//! function that is 1 at `t_k` and 0 at its neighbours. Properties, all tested:
//!
//! * the weights of a line are not negative and sum to 1;
//! * anything linear in time is integrated exactly, for e = 0 too: `sum w_k t_k = s + e/2` for every line. No line
//!   sees a bias in time, although all lines share the same instants;
//! * with e = 0 and N = line count the instants are the lines' own and each line uses one picture alone;
//! * no instant lies outside the frame, so a trajectory that just covers it suffices.
//!
//! Error, with h the spacing of the instants: at most `h^2/8 max |d2L/dt2|` (e = 0) and, averaged over an exposure of
//! several spacings, `h^2/12` times the mean of `d2L/dt2`. For content that moves by d px between instants that is
//! `d^2/8` and `d^2/12` times its second derivative per px^2: a little extra blur of variance at most `d^2/4` px^2, and
//! no shift. Weights by overlap of cells would leave a shift of up to d/2 that differs from line to line.

use super::ShutterTiming;

/// An instant to be rendered, and its share in the lines that see it.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedInstant {
    /// When, s on the capture's clock.
    pub time_s: f64,
    /// First line that sees it, counted in SCAN ORDER.
    pub first_line: u32,
    /// Weight in line `first_line + i` (scan order); at least one.
    pub weights: Vec<f32>,
}

/// The instants of one frame, in order of time. For every line the weights over all instants sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct AccumulationPlan {
    /// Those that any line sees.
    pub instants: Vec<WeightedInstant>,
}

impl AccumulationPlan {
    /// Plans at most `renders` instants over the whole frame.
    ///
    /// A frame without duration needs one. Lines that do not integrate need no more than one each, so with exposure 0
    /// `renders` above the line count is lowered to it. A single instant for a frame that lasts is its middle: that is
    /// the one case in which motion linear in time is not integrated exactly.
    ///
    /// # Panics
    /// If `renders` or the line count is 0, or a time is negative or not finite.
    pub fn new(timing: &ShutterTiming, renders: u32) -> Self {
        assert!(renders > 0, "at least one instant has to be rendered");
        assert!(timing.line_count > 0, "a picture has at least one line");
        let duration_s = duration_s(timing);
        assert!(
            duration_s.is_finite() && timing.exposure_time_s >= 0.0 && timing.readout_time_s >= 0.0,
            "{timing:?} is no interval"
        );
        let renders = renders.min(most_useful_renders(timing, duration_s));
        if renders == 1 {
            let weights = vec![1.0; timing.line_count as usize];
            return Self {
                instants: vec![WeightedInstant { time_s: timing.middle_s(), first_line: 0, weights }],
            };
        }
        let spacing_s = duration_s / f64::from(renders - 1);
        let mut instants: Vec<WeightedInstant> = (0..renders)
            .map(|k| {
                let time_s = timing.start_s + duration_s * f64::from(k) / f64::from(renders - 1);
                // Rounding must not step over the end that the trajectory was checked for.
                WeightedInstant { time_s: time_s.min(timing.end_s()), first_line: 0, weights: Vec::new() }
            })
            .collect();
        for line in 0..timing.line_count {
            // Relative to the frame's start: clocks are large numbers, spacings small ones.
            let start = timing.line_delay_s() * f64::from(line) / spacing_s;
            let end = start + timing.exposure_time_s / spacing_s;
            add_line(&mut instants, line, start, end);
        }
        instants.retain(|i| !i.weights.is_empty());
        Self { instants }
    }

    /// How many renders keep the image motion from one instant to the next at or under `step_px`, when the fastest
    /// content moves at `speed_px_per_s` (the largest over picture and frame); at most `most`. The result is lower
    /// where fewer are exact: see [`Self::new`].
    ///
    /// Measured on the development captures with 16 samples (frames 0, 5, 10, 15 of d01 and d02): steps of 2, 1,
    /// 0.5, 0.25 px differ from the path tracer by 1.07, 0.42, 0.22, 0.17 levels under a rolling shutter (an own
    /// instant for each line: 0.20) and by 0.45, 0.26, 0.23, 0.23 under motion blur (0.05 px: 0.22). 0.5 px is a good
    /// choice, less gains nothing that can be seen.
    ///
    /// # Panics
    /// If `step_px` is not positive, or `most` is 0.
    pub fn auto_renders(timing: &ShutterTiming, speed_px_per_s: f64, step_px: f64, most: u32) -> u32 {
        assert!(step_px > 0.0 && most > 0, "steps of {step_px} px, at most {most} renders");
        let duration_s = duration_s(timing);
        // The cast saturates; an unknown speed (NaN) becomes 0 there, so it is taken for unbounded instead.
        let steps = (duration_s * speed_px_per_s.abs() / step_px).ceil();
        let steps = if steps.is_nan() { u32::MAX } else { steps as u32 };
        steps.saturating_add(1).min(most).min(most_useful_renders(timing, duration_s))
    }
}

/// From the first line's start to the last line's end, s.
fn duration_s(timing: &ShutterTiming) -> f64 {
    timing.line_delay_s() * f64::from(timing.line_count - 1) + timing.exposure_time_s
}

/// More renders than this cannot bring the result nearer to the exact one.
fn most_useful_renders(timing: &ShutterTiming, duration_s: f64) -> u32 {
    if duration_s <= 0.0 {
        1
    } else if timing.exposure_time_s == 0.0 {
        timing.line_count
    } else {
        u32::MAX
    }
}

/// Adds the weights of the line that integrates over `[start, end]`, in spacings from the first instant.
fn add_line(instants: &mut [WeightedInstant], line: u32, start: f64, end: f64) {
    /// Times nearer than this many spacings are one: rounding of start and spacing stays far below, and what is cut
    /// off is a weight of the same size.
    const SAME_TIME: f64 = 1e-9;
    let last = (instants.len() - 1) as f64;
    let snap = |t: f64| if (t - t.round()).abs() < SAME_TIME { t.round() } else { t }.clamp(0.0, last);
    let (start, end) = (snap(start), snap(end));
    for k in start.floor() as usize..=(end.ceil() as usize).min(instants.len() - 1) {
        let weight = mean_of_hat(start - k as f64, end - k as f64) as f32;
        if weight > 0.0 {
            let instant = &mut instants[k];
            if instant.weights.is_empty() {
                instant.first_line = line;
            }
            // Starts and ends grow with the line, so the lines that see an instant follow one another.
            debug_assert_eq!(instant.first_line as usize + instant.weights.len(), line as usize);
            instant.weights.push(weight);
        }
    }
}

/// Mean over `[from, to]` of the hat that is 1 at 0 and 0 at -1 and 1 and beyond.
fn mean_of_hat(from: f64, to: f64) -> f64 {
    let hat = |x: f64| (1.0 - x.abs()).max(0.0);
    let (length, middle) = (to - from, 0.5 * (from + to));
    // The difference of two integrals loses digits on short intervals; there the middle is as good, unless the tip
    // lies inside, where it is off by at most a quarter of the length.
    if length < 1e-7 {
        return hat(middle);
    }
    // Integral of the hat from -1.
    let integral = |x: f64| {
        let x = x.clamp(-1.0, 1.0);
        if x < 0.0 { 0.5 * (1.0 + x) * (1.0 + x) } else { 1.0 - 0.5 * (1.0 - x) * (1.0 - x) }
    };
    (integral(to) - integral(from)) / length
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ScanOrder;

    fn timing(exposure_time_s: f64, readout_time_s: f64, line_count: u32) -> ShutterTiming {
        // A start like that of a real clock, so that lost digits show.
        ShutterTiming {
            start_s: 54_024.711_636,
            exposure_time_s,
            readout_time_s,
            scan_order: ScanOrder::TopToBottom,
            line_count,
        }
    }

    /// Sum over the instants of weight times `f(time)`, for every line.
    fn integrate(plan: &AccumulationPlan, lines: u32, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; lines as usize];
        for instant in &plan.instants {
            for (i, &w) in instant.weights.iter().enumerate() {
                sums[instant.first_line as usize + i] += f64::from(w) * f(instant.time_s);
            }
        }
        sums
    }

    /// Largest error, over the lines, of the mean time that a plan sees, s.
    fn worst_mean_time_s(plan: &AccumulationPlan, t: &ShutterTiming) -> f64 {
        let means = integrate(plan, t.line_count, |time_s| time_s - t.start_s);
        let error = |(line, mean): (usize, &f64)| (mean - (t.line_middle_s(line as u32) - t.start_s)).abs();
        means.iter().enumerate().map(error).fold(0.0, f64::max)
    }

    #[test]
    fn weights_sum_to_one_and_integrate_linear_motion_exactly() {
        for exposure_s in [0.0, 1e-12, 1e-6, 1e-4, 0.0073, 0.04] {
            for readout_s in [0.0, 1e-5, 0.0107, 0.0333, 0.5] {
                for renders in [2, 3, 7, 16, 61, 240, 1000] {
                    let t = timing(exposure_s, readout_s, 241);
                    let plan = AccumulationPlan::new(&t, renders);
                    let label = format!("exposure {exposure_s} s, readout {readout_s} s, {renders} renders");
                    for (line, sum) in integrate(&plan, 241, |_| 1.0).into_iter().enumerate() {
                        assert!((sum - 1.0).abs() < 2e-6, "{label}: weights of line {line} sum to {sum}");
                    }
                    // f32 weights carry 6e-8 each, times the frame's length.
                    let bound_s = 1e-6 * (exposure_s + readout_s) + 1e-11;
                    let worst_s = worst_mean_time_s(&plan, &t);
                    assert!(worst_s <= bound_s, "{label}: mean time off by {worst_s} s");
                    for i in &plan.instants {
                        assert!(t.start_s <= i.time_s && i.time_s <= t.end_s(), "{label}: {} s", i.time_s);
                        assert!(
                            i.weights.iter().all(|&w| (0.0..=1.0).contains(&w)),
                            "{label}: {:?}",
                            i.weights
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn nearest_instants_would_not_integrate_linear_motion() {
        // Control of the test above: the same instants with all of a line's weight on the nearest.
        let t = timing(0.0, 0.0333, 241);
        let mut plan = AccumulationPlan::new(&t, 16);
        for i in &mut plan.instants {
            i.weights.iter_mut().for_each(|w| *w = w.round());
        }
        assert!(worst_mean_time_s(&plan, &t) > 1e-3 * t.readout_time_s);
    }

    #[test]
    fn error_is_of_second_order() {
        // L = t^2: linear interpolation is off by h^2/12 L'' = h^2/6 in the mean.
        let t = timing(0.02, 0.03, 240);
        let worst = |renders: u32| {
            let plan = AccumulationPlan::new(&t, renders);
            let got = integrate(&plan, t.line_count, |time_s| (time_s - t.start_s).powi(2));
            let exact = |line: usize| {
                let s = t.line_start_s(line as u32) - t.start_s;
                ((s + 0.02).powi(3) - s.powi(3)) / (3.0 * 0.02)
            };
            got.iter().enumerate().map(|(line, g)| (g - exact(line)).abs()).fold(0.0, f64::max)
        };
        let h_s = |renders: u32| (0.02 + 0.03 * 239.0 / 240.0) / f64::from(renders - 1);
        for renders in [11, 41] {
            let in_units = worst(renders) / h_s(renders).powi(2);
            assert!((0.1..0.25).contains(&in_units), "{renders} renders: {in_units} h^2");
        }
    }

    #[test]
    fn lines_that_do_not_integrate_get_their_own_instant() {
        for renders in [240, 5000] {
            let t = timing(0.0, 0.02732, 240);
            let plan = AccumulationPlan::new(&t, renders);
            assert_eq!(plan.instants.len(), 240);
            for (line, i) in plan.instants.iter().enumerate() {
                assert_eq!((i.first_line as usize, i.weights.as_slice()), (line, &[1.0][..]));
                // The clock's own resolution at 54 000 s is 7e-12 s.
                assert!((i.time_s - t.line_start_s(line as u32)).abs() < 2e-11);
            }
        }
        // Control: one fewer, and lines share instants.
        let shared = AccumulationPlan::new(&timing(0.0, 0.02732, 240), 239);
        assert!(shared.instants.iter().any(|i| i.weights.len() > 1));
    }

    #[test]
    fn a_frame_without_duration_is_one_instant() {
        let plan = AccumulationPlan::new(&timing(0.0, 0.0, 240), 64);
        assert_eq!(plan.instants.len(), 1);
        assert_eq!(plan.instants[0].time_s, 54_024.711_636);
        assert_eq!(plan.instants[0].weights, vec![1.0; 240]);
        let one_line = AccumulationPlan::new(&timing(0.0, 0.03, 1), 64);
        assert_eq!(one_line.instants.len(), 1, "a single line without exposure has no duration");
    }

    #[test]
    fn a_global_exposure_is_the_trapezoid_rule() {
        let plan = AccumulationPlan::new(&timing(0.02, 0.0, 4), 5);
        let weights: Vec<f32> = plan.instants.iter().map(|i| i.weights[3]).collect();
        for (got, want) in weights.iter().zip([0.125, 0.25, 0.25, 0.25, 0.125]) {
            assert!((got - want).abs() < 1e-6, "{weights:?}");
        }
    }

    #[test]
    fn auto_renders_keeps_the_step() {
        let t = timing(0.01, 0.02, 240);
        let duration_s = 0.01 + 0.02 * 239.0 / 240.0;
        for (speed_px_per_s, step_px) in [(300.0, 0.5), (1000.0, 0.25), (17.0, 0.1)] {
            let n = AccumulationPlan::auto_renders(&t, speed_px_per_s, step_px, 10_000);
            let step = |n: u32| speed_px_per_s * duration_s / f64::from(n - 1);
            assert!(step(n) <= step_px && step(n - 1) > step_px, "{n} renders");
            let plan = AccumulationPlan::new(&t, n);
            let gap_s = plan.instants[1].time_s - plan.instants[0].time_s;
            assert!(gap_s * speed_px_per_s <= step_px * (1.0 + 1e-6));
        }
        assert_eq!(AccumulationPlan::auto_renders(&t, 0.0, 0.5, 100), 1, "nothing moves");
        assert_eq!(AccumulationPlan::auto_renders(&t, f64::NAN, 0.5, 100), 100, "unknown speed");
        assert_eq!(AccumulationPlan::auto_renders(&t, f64::INFINITY, 0.5, 100), 100);
        assert_eq!(AccumulationPlan::auto_renders(&timing(0.0, 0.02, 240), 1e6, 0.1, 10_000), 240);
        assert_eq!(AccumulationPlan::auto_renders(&timing(0.0, 0.0, 240), 1e6, 0.1, 10_000), 1);
    }
}
