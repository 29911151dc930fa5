//! Lamps on alternating current: L (1 + depth sin(2 pi f t + phase)), t = time of the line (docs/reference/camera.md),
//! so that a rolling shutter sees bands, one every 1/f of readout. Linear radiance.
//!
//! The time of a line is the start of its exposure; with `average = "exposure"` the light is averaged over the exposure
//! instead, as a sensor does: the sine of its middle times sin(x)/x, x = pi f exposure, which is nothing where the
//! exposure is a whole number of periods. A lamp on 50 Hz flickers at 100 Hz.

use std::f64::consts::{PI, TAU};

use super::MotionBlur;
use crate::chain::{
    At, Choice, Domain, Effect, Fit, Held, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings,
    Stage, View, Work,
};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct Flicker;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number(
        "frequency_hz",
        "Hz",
        (0.0, 10_000.0),
        0.0,
        "of the brightness: twice that of the current",
    )
    .beside(&["depth"])
    .fit(
        // Not near a multiple of 30 Hz: seen by a global shutter, that is a gain and no flicker.
        Fit::by(0.05).within(1.0, 1000.0).rest(100.0).by_lines().trial(Law::Even, 96.0, 114.0),
    ),
    ParamSpec::number("depth", "", (0.0, 1.0), 0.0, "amplitude over mean brightness")
        .beside(&["frequency_hz", "phase_rad"])
        .fit(Fit::by(0.01).within(-0.9, 0.9).held(Held::Cosine).trial(Law::Up, 0.05, 0.3).graded(3e-3, 3e-1)),
    ParamSpec::number("phase_rad", "rad", (-TAU, TAU), 0.0, "at the zero of the capture's clock")
        .beside(&["depth"])
        .fit(Fit::by(0.01).within(-0.9, 0.9).held(Held::Sine).by_lines().trial(Law::Even, -3.0, 3.0)),
    ParamSpec::choice("average", &["line_start", "exposure"], "what the time of a line means")
        .beside(&["depth"]),
];

const FREQUENCY_HZ: Number = Number::of("flicker", SPECS, "frequency_hz");
const PHASE_RAD: Number = Number::of("flicker", SPECS, "phase_rad");
const DEPTH: Number = Number::of("flicker", SPECS, "depth");
const AVERAGE: Choice = Choice::of("flicker", SPECS, "average");

impl Flicker {
    /// Brightness of the light that a line sees, relative to its mean; `line` is the line's place in scan order.
    pub fn factor(settings: &Settings, view: &View, line: u32) -> f64 {
        let get = |of| settings.value(of);
        let (frequency_hz, depth) = (get(FREQUENCY_HZ), get(DEPTH));
        let shutter = &view.shutter;
        let (time_s, weight) = match settings.chosen(AVERAGE) {
            Some("exposure") if shutter.exposure_time_s > 0.0 => {
                let x = PI * frequency_hz * shutter.exposure_time_s;
                (shutter.line_middle_s(line), if x == 0.0 { 1.0 } else { x.sin() / x })
            }
            _ => (shutter.line_start_s(line), 1.0),
        };
        1.0 + depth * weight * (TAU * frequency_hz * time_s + get(PHASE_RAD)).sin()
    }
}

/// The function of the same name in `glsl/include/effects/flicker.glsl`.
fn flicker(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let (k, [x, y]) = (&at.view.intrinsics, at.pixel);
    let line = at.view.shutter.scan_order.line_of(x, y, k.width, k.height);
    let factor = p.table(0, line as usize);
    value.map(|v| factor * v)
}

fn light(p: &Parameters, view: &View, y: usize, row: &mut [f32]) {
    let (k, order) = (&view.intrinsics, view.shutter.scan_order);
    let factor = |x: usize| p.table(0, order.line_of(x as u32, y as u32, k.width, k.height) as usize);
    if order.lines_are_rows() {
        row.fill(factor(0));
    } else {
        row.iter_mut().enumerate().for_each(|(x, v)| *v = factor(x));
    }
}

impl Effect for Flicker {
    fn id(&self) -> &'static str {
        "flicker"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn shown_by(&self) -> &'static str {
        "an evenly lit wall under the same lamps for ten frames, camera at rest"
    }

    fn check(&self, settings: &Settings, _: f64) -> Result<Vec<String>> {
        let average = self.variant(settings) != 0 && settings.chosen(AVERAGE) == Some("exposure");
        let idle = average && MotionBlur::exposure_time_s(settings) == 0.0;
        let said = "flicker.average = \"exposure\" changes nothing without motion_blur.exposure_time_s";
        Ok(idle.then(|| said.to_owned()).into_iter().collect())
    }

    fn variant(&self, settings: &Settings) -> u32 {
        u32::from(settings.value(DEPTH) != 0.0)
    }

    fn moments(&self) -> Moments {
        Moments::Light(light)
    }

    fn work(&self) -> Work {
        Work::Pointwise(flicker)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        let lines = view.shutter.scan_order.line_count(view.intrinsics.width, view.intrinsics.height);
        packer.table((0..lines).map(|line| Self::factor(settings, view, line) as f32));
        packer.bits(view.shutter.scan_order as u32);
    }
}
