//! The numbers of the flat vector of a fit: every parameter of the list of effects that has a `fit` line.

use serde::{Deserialize, Serialize};

use shutterbug::chain::{Fit, Held, ParamKind, ParamSpec, Stage};
use shutterbug::effects;

/// A number of the flat vector: a parameter, or a component of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ParameterSpec {
    /// Stem of the effect.
    pub effect: &'static str,
    /// Name of the parameter.
    pub name: &'static str,
    /// Which component of a vector; else 0.
    pub component: usize,
    /// Unit in words.
    pub unit: &'static str,
    /// What is held while the effect is off.
    pub neutral: f64,
    /// Step of numeric derivatives.
    pub step: f64,
    /// Allowed range of what is held.
    pub range: [f64; 2],
    /// What the parameter's own line says.
    pub fit: Fit,
    /// What values the parameter takes.
    pub kind: ParamKind,
}

/// How many numbers of the vector a parameter takes.
pub(crate) const fn components(spec: &ParamSpec) -> usize {
    match (spec.fit, spec.kind) {
        (None | Some(Fit { held: Held::Aside, .. }), _) => 0,
        (Some(_), ParamKind::Vector3 { .. }) => 3,
        (Some(_), _) => 1,
    }
}

const fn described(effect: &'static str, spec: &ParamSpec, fit: Fit, component: usize) -> ParameterSpec {
    let (all, neutral) = match spec.kind {
        ParamKind::Number { min, max, neutral } | ParamKind::Integer { min, max, neutral } => {
            ([min, max], neutral)
        }
        ParamKind::Choice { options, .. } => ([0.0, options.len() as f64 - 1.0], 0.0),
        ParamKind::Vector3 { max } => ([-max, max], 0.0),
    };
    let range = match fit.range {
        Some(range) => range,
        None => all,
    };
    let neutral = match fit.rest {
        Some(rest) => rest,
        None => neutral,
    };
    let (name, unit, kind, step) = (spec.name, spec.unit, spec.kind, fit.step[component]);
    ParameterSpec { effect, name, component, unit, neutral, step, range, fit, kind }
}

const COUNT: usize = {
    let (mut count, mut effect) = (0, 0);
    while effect < effects::PARAMETERS.len() {
        let specs = effects::PARAMETERS[effect].1;
        let mut i = 0;
        while i < specs.len() {
            count += components(&specs[i]);
            i += 1;
        }
        effect += 1;
    }
    count
};

/// What stands at each place of the vector: every parameter of the list of effects that has a `fit` line, in the list's
/// order.
pub(crate) const PARAMETERS: &[ParameterSpec; COUNT] = &{
    let nothing = described("", &ParamSpec::number("", "", (0.0, 0.0), 0.0, ""), Fit::by(0.0), 0);
    let (mut all, mut count, mut effect) = ([nothing; COUNT], 0, 0);
    while effect < effects::PARAMETERS.len() {
        let (stem, specs) = effects::PARAMETERS[effect];
        let mut i = 0;
        while i < specs.len() {
            let mut component = 0;
            while component < components(&specs[i]) {
                if let Some(fit) = specs[i].fit {
                    all[count] = described(stem, &specs[i], fit, component);
                }
                count += 1;
                component += 1;
            }
            i += 1;
        }
        effect += 1;
    }
    all
};

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    a.len() == b.len() && i == a.len()
}

/// The place of a parameter; compiling fails where there is none.
const fn place(effect: &str, name: &str, component: usize) -> P {
    let mut i = 0;
    while i < COUNT {
        let p = &PARAMETERS[i];
        if same(p.effect, effect) && same(p.name, name) && p.component == component {
            return P(i as u16);
        }
        i += 1;
    }
    panic!("no such parameter has a fit line")
}

/// A place in the vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u16")]
pub(crate) struct P(pub(crate) u16);

impl TryFrom<u16> for P {
    type Error = String;

    fn try_from(place: u16) -> Result<Self, String> {
        let expected = || format!("found place {place}; expected one below {COUNT}");
        PLACES.get(usize::from(place)).copied().ok_or_else(expected)
    }
}

