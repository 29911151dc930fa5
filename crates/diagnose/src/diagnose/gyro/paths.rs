//! When lines are exposed, from where far points are seen in neighbouring frames and how the camera turned meanwhile.

use glam::{DQuat, DVec2, DVec3};

use super::axes::{self, FURTHEST_S, MOST_LEFT, SCALE_OFF};
use super::input::Footage;
use super::step::{PLACES, Step};
use crate::diagnose::expect::linear::solve;
use crate::diagnose::search::decide::NAMED;

/// Rounds of a fit.
const ROUNDS: usize = 12;
/// Errors from so many times the usual one on count less.
const HUBER: f64 = 2.0;
/// Groups that are left out in turn for intervals, and the factor of a 95 % interval from so many (Student, 9 degrees
/// of freedom).
pub(super) const GROUPS: usize = 10;
pub(super) const STUDENT: f64 = 2.26;
/// The errors that a gyro may leave that explains the footage, px.
const MOST_LEFT_PX: f64 = 1.0;
/// By how much two clocks may differ in pace: crystals differ by 1 in 10000, and wrong axes or units ask for any.
const PACE_OFF: f64 = 0.1;
/// Errors within this of each other are no gap, px.
pub(super) const MARGIN_PX: f64 = 0.05;
/// Least motion, px from frame to frame.
const LEAST_MOTION_PX: f64 = 1.0;

/// Numbers that are fitted: middle of the exposure of row 0 (or column 0) behind the timestamp, s; time from the
/// first row to the last and from the first column to the last, s; drift of the gyro, rad/s; its scale less 1; how much
/// more of its own seconds pass in one of the frames'. The offset is that in the middle of the footage.
pub(super) const OFFSET: usize = 0;
pub(super) const ROWS: usize = 1;
pub(super) const COLUMNS: usize = 2;
const DRIFT: usize = 3;
pub(super) const SCALE: usize = 6;
/// See [`OFFSET`].
pub(super) const CLOCK: usize = 7;
pub(super) type Numbers = [f64; 8];

/// The fitted times.
pub(super) struct Timed {
    pub numbers: Numbers,
    /// Half widths of 95 % intervals.
    pub half: Numbers,
    /// Errors of held-out points, px, root mean square: with lines that are all read at the timestamp, with those
    /// times, of the times with an offset alone, and how far points move.
    pub before_px: f64,
    pub after_px: f64,
    pub offset_alone_px: f64,
    /// What displacements are known to, px, root mean square: by how much the errors of neighbouring points differ.
    pub known_px: f64,
    pub motion_px: f64,
    /// By how much content moves by the gyro's own rates, px.
    gyro_px: f64,
    /// By how much content would be misplaced at the ends of the footage if both clocks ran alike, px.
    clock_px: f64,
    /// What is wrong with its axes or unit; sought where it does not explain how the frames move.
    fault: Option<String>,
    /// By pair of frames: error before and after, px.
    pub by_pair: Vec<[f64; 2]>,
}

/// Time of a place in a frame by the gyro's clock, s.
pub(super) fn time_s(footage: &Footage, n: &Numbers, frame: usize, px: DVec2) -> f64 {
    let k = footage.intrinsics();
    let part = DVec2::new((px.x - 0.5) / f64::from(k.width), (px.y - 0.5) / f64::from(k.height));
    let [from_s, to_s] = [0, footage.frames.len() - 1].map(|f| footage.frames[f].start_s);
    let middle_s = 0.5 * (from_s + to_s);
    let at_s = footage.frames[frame].start_s + n[ROWS] * part.y + n[COLUMNS] * part.x;
    n[OFFSET] + middle_s + (at_s - middle_s) * (1.0 + n[CLOCK])
}

/// Of the gyro, rad/s.
fn drift(n: &Numbers) -> DVec3 {
    DVec3::new(n[DRIFT], n[DRIFT + 1], n[DRIFT + 2])
}

/// How fast the camera turns about its axes at a time of the gyro's clock, rad per second of the frames'.
pub(super) fn rate(footage: &Footage, n: &Numbers, time_s: f64) -> DVec3 {
    (footage.gyro.rate(time_s) * (1.0 + n[SCALE]) + drift(n)) * (1.0 + n[CLOCK])
}

