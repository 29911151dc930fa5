//! The lens puts rays elsewhere than a pinhole would: Brown-Conrady or the rational model as in OpenCV, the equidistant
//! fisheye (Kannala-Brandt), or the division model. Acts while the frame is rendered; the time of a line is that of the
//! sensor's line.

use crate::camera::Distortion;
use crate::chain::{Effect, Fit, Law, ParamSpec, Settings, Stage, Value};
use crate::error::{Quoted, Result};

/// The effect; its values live in [`Settings`].
pub struct LensDistortion;

const ID: &str = "lens_distortion";
const MODEL: &str = "model";
const BROWN_CONRADY: &str = "brown_conrady";
const EQUIDISTANT: &str = "equidistant";
const RATIONAL: &str = "rational";
const DIVISION: &str = "division";
/// Calibrations of narrow lenses have high powers with large coefficients; what folds is refused with the picture
/// known.
const RADIAL: (f64, f64) = (-100.0, 100.0);
const TANGENTIAL: (f64, f64) = (-1.0, 1.0);

/// Where fits begin: regular patterns have a valley at each of their steps, and a wide lens moves its corners over
/// several. With k2 = k1^2 no start folds: 1 + 3 k1 s + 5 k1^2 s^2 has no root.
const K1_STARTS: &[f64] = &[-0.4, -0.3, -0.22, -0.15, -0.08, 0.0, 0.08, 0.2];
const K2_STARTS: &[f64] = &[0.16, 0.09, 0.0484, 0.0225, 0.0064, 0.0, 0.0064, 0.04];

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::choice(
        MODEL,
        &[BROWN_CONRADY, EQUIDISTANT, RATIONAL, DIVISION],
        "brown_conrady: distorted = undistorted (1 + k1 r^2 + k2 r^4 + k3 r^6) + tangential (OpenCV); equidistant: the \
         angle from the axis becomes theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) (Kannala-Brandt); \
         rational: the radial factor of brown_conrady over 1 + k4 r^2 + k5 r^4 + k6 r^6 (OpenCV); division: \
         undistorted = distorted / (1 + k1 r^2), r of the distorted point (Fitzgibbon)",
    ),
    ParamSpec::number("k1", "", RADIAL, 0.0, "radial, on r^2 or theta^2").fit(
        Fit::by(3e-3).within(-0.6, 0.8).starts(K1_STARTS).trial(Law::Either, 0.03, 0.25).graded(1e-3, 1e-1),
    ),
    ParamSpec::number("k2", "", RADIAL, 0.0, "radial, on r^4 or theta^4")
        .fit(Fit::by(6e-3).within(-0.4, 0.8).starts(K2_STARTS).trial(Law::Follows, -0.2, 0.0)),
    ParamSpec::number("p1", "", TANGENTIAL, 0.0, "tangential, brown_conrady and rational only")
        .fit(Fit::by(1e-3).within(-0.05, 0.05).last()),
    ParamSpec::number("p2", "", TANGENTIAL, 0.0, "tangential, brown_conrady and rational only")
        .fit(Fit::by(1e-3).within(-0.05, 0.05).last()),
    ParamSpec::number("k3", "", RADIAL, 0.0, "radial, on r^6 or theta^6")
        .fit(Fit::by(1e-2).within(-0.6, 0.8).last()),
    ParamSpec::number(
        "k4",
        "",
        RADIAL,
        0.0,
        "radial, on theta^8 (equidistant) or below the line on r^2 (rational)",
    ),
    ParamSpec::number("k5", "", RADIAL, 0.0, "radial, below the line on r^4, rational only"),
    ParamSpec::number("k6", "", RADIAL, 0.0, "radial, below the line on r^6, rational only"),
];

/// The coefficients that a model does not have.
fn idle_in(model: &str) -> &'static [&'static str] {
    match model {
        EQUIDISTANT => &["p1", "p2", "k5", "k6"],
        RATIONAL => &[],
        DIVISION => &["k2", "p1", "p2", "k3", "k4", "k5", "k6"],
        _ => &["k4", "k5", "k6"],
    }
}

