//! Automatic exposure: a controller that chooses each frame's gain from the frames before it, as cameras do. It acts
//! where frames are asked for one after another, by the gain of [`super::ExposureGain`]; linear radiance.
//!
//! Model: frame k, taken with gain g_k, is metered as delivered: m_k is the mean of its linear luminance (ITU-R BT.709,
//! from the 8-bit sRGB values, so what is clipped counts as white). Frame n answers to frame k = n - `delay_frames`,
//! because a real one is metered, computed and set while others are on their way: the gain that was wanted is g_k
//! target / m_k, and log g_n goes `speed` of the way from log g_(n-1) to it, at most `max_step_ev` (powers of two),
//! within `min_gain` to `max_gain`. The first `delay_frames` frames have `initial_gain`. With a delay and a high speed
//! it overshoots, as real ones do. No random number and no clock: the same frames give the same gains.

use std::collections::VecDeque;

use crate::chain::{Effect, Number, ParamSpec, Settings, Stage, Value};
use crate::effects::ExposureGain;
use crate::error::{Error, Result};
use crate::plane::{Plane, srgb_decode};

/// The effect; its values live in [`Settings`].
pub struct AutoExposure;

const ID: &str = "auto_exposure";
const GAIN: (f64, f64) = (1e-3, 100.0);

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("target", "", (0.0, 1.0), 0.0, "mean linear luminance that is wanted; 0: no control"),
    ParamSpec::integer(
        "delay_frames",
        "",
        (1.0, 60.0),
        "frames from the one that is metered to the one that answers",
    )
    .beside(&["target"]),
    ParamSpec::number(
        "speed",
        "",
        (0.0, 1.0),
        1.0,
        "share of the way to the wanted gain, in its logarithm, a frame",
    )
    .beside(&["target"]),
    ParamSpec::number(
        "max_step_ev",
        "powers of two",
        (0.0, 10.0),
        10.0,
        "largest change of the gain, a frame",
    )
    .beside(&["target"]),
    ParamSpec::number("min_gain", "", GAIN, 1e-3, "smallest gain").beside(&["target"]),
    ParamSpec::number("max_gain", "", GAIN, 100.0, "largest gain").beside(&["target"]),
    ParamSpec::number("initial_gain", "", GAIN, 1.0, "gain until the first frame that was metered counts")
        .beside(&["target"]),
];

const TARGET: Number = Number::of(ID, SPECS, "target");
const DELAY_FRAMES: Number = Number::of(ID, SPECS, "delay_frames");
const SPEED: Number = Number::of(ID, SPECS, "speed");
const MAX_STEP_EV: Number = Number::of(ID, SPECS, "max_step_ev");
const MIN_GAIN: Number = Number::of(ID, SPECS, "min_gain");
const MAX_GAIN: Number = Number::of(ID, SPECS, "max_gain");
const INITIAL_GAIN: Number = Number::of(ID, SPECS, "initial_gain");

impl Effect for AutoExposure {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::SetUp
    }

    fn undiagnosed(&self) -> Option<&'static str> {
        Some("its gain follows from the frames before, which a fit of single frames does not make")
    }

    fn check(&self, settings: &Settings, _frame_period_s: f64) -> Result<Vec<String>> {
        let number = |of| settings.value(of);
        let (low, high) = (number(MIN_GAIN), number(MAX_GAIN));
        if low > high {
            let what = format!("min_gain = {low} is above max_gain = {high}");
            return Err(Error::Contradiction { effect: ID, what });
        }
        let idle = number(TARGET) > 0.0 && number(SPEED) * number(MAX_STEP_EV) == 0.0;
        let said = format!("{ID} never changes the gain: speed or max_step_ev is 0");
        Ok(idle.then_some(said).into_iter().collect())
    }
}

/// The controller over one capture's frames.
#[derive(Clone, Debug, PartialEq)]
pub struct ExposureControl {
    target: f64,
    delay: usize,
    speed: f64,
    max_step: f64,
    range: (f64, f64),
    /// The same, not as logarithms.
    given_range: [f64; 2],
    initial: f64,
    /// Frame that the first entry of the two below belongs to.
    first: usize,
    /// Logarithms of the gains so far, by frame.
    log_gains: VecDeque<f64>,
    /// Metered means, by frame.
    means: VecDeque<Option<f64>>,
}