/// Where a far point that is on a ray at one time is at another, by the gyro.
pub(super) fn seen(footage: &Footage, n: &Numbers, ray: DVec2, from_s: f64, to_s: f64) -> DVec2 {
    let turned = footage.gyro.between(from_s, to_s) * (1.0 + n[SCALE]) + drift(n) * (to_s - from_s);
    let then = DQuat::from_scaled_axis(-turned) * ray.extend(1.0);
    then.truncate() / then.z.max(0.05)
}

/// Errors of a pair's points, px.
fn errors(footage: &Footage, step: &Step, n: &Numbers) -> Vec<DVec2> {
    let k = footage.intrinsics();
    let focal = DVec2::new(k.fx, k.fy);
    let one = |(px, rays): (&[DVec2; 2], &[DVec2; 2])| {
        let [from_s, to_s] = [0, 1].map(|i| time_s(footage, n, step.frames[i], px[i]));
        (seen(footage, n, rays[0], from_s, to_s) - rays[1]) * focal
    };
    step.points.iter().zip(step.rays()).map(one).collect()
}

fn rms(all: impl Iterator<Item = DVec2>) -> f64 {
    let (sum, count) = all.fold((0.0, 0usize), |(s, n), d| (s + d.length_squared(), n + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// The middle length of some errors, px.
fn middle(errors: &[DVec2]) -> f64 {
    let mut all: Vec<f64> = errors.iter().map(|e| e.length()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

/// How far points move by the gyro as it is given, px from frame to frame.
fn gyro_px(footage: &Footage, steps: &[&Step]) -> f64 {
    let focal = DVec2::new(footage.intrinsics().fx, footage.intrinsics().fy);
    let moved = |s: &&Step| -> Vec<DVec2> {
        let [from_s, to_s] = s.frames.map(|f| footage.frames[f].start_s);
        let to = |ray: DVec2| (seen(footage, &Numbers::default(), ray, from_s, to_s) - ray) * focal;
        s.rays().iter().map(|rays| to(rays[0])).collect()
    };
    rms(steps.iter().flat_map(moved))
}

/// The offset of the clocks from which a fit begins: the one that leaves least.
fn start(footage: &Footage, steps: &[&Step]) -> Numbers {
    let mut best = (f64::INFINITY, Numbers::default());
    for offset_s in axes::offsets_s() {
        let mut n = Numbers::default();
        n[OFFSET] = offset_s;
        let left: Vec<DVec2> = steps.iter().flat_map(|s| errors(footage, s, &n)).collect();
        let left = middle(&left);
        if left < best.0 {
            best = (left, n);
        }
    }
    best.1
}

/// Robust least squares in some of the numbers.
fn fitted(footage: &Footage, steps: &[&Step], from: &Numbers, free: &[usize], rounds: usize) -> Numbers {
    const NUDGE: Numbers = [1e-4; 8];
    let mut n = *from;
    for _ in 0..rounds {
        let now: Vec<DVec2> = steps.iter().flat_map(|s| errors(footage, s, &n)).collect();
        let usual = middle(&now).max(1e-6);
        let slopes: Vec<Vec<DVec2>> = free
            .iter()
            .map(|&p| {
                let mut moved = n;
                moved[p] += NUDGE[p];
                let then = steps.iter().flat_map(|s| errors(footage, s, &moved));
                then.zip(&now).map(|(a, b)| (a - *b) / NUDGE[p]).collect()
            })
            .collect();
        let (mut a, mut b) = (vec![vec![0.0; free.len()]; free.len()], vec![0.0; free.len()]);
        for (i, e) in now.iter().enumerate() {
            let weight = (HUBER * usual / e.length().max(1e-12)).min(1.0);
            for p in 0..free.len() {
                (0..free.len()).for_each(|q| a[p][q] += weight * slopes[p][i].dot(slopes[q][i]));
                b[p] -= weight * slopes[p][i].dot(*e);
            }
        }
        let Some(x) = solve(&a, &b, 1e-9) else { break };
        free.iter().zip(&x).for_each(|(p, x)| n[*p] += x);
    }
    n
}

/// Fits the times of lines; nothing where frames have too little in common or hardly move.
pub(super) fn fit(footage: &Footage, steps: &[Step]) -> Option<Timed> {
    let enough = PLACES[0] * PLACES[1] / 4;
    let used: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].points.len() >= enough).collect();
    if 2 * used.len() < steps.len() || used.len() < 4 {
        return None;
    }
    let part = |odd: bool| {
        used.iter().enumerate().filter(move |(k, _)| (k % 2 == 1) == odd).map(|(_, i)| &steps[*i])
    };
    let (fit, held): (Vec<&Step>, Vec<&Step>) = (part(false).collect(), part(true).collect());
    let motion_px = rms(held.iter().flat_map(|s| s.points.iter().map(|p| p[1] - p[0])));
    let begin = start(footage, &fit);
    let rest: Vec<usize> = (DRIFT..=CLOCK).collect();
    let with =
        |times: &[usize]| -> Vec<usize> { times.iter().copied().chain(rest.iter().copied()).collect() };
    let judge = |n: &Numbers| rms(held.iter().flat_map(|s| errors(footage, s, n)));
    let alone = fitted(footage, &fit, &begin, &with(&[OFFSET]), ROUNDS);
    let rows = fitted(footage, &fit, &alone, &with(&[OFFSET, ROWS]), ROUNDS);
    let columns = fitted(footage, &fit, &alone, &with(&[OFFSET, COLUMNS]), ROUNDS);
    let (lines, first) = if judge(&rows) <= judge(&columns) { (ROWS, rows) } else { (COLUMNS, columns) };
    let free = with(&[OFFSET, lines]);
    // With all pairs for the answer; those that were held out have judged.
    let all: Vec<&Step> = used.iter().map(|i| &steps[*i]).collect();
    let numbers = fitted(footage, &all, &first, &free, ROUNDS);
    let mut neutral = first;
    [OFFSET, ROWS, COLUMNS, CLOCK].iter().for_each(|p| neutral[*p] = 0.0);
    // Its clock is not free here: before anything is found the two run alike.
    let neutral = fitted(footage, &fit, &neutral, &(DRIFT..=SCALE).collect::<Vec<_>>(), ROUNDS);
    let both = |s: &Step| [&neutral, &numbers].map(|n| rms(errors(footage, s, n).into_iter()));
    let known_px = known_px(footage, &held, &first);
    let after_px = judge(&first);
    Some(Timed {
        half: half(footage, &all, &numbers, &free),
        known_px,
        clock_px: numbers[CLOCK].abs() * 0.5 * footage.span_s() * motion_px / footage.period_s,
        fault: (after_px > MOST_LEFT * motion_px).then(|| axes::fault(footage, &all)).flatten(),
        gyro_px: gyro_px(footage, &all),
        before_px: judge(&neutral),
        after_px,
        offset_alone_px: judge(&alone),
        motion_px,
        by_pair: steps.iter().map(both).collect(),
        numbers,
    })
}

/// Half widths of 95 % intervals, by leaving out groups of pairs in turn.
fn half(footage: &Footage, all: &[&Step], numbers: &Numbers, free: &[usize]) -> Numbers {
    let groups = GROUPS.min(all.len());
    let without = |g: usize| {
        let some: Vec<&Step> =
            all.iter().enumerate().filter(|(k, _)| k % groups != g).map(|(_, s)| *s).collect();
        fitted(footage, &some, numbers, free, 4)
    };
    let left_out: Vec<Numbers> = (0..groups).map(without).collect();
    std::array::from_fn(|p| jackknife(&left_out.iter().map(|n| n[p]).collect::<Vec<_>>()))
}

/// What displacements are known to, px: errors of what was measured differ from point to point, those of a geometry
/// that is not right go smoothly over the picture.
fn known_px(footage: &Footage, steps: &[&Step], n: &Numbers) -> f64 {
    let size =
        DVec2::new(f64::from(footage.camera.intrinsics.width), f64::from(footage.camera.intrinsics.height));
    let apart = size / DVec2::new(PLACES[0] as f64, PLACES[1] as f64);
    let of = |step: &&Step| -> Vec<DVec2> {
        let errors = errors(footage, step, n);
        let beside = |k: &usize| {
            let between = (step.points[*k][0] - step.points[k - 1][0]).abs();
            between.x < 0.5 * apart.x && between.y < 1.5 * apart.y
        };
        (1..errors.len()).filter(beside).map(|k| (errors[k] - errors[k - 1]) * 0.5f64.sqrt()).collect()
    };
    rms(steps.iter().flat_map(of))
}

/// Half width of a 95 % interval from what is found when groups are left out in turn.
pub(super) fn jackknife(left_out: &[f64]) -> f64 {
    let n = left_out.len() as f64;
    let mean = left_out.iter().sum::<f64>() / n;
    STUDENT * ((n - 1.0) / n * left_out.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt()
}

impl Timed {
    /// Why the times are no answer; nothing where they are one.
    pub(super) fn doubt(&self) -> Option<String> {
        let (left_px, motion_px) = (self.after_px, self.motion_px);
        if !(motion_px >= LEAST_MOTION_PX) {
            return Some(format!(
                "the camera hardly turns: content moves {motion_px:.2} px from frame to frame"
            ));
        }
        if self.fault.is_some() {
            return self.fault.clone();
        }
        if !(self.gyro_px >= MOST_LEFT * motion_px) {
            return Some(format!(
                "the gyro hardly turns while the frames do: content moves {motion_px:.1} px from frame to frame, and \
                 {:.2} px by its rates. It may have been at rest, its unit be another (rad/s), or the scene be near",
                self.gyro_px
            ));
        }
        // Asked so that errors that are no numbers are a doubt too.
        if !(left_px <= MOST_LEFT * motion_px && left_px <= MOST_LEFT_PX) {
            return Some(format!(
                "the gyro does not explain how the frames move: content moves {motion_px:.1} px from frame to \
                frame, and points are \
                 {left_px:.2} px from where the gyro has them at best. It may be of another recording, its \
                 clock more than \
                 {FURTHEST_S} s off, its axes not the camera's, its focal length another, or the \
                 scene near"
            ));
        }
        let pace = 1.0 + self.numbers[CLOCK];
        if (pace - 1.0).abs() > PACE_OFF {
            return Some(format!(
                "the gyro explains how the frames move only if its clock runs {pace:.2} times as fast as that of the \
                 frames, and two clocks differ by far less: its axes may not be the camera's (x right, y down, z \
                 forward), or its times not in the unit of frames.csv"
            ));
        }
        if self.leaves() && self.closed() < NAMED[0] {
            return Some(format!(
                "the times of lines do not explain how the frames move: points are {left_px:.2} px from where the \
                gyro has them at best, {:.2} px if all lines are read at once, and are measured to {:.2} px. The \
                centre or the lens of camera.toml may be off, or the scene near",
                self.before_px, self.known_px
            ));
        }
        // Of the gyro's rates, not of its seconds.
        let scale = (1.0 + self.numbers[SCALE]) * (1.0 + self.numbers[CLOCK]);
        if (scale - 1.0).abs() > SCALE_OFF.max(self.half[SCALE]) {
            return Some(format!(
                "the frames turn {scale:.3} times as far as the gyro: its unit (rad/s), its scale or the \
                focal length of camera.toml is \
                 off by so much"
            ));
        }
        None
    }

    /// That the gyro's clock runs at another rate than the frames', where that is seen.
    pub(super) fn clock(&self) -> Option<String> {
        let (fast, half) = (self.numbers[CLOCK], self.half[CLOCK]);
        (fast.abs() > half && self.clock_px > MARGIN_PX).then(|| {
            let how = if fast > 0.0 { "fast" } else { "slow" };
            format!(
                "the gyro's clock runs {:.2} % (+- {:.2}) {how} against that of the frames: readout and exposure are \
                 by the frames' clock, the offset is that in the middle of the footage",
                100.0 * fast.abs(),
                100.0 * half
            )
        })
    }

    /// Whether points lie further off than they are measured to.
    pub(super) fn leaves(&self) -> bool {
        self.after_px - self.known_px > MARGIN_PX
    }

    /// Part of the gap that the times close, of what measuring allows.
    pub(super) fn closed(&self) -> f64 {
        let all = self.before_px - self.known_px.min(self.after_px);
        if all > 0.0 { ((self.before_px - self.after_px) / all).max(0.0) } else { 0.0 }
    }

    pub(super) fn is_trusted(&self) -> bool {
        self.doubt().is_none()
    }
}
