//! The parameters of all candidates as one flat vector, so that a fit needs to know no effect.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::report::Parameter;
use crate::camera::ScanOrder;

/// One continuous parameter of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ParameterSpec {
    /// Effect of the contract.
    pub effect: &'static str,
    /// Name of the contract.
    pub name: &'static str,
    /// Unit in words.
    pub unit: &'static str,
    /// The value that changes nothing.
    pub neutral: f64,
    /// Step of numeric derivatives: moves a typical picture by a few tenths of a px or of a DN to a few DN.
    pub step: f64,
    /// Allowed range.
    pub range: [f64; 2],
}

macro_rules! parameters {
    ($($index:ident: $effect:literal $name:literal $unit:literal, $neutral:expr, $step:expr, $lo:expr, $hi:expr;)*) => {
        /// Places in the vector.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub(super) enum P { $(#[doc = $name] $index,)* }
        /// What stands at each place.
        pub(super) const PARAMETERS: &[ParameterSpec] = &[$(ParameterSpec {
            effect: $effect, name: $name, unit: $unit, neutral: $neutral, step: $step, range: [$lo, $hi],
        },)*];
    };
}

parameters! {
    Offset: "time_offset" "offset_s" "s", 0.0, 1e-3, -0.5, 0.5;
    Readout: "rolling_shutter" "readout_time_s" "s", 0.0, 2e-3, 0.0, 0.5;
    Exposure: "motion_blur" "exposure_time_s" "s", 0.0, 2e-3, 0.0, 0.5;
    RotX: "pose_offset" "rotvec_x" "rad", 0.0, 5e-4, -0.3, 0.3;
    RotY: "pose_offset" "rotvec_y" "rad", 0.0, 5e-4, -0.3, 0.3;
    RotZ: "pose_offset" "rotvec_z" "rad", 0.0, 1e-3, -0.3, 0.3;
    Focal: "focal_length_error" "ratio" "", 1.0, 1e-3, 0.7, 1.4;
    K1: "lens_distortion" "k1" "", 0.0, 3e-3, -0.6, 0.8;
    K2: "lens_distortion" "k2" "", 0.0, 6e-3, -0.4, 0.8;
    P1: "lens_distortion" "p1" "", 0.0, 1e-3, -0.05, 0.05;
    P2: "lens_distortion" "p2" "", 0.0, 1e-3, -0.05, 0.05;
    K3: "lens_distortion" "k3" "", 0.0, 1e-2, -0.6, 0.8;
    ScaleR: "chromatic_aberration" "scale_r" "", 1.0, 1e-3, 0.97, 1.03;
    ScaleB: "chromatic_aberration" "scale_b" "", 1.0, 1e-3, 0.97, 1.03;
    Defocus: "defocus" "sigma_px" "px", 0.0, 0.1, 0.0, 8.0;
    A1: "vignetting" "a1" "", 0.0, 0.01, -1.5, 0.5;
    A2: "vignetting" "a2" "", 0.0, 0.01, -1.0, 1.5;
    Veil: "glare" "veil" "", 0.0, 0.005, 0.0, 0.8;
    Level: "glare" "level" "", 0.5, 0.02, 0.0, 1.5;
    Gain: "exposure_gain" "gain" "", 1.0, 0.01, 0.05, 20.0;
    FlickerF: "flicker" "frequency_hz" "Hz", 100.0, 0.05, 1.0, 1000.0;
    FlickerC: "flicker" "depth" "", 0.0, 0.01, -0.9, 0.9;
    FlickerS: "flicker" "phase_rad" "rad", 0.0, 0.01, -0.9, 0.9;
    Black: "black_level" "offset" "", 0.0, 0.002, -0.2, 0.4;
    WbR: "white_balance" "r" "", 1.0, 0.01, 0.2, 5.0;
    WbB: "white_balance" "b" "", 1.0, 0.01, 0.2, 5.0;
    Gamma: "gamma" "exponent" "", 1.0, 0.01, 0.3, 3.0;
    Sharpen: "sharpening" "amount" "", 0.0, 0.05, 0.0, 5.0;
    Radius: "sharpening" "radius_px" "px", 1.0, 0.1, 0.4, 5.0;
    Shot: "shot_noise" "full_well_e" "e-", 0.0, 1e-4, 0.0, 0.2;
    Read: "read_noise" "sigma" "", 0.0, 1e-3, 0.0, 0.3;
    Row: "row_noise" "sigma" "", 0.0, 1e-3, 0.0, 0.3;
    Dsnu: "fixed_pattern_noise" "dsnu" "", 0.0, 1e-3, 0.0, 0.3;
    Prnu: "fixed_pattern_noise" "prnu" "", 0.0, 1e-3, 0.0, 0.3;
    Hot: "hot_pixels" "fraction" "", 0.0, 1e-4, 0.0, 0.05;
    Quality: "jpeg" "quality" "", 0.0, 1.0, 0.0, 100.0;
    Chroma: "chroma_subsampling" "scheme" "", 0.0, 1.0, 0.0, 2.0;
    Mosaic: "bayer_mosaic" "pattern" "", 0.0, 1.0, 0.0, 4.0;
}