impl LensDistortion {
    /// The model and its coefficients; [`Distortion::None`] when the effect is off or every point stays where it is.
    pub fn distortion(settings: &Settings) -> Distortion {
        let number = |name: &str| settings.number(ID, name, 0.0);
        let distortion = match settings.choice(ID, MODEL) {
            None => Distortion::None,
            Some(EQUIDISTANT) => Distortion::Equidistant { k: ["k1", "k2", "k3", "k4"].map(number) },
            Some(RATIONAL) => Distortion::Rational {
                k: ["k1", "k2", "k3", "k4", "k5", "k6"].map(number),
                p: ["p1", "p2"].map(number),
            },
            Some(DIVISION) => Distortion::Division { k1: number("k1") },
            Some(_) => {
                Distortion::BrownConrady { k: ["k1", "k2", "k3"].map(number), p: ["p1", "p2"].map(number) }
            }
        };
        if distortion.is_identity() { Distortion::None } else { distortion }
    }

    /// Writes a lens into settings: its model and all of its coefficients. [`Distortion::None`] switches the effect
    /// off.
    ///
    /// # Errors
    /// A coefficient outside of its range.
    pub fn set(settings: &mut Settings, distortion: &Distortion) -> Result<()> {
        settings.disable(ID);
        let tangential = |p: &[f64; 2]| vec![("p1", p[0]), ("p2", p[1])];
        let (model, p, k): (_, _, &[f64]) = match distortion {
            Distortion::None => return Ok(()),
            Distortion::BrownConrady { k, p } => (BROWN_CONRADY, tangential(p), k),
            Distortion::Equidistant { k } => (EQUIDISTANT, Vec::new(), k),
            Distortion::Rational { k, p } => (RATIONAL, tangential(p), k),
            Distortion::Division { k1 } => (DIVISION, Vec::new(), std::slice::from_ref(k1)),
        };
        settings.set(&Self, MODEL, Value::Choice(model))?;
        let radial = ["k1", "k2", "k3", "k4", "k5", "k6"].into_iter().zip(k.iter().copied());
        for (name, value) in radial.chain(p) {
            settings.set(&Self, name, Value::Number(value))?;
        }
        Ok(())
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
        let model = settings.choice(ID, MODEL).unwrap_or(BROWN_CONRADY);
        let idle = idle_in(model).iter().filter_map(|name| match settings.get(ID, name) {
            Some(Value::Number(n)) if n != 0.0 => Some(format!(
                "{ID}.{name} = {} changes nothing: the model {model} has no such coefficient",
                Quoted(n)
            )),
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

    #[test]
    fn every_model_survives_the_way_into_settings_and_back() {
        let k = [0.1, -0.2, 0.3, 0.4, -0.5, 0.6];
        for lens in [
            Distortion::None,
            Distortion::BrownConrady { k: [0.1, 0.0, -0.2], p: [0.0, 0.01] },
            Distortion::Equidistant { k: [0.1, 0.0, -0.2, 0.3] },
            Distortion::Rational { k, p: [0.01, -0.02] },
            Distortion::Division { k1: -0.2 },
        ] {
            // What stood there before leaves nothing behind.
            let mut settings = Settings::default();
            LensDistortion::set(&mut settings, &Distortion::Rational { k, p: [0.5; 2] }).expect("in range");
            LensDistortion::set(&mut settings, &lens).expect("in range");
            assert_eq!(LensDistortion::distortion(&settings), lens);
            assert!(LensDistortion.check(&settings, 0.04).expect("allowed").is_empty(), "{lens:?}");
        }
        let equal = Distortion::Rational { k: [0.1, 0.2, 0.3, 0.1, 0.2, 0.3], p: [0.0; 2] };
        assert!(equal.is_identity(), "a quotient of equals");
    }
}