impl ExposureControl {
    /// `None` where the effect is off or has no target.
    pub fn new(settings: &Settings) -> Option<Self> {
        let number = |of| settings.value(of);
        let target = number(TARGET);
        (target > 0.0).then(|| Self {
            target,
            delay: number(DELAY_FRAMES) as usize,
            speed: number(SPEED),
            max_step: number(MAX_STEP_EV) * std::f64::consts::LN_2,
            range: (number(MIN_GAIN).ln(), number(MAX_GAIN).ln()),
            given_range: [number(MIN_GAIN), number(MAX_GAIN)],
            initial: number(INITIAL_GAIN).ln(),
            first: 0,
            log_gains: VecDeque::new(),
            means: VecDeque::new(),
        })
    }

    /// The frames that must be metered before the gain of `frame` can be asked for, and were not.
    pub fn missing(&self, frame: usize) -> impl Iterator<Item = usize> + use<'_> {
        let end = (frame + 1).saturating_sub(self.delay);
        (self.first..end).filter(|k| !self.means.get(k - self.first).is_some_and(Option::is_some))
    }

    /// Forgets what no frame from `frame` on answers to: frames before it cannot be asked for any more. A run without
    /// end takes no more memory then.
    pub fn forget_before(&mut self, frame: usize) {
        let keep = frame.saturating_sub(self.delay).max(self.first);
        // A gain is taken from the one before it.
        let keep = keep.min((self.first + self.log_gains.len()).saturating_sub(1));
        while self.first < keep {
            self.log_gains.pop_front();
            self.means.pop_front();
            self.first += 1;
        }
    }

    /// Meters a delivered picture, shape `[height, width, 3]`, 8-bit sRGB.
    pub fn meter(&mut self, frame: usize, picture: &Plane<u8>) {
        let linear: Vec<f64> = (0..256).map(|v| f64::from(srgb_decode(v as f32 / 255.0))).collect();
        let mut counts = [[0u64; 256]; 3];
        for (i, value) in picture.data.iter().enumerate() {
            counts[i % 3][usize::from(*value)] += 1;
        }
        let mean = |c: usize| (0..256).map(|v| counts[c][v] as f64 * linear[v]).sum::<f64>();
        let luminance = 0.2126 * mean(0) + 0.7152 * mean(1) + 0.0722 * mean(2);
        self.meter_mean(frame, luminance / (picture.width * picture.height).max(1) as f64);
    }

    /// The same with a mean linear luminance that is known.
    pub fn meter_mean(&mut self, frame: usize, mean: f64) {
        // Of a frame that was forgotten, nothing asks.
        let Some(at) = frame.checked_sub(self.first) else { return };
        self.means.resize(self.means.len().max(at + 1), None);
        self.means[at] = Some(mean);
    }

    /// The gain of a frame.
    ///
    /// # Panics
    /// If a frame of [`Self::missing`] was not metered, or the frame was forgotten: a bug of the caller.
    pub fn gain(&mut self, frame: usize) -> f64 {
        /// A black frame asks for no more than this; the range decides.
        const DARKEST: f64 = 1e-6;
        while self.first + self.log_gains.len() <= frame {
            let n = self.first + self.log_gains.len();
            let inside = |log: f64| log.clamp(self.range.0, self.range.1);
            let next = match n.checked_sub(self.delay) {
                None => inside(self.initial),
                Some(k) => {
                    let k = k - self.first;
                    let mean = self.means[k].expect("frames are metered before they are answered");
                    let wanted = inside(self.log_gains[k] + (self.target / mean.max(DARKEST)).ln());
                    let before = self.log_gains[self.log_gains.len() - 1];
                    let step = (self.speed * (wanted - before)).clamp(-self.max_step, self.max_step);
                    inside(before + step)
                }
            };
            self.log_gains.push_back(next);
        }
        // exp(ln(100)) is a little more than 100: the range holds for what is given out.
        let [least, most] = self.given_range;
        self.log_gains[frame - self.first].exp().clamp(least, most)
    }

    /// The settings of a frame: its gain times that of `exposure_gain`, at most the largest gain there is.
    ///
    /// # Errors
    /// None in practice: the gain lies within the range of `exposure_gain`.
    ///
    /// # Panics
    /// As [`Self::gain`].
    pub fn settings(&mut self, frame: usize, settings: &Settings) -> Result<Settings> {
        let mut out = settings.clone();
        let gain = self.gain(frame) * settings.number("exposure_gain", "gain", 1.0);
        // Both are in their range; what they come to together is at most what a sensor has.
        let gain = gain.min(GAIN.1);
        out.set(&ExposureGain, "gain", Value::Number(gain))?;
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(of: &[(&str, f64)]) -> ExposureControl {
        let mut settings = Settings::default();
        for (name, value) in of {
            settings.set(&AutoExposure, name, Value::Number(*value)).expect("in range");
        }
        ExposureControl::new(&settings).expect("a target")
    }

    /// Gains over a scene whose radiance has that mean in each frame, never clipped.
    fn gains(mut c: ExposureControl, scene: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..40)
            .map(|n| {
                let gain = c.gain(n);
                c.meter_mean(n, gain * scene(n));
                gain
            })
            .collect()
    }

    #[test]
    fn a_step_of_light_is_answered_after_the_delay_and_not_before() {
        for delay in [1, 3] {
            let light = |n: usize| if n < 10 { 0.18 } else { 0.72 };
            let got = gains(control(&[("target", 0.18), ("delay_frames", delay as f64)]), light);
            assert!(got[..10 + delay].iter().all(|g| (g - 1.0).abs() < 1e-12), "{got:?}");
            assert!((got[10 + delay] - 0.25).abs() < 1e-12, "all at once: {got:?}");
        }
    }

    #[test]
    fn speed_and_step_limit_the_way_as_the_formula_says() {
        let light = |_: usize| 0.18 * 16.0;
        let slow = gains(control(&[("target", 0.18), ("speed", 0.5)]), light);
        for (n, g) in slow.iter().enumerate().take(20) {
            // log2 g_n = -4 (1 - 2^-n).
            assert!((g.log2() + 4.0 * (1.0 - 0.5f64.powi(n as i32))).abs() < 1e-9, "{n}: {g}");
        }
        let stepped = gains(control(&[("target", 0.18), ("max_step_ev", 0.75)]), light);
        for (n, g) in stepped.iter().enumerate() {
            assert!((g.log2() + (0.75 * n as f64).min(4.0)).abs() < 1e-9, "{n}: {g}");
        }
        let limited = gains(control(&[("target", 0.18), ("min_gain", 0.2)]), light);
        assert!((limited[39] - 0.2).abs() < 1e-12, "{limited:?}");
        // A long delay at half speed overshoots; at once it does not.
        let late = gains(control(&[("target", 0.18), ("speed", 0.5), ("delay_frames", 4.0)]), light);
        let lowest = late.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((late[39].log2() + 4.0).abs() < 0.2 && lowest.log2() >= -4.0 - 1e-9, "{late:?}");
    }

    #[test]
    fn a_picture_is_metered_by_its_linear_luminance_and_settings_get_the_product() {
        let mut c = control(&[("target", 0.2)]);
        let gain = c.gain(0);
        assert!((gain - 1.0).abs() < 1e-12);
        c.meter(0, &Plane::from_fn(8, 4, |x, _| [if x < 4 { 255u8 } else { 0 }; 3]));
        let mut settings = Settings::default();
        settings.set(&ExposureGain, "gain", Value::Number(3.0)).expect("in range");
        let got = c.settings(1, &settings).expect("in range").number("exposure_gain", "gain", 1.0);
        assert!((got - 3.0 * 0.2 / 0.5).abs() < 1e-9, "half of the picture is white: {got}");
        assert_eq!(ExposureControl::new(&Settings::default()), None);
    }

    #[test]
    fn what_no_frame_answers_to_is_forgotten_and_the_gains_stay() {
        let settings = [("target", 0.18), ("speed", 0.4), ("delay_frames", 3.0)];
        let light = |n: usize| 0.1 + 0.05 * (n % 7) as f64;
        let want = gains(control(&settings), light);
        let mut c = control(&settings);
        for (n, want) in want.iter().enumerate() {
            assert_eq!(c.missing(n).next(), None);
            assert_eq!(c.gain(n), *want, "frame {n}");
            c.forget_before(n);
            c.meter_mean(n, want * light(n));
            assert!(c.log_gains.len() <= 4 && c.means.len() <= 4, "{} {}", c.log_gains.len(), c.means.len());
        }
        // Control: a frame that was not metered is missed, once it counts.
        let n = want.len();
        c.gain(n);
        assert_eq!(c.missing(n + 2).next(), None);
        assert_eq!(c.missing(n + 4).collect::<Vec<_>>(), [n, n + 1]);
    }

    #[test]
    fn contradictions_are_refused() {
        let mut settings = Settings::default();
        settings.set(&AutoExposure, "min_gain", Value::Number(4.0)).expect("in range");
        settings.set(&AutoExposure, "max_gain", Value::Number(2.0)).expect("in range");
        assert!(
            AutoExposure.check(&settings, 0.1).expect_err("crossed").to_string().contains("min_gain = 4")
        );
    }
}