/// Names of the values of the parameters that are choices: 0 is off.
pub(super) const SCHEMES: [&str; 3] = ["4:4:4", "4:2:0", "4:2:2"];
/// See [`SCHEMES`].
pub(super) const PATTERNS: [&str; 5] = ["", "RGGB", "BGGR", "GRBG", "GBRG"];

/// A candidate cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CandidateSpec {
    /// Name of the contract.
    pub name: &'static str,
    /// Its parameters that every fit frees.
    pub parameters: &'static [P],
    /// Those that are freed at the end, if that helps.
    pub more: &'static [P],
    /// Needs motion to be seen.
    pub needs_motion: bool,
    /// Changes the spread of values, not their mean.
    pub noise: bool,
}

const fn candidate(name: &'static str, parameters: &'static [P]) -> CandidateSpec {
    CandidateSpec { name, parameters, more: &[], needs_motion: false, noise: false }
}

const fn moving(name: &'static str, parameters: &'static [P]) -> CandidateSpec {
    CandidateSpec { name, parameters, more: &[], needs_motion: true, noise: false }
}

const fn noise(name: &'static str, parameters: &'static [P]) -> CandidateSpec {
    CandidateSpec { name, parameters, more: &[], needs_motion: false, noise: true }
}

/// All candidates, in light-path order; set-up errors last.
pub(super) const CANDIDATES: &[CandidateSpec] = &[
    CandidateSpec { more: &[P::P1, P::P2, P::K3], ..candidate("lens_distortion", &[P::K1, P::K2]) },
    candidate("chromatic_aberration", &[P::ScaleR, P::ScaleB]),
    moving("rolling_shutter", &[P::Readout]),
    moving("motion_blur", &[P::Exposure]),
    candidate("defocus", &[P::Defocus]),
    candidate("vignetting", &[P::A1, P::A2]),
    candidate("glare", &[P::Veil, P::Level]),
    candidate("exposure_gain", &[P::Gain]),
    candidate("flicker", &[P::FlickerF, P::FlickerC, P::FlickerS]),
    candidate("bayer_mosaic", &[P::Mosaic]),
    noise("shot_noise", &[P::Shot]),
    noise("fixed_pattern_noise", &[P::Dsnu, P::Prnu]),
    noise("row_noise", &[P::Row]),
    noise("read_noise", &[P::Read]),
    noise("hot_pixels", &[P::Hot]),
    candidate("black_level", &[P::Black]),
    candidate("white_balance", &[P::WbR, P::WbB]),
    candidate("gamma", &[P::Gamma]),
    candidate("sharpening", &[P::Sharpen, P::Radius]),
    candidate("chroma_subsampling", &[P::Chroma]),
    candidate("jpeg", &[P::Quality]),
    moving("time_offset", &[P::Offset]),
    candidate("pose_offset", &[P::RotX, P::RotY, P::RotZ]),
    candidate("focal_length_error", &[P::Focal]),
];

/// The candidate of that name.
///
/// # Panics
/// If there is none.
pub(super) fn candidate_of(name: &str) -> &'static CandidateSpec {
    CANDIDATES.iter().find(|c| c.name == name).expect("names come from the list")
}

impl P {
    pub(super) fn spec(self) -> &'static ParameterSpec {
        &PARAMETERS[self as usize]
    }

    /// Whether a new render is needed when it changes.
    pub(super) fn is_time(self) -> bool {
        matches!(self, P::Offset | P::Readout | P::Exposure)
    }

    /// Whether it moves pixels without a new render.
    pub(super) fn is_remap(self) -> bool {
        (P::RotX..=P::ScaleB).contains(&self)
    }
}

/// A point in the space of all parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Theta {
    values: Vec<f64>,
    /// Which line is read first.
    pub scan_order: ScanOrder,
}

impl Theta {
    /// Everything neutral.
    pub(super) fn neutral() -> Self {
        Self { values: PARAMETERS.iter().map(|p| p.neutral).collect(), scan_order: ScanOrder::TopToBottom }
    }

    pub(super) fn get(&self, p: P) -> f64 {
        self.values[p as usize]
    }

