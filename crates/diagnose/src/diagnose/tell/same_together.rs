//! Effects that only together do the same as one that was found, on any frames.

use std::collections::BTreeMap;

use crate::diagnose::report::{Parameter, Together};
use shutterbug::effects::LIST;

/// What to film to tell them apart.
pub(super) const FILM: &str = "frames with the lens capped: a black level is there still, a glare is not";

/// The most that a black level may be.
const MOST_OFFSET: f64 = 0.9;

/// A glare scales light and adds some, (1 - veil) L + veil level. So do a gain g and a black level b,
/// (1 - b) g L + b. Nothing where an effect of the `set` lies between the two, for it would tell them apart, or where
/// one of them is in the set already.
pub(super) fn same_together(name: &str, set: &[&str], parameters: &BTreeMap<String, Parameter>) -> Together {
    let number = |key: &str| parameters.get(key).and_then(|p| p.value.as_f64());
    let (Some(veil), Some(level)) = (number("veil"), number("level")) else { return Together::new() };
    let [from, to] = ["glare", "black_level"].map(place);
    let between = set.iter().any(|other| *other != name && (from..=to).contains(&place(other)));
    let offset = veil * level;
    if name != "glare" || between || offset > MOST_OFFSET {
        return Together::new();
    }
    let one = |effect: &str, key: &str, value| (effect.to_owned(), [(key.to_owned(), value)].into());
    [one("exposure_gain", "gain", (1.0 - veil) / (1.0 - offset)), one("black_level", "offset", offset)].into()
}

/// Where light meets an effect; before all of them what is wrong with the description.
fn place(name: &str) -> usize {
    LIST.iter().position(|e| e.id() == name).map_or(0, |at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
    use shutterbug::chain::{Settings, Value, View};
    use shutterbug::effects::by_id;
    use shutterbug::plane::Plane;
    use shutterbug::reference::chain;

    fn glare(veil: f64, level: f64) -> BTreeMap<String, Parameter> {
        let of = |v: f64| Parameter { value: v.into(), ci95: None, unit: String::new() };
        [("veil".to_owned(), of(veil)), ("level".to_owned(), of(level))].into()
    }

    fn seen(values: &[(&str, &str, f64)]) -> Vec<f32> {
        let mut settings = Settings::default();
        for (effect, key, value) in values {
            settings.set(by_id(effect).expect("there"), key, Value::Number(*value)).expect("in its range");
        }
        let intrinsics = Intrinsics { width: 64, height: 1, fx: 64.0, fy: 64.0, cx: 32.0, cy: 0.5 };
        let shutter = ShutterTiming {
            start_s: 0.0,
            exposure_time_s: 0.0,
            readout_time_s: 0.0,
            scan_order: ScanOrder::TopToBottom,
            line_count: 1,
        };
        let ramp = Plane::from_fn(64, 1, |x, _| [0.02 * x as f32; 4]);
        chain::values(LIST, &settings, &View { intrinsics, shutter, frame: 0, seed: 0 }, &ramp).data
    }

    #[test]
    fn a_gain_with_a_black_level_delivers_what_a_glare_does() {
        let together = same_together("glare", &["defocus", "glare", "jpeg"], &glare(0.22, 0.14));
        let (gain, offset) = (together["exposure_gain"]["gain"], together["black_level"]["offset"]);
        let one = seen(&[("glare", "veil", 0.22), ("glare", "level", 0.14)]);
        let both = seen(&[("exposure_gain", "gain", gain), ("black_level", "offset", offset)]);
        let off = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off(&one, &both) < 1e-5, "{}", off(&one, &both));
        let alone = seen(&[("black_level", "offset", offset)]);
        assert!(off(&one, &alone) > 0.05, "control: one of them is not enough");
    }

    #[test]
    fn what_lies_between_tells_them_apart() {
        for between in ["shot_noise", "flicker", "exposure_gain", "black_level"] {
            assert!(same_together("glare", &[between, "glare"], &glare(0.2, 0.3)).is_empty(), "{between}");
        }
        for other in ["vignetting", "gamma", "rolling_shutter", "scene_radiance"] {
            assert!(!same_together("glare", &[other, "glare"], &glare(0.2, 0.3)).is_empty(), "{other}");
        }
        assert!(same_together("gamma", &["gamma"], &glare(0.2, 0.3)).is_empty());
    }
}