/// All places.
pub(crate) static PLACES: [P; COUNT] = {
    let (mut all, mut i) = ([P(0); COUNT], 0);
    while i < COUNT {
        all[i] = P(i as u16);
        i += 1;
    }
    all
};

/// Places that are asked for by name.
#[allow(non_upper_case_globals)]
impl P {
    pub(crate) const Offset: P = place("time_offset", "offset_s", 0);
    pub(crate) const Readout: P = place("rolling_shutter", "readout_time_s", 0);
    pub(crate) const Exposure: P = place("motion_blur", "exposure_time_s", 0);
    pub(crate) const RotX: P = place("pose_offset", "rotvec_rad", 0);
    pub(crate) const RotY: P = place("pose_offset", "rotvec_rad", 1);
    pub(crate) const RotZ: P = place("pose_offset", "rotvec_rad", 2);
    pub(crate) const Focal: P = place("focal_length_error", "ratio", 0);
    pub(crate) const K1: P = place("lens_distortion", "k1", 0);
    pub(crate) const K2: P = place("lens_distortion", "k2", 0);
    pub(crate) const P1: P = place("lens_distortion", "p1", 0);
    pub(crate) const P2: P = place("lens_distortion", "p2", 0);
    pub(crate) const K3: P = place("lens_distortion", "k3", 0);
    pub(crate) const ScaleR: P = place("chromatic_aberration", "scale_r", 0);
    pub(crate) const ScaleB: P = place("chromatic_aberration", "scale_b", 0);
    pub(crate) const Defocus: P = place("defocus", "sigma_px", 0);
    pub(crate) const FlickerF: P = place("flicker", "frequency_hz", 0);
    pub(crate) const FlickerC: P = place("flicker", "depth", 0);
    pub(crate) const FlickerS: P = place("flicker", "phase_rad", 0);
    pub(crate) const Sharpen: P = place("sharpening", "amount", 0);
    pub(crate) const Radius: P = place("sharpening", "radius_px", 0);
    pub(crate) const Shot: P = place("shot_noise", "full_well_e", 0);
    pub(crate) const Read: P = place("read_noise", "sigma", 0);
    pub(crate) const Row: P = place("row_noise", "sigma", 0);
    pub(crate) const Dsnu: P = place("fixed_pattern_noise", "dsnu", 0);
    pub(crate) const Prnu: P = place("fixed_pattern_noise", "prnu", 0);
    pub(crate) const Hot: P = place("hot_pixels", "fraction", 0);
    pub(crate) const Quality: P = place("jpeg", "quality", 0);
    pub(crate) const Chroma: P = place("chroma_subsampling", "scheme", 0);
    pub(crate) const Bits: P = place("quantization", "bits", 0);
    pub(crate) const Mosaic: P = place("bayer_mosaic", "pattern", 0);
}

impl P {
    pub(crate) fn spec(self) -> &'static ParameterSpec {
        &PARAMETERS[usize::from(self.0)]
    }

    /// Where its effect acts.
    fn stage(self) -> Stage {
        effects::by_id(self.spec().effect).expect("from the list").stage()
    }

    /// Whether its values are tried one by one: it has no derivative.
    pub(crate) fn is_discrete(self) -> bool {
        matches!(self.spec().kind, ParamKind::Choice { .. } | ParamKind::Integer { .. })
    }

    /// Whether a new render is needed when it changes.
    pub(crate) fn is_time(self) -> bool {
        self.spec().unit == "s" && !matches!(self.stage(), Stage::Pixel(..))
    }

    /// By which part of itself it delays the picture on average: an exposure and a readout delay its middle by half.
    pub(crate) fn delays(self) -> Option<f64> {
        match self {
            P::Offset => Some(1.0),
            P::Exposure | P::Readout => Some(0.5),
            _ => None,
        }
    }

    /// Whether it moves pixels without a new render.
    pub(crate) fn is_remap(self) -> bool {
        !self.is_time() && matches!(self.stage(), Stage::SetUp | Stage::Geometry)
    }
}