    /// Sets a value, kept inside its range.
    pub(super) fn set(&mut self, p: P, value: f64) {
        let [lo, hi] = p.spec().range;
        self.values[p as usize] = value.clamp(lo, hi);
    }

    /// The same with one value changed.
    pub(super) fn with(&self, p: P, value: f64) -> Self {
        let mut changed = self.clone();
        changed.set(p, value);
        changed
    }

    /// Whether a parameter differs from neutral.
    pub(super) fn is_on(&self, p: P) -> bool {
        self.get(p) != p.spec().neutral
    }

    /// Whether two points differ in the parameter at that place.
    pub(super) fn differs(&self, other: &Self, place: usize) -> bool {
        self.values[place] != other.values[place]
    }

    /// Whether the parameter at that place has its neutral value.
    pub(super) fn is_neutral(&self, place: usize) -> bool {
        self.values[place] == PARAMETERS[place].neutral
    }

    /// Whether the parameter at that place moves the picture.
    pub(super) fn moves(place: usize) -> bool {
        place <= P::ScaleB as usize
    }

    /// The same with an effect taken out.
    pub(super) fn without(&self, candidate: &CandidateSpec) -> Self {
        let mut changed = self.clone();
        for &p in candidate.parameters.iter().chain(candidate.more) {
            changed.values[p as usize] = p.spec().neutral;
        }
        changed
    }

    /// The parameters of an effect as the report has them. `half` gives the half widths of 95 % intervals.
    pub(super) fn report(
        &self,
        candidate: &CandidateSpec,
        half: &BTreeMap<P, f64>,
    ) -> BTreeMap<String, Parameter> {
        let mut out = BTreeMap::new();
        let mut number = |name: &str, value: f64, ci: Option<[f64; 2]>, unit: &str| {
            let ci95 = ci.map(|[a, b]| json!([a.min(b), a.max(b)]));
            out.insert(name.to_owned(), Parameter { value: json!(value), ci95, unit: unit.to_owned() });
        };
        let around = |p: P| half.get(&p).map(|h| [self.get(p) - h, self.get(p) + h]);
        match candidate.name {
            "flicker" => {
                let (c, s) = (self.get(P::FlickerC), self.get(P::FlickerS));
                let depth = c.hypot(s);
                let wide = half.get(&P::FlickerC).map(|h| [(depth - h).max(0.0), depth + h]);
                number("depth", depth, wide, "");
                let turn = half.get(&P::FlickerS).map(|h| h / depth.max(1e-9));
                let phase = s.atan2(c);
                // Frames whose lines are all exposed at once know the frequency up to multiples of their own rate only:
                // an interval about one of these aliases would say more than is known.
                let rolls = self.is_on(P::Readout);
                let phase_ci = turn.filter(|_| rolls).map(|t| [phase - t, phase + t]);
                number("phase_rad", phase, phase_ci, "rad");
                number("frequency_hz", self.get(P::FlickerF), around(P::FlickerF).filter(|_| rolls), "Hz");
            }
            "shot_noise" => {
                let inverse = self.get(P::Shot);
                let ci = half.get(&P::Shot).map(|h| [1.0 / (inverse + h), 1.0 / (inverse - h).max(1e-7)]);
                number("full_well_e", 1.0 / inverse.max(1e-12), ci, "e-");
            }
            "pose_offset" => {
                let axes = [P::RotX, P::RotY, P::RotZ];
                let ci: Option<Vec<_>> = axes.iter().map(|&p| around(p)).collect();
                out.insert(
                    "rotvec_rad".to_owned(),
                    Parameter {
                        value: json!(axes.map(|p| self.get(p))),
                        ci95: ci.map(|ci| json!(ci)),
                        unit: "rad".to_owned(),
                    },
                );
            }
            "chroma_subsampling" | "bayer_mosaic" => {
                let p = candidate.parameters[0];
                let names: &[&str] = if p == P::Chroma { &SCHEMES } else { &PATTERNS };
                let name = names[self.get(p) as usize];
                out.insert(p.spec().name.to_owned(), word(name));
                if p == P::Mosaic {
                    out.insert("demosaic".to_owned(), word("bilinear"));
                }
            }
            _ => {
                for &p in candidate.parameters {
                    number(p.spec().name, self.get(p), around(p), p.spec().unit);
                }
                for &p in candidate.more.iter().filter(|&&p| self.is_on(p)) {
                    number(p.spec().name, self.get(p), around(p), p.spec().unit);
                }
                if candidate.name == "rolling_shutter" {
                    out.insert("scan_order".to_owned(), word(self.scan_order.name()));
                }
            }
        }
        out
    }
}

fn word(name: &str) -> Parameter {
    Parameter { value: json!(name), ci95: None, unit: String::new() }
}
