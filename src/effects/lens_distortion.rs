//! The lens puts rays elsewhere than a pinhole would: Brown-Conrady as in OpenCV, or the equidistant fisheye
//! (Kannala-Brandt). Acts while the frame is rendered; the time of a line is that of the sensor's line.

use crate::camera::Distortion;
use crate::chain::{Effect, Fit, Law, ParamSpec, Settings, Stage, Value};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct LensDistortion;

const ID: &str = "lens_distortion";
const MODEL: &str = "model";
const EQUIDISTANT: &str = "equidistant";
/// Calibrations of narrow lenses have high powers with large coefficients; what folds is refused with the picture known.
const RADIAL: (f64, f64) = (-100.0, 100.0);
const TANGENTIAL: (f64, f64) = (-1.0, 1.0);

/// Where fits begin: regular patterns have a valley at each of their steps, and a wide lens moves its corners over several. With
/// k2 = k1^2 no start folds: 1 + 3 k1 s + 5 k1^2 s^2 has no root.
const K1_STARTS: &[f64] = &[-0.4, -0.3, -0.22, -0.15, -0.08, 0.0, 0.08, 0.2];
const K2_STARTS: &[f64] = &[0.16, 0.09, 0.0484, 0.0225, 0.0064, 0.0, 0.0064, 0.04];

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::choice(
        MODEL,
        &["brown_conrady", EQUIDISTANT],
        "brown_conrady: distorted = undistorted (1 + k1 r^2 + k2 r^4 + k3 r^6) + tangential (OpenCV); equidistant: the \
         angle from the axis becomes theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) (Kannala-Brandt)",
    ),
    ParamSpec::number("k1", "", RADIAL, 0.0, "radial, on r^2 or theta^2").fit(
        Fit::by(3e-3).within(-0.6, 0.8).starts(K1_STARTS).trial(Law::Either, 0.03, 0.25).graded(1e-3, 1e-1),
    ),
    ParamSpec::number("k2", "", RADIAL, 0.0, "radial, on r^4 or theta^4")
        .fit(Fit::by(6e-3).within(-0.4, 0.8).starts(K2_STARTS).trial(Law::Follows, -0.2, 0.0)),
    ParamSpec::number("p1", "", TANGENTIAL, 0.0, "tangential, brown_conrady only")
        .fit(Fit::by(1e-3).within(-0.05, 0.05).last()),
    ParamSpec::number("p2", "", TANGENTIAL, 0.0, "tangential, brown_conrady only")
        .fit(Fit::by(1e-3).within(-0.05, 0.05).last()),
    ParamSpec::number("k3", "", RADIAL, 0.0, "radial, on r^6 or theta^6")
        .fit(Fit::by(1e-2).within(-0.6, 0.8).last()),
    ParamSpec::number("k4", "", RADIAL, 0.0, "radial, on theta^8, equidistant only"),
];

impl LensDistortion {
    /// The model and its coefficients; [`Distortion::None`] when the effect is off or all coefficients of Brown-Conrady
    /// are zero.
    pub fn distortion(settings: &Settings) -> Distortion {
        let number = |name: &str| settings.number(ID, name, 0.0);
        let distortion = match settings.choice(ID, MODEL) {
            None => Distortion::None,
            Some(EQUIDISTANT) => Distortion::Equidistant { k: ["k1", "k2", "k3", "k4"].map(number) },
            Some(_) => {
                Distortion::BrownConrady { k: ["k1", "k2", "k3"].map(number), p: ["p1", "p2"].map(number) }
            }
        };
        if distortion.is_identity() { Distortion::None } else { distortion }
    }
}

impl Effect for LensDistortion {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn check(&self, settings: &Settings, _frame_period_s: f64) -> Result<Vec<String>> {
        let model = settings.choice(ID, MODEL).unwrap_or("brown_conrady");
        let without: &[&str] = if model == EQUIDISTANT { &["p1", "p2"] } else { &["k4"] };
        let idle = without.iter().filter_map(|name| match settings.get(ID, name) {
            Some(Value::Number(n)) if n != 0.0 => {
                Some(format!("{ID}.{name} = {n} changes nothing: the model {model} has no such coefficient"))
            }
            _ => None,
        });
        Ok(idle.collect())
    }

    fn variant(&self, settings: &Settings) -> u32 {
        // The fisheye without coefficients is no pinhole.
        u32::from(!Self::distortion(settings).is_identity())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_become_a_lens_and_idle_coefficients_are_said() {
        let mut settings = Settings::default();
        assert_eq!(LensDistortion::distortion(&settings), Distortion::None);
        settings.enable(&LensDistortion);
        assert_eq!(LensDistortion::distortion(&settings), Distortion::None, "neutral");
        let mut set =
            |name: &str, value: Value| settings.set(&LensDistortion, name, value).expect("in range");
        set("k1", Value::Number(0.1));
        set("k3", Value::Number(-0.2));
        set("p2", Value::Number(0.01));
        set("k4", Value::Number(0.3));
        let brown = Distortion::BrownConrady { k: [0.1, 0.0, -0.2], p: [0.0, 0.01] };
        assert_eq!(LensDistortion::distortion(&settings), brown);
        let said = LensDistortion.check(&settings, 0.04).expect("allowed");
        assert!(said.len() == 1 && said[0].contains("k4 = 0.3"), "{said:?}");
        settings.set(&LensDistortion, MODEL, Value::Choice(EQUIDISTANT)).expect("an option");
        let fisheye = Distortion::Equidistant { k: [0.1, 0.0, -0.2, 0.3] };
        assert_eq!(LensDistortion::distortion(&settings), fisheye);
        let said = LensDistortion.check(&settings, 0.04).expect("allowed");
        assert!(said.len() == 1 && said[0].contains("p2 = 0.01"), "{said:?}");
    }
}
